//! Scenes with a terrain as users run them: the same bits whoever computes, restarts without the rasters, and rasters that
//! changed or are damaged.

use formats::exit;
use std::fs;
use tests::trial::{Trial, launch};
use tests::{WorkFolder, prepared, rasters, run};

/// A smooth side wall, a plane of symmetry, and a ground of many slopes.
const SCENE: &str = r#"
space = "3d"
spacing = "20 mm"
symmetry = ["y"]
[material.drucker-prager]
density = "1600 kg/m3"
young = "0.4 MPa"
poisson = 0.3
friction = "25 deg"
cohesion = "0 Pa"
[terrain]
file = "ground.asc"
origin = [10, 20, 5]
slip = "SLIP"
[body.slab]
release = { polygon = [[0.1, -1], [0.3, -1], [0.3, 0.15], [0.1, 0.15]], thickness = "0.09 m" }
velocity = ["1 m/s", "-0.3 m/s", 0]
[wall.side]
axis = "x"
at = "0.4 m"
side = "below"
slip = "free-slip"
[initial]
stress = "hydrostatic"
jitter = 0.1
[end]
time = "150 ms"
[output]
snapshots = "50 ms"
history = "7 ms"
"#;

fn ground(work: &WorkFolder) {
    let height = |x: f64, y: f64| 5.0 + 0.3 * (10.5 - x) + 0.02 * (31.0 * x).sin() * (23.0 * y).cos();
    rasters::write(work, "ground.asc", [24, 16], [9.9, 19.9], 0.03, height);
}

fn same_bits(slip: &str) {
    let work = WorkFolder::new();
    ground(&work);
    let text = SCENE.replace("SLIP", slip);
    let reference = tests::computed(&work, "one", &text, 1);
    let trial = Trial { work, reference };
    for ranks in [2, 3] {
        let folder = prepared(&trial.work, &format!("ranks-{ranks}"), &text, ranks);
        assert_eq!(fs::read(folder.initial()).unwrap(), fs::read(trial.reference.initial()).unwrap());
        trial.go(&folder, ranks, &["--always-rebalance"], exit::DONE);
        trial.same(&folder);
    }
    // Elsewhere, where the raster is not: the run folder has its own.
    fs::remove_file(trial.work.join("ground.asc")).unwrap();
    let folder = trial.fresh("pieces");
    for (ranks, steps) in [(1, "41"), (3, "1"), (2, "57")] {
        trial.go(&folder, ranks, &["--stop-after-steps", steps], exit::RESUMABLE);
    }
    trial.go(&folder, 1, &[], exit::DONE);
    trial.same(&folder);
}

#[test]
fn the_same_bits_on_a_rough_terrain() {
    same_bits("no-slip");
}

#[test]
fn the_same_bits_on_a_smooth_terrain() {
    same_bits("free-slip");
}

#[test]
fn a_raster_that_changed_is_refused() {
    let work = WorkFolder::new();
    ground(&work);
    let text = SCENE.replace("SLIP", "no-slip");
    let folder = prepared(&work, "run", &text, 0);
    launch(&folder, 0, &["--stop-after-steps", "3"]).expect(exit::RESUMABLE);
    // Beside a scene that may change otherwise.
    let longer = work.write("longer.toml", &text.replace("150 ms", "160 ms"));
    let raster = fs::read_to_string(work.join("ground.asc")).unwrap();
    fs::write(work.join("ground.asc"), raster.replacen('5', "6", 40)).unwrap();
    let refused = run("sph-run", &[folder.path().as_os_str(), "--scene".as_ref(), longer.as_os_str()], 0);
    assert!(refused.stderr.contains("ground.asc is not what it was when the run was made"), "{refused}");
    refused.expect(exit::USAGE);
    fs::write(work.join("ground.asc"), &raster).unwrap();
    run("sph-run", &[folder.path().as_os_str(), "--scene".as_ref(), longer.as_os_str()], 2).expect(exit::DONE);
    // The copy in the run folder.
    let copy = folder.path().join("rasters/0-ground.asc");
    fs::write(&copy, raster.replacen('5', "6", 40)).unwrap();
    let other = run("sph-post", &[folder.path()], 0);
    assert!(other.stderr.contains("belongs to another scene"), "{other}");
    other.expect(exit::NO_INPUT);
    fs::remove_file(&copy).unwrap();
    let gone = run("sph-post", &[folder.path()], 0);
    assert!(gone.stderr.contains("0-ground.asc: No such file"), "{gone}");
    gone.expect(exit::USAGE);
}

#[test]
fn a_raster_that_is_not_there_is_one_error_on_any_number_of_ranks() {
    let work = WorkFolder::new();
    let scene = work.write("scene.toml", &SCENE.replace("SLIP", "no-slip"));
    for ranks in [0, 3] {
        let run_folder = work.join("run");
        let refused = run("sph-prep", &[scene.as_os_str(), "-o".as_ref(), run_folder.as_os_str()], ranks);
        assert!(refused.stderr.contains("scene.toml:12:8: terrain.file: "), "{refused}");
        assert_eq!(refused.stderr.matches("ground.asc: No such file").count(), 1, "{refused}");
        assert!(!run_folder.exists());
        refused.expect(exit::USAGE);
    }
}
