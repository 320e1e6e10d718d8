use super::*;
use crate::testing::{block, geometry, jitter, push};
use formats::kernel::Kernel;

const BLOCK: &str = "[body.b]\nbox = { min = [0, 0, 0], max = [0.1, 0.1, 0.1] }\n";

/// A scene of one block on nothing, with more keys above and below.
fn scene(space: &str, above: &str, below: &str) -> Scene {
    let text = format!(
        "space = \"{space}\"\nspacing = 0.01\n{above}\n[material.drucker-prager]\ndensity = 2000\nyoung = 1e6\npoisson = 0.3\n\
         friction = 30\ncohesion = 0\n[end]\ntime = 1\n{below}\n"
    );
    Scene::read("health", &text).unwrap_or_else(|faults| panic!("{faults}\n{text}"))
}

fn plane() -> Geometry {
    Geometry { mirrored: [false; 2], ..geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01) }
}

/// The health after these snapshots.
fn health(scene: &Scene, g: &Geometry, snapshots: &[&Rows]) -> Health {
    let (last, before) = snapshots.split_last().unwrap();
    let start = Start::of(snapshots[0]);
    let end = Health::at_end(scene, g, last, &Sampler::new(g, last), 0.1, &start);
    let watched = before.iter().map(|rows| Health::at(scene, g, rows, &Sampler::new(g, rows)));
    watched.fold(Health::default(), Health::and_then).and_then(end)
}

#[test]
fn a_lattice_is_sound_and_a_clump_is_seen() {
    let (g, scene) = (plane(), scene("plane-strain", "", BLOCK));
    let mut rows = block(&g, [10, 1, 10]);
    let sound = health(&scene, &g, &[&rows]);
    assert!((sound.nearest - 1.0).abs() < 1e-9 && sound.close == 0.0 && sound.pieces == 1);
    assert!(
        (sound.sum_mean - 1.0).abs() < 0.02 && sound.sum_scatter < 5e-3 && sound.density_noise < 1e-12,
        "{sound:?}"
    );
    assert_eq!((sound.displacement, sound.loose, sound.tension), (0.0, 0.0, 0.0));
    // Two in the middle come together: a fifth of a spacing apart.
    rows.position[44][0] += 0.4 * g.dx;
    rows.position[54][0] -= 0.4 * g.dx;
    // One flies off, and another one with it.
    rows.position[99] = [0.5, 0.0, 0.5];
    let mass = rows.mass[0];
    push(&mut rows, [0.51, 0.0, 0.5], mass, g.density);
    let clump = health(&scene, &g, &[&rows]);
    assert!((clump.nearest - 0.2).abs() < 1e-9 && clump.pieces == 2, "{clump:?}");
    assert!((clump.close - 2.0 / 101.0).abs() < 1e-12 && clump.sum_scatter > 0.02);
}

#[test]
fn pieces_far_apart_are_counted() {
    let (g, scene) = (plane(), scene("plane-strain", "", BLOCK));
    let mut rows = block(&g, [10, 1, 10]);
    rows.position.iter_mut().filter(|x| x[2] > 0.05).for_each(|x| x[2] += 0.55 * g.dx);
    assert_eq!(health(&scene, &g, &[&rows]).pieces, 2);
    rows.position.iter_mut().filter(|x| x[2] > 0.05).for_each(|x| x[2] -= 0.1 * g.dx);
    assert_eq!(health(&scene, &g, &[&rows]).pieces, 1);
}

#[test]
fn a_linear_stress_has_no_noise_and_a_checkerboard_is_nothing_else() {
    let (g, scene) = (plane(), scene("plane-strain", "", BLOCK));
    let mut rows = block(&g, [12, 1, 12]);
    jitter(&mut rows, &g, 0.1);
    let linear: Vec<[f64; 6]> =
        rows.position.iter().map(|x| [-1e3 * x[2] - 50.0, -300.0, -2e3 * x[2], 0.0, 0.0, 400.0 * x[0]]).collect();
    rows.stress = linear.clone();
    let smooth = health(&scene, &g, &[&rows]);
    assert!(smooth.noise < 1e-12 && smooth.noise_static < 1e-12, "{smooth:?}");
    for (k, s) in rows.stress.iter_mut().enumerate() {
        let sign = if (k / 12 + k) % 2 == 0 { 1.0 } else { -1.0 };
        *s = [sign * 100.0, 0.0, sign * 100.0, 0.0, 0.0, 0.0];
    }
    // The upper half moves, and is smooth.
    for k in 0..rows.len() {
        if rows.position[k][2] > 0.06 {
            rows.velocity[k] = [1.0, 0.0, 0.0];
        }
    }
    let rough = health(&scene, &g, &[&rows]);
    // The average of a checkerboard over the kernel is a few per cent of it inside, and more at surfaces.
    assert!(rough.noise > 0.75 && rough.noise < 1.1, "{rough:?}");
    assert!((rough.tension - 0.5).abs() < 0.01);
    for k in 0..rows.len() {
        if rows.position[k][2] > 0.06 {
            rows.stress[k] = linear[k];
        }
    }
    let half = health(&scene, &g, &[&rows]);
    assert!(half.noise_static > half.noise && half.noise_static > 0.6, "{half:?}");
}

#[test]
fn densities_are_watched_all_along() {
    let (g, scene) = (plane(), scene("plane-strain", "", BLOCK));
    let rows = block(&g, [10, 1, 10]);
    let mut squeezed = rows.clone();
    squeezed.density.fill(2200.0);
    squeezed.stress.fill([-3e3, -3e3, -3e3, 0.0, 0.0, 0.0]);
    let mut loose = rows.clone();
    loose.density[..25].fill(1000.0);
    let found = health(&scene, &g, &[&rows, &squeezed, &loose]);
    assert_eq!((found.densities, found.pressure), ([0.5, 1.1], 3e3));
    assert!((found.loose - 0.25).abs() < 1e-12);
    // On the border of the two the average lies between them.
    assert!(found.density_noise > 0.1 && found.density_noise < 0.5);
    // Densities below what the places say: the sums are too large by as much.
    let mut drifted = rows.clone();
    drifted.density.fill(1600.0);
    let sums = [&rows, &drifted].map(|rows| health(&scene, &g, &[rows]).sum_mean);
    assert!((sums[1] / sums[0] - 1.25).abs() < 1e-9);
}

#[test]
fn places_behind_walls_and_displacements() {
    let g = plane();
    let walls = format!("{BLOCK}[wall.f]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n");
    let with_walls = scene("plane-strain", "periodic = { x = { from = 0, to = 0.1 } }", &walls);
    let rows = block(&g, [10, 1, 10]);
    let mut lower = rows.clone();
    lower.position.iter_mut().for_each(|x| x[2] -= 0.8 * g.dx);
    // Once around, and a quarter of a spacing further.
    let mut around = rows.clone();
    around.position.iter_mut().for_each(|x| x[0] -= 10.25 * g.dx);
    around.velocity.fill([3.0, 0.0, 4.0]);
    let found = health(&with_walls, &g, &[&rows, &lower, &around]);
    assert!((found.deepest - 0.3).abs() < 1e-9 && (found.displacement - 0.25).abs() < 1e-9, "{found:?}");
    assert!((found.speed - 5.0).abs() < 1e-12 && found.turned.is_nan());
}

#[test]
fn angular_momentum_is_held_against_that_of_the_start() {
    let (g, scene) = (plane(), scene("plane-strain", "gravity = 0", BLOCK));
    let mut rows = block(&g, [10, 1, 10]);
    let spin = |rows: &mut Rows, omega: f64| {
        for (v, x) in rows.velocity.iter_mut().zip(&rows.position) {
            *v = [7.0 + omega * (x[2] - 0.05), 0.0, -omega * (x[0] - 0.05)];
        }
    };
    assert!(health(&scene, &g, &[&rows]).turned.is_nan());
    spin(&mut rows, 2.0);
    let begin = rows.clone();
    // It may fly along as it likes.
    rows.position.iter_mut().for_each(|x| x[0] += 0.3);
    rows.position.iter_mut().for_each(|x| x[0] -= 0.3);
    spin(&mut rows, 1.5);
    assert!((health(&scene, &g, &[&begin, &rows]).turned - 0.25).abs() < 1e-9);
}

#[test]
fn a_hole_on_the_axis_and_an_uneven_front() {
    let round = "[body.b]\ncylinder = { radius = 0.1, height = 0.1 }\n";
    let g = geometry(Space::Axisymmetric, Kernel::CubicSpline, 0.01);
    let (filled, rings) = (scene("axisymmetric", "", round), block(&g, [10, 1, 20]));
    let void = health(&filled, &g, &[&rings]).void;
    assert!(void.abs() < 0.03, "{void}");
    let mut bored = rings.clone();
    bored.position.iter_mut().for_each(|x| x[0] += 2.0 * g.dx);
    assert!(health(&filled, &g, &[&rings, &bored, &rings]).void > 0.5);

    let g = Geometry { radial: true, mirrored: [false; 2], ..geometry(Space::ThreeD, Kernel::CubicSpline, 0.01) };
    let whole = scene("3d", "", round);
    let mut rows = Rows::default();
    for k in 0..1600 {
        let turn = ((k % 16) as f64 + 0.5) / 16.0 * std::f64::consts::TAU;
        let r = 0.1 * ((k / 16) as f64 / 100.0).sqrt();
        push(&mut rows, [r * turn.cos(), r * turn.sin(), 0.005], 1.0, 2000.0);
    }
    let even = health(&whole, &g, &[&rows]).uneven;
    assert!(even < 1e-9, "{even}");
    // A fifth further along x than along y.
    rows.position.iter_mut().for_each(|x| x[0] *= 1.2);
    let uneven = health(&whole, &g, &[&rows]).uneven;
    assert!(uneven > 0.12 && uneven < 0.2, "{uneven}");
}
