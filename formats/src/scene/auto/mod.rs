//! `"auto"` in a scene: the program chooses, and says what, why, and what it did not take.
//!
//! How data moves: the text is parsed once. Where it says `"auto"`, the document is read as the full description first
//! (three dimensions, no planes of symmetry), with what follows from it alone (speed of sound, end) written in. Pure
//! functions look at that scene and give the edits of the document that somebody would make who writes the smaller
//! scene by hand ([`symmetry`]). The edited document is read and checked like any other: the scene that comes out is
//! that of the text by hand, and where it has a fault the reduction is refused with that fault as the reason. All of it
//! follows from the text, so that every program that reads it comes to the same scene.

mod edit;
mod motion;
mod symmetry;

use super::{
    Fault, Scene, SceneError,
    check::{self, Checked},
    raw::Faults,
    sources::Sources,
};
use crate::space::Space;
use edit::{Edit, has, is_auto, text_at};
use std::fmt;
use symmetry::Reduction;
use toml::de::DeTable;

/// What was chosen where a scene says `"auto"`.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The choices, in the order of the file's sections.
    pub choices: Vec<Choice>,
    /// What was looked at and not taken, and why: one sentence each.
    pub refused: Vec<String>,
    /// What else there is to know: one sentence each.
    pub notes: Vec<String>,
    /// The scene as it is described, before bodies, walls and axes were left out.
    pub full: Box<Scene>,
}

/// One choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Path of the key that says `"auto"`, or leaves it to the space to say so.
    pub key: String,
    /// What stands for it, as one would write it.
    pub value: String,
    /// Why.
    pub why: String,
    /// Does it decide how particles move? When a run is over does not.
    binds: bool,
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: {}", self.key, self.value, self.why)
    }
}

impl Chosen {
    /// The choices that particles depend on, for the hash of a scene: a program that chooses otherwise must not go on
    /// with them. Empty where none is.
    pub(super) fn canonical(&self) -> String {
        let binding = self.choices.iter().filter(|choice| choice.binds);
        binding.map(|choice| format!("{} = {}\n", choice.key, choice.value)).collect()
    }
}

impl Scene {
    /// The scene that `"auto"` would make of one that names its space, where that is smaller: in fewer dimensions, or
    /// cut at a plane of symmetry that the text says nothing about. None where nothing is gained, or the scene has
    /// faults.
    pub fn smaller(name: &str, text: &str, sources: &Sources) -> Option<Self> {
        let (mut document, errors) = DeTable::parse_recoverable(text);
        let space = text_at(document.get_ref(), &["space"])?.to_string();
        let may_be_less = space == Space::ThreeD.name()
            || space == Space::PlaneStrain.name() && !has(document.get_ref(), &["symmetry"]);
        // With a terrain or obstacles nothing can be left out, and their files are large.
        let has_files = ["terrain", "obstacle"].iter().any(|key| has(document.get_ref(), &[key]));
        if !errors.is_empty() || !may_be_less || has_files {
            return None;
        }
        let names_planes = has(document.get_ref(), &["symmetry"]);
        let key = if space == Space::ThreeD.name() { "space" } else { "symmetry" };
        edit::set_text(document.get_mut(), &[key], "auto");
        let asked = Asked::of(document.get_ref());
        let scene = resolve(name, text, document.into_inner(), &asked, sources).ok()?;
        let full = &scene.chosen.as_ref()?.full;
        let cut = !names_planes && scene.symmetry != full.symmetry;
        (scene.space != full.space || cut).then_some(scene)
    }
}

/// Which keys say `"auto"`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Asked {
    space: bool,
    symmetry: bool,
    /// The law whose speed of sound does.
    sound_speed: Option<&'static str>,
    at_rest: bool,
}

impl Asked {
    pub fn of(document: &DeTable<'_>) -> Self {
        let space = is_auto(document, &["space"]);
        let laws = ["mu-i", "visco-plastic"];
        Self {
            space,
            symmetry: is_auto(document, &["symmetry"]) || space && !has(document, &["symmetry"]),
            sound_speed: laws.into_iter().find(|law| is_auto(document, &["material", law, "sound-speed"])),
            at_rest: is_auto(document, &["end", "at-rest"]),
        }
    }

    pub fn nothing(&self) -> bool {
        *self == Self::default()
    }

    fn sound_path(&self) -> Option<[&'static str; 3]> {
        self.sound_speed.map(|law| ["material", law, "sound-speed"])
    }

    /// Turns the document into that of the full description: nothing in it is left to the program.
    pub fn describe(&self, document: &mut DeTable<'_>) {
        if self.space {
            edit::set_text(document, &["space"], Space::ThreeD.name());
        }
        if self.symmetry {
            edit::remove(document, &["symmetry"]);
        }
        if let Some(path) = self.sound_path() {
            edit::set_text(document, &path, PLACEHOLDER);
        }
        if self.at_rest {
            edit::remove(document, &["end", "at-rest"]);
        }
    }
}

/// A speed of sound that hides no fault, while the true one is not known yet, m/s.
const PLACEHOLDER: &str = "1e6 m/s";

/// The scene of a document that leaves choices to the program.
pub(super) fn resolve(
    name: &str,
    text: &str,
    mut document: DeTable<'_>,
    asked: &Asked,
    sources: &Sources,
) -> Result<Scene, SceneError> {
    let read = |document: &DeTable<'_>| check::document(name, text, document, &[], sources);
    let mut choices = Vec::new();
    asked.describe(&mut document);
    let Checked { scene: mut full, flow } = read(&document)?;

    if let Some(path) = &asked.sound_path() {
        let key = path.join(".");
        let bound = motion::fastest(&full).map_err(|message| {
            let faults = Faults::new(text);
            faults.add(edit::place(&document, path), &key, message);
            SceneError { file: name.to_string(), faults: faults.into_list() }
        })?;
        // Three digits, as one would write it; the others mean nothing.
        let value = format!("{:.2e}", motion::TIMES_FASTEST * bound.speed);
        let value = format!("{} m/s", value.parse().unwrap_or(f64::NAN));
        edit::set_text(&mut document, path, &value);
        choices.push(Choice { key, value: format!("\"{value}\""), why: bound.why, binds: true });
    }
    if asked.at_rest {
        let rest = motion::at_rest(&full, flow.as_deref());
        if let Some(value) = rest.fraction {
            edit::set_text(&mut document, &["end", "at-rest"], &format!("{value:e}"));
        }
        let value = rest.fraction.map_or("none".into(), |value| format!("{value:e}"));
        choices.push(Choice { key: "end.at-rest".into(), value, why: rest.why, binds: false });
    }
    if asked.sound_speed.is_some() || asked.at_rest {
        full = read(&document)?.scene;
    }
    let mut chosen = Chosen { choices, refused: Vec::new(), notes: Vec::new(), full: Box::new(full) };
    let mut scene = reduced(&document, asked, &mut chosen, |document| Ok(read(document)?.scene))?;
    // It is named after all bodies, also those that are mirror images of others.
    scene.title.clone_from(&chosen.full.title);
    scene.chosen = Some(chosen);
    Ok(scene)
}

/// The smallest scene that does.
fn reduced(
    document: &DeTable<'_>,
    asked: &Asked,
    chosen: &mut Chosen,
    read: impl Fn(&DeTable<'_>) -> Result<Scene, SceneError>,
) -> Result<Scene, SceneError> {
    let full = (*chosen.full).clone();
    let mut take = |what: &str, found: Result<Reduction, String>| {
        found.map_err(|why| chosen.refused.push(format!("{what}: {why}"))).ok()
    };
    let flat = if asked.space {
        // No body can have both shapes, so that at most one of them is found.
        let round = take("axisymmetric", symmetry::axisymmetric(&full));
        round.or_else(|| take("plane strain", symmetry::plane_strain(&full)))
    } else {
        None
    };
    let (mut planes, mut no_planes) = (Vec::new(), Vec::new());
    if asked.symmetry && full.space != Space::Axisymmetric {
        for &axis in full.space.axes().iter().filter(|&&axis| axis < 2) {
            match symmetry::mirrored(&full, axis) {
                Ok(reduction) => planes.push((axis, reduction)),
                Err(why) => no_planes.push((axis, format!("{}: {why}", PLANES[axis]))),
            }
        }
    }

    for combination in combinations(flat.as_ref(), &planes) {
        let mut edited = document.clone();
        let edits: Vec<Edit> = combination.iter().flat_map(|part| part.edits.clone()).collect();
        edit::apply(&mut edited, &full, &edits);
        match read(&edited) {
            Ok(scene) => {
                chosen.choices.splice(0..0, made(&scene, asked, &combination));
                if !combination.is_empty() && scene.initial.jitter > 0.0 {
                    chosen.notes.push(JITTER.into());
                }
                // Of the axes that are left; around the axis of r-z all is mirrored anyway.
                let is_left = |axis: &usize| scene.space != Space::Axisymmetric && scene.space.axes().contains(axis);
                chosen.refused.extend(no_planes.into_iter().filter(|(axis, _)| is_left(axis)).map(|(_, why)| why));
                return Ok(scene);
            }
            Err(error) => chosen.refused.push(refusal(&combination, &error)),
        }
    }
    // The last combination is empty: the full scene, which was sound already.
    read(document)
}

const JITTER: &str = "The random displacement of particles at the start is no asymmetry of the scene: it is drawn anew for what is \
                      computed, and what it breaks in the whole is left out.";

/// The choices of a space and of planes that a combination of reductions stands for.
fn made(scene: &Scene, asked: &Asked, combination: &[&Reduction]) -> Vec<Choice> {
    let mut choices = Vec::new();
    if asked.space {
        let flat = combination.iter().find_map(|part| part.flat.as_ref());
        let why = flat.map_or("nothing less would do for what is described".into(), |flat| flat.why.clone());
        let value = format!("\"{}\"", scene.space.name());
        choices.push(Choice { key: "space".into(), value, why, binds: true });
    }
    if asked.symmetry && scene.space != Space::Axisymmetric {
        let planes: Vec<_> = ["x", "y"].into_iter().zip(scene.symmetry).filter(|(_, is)| *is).map(|(n, _)| n).collect();
        let why = if planes.is_empty() {
            "the scene is no mirror image of itself".into()
        } else {
            let planes = planes.join(" = 0 and ");
            format!("bodies with their velocities, walls and gravity are their own mirror images in {planes} = 0")
        };
        let names: Vec<_> = planes.iter().map(|name| format!("\"{name}\"")).collect();
        let value = format!("[{}]", names.join(", "));
        choices.push(Choice { key: "symmetry".into(), value, why, binds: true });
    }
    choices
}

const PLANES: [&str; 2] = ["mirror symmetry about x = 0", "mirror symmetry about y = 0"];

/// What to try, the cheapest first; nothing at all at the end.
fn combinations<'r>(flat: Option<&'r Reduction>, planes: &'r [(usize, Reduction)]) -> Vec<Vec<&'r Reduction>> {
    let mut all = Vec::new();
    if let Some(flat) = flat {
        let x = planes.iter().find(|(axis, _)| *axis == 0).map(|(_, reduction)| reduction);
        if let (Some(x), Some(Space::PlaneStrain)) = (x, flat.flat.as_ref().map(|flat| flat.space)) {
            all.push(vec![flat, x]);
        }
        all.push(vec![flat]);
    }
    let planes: Vec<&Reduction> = planes.iter().map(|(_, reduction)| reduction).collect();
    if planes.len() == 2 {
        all.push(planes.clone());
    }
    all.extend(planes.into_iter().map(|plane| vec![plane]));
    all.push(Vec::new());
    all
}

fn refusal(combination: &[&Reduction], error: &SceneError) -> String {
    let what: Vec<_> = combination.iter().map(|part| part.name).collect();
    let words = |fault: &Fault| format!("{}: {}", fault.key, fault.message);
    let why = error.faults.first().map_or_else(String::new, words);
    format!("{}: the scene would have a fault: {why}", what.join(" with "))
}
