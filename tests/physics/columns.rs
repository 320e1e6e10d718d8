//! Columns at rest: rows E1, E5 and E8 of the list of verification problems.
//!
//! The SPH operators of the solver are not renormalised. Their gradient of a linear field on a lattice is too small by
//! the factor M11 of row C4, and in equilibrium the stress is too large by its inverse: what these tests expect of
//! stresses is the exact value over M11. Besides, rows of particles carry alternately too much and too little (the
//! mode of failure F3, which does no work on the lattice), 2 to 3 % of rho g H with the cubic spline.

use crate::{Scene, last, wall};
use formats::folder::RunFolder;
use formats::snapshot;
use tests::{WorkFolder, computed};

const GRAVITY: f64 = 9.81;
/// Slope of the cubic spline's gradient, h = 1.2 dx, on a lattice (row C4).
const SLOPE_2D: f64 = 0.990_793;
const SLOPE_3D: f64 = 0.981_689;

/// A column that has settled under damping.
struct Settled {
    /// Root mean square error of sigma_zz against -rho g (H - z), over rho g H.
    error: f64,
    /// Largest error of the mean over a row, over rho g H.
    row_error: f64,
    /// Sum of sigma_xx over sum of sigma_zz.
    k0: f64,
    /// Sum of sigma_yy over sum of sigma_zz.
    k0_out_of_plane: f64,
    /// m/s
    speed: f64,
    /// Mean settlement of the top row, m.
    settlement: f64,
    /// Mean of sigma_zz over the lowest two rows, over the exact one.
    base: f64,
    /// For some levels: what the stress carries there, over the weight above.
    carried: Vec<f64>,
}

impl Settled {
    fn measure(folder: &RunFolder, height: f64, density: f64) -> Self {
        let (header, rows) = last(folder);
        let (_, start) = snapshot::read(&folder.initial()).expect("the start can be read");
        let (dx, scale) = (header.spacing, density * GRAVITY * height);
        let levels = (height / dx).round() as usize;
        let (mut squares, mut sums, mut speed) = (0.0, [0.0; 3], 0.0_f64);
        let mut of_rows = vec![[0.0; 3]; levels];
        for (i, stress) in rows.stress.iter().enumerate() {
            let z = rows.position[i][2];
            let error = stress[2] + density * GRAVITY * (height - z);
            squares += (error / scale).powi(2);
            for a in 0..3 {
                sums[a] += stress[a];
            }
            speed = speed.max(rows.velocity[i].iter().map(|v| v * v).sum::<f64>().sqrt());
            let row = &mut of_rows[(start.position[i][2] / dx) as usize];
            row[0] += error / scale;
            row[1] += start.position[i][2] - z;
            row[2] += 1.0;
        }
        let exact_base = (height - dx) / height;
        let base_error: f64 = of_rows[..2].iter().map(|row| 0.5 * row[0] / row[2]).sum();
        let settled = Self {
            error: (squares / rows.len() as f64).sqrt(),
            row_error: of_rows.iter().map(|row| (row[0] / row[2]).abs()).fold(0.0, f64::max),
            k0: sums[0] / sums[2],
            k0_out_of_plane: sums[1] / sums[2],
            speed,
            settlement: of_rows[levels - 1][1] / of_rows[levels - 1][2],
            base: (exact_base - base_error) / exact_base,
            carried: [3.0, 5.0, 8.0].iter().map(|z| carried(&rows, z * dx, 2.0 * dx)).collect(),
        };
        println!("{}", settled.tell());
        settled
    }

    fn tell(&self) -> String {
        format!(
            "error {:.4}, of rows {:.4}; K0 {:.5} {:.5}; speed {:.2e} m/s; settlement {:.4e} m; base {:.4}; carried {:.5?}",
            self.error,
            self.row_error,
            self.k0,
            self.k0_out_of_plane,
            self.speed,
            self.settlement,
            self.base,
            self.carried
        )
    }
}

/// Vertical force that the stress carries through the level `z`, over the weight above. Both are means over levels
/// around z with a hat of half width `width`, the same one, so that the mean takes nothing from the balance: it holds
/// for a deposit of any shape in any space.
pub fn carried(rows: &snapshot::Rows, z: f64, width: f64) -> f64 {
    let (mut force, mut weight) = (0.0, 0.0);
    for i in 0..rows.len() {
        let q = ((rows.position[i][2] - z) / width).clamp(-1.0, 1.0);
        force -= rows.mass[i] / rows.density[i] * rows.stress[i][2] * (1.0 - q.abs()) / width;
        weight += rows.mass[i] * GRAVITY * (0.5 + q - 0.5 * q * q.abs());
    }
    force / weight
}

fn m0(space: &'static str, body: &'static str, sides: String) -> Scene {
    Scene {
        space,
        spacing: 0.005,
        body,
        walls: wall("floor", "z", 0.0, "above", "no-slip") + &sides,
        numerics: "damping = 60",
        end: 0.35,
        ..Scene::default()
    }
}

const BOX: &str = "box = { min = [0, 0, 0], max = [0.05, 0, 0.1] }";

/// What row E1 asks of every space; `slope` is that of row C4.
#[track_caller]
fn assert_e1(settled: &Settled, slope: f64) {
    let told = settled.tell();
    // The list's 3 % is over rho g H (its prototype's 2.2 % as well); 3-D has the larger error of slope.
    assert!(settled.error < 0.03, "{told}");
    // 4 %, the prototype's largest, in the two dimensions it had (measured 3.6 to 4.0 %). In 3-D the slope alone takes
    // another 1 %: measured 5.1 %.
    assert!(settled.row_error < if slope == SLOPE_3D { 0.055 } else { 0.04 }, "{told}");
    // The prototype's. They decay with exp(-30 t) from 2e-2 m/s; in 3-D the lattice's soft transverse modes (failure
    // F2) are slower: measured 6e-6 m/s.
    assert!(settled.speed < if slope == SLOPE_3D { 1e-5 } else { 4e-6 }, "{told}");
    // The prototype's 1.49e-5 m of rho g H^2/(2 M) = 1.58e-5 m. Not a matter of stiffness (with cohesion it is 1.61e-5 m,
    // 1/M11^2 of the exact one): without cohesion the first rebound opens the column a little, and it stays so (F12).
    let exact = 2600.0 * GRAVITY * 0.01 / (2.0 * 2600.0 * 55.643 * 55.643);
    assert!((settled.settlement / exact - 0.96).abs() < 0.03, "{told}");
    for carried in &settled.carried {
        // E8's 1 %; the plain value is 1/slope, which is what fails without the factor.
        assert!((carried * slope - 1.0).abs() < 0.01, "{told}");
    }
}

#[test]
fn e1_column_between_walls() {
    let work = WorkFolder::new();
    let sides = wall("left", "x", 0.0, "above", "free-slip") + &wall("right", "x", 0.05, "below", "free-slip");
    let folder = computed(&work, "run", &m0("plane-strain", BOX, sides).text(), 0);
    let settled = Settled::measure(&folder, 0.1, 2600.0);
    assert_e1(&settled, SLOPE_2D);
    // nu/(1 - nu) by 0.5 %.
    assert!((settled.k0 / 0.428_571 - 1.0).abs() < 0.005, "{}", settled.tell());
    assert!((settled.k0_out_of_plane / 0.428_571 - 1.0).abs() < 0.005, "{}", settled.tell());
}

#[test]
fn e1_column_beside_a_plane_of_symmetry() {
    let work = WorkFolder::new();
    let mut scene = m0("plane-strain", BOX, wall("right", "x", 0.05, "below", "free-slip"));
    scene.symmetry = "[\"x\"]";
    let settled = Settled::measure(&computed(&work, "run", &scene.text(), 0), 0.1, 2600.0);
    assert_e1(&settled, SLOPE_2D);
    assert!((settled.k0 / 0.428_571 - 1.0).abs() < 0.005, "{}", settled.tell());
    assert!((settled.k0_out_of_plane / 0.428_571 - 1.0).abs() < 0.005, "{}", settled.tell());
}

/// The same between mirror walls, which need no extrapolation: beside them nothing depends on x at all.
#[test]
fn e1_column_between_mirror_walls() {
    let work = WorkFolder::new();
    let mirror = |wall: String| wall + "kind = \"mirror\"\n";
    let mut scene = m0("plane-strain", BOX, String::new());
    scene.walls = mirror(wall("floor", "z", 0.0, "above", "no-slip"))
        + &mirror(wall("left", "x", 0.0, "above", "free-slip"))
        + &mirror(wall("right", "x", 0.05, "below", "free-slip"));
    let settled = Settled::measure(&computed(&work, "run", &scene.text(), 0), 0.1, 2600.0);
    let told = settled.tell();
    // Measured 2.36 %, with virtual walls 2.28 %: on a floor that is a mirror the alternating mode is a little stronger.
    assert!(settled.error < 0.03, "{told}");
    assert!(settled.row_error < 0.045, "{told}");
    // Measured 0.42857 for both; with virtual walls K0 is 0.13 % off.
    assert!((settled.k0 / 0.428_571 - 1.0).abs() < 1e-4, "{told}");
    assert!((settled.k0_out_of_plane / 0.428_571 - 1.0).abs() < 1e-4, "{told}");
    for carried in &settled.carried {
        assert!((carried * SLOPE_2D - 1.0).abs() < 0.01, "{told}");
    }
}

#[test]
fn e1_axisymmetric_column_in_a_tube() {
    let work = WorkFolder::new();
    let scene =
        m0("axisymmetric", "cylinder = { radius = 0.05, height = 0.1 }", wall("tube", "x", 0.05, "below", "free-slip"));
    let settled = Settled::measure(&computed(&work, "run", &scene.text(), 0), 0.1, 2600.0);
    assert_e1(&settled, SLOPE_2D);
    // The prototype's 0.430 +- 0.009.
    assert!((settled.k0 - 0.428_571).abs() < 0.009, "{}", settled.tell());
    assert!((settled.k0_out_of_plane - 0.428_571).abs() < 0.009, "{}", settled.tell());

    // Floor and tube as mirrors: rings behind the tube have their own radii.
    let mut mirrors = scene;
    mirrors.walls = mirrors.walls.replace("slip\"\n", "slip\"\nkind = \"mirror\"\n");
    let settled = Settled::measure(&computed(&work, "mirrors", &mirrors.text(), 0), 0.1, 2600.0);
    assert_e1(&settled, SLOPE_2D);
    assert!((settled.k0 - 0.428_571).abs() < 0.009, "{}", settled.tell());
    assert!((settled.k0_out_of_plane - 0.428_571).abs() < 0.009, "{}", settled.tell());
}

#[test]
fn e1_column_in_three_dimensions() {
    let work = WorkFolder::new();
    let mut scene = m0(
        "3d",
        "box = { min = [0, 0, 0], max = [0.02, 0.02, 0.1] }",
        wall("right", "x", 0.02, "below", "free-slip") + &wall("rear", "y", 0.02, "below", "free-slip"),
    );
    scene.symmetry = "[\"x\", \"y\"]";
    let settled = Settled::measure(&computed(&work, "run", &scene.text(), 0), 0.1, 2600.0);
    assert_e1(&settled, SLOPE_3D);
    // Four particles from the axis to the walls, one of them in a corner: measured 0.6 % off.
    assert!((settled.k0 / 0.428_571 - 1.0).abs() < 0.01, "{}", settled.tell());
}

/// E5: the hydrostatic column of CB-Geo's benchmarks, 0.2 m wide, 0.1 m high, Poisson's ratio 0.
#[test]
fn e5_hydrostatic_column_without_lateral_stress() {
    let work = WorkFolder::new();
    let sides = wall("left", "x", 0.0, "above", "free-slip") + &wall("right", "x", 0.2, "below", "free-slip");
    let mut scene = m0("plane-strain", "box = { min = [0, 0, 0], max = [0.2, 0, 0.1] }", sides);
    // Elastic: without lateral stress a material without cohesion would yield.
    (scene.density, scene.young, scene.poisson, scene.cohesion) = (1800.0, 1e6, 0.0, 1e5);
    let settled = Settled::measure(&computed(&work, "run", &scene.text(), 0), 0.1, 1800.0);
    let told = settled.tell();
    // 2 % at the base, as the row asks, of the mean of the lowest two rows: the lowest alone is 3.9 % off by the
    // alternating mode.
    assert!((settled.base - 1.0).abs() < 0.02, "{told}");
    assert!(settled.k0.abs() < 0.005 && settled.k0_out_of_plane.abs() < 0.005, "{told}");
    for carried in &settled.carried {
        // 20 particles from wall to wall: here the slope alone explains the weight.
        assert!((carried * SLOPE_2D - 1.0).abs() < 2e-3, "{told}");
    }
}

/// E8 on a deposit that has flowed: the stress carries what lies above, whatever the shape.
#[test]
fn e8_a_deposit_carries_its_weight() {
    let work = WorkFolder::new();
    let mut scene = m0("axisymmetric", "cylinder = { radius = 0.1, height = 0.05 }", String::new());
    (scene.spacing, scene.end) = (0.0025, 0.6);
    // What is looked at is the deposit, not how far it ran.
    scene.numerics = "damping = 5\ndamping-in-flow = \"forced\"";
    let (header, rows) = last(&computed(&work, "run", &scene.text(), 0));
    let carried: Vec<f64> =
        [3.0, 5.0, 8.0].iter().map(|z| carried(&rows, z * header.spacing, 2.0 * header.spacing)).collect();
    let speed = rows.velocity.iter().flatten().fold(0.0_f64, |a, v| a.max(v.abs()));
    let front = rows.position.iter().fold(0.0_f64, |a, x| a.max(x[0]));
    println!("carried {carried:.5?}; speed {speed:.2e} m/s; front {front:.4} m");
    assert!(front > 0.12, "it has flowed, to {front} m");
    // The row's 1 %, which includes 1/M11 = 1.009 of what is left of the lattice: measured 1.004 to 1.008.
    for carried in carried {
        assert!((carried - 1.0).abs() < 0.01, "{carried}");
    }
}
