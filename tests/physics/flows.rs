//! Steady flows of the mu(I) law: rows F1 and F2 of the list of verification problems, periodic along the flow.
//!
//! Grains of 0.5 mm and 2500 kg/m3 at 60 % of volume, mu_s = 0.38, mu_2 = 0.64, I0 = 0.279, the elastic branch below
//! yield, twenty particles across the film and forty across the chute.

use crate::last;
use tests::{WorkFolder, computed};

const GRAVITY: f64 = 9.81;
const DENSITY: f64 = 1500.0;
const GRAIN_DENSITY: f64 = 2500.0;
const GRAIN: f64 = 0.5e-3;
const STATIC: f64 = 0.38;
const DYNAMIC: f64 = 0.64;
const INERTIAL: f64 = 0.279;

/// A body `[low, high]` high and one period long, thrown along x.
struct Flow {
    period: f64,
    gravity: [f64; 2],
    z: [f64; 2],
    sound_speed: f64,
    speed: f64,
    /// Walls, start and numerics.
    rest: String,
    end: f64,
}

impl Flow {
    fn text(&self) -> String {
        let Self { period, gravity: [gx, gz], z: [low, high], sound_speed, speed, rest, end } = self;
        format!(
            "space = \"plane-strain\"\nspacing = 0.001\ngravity = [{gx}, 0, {gz}]\n\
             periodic = {{ x = {{ from = 0, to = {period} }} }}\n\
             [material.mu-i]\ndensity = {DENSITY}\nsound-speed = {sound_speed}\nfriction-static = {STATIC}\n\
             friction-dynamic = {DYNAMIC}\ninertial-number = {INERTIAL}\ngrain-diameter = {GRAIN}\n\
             grain-density = {GRAIN_DENSITY}\nunyielded = \"elastic\"\n\
             [body.grains]\nbox = {{ min = [0, 0, {low}], max = [{period}, 0, {high}] }}\nvelocity = [{speed}, 0, 0]\n\
             {rest}\n[end]\ntime = {end}\n[output]\nsnapshots = {end}\nhistory = {end}\n"
        )
    }
}

/// Shear rate at which the friction is `mu` under the pressure `p`.
fn shear_rate(mu: f64, p: f64) -> f64 {
    INERTIAL * (mu - STATIC).max(0.0) / (DYNAMIC - mu) * (p / GRAIN_DENSITY).sqrt() / GRAIN
}

/// Heights and velocities along x at the end.
fn profile(flow: &Flow) -> Vec<[f64; 2]> {
    let work = WorkFolder::new();
    let (_, rows) = last(&computed(&work, "run", &flow.text(), 0));
    rows.position.iter().zip(&rows.velocity).map(|(x, v)| [x[2], v[0]]).collect()
}

/// F1: between two vertical walls under 600 Pa a plug of 2 x 15.49 mm falls at 0.372 m/s. Mirror walls.
#[test]
fn f1_vertical_chute() {
    let (half, pressure) = (0.02, 600.0);
    let wall = |name, at, side| {
        format!("[wall.{name}]\naxis = \"z\"\nat = {at}\nside = \"{side}\"\nslip = \"no-slip\"\nkind = \"mirror\"\n")
    };
    let rest = wall("low", -half, "above")
        + &wall("high", half, "below")
        + "[initial]\nstress = \"pressure\"\npressure = 600\n\
           [numerics]\nviscosity = 0.02\nviscosity-acts = \"approach\"\n";
    let flow = Flow {
        period: 0.012,
        gravity: [GRAVITY, 0.0],
        z: [-half, half],
        sound_speed: 8.0,
        // Near the end state: its mass adjusts within about half a second.
        speed: 0.36,
        rest,
        end: 1.5,
    };
    let exact = |z: f64| {
        let (steps, from) = (2000, z.abs());
        let dz = (half - from) / f64::from(steps);
        (0..steps)
            .map(|k| from + (f64::from(k) + 0.5) * dz)
            .map(|z| shear_rate(DENSITY * GRAVITY * z / pressure, pressure) * dz)
            .sum::<f64>()
    };
    assert!((exact(0.0) - 0.37207).abs() < 1e-4, "the oracle's number");
    let particles = profile(&flow);
    let mean = |inside: &dyn Fn(f64) -> bool| {
        let found: Vec<_> = particles.iter().filter(|p| inside(p[0].abs())).collect();
        let sum = |of: &dyn Fn(&[f64; 2]) -> f64| found.iter().map(|p| of(p)).sum::<f64>() / found.len() as f64;
        (sum(&|p| p[1]), sum(&|p| exact(p[0])))
    };
    let (plug, plug_exact) = mean(&|z| z < 0.012);
    let (edge, edge_exact) = mean(&|z| (0.017..0.019).contains(&z));
    println!("plug {plug:.4}, exact {plug_exact:.4} m/s; at 18 mm {edge:.4}, exact {edge_exact:.4} m/s");
    // 3 %, the row's. Measured -0.1 % and +2.1 %; with half the period after 1 s +1.0 % and +3.7 %. A viscosity of 0.01 on all pairs, the
    // default, makes the plug 7.5 % slow: under 600 Pa the grains resist a change of speed little.
    assert!((plug / plug_exact - 1.0).abs() < 0.03, "{plug} m/s, not {plug_exact}");
    assert!((edge / edge_exact - 1.0).abs() < 0.03, "{edge} m/s, not {edge_exact}");
}

/// Bagnold's film at an angle: L2 error of its profile over the speed of its surface, and the mean speed over the exact one.
fn film(degrees: f64, period: f64, speed: f64, end: f64) -> (f64, f64) {
    let (height, angle) = (0.02, degrees.to_radians());
    let flow = Flow {
        period,
        gravity: [GRAVITY * angle.sin(), -GRAVITY * angle.cos()],
        z: [0.0, height],
        sound_speed: 10.0,
        speed,
        rest: "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n\
               [initial]\nstress = \"hydrostatic\"\n[kernel]\nkind = \"wendland-c2\"\n\
               [numerics]\nviscosity = 0.01\nviscosity-acts = \"approach\"\ndensity-diffusion = 0.3\nshifting = 0.1\n"
            .into(),
        end,
    };
    let mu = angle.tan();
    let surface = 2.0 / 3.0 * shear_rate(mu, DENSITY * GRAVITY * angle.cos() * height) * height;
    let exact = |z: f64| surface * (1.0 - (1.0 - z / height).max(0.0).powf(1.5));
    let particles = profile(&flow);
    let count = particles.len() as f64;
    let square: f64 = particles.iter().map(|[z, v]| (v - exact(*z)).powi(2)).sum();
    let mean: f64 = particles.iter().map(|p| p[1]).sum::<f64>() / count;
    let error = (square / count).sqrt() / surface;
    println!("{degrees} deg: surface {surface:.4} m/s; L2 {error:.4}; mean over exact {:.4}", mean / (0.6 * surface));
    (error, mean / (0.6 * surface))
}

/// F2: Bagnold's film, u = u_s (1 - (1 - z/h)^(3/2)). 5 %, the row's. At 26 and 28 degrees the particles are as agitated as
/// grains would be: without shifting and a stronger diffusion of density they dilate and the film is 15 to 20 % slow.
#[test]
fn f2_bagnold_film() {
    // Started near the end state, which they approach within seconds; 26 and 28 degrees take too long for a test: from 1.3 and 2.6 m/s with a
    // period of 12 mm L2 was 4.5 and 4.1 to 4.6 %, mean speeds +1.6 and +3 to +7 %, after 2 s; from 2.2 m/s 28 degrees is not there after
    // 1.8 s, and with a period of 8 mm L2 is 8 %.
    for (degrees, period, speed, end) in [(22.0, 0.008, 0.15, 1.5), (24.0, 0.008, 0.6, 2.0)] {
        let (error, mean) = film(degrees, period, speed, end);
        assert!(error < 0.05, "{degrees} deg: {error}");
        assert!((mean - 1.0).abs() < 0.05, "{degrees} deg: {mean}");
    }
}
