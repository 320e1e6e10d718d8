//! `sph-post` on run folders made by hand, with known answers.

mod folder;
mod report;

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
    called(command(env!("CARGO_BIN_EXE_sph-post")).arg(run).args(more))
}

/// This process runs MPI: a program that inherits its environment would take itself for the same rank.
fn command(program: &str) -> Command {
    let mut command = Command::new(program);
    for (name, _) in std::env::vars_os() {
        if name.to_str().is_some_and(|n| ["OMPI_", "PMIX_", "ORTE_", "PMI_"].iter().any(|p| n.starts_with(p))) {
            command.env_remove(name);
        }
    }
    command
}

fn called(command: &mut Command) -> Called {
    let output = command.output().unwrap();
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

/// Every file but the report, which tells when it was made.
#[test]
fn threads_change_nothing() {
    let made = Made::new(SCENES[0].text);
    spreading(&made);
    let mut files: [Vec<(String, Vec<u8>)>; 2] = Default::default();
    for (threads, files) in ["1", "4"].into_iter().zip(&mut files) {
        let called = post(made.run.path(), &["--threads", threads, "--quiet"]);
        assert_eq!(called.code, Some(exit::DONE), "{}", called.err);
        let paths = called.out.lines().filter(|path| !path.ends_with("report.html"));
        files.extend(paths.map(|path| (path.to_owned(), std::fs::read(path).unwrap())));
    }
    let [one, four] = files;
    assert!(one.len() > 40 && one.len() == four.len());
    for ((path, one), (_, four)) in one.iter().zip(&four) {
        assert!(one == four, "{path} differs");
    }
    let called = post(made.run.path(), &["--threads", "0"]);
    assert_eq!(called.code, Some(exit::USAGE));
}

#[test]
fn everything_is_written_and_told() {
    for scene in SCENES {
        let made = Made::new(scene.text);
        spreading(&made);
        let measured = made.run.path().join("measured.csv");
        std::fs::write(&measured, "curve,x_m,y_m\nfree_surface,0.05,0.06\nfree_surface,0.1,0.03\n").unwrap();
        let asked = ["--basal-height", "8 mm", "--grain-diameter", "1 mm", "--color", "pressure", "--color", "body"];
        let asked = [&asked[..], &["--reference", measured.to_str().unwrap()]].concat();
        let called = post(made.run.path(), &asked);
        assert_eq!(called.code, Some(exit::DONE), "{}", called.err);
        let drawn = std::fs::read_to_string(made.run.post().join("surfaces.svg")).unwrap();
        assert_eq!(
            drawn.matches("<circle").count(),
            2 * 2 + 1,
            "two measured points, each with its rim, and the legend"
        );
        let mut names = vec!["results.nc", "history.nc", "summary.json", "profile_final.csv", "report.html"];
        let pictures = [
            "profiles",
            "surfaces",
            "front",
            "run-out",
            "time-series",
            "energies",
            "particles",
            "particles-pressure",
            "particles-body",
            "layers-horizontal",
            "layers-vertical",
            "static",
            "static-share",
            "shear-rate",
            "inertial-number",
            "stress-sections",
            "basal-stress",
            "basal-stress-normalised",
            "top-view",
        ];
        let of_space = &pictures[..pictures.len() - usize::from(scene.name != "3d")];
        let files: Vec<String> =
            of_space.iter().flat_map(|p| ["svg", "png", "pdf"].map(|k| format!("{p}.{k}"))).collect();
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
        // It is still on its way: the front moves during the last T; the energy of the made-up history is back at zero.
        let summary = std::fs::read(made.run.post().join("summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap();
        assert_eq!(summary["kinetic_over_peak"].as_f64(), Some(0.0));
        // The made-up speed is 2 (s (1 - s))^2 at the time s.
        close(summary["peak_speed_m_s"].as_f64().unwrap(), 0.125, 1e-12, "peak speed");
        let last = summary["front_mass_last_T"].as_f64().unwrap();
        assert!(last > 0.05 && last < summary["runout_mass_99_5"].as_f64().unwrap(), "{last}");
        assert!((summary["volume_ratio"].as_f64().unwrap() - 1.0).abs() < 1e-12);
        // The energies of the made-up history add up, but for rounding: half of the potential energy is gone at the end.
        assert!(summary["energy_closure"].as_f64().unwrap().abs() < 1e-14, "{}", summary["energy_closure"]);
        let [dissipated, lost] = ["dissipated_share", "mechanical_loss_share"].map(|k| summary[k].as_f64().unwrap());
        close(dissipated, 0.5, 1e-12, "dissipated");
        close(lost, 0.5, 1e-12, "lost");
        let from_history = |name: &str| results::read(&made.run.post().join("history.nc"), name).unwrap();
        close(from_history("plastic_work")[100], 0.45, 1e-12, "plastic work");
        close(from_history("viscous_work")[100], 0.05, 1e-12, "viscous work");
        assert!(from_history("energy_closure").iter().all(|e| e.abs() < 1e-14));
        // Twice the same: same bits.
        let before = std::fs::read(made.run.post().join("profiles.svg")).unwrap();
        assert_eq!(post(made.run.path(), &[&asked[..], &["--quiet"]].concat()).err, "");
        // PDF has the pages' text as text: fonts are inside.
        let pdf = std::fs::read(made.run.post().join("profiles.pdf")).unwrap();
        assert!(pdf.starts_with(b"%PDF-") && pdf.windows(10).any(|w| w == b"/FontFile2" || w == b"/FontFile3"));
        assert!(before == std::fs::read(made.run.post().join("profiles.svg")).unwrap(), "other bytes");
        if let Some(keep) = std::env::var_os("SPH_POST_KEEP") {
            let keep = Path::new(&keep).join(scene.name);
            std::fs::create_dir_all(&keep).unwrap();
            for name in names {
                std::fs::copy(made.run.post().join(name), keep.join(name)).unwrap();
            }
        }
    }
}

/// A block under its own weight, whose outer part slides at 1 m/s down a plane that rises at 60 degrees from the toe.
#[test]
fn what_lies_inside_has_known_numbers() {
    for scene in SCENES {
        let made = Made::new(scene.text);
        let mut rows = block(&made.scene);
        hydrostatic(&made.scene, &mut rows);
        made.initial(&rows);
        let (dx, what) = (made.scene.spacing, scene.name);
        let (sin, cos) = 60_f64.to_radians().sin_cos();
        let outside = |r: f64, z: f64| (r - 0.1) * sin + z * cos;
        for (v, x) in rows.velocity.iter_mut().zip(&rows.position) {
            let speed = (0.5 + outside(x[0].hypot(x[1]), x[2]) / (4.0 * dx)).clamp(0.0, 1.0);
            *v = [speed * cos, 0.0, -speed * sin];
        }
        made.snapshot(0, 0.0, 0, &rows);
        let asked =
            ["--layers", "4", "--static-speed", "50 cm/s", "--failure-time", "1 ms", "--grain-diameter", "2 mm"];
        let called = post(made.run.path(), &asked);
        assert_eq!(called.code, Some(exit::DONE), "{}", called.err);
        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(made.run.post().join("summary.json")).unwrap()).unwrap();
        let number = |name: &str| summary[name].as_f64().unwrap();
        assert!((read(&made.run, "failure_angle")[0] - 60.0).abs() < 1.0, "{what}: {summary:#}");
        assert_eq!(number("failure_angle_deg"), read(&made.run, "failure_angle")[0]);
        assert_eq!((number("failure_time_s"), number("static_speed_m_s")), (0.0, 0.5));
        assert!(made.run.post().join("failure-plane.png").is_file() && called.err.contains("failure plane"));
        close(read(&made.run, "failure_top_speed")[0], 1.0, 1e-9, what);
        // The surface of a tenth of the top speed, and that of half of it, are 1.6 spacings apart.
        let surface = read(&made.run, "failure_surface");
        for j in [4, 8, 12] {
            let z = (f64::from(j) + 0.5) * dx;
            let distance = outside(surface[j as usize], z);
            assert!((distance + 1.6 * dx).abs() < 0.5 * dx, "{what} {j}: {} spacings", distance / dx);
        }
        let bins = read(&made.run, if scene.name == "plane-strain" { "x" } else { "r" });
        let still = read(&made.run, "static_height");
        for k in [bins.len() / 2, 2 * bins.len() / 3] {
            let distance = outside(bins[k], still[k]);
            assert!(distance.abs() < 0.5 * dx, "{what} {k}: {} spacings", distance / dx);
        }
        let tops = read(&made.run, "layer_top");
        for (n, tops) in tops.chunks(bins.len()).enumerate() {
            close(tops[bins.len() / 2], 0.025 * (n + 1) as f64, 0.05, what);
        }
        assert_eq!((tops.len(), read(&made.run, "layer").len()), (4 * bins.len(), 4));
        let stress = read(&made.run, "section_stress_zz");
        let z = read(&made.run, "z");
        for j in 0..z.len() - 1 {
            close(stress[j * bins.len() + bins.len() / 2], -2600.0 * 9.81 * (0.1 - z[j]), 1e-9, what);
        }
        let top_of_scale = stress.iter().copied().filter(|s| s.is_finite()).fold(0.0, f64::min);
        close(top_of_scale, -2600.0 * 9.81 * (0.1 - z[0]), 1e-6, what);
        // Across the plane the speed grows by 1 m/s in 4 spacings, all of it shear; in 3-D it is along x, whatever the angle.
        let (rate, inertial) = (read(&made.run, "section_shear_rate"), read(&made.run, "section_inertial_number"));
        let inside = |c: usize| {
            let (r, z) = (bins[c % bins.len()], z[c / bins.len()]);
            r > 0.02 && z < 0.08 && (outside(r, z) / dx).abs() < 0.2
        };
        let within: Vec<usize> = (0..rate.len()).filter(|c| scene.name != "3d" && inside(*c)).collect();
        assert!(within.len() > 3 || scene.name == "3d", "{what}");
        for c in within {
            assert!((rate[c] * 4.0 * dx - 1.0).abs() < 0.1, "{what}: {} of {}", rate[c], 0.25 / dx);
            let pressure = made.scene.gravity[2].abs() * 2600.0 * (0.1 - z[c / bins.len()]) * 13.0 / 21.0;
            let expected = rate[c] * 0.002 / (pressure / 2600.0).sqrt();
            close(inertial[c], expected, 0.02, what);
        }
        // There is no history, nor a column that says what work was done.
        assert!(summary["energy_closure"].is_null() && !made.run.post().join("energies.png").exists());
        assert_eq!((number("stray_particles"), number("runout_effective")), (0.0, number("runout_thickness")));
    }
}

#[test]
fn histories_of_older_runs_are_read_too() {
    let made = Made::new(SCENES[0].text);
    made.initial(&block(&made.scene));
    let text = "time [s],step [1],kinetic_energy [J],potential_energy [J],elastic_energy [J]\n0,0,0,2,0\n1,9,1,0.5,0\n";
    made.history(text);
    let called = post(made.run.path(), &["--quiet"]);
    assert_eq!((called.code, called.err.as_str()), (Some(exit::DONE), ""));
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(made.run.post().join("summary.json")).unwrap()).unwrap();
    assert!(summary.get("energy_closure").is_none() && summary.get("dissipated_share").is_none());
    assert_eq!(summary["mechanical_loss_share"].as_f64(), Some(0.25));
    assert!(summary["peak_speed_m_s"].is_null(), "{}", summary["peak_speed_m_s"]);
    let history = made.run.post().join("history.nc");
    assert!(results::read(&history, "plastic_work").is_err() && results::read(&history, "kinetic_energy").is_ok());
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
    made.history("time [s],a [1]\n1,2\n1,x\n");
    refused(made.run.path(), exit::NO_INPUT, "line 3");
    std::fs::write(made.run.history_piece(2), "time [s],a [1]\n1,2\n1,3\n").unwrap();
    refused(made.run.path(), exit::NO_INPUT, "000002.csv");
    made.history("time [s],a [1]\n1,2\n2,3\n");
    std::fs::write(made.run.scene(), SCENES[0].text.replace("30 deg", "31 deg")).unwrap();
    refused(made.run.path(), exit::NO_INPUT, "another scene");
    std::fs::write(made.run.scene(), "space = 3").unwrap();
    refused(made.run.path(), exit::USAGE, "scene.lock.toml");
    std::fs::write(made.run.scene(), SCENES[0].text).unwrap();

    // post/ can't be written where a file has its name.
    std::fs::remove_dir_all(made.run.post()).unwrap();
    std::fs::write(made.run.post(), "").unwrap();
    refused(made.run.path(), exit::CANNOT_WRITE, "post");
    assert_eq!(post(made.run.path(), &["--basal-height", "3 kg"]).code, Some(exit::USAGE));
}

#[test]
fn of_several_ranks_one_works_and_speaks() {
    let made = Made::new(SCENES[1].text);
    made.initial(&block(&made.scene));
    let alone = post(made.run.path(), &[]);
    assert_eq!(alone.code, Some(exit::DONE), "{}", alone.err);
    let read = || std::fs::read(made.run.post().join("summary.json")).unwrap();
    let files = || std::fs::read_dir(made.run.post()).unwrap().count();
    let before = (read(), files());
    let mpirun = |run: &Path| {
        let mut command = command("mpirun");
        command.args(["-n", "3", env!("CARGO_BIN_EXE_sph-post")]).arg(run);
        for name in ["OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"] {
            command.env(name, "1");
        }
        called(command.env("OMPI_MCA_hwloc_base_binding_policy", "none"))
    };
    let three = mpirun(made.run.path());
    assert_eq!((three.code, &three.out), (Some(exit::DONE), &alone.out), "{}", three.err);
    assert_eq!(three.err.matches("snapshots, particles").count(), 1, "{}", three.err);
    assert_eq!((read(), files()), before);
    std::fs::write(made.run.scene(), "space = 3").unwrap();
    let refused = mpirun(made.run.path());
    assert_eq!((refused.code, refused.out.as_str()), (Some(exit::USAGE), ""), "{}", refused.err);
    assert_eq!(refused.err.matches("sph-post: error: ").count(), 1, "{}", refused.err);
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let made = Made::new(SCENES[1].text);
    made.initial(&block(&made.scene));
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut command = command(env!("CARGO_BIN_EXE_sph-post"));
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    assert_eq!(called(command.arg(made.run.path()).stdout(writer).stderr(full())).code, Some(exit::DONE));
    assert!(made.run.post().join("results.nc").is_file());
}

#[test]
fn run_outs_are_given_only_where_fronts_say_how_far_the_body_ran() {
    let plane = SCENES[1].text;
    let held = "[wall.left]\naxis = \"x\"\nat = \"0 m\"\nside = \"above\"\nslip = \"no-slip\"\n[end]";
    let free = plane.replace("symmetry = [\"x\"]", "");
    let body = |shape: &str| {
        let begin = plane.find("box =").unwrap();
        let end = begin + plane[begin..].find('\n').unwrap();
        let wall = plane.replace("symmetry = [\"x\"]", "").replace("[end]", held);
        wall.replace(&plane[begin..end], shape)
    };
    let wedge = |x: &str, falls: &str| {
        body(&format!("wedge = {{ corner = [{x}, 0, 0], size = [\"0.1 m\", 0, \"0.1 m\"], falls = \"{falls}\" }}"))
    };
    for (text, given) in [
        (plane.to_string(), true),
        (free.clone(), false),
        (free.replace("[end]", held), true),
        (body("box = { min = [0.2, 0, 0], max = [0.3, 0, 0.1] }"), false),
        (wedge("0", "right"), true),
        (wedge("0.1", "left"), false),
    ] {
        let made = Made::new(text.leak());
        made.initial(&block(&made.scene));
        let called = post(made.run.path(), &["--quiet"]);
        assert_eq!(called.code, Some(exit::DONE), "{}", called.err);
        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(made.run.post().join("summary.json")).unwrap()).unwrap();
        for name in ["furthest", "mass", "thickness"] {
            assert!(read(&made.run, &format!("front_{name}"))[0] > 0.0);
            assert_eq!(read(&made.run, &format!("runout_{name}"))[0].is_nan(), !given, "{name}");
        }
        for name in ["runout_furthest", "runout_mass_99_5", "runout_thickness"] {
            assert_eq!(summary[name].is_null(), !given, "{summary:#}");
        }
        assert!(summary["r0_m"].is_number() && summary["front_mass_last_T"].is_null());
    }
}
