//! Obstacles from STL files: as good as plane walls, and the forces on them.

use crate::{AS_YANG, Scene, history, last, wall};
use tests::{WorkFolder, computed, solids};

const SPACING: f64 = 0.015625;

/// A block that falls and slides against a wall at x = 12 spacings.
fn slide(walls: &str, numerics: &'static str) -> String {
    let scene = Scene {
        space: "3d",
        spacing: SPACING,
        body: "box = { min = [0.03125, 0, 0.015625], max = [0.1875, 0.125, 0.171875] }\nvelocity = [0.5, 0.2, 0]",
        walls: walls.to_string(),
        end: 0.15,
        young: 0.5e6,
        numerics,
        ..Scene::default()
    };
    scene.text()
}

/// A box whose faces lie on the planes of the lattice has the sites of a plane wall, and does what that does: to the bit where it
/// sticks. Where it is smooth, the wall particles behind the floor and within the box differ: the floor has them.
#[test]
fn k3_a_box_is_as_good_as_a_plane_wall() {
    let work = WorkFolder::new();
    solids::block(&work, "box.stl", [0.1875, -1.0, -1.0], [1.0, 2.0, 2.0]);
    // Measured 0; 3.7e-3 m, a quarter of a spacing, as Yang et al. have it, and 8.1e-3 m with the defaults of sand.
    let cases = [("no-slip", "", 0.0), ("free-slip", AS_YANG, 0.005), ("free-slip", "", 0.01)];
    for (k, (slip, numerics, tolerance)) in cases.into_iter().enumerate() {
        let floor = wall("floor", "z", 0.0, "above", "no-slip");
        let plane = computed(
            &work,
            &format!("plane-{k}"),
            &slide(&(floor.clone() + &wall("side", "x", 0.1875, "below", slip)), numerics),
            0,
        );
        let solid = format!("{floor}[obstacle.box]\nfile = \"box.stl\"\nslip = \"{slip}\"\n");
        let solid = computed(&work, &format!("solid-{k}"), &slide(&solid, numerics), 0);
        let (plane, solid) = (last(&plane).1, last(&solid).1);
        let apart = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
        let off = plane.position.iter().zip(&solid.position).map(|(a, b)| apart(*a, *b)).fold(0.0, f64::max);
        let moved = plane.position.iter().map(|x| x[1] - 0.125).fold(0.0, f64::max);
        println!("{slip} {numerics:?}: particles are up to {off:.2e} m apart, and have gone up to {moved:.3} m");
        assert!(off <= tolerance && moved > 0.02, "{slip}: {off} m");
    }
}

/// A column in a box of smooth solids: all of them together bear its weight, to rounding and what still moves, for the forces
/// are the very ones between particles. The one under it bears nearly all of it, and the one beside it the thrust of K0 = nu/(1 - nu).
#[test]
fn k4_a_resting_column_weighs_on_its_obstacles() {
    let work = WorkFolder::new();
    solids::block(&work, "floor.stl", [-1.0, -1.0, -1.0], [2.0, 2.0, 0.0]);
    solids::block(&work, "side.stl", [0.1, -1.0, -1.0], [1.0, 2.0, 2.0]);
    solids::block(&work, "back.stl", [-1.0, 0.1, -1.0], [2.0, 1.0, 2.0]);
    let obstacle = |name: &str| format!("[obstacle.{name}-1]\nfile = \"{name}.stl\"\nslip = \"free-slip\"\n");
    let scene = Scene {
        space: "3d",
        spacing: 0.0125,
        symmetry: "[\"x\", \"y\"]",
        body: "box = { min = [0, 0, 0], max = [0.1, 0.1, 0.2] }",
        walls: ["floor", "side", "back"].map(obstacle).concat(),
        // Elastic: held sideways it does not yield anyway.
        cohesion: 1e5,
        numerics: "damping = 50\ndamping-in-flow = \"forced\"",
        end: 0.25,
        ..Scene::default()
    };
    let text = scene.text() + "[initial]\nstress = \"k0\"\n";
    let folder = computed(&work, "run", &text, 0);
    let end = |name: &str| *history(&folder, name).last().unwrap();
    let weight = 2600.0 * 0.1 * 0.1 * 0.2 * 9.81;
    let pressed = 0.3 / 0.7 * 0.5 * 2600.0 * 9.81 * 0.2 * 0.2 * 0.1;
    let down = ["floor", "side", "back"].map(|name| -end(&format!("force_{name}_1_z")) / weight);
    let aside = end("force_side_1_x") / pressed;
    let all: f64 = down.iter().sum();
    println!("{all:.6} of the weight, {down:.4?}; {aside:.4} of the thrust; {:.2e} m/s", end("max_speed"));
    // Measured 0.99997: a damping of 50 1/s on 1e-5 m/s holds the rest. The floor bears 1.002, the thrust is 0.977 of K0.
    assert!((all - 1.0).abs() < 1e-3, "{all} of the weight");
    assert!(down[0] > 0.95, "{down:?} of the weight");
    assert!((aside - 1.0).abs() < 0.1, "{aside} of the thrust");
    // It stays where it is, outside and at rest.
    assert!(end("max_speed") < 1e-4);
    assert_eq!(end("below_floor"), 0.0);
}
