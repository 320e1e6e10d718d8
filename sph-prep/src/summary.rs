//! What the user is told before anything is written.

use crate::{lattice::Lattice, memory::Load};
use formats::{
    scene::{self, Scene},
    space::Space,
};

/// Whole numbers of intervals may be off by so much.
const ROUNDING: f64 = 1e-9;

/// A body in numbers.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its name.
    pub name: String,
    /// Number of particles.
    pub particles: u64,
    /// Volume of the shape; m2 in plane strain, else m3.
    pub ideal: f64,
    /// Volume of the particles, in the same unit.
    pub discrete: f64,
    /// Particles that would lie in obstacles, and are left out.
    pub left_out: u64,
}

impl Body {
    /// By how much the particles' volume differs from the shape's, per cent.
    pub fn deviation(&self) -> f64 {
        100.0 * (self.discrete / self.ideal - 1.0)
    }
}

/// Bodies in numbers; `discrete` is their volume summed over all ranks.
pub fn bodies(scene: &Scene, lattices: &[Lattice], particles: &[u64], discrete: &[f64]) -> Vec<Body> {
    let one = |n: usize| Body {
        name: scene.bodies[n].name.clone(),
        particles: particles[n],
        ideal: lattices[n].solid.ideal_volume(),
        discrete: discrete[n],
        left_out: 0,
    };
    (0..lattices.len()).map(one).collect()
}

/// Bodies in numbers, where there are too many particles to count.
pub fn estimated(scene: &Scene, lattices: &[Lattice]) -> Vec<Body> {
    let particles: Vec<_> = lattices.iter().map(Lattice::estimate).collect();
    let volumes: Vec<_> = lattices.iter().map(|lattice| lattice.solid.ideal_volume()).collect();
    bodies(scene, lattices, &particles, &volumes)
}

/// The scene and its bodies; printed before the particles are made, so that a slip in the spacing shows before it
/// eats the memory.
pub fn head(scene: &Scene, bodies: &[Body]) -> String {
    let mut out = String::new();
    let mut line = |name: &str, text: String| out += &format!("{name:<12} {text}\n");
    let kernel = scene.kernel.name();
    let part = match scene.symmetry {
        [true, true] => ", symmetric about x = 0 and y = 0",
        [true, false] => ", symmetric about x = 0",
        [false, true] => ", symmetric about y = 0",
        [false, false] => "",
    };
    line("scene", scene.title.clone());
    line("space", format!("{}{part}", scene.space.name()));
    let arrangement = match scene.initial.lattice {
        scene::Lattice::Cubic => "cubic",
        scene::Lattice::Hexagonal => "hexagonal",
        scene::Lattice::BodyCentred => "body-centred",
    };
    line("lattice", format!("{arrangement}, dx = {} m, h = {} m ({kernel})", short(scene.spacing), short(scene.h())));
    let unit = if scene.space == Space::PlaneStrain { "m2" } else { "m3" };
    for body in bodies {
        let (ideal, discrete) = (short(body.ideal), short(body.discrete));
        let volumes = format!("volume {ideal} {unit}, as particles {discrete} {unit} ({:+.2} %)", body.deviation());
        line("body", format!("{}: {} particles, {volumes}", body.name, body.particles));
        if body.left_out > 0 {
            let many = body.left_out;
            line("", format!("{many} of its particles would lie in obstacles, and are left out of the volume too"));
        }
    }
    for obstacle in &scene.obstacles {
        let (solid, [x, y, z]) = (&obstacle.solid, [0, 1, 2].map(|a| obstacle.solid.high[a] - obstacle.solid.low[a]));
        let size = format!("{} m x {} m x {} m", short(x), short(y), short(z));
        let surface = format!("volume {} m3, {} triangles", short(solid.volume), solid.triangles.len());
        line("obstacle", format!("{}: {size}, {surface} ({})", obstacle.name, obstacle.file));
    }
    out
}

/// What the run will cost.
pub fn cost(scene: &Scene, load: Load, ranks: u64) -> String {
    let mut out = String::new();
    let mut line = |name: &str, text: String| out += &format!("{name:<12} {text}\n");
    line("walls", format!("about {} virtual particles within reach at the start", load.walls));
    let plural = if ranks == 1 { "" } else { "s" };
    line("memory", format!("about {} for sph-run on {ranks} rank{plural}, all together", size(load.bytes(ranks))));
    let (dt, steps) = time_step(scene);
    line("sound speed", format!("{} m/s", short(scene.material.sound_speed())));
    line("time step", format!("about {} s, {steps} steps to {} s", short(dt), short(scene.end.time)));
    line("snapshots", format!("{}, every {} s", snapshots(scene), short(scene.output.snapshots)));
    line("prepared on", format!("{ranks} rank{plural}"));
    out
}

/// The first time step, s, and the number of such steps to the end. Steps are shortened to meet each line of the
/// history and each snapshot, so that every stretch between two of them takes a whole number of steps.
pub fn time_step(scene: &Scene) -> (f64, u64) {
    let speed = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let fastest = scene.bodies.iter().map(|b| speed(b.velocity)).fold(0.0, f64::max);
    let dt = scene.numerics.courant * scene.h() / (scene.material.sound_speed() + fastest);
    let end = scene.end.time;
    let steps = |stretch: f64| (stretch / dt - ROUNDING).ceil().max(0.0);
    let (fine, coarse) = (
        scene.output.history.min(scene.output.snapshots).min(end),
        scene.output.history.max(scene.output.snapshots).min(end),
    );
    let whole = (end / fine + ROUNDING).floor();
    let mut count = whole * steps(fine) + steps(end - whole * fine);
    // Coarse events that fall between the fine ones cut one more step each.
    let ratio = coarse / fine;
    if (ratio - ratio.round()).abs() > 1e-6 {
        count += (end / coarse - ROUNDING).floor();
    }
    (dt, count as u64)
}

/// Number of snapshots, the first and the last included.
pub fn snapshots(scene: &Scene) -> u64 {
    // A hair more than a whole number of intervals is a whole number.
    (scene.end.time / scene.output.snapshots - ROUNDING).ceil() as u64 + 1
}

/// A number to five digits, without trailing zeros.
pub(crate) fn short(x: f64) -> String {
    if x != 0.0 && !(1e-3..1e6).contains(&x.abs()) {
        let text = format!("{x:.4e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", trimmed(mantissa));
    }
    let digits = if x == 0.0 { 0 } else { (4 - x.abs().log10().floor() as i32).max(0) as usize };
    trimmed(&format!("{x:.digits$}")).to_owned()
}

fn trimmed(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

/// A number of bytes to the reader's scale.
pub(crate) fn size(bytes: u64) -> String {
    let mut value = bytes as f64;
    for unit in ["B", "kB", "MB", "GB"] {
        if value < 1000.0 {
            return format!("{value:.0} {unit}");
        }
        value /= 1000.0;
    }
    format!("{value:.1} TB")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scene;
    use formats::scene::Shape;

    #[test]
    fn numbers_are_short() {
        let cases = [(0.004, "0.004"), (1.0 / 3.0, "0.33333"), (0.0, "0"), (4.2e-5, "4.2e-5"), (1234567.0, "1.2346e6")];
        for (x, text) in cases {
            assert_eq!(short(x), text);
        }
        assert_eq!(short(100.0), "100");
        assert_eq!(size(1_234_567), "1 MB");
    }

    #[test]
    fn the_time_step_follows_the_fastest_body() {
        let mut scene = scene(Space::PlaneStrain, 0.01, Shape::Box { min: [0.0; 3], max: [0.1, 0.0, 0.1] });
        let c = scene.material.sound_speed();
        let (dt, steps) = time_step(&scene);
        assert!((dt - 0.6 * 0.012 / c).abs() < 1e-15);
        // 100 lines of the history, which all snapshots fall on.
        assert_eq!(steps, 100 * (0.01 / dt).ceil() as u64);
        scene.bodies[0].velocity = [3.0, 0.0, 4.0];
        assert!((time_step(&scene).0 - 0.6 * 0.012 / (c + 5.0)).abs() < 1e-15);
        assert_eq!(snapshots(&scene), 21);
        scene.output.snapshots = 0.3;
        assert_eq!(snapshots(&scene), 5);
    }

    #[test]
    fn events_shorten_steps() {
        let mut scene = scene(Space::PlaneStrain, 0.01, Shape::Box { min: [0.0; 3], max: [0.1, 0.0, 0.1] });
        let (dt, _) = time_step(&scene);
        let mut count = |history: f64, snapshots: f64, end: f64| {
            scene.output.history = history * dt;
            scene.output.snapshots = snapshots * dt;
            scene.end.time = end * dt;
            time_step(&scene).1
        };
        assert_eq!(count(10.0, 100.0, 100.0), 100);
        assert_eq!(count(9.5, 95.0, 95.0), 100);
        assert_eq!(count(0.1, 1.0, 10.0), 100, "at least a step an event");
        assert_eq!(count(10.0, 25.0, 100.0), 103, "at 25, 75 and, for want of looking closer, 50");
        assert_eq!(count(40.0, 40.0, 100.5), 101);
    }
}
