//! Scenes with obstacles as users run them: material that flows against a cylinder and over a wedge stays outside, with the same
//! bits whoever computes, and restarts without the STL files.

use formats::exit;
use formats::scene::{Scene, WallLattice};
use formats::snapshot;
use std::fs;
use tests::trial::{Trial, launch};
use tests::{WorkFolder, prepared, rasters, run, solids};

/// A column beside a pillar, before a wedge; the pillar crosses the plane of symmetry.
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
FLOOR
[body.column]
box = { min = [0, 0, "FOOT"], max = [0.2, 0.2, "TOP"] }
velocity = ["1.5 m/s", 0, 0]
[obstacle.pillar]
file = "pillar.stl"
scale = 0.001
at = ["0.34 m", 0, 0]
slip = "SLIP"
[obstacle.wedge]
file = "wedge.stl"
slip = "no-slip"
[wall.side]
axis = "y"
at = "0.24 m"
side = "below"
slip = "free-slip"
[initial]
jitter = 0.1
[end]
time = "250 ms"
[output]
snapshots = "50 ms"
history = "7 ms"
"#;
const FLOOR: &str = "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n";
const TERRAIN: &str = "[terrain]\nfile = \"ground.asc\"\nslip = \"no-slip\"\n";

fn files(work: &WorkFolder) {
    solids::prism(work, "pillar.stl", &solids::round([0.0, 0.0], 70.0, 24), [-200.0, 400.0], true);
    // Its slope, then its vertical back, down to below the floor.
    let wedge = [[0.0, 0.0], [0.0, 0.4], [-0.1, 0.4], [-0.1, 0.0]].map(|[z, y]| [0.44 - z, y - 0.1]);
    solids::prism(work, "wedge.stl", &wedge, [-0.2, 0.06], false);
    rasters::write(work, "ground.asc", [24, 16], [-0.1, -0.1], 0.05, |x, y| 0.2 - 0.3 * x + 0.03 * (9.0 * y).cos());
}

fn text(ground: &str, slip: &str) -> String {
    let [foot, top] = if ground == FLOOR { ["0 m", "0.2 m"] } else { ["0.24 m", "0.4 m"] };
    SCENE.replace("FLOOR", ground).replace("SLIP", slip).replace("FOOT", foot).replace("TOP", top)
}

fn same_bits(ground: &str, slip: &str) {
    let work = WorkFolder::new();
    files(&work);
    let text = text(ground, slip);
    let scene = Scene::read(&work.join("scene.toml").display().to_string(), &text).unwrap();
    let reference = tests::computed(&work, "one", &text, 1);
    let trial = Trial { work, reference };
    stays_outside(&trial, &scene);
    for ranks in [2, 3] {
        let folder = prepared(&trial.work, &format!("ranks-{ranks}"), &text, ranks);
        assert_eq!(fs::read(folder.initial()).unwrap(), fs::read(trial.reference.initial()).unwrap());
        trial.go(&folder, ranks, &["--always-rebalance"], exit::DONE);
        trial.same(&folder);
    }
    for name in ["pillar.stl", "wedge.stl", "ground.asc"] {
        fs::remove_file(trial.work.join(name)).unwrap();
    }
    let folder = trial.fresh("pieces");
    for (ranks, steps) in [(1, "41"), (3, "1"), (2, "57")] {
        trial.go(&folder, ranks, &["--stop-after-steps", steps], exit::RESUMABLE);
    }
    trial.go(&folder, 1, &[], exit::DONE);
    trial.same(&folder);
    run("sph-post", &[folder.path()], 0).expect(exit::DONE);
}

/// No particle deeper in an obstacle than half a spacing, at any snapshot; the mass stays, and no energy comes from nowhere.
fn stays_outside(trial: &Trial, scene: &Scene) {
    let lattice = WallLattice::new(scene);
    let (mut deepest, mut touched, mut mass) = (0.0_f64, [0; 2], None);
    for (name, _) in tests::digests(&trial.reference) {
        let (_, rows) = snapshot::read(&trial.reference.out().join(name)).unwrap();
        for x in &rows.position {
            deepest = deepest.max(lattice.inside_obstacle(*x).map_or(0.0, |inside| inside.depth));
            for (n, obstacle) in scene.obstacles.iter().enumerate() {
                touched[n] += usize::from(obstacle.solid.distance(*x, 0.02) < 0.02);
            }
        }
        let now: f64 = rows.mass.iter().sum();
        assert_eq!(now, *mass.get_or_insert(now));
    }
    let history = fs::read_to_string(trial.reference.history()).unwrap();
    let head: Vec<&str> = history.lines().next().unwrap().split(',').collect();
    let of = |name: &str| head.iter().position(|cell| cell.starts_with(name)).expect("a column of that name");
    let [kinetic, potential] = ["kinetic_energy", "potential_energy"].map(of);
    let lines: Vec<Vec<f64>> =
        history.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    let energies: Vec<f64> = lines.iter().map(|line| line[kinetic] + line[potential]).collect();
    let push = lines.iter().map(|line| line[of("force_pillar_x")]).fold(f64::NEG_INFINITY, f64::max);
    println!("deepest {deepest:.2e} m, near the obstacles {touched:?}, pushed with up to {push:.1} N, {energies:?}");
    assert!(deepest < 0.5 * scene.spacing, "{deepest} m");
    assert!(touched[0] > 50 && touched[1] > 10, "{touched:?}");
    assert!(push > 0.0, "{push} N");
    assert!(energies.windows(2).all(|pair| pair[1] < pair[0] + 0.01 * energies[0].abs()), "{energies:?}");
}

#[test]
fn the_same_bits_around_a_smooth_pillar_on_a_floor() {
    same_bits(FLOOR, "free-slip");
}

#[test]
fn the_same_bits_around_a_rough_pillar_on_a_terrain() {
    same_bits(TERRAIN, "no-slip");
}

#[test]
fn what_lies_in_an_obstacle_is_left_out_and_told() {
    let work = WorkFolder::new();
    files(&work);
    let text = text(FLOOR, "no-slip").replace("at = [\"0.34 m\", 0, 0]", "at = [\"0.1 m\", 0, 0]");
    let scene = work.write("scene.toml", &text);
    let mut starts = Vec::new();
    for ranks in [0, 3] {
        let folder = work.join(format!("run-{ranks}"));
        let output = run("sph-prep", &[scene.as_os_str(), "-o".as_ref(), folder.as_os_str()], ranks);
        // 10 layers of half a circle of 3.5 spacings: rows of 6, 6 and 4.
        assert!(output.stderr.contains("160 of its particles would lie in obstacles"), "{output}");
        assert!(output.stderr.contains("pillar: 0.14 m x 0.14 m x 0.6 m"), "{output}");
        output.expect(exit::DONE);
        starts.push(fs::read(folder.join("initial.hdf")).unwrap());
    }
    assert_eq!(starts[0], starts[1]);
    let (_, rows) = snapshot::read(&work.join("run-0/initial.hdf")).unwrap();
    let lattice = WallLattice::new(&Scene::read(&scene.display().to_string(), &text).unwrap());
    assert_eq!(rows.len(), 1000 - 160);
    assert!(rows.position.iter().all(|x| lattice.inside_obstacle(*x).is_none()), "jitter leads into none");
    let within = work.write(
        "within.toml",
        &text.replace("0.2, 0.2, \"0.2 m\"", "0.1, 0.04, \"0.2 m\"").replace("min = [0, 0,", "min = [0.06, 0,"),
    );
    let refused = run("sph-prep", &[within.as_os_str(), "-o".as_ref(), work.join("none").as_os_str()], 0);
    assert!(refused.stderr.contains("lies in obstacles with all of its 40 particles"), "{refused}");
    refused.expect(exit::USAGE);
}

#[test]
fn thin_obstacles_are_warned_of() {
    let work = WorkFolder::new();
    files(&work);
    solids::block(&work, "pillar.stl", [-15.0, -300.0, -100.0], [15.0, 300.0, 400.0]);
    let scene = work.write("scene.toml", &text(FLOOR, "no-slip"));
    let output = run("sph-prep", &[scene.as_os_str(), "-o".as_ref(), work.join("run").as_os_str()], 0);
    let words = "warning: obstacle pillar: 97 % of its surface has another side less than 2 h = 0.048 m behind it, as near as 0.03";
    assert!(output.stderr.contains(words), "{output}");
    assert!(!output.stderr.contains("obstacle wedge:"), "it is thick: {output}");
    output.expect(exit::DONE);
}

#[test]
fn a_file_that_changed_is_refused() {
    let work = WorkFolder::new();
    files(&work);
    let folder = prepared(&work, "run", &text(FLOOR, "no-slip"), 0);
    launch(&folder, 0, &["--stop-after-steps", "3"]).expect(exit::RESUMABLE);
    let copy = folder.path().join("rasters/1-wedge.stl");
    let stl = fs::read_to_string(&copy).unwrap();
    fs::write(&copy, stl.replace("0.06", "0.07")).unwrap();
    let other = run("sph-post", &[folder.path()], 0);
    assert!(other.stderr.contains("belongs to another scene"), "{other}");
    other.expect(exit::NO_INPUT);
}
