//! Scenes: what good ones become, and what is said about bad ones.

#[path = "support/scenes.rs"]
mod scenes;

use formats::{
    kernel::Kernel,
    scene::{
        Body, Cone, DruckerPrager, End, Initial, InitialStress, Lattice, Material, MeanStress, Numerics, Output,
        Precision, Rotation, Scene, Shape, Slip, Wall, WallKind,
    },
    space::Space,
};
use scenes::{bad, faults, good};

/// The least that a scene needs.
const COLUMN: &str = r#"space = "axisymmetric"
spacing = "4 mm"

[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = 0

[body.column]
cylinder = { radius = "0.1 m", height = "0.1 m" }

[wall.floor]
axis = "z"
at = 0
side = "above"
slip = "no-slip"

[end]
time = "0.35 s"
"#;

/// Every key, in three dimensions.
const EVERYTHING: &str = r#"title = "All at once"
space = "3d"
spacing = "10 mm"
gravity = [0, "0 m/s2", "-10 m/s^2"]
symmetry = ["y", "x"]

[kernel]
kind = "wendland-c2"
h-over-dx = 1.5

[material.drucker-prager]
density = "2.65 g/cm3"
young = "2 GPa"
poisson = 0.25
friction = "30 deg"
dilation = "5 deg"
cohesion = "1.5 kPa"
cone = "plane-strain-isochoric"
rotation = "hughes-winget"

[body.second]
box = { min = [0, 0, "20 cm"], max = ["0.1 m", "0.2 m", "0.3 m"] }
velocity = ["1 mm/s", "-36 km/h", 3]

[body.first]
cylinder = { radius = "0.2 m", height = "0.2 m", base = ["0 m", "0 m", "0 m"] }

[body.ramp]
wedge = { corner = ["0.5 m", 0, 0], size = [0.2, 0.1, 0.05], falls = "left" }

[wall.end]
axis = "x"
at = "500 mm"
side = "below"
slip = "free-slip"

[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"

[initial]
stress = "k0"
k0 = 0.43
jitter = 0.1
seed = 7

[numerics]
courant = 0.3
viscosity = 0.2
damping = "2 1/s"
damping-in-flow = "forced"

[end]
time = "2 s"
at-rest = 1e-4

[output]
snapshots = "20 ms"
history = "1 ms"
"#;

const PLANE: &str = r#"space = "plane-strain"
spacing = 0.01
symmetry = ["x"]
[material.drucker-prager]
density = 2600
young = 1e6
poisson = 0.3
friction = 30
cohesion = 0
[body.left]
box = { min = [0, 0, 0], max = ["0.2 m", 0, "0.1 m"] }
[body.right]
wedge = { corner = [0.2, 0, 0], size = [0.2, 0, 0.1], falls = "right" }
[wall.end]
axis = "x"
at = 0.5
side = "below"
slip = "free-slip"
[end]
time = 1
"#;

fn law() -> DruckerPrager {
    DruckerPrager {
        density: 2600.0,
        young: 5.98e6,
        poisson: 0.3,
        friction_deg: 30.0,
        dilation_deg: 0.0,
        cohesion: 0.0,
        cone: Cone::Compression,
        rotation: Rotation::Jaumann,
        mean_stress: MeanStress::Rate,
    }
}

/// The defaults of dry sand.
fn numerics() -> Numerics {
    Numerics {
        courant: 0.6,
        viscous_courant: 0.125,
        viscosity: 0.03,
        viscosity_on_approach: true,
        quadratic_viscosity: 0.0,
        damping: 0.0,
        density_gate: 0.98,
        density_diffusion: 0.0,
        stress_diffusion: 0.0,
        artificial_stress: 0.0,
        gradient_correction: false,
        shifting: 0.0,
        precision: Precision::Double,
    }
}

#[test]
fn the_least_scene_gets_all_defaults() {
    let expected = Scene {
        title: "column".to_string(),
        space: Space::Axisymmetric,
        spacing: 0.004,
        gravity: [0.0, 0.0, -9.81],
        symmetry: [false; 2],
        periodic: [None; 3],
        kernel: Kernel::CubicSpline,
        h_over_dx: 1.2,
        material: Material::DruckerPrager(law()),
        bodies: vec![Body {
            name: "column".to_string(),
            shape: Shape::Cylinder { base: [0.0; 3], radius: 0.1, height: 0.1 },
            velocity: [0.0; 3],
        }],
        terrain: None,
        obstacles: Vec::new(),
        files: Vec::new(),
        chosen: None,
        walls: vec![Wall {
            axis: 2,
            at: 0.0,
            side: 1.0,
            slip: Slip::NoSlip,
            kind: WallKind::Virtual,
            velocity: [0.0; 3],
        }],
        initial: Initial { stress: InitialStress::Zero, lattice: Lattice::Cubic, jitter: 0.0, seed: 1, relax: 0 },
        numerics: numerics(),
        end: End { time: 0.35, at_rest: None },
        output: Output { snapshots: 0.35 / 20.0, history: 0.35 / 400.0 },
    };
    assert_eq!(Scene::read("scene.toml", COLUMN), Ok(expected));
}

#[test]
fn every_key_is_read() {
    let body = |name: &str, shape, velocity| Body { name: name.to_string(), shape, velocity };
    let expected = Scene {
        title: "All at once".to_string(),
        space: Space::ThreeD,
        spacing: 0.01,
        gravity: [0.0, 0.0, -10.0],
        symmetry: [true; 2],
        periodic: [None; 3],
        kernel: Kernel::WendlandC2,
        h_over_dx: 1.5,
        material: Material::DruckerPrager(DruckerPrager {
            density: 2650.0,
            young: 2e9,
            poisson: 0.25,
            friction_deg: 30.0,
            dilation_deg: 5.0,
            cohesion: 1500.0,
            cone: Cone::PlaneStrainIsochoric,
            rotation: Rotation::HughesWinget,
            mean_stress: MeanStress::Rate,
        }),
        // In the order of the file, not of the alphabet.
        bodies: vec![
            body("second", Shape::Box { min: [0.0, 0.0, 0.2], max: [0.1, 0.2, 0.3] }, [0.001, -10.0, 3.0]),
            body("first", Shape::Cylinder { base: [0.0; 3], radius: 0.2, height: 0.2 }, [0.0; 3]),
            body("ramp", Shape::Wedge { corner: [0.5, 0.0, 0.0], size: [0.2, 0.1, 0.05], falls_left: true }, [0.0; 3]),
        ],
        terrain: None,
        obstacles: Vec::new(),
        files: Vec::new(),
        chosen: None,
        walls: vec![
            Wall { axis: 0, at: 0.5, side: -1.0, slip: Slip::FreeSlip, kind: WallKind::Virtual, velocity: [0.0; 3] },
            Wall { axis: 2, at: 0.0, side: 1.0, slip: Slip::NoSlip, kind: WallKind::Virtual, velocity: [0.0; 3] },
        ],
        initial: Initial {
            stress: InitialStress::K0 { coefficient: 0.43 },
            lattice: Lattice::Cubic,
            jitter: 0.1,
            seed: 7,
            relax: 0,
        },
        // Cohesive, and gaining volume: no gate.
        numerics: Numerics { courant: 0.3, viscosity: 0.2, damping: 2.0, density_gate: 0.0, ..numerics() },
        end: End { time: 2.0, at_rest: Some(1e-4) },
        output: Output { snapshots: 0.02, history: 0.001 },
    };
    assert_eq!(Scene::read("scene.toml", EVERYTHING), Ok(expected));
}

#[test]
fn passes_of_relaxation_are_read() {
    let with = |passes: &str| format!("{COLUMN}[initial]\nrelax = {passes}\n");
    for passes in [0, 20, 10_000] {
        assert_eq!(Scene::read("scene.toml", &with(&passes.to_string())).unwrap().initial.relax, passes);
    }
    bad(&with("20"), "relax = 20", "relax = 10001", (23, 9), "initial.relax", "from 0 to 10000");
    bad(&with("20"), "relax = 20", "relax = 0.5", (23, 9), "initial.relax", "`0.5` is not a whole number");
}

#[test]
fn the_example_of_the_guide_is_a_scene() {
    let text = COLUMN
        .replace("spacing = \"4 mm\"", "spacing = \"4 mm\"\ngravity = \"9.81 m/s2\"\nsymmetry = []")
        .replace("cohesion = 0", "dilation = \"0 deg\"\ncohesion = \"0 Pa\"\ncone = \"compression\"")
        + "at-rest = 1e-4\n[output]\nsnapshots = \"20 ms\"\nhistory = \"1 ms\"\n";
    let scene = Scene::read("scene.toml", &text).unwrap();
    assert_eq!(scene.material, Material::DruckerPrager(law()));
    assert_eq!(scene.output, Output { snapshots: 0.02, history: 0.001 });
}

#[test]
fn what_is_allowed_at_the_borders_is_read() {
    let scene = Scene::read("scene.toml", PLANE).unwrap();
    assert_eq!(scene.symmetry, [true, false]);
    assert_eq!(
        scene.bodies[1].shape,
        Shape::Wedge { corner: [0.2, 0.0, 0.0], size: [0.2, 0.0, 0.1], falls_left: false }
    );
    // Y extents are ignored in the plane spaces.
    let scene = good(PLANE, r#"min = [0, 0, 0], max = ["0.2 m", 0, "0.1 m"]"#, "min = [0, 5, 0], max = [0.2, 9, 0.1]");
    assert_eq!(scene.bodies[0].shape, Shape::Box { min: [0.0; 3], max: [0.2, 0.0, 0.1] });
    // No gravity at all.
    assert_eq!(good(COLUMN, "spacing", "gravity = -0.0\nspacing").gravity, [0.0; 3]);
    // A body is cut by a plane of symmetry.
    good(PLANE, "min = [0, 0, 0]", "min = [-0.2, 0, 0]");
    // K0 follows from the elasticity.
    let scene = good(COLUMN, "[end]", "[initial]\nstress = \"k0\"\n[end]");
    assert_eq!(scene.initial.stress, InitialStress::K0 { coefficient: 0.3 / (1.0 - 0.3) });
    // The default of h/dx depends on the kernel.
    let scene = good(COLUMN, "[end]", "[kernel]\nkind = \"wendland-c2\"\n[end]");
    assert_eq!((scene.kernel, scene.h_over_dx), (Kernel::WendlandC2, 1.5625));
    good(COLUMN, "[end]", "[kernel]\nh-over-dx = 3\n[numerics]\ncourant = 0.3\n[end]");
    good(PLANE, "[end]", "[numerics]\ncourant = 1.7\n[end]");
    let scene = good(COLUMN, "[end]", "[numerics]\ndensity-gate = 0.98\n[end]");
    assert_eq!(scene.numerics.density_gate, 0.98);
    // A ceiling a whole number of spacings above the floor, and an outer cylinder.
    let ceiling = "[wall.ceiling]\naxis = \"z\"\nat = \"0.3 m\"\nside = \"below\"\nslip = \"free-slip\"\n";
    let outer = "[wall.outer]\naxis = \"x\"\nat = \"0.3 m\"\nside = \"below\"\nslip = \"free-slip\"\n";
    assert_eq!(good(COLUMN, "[end]", &format!("{ceiling}{outer}[end]")).walls.len(), 3);
}

#[test]
fn values_out_of_range() {
    let c = "material.drucker-prager.";
    bad(COLUMN, "\"4 mm\"", "\"-4 mm\"", (2, 11), "spacing", "\"-4 mm\" is out of range; it must be greater than 0");
    bad(COLUMN, "\"4 mm\"", "0", (2, 11), "spacing", "greater than 0");
    bad(COLUMN, "\"2600 kg/m3\"", "0.0", (5, 11), &format!("{c}density"), "0.0 is out of range");
    bad(COLUMN, "\"5.98 MPa\"", "\"-1 MPa\"", (6, 9), &format!("{c}young"), "greater than 0");
    bad(COLUMN, "0.3\n", "0.5\n", (7, 11), &format!("{c}poisson"), "in [0, 0.5)");
    bad(COLUMN, "\"30 deg\"", "\"90 deg\"", (8, 12), &format!("{c}friction"), "in [0, 90) degrees");
    bad(COLUMN, "cohesion = 0", "cohesion = -1", (9, 12), &format!("{c}cohesion"), "0 or greater");
    let dilation = "dilation = \"31 deg\"\ncohesion";
    bad(COLUMN, "cohesion", dilation, (9, 12), &format!("{c}dilation"), "in [0, 30] degrees");
    bad(EVERYTHING, "1.5\n", "0.9\n", (9, 13), "kernel.h-over-dx", "in [1, 3]");
    bad(EVERYTHING, "courant = 0.3", "courant = 1.8", (50, 11), "numerics.courant", "in (0, 1.7]");
    bad(EVERYTHING, "viscosity = 0.2", "viscosity = -1", (51, 13), "numerics.viscosity", "in [0, 1]");
    bad(EVERYTHING, "\"2 1/s\"", "\"-2 1/s\"", (52, 11), "numerics.damping", "0 or greater");
    bad(EVERYTHING, "jitter = 0.1", "jitter = 0.5", (46, 10), "initial.jitter", "in [0, 0.5)");
    bad(EVERYTHING, "seed = 7", "seed = -7", (47, 8), "initial.seed", "`-7` is not a whole number");
    bad(EVERYTHING, "k0 = 0.43", "k0 = -0.1", (45, 6), "initial.k0", "0 or greater");
    bad(EVERYTHING, "\"2 s\"", "\"0 s\"", (56, 8), "end.time", "greater than 0");
    bad(EVERYTHING, "1e-4", "1", (57, 11), "end.at-rest", "in (0, 1)");
    bad(EVERYTHING, "\"20 ms\"", "\"3 s\"", (60, 13), "output.snapshots", "\"3 s\" is later than end.time = 2 s");
    bad(EVERYTHING, "\"1 ms\"", "0", (61, 11), "output.history", "greater than 0");
    bad(COLUMN, "spacing", "gravity = -9.81\nspacing", (2, 11), "gravity", "a magnitude must be 0 or greater");
}

#[test]
fn values_of_the_wrong_kind() {
    bad(
        COLUMN,
        "\"4 mm\"",
        "\"4 kg/m3\"",
        (2, 11),
        "spacing",
        "is a density; a length is needed (units: um, mm, cm, m,",
    );
    bad(COLUMN, "\"4 mm\"", "\"4 foot\"", (2, 11), "spacing", "unknown unit `foot`");
    bad(COLUMN, "\"4 mm\"", "true", (2, 11), "spacing", "a length such as \"4 mm\" is needed, not true or false");
    bad(COLUMN, "\"4 mm\"", "inf", (2, 11), "spacing", "not a finite number");
    bad(COLUMN, "\"4 mm\"", "1e999", (2, 11), "spacing", "not a finite number");
    bad(COLUMN, "0.3\n", "nan\n", (7, 11), "material.drucker-prager.poisson", "not a finite number");
    bad(COLUMN, "5.98 MPa", "5.98 mpa", (6, 9), "material.drucker-prager.young", "did you mean `MPa`?");
    bad(
        COLUMN,
        "\"axisymmetric\"",
        "\"axisymetric\"",
        (1, 9),
        "space",
        "did you mean `axisymmetric`? valid: plane-strain",
    );
    bad(COLUMN, "\"axisymmetric\"", "2", (1, 9), "space", "\"3d\", \"auto\" is needed, not a number");
    bad(COLUMN, "[end]", "[kernel]\nkind = \"cubic\"\n[end]", (21, 8), "kernel.kind", "unknown name `cubic`");
    bad(COLUMN, "[end]", "[[kernel]]\n[end]", (20, 1), "kernel", "a table is needed, not an array");
    bad(COLUMN, "spacing", "title = 3\nspacing", (2, 9), "title", "a string in quotes is needed, not a number");
    bad(COLUMN, "spacing", "title = \"a\\nb\"\nspacing", (2, 9), "title", "a single line");
    bad(COLUMN, "spacing", "symmetry = \"x\"\nspacing", (2, 12), "symmetry", "an array of names is needed");
    bad(COLUMN, "spacing", "gravity = [0, -9]\nspacing", (2, 11), "gravity", "has 2 values");
    let base = "height = \"0.1 m\", base = 0";
    bad(COLUMN, "height = \"0.1 m\"", base, (12, 57), "body.column.cylinder.base", "three quantities, each a length,");
}

#[test]
fn keys_missing_and_unknown() {
    bad(COLUMN, "spacing = \"4 mm\"\n", "", (1, 1), "spacing", "missing; a length such as \"4 mm\" is needed");
    bad(COLUMN, "space = \"axisymmetric\"", "", (1, 1), "space", "missing; one of \"plane-strain\", \"axisymmetric\"");
    bad(COLUMN, "poisson = 0.3\n", "", (4, 11), "material.drucker-prager.poisson", "missing; a number without unit");
    bad(COLUMN, "[end]\ntime = \"0.35 s\"\n", "", (1, 1), "end", "missing; a table [end] is needed");
    bad(COLUMN, "time = \"0.35 s\"\n", "", (20, 2), "end.time", "missing; a time such as \"0.35 s\" is needed");
    bad(COLUMN, "slip = \"no-slip\"\n", "", (14, 7), "wall.floor.slip", "one of \"no-slip\", \"free-slip\" is needed");
    let cylinder = "cylinder = { radius = \"0.1 m\", height = \"0.1 m\" }";
    bad(COLUMN, cylinder, "", (11, 7), "body.column", "has no shape; one of cylinder, box, wedge");
    bad(COLUMN, &format!("[body.column]\n{cylinder}"), "", (1, 1), "body", "at least one body is needed");
    bad(
        COLUMN,
        "cohesion = 0",
        "cohesion = 0\nfrction = 3",
        (10, 1),
        "material.drucker-prager.frction",
        "did you mean `friction`?",
    );
    bad(
        COLUMN,
        "[end]",
        "[numeric]\n[end]",
        (20, 2),
        "numeric",
        "unknown key or table `numeric`; did you mean `numerics`?",
    );
    bad(COLUMN, "[end]", "[end]\nsteps = 3", (21, 1), "end.steps", "unknown key `steps`; valid: time, at-rest");
    bad(COLUMN, "radius = \"0.1 m\"", "radius = 0.1, heigth = 1", (12, 28), "body.column.cylinder.heigth", "`height`");
}

#[test]
fn sections_that_contradict_each_other() {
    let end = |text: &str| format!("{text}\n[end]");
    let k0 = "is used only with stress = \"k0\"";
    bad(COLUMN, "[end]", &end("[initial]\nk0 = 0.4"), (21, 6), "initial.k0", k0);
    bad(COLUMN, "[end]", &end("[initial]\nstress = \"hydrostatic\"\nk0 = 0.4"), (22, 6), "initial.k0", k0);
    let weightless = COLUMN.replace("spacing", "gravity = 0\nspacing");
    bad(&weightless, "[end]", &end("[initial]\nstress = \"k0\""), (22, 10), "initial.stress", "needs gravity along -z");
    let up = COLUMN.replace("spacing", "gravity = [0, 0, 9.81]\nspacing");
    bad(
        &up,
        "[end]",
        &end("[initial]\nstress = \"hydrostatic\""),
        (22, 10),
        "initial.stress",
        "needs gravity along -z",
    );
    bad(
        COLUMN,
        "spacing",
        "gravity = [1, 0, -9]\nspacing",
        (2, 12),
        "gravity",
        "gravity along x must be 0 in the space",
    );
    bad(
        PLANE,
        "symmetry = [\"x\"]",
        "gravity = [0, 1, -9]",
        (3, 15),
        "gravity",
        "gravity along y must be 0 in the space",
    );
    bad(PLANE, "symmetry", "gravity = [1, 0, -9]\nsymmetry", (4, 13), "symmetry", "across this plane of symmetry");
    bad(EVERYTHING, "[0, \"0 m/s2\"", "[0, \"1 m/s2\"", (5, 13), "symmetry", "gravity has a component along y");
    bad(PLANE, "[\"x\"]", "[\"x\", \"y\"]", (3, 18), "symmetry", "has no y axis");
    bad(PLANE, "[\"x\"]", "[\"x\", \"x\"]", (3, 18), "symmetry", "named twice");
    bad(PLANE, "[\"x\"]", "[\"z\"]", (3, 13), "symmetry", "unknown name `z`");
    bad(COLUMN, "spacing", "symmetry = [\"x\"]\nspacing", (2, 13), "symmetry", "the axis is implied");
}

#[test]
fn shapes_that_do_not_fit() {
    let column = |shape: &str, place, key: &str, phrase: &str| {
        bad(COLUMN, "cylinder = { radius = \"0.1 m\", height = \"0.1 m\" }", shape, place, key, phrase);
    };
    let (cylinder, block, wedge) = ("body.column.cylinder", "body.column.box", "body.column.wedge");
    let shape = "cylinder = { radius = 0.001, height = 1 }";
    column(shape, (12, 1), cylinder, "holds no particle: radius 0.001 m is too small for the spacing of 0.004 m");
    let shape = "cylinder = { radius = 1, height = 0.001 }";
    column(shape, (12, 1), cylinder, "size along z is 0.001 m, less than half the spacing of 0.004 m");
    let shape = "cylinder = { radius = 1, height = 1, base = [0, 0.1, 0] }";
    column(shape, (12, 49), &format!("{cylinder}.base"), "must lie on the axis");
    let shape = "wedge = { corner = [0, 0, 0], size = [1, 0, 1], falls = \"left\" }";
    column(shape, (12, 1), wedge, "there are no wedges in the space \"axisymmetric\"");
    let shape = "box = { min = [-0.1, 0, 0], max = [1, 0, 1] }";
    column(shape, (12, 16), &format!("{block}.min"), "x is the radius");
    let shape = "box = { min = [0.1, 0, 0], max = [0.1, 0, 1] }";
    column(shape, (12, 35), &format!("{block}.max"), "upper corner's x must be greater than min's, 0.1 m");
    let shape = "cylinder = { radius = 1, height = 1 }\nbox = { min = [1, 0, 0], max = [2, 0, 1] }";
    column(shape, (13, 1), "body.column", "has several shapes (cylinder, box)");
    let shape = "cylinder = { radius = 0.1, height = 0.1, base = [0, 0, -0.05] }";
    column(shape, (12, 1), cylinder, "reaches 0.05 m behind wall `floor`, the plane z = 0 m");
    let shape = "cylinder = { radius = 0.1, height = 5000 }";
    column(shape, (12, 1), cylinder, "reaches 1.250e6 spacings from the origin of the lattice along z");
    bad(
        COLUMN,
        "[wall.floor]",
        "velocity = [0, 1, 0]\n[wall.floor]",
        (14, 16),
        "body.column.velocity",
        "along y must be 0",
    );

    let left = "box = { min = [0, 0, 0], max = [\"0.2 m\", 0, \"0.1 m\"] }";
    let shape = "cylinder = { radius = 0.1, height = 0.1 }";
    bad(PLANE, left, shape, (11, 1), "body.left.cylinder", "there are no cylinders in the space \"plane-strain\"");
    let shape = "box = { min = [-1, 0, 0], max = [0, 0, 0.1] }";
    bad(PLANE, left, shape, (11, 1), "body.left.box", "lies on the negative side of the plane of symmetry x = 0");
    let shape = "box = { min = [-1.001, 0, 0], max = [0.003, 0, 0.1] }";
    bad(PLANE, left, shape, (11, 1), "body.left.box", "holds no particle on the positive side");
    let right = "size = [0.2, 0, 0.1]";
    bad(PLANE, right, "size = [0.2, 0, -1]", (13, 49), "body.right.wedge.size", "size along z must be greater than 0");
    bad(PLANE, right, "size = [0.01, 0, 0.01]", (13, 1), "body.right.wedge", "too small for the spacing of 0.01 m");
    bad(PLANE, right, "size = [0.6, 0, 0.1]", (13, 1), "body.right.wedge", "behind wall `end`, the plane x = 0.5 m");

    let many =
        EVERYTHING.replace("10 mm", "1 um").replace("0.5 m", "0.4 m").replace("at = \"500 mm\"", "at = \"900 mm\"");
    let cylinder = "radius = \"0.2 m\", height = \"0.2 m\"";
    bad(&many, cylinder, "radius = 0.2, height = 0.01", (29, 1), "body.ramp.wedge", "there must be fewer than 2^40");
}

#[test]
fn walls_that_do_not_fit() {
    let wall = |axis: &str, at: f64, side: &str| {
        format!("[wall.other]\naxis = \"{axis}\"\nat = {at}\nside = \"{side}\"\nslip = \"no-slip\"\n[end]")
    };
    let column = |axis, at, side, place, key: &str, phrase: &str| {
        bad(COLUMN, "[end]", &wall(axis, at, side), place, &format!("wall.other.{key}"), phrase);
    };
    column(
        "y",
        1.0,
        "below",
        (21, 8),
        "axis",
        "no walls normal to y in the space \"axisymmetric\"; valid: \"x\", \"z\"",
    );
    column("z", -1.0, "above", (23, 8), "side", "same axis and side as that of wall `floor`");
    column("z", 0.3021, "below", (22, 6), "at", "a whole number of spacings from wall `floor`, which faces it");
    column("z", -1.0, "below", (22, 6), "at", "leaves no room between this wall and wall `floor`");
    column("x", -1.0, "above", (22, 6), "at", "its radius must be greater than 0");
    bad(
        COLUMN,
        "[end]",
        &wall("x", 0.05, "above"),
        (12, 1),
        "body.column.cylinder",
        "behind wall `other`, the plane x = 0.05",
    );
    bad(PLANE, "at = 0.5", "at = 0.505", (16, 6), "wall.end.at", "from the plane of symmetry x = 0");
    let inverted = PLANE.replace("side = \"below\"", "side = \"above\"");
    bad(
        &inverted,
        "at = 0.5",
        "at = -1",
        (16, 6),
        "wall.end.at",
        "on the positive side of the plane of symmetry x = 0",
    );
}

#[test]
fn syntax_errors_have_a_place_too() {
    bad(COLUMN, "\"4 mm\"", "4 mm", (2, 11), "", "a number with a unit goes in quotes, e.g. \"4 mm\"");
    bad(COLUMN, "spacing", "spacing = 3\nspacing", (3, 1), "", "not valid TOML: duplicate key");
    bad(COLUMN, "[wall.floor]", "[wall.floor", (14, 12), "", "not valid TOML");
    // What is certain in spite of them is reported with them.
    let text = COLUMN.replace("\"4 mm\"", "4 mm").replace("\"30 deg\"", "\"95 deg\"");
    let lines: Vec<_> = faults(&text).iter().map(|fault| fault.line).collect();
    assert_eq!(lines, [2, 8]);
    assert_eq!(faults("space = ").len(), 1);
}

#[test]
fn all_faults_are_reported_in_the_order_of_the_file() {
    let text = COLUMN
        .replace("\"4 mm\"", "\"4 Pa\"")
        .replace("0.3\n", "0.7\n")
        .replace("\"30 deg\"", "\"30 grad\"")
        .replace("radius = \"0.1 m\"", "ä = 1, radius = -1")
        .replace("\"above\"", "\"abov\"")
        .replace("time =", "tme =");
    let error = Scene::read("dir/scene.toml", &text).unwrap_err();
    let report = error.to_string();
    let starts = [
        "dir/scene.toml:2:11: spacing: ",
        "dir/scene.toml:7:11: material.drucker-prager.poisson: 0.7 is out of range; it must be in [0, 0.5)",
        "dir/scene.toml:8:12: material.drucker-prager.friction: unknown unit `grad`; an angle is needed (units: deg, rad)",
        "dir/scene.toml:12:32: body.column.cylinder.radius: -1 is out of range",
        "dir/scene.toml:17:8: wall.floor.side: unknown name `abov`; did you mean `above`? valid: above, below",
        "dir/scene.toml:20:2: end.time: missing",
        "dir/scene.toml:21:1: end.tme: unknown key `tme`; did you mean `time`? valid: time, at-rest",
    ];
    let text = text.replace("ä = 1", "\"ä\" = 1");
    let again = Scene::read("dir/scene.toml", &text).unwrap_err().to_string();
    assert!(report.contains("dir/scene.toml:12:14"), "{report}");
    assert_eq!(again.lines().count(), starts.len() + 1, "{again}");
    let known = again.lines().filter(|line| !line.contains("unknown key `ä`"));
    for (line, start) in known.zip(starts) {
        assert!(line.starts_with(start), "{line}\n{start}");
    }
}

#[test]
fn no_text_makes_the_reader_panic() {
    let mut texts: Vec<String> = (0..EVERYTHING.len()).map(|end| EVERYTHING[..end].to_string()).collect();
    texts.extend((0..EVERYTHING.len()).map(|start| EVERYTHING[start..].to_string()));
    for (at, _) in EVERYTHING.char_indices() {
        for piece in ["é", "\"", "[", "]", "}", "=", "\n", "9", "-"] {
            texts.push(format!("{}{piece}{}", &EVERYTHING[..at], &EVERYTHING[at + 1..]));
        }
    }
    for text in texts {
        if let Err(error) = Scene::read("scene.toml", &text) {
            let places: Vec<_> = error.faults.iter().map(|fault| (fault.line, fault.column)).collect();
            assert!(!places.is_empty() && places.is_sorted(), "{error}");
        }
    }
}
