//! Columns that collapse: rows G5, G6 and G8 of the list of verification problems.

use crate::{AS_YANG, Scene, history, last, wall};
use formats::snapshot;
use tests::{WorkFolder, computed};

const GRAVITY: f64 = 9.81;

/// Largest error of kinetic and potential energy and the work of stress and viscosity, over the potential energy at the start;
/// and the most that plastic work ever falls between two lines.
fn closure(slip: &str, kind: &str, numerics: &'static str, spacing: f64) -> (f64, f64) {
    let scene = Scene {
        spacing,
        symmetry: "[\"x\"]",
        body: "box = { min = [0, 0, 0], max = [0.1, 0, 0.1] }",
        walls: wall("floor", "z", 0.0, "above", slip) + &format!("kind = \"{kind}\"\n"),
        numerics,
        end: 0.3,
        history: 0.002,
        ..Scene::default()
    };
    let work = WorkFolder::new();
    let folder = computed(&work, "run", &scene.text(), 0);
    let [kinetic, potential, stress, viscous, elastic] =
        ["kinetic_energy", "potential_energy", "stress_work", "viscous_work", "elastic_energy"]
            .map(|name| history(&folder, name));
    let sum = |k: usize| kinetic[k] + potential[k] + stress[k] + viscous[k];
    let lines = 0..kinetic.len();
    let off = lines.clone().map(|k| (sum(k) - sum(0)).abs()).fold(0.0, f64::max) / potential[0];
    let plastic = |k: usize| stress[k] - elastic[k];
    let falls = lines.skip(1).map(|k| plastic(k - 1) - plastic(k)).fold(0.0, f64::max) / potential[0];
    println!("G5 {slip} {kind} {numerics:?} {spacing} m: {off:.2e}; plastic work falls by {falls:.1e}");
    (off, falls)
}

/// G5: the account of energies closes, and plastic work is never given back.
///
/// Operators and a mirror that slips, as a plane of symmetry, are work-conjugate: what is left there is the time step's. Walls
/// that stick, and all that extrapolate, keep the stress and turn the velocity; they do a little work of their own,
/// whatever the step, which falls with the spacing and with the swings of the stress that a viscosity holds down.
#[test]
fn g5_energies_add_up() {
    for (slip, kind, numerics, spacing, most) in [
        // The row's 1e-3, as Yang et al. have it, with twenty spacings. Measured 8.7e-4; with a scene's defaults 2.2e-3.
        ("no-slip", "virtual", AS_YANG, 0.005, 1e-3),
        ("no-slip", "virtual", "", 0.005, 4e-3),
        // Half as many: measured 2.1e-3 and 3.3e-3.
        ("no-slip", "virtual", AS_YANG, 0.01, 3e-3),
        ("no-slip", "virtual", "", 0.01, 5e-3),
        // Measured 1.4e-4; with a scene's defaults 4.2e-4, for it goes as the step; 5.9e-4 and 6.8e-5.
        ("free-slip", "mirror", AS_YANG, 0.01, 2e-4),
        ("free-slip", "mirror", "", 0.01, 8e-4),
        ("free-slip", "mirror", "viscosity = 0\ndensity-gate = 0\ncourant = 1", 0.01, 7e-4),
        ("free-slip", "mirror", "viscosity = 0\ncourant = 0.15", 0.01, 2e-4),
        // Measured 7.3e-3 and 9.7e-3: the row's 1e-3 does not hold.
        // A mirror that sticks wants the viscosity: 7.2e-2 with the defaults of sand.
        ("no-slip", "virtual", "viscosity = 0", 0.01, 0.02),
        ("no-slip", "mirror", AS_YANG, 0.01, 0.02),
    ] {
        let (off, falls) = closure(slip, kind, numerics, spacing);
        assert!(off < most, "{slip} {kind} {numerics}: {off}");
        // Rounding of the return to the cone aside. Measured 0.
        assert!(falls < 1e-6, "{slip} {kind} {numerics}: {falls}");
    }
}

/// Largest distance of the top from H - g t^2/2 up to t = 0.8 sqrt(H/g), over H.
fn late(space: &'static str, spacing: f64) -> f64 {
    let height = 0.8;
    let unit = f64::sqrt(height / GRAVITY);
    let mut scene = Scene {
        space,
        spacing,
        symmetry: "[\"x\"]",
        body: "box = { min = [0, 0, 0], max = [0.1, 0, 0.8] }",
        walls: wall("floor", "z", 0.0, "above", "no-slip"),
        end: 0.8 * unit,
        history: 0.05 * unit,
        ..Scene::default()
    };
    if space == "axisymmetric" {
        (scene.symmetry, scene.body) = ("[]", "cylinder = { radius = 0.1, height = 0.8 }");
    }
    let work = WorkFolder::new();
    let folder = computed(&work, "run", &scene.text(), 0);
    let (time, top) = (history(&folder, "time"), history(&folder, "height"));
    let off = |(t, z): (&f64, &f64)| (z - height + 0.5 * GRAVITY * t * t).abs() / height;
    let worst = time.iter().zip(&top).map(off).fold(0.0, f64::max);
    println!("G6 {space}, {spacing} m: {worst:.2e}");
    worst
}

/// G6: the top of a column of a = 8 falls freely: what holds it back comes up from the floor.
#[test]
fn g6_the_top_of_a_tall_column() {
    // Measured 1e-4.
    assert!(late("axisymmetric", 0.0125) < 1e-3);
    // In the plane more of it is held. The row's 1 %: measured 0.83 %, and 1.4 % with half as many particles.
    assert!(late("plane-strain", 0.00625) < 0.01);
}

/// G8: a cylinder on a square lattice stays symmetric about four planes, but for rounding, which grows as the flow mixes.
#[test]
fn g8_a_cylinder_keeps_the_symmetry_of_its_lattice() {
    let scene = Scene {
        space: "3d",
        spacing: 0.02,
        body: "cylinder = { radius = 0.1, height = 0.1 }",
        walls: wall("floor", "z", 0.0, "above", "no-slip"),
        end: 0.3,
        ..Scene::default()
    };
    let work = WorkFolder::new();
    let folder = computed(&work, "run", &scene.text(), 0);
    let (_, start) = snapshot::read(&folder.initial()).expect("the start can be read");
    let (header, end) = last(&folder);
    let cell = |x: [f64; 3]| x.map(|x| (x / (0.5 * header.spacing)).round() as i64);
    let places: std::collections::HashMap<_, _> =
        start.position.iter().enumerate().map(|(i, &x)| (cell(x), i)).collect();
    let mirrors: [fn([f64; 3]) -> [f64; 3]; 3] =
        [|x| [-x[0], x[1], x[2]], |x| [x[0], -x[1], x[2]], |x| [x[1], x[0], x[2]]];
    let mut worst = 0.0_f64;
    for mirror in mirrors {
        for (i, &x) in start.position.iter().enumerate() {
            let (image, wanted) = (end.position[places[&cell(mirror(x))]], mirror(end.position[i]));
            worst = (0..3).map(|a| (image[a] - wanted[a]).abs() / header.spacing).fold(worst, f64::max);
        }
    }
    let front = |x: &[f64; 3]| x[0].hypot(x[1]);
    let (before, after) = (&start.position, &end.position);
    let [before, after] = [before, after].map(|all| all.iter().map(front).fold(0.0, f64::max));
    println!("G8: {} particles, front {before:.3} to {after:.3} m, asymmetry {worst:.1e} dx", start.len());
    assert!(after > 1.4 * before, "it has flowed: {before} to {after}");
    // Measured 1e-13 dx after three sqrt(H/g), tenfold every one of them; the sums' order differs between images.
    assert!(worst < 1e-10, "{worst}");
}
