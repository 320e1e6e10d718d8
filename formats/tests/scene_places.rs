//! Scenes: bodies that overlap, periods, mirror walls, walls that move, and where the material can flow.

#[path = "support/scenes.rs"]
mod scenes;

use formats::{
    scene::{Scene, WallKind},
    space::Space,
};
use scenes::{bad, good};

/// A box full of soil: 20 x 10 spacings in plane strain, with h = 12 mm. Nothing can flow.
const BOX: &str = r#"space = "plane-strain"
spacing = "1 cm"
[material.drucker-prager]
density = 1800
young = "2 MPa"
poisson = 0.25
friction = 30
cohesion = 0
[body.soil]
box = { min = [0, 0, 0], max = [0.2, 0, 0.1] }
[wall.floor]
axis = "z"
at = 0
side = "above"
slip = "no-slip"
[wall.left]
axis = "x"
at = 0
side = "above"
slip = "free-slip"
[wall.right]
axis = "x"
at = 0.2
side = "below"
slip = "free-slip"
[end]
time = 1
"#;

const LEFT: &str = "[wall.left]\naxis = \"x\"\nat = 0\nside = \"above\"\nslip = \"free-slip\"\n";
const RIGHT: &str = "[wall.right]\naxis = \"x\"\nat = 0.2\nside = \"below\"\nslip = \"free-slip\"\n";
const FLOOR: &str = "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n";
const SOIL: &str = "[body.soil]\nbox = { min = [0, 0, 0], max = [0.2, 0, 0.1] }\n";

/// The box with two periodic sides instead of walls.
fn repeated() -> String {
    BOX.replace(LEFT, "").replace(RIGHT, "[periodic]\nx = { from = 0, to = \"20 cm\" }\n")
}

/// The same in three dimensions, along both axes.
fn repeated_twice() -> String {
    let text = repeated().replace("plane-strain", "3d").replace("max = [0.2, 0, 0.1]", "max = [0.2, 0.3, 0.1]");
    text.replace("[end]", "y = { from = \"0 m\", to = 0.3 }\n[end]")
}

#[test]
fn bodies_that_overlap() {
    let bodies = |space: &str, a: &str, b: &str| {
        let law = "[material.drucker-prager]\ndensity = 1\nyoung = 1\npoisson = 0\nfriction = 0\ncohesion = 0\n[end]\ntime = 1";
        let text = format!("space = \"{space}\"\nspacing = 0.1\n[body.a]\n{a}\n[body.b]\n{b}\n{law}\n");
        match Scene::read("scene.toml", &text) {
            Ok(_) => false,
            Err(error) => {
                let [fault] = error.faults.as_slice() else { panic!("{error}") };
                assert!(fault.message.contains("overlaps body `a`"), "{error}");
                assert_eq!((fault.line, fault.column), (6, 1));
                true
            }
        }
    };
    let block = |min: [f64; 3], max: [f64; 3]| format!("box = {{ min = {min:?}, max = {max:?} }}");
    let disc = |x: f64, y: f64, z: f64| format!("cylinder = {{ radius = 1, height = 1, base = [{x}, {y}, {z}] }}");
    let slope =
        |x: f64, falls: &str| format!("wedge = {{ corner = [{x}, 0, 0], size = [1, 1, 1], falls = \"{falls}\" }}");
    let unit = block([0.0; 3], [1.0; 3]);
    for (a, b, expected) in [
        (unit.clone(), block([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]), false),
        (unit.clone(), block([0.9, 0.0, 0.0], [2.0, 1.0, 1.0]), true),
        (unit.clone(), block([0.0, 1.0, 0.0], [1.0, 2.0, 1.0]), false),
        (unit.clone(), block([0.5, 0.5, 1.0], [1.5, 1.5, 2.0]), false),
        (unit.clone(), block([0.3, 0.3, 0.3], [0.6, 0.6, 0.6]), true),
        (disc(0.0, 0.0, 0.0), disc(2.0, 0.0, 0.0), false),
        (disc(0.0, 0.0, 0.0), disc(1.5, 1.5, 0.0), false),
        (disc(0.0, 0.0, 0.0), disc(1.3, 1.3, 0.0), true),
        (disc(0.0, 0.0, 0.0), disc(0.0, 0.0, 1.0), false),
        (unit.clone(), disc(1.8, 1.8, 0.0), false),
        (unit.clone(), disc(1.6, 1.6, 0.0), true),
        (unit.clone(), disc(2.0, 0.5, 0.0), false),
        (slope(0.0, "right"), block([0.5, 0.0, 0.5], [1.5, 1.0, 1.0]), false),
        (slope(0.0, "right"), block([0.5, 0.0, 0.4], [1.5, 1.0, 1.0]), true),
        (slope(0.0, "right"), slope(0.0, "left"), false),
        (slope(0.0, "right"), slope(2.0, "left"), false),
        (slope(0.0, "right"), slope(1.9, "left"), true),
        (slope(0.0, "right"), disc(1.5, 0.5, 0.5), false),
        (slope(0.0, "right"), disc(1.4, 0.5, 0.5), true),
    ] {
        assert_eq!(bodies("3d", &a, &b), expected, "{a} {b}");
        assert_eq!(bodies("3d", &b, &a), expected, "{b} {a}");
    }
    let ring = block([1.0, 0.0, 0.0], [2.0, 0.0, 1.0]);
    assert!(!bodies("axisymmetric", &disc(0.0, 0.0, 0.0), &ring));
    assert!(bodies("axisymmetric", &disc(0.0, 0.0, 0.0), &block([0.9, 0.0, 0.0], [2.0, 0.0, 1.0])));
    assert!(bodies("axisymmetric", &disc(0.0, 0.0, 0.0), &disc(0.0, 0.0, 0.5)));
    assert!(bodies("plane-strain", &unit, &slope(0.9, "right")));
    assert!(!bodies("plane-strain", &unit, &slope(1.0, "right")));
}

#[test]
fn periods_are_read() {
    let scene = Scene::read("scene", &repeated()).unwrap();
    assert_eq!(scene.periodic, [Some([0.0, 0.2]), None, None]);
    assert_eq!(Scene::read("scene", BOX).unwrap().periodic, [None; 3]);
    assert_eq!(Scene::read("scene", &repeated_twice()).unwrap().periodic, [Some([0.0, 0.2]), Some([0.0, 0.3]), None]);
    // One axis may mirror where the other repeats; gravity may act along the period.
    let half = repeated_twice().replace("y = { from = \"0 m\", to = 0.3 }\n", "");
    good(&half, "spacing", "symmetry = [\"y\"]\nspacing");
    let scene = good(&repeated(), "spacing", "gravity = [4.9, 0, -8.5]\nspacing");
    assert_eq!(scene.gravity, [4.9, 0.0, -8.5]);
    // The shortest period there may be: more than 4.4 h = 5.28 spacings.
    let short = repeated().replace("[0.2, 0, 0.1]", "[0.06, 0, 0.1]");
    good(&short, "\"20 cm\"", "\"6 cm\"");
    // Rounding of places in metres.
    let shifted = repeated().replace("min = [0, 0, 0], max = [0.2,", "min = [-0.3, 0, 0], max = [-0.1,");
    good(&shifted, "from = 0, to = \"20 cm\"", "from = -0.3, to = \"-10 cm\"");
}

#[test]
fn periods_that_do_not_fit() {
    let text = repeated();
    let period = |from: &str, to: &str, place, key: &str, phrase: &str| bad(&text, from, to, place, key, phrase);
    period("from = 0, ", "", (17, 1), "periodic.x.from", "missing; a length such as \"4 mm\" is needed");
    period(", to = \"20 cm\"", "", (17, 1), "periodic.x.to", "missing; a length");
    period("{ from = 0, to = \"20 cm\" }", "\"20 cm\"", (17, 5), "periodic.x", "a table is needed, not a string");
    period("to = \"20 cm\"", "to = 0.2, step = 1", (17, 27), "periodic.x.step", "unknown key `step`; valid: from, to");
    period("\nx =", "\nz =", (17, 1), "periodic.z", "unknown key `z`; did you mean `x`? valid: x, y");
    period("\"20 cm\"", "\"-20 cm\"", (17, 22), "periodic.x.to", "must be greater than `from`: the period is -0.2 m");
    let message = "the period is 5 spacings; it must be more than 5.28, twice the reach of the kernel";
    period("\"20 cm\"", "\"5 cm\"", (17, 22), "periodic.x.to", message);
    period("\"20 cm\"", "\"20.4 cm\"", (17, 22), "periodic.x.to", "must be a whole number of spacings; it is 20.4 of");
    period("\nx =", "\ny =", (17, 1), "periodic.y", "the space \"plane-strain\" has no y axis; valid: x");
    period("spacing", "symmetry = [\"x\"]\nspacing", (18, 1), "periodic.x", "x = 0 is a plane of symmetry; drop");
    let message = "the space \"axisymmetric\" has no periodic axis";
    period("\"plane-strain\"", "\"axisymmetric\"", (17, 1), "periodic.x", message);

    let message = "the scene repeats itself along x: no wall can be normal to it; drop this wall, or periodic.x";
    period("[end]", &format!("{RIGHT}[end]"), (19, 8), "wall.right.axis", message);
    let message = "reaches from 0 m to 0.21 m along x, out of the period; it must lie within 0 m and 0.2 m";
    period("[0.2, 0, 0.1]", "[0.21, 0, 0.1]", (10, 1), "body.soil.box", message);
    period("min = [0, 0, 0]", "min = [-0.1, 0, 0]", (10, 1), "body.soil.box", "reaches from -0.1 m to 0.2 m along x");
    let message = "along y, out of the period; it must lie within 0 m and 0.3 m";
    bad(&repeated_twice(), "[0.2, 0.3, 0.1]", "[0.2, 0.31, 0.1]", (10, 1), "body.soil.box", message);
}

#[test]
fn mirror_walls_are_out_of_reach_of_what_faces_them() {
    let kinds = |scene: Scene| scene.walls.iter().map(|wall| wall.kind).collect::<Vec<_>>();
    let mirror = "side = \"below\"\nkind = \"mirror\"";
    assert_eq!(kinds(good(BOX, "side = \"below\"", mirror)), [WallKind::Virtual, WallKind::Virtual, WallKind::Mirror]);
    let named = "side = \"below\"\nkind = \"virtual\"";
    assert_eq!(kinds(good(BOX, "side = \"below\"", named)), [WallKind::Virtual; 3]);
    bad(
        BOX,
        "side = \"below\"",
        "side = \"below\"\nkind = \"ghost\"",
        (25, 8),
        "wall.right.kind",
        "valid: virtual, mirror",
    );

    // 2.2 h = 2.64 spacings: 3 are enough, 2 are not, unless both walls are of virtual particles.
    let mirrors = BOX.replace("slip = \"free-slip\"", "slip = \"free-slip\"\nkind = \"mirror\"");
    for (cells, fits) in [(3, true), (2, false)] {
        let narrow = |text: &str| text.replace("max = [0.2,", &format!("max = [0.0{cells},"));
        let at = format!("at = 0.0{cells}");
        good(&narrow(BOX), "at = 0.2", &at);
        for text in [narrow(&mirrors), narrow(BOX).replace("side = \"below\"", mirror)] {
            if fits {
                good(&text, "at = 0.2", &at);
                continue;
            }
            let line = text[..text.find("at = 0.2").unwrap()].lines().count() + 1;
            let message = "is 0.02 m from wall `left`, which faces it; a mirror wall must be at least 2.2 h = 0.0264";
            bad(&text, "at = 0.2", &at, (line, 6), "wall.right.at", message);
        }
        // From a plane of symmetry, and from the axis of rings.
        let half = narrow(BOX).replace(LEFT, "").replace("side = \"below\"", mirror);
        let (half, rings) =
            (half.replace("spacing", "symmetry = [\"x\"]\nspacing"), half.replace("plane-strain", "axisymmetric"));
        if fits {
            good(&half, "at = 0.2", &at);
            good(&rings, "at = 0.2", &at);
        } else {
            let message = "is 0.02 m from the plane of symmetry x = 0; a mirror wall must be at least 2.2 h = 0.0264";
            bad(&half, "at = 0.2", &at, (19, 6), "wall.right.at", message);
            bad(&rings, "at = 0.2", &at, (18, 6), "wall.right.at", "is 0.02 m from the axis; a mirror wall must be");
        }
    }
}

#[test]
fn walls_move_along_themselves() {
    let velocity =
        |text: &str, v: &str| good(text, "slip = \"no-slip\"", &format!("slip = \"no-slip\"\nvelocity = {v}"));
    assert_eq!(velocity(BOX, "[\"-20 mm/s\", 0, 0]").walls[0].velocity, [-0.02, 0.0, 0.0]);
    let solid = BOX.replace("plane-strain", "3d").replace("max = [0.2, 0,", "max = [0.2, 0.1,");
    assert_eq!(velocity(&solid, "[1, 2, 0]").walls[0].velocity, [1.0, 2.0, 0.0]);
    // A tube of rings moves up.
    let tube = BOX.replace(LEFT, "").replace("plane-strain", "axisymmetric");
    let up = "slip = \"no-slip\"\nvelocity = [0, 0, 1]";
    assert_eq!(good(&tube, "slip = \"free-slip\"", up).walls[1].velocity, [0.0, 0.0, 1.0]);

    let moved = |text: &str, v: &str, place, phrase: &str| {
        let moving = format!("slip = \"no-slip\"\nvelocity = {v}");
        bad(text, "slip = \"no-slip\"", &moving, place, "wall.floor.velocity", phrase);
    };
    moved(BOX, "[0, 0, 1]", (16, 19), "a wall normal to z slides along itself: its velocity along z must be 0");
    moved(BOX, "[0, 1, 0]", (16, 16), "velocity of a wall along y must be 0 in the space \"plane-strain\"");
    moved(BOX, "1", (16, 12), "an array [x, y, z] of three quantities, each a velocity, is needed, not one");
    moved(BOX, "[\"1 m\", 0, 0]", (16, 13), "is a length; a velocity is needed");
    moved(&tube, "[1, 0, 0]", (16, 13), "velocity of a wall along x must be 0 in the space \"axisymmetric\"");
    let half = solid.replace("spacing", "symmetry = [\"y\"]\nspacing");
    let message = "this wall crosses the plane of symmetry y = 0: its velocity along y must be 0";
    moved(&half, "[1, 1, 0]", (17, 16), message);
    let sliding = "side = \"below\"\nvelocity = [0, 0, 1]";
    let message = "a free-slip wall takes nothing along; set slip = \"no-slip\", or drop the velocity";
    bad(BOX, "side = \"below\"", sliding, (25, 19), "wall.right.velocity", message);
}

/// What the reader says flows in a damped scene; nothing where damping is allowed.
#[track_caller]
fn flows(text: &str) -> String {
    let damped = text.replace("[end]", "[numerics]\ndamping = \"20 1/s\"\n[end]");
    // Whatever it is, it can be forced, and 0 is no damping.
    good(&damped, "[numerics]", "[numerics]\ndamping-in-flow = \"forced\"");
    good(&damped, "20 1/s", "0 1/s");
    match Scene::read("scene", &damped) {
        Ok(_) => String::new(),
        Err(error) => {
            let [fault] = error.faults.as_slice() else { panic!("{error}") };
            assert_eq!((fault.key.as_str(), fault.column), ("numerics.damping", 11));
            let advice =
                "run-outs would be too short, and speeds too low; drop it, or set damping-in-flow = \"forced\"";
            assert!(fault.message.ends_with(advice), "{error}");
            let (_, what) = fault.message.split_once("damps a flow (").unwrap();
            what.split(')').next().unwrap().to_string()
        }
    }
}

#[test]
fn what_is_held_on_all_sides_may_be_damped() {
    assert_eq!(flows(BOX), "");
    assert_eq!(flows(&BOX.replace(LEFT, "").replace("spacing", "symmetry = [\"x\"]\nspacing")), "");
    assert_eq!(flows(&repeated()), "");
    assert_eq!(flows(&repeated_twice()), "");
    // The axis holds rings, and a tube.
    let rings = BOX.replace(LEFT, "").replace("plane-strain", "axisymmetric");
    assert_eq!(flows(&rings), "");
    assert_eq!(
        flows(
            &rings
                .replace("box = { min = [0, 0, 0], max = [0.2, 0, 0.1] }", "cylinder = { radius = 0.2, height = 0.1 }")
        ),
        ""
    );
    // Up to a spacing is left by rounding; without gravity nothing needs a floor.
    assert_eq!(flows(&BOX.replace("min = [0, 0, 0], max = [0.2,", "min = [0.01, 0, 0.01], max = [0.19,")), "");
    assert_eq!(flows(&BOX.replace(FLOOR, "").replace("spacing", "gravity = 0\nspacing")), "");
    // Bodies hold each other where they touch, and the lower ones those above.
    let body = |name: &str, min: [f64; 2], max: [f64; 2]| {
        let ([x0, z0], [x1, z1]) = (min, max);
        format!("[body.{name}]\nbox = {{ min = [{x0}, 0, {z0}], max = [{x1}, 0, {z1}] }}\n")
    };
    let layers = body("low", [0.0, 0.0], [0.2, 0.1]) + &body("high", [0.0, 0.1], [0.2, 0.3]);
    assert_eq!(flows(&BOX.replace(SOIL, &layers)), "");
    let bricks =
        body("a", [0.0, 0.0], [0.1, 0.1]) + &body("b", [0.0, 0.1], [0.1, 0.2]) + &body("c", [0.1, 0.0], [0.2, 0.2]);
    assert_eq!(flows(&BOX.replace(SOIL, &bricks)), "");
    assert_eq!(flows(&repeated().replace(SOIL, &bricks)), "");

    // Steps, gaps, and what hangs in the air are not held.
    let step = body("a", [0.0, 0.0], [0.1, 0.2]) + &body("b", [0.1, 0.0], [0.2, 0.1]);
    let free = |name, end, axis| format!("nothing holds body `{name}` at its {end} end along {axis}");
    assert_eq!(flows(&BOX.replace(SOIL, &step)), free("a", "upper", "x"));
    let step = body("b", [0.0, 0.0], [0.1, 0.1]) + &body("a", [0.1, 0.0], [0.2, 0.2]);
    assert_eq!(flows(&repeated().replace(SOIL, &step)), free("a", "lower", "x"));
    let gap = body("a", [0.0, 0.0], [0.08, 0.1]) + &body("b", [0.12, 0.0], [0.2, 0.1]);
    assert_eq!(flows(&BOX.replace(SOIL, &gap)), free("a", "upper", "x"));
    let drop = body("low", [0.0, 0.0], [0.2, 0.1]) + &body("high", [0.0, 0.15], [0.2, 0.3]);
    assert_eq!(flows(&BOX.replace(SOIL, &drop)), free("high", "lower", "z"));
}

#[test]
fn what_can_flow_may_not() {
    let free = |end: &str, axis: &str| format!("nothing holds body `soil` at its {end} end along {axis}");
    assert_eq!(flows(&BOX.replace(LEFT, "")), free("lower", "x"));
    assert_eq!(flows(&BOX.replace(RIGHT, "")), free("upper", "x"));
    assert_eq!(flows(&BOX.replace(FLOOR, "")), free("lower", "z"));
    assert_eq!(flows(&BOX.replace("spacing", "gravity = [0, 0, 9.81]\nspacing")), free("upper", "z"));
    // Several spacings from the wall that would hold it.
    assert_eq!(flows(&BOX.replace("at = 0.2", "at = 0.23")), free("upper", "x"));
    assert_eq!(flows(&BOX.replace("max = [0.2,", "max = [0.17,")), free("upper", "x"));
    assert_eq!(flows(&repeated().replace("max = [0.2,", "max = [0.17,")), free("lower", "x"));
    let solid = repeated_twice().replace("y = { from = \"0 m\", to = 0.3 }\n", "");
    assert_eq!(flows(&solid), free("lower", "y"));
    // Slopes and round sides.
    let wedge = "wedge = { corner = [0, 0, 0], size = [0.2, 0, 0.1], falls = \"right\" }";
    let text = BOX.replace("box = { min = [0, 0, 0], max = [0.2, 0, 0.1] }", wedge);
    assert_eq!(flows(&text), "body `soil` has a free side");
    let text = solid.replace(
        "box = { min = [0, 0, 0], max = [0.2, 0.3, 0.1] }",
        "cylinder = { radius = 0.1, height = 0.1, base = [0.1, 0.1, 0] }",
    );
    assert_eq!(Space::ThreeD, Scene::read("scene", &text).unwrap().space);
    assert_eq!(flows(&text), "body `soil` has a free side");
    // Driven for ever.
    let slope = repeated().replace("spacing", "gravity = [4.9, 0, -8.5]\nspacing");
    assert_eq!(flows(&slope), "gravity acts along x, where nothing stops it");
    let moving = repeated().replace("[wall", "velocity = [1, 0, 0]\n[wall");
    assert_eq!(flows(&moving), "body `soil` moves along x, where nothing stops it");
    let belt = BOX.replace("slip = \"no-slip\"", "slip = \"no-slip\"\nvelocity = [1, 0, 0]");
    assert_eq!(flows(&belt), "a wall moves");
    // Held, an oblique gravity and a push come to rest.
    assert_eq!(flows(&BOX.replace("spacing", "gravity = [4.9, 0, -8.5]\nspacing")), "");
    assert_eq!(flows(&BOX.replace("[wall.floor]", "velocity = [1, 0, 0]\n[wall.floor]")), "");
}
