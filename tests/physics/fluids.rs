//! Viscous flow between plates: row D7 of the list of verification problems.

use crate::wall;
use formats::snapshot;
use std::f64::consts::PI;
use tests::{WorkFolder, computed};

/// Distance of the plates and spacing, m: 25 particles across.
const HEIGHT: f64 = 0.025;
const SPACING: f64 = 0.001;
/// Velocity of the lid, or in the middle of the steady flow, m/s; Reynolds's number is 1.
const SPEED: f64 = 0.1;
const VISCOSITY: f64 = SPEED * HEIGHT;
const DENSITY: f64 = 1000.0;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Flow {
    /// Dragged along by a lid.
    Couette,
    /// Driven by gravity along the plates.
    Poiseuille,
}

impl Flow {
    /// Velocity over SPEED at height z and time t, in units of the distance and its square over the viscosity: the steady
    /// profile and its Fourier series.
    fn exact(self, z: f64, t: f64) -> f64 {
        let term = |n: u32| {
            let n = f64::from(n);
            let wave = (-(n * PI).powi(2) * t).exp() * (n * PI * z).sin();
            match self {
                Self::Couette => 2.0 / (n * PI) * (n * PI).cos() * wave,
                Self::Poiseuille => -16.0 * (1.0 - (n * PI).cos()) / (n * PI).powi(3) * wave,
            }
        };
        let steady = if self == Self::Couette { z } else { 4.0 * z * (1.0 - z) };
        steady + (1..200).map(term).sum::<f64>()
    }
}

/// Largest L2 errors at t = 0.05, 0.1, 0.15 and 0.2 over the exact profile.
#[derive(Debug)]
struct Errors {
    /// Of particles.
    particles: f64,
    /// Of the means of two neighbouring rows.
    pairs: f64,
}

fn start_up(flow: Flow, kind: &str, operator: &str) -> Errors {
    let unit = HEIGHT * HEIGHT / VISCOSITY;
    let end = 0.2 * unit;
    let (gravity, motion) = match flow {
        Flow::Couette => ("0".to_owned(), format!("velocity = [{SPEED}, 0, 0]\n")),
        Flow::Poiseuille => (format!("[{}, 0, 0]", 8.0 * VISCOSITY * SPEED / (HEIGHT * HEIGHT)), String::new()),
    };
    let plate = |name, at, side| wall(name, "z", at, side, "no-slip") + &format!("kind = \"{kind}\"\n");
    let eta = VISCOSITY * DENSITY;
    let text = format!(
        "space = \"plane-strain\"\nspacing = {SPACING}\ngravity = {gravity}\n\
         periodic = {{ x = {{ from = 0, to = 0.008 }} }}\n\
         [material.visco-plastic]\ndensity = {DENSITY}\nsound-speed = {}\nfriction = 0\ncohesion = 0\n\
         viscosity = {eta}\nviscosity-solid = {eta}\noperator = \"{operator}\"\n\
         [body.fluid]\nbox = {{ min = [0, 0, 0], max = [0.008, 0, {HEIGHT}] }}\n{}{}{motion}\
         [numerics]\nviscous-courant = 0.25\n[end]\ntime = {end}\n[output]\nsnapshots = {}\n",
        10.0 * SPEED,
        plate("floor", 0.0, "above"),
        plate("lid", HEIGHT, "below"),
        end / 4.0
    );
    let work = WorkFolder::new();
    let folder = computed(&work, "run", &text, 0);
    let mut worst = Errors { particles: 0.0, pairs: 0.0 };
    for (name, _) in tests::digests(&folder) {
        let (header, found) = snapshot::read(&folder.out().join(name)).expect("a snapshot can be read");
        if header.time == 0.0 {
            continue;
        }
        let (mut wrong, mut whole) = (0.0, 0.0);
        let mut rows = vec![(0.0, 0.0, 0.0); 25];
        for (x, v) in found.position.iter().zip(&found.velocity) {
            let exact = flow.exact(x[2] / HEIGHT, header.time / unit);
            let error = v[0] / SPEED - exact;
            (wrong, whole) = (wrong + error * error, whole + exact * exact);
            let row = &mut rows[((x[2] / SPACING) as usize).min(24)];
            *row = (row.0 + error, row.1 + exact, row.2 + 1.0);
        }
        worst.particles = worst.particles.max(f64::sqrt(wrong / whole));
        let mean = |row: &(f64, f64, f64)| (row.0 / row.2, row.1 / row.2);
        let (wrong, whole) = rows.windows(2).fold((0.0, 0.0), |(wrong, whole), pair| {
            let (a, b) = (mean(&pair[0]), mean(&pair[1]));
            (wrong + (a.0 + b.0).powi(2), whole + (a.1 + b.1).powi(2))
        });
        worst.pairs = worst.pairs.max(f64::sqrt(wrong / whole));
    }
    println!("D7 {flow:?}, {kind}, {operator}: {worst:.4?}");
    worst
}

/// D7: with viscosity along pairs of particles the profiles are within the row's 1 % of the series throughout.
#[test]
fn d7_start_up_with_viscosity_along_pairs() {
    for kind in ["virtual", "mirror"] {
        for flow in [Flow::Couette, Flow::Poiseuille] {
            // Measured 0.45 and 0.70 % with virtual walls, 0.45 and 0.64 % with mirrors.
            let errors = start_up(flow, kind, "arithmetic");
            assert!(errors.particles < 0.01, "{flow:?} {kind}: {errors:?}");
        }
    }
}

/// D7 with the tensor 2 mu e: the kink of the profile drives rows that are alternately too fast and too slow, which that stress
/// does not feel (failure F3). The row's 1 % does not hold: 4.8 and 7.1 % with virtual walls, 6.3 and 7.7 % with mirrors,
/// and in Poiseuille's flow it stays. What is left in means of two rows is 0.8 to 1.6 %.
#[test]
fn d7_start_up_with_the_tensor_of_viscosity() {
    for kind in ["virtual", "mirror"] {
        for (flow, most) in [(Flow::Couette, 0.012), (Flow::Poiseuille, 0.02)] {
            let errors = start_up(flow, kind, "tensor");
            assert!(errors.pairs < most && errors.particles < 0.1, "{flow:?} {kind}: {errors:?}");
            // Were it gone, the documentation would be wrong.
            assert!(errors.particles > 0.01, "{flow:?} {kind}: {errors:?}");
        }
    }
}
