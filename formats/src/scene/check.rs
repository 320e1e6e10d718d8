//! From text to a checked scene: reads every section, fills in the defaults, and checks what is allowed.
//! What concerns places (bodies, walls, planes of symmetry) is in [`super::geometry`].

use super::{
    Cone, DruckerPrager, End, Initial, InitialStress, Material, Numerics, Output, Rotation, Scene, SceneError,
    geometry,
    raw::{Allowed, Faults, Found, NOT_NEGATIVE, POSITIVE, Table, values},
};
use crate::{kernel::Kernel, space::Space, units::Dimension};
use toml::de::DeTable;

const POISSON: Allowed = Allowed { says: "in [0, 0.5)", holds: |v| (0.0..0.5).contains(&v) };
const FRICTION: Allowed = Allowed { says: "in [0, 90) degrees", holds: |v| (0.0..90.0).contains(&v) };
const H_OVER_DX: Allowed = Allowed { says: "in [1, 3]", holds: |v| (1.0..=3.0).contains(&v) };
const COURANT: Allowed = Allowed { says: "in (0, 1.7]", holds: |v| v > 0.0 && v <= 1.7 };
const VISCOSITY: Allowed = Allowed { says: "in [0, 1]", holds: |v| (0.0..=1.0).contains(&v) };
const DENSITY_GATE: Allowed =
    Allowed { says: "in [0, 1), a fraction of the initial density", holds: |v| (0.0..1.0).contains(&v) };
const JITTER: Allowed = Allowed { says: "in [0, 0.5), a fraction of the spacing", holds: |v| (0.0..0.5).contains(&v) };
const AT_REST: Allowed =
    Allowed { says: "in (0, 1), a fraction of the peak kinetic energy", holds: |v| v > 0.0 && v < 1.0 };

/// Acceleration of gravity where the scene names none, m/s2.
const STANDARD_GRAVITY: f64 = 9.81;

/// What all sections lie in; None where the scene has a fault there.
pub(super) struct Setting {
    pub space: Option<Space>,
    pub spacing: Option<f64>,
    pub gravity: Option<[f64; 3]>,
    pub symmetry: [bool; 2],
}

/// Checks the text of a scene file. All faults are reported at once, in the order of the file.
pub(super) fn scene(name: &str, text: &str) -> Result<Scene, SceneError> {
    let faults = Faults::new(text);
    let (document, syntax_errors) = DeTable::parse_recoverable(text);
    for error in &syntax_errors {
        faults.syntax(error);
    }
    let scene = read(Table::root(document.get_ref(), &faults));
    if scene.is_none() && faults.is_empty() {
        faults.add(0, "", "cannot be understood as a scene");
    }
    match (scene, faults.into_list()) {
        (Some(scene), faults) if faults.is_empty() => Ok(scene),
        (_, faults) => Err(SceneError { file: name.to_string(), faults }),
    }
}

/// Reads every section before it gives up on any, so that no fault hides another.
fn read(root: Table<'_>) -> Option<Scene> {
    let setting = setting(&root);
    let title = title(&root);
    let (kernel, h_over_dx) = kernel(&root);
    let material = material(&root);
    let (bodies, walls) = geometry::read(&root, &setting);
    let initial = initial(&root, &setting, material.as_ref());
    let numerics = numerics(&root, setting.space, kernel, h_over_dx);
    let end = end(&root);
    let output = output(&root, end.as_ref());
    root.finish();

    let bodies = bodies?;
    let names = || bodies.iter().map(|body| body.name.as_str()).collect::<Vec<_>>().join(", ");
    Some(Scene {
        title: title.unwrap_or_else(names),
        space: setting.space?,
        spacing: setting.spacing?,
        gravity: setting.gravity?,
        symmetry: setting.symmetry,
        kernel,
        h_over_dx,
        material: material?,
        bodies,
        walls: walls?,
        initial: initial?,
        numerics,
        end: end?,
        output: output?,
    })
}

fn setting(root: &Table<'_>) -> Setting {
    let space = root.needed_choice("space", &Space::ALL.map(|space| (space.name(), space))).map(|found| found.value);
    let spacing = root.needed("spacing", Dimension::Length, &POSITIVE).map(|found| found.value);
    let gravity = gravity(root, space);
    Setting { space, spacing, gravity, symmetry: symmetry(root, space, gravity) }
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

fn material(root: &Table<'_>) -> Option<Material> {
    let table = root.needed_child("material");
    let law = drucker_prager(table.needed_child("drucker-prager"));
    table.finish();
    law.map(Material::DruckerPrager)
}

fn drucker_prager(table: Table<'_>) -> Option<DruckerPrager> {
    let density = table.needed("density", Dimension::Density, &POSITIVE);
    let young = table.needed("young", Dimension::Stress, &POSITIVE);
    let poisson = table.needed("poisson", Dimension::Number, &POISSON);
    let friction = table.needed("friction", Dimension::Angle, &FRICTION);
    let dilation = table.number("dilation", Dimension::Angle, &NOT_NEGATIVE);
    let cohesion = table.needed("cohesion", Dimension::Stress, &NOT_NEGATIVE);
    let cones = [
        ("compression", Cone::Compression),
        ("extension", Cone::Extension),
        ("plane-strain", Cone::PlaneStrain),
        ("plane-strain-isochoric", Cone::PlaneStrainIsochoric),
    ];
    let cone = table.choice("cone", &cones);
    let rotations = [("jaumann", Rotation::Jaumann), ("hughes-winget", Rotation::HughesWinget)];
    let rotation = table.choice("rotation", &rotations);
    if let (Some(dilation), Some(friction)) = (&dilation, &friction)
        && dilation.value > friction.value
    {
        let (source, friction) = (table.faults.source(dilation), friction.value);
        let message =
            format!("{source} is out of range; it must be in [0, {friction}] degrees, up to the friction angle");
        table.faults.at(dilation, message);
    }
    table.finish();
    Some(DruckerPrager {
        density: density?.value,
        young: young?.value,
        poisson: poisson?.value,
        friction_deg: friction?.value,
        dilation_deg: dilation.map_or(0.0, |found| found.value),
        cohesion: cohesion?.value,
        cone: cone.map_or(Cone::Compression, |found| found.value),
        rotation: rotation.map_or(Rotation::Jaumann, |found| found.value),
    })
}

fn initial(root: &Table<'_>, setting: &Setting, material: Option<&Material>) -> Option<Initial> {
    #[derive(Clone, Copy, PartialEq)]
    enum Kind {
        Zero,
        Hydrostatic,
        K0,
    }
    let table = root.child("initial");
    let kinds = [("zero", Kind::Zero), ("hydrostatic", Kind::Hydrostatic), ("k0", Kind::K0)];
    let kind = table.choice("stress", &kinds);
    let k0 = table.number("k0", Dimension::Number, &NOT_NEGATIVE);
    let jitter = table.number("jitter", Dimension::Number, &JITTER);
    let seed = table.count("seed");
    if let (Some(k0), true) = (&k0, kind.as_ref().map_or(!table.has("stress"), |kind| kind.value != Kind::K0)) {
        table.faults.at(k0, "is used only with stress = \"k0\"; set that, or drop this key");
    }
    if let (Some(kind), Some(gravity)) = (&kind, setting.gravity)
        && kind.value != Kind::Zero
        && gravity[2] >= 0.0
    {
        let message = "needs gravity along -z: there is no weight to carry; use \"zero\", or give gravity";
        table.faults.at(kind, format!("{} {message}", table.faults.source(kind)));
    }
    table.finish();
    let stress = match kind.map_or(Kind::Zero, |found| found.value) {
        Kind::Zero => InitialStress::Zero,
        Kind::Hydrostatic => InitialStress::Hydrostatic,
        Kind::K0 => {
            let Material::DruckerPrager(law) = material?;
            let elastic = law.poisson / (1.0 - law.poisson);
            InitialStress::K0 { coefficient: k0.map_or(elastic, |found| found.value) }
        }
    };
    let jitter = jitter.map_or(0.0, |found| found.value);
    Some(Initial { stress, jitter, seed: seed.map_or(1, |found| found.value) })
}

fn numerics(root: &Table<'_>, space: Option<Space>, kernel: Kernel, h_over_dx: f64) -> Numerics {
    let table = root.child("numerics");
    let courant = table.number("courant", Dimension::Number, &COURANT);
    let viscosity = table.number("viscosity", Dimension::Number, &VISCOSITY);
    let damping = table.number("damping", Dimension::Rate, &NOT_NEGATIVE);
    let density_gate = table.number("density-gate", Dimension::Number, &DENSITY_GATE);
    let limit = if space == Some(Space::Axisymmetric) { ring_limit(kernel, h_over_dx) } else { f64::INFINITY };
    // Up to 92 % of the limit is stable in tests; the default keeps 20 % away from it.
    let most = (92.0 * limit).floor() / 100.0;
    if let Some(found) = &courant
        && found.value > most
    {
        let source = table.faults.source(found);
        let reason = "the hoop stress of the innermost rings limits the time step in the axisymmetric space";
        table.faults.at(found, format!("{source} is too large; it must be in (0, {most}] with this kernel: {reason}"));
    }
    table.finish();
    let or = |found: Option<Found<f64>>, default| found.map_or(default, |found| found.value);
    Numerics {
        courant: or(courant, 0.6_f64.min(0.8 * limit)),
        viscosity: or(viscosity, 0.1),
        damping: or(damping, 0.0),
        density_gate: or(density_gate, 0.0),
    }
}

/// Largest stable dt c/h of leap-frog where rings lie at dx/2 from the axis: omega^2 = (2 c/(L h))^2 + (2 c/dx)^2, with
/// L the limit without rings, measured on free blocks. Measured with rings: 0.75 to 0.80 for the cubic spline at
/// h = 1.2 dx, 0.60 to 0.65 for Wendland at 1.5625, 0.45 to 0.50 at 2.
fn ring_limit(kernel: Kernel, h_over_dx: f64) -> f64 {
    let free = match kernel {
        Kernel::CubicSpline => 1.86,
        Kernel::WendlandC2 => 1.76,
    };
    free / (1.0 + (free * h_over_dx).powi(2)).sqrt()
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
