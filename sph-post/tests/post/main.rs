//! `sph-post` on run folders made by hand, with known answers.

mod folder;

use folder::{Made, SCENES, block, hydrostatic, spreading};
use formats::{exit, folder::RunFolder, results};
use std::{path::Path, process::Command};

/// What a call of the binary gave.
struct Called {
    code: Option<i32>,
    out: String,
    err: String,
}

fn post(run: &Path, more: &[&str]) -> Called {
    let output = Command::new(env!("CARGO_BIN_EXE_sph-post")).arg(run).args(more).output().unwrap();
    Called {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

fn read(run: &RunFolder, name: &str) -> Vec<f64> {
    results::read(&run.post().join("results.nc"), name).unwrap()
}

fn close(a: f64, b: f64, tolerance: f64, what: &str) {
    assert!((a - b).abs() <= tolerance * b.abs().max(1e-300), "{what}: {a}, should be {b}");
}

#[test]
fn a_block_under_its_own_weight_has_known_numbers() {
    for scene in SCENES {
        let made = Made::new(scene.text);
        let mut rows = block(&made.scene);
        hydrostatic(&made.scene, &mut rows);
        made.initial(&rows);
        let called = post(made.run.path(), &[]);
        assert_eq!(called.code, Some(exit::DONE), "{}", called.err);
        let one = |name: &str| read(&made.run, name)[0];
        let (dx, length, height) = (made.scene.spacing, 0.1, 0.1);
        let what = scene.name;
        close(one("front_furthest"), length, 0.03, what);
        close(one("front_thickness"), length, scene.round, what);
        assert!(one("front_mass") <= length && one("front_mass") > length - 1.6 * dx, "{what}");
        close(one("height_max"), height, 1e-3, what);
        close(one("height_centre"), height, 1e-3, what);
        close(one("volume_ratio"), 1.0, 1e-12, what);
        assert_eq!(one("kinetic_energy"), 0.0);
        let level = 3.0 * made.scene.h();
        close(one("basal_height"), level, 1e-12, what);
        let exact = -2600.0 * 9.81 * (height - level);
        let normal = read(&made.run, "basal_normal_stress");
        for s in &normal[..normal.len() - 2] {
            close(*s, exact, 1e-9, what);
        }
        for s in &read(&made.run, "basal_shear_stress")[..normal.len() - 2] {
            assert!(s.abs() < 1e-9 * exact.abs(), "{what}: {s}");
        }
        close(-one("basal_force"), one("weight_above"), scene.round.max(1e-9), what);
        close(one("runout_furthest") * one("r0") + one("r0"), one("front_furthest"), 1e-12, what);
    }
}

#[test]
fn everything_is_written_and_told() {
    for scene in SCENES {
        let made = Made::new(scene.text);
        spreading(&made);
        let called = post(made.run.path(), &["--basal-height", "8 mm"]);
        assert_eq!(called.code, Some(exit::DONE), "{}", called.err);
        let mut names = vec!["results.nc", "history.nc", "summary.json", "profile_final.csv"];
        let pictures = ["profiles", "time-series", "particles", "basal-stress", "top-view"];
        let of_space = &pictures[..if scene.name == "3d" { 5 } else { 4 }];
        let files: Vec<String> = of_space.iter().flat_map(|p| ["svg", "png"].map(|k| format!("{p}.{k}"))).collect();
        names.extend(files.iter().map(String::as_str));
        for name in &names {
            let path = made.run.post().join(name);
            assert!(std::fs::metadata(&path).unwrap().len() > 100, "{name}");
            assert!(called.out.lines().any(|line| line == path.display().to_string()), "{name} in {}", called.out);
        }
        assert_eq!(called.out.lines().count(), names.len(), "{}", called.out);
        let there = std::fs::read_dir(made.run.post()).unwrap().count();
        assert_eq!(there, names.len(), "nothing else is left in post/");
        for word in ["run-out", "height", "volume", "force / weight"] {
            assert!(called.err.contains(word), "{word} in {}", called.err);
        }
        // The times are those of the snapshots; the volume of the surface is that of the particles.
        let times = read(&made.run, "t");
        assert_eq!(times.len(), 11);
        assert!(times.windows(2).all(|w| w[0] < w[1]));
        let history = results::read(&made.run.post().join("history.nc"), "kinetic_energy").unwrap();
        assert_eq!(history.len(), 101);
        // Twice the same: same bits.
        let before = std::fs::read(made.run.post().join("profiles.svg")).unwrap();
        assert_eq!(post(made.run.path(), &["--basal-height", "8 mm", "--quiet"]).err, "");
        assert_eq!(before, std::fs::read(made.run.post().join("profiles.svg")).unwrap());
        if let Some(keep) = std::env::var_os("SPH_POST_KEEP") {
            let keep = Path::new(&keep).join(scene.name);
            std::fs::create_dir_all(&keep).unwrap();
            for name in names {
                std::fs::copy(made.run.post().join(name), keep.join(name)).unwrap();
            }
        }
    }
}

#[test]
fn wrong_folders_and_files_are_refused_with_one_message() {
    let refused = |run: &Path, code: i32, word: &str| {
        let called = post(run, &[]);
        assert_eq!(called.code, Some(code), "{}", called.err);
        assert!(called.err.contains(word) && called.err.starts_with("sph-post: error: "), "{}", called.err);
        assert_eq!(called.out, "");
    };
    let empty = tempfile::tempdir().unwrap();
    refused(&empty.path().join("none"), exit::NO_INPUT, "no such folder");
    refused(empty.path(), exit::NO_INPUT, "scene.lock.toml");

    let made = Made::new(SCENES[0].text);
    refused(made.run.path(), exit::NO_INPUT, "initial.hdf");
    let rows = block(&made.scene);
    made.initial(&rows);
    made.snapshot(0, 0.0, 0, &rows);
    made.snapshot(1, 0.1, 10, &rows);
    assert_eq!(post(made.run.path(), &["--quiet"]).code, Some(exit::DONE));

    // A file cut off, one of another scene, one out of order, a broken history.
    let second = made.run.snapshot(1);
    let whole = std::fs::read(&second).unwrap();
    std::fs::write(&second, &whole[..whole.len() / 2]).unwrap();
    refused(made.run.path(), exit::NO_INPUT, "snapshot-000001.hdf");
    made.snapshot(1, 0.0, 10, &rows);
    refused(made.run.path(), exit::NO_INPUT, "does not come after");
    std::fs::write(&second, &whole).unwrap();
    std::fs::write(made.run.history(), "time [s],a [1]\n1,2\n1,x\n").unwrap();
    refused(made.run.path(), exit::NO_INPUT, "line 3");
    std::fs::remove_file(made.run.history()).unwrap();
    std::fs::write(made.run.scene(), SCENES[0].text.replace("30 deg", "31 deg")).unwrap();
    refused(made.run.path(), exit::NO_INPUT, "another scene");
    std::fs::write(made.run.scene(), "space = 3").unwrap();
    refused(made.run.path(), exit::NO_INPUT, "scene.lock.toml");
    std::fs::write(made.run.scene(), SCENES[0].text).unwrap();

    // post/ can't be written where a file has its name.
    std::fs::remove_dir_all(made.run.post()).unwrap();
    std::fs::write(made.run.post(), "").unwrap();
    refused(made.run.path(), exit::CANNOT_WRITE, "post");
    assert_eq!(post(made.run.path(), &["--basal-height", "3 kg"]).code, Some(exit::USAGE));
}
