//! How fast a scene can become, and whether it comes to rest.

use crate::scene::{InitialStress, Material, Scene};

/// The speed of sound over the fastest motion: the pressure of a flow then changes densities by about 1 % (Monaghan 1994).
pub(super) const TIMES_FASTEST: f64 = 10.0;

/// A run is over where the kinetic energy falls below this fraction of its peak: that of the columns in VALIDATION.md.
const AT_REST: f64 = 5e-5;

const AXES: [&str; 3] = ["x", "y", "z"];

/// A bound of the speeds.
pub(super) struct Bound {
    /// m/s.
    pub speed: f64,
    /// Where it comes from, in words.
    pub why: String,
}

/// The fastest motion that is to be expected: what the first speed, the fall to the lowest place there is, and the
/// pressure at the start can turn into, v^2 = v0^2 + 2 g H + 2 p/rho (Torricelli), and the speed of the walls besides.
/// Or why there is no bound.
pub(super) fn fastest(scene: &Scene) -> Result<Bound, String> {
    let first = scene.bodies.iter().map(|body| speed(body.velocity)).fold(0.0, f64::max);
    let walls = scene.walls.iter().map(|wall| speed(wall.velocity)).fold(0.0, f64::max);
    let mut fall = 0.0;
    for axis in (0..3).filter(|&axis| scene.gravity[axis] != 0.0) {
        let pull = scene.gravity[axis];
        let name = AXES[axis];
        let bounds = scene.bodies.iter().map(|body| body.shape.bounds(scene.space));
        // The farthest point from where gravity leads to.
        let farthest =
            bounds.map(|(low, high)| if pull > 0.0 { -low[axis] } else { high[axis] }).fold(f64::MIN, f64::max);
        let facing = scene.walls.iter().find(|wall| wall.axis == axis && wall.side == -pull.signum());
        let ground = scene.terrain.as_ref().filter(|_| axis == 2 && pull < 0.0).map(|t| t.ground.range()[0]);
        let Some(end) = facing.map(|wall| wall.at).or(ground) else {
            return Err(format!(
                "\"auto\" needs a bound of the speeds, and gravity acts along {name} without a wall where it leads to; \
                 name ten times the fastest motion"
            ));
        };
        fall += pull.abs() * (farthest + pull.signum() * end).max(0.0);
    }
    let pressure = match scene.initial.stress {
        InitialStress::Pressure(pressure) => 2.0 * pressure / scene.material.density(),
        InitialStress::Zero | InitialStress::Hydrostatic | InitialStress::K0 { .. } => 0.0,
    };
    let bound = (first * first + 2.0 * fall + pressure).sqrt() + walls;
    if bound <= 0.0 {
        return Err(
            "\"auto\" needs something that moves: there is neither gravity nor a speed; name a speed of sound".into()
        );
    }
    let parts = [
        ("the speed at the start", first),
        ("a fall to the lowest place there is", (2.0 * fall).sqrt()),
        ("the pressure at the start", pressure.sqrt()),
        ("the walls", walls),
    ];
    let parts: Vec<_> =
        parts.iter().filter(|(_, speed)| *speed > 0.0).map(|(name, v)| format!("{name} {v:.3} m/s")).collect();
    let why = format!(
        "{TIMES_FASTEST} times the fastest motion to be expected, {bound:.3} m/s ({}), so that densities vary by 1 to 2 %",
        parts.join(", ")
    );
    Ok(Bound { speed: bound, why })
}

/// Whether a run may end at rest.
pub(super) struct Rest {
    /// The fraction of the peak kinetic energy; none: at the end of the time only.
    pub fraction: Option<f64>,
    /// Why, in words.
    pub why: String,
}

/// Whether a scene can come to rest, and is at rest where its kinetic energy has gone. `flow` is what lets the material
/// flow.
pub(super) fn at_rest(scene: &Scene, flow: Option<&str>) -> Rest {
    let never = |why: String| Rest { fraction: None, why: format!("{why}: it runs to end.time") };
    let Some(flow) = flow else {
        return never(
            "it is held on every side and can only settle, and at each turn of an oscillation it stands still".into(),
        );
    };
    let strength = match &scene.material {
        Material::DruckerPrager(law) => law.friction_deg.max(law.cohesion),
        Material::ViscoPlastic(law) => law.friction_deg.max(law.cohesion),
        Material::MuI(law) => law.friction_static,
    };
    if strength == 0.0 {
        return never("it has neither friction nor cohesion: it sloshes, and stands still at every turn".into());
    }
    if scene.walls.iter().any(|wall| wall.velocity != [0.0; 3]) {
        return never("a wall moves and drives it".into());
    }
    for axis in (0..3).filter(|&axis| scene.periodic[axis].is_some()) {
        if scene.gravity[axis] != 0.0 || scene.bodies.iter().any(|body| body.velocity[axis] != 0.0) {
            return never(format!("it flows along the period, {}, without an end", AXES[axis]));
        }
    }
    if scene.gravity[2] >= 0.0 || scene.terrain.is_none() && !scene.walls.iter().any(|w| w.axis == 2 && w.side > 0.0) {
        return never("no floor catches it".into());
    }
    let rises = |velocity: [f64; 3]| (0..3).map(|axis| velocity[axis] * scene.gravity[axis]).sum::<f64>() < 0.0;
    if let Some(body) = scene.bodies.iter().find(|body| rises(body.velocity)) {
        return never(format!("body `{}` moves up, and stands still where it turns", body.name));
    }
    let ends = if scene.material.is_fluid() { "creeps ever more slowly" } else { "comes to rest" };
    Rest { fraction: Some(AT_REST), why: format!("it can flow ({flow}), and {ends} on its floor") }
}

fn speed(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}
