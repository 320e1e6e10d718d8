//! What the program chose where a scene says `"auto"`: a short block before the particles are made, and whole sentences
//! for `explain` and the provenance.

use crate::{
    fill,
    lattice::Lattice,
    summary::{self, short},
};
use formats::{
    scene::{Chosen, Material, Scene},
    space::Space,
};

/// The block that is printed; empty where nothing was left to choose.
pub fn block(scene: &Scene) -> String {
    let Some(chosen) = &scene.chosen else { return String::new() };
    let mut out = String::new();
    let mut line = |name: &str, text: &str| out += &format!("{name:<12} {text}\n");
    chosen.choices.iter().for_each(|choice| line("chosen", &choice.to_string()));
    chosen.refused.iter().for_each(|why| line("not chosen", why));
    if let Some(saving) = Saving::of(scene, chosen) {
        line("saving", &saving.text());
    }
    out
}

/// All that was chosen and what it means, one sentence each; empty where nothing was left to choose.
pub fn sentences(scene: &Scene) -> Vec<String> {
    let Some(chosen) = &scene.chosen else { return Vec::new() };
    let choices = chosen.choices.iter().map(|choice| format!("{choice}."));
    let mut all: Vec<String> = choices.chain(chosen.refused.iter().map(|why| format!("Not chosen: {why}."))).collect();
    all.extend(Saving::of(scene, chosen).map(|saving| format!("{}.", saving.text())));
    all.extend(chosen.notes.iter().cloned());
    all
}

/// What a scene that names its space could spare; None where it is as small as it can be.
pub fn advice(scene: &Scene, smaller: Option<&Scene>) -> Option<String> {
    let smaller = smaller?;
    let saving = Saving::of(smaller, smaller.chosen.as_ref()?)?;
    let names: Vec<_> =
        ["x", "y"].into_iter().zip(smaller.symmetry).filter(|(_, is)| *is).map(|(name, _)| name).collect();
    let (what, change) = if smaller.space == scene.space {
        let planes = names.iter().map(|name| format!("{name} = 0")).collect::<Vec<_>>().join(" and ");
        let list = names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
        (format!("is symmetric about {planes}"), format!("symmetry = [{list}]"))
    } else if smaller.space == Space::Axisymmetric {
        ("is the same all around its axis".into(), format!("space = \"{}\"", smaller.space.name()))
    } else {
        ("is the same all along y".into(), format!("space = \"{}\"", smaller.space.name()))
    };
    let automatic = if scene.space == Space::ThreeD { "space" } else { "symmetry" };
    let less = short(saving.factor());
    let so = format!("{automatic} = \"auto\" does so");
    Some(format!("advice: this scene {what}: {change} would take {less} times fewer particle-steps; {so}\n"))
}

/// What a stiffness that is just enough would save; for the law whose stiffness is a property of the material.
/// `fastest` is the fastest motion that is to be expected, m/s.
pub fn softer(scene: &Scene, fastest: f64) -> Option<String> {
    let Material::DruckerPrager(law) = &scene.material else { return None };
    let times = scene.material.sound_speed() / (10.0 * fastest);
    let young = law.young / (times * times);
    (times >= 1.5 && fastest > 0.0).then(|| {
        format!(
            "A Young's modulus of {:.2e} Pa would take {times:.1} times fewer steps, with sound still ten times as fast \
             as the fall. It is a property of the material and never chosen for you: from a tenth to ten times the modulus \
             heights of deposits moved by 6 % at most, but run-outs by more than half, through the artificial viscosity \
             (VALIDATION.md). Where run-outs count, compare two values.",
            young
        )
    })
}

/// Particle-steps of a scene against its full description.
struct Saving {
    less: f64,
    full: f64,
    space: Space,
}

impl Saving {
    /// None where no axis, body or wall was left out.
    fn of(scene: &Scene, chosen: &Chosen) -> Option<Self> {
        let full = &*chosen.full;
        let same = scene.space == full.space && scene.symmetry == full.symmetry;
        (!same).then(|| Self { less: particle_steps(scene), full: particle_steps(full), space: full.space })
    }

    fn factor(&self) -> f64 {
        let factor = self.full / self.less;
        if factor < 10.0 { (factor * 10.0).round() / 10.0 } else { factor.round() }
    }

    fn text(&self) -> String {
        let (less, full, space) = (short(self.less), short(self.full), self.space.name());
        format!("{less} particle-steps instead of {full} in full ({space}): {} times fewer", short(self.factor()))
    }
}

/// Particles times steps.
fn particle_steps(scene: &Scene) -> f64 {
    let particles: u64 = fill::lattices(scene).iter().map(Lattice::estimate).sum();
    particles as f64 * summary::time_step(scene).1 as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::scene::Sources;

    const COLUMN: &str = "space = \"SPACE\"\nspacing = \"1 cm\"\n[material.drucker-prager]\ndensity = 2600\nyoung = \"6 MPa\"\n\
                          poisson = 0.3\nfriction = 30\ncohesion = 0\n[body.heap]\nSHAPE\n[initial]\njitter = 0.1\n\
                          [wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n[end]\ntime = 0.4\n";
    const CYLINDER: &str = "cylinder = { radius = 0.2, height = 0.1 }";
    const BOX: &str = "box = { min = [-0.1, -0.1, 0], max = [0.1, 0.1, 0.2] }";

    fn text(space: &str, shape: &str) -> String {
        COLUMN.replace("SPACE", space).replace("SHAPE", shape)
    }

    fn read(text: &str) -> Scene {
        Scene::read("scene", text).unwrap()
    }

    #[test]
    fn what_is_saved_is_counted_by_the_lattices() {
        let scene = read(&text("auto", CYLINDER));
        let told = block(&scene);
        assert!(told.starts_with("chosen       space = \"axisymmetric\": all bodies are upright"), "{told}");
        // 20 x 10 rings instead of 10 pi 20^2 cubes, in more but shorter steps.
        let (rings, cubes) = (200.0 * summary::time_step(&scene).1 as f64, scene.chosen.as_ref().unwrap());
        let cubes = 12566.0 * summary::time_step(&cubes.full).1 as f64;
        let saving = format!("saving       {} particle-steps instead of {} in full (3d)", short(rings), short(cubes));
        assert!(told.contains(&saving), "{saving} in {told}");
        assert!(sentences(&scene).iter().any(|s| s.contains("random displacement")));
        assert!(block(&read(&text("3d", CYLINDER))).is_empty() && sentences(&read(&text("3d", CYLINDER))).is_empty());
        let quarter = block(&read(&text("auto", BOX)));
        assert!(quarter.contains("symmetry = [\"x\", \"y\"]") && quarter.contains(": 4 times fewer"), "{quarter}");
        assert!(quarter.contains("not chosen   axisymmetric: body `heap` is no upright cylinder"), "{quarter}");
    }

    /// Volume of all particles, m3; m2 in plane strain.
    fn volume(scene: &Scene) -> f64 {
        let of = |lattice: &Lattice| {
            let columns = (0..lattice.columns()).map(|number| lattice.column(number));
            columns.map(|column| column.cells as f64 * lattice.bulk_volume(&column)).sum::<f64>()
        };
        fill::lattices(scene).iter().map(of).sum()
    }

    #[test]
    fn what_is_left_out_is_there_as_images_around_or_along() {
        let between = |text: &str| {
            let wall = |at: &str, side: &str| {
                format!("[wall.{side}]\naxis = \"y\"\nat = {at}\nside = \"{side}\"\nslip = \"free-slip\"\n")
            };
            format!("{text}{}{}", wall("-0.1", "above"), wall("0.1", "below"))
        };
        let wedges = "wedge = { corner = [0, -0.1, 0], size = [0.2, 0.2, 0.1], falls = \"left\" }\n[body.other]\n\
                      wedge = { corner = [0, -0.1, 0], size = [0.2, 0.2, 0.1], falls = \"right\" }";
        // What the part has to be multiplied with, and how exactly: circles are cut into squares.
        for (text, times, exactly) in [
            (text("auto", BOX), 4.0, 1e-12),
            (text("auto", wedges), 4.0, 1e-12),
            (between(&text("auto", BOX)), 2.0 * 0.2, 1e-12),
            (between(&text("auto", wedges)), 2.0 * 0.2, 1e-12),
            (text("3d", CYLINDER).replace("spacing", "symmetry = \"auto\"\nspacing"), 4.0, 1e-12),
            (text("auto", CYLINDER), 1.0, 0.01),
        ] {
            let scene = read(&text);
            let full = volume(&scene.chosen.as_ref().unwrap().full);
            assert!((times * volume(&scene) / full - 1.0).abs() < exactly, "{} of {full}: {text}", volume(&scene));
        }
    }

    #[test]
    fn a_scene_that_could_be_smaller_is_told_so() {
        let told = |space: &str, shape: &str| {
            let text = text(space, shape);
            let smaller = Scene::smaller("scene", &text, &Sources::from_bytes(&[]));
            advice(&read(&text), smaller.as_ref()).unwrap_or_default()
        };
        let quarter = "advice: this scene is symmetric about x = 0 and y = 0: symmetry = [\"x\", \"y\"] would take 4 times fewer \
                       particle-steps; space = \"auto\" does so\n";
        assert_eq!(told("3d", BOX), quarter);
        assert!(
            told("3d", CYLINDER)
                .starts_with("advice: this scene is the same all around its axis: space = \"axisymmetric\"")
        );
        assert!(told("plane-strain", BOX).contains("2 times fewer particle-steps; symmetry = \"auto\" does so"));
        assert_eq!(told("axisymmetric", CYLINDER), "");
    }

    #[test]
    fn a_softer_material_is_told_of_and_not_chosen() {
        let scene = read(&text("auto", CYLINDER));
        let sound = scene.material.sound_speed();
        let told = softer(&scene, sound / 40.0).unwrap();
        assert!(told.starts_with("A Young's modulus of 3.75e5 Pa would take 4.0 times fewer steps"), "{told}");
        assert_eq!(softer(&scene, sound / 12.0), None);
    }
}
