//! From text to a checked scene: reads every section, fills in the defaults, and checks what is allowed.
//! What concerns places (bodies, walls, planes of symmetry) is in [`super::geometry`].

use super::{
    End, Output, Scene, SceneError, Shape, auto, geometry, held, initial, material, numerics, obstacle, period,
    raw::{Allowed, Faults, POSITIVE, Table, values},
    sources::Sources,
    terrain::{self, Terrain},
};
use crate::{kernel::Kernel, space::Space, units::Dimension};
use toml::de::DeTable;

const H_OVER_DX: Allowed = Allowed { says: "in [1, 3]", holds: |v| (1.0..=3.0).contains(&v) };
const AT_REST: Allowed =
    Allowed { says: "in (0, 1), a fraction of the peak kinetic energy", holds: |v| v > 0.0 && v < 1.0 };

/// Acceleration of gravity where the scene names none, m/s2.
const STANDARD_GRAVITY: f64 = 9.81;

/// What all sections lie in; None where the scene has a fault there.
pub(super) struct Setting<'a> {
    pub space: Option<Space>,
    pub spacing: Option<f64>,
    /// Smoothing length over spacing.
    pub h_over_dx: f64,
    pub gravity: Option<[f64; 3]>,
    pub symmetry: [bool; 2],
    pub periodic: [Option<[f64; 2]>; 3],
    /// Does the scene have one, be it with faults?
    pub has_terrain: bool,
    pub terrain: Option<Terrain>,
    pub sources: &'a Sources,
}

/// Checks the text of a scene file. All faults are reported at once, in the order of the file.
pub(super) fn scene(name: &str, text: &str, sources: &Sources) -> Result<Scene, SceneError> {
    let (document, syntax_errors) = DeTable::parse_recoverable(text);
    let mut document = document.into_inner();
    let asked = auto::Asked::of(&document);
    if !asked.nothing() && syntax_errors.is_empty() {
        return auto::resolve(name, text, document, &asked, sources);
    }
    asked.describe(&mut document);
    Ok(self::document(name, text, &document, &syntax_errors, sources)?.scene)
}

/// A checked scene.
pub(super) struct Checked {
    pub scene: Scene,
    /// What lets the material flow, in words; None where it can only settle.
    pub flow: Option<String>,
}

/// Checks a parsed document, in which nothing is left to the program to choose. Places are those in the text.
pub(super) fn document(
    name: &str,
    text: &str,
    document: &DeTable<'_>,
    syntax_errors: &[toml::de::Error],
    sources: &Sources,
) -> Result<Checked, SceneError> {
    let faults = Faults::new(text);
    for error in syntax_errors {
        faults.syntax(error);
    }
    let scene = read(Table::root(document, &faults), sources);
    if scene.is_none() && faults.is_empty() {
        faults.add(0, "", "cannot be understood as a scene");
    }
    match (scene, faults.into_list()) {
        (Some(scene), faults) if faults.is_empty() => Ok(scene),
        (_, faults) => Err(SceneError { file: name.to_string(), faults }),
    }
}

/// Reads every section before it gives up on any, so that no fault hides another.
fn read(root: Table<'_>, sources: &Sources) -> Option<Checked> {
    let (kernel, h_over_dx) = kernel(&root);
    let setting = setting(&root, h_over_dx, sources);
    let title = title(&root);
    let material = material::read(&root);
    let (bodies, walls) = geometry::read(&root, &setting);
    let initial = initial::read(&root, &setting, material.as_ref());
    if bodies.iter().flatten().any(|body| matches!(body.shape, Shape::Release(_))) {
        initial::on_terrain(&root, initial.as_ref());
    }
    let relaxes = initial.is_some_and(|initial| initial.relax > 0);
    let obstacles = obstacle::read(&root, &setting, bodies.as_deref(), walls.as_deref(), relaxes);
    // With a fault in a body or a wall nothing certain can be said.
    let flow = bodies.as_ref().zip(walls.as_ref()).and_then(|(b, w)| held::what_flows(b, w, &setting));
    let periodic = setting.periodic.iter().any(Option::is_some);
    let place = numerics::Place { space: setting.space, kernel, h_over_dx, periodic, flow: flow.clone() };
    let numerics = numerics::read(&root, place, material.as_ref());
    let end = end(&root);
    let output = output(&root, end.as_ref());
    root.finish();

    let bodies = bodies?;
    let names = || bodies.iter().map(|body| body.name.as_str()).collect::<Vec<_>>().join(", ");
    let scene = Scene {
        title: title.unwrap_or_else(names),
        space: setting.space?,
        spacing: setting.spacing?,
        gravity: setting.gravity?,
        symmetry: setting.symmetry,
        periodic: setting.periodic,
        kernel,
        h_over_dx,
        material: material?,
        bodies,
        walls: walls?,
        terrain: if setting.has_terrain { Some(setting.terrain?) } else { None },
        obstacles: obstacles?,
        files: sources.digests(),
        initial: initial?,
        numerics: numerics?,
        end: end?,
        output: output?,
        chosen: None,
    };
    Some(Checked { scene, flow })
}

fn setting<'a>(root: &Table<'_>, h_over_dx: f64, sources: &'a Sources) -> Setting<'a> {
    // "auto" has become one of the others by now; it is here for the list of what is valid.
    let [plane, rings, three] = Space::ALL.map(|space| (space.name(), Some(space)));
    let space = root.needed_choice("space", &[plane, rings, three, ("auto", None)]).and_then(|found| found.value);
    let spacing = root.needed("spacing", Dimension::Length, &POSITIVE).map(|found| found.value);
    let gravity = gravity(root, space);
    let symmetry = symmetry(root, space, gravity);
    let periodic = period::read(root, space, spacing, symmetry, h_over_dx);
    let has_terrain = root.has("terrain");
    let terrain = terrain::read(root, space, spacing, sources);
    Setting { space, spacing, h_over_dx, gravity, symmetry, periodic, has_terrain, terrain, sources }
}

fn title(root: &Table<'_>) -> Option<String> {
    let title = root.text("title")?;
    if title.value.contains(['\n', '\r']) {
        root.faults.at(&title, "must be a single line");
    }
    Some(title.value)
}

fn gravity(root: &Table<'_>, space: Option<Space>) -> Option<[f64; 3]> {
    let given = root.vector_or_number("gravity", Dimension::Acceleration);
    if !root.has("gravity") {
        return Some([0.0, 0.0, -STANDARD_GRAVITY]);
    }
    match given? {
        Ok(magnitude) if magnitude.value < 0.0 => {
            let message = "a magnitude must be 0 or greater, and points down -z; for another direction write an array \
                           [x, y, z]";
            root.faults.at(&magnitude, message);
            None
        }
        Ok(magnitude) => Some([0.0, 0.0, 0.0 - magnitude.value]),
        Err(vector) => {
            let still: &[usize] = match space {
                Some(Space::PlaneStrain) => &[1],
                Some(Space::Axisymmetric) => &[0, 1],
                Some(Space::ThreeD) | None => &[],
            };
            for &axis in still.iter().filter(|&&axis| vector[axis].value != 0.0) {
                let space = space.map_or("", Space::name);
                let message = format!("gravity along {} must be 0 in the space \"{space}\"", AXES[axis]);
                root.faults.at(&vector[axis], message);
            }
            Some(values(&vector))
        }
    }
}

/// Names of the axes.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

fn symmetry(root: &Table<'_>, space: Option<Space>, gravity: Option<[f64; 3]>) -> [bool; 2] {
    let mut symmetry = [false; 2];
    for plane in root.choices("symmetry", &[("x", 0), ("y", 1)]) {
        let axis: usize = plane.value;
        let name = AXES[axis];
        if symmetry[axis] {
            root.faults.at(&plane, format!("\"{name}\" is named twice"));
        }
        match space {
            Some(Space::Axisymmetric) => {
                let message = "the space \"axisymmetric\" takes no planes of symmetry: the axis is implied";
                root.faults.at(&plane, message);
            }
            Some(Space::PlaneStrain) if axis == 1 => {
                let message = "the space \"plane-strain\" has no y axis; the only plane of symmetry there is \"x\"";
                root.faults.at(&plane, message);
            }
            _ => symmetry[axis] = true,
        }
        if symmetry[axis] && gravity.is_some_and(|gravity| gravity[axis] != 0.0) {
            let message = format!("gravity has a component along {name}, across this plane of symmetry");
            root.faults.at(&plane, format!("{message}; drop the plane, or make that component 0"));
        }
    }
    symmetry
}

/// The kernel and h/dx.
fn kernel(root: &Table<'_>) -> (Kernel, f64) {
    let table = root.child("kernel");
    let kind = table.choice("kind", &Kernel::ALL.map(|kernel| (kernel.name(), kernel)));
    let kind = kind.map_or(Kernel::CubicSpline, |found| found.value);
    let ratio = table.number("h-over-dx", Dimension::Number, &H_OVER_DX);
    table.finish();
    (kind, ratio.map_or(kind.default_h_over_dx(), |found| found.value))
}

fn end(root: &Table<'_>) -> Option<End> {
    let table = root.needed_child("end");
    let time = table.needed("time", Dimension::Time, &POSITIVE);
    let at_rest = table.number("at-rest", Dimension::Number, &AT_REST);
    table.finish();
    Some(End { time: time?.value, at_rest: at_rest.map(|found| found.value) })
}

fn output(root: &Table<'_>, end: Option<&End>) -> Option<Output> {
    let table = root.child("output");
    let interval = |key| {
        let found = table.number(key, Dimension::Time, &POSITIVE);
        if let (Some(found), Some(end)) = (&found, end)
            && found.value > end.time
        {
            let source = table.faults.source(found);
            table.faults.at(found, format!("{source} is later than end.time = {} s; it must not be", end.time));
        }
        found.map(|found| found.value)
    };
    let (snapshots, history) = (interval("snapshots"), interval("history"));
    table.finish();
    let end = end?;
    Some(Output { snapshots: snapshots.unwrap_or(end.time / 20.0), history: history.unwrap_or(end.time / 400.0) })
}
