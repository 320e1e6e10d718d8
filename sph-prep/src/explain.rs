//! `sph-prep explain scene.toml`: what a scene is, in plain words, what computing it takes, and what it leaves out.

use crate::{
    advice, chosen, fill,
    lattice::Lattice,
    memory::Load,
    summary::{self, short, size},
};
use formats::{
    scene::{Body, InitialStress, Material, Numerics, Obstacle, Scene, Shape, Slip, Unyielded, Wall, WallKind},
    space::Space,
};
use std::path::PathBuf;

/// Say in plain words what a scene is, what computing it takes, and what it leaves out. Makes nothing.
#[derive(Clone, Debug, clap::Parser)]
#[command(name = "sph-prep explain", bin_name = "sph-prep explain")]
pub struct Arguments {
    /// The scene file
    pub scene: PathBuf,
}

/// Longest line.
const WIDTH: usize = 100;

/// The whole text about a scene; `smaller` is the advice on what it could spare.
pub fn text(scene: &Scene, smaller: Option<&str>) -> String {
    let lattices = fill::lattices(scene);
    let parts = [
        ("What it is", what(scene)),
        ("What was chosen", chosen::sentences(scene)),
        ("How it is computed", how(scene, &lattices)),
        ("What comes out", out(scene)),
        ("What it leaves out", without(scene)),
        ("Advice", advices(scene, smaller)),
        ("Warnings", warnings(scene, &lattices)),
    ];
    let mut all = format!("{}\n", if scene.title.is_empty() { "A scene without a title" } else { &scene.title });
    for (heading, sentences) in parts.iter().filter(|p| !p.1.is_empty()) {
        all += &format!("\n{heading}\n");
        sentences.iter().for_each(|sentence| all += &wrapped(sentence));
    }
    all
}

/// A sentence as an item of a list, in lines of at most [`WIDTH`].
fn wrapped(sentence: &str) -> String {
    let mut lines = vec![String::from("  -")];
    for word in sentence.split_whitespace() {
        if lines[lines.len() - 1].chars().count() + 1 + word.chars().count() > WIDTH {
            lines.push("   ".into());
        }
        let last = lines.len() - 1;
        lines[last] += &format!(" {word}");
    }
    lines.join("\n") + "\n"
}

fn speed(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

fn what(scene: &Scene) -> Vec<String> {
    let mut all: Vec<String> = scene.bodies.iter().map(|body| self::body(scene, body)).collect();
    all.push(material(&scene.material));
    all.extend(scene.walls.iter().map(wall));
    all.extend(scene.obstacles.iter().map(obstacle));
    for (axis, ends) in scene.periodic.iter().enumerate() {
        if let Some([low, high]) = ends {
            let name = ["x", "y", "z"][axis];
            all.push(format!("What leaves at {name} = {} m comes in again at {} m.", short(*high), short(*low)));
        }
    }
    let [x, y, z] = scene.gravity;
    all.push(match (x == 0.0 && y == 0.0, z < 0.0) {
        (true, true) => format!("Gravity pulls down with {} m/s2.", short(-z)),
        _ if speed(scene.gravity) == 0.0 => "There is no gravity.".into(),
        _ => format!("Gravity is ({}, {}, {}) m/s2: a slope, seen along it.", short(x), short(y), short(z)),
    });
    all.push(match scene.initial.stress {
        InitialStress::Zero => "It starts without stress: its own weight first has to settle on it.".into(),
        InitialStress::Pressure(p) => format!("It starts under a pressure of {} Pa.", short(p)),
        InitialStress::Hydrostatic => "It starts under its own weight, the same in all directions.".into(),
        InitialStress::K0 { coefficient } => {
            format!("It starts under its own weight, with {} times the vertical stress sideways.", short(coefficient))
        }
    });
    all
}

fn body(scene: &Scene, body: &Body) -> String {
    let (low, high) = body.shape.bounds(scene.space);
    let size = [0, 1, 2].map(|axis| short(high[axis] - low[axis]));
    let flat = scene.space.dimension() == 2;
    let shape = if let Shape::Cylinder { radius, height, .. } = body.shape {
        format!("a cylinder of radius {} m and height {} m", short(radius), short(height))
    } else if let Shape::Wedge { falls_left, .. } = body.shape {
        let side = if falls_left { "left" } else { "right" };
        format!("a wedge {} m long and {} m high that falls to the {side}", size[0], size[2])
    } else if flat {
        format!("a body {} m long and {} m high", size[0], size[2])
    } else {
        format!("a body of {} m x {} m x {} m", size[0], size[1], size[2])
    };
    let start = match speed(body.velocity) {
        0.0 => "released at rest".to_string(),
        v => format!("moving at {} m/s", short(v)),
    };
    format!("`{}` is {shape}, {start}.", body.name)
}

fn material(material: &Material) -> String {
    let density = short(material.density());
    if let Material::DruckerPrager(law) = material {
        let cohesion = match law.cohesion {
            0.0 => "no cohesion".to_string(),
            c => format!("{} Pa of cohesion", short(c)),
        };
        let dilation = match law.dilation_deg {
            0.0 => "keeps its volume when it yields".to_string(),
            angle => format!("dilates by {} degrees when it yields", short(angle)),
        };
        return format!(
            "It is an elastic, perfectly plastic grain mass (Drucker-Prager) of {density} kg/m3, {} degrees of friction and \
             {cohesion}, which {dilation}.",
            short(law.friction_deg)
        );
    }
    if let Material::MuI(law) = material {
        return format!(
            "It is a granular fluid (mu(I) law) of {density} kg/m3, with a friction coefficient from {} at rest to {} in fast flow.",
            short(law.friction_static),
            short(law.friction_dynamic)
        );
    }
    if let Material::ViscoPlastic(law) = material {
        return format!(
            "It is a Bingham fluid of {density} kg/m3 whose yield stress grows with pressure, by {} degrees of friction.",
            short(law.friction_deg)
        );
    }
    format!("Its density is {density} kg/m3.")
}

fn wall(wall: &Wall) -> String {
    let name = match (wall.axis, wall.side > 0.0) {
        (2, true) => "A floor",
        (2, false) => "A ceiling",
        _ => "A wall",
    };
    let slip = slip(wall.slip);
    let moves = match speed(wall.velocity) {
        0.0 => String::new(),
        v => format!("; it slides along itself at {} m/s", short(v)),
    };
    let kind = if wall.kind == WallKind::Mirror { ", made of mirror images" } else { "" };
    format!("{name} at {} = {} m, {slip}{kind}{moves}.", ["x", "y", "z"][wall.axis], short(wall.at))
}

fn slip(slip: Slip) -> &'static str {
    match slip {
        Slip::NoSlip => "to which the material sticks",
        Slip::FreeSlip => "along which it slides without friction",
    }
}

fn obstacle(obstacle: &Obstacle) -> String {
    let (low, high) = (obstacle.solid.low, obstacle.solid.high);
    let [x, y, z] = [0, 1, 2].map(|a| short(high[a] - low[a]));
    let place = format!("from ({}, {}, {})", short(low[0]), short(low[1]), short(low[2]));
    format!("`{}` is a fixed obstacle of {x} m x {y} m x {z} m {place} on, {}.", obstacle.name, slip(obstacle.slip))
}

fn how(scene: &Scene, lattices: &[Lattice]) -> Vec<String> {
    let load = Load::of(scene, lattices);
    let (dt, steps) = summary::time_step(scene);
    let kernel = scene.kernel.name();
    let across = lattices.iter().map(Lattice::estimate).max().unwrap_or(0) as f64;
    let across = across.powf(1.0 / scene.space.dimension() as f64);
    vec![
        format!(
            "About {} particles, {} m apart (some {} along a side), each felt as far as {} m away (kernel {kernel}, h = {} m).",
            load.particles,
            short(scene.spacing),
            short(across.round()),
            short(2.0 * scene.h()),
            short(scene.h())
        ),
        format!(
            "Besides, about {} virtual particles stand for the walls at the start: only where material is within reach; of the terms of \
             laws and stabilisers only those that the scene uses are computed.",
            load.walls
        ),
        format!(
            "About {steps} steps of {} s to {} s: a sound wave, {} m/s fast, may not cross {} h in one.",
            short(dt),
            short(scene.end.time),
            short(scene.material.sound_speed()),
            short(scene.numerics.courant)
        ),
        dissipation(&scene.numerics),
        format!(
            "That makes {} particle-steps and takes about {} of memory on one rank.",
            short(load.particles as f64 * steps as f64),
            size(load.bytes(1))
        ),
    ]
}

/// What the results depend on beside the law: said whether the scene names it or not.
fn dissipation(numerics: &Numerics) -> String {
    let pairs = if numerics.viscosity_on_approach { "particles that approach each other" } else { "all particles" };
    let viscosity = match numerics.viscosity {
        0.0 => "No artificial viscosity acts".into(),
        alpha => format!("An artificial viscosity of {} acts between {pairs}", short(alpha)),
    };
    match numerics.density_gate {
        0.0 => viscosity + ".",
        gate => format!(
            "{viscosity}; what is below {} of its density has come apart, and carries nothing until it is closed again.",
            short(gate)
        ),
    }
}

fn out(scene: &Scene) -> Vec<String> {
    let rest = match scene.end.at_rest {
        Some(part) => format!("; earlier, once the kinetic energy is below {} of its peak", short(part)),
        None => String::new(),
    };
    let history = short(scene.output.history);
    vec![format!(
        "{} snapshots, one every {} s, and a line of energies, front and height every {history} s, until {} s{rest}.",
        summary::snapshots(scene),
        short(scene.output.snapshots),
        short(scene.end.time)
    )]
}

fn without(scene: &Scene) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    let mut say = |text: &str| all.push(text.into());
    match scene.space {
        Space::PlaneStrain => {
            say(
                "Nothing moves or changes across the plane (y): the friction of side walls, spreading across and three-dimensional \
                 flow are left out; masses, forces and energies are for a metre of depth.",
            );
        }
        Space::Axisymmetric => {
            say(
                "All is the same around the axis, and the deposit round by construction: no swirl, no fingers, no wall beside it. \
                 Near the axis the scheme is less accurate: the pressure dips there.",
            );
        }
        Space::ThreeD => {}
    }
    match scene.symmetry.iter().filter(|s| **s).count() {
        0 => {}
        1 => say(
            "Half is computed, the other half is taken for its mirror image: nothing moves across the plane between them, and what \
             breaks the symmetry is left out.",
        ),
        _ => say(
            "A quarter is computed, the rest is taken for mirror images: nothing moves across the planes between them, and what \
             breaks the symmetry is left out.",
        ),
    }
    say("Air, water and pore pressure; single grains, their shape, rolling and breaking.");
    if let Material::DruckerPrager(law) = &scene.material {
        say("The strength does not depend on how fast it shears, nor on how densely it is packed (no critical state).");
        if law.dilation_deg == 0.0 {
            say("Dilatancy: the volume changes elastically only, but for what is gained where material is torn apart.");
        }
    } else {
        say("How densely it is packed, and what a start needs more than to go on (no hysteresis, no critical state).");
        if let Material::MuI(law) = &scene.material
            && matches!(law.unyielded, Unyielded::Cap(_))
        {
            say("A deposit at rest: below yield it is a stiff fluid, which goes on creeping.");
        }
    }
    let fastest = fastest(scene);
    let sound = scene.material.sound_speed();
    if fastest > 0.0 {
        say(&format!(
            "True stiffness: sound travels at {} m/s, {} times as fast as a fall from its height{}.",
            short(sound),
            short((sound / fastest * 10.0).round() / 10.0),
            if sound < 10.0 * fastest { "; below 10 the material is compressed visibly" } else { "" }
        ));
    }
    all
}

/// The speed of a fall from the highest point to the floor, or that of a body at the start, m/s.
fn fastest(scene: &Scene) -> f64 {
    let top = scene.bodies.iter().map(|b| b.shape.bounds(scene.space).1[2]).fold(f64::NEG_INFINITY, f64::max);
    let fall = (2.0 * speed(scene.gravity) * (top - scene.floor()).max(0.0)).sqrt();
    scene.bodies.iter().map(|b| speed(b.velocity)).fold(fall, f64::max)
}

fn advices(scene: &Scene, smaller: Option<&str>) -> Vec<String> {
    let smaller = smaller.map(|advice| advice.trim().trim_start_matches("advice: ").to_owned() + ".");
    smaller.into_iter().chain(chosen::softer(scene, fastest(scene))).collect()
}

fn warnings(scene: &Scene, lattices: &[Lattice]) -> Vec<String> {
    let bodies = summary::estimated(scene, lattices);
    let text = advice::warnings(scene, lattices, &bodies);
    text.lines().map(|line| line.trim_start_matches("warning: ").to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMN: &str = r#"
title = "Column"
space = "SPACE"
spacing = "1 cm"
[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.heap]
box = { min = [0, 0, 0], max = ["0.2 m", "WIDTH", "0.1 m"] }
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "0.4 s"
"#;

    fn explained(space: &str, width: &str) -> String {
        let text = COLUMN.replace("SPACE", space).replace("WIDTH", width);
        self::text(&Scene::read("scene", &text).unwrap(), None)
    }

    #[test]
    fn a_scene_is_told_with_its_numbers_and_its_limits() {
        let plane = explained("plane-strain", "0 m");
        let flat = plane.split_whitespace().collect::<Vec<_>>().join(" ");
        for words in [
            "`heap` is a body 0.2 m long and 0.1 m high, released at rest.",
            "30 degrees of friction and no cohesion, which keeps its volume when it yields.",
            "A floor at z = 0 m, to which the material sticks.",
            "Gravity pulls down with 9.81 m/s2.",
            "About 200 particles, 0.01 m apart",
            "a metre of depth",
            "no critical state",
            "True stiffness",
            "An artificial viscosity of 0.03 acts between particles that approach each other; what is below 0.98 of its density has",
        ] {
            assert!(flat.contains(words), "{words} in\n{plane}");
        }
        assert!(plane.lines().all(|line| line.chars().count() <= WIDTH), "{plane}");
        let space = explained("3d", "0.2 m");
        assert!(space.contains("0.2 m x 0.2 m x 0.1 m") && !space.contains("metre of depth"), "{space}");
        assert!(space.contains("About 4000 particles"), "{space}");
    }

    #[test]
    fn every_law_is_told() {
        let fluid = COLUMN.replace("SPACE", "plane-strain").replace("WIDTH", "0 m");
        let begin = fluid.find("[material").unwrap();
        let end = fluid.find("[body").unwrap();
        let with = |law: &str| {
            let text = fluid.replace(&fluid[begin..end], law);
            self::text(&Scene::read("scene", &text).unwrap(), None)
        };
        let mu = "[material.mu-i]\ndensity = 1500\nsound-speed = 20\nfriction-static = 0.38\nfriction-dynamic = 0.64\n\
                  inertial-number = 0.28\ngrain-diameter = 0.001\ngrain-density = 2500\n";
        let told = with(mu).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(told.contains("mu(I) law") && told.contains("from 0.38 at rest to 0.64"), "{told}");
        assert!(told.contains("goes on creeping"), "{told}");
        assert!(told.contains("viscosity of 0.01 acts between all particles."), "{told}");
    }
}
