//! What stays where it is, and what creeps: row E4 of the list of verification problems, and the cost of a capped viscosity.

use crate::{history, last, wall};
use formats::folder::RunFolder;
use formats::snapshot;
use tests::{WorkFolder, computed};

const GRAVITY: f64 = 9.81;
const HEIGHT: f64 = 0.1;
const SPACING: f64 = 0.01;

/// Columns ten spacings high, in a period that holds them at the sides, for 100 sqrt(H/g) without damping.
struct Rested {
    /// Largest kinetic energy after 20 sqrt(H/g), and at the end, over rho g H V.
    kinetic: [f64; 2],
    /// Largest change of a density since 20 sqrt(H/g).
    density: f64,
    /// Largest vertical movement of a particle, and of all their mean, since then, over the spacing.
    moved: [f64; 2],
    /// Largest speed at the end, m/s.
    speed: f64,
}

fn rest(law: &str, density: f64, stress: &str) -> Rested {
    let unit = (HEIGHT / GRAVITY).sqrt();
    let text = format!(
        "space = \"plane-strain\"\nspacing = {SPACING}\nperiodic = {{ x = {{ from = 0, to = 0.06 }} }}\n{law}\
         [body.column]\nbox = {{ min = [0, 0, 0], max = [0.06, 0, {HEIGHT}] }}\n{}\
         [initial]\nstress = \"{stress}\"\n[end]\ntime = {}\n[output]\nsnapshots = {}\nhistory = {unit}\n",
        wall("floor", "z", 0.0, "above", "no-slip"),
        100.0 * unit,
        20.0 * unit
    );
    let work = WorkFolder::new();
    let folder = computed(&work, "run", &text, 0);
    let early = nth(&folder, 1);
    let (_, late) = last(&folder);
    let kinetic = history(&folder, "kinetic_energy");
    let scale = density * GRAVITY * HEIGHT * HEIGHT * 0.06;
    let (mut changed, mut moved, mut mean) = (0.0_f64, 0.0_f64, 0.0);
    for i in 0..late.len() {
        changed = changed.max((late.density[i] / early.density[i] - 1.0).abs());
        let fall = (early.position[i][2] - late.position[i][2]) / SPACING;
        moved = moved.max(fall.abs());
        mean += fall / late.len() as f64;
    }
    Rested {
        kinetic: [kinetic[20..].iter().fold(0.0_f64, |a, &b| a.max(b)) / scale, kinetic[kinetic.len() - 1] / scale],
        density: changed,
        moved: [moved, mean],
        speed: history(&folder, "max_speed").pop().expect("a last line"),
    }
}

fn nth(folder: &RunFolder, n: usize) -> snapshot::Rows {
    let (name, _) = &tests::digests(folder)[n];
    snapshot::read(&folder.out().join(name)).expect("a snapshot can be read").1
}

impl Rested {
    fn tell(&self, law: &str) -> String {
        let Self { kinetic: [most, end], density, moved: [moved, mean], speed } = self;
        let told = format!(
            "{law}: kinetic energy {most:.1e}, at the end {end:.1e}; density {density:.1e}; moved {moved:.1e} dx, \
             mean {mean:.1e} dx; {speed:.1e} m/s"
        );
        println!("E4 {told}");
        told
    }
}

const M0: &str =
    "[material.drucker-prager]\ndensity = 2600\nyoung = 5.98e6\npoisson = 0.3\nfriction = 30\ncohesion = 0\n";
const GRAINS: &str = "[material.mu-i]\ndensity = 1500\nsound-speed = 10\nfriction-static = 0.38\n";

/// E4: with nothing but the default viscosity columns come to rest and stay there.
#[test]
fn e4_long_rest() {
    let elastic = GRAINS.to_owned() + "unyielded = \"elastic\"\n";
    for (name, law, rho, stress) in [
        ("Drucker-Prager from no stress", M0, 2600.0, "zero"),
        ("mu(I), elastic below yield", elastic.as_str(), 1500.0, "hydrostatic"),
    ] {
        let rested = rest(law, rho, stress);
        let told = rested.tell(name);
        // Measured 8e-11 and 3e-9, and below 1e-18 at the end.
        assert!(rested.kinetic[0] < 1e-6 && rested.kinetic[1] < 1e-12, "{told}");
        // Measured 5e-7 and 2e-5.
        assert!(rested.density < 1e-4, "{told}");
        // Measured 3e-6 and 9e-5 dx.
        assert!(rested.moved[0] < 0.01, "{told}");
    }
}

/// E4 of mu(I) under a cap: held on all sides it passes as well, but its particles go on creeping past each other. Measured
/// 3e-6 m/s after 100 sqrt(H/g), and up to 5e-3 dx of movement.
#[test]
fn e4_long_rest_under_a_cap() {
    let rested = rest(GRAINS, 1500.0, "hydrostatic");
    let told = rested.tell("mu(I), capped");
    assert!(rested.kinetic[0] < 1e-6 && rested.density < 1e-4 && rested.moved[0] < 0.02, "{told}");
    assert!((1e-7..1e-4).contains(&rested.speed), "{told}");
}

/// The cost of the cap on a slope of 15 degrees that should stand (mu_s = tan 20.8 degrees): it flows as a Newtonian film,
/// with rho g sin(theta) h^2/(2 cap) at its surface.
#[test]
fn a_capped_film_creeps_down_a_slope_it_should_rest_on() {
    let (height, spacing, theta) = (0.02, 0.002, 15f64.to_radians());
    for cap in [5.0, 20.0] {
        let text = format!(
            "space = \"plane-strain\"\nspacing = {spacing}\ngravity = [{}, 0, {}]\n\
             periodic = {{ x = {{ from = 0, to = 0.012 }} }}\n{GRAINS}viscosity-cap = {cap}\n\
             [body.film]\nbox = {{ min = [0, 0, 0], max = [0.012, 0, {height}] }}\n{}\
             [initial]\nstress = \"hydrostatic\"\n[end]\ntime = 0.4\n[output]\nsnapshots = 0.4\n",
            GRAVITY * theta.sin(),
            -GRAVITY * theta.cos(),
            wall("floor", "z", 0.0, "above", "no-slip"),
        );
        let work = WorkFolder::new();
        let (_, rows) = last(&computed(&work, "run", &text, 0));
        let surface = rows.velocity.iter().map(|v| v[0]).fold(0.0, f64::max);
        let exact = 1500.0 * GRAVITY * theta.sin() * height * height / (2.0 * cap);
        println!("cap {cap} Pa s: {surface:.4} m/s, Newtonian {exact:.4} m/s");
        // Measured 1.000 and 1.007.
        assert!((surface / exact - 1.0).abs() < 0.03, "{surface} {exact}");
    }
}
