//! `"auto"`: what is left out of a scene, that nothing else changes, and that near symmetry is none.

use formats::{
    scene::{Scene, Sources},
    space::Space,
};

/// What scenes have in common, with a floor.
const REST: &str = r#"
title = "A scene"
[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = 0
[wall.floor]
axis = "z"
at = 0
side = "above"
slip = "no-slip"
[end]
time = "0.35 s"
"#;

fn scene(head: &str, rest: &str) -> String {
    // Keys at the top of a file come before its tables.
    let (title, tables) = REST.split_once("[material").unwrap();
    format!("spacing = \"1 cm\"\n{head}{title}{rest}\n[material{tables}")
}

fn wall(name: &str, axis: &str, at: &str, side: &str, slip: &str) -> String {
    format!("[wall.{name}]\naxis = \"{axis}\"\nat = \"{at}\"\nside = \"{side}\"\nslip = \"{slip}\"\n")
}

const AUTO: &str = "space = \"auto\"\n";

fn good(text: &str) -> Scene {
    Scene::read("scene.toml", text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The text has one fault, told with these words.
#[track_caller]
fn bad(text: &str, words: &str) {
    let report = Scene::read("scene.toml", text).expect_err("a fault").report();
    assert!(report.contains(words) && report.lines().count() == 1, "{report}");
}

/// That of a text that leaves choices to the program, without the record of them.
fn bare(text: &str) -> Scene {
    let scene = good(text);
    assert!(scene.chosen.is_some(), "nothing was chosen in {text}");
    Scene { chosen: None, ..scene }
}

#[track_caller]
fn is_as_by_hand(auto: &str, hand: &str) {
    assert_eq!(bare(auto), good(hand));
}

/// The scene stays three-dimensional and whole, and the reasons say so in these words.
#[track_caller]
fn is_not_reduced(text: &str, why: &[&str]) {
    let scene = good(text);
    assert_eq!((scene.space, scene.symmetry), (Space::ThreeD, [false; 2]), "{:?}", scene.chosen);
    let chosen = scene.chosen.as_ref().expect("choices");
    assert_eq!(Scene { chosen: None, ..scene.clone() }, *chosen.full);
    let refused = chosen.refused.join("\n");
    for words in why {
        assert!(refused.contains(words), "{words} in\n{refused}");
    }
}

const COLUMN: &str = "[body.column]\ncylinder = { radius = \"10 cm\", height = \"20 cm\"BASE }\n";

fn column(base: &str) -> String {
    let base = if base.is_empty() { String::new() } else { format!(", base = [{base}]") };
    COLUMN.replace("BASE", &base)
}

const CAP: &str = "[body.cap]\ncylinder = { radius = \"5 cm\", height = \"5 cm\", base = [BASE] }\n";

#[test]
fn coaxial_cylinders_become_rings() {
    let hand = scene("space = \"axisymmetric\"\n", &column(""));
    is_as_by_hand(&scene(AUTO, &column("")), &hand);
    // Around another axis, a tenth of a metre written in two ways.
    let stacked = column("0.1, \"-3 cm\", 0") + &CAP.replace("BASE", "\"10 cm\", -0.03, 0.2");
    let hand = scene("space = \"axisymmetric\"\n", &(column("0, 0, 0") + &CAP.replace("BASE", "0, 0, 0.2")));
    is_as_by_hand(&scene(AUTO, &stacked), &hand);
    let falls = column("") + "velocity = [0, 0, \"-1 m/s\"]\n" + &wall("lid", "z", "1 m", "below", "free-slip");
    is_as_by_hand(&scene(AUTO, &falls), &scene("space = \"axisymmetric\"\n", &falls));
    // A quarter by hand is still round; its Courant number is that of rings.
    let quarter = format!("{AUTO}symmetry = [\"x\", \"y\"]\n");
    let rings = bare(&scene(&quarter, &column("")));
    assert_eq!(rings, good(&scene("space = \"axisymmetric\"\n", &column(""))));
    assert!(rings.numerics.courant < good(&scene("space = \"3d\"\n", &column(""))).numerics.courant);
}

#[test]
fn what_is_not_round_does_not_become_rings() {
    let full = format!("{AUTO}symmetry = []\n");
    let not = |rest: &str, why: &str| is_not_reduced(&scene(&full, rest), &[&format!("axisymmetric: {why}")]);
    // A second cylinder 1 mm, and one part in 10^12, off the axis of the first.
    not(&(column("") + &CAP.replace("BASE", "\"1 mm\", 0, 0.2")), "body `cap` stands at x = 0.001 m");
    not(&(column("0.1, 0, 0") + &CAP.replace("BASE", "0.1000000000001, 0, 0.2")), "body `cap` stands at");
    not(
        "[body.block]\nbox = { min = [-0.1, -0.1, 0], max = [0.1, 0.1, 0.2] }\n",
        "body `block` is no upright cylinder",
    );
    not(&(column("") + &wall("side", "x", "0.5 m", "below", "free-slip")), "the wall x = 0.5 m is not round");
    not(
        &(column("") + "velocity = [0, \"1 um/s\", 0]\n".replace("um/s", "mm/s").as_str()),
        "body `column` moves along y",
    );
    not(&(column("") + "[periodic]\nx = { from = -0.5, to = 0.5 }\n"), "it repeats itself along x");
    let slides = REST.replace("slip = \"no-slip\"", "slip = \"no-slip\"\nvelocity = [\"1 mm/s\", 0, 0]");
    let text = scene(&full, &column(""))
        .replace(&REST[REST.find("[wall").unwrap()..], &slides[slides.find("[wall").unwrap()..]);
    is_not_reduced(&text, &["axisymmetric: the wall z = 0 m slides along x"]);
    let tilted = format!("{full}gravity = [9.81e-6, 0, -9.81]\n");
    is_not_reduced(&scene(&tilted, &column("")), &["axisymmetric: gravity has a component along x"]);
    // Half of it by hand, but not through its axis: two columns.
    let text = scene(&format!("{AUTO}symmetry = [\"x\"]\n"), &column("0.2, 0, 0"));
    assert_eq!(good(&text).space, Space::ThreeD);
}

#[test]
fn what_rings_cannot_have_is_the_reason() {
    let full = format!("{AUTO}symmetry = []\n");
    let lattice = column("") + "[initial]\nlattice = \"body-centred\"\n";
    is_not_reduced(
        &scene(&full, &lattice),
        &["axisymmetric: the scene would have a fault: initial.lattice", "hexagonal"],
    );
    let courant = column("") + "[numerics]\ncourant = 1.0\n";
    is_not_reduced(&scene(&full, &courant), &["numerics.courant: 1.0 is too large"]);
    // With planes of symmetry it is cut all the same.
    assert_eq!(good(&scene(AUTO, &courant)).symmetry, [true; 2]);
}

const BLOCK: &str = "[body.block]\nbox = { min = [0.03, FROM, 0], max = [\"30 cm\", TO, 0.1] }\n";

fn block(from: &str, to: &str) -> String {
    BLOCK.replace("FROM", from).replace("TO", to)
}

fn sides(slip: &str) -> String {
    wall("front", "y", "-0.1 m", "above", slip) + &wall("back", "y", "0.2 m", "below", slip)
}

const RAMP: &str = "[body.ramp]\nwedge = { corner = [0.3, -0.1, 0], size = [0.1, 0.3, 0.1], falls = \"right\" }\n";

#[test]
fn what_fills_its_width_becomes_plane_strain() {
    let hand = scene("space = \"plane-strain\"\n", &(block("0", "0") + RAMP));
    is_as_by_hand(&scene(AUTO, &(block("-0.1", "\"20 cm\"") + RAMP + &sides("free-slip"))), &hand);
    let period = "[periodic]\ny = { from = -0.1, to = 0.2 }\n";
    is_as_by_hand(&scene(AUTO, &(block("\"-10 cm\"", "0.2") + RAMP + period)), &hand);
    // Half of the width, behind a plane of symmetry.
    let text = format!("{AUTO}symmetry = [\"y\"]\n");
    let half = block("-0.2", "0.2") + &wall("back", "y", "0.2 m", "below", "free-slip");
    is_as_by_hand(&scene(&text, &half), &scene("space = \"plane-strain\"\n", &block("0", "0")));
    // Half of the length besides.
    let centred = |from: &str, y: &str, to: &str, z: &str| {
        format!("[body.heap]\nbox = {{ min = [{from}, {y}, 0], max = [0.2, {to}, {z}] }}\n")
    };
    let text = scene(AUTO, &(centred("-0.2", "-0.1", "0.2", "0.1") + &sides("free-slip")));
    let hand = scene("space = \"plane-strain\"\nsymmetry = [\"x\"]\n", &centred("0", "0", "0", "0.1"));
    is_as_by_hand(&text, &hand);
    let why = good(&text).chosen.unwrap().choices[0].to_string();
    assert!(why.starts_with("space = \"plane-strain\": ") && why.contains("metre of depth"), "{why}");
    // A plane-strain scene that asks for its planes.
    let text = scene("space = \"plane-strain\"\nsymmetry = \"auto\"\n", &centred("-0.2", "0", "0", "0.1"));
    is_as_by_hand(&text, &hand);
}

#[test]
fn what_can_spread_or_rubs_does_not_become_plane_strain() {
    let full = format!("{AUTO}symmetry = []\n");
    let not = |rest: &str, why: &str| is_not_reduced(&scene(&full, rest), &[&format!("plane strain: {why}")]);
    not(&(block("-0.1", "0.2") + &sides("no-slip")), "the material sticks to the wall y = -0.1 m");
    // A gap of one spacing; and of one part in 10^12.
    not(
        &(block("-0.1", "0.19") + &sides("free-slip")),
        "body `block` lies from y = -0.1 m to 0.19 m, and there is room",
    );
    not(&(block("-0.1", "0.1999999999998") + &sides("free-slip")), "body `block` lies from y = -0.1 m");
    let narrow = block("-0.1", "0.2") + &RAMP.replace("0.3, 0.1]", "0.29, 0.1]") + &sides("free-slip");
    not(&narrow, "body `ramp` lies from");
    not(&block("-0.1", "0.2"), "nothing holds the material at its lower end along y");
    not(
        &(block("-0.1", "0.2") + &wall("front", "y", "-0.1 m", "above", "free-slip")),
        "nothing holds the material at its upper",
    );
    let moves = block("-0.1", "0.2") + "velocity = [0, \"1 mm/s\", 0]\n" + &sides("free-slip");
    not(&moves, "body `block` moves along y");
    not(&(column("0.05, 0.05, 0") + &sides("free-slip")), "body `column` is neither a box nor a wedge");
    let belt = wall("lid", "z", "0.5 m", "below", "no-slip") + "velocity = [0, \"1 m/s\", 0]\n";
    not(&(block("-0.1", "0.2") + &sides("free-slip") + &belt), "the wall z = 0.5 m slides along y");
    let tilted = format!("{full}gravity = [0, 1e-9, -9.81]\n");
    let text = scene(&tilted, &(block("-0.1", "0.2") + &sides("free-slip")));
    is_not_reduced(&text, &["plane strain: gravity has a component along y"]);
}

fn bin(name: &str, min: &str, max: &str, velocity: &str) -> String {
    format!("[body.{name}]\nbox = {{ min = [{min}], max = [{max}] }}\nvelocity = [{velocity}]\n")
}

#[test]
fn mirror_images_are_left_out() {
    // A pile, two blocks that fall together, a ridge of two wedges, walls on both sides.
    let pile = bin("pile", "-0.1, -0.2, 0", "0.1, 0.2, 0.1", "0, 0, 0");
    let hand = bin("pile", "0, 0, 0", "0.1, 0.2, 0.1", "0, 0, 0");
    let quarter = "space = \"3d\"\nsymmetry = [\"x\", \"y\"]\n";
    is_as_by_hand(&scene(AUTO, &pile), &scene(quarter, &hand));
    let walls = |left: bool| {
        let left = if left { wall("left", "x", "-0.5 m", "above", "free-slip") } else { String::new() };
        left + &wall("right", "x", "50 cm", "below", "free-slip")
    };
    let left = bin("left", "-0.3, -0.1, 0", "-0.2, 0.1, 0.1", "1, 0, -2");
    let right = |y: &str| bin("right", &format!("0.2, {y}, 0"), "0.3, 0.1, 0.1", "-1, 0, -2");
    is_as_by_hand(
        &scene(AUTO, &(left + &right("-0.1") + &walls(true))),
        &scene(quarter, &(right("0") + &walls(false))),
    );
    let wedge = |x: &str, y: &str, width: &str, falls: &str| {
        format!(
            "[body.{falls}]\nwedge = {{ corner = [{x}, {y}, 0], size = [0.3, {width}, 0.1], falls = \"{falls}\" }}\n"
        )
    };
    let ridge = wedge("0", "-0.1", "0.2", "left") + &wedge("0", "-0.1", "0.2", "right");
    is_as_by_hand(&scene(AUTO, &ridge), &scene(quarter, &wedge("0", "0", "0.1", "right")));
    // About one plane only; in three dimensions as the scene says.
    let tilted = "gravity = [1, 0, -9]\n";
    let half = scene(
        &format!("space = \"3d\"\nsymmetry = [\"y\"]\n{tilted}"),
        &bin("pile", "-0.1, 0, 0", "0.1, 0.2, 0.1", "0, 0, 0"),
    );
    is_as_by_hand(&scene(&format!("{AUTO}{tilted}"), &pile), &half);
    is_as_by_hand(&scene(&format!("space = \"3d\"\nsymmetry = \"auto\"\n{tilted}"), &pile), &half);
    let cylinder = scene("space = \"3d\"\nsymmetry = \"auto\"\n", &column("0, 0, 0"));
    is_as_by_hand(&cylinder, &scene(quarter, &column("0, 0, 0")));
}

#[test]
fn near_symmetry_is_none() {
    // About y nothing is symmetric here.
    let pair = |left: [&str; 3], right: [&str; 3]| {
        bin("left", left[0], left[1], left[2]) + &bin("right", right[0], right[1], right[2])
    };
    let right = ["0.2, 0, 0", "0.3, 0.1, 0.1", "-1, 0, 0"];
    let not = |rest: &str, why: &str| {
        is_not_reduced(
            &scene(AUTO, rest),
            &[&format!("mirror symmetry about x = 0: {why}"), "mirror symmetry about y = 0: "],
        );
    };
    not(
        &pair(["-0.3, 0, 0", "-0.2, 0.1, 0.1", "1.000001, 0, 0"], right),
        "body `left` has no mirror image that moves along x",
    );
    not(&pair(["-0.3, 0, 0", "-0.2, 0.1, 0.1", "-1, 0, 0"], right), "body `left` has no mirror image");
    not(&pair(["-0.301, 0, 0", "-0.2, 0.1, 0.1", "1, 0, 0"], right), "body `left` has no mirror image");
    not(&pair(["-0.3, 0, 0", "-0.2, 0.1, 0.10000000000001", "1, 0, 0"], right), "body `left` has no mirror image");
    let off = "[body.column]\ncylinder = { radius = 0.1, height = 0.2, base = [\"1 mm\", 0.3, 0] }\n\
               [body.other]\nbox = { min = [0.2, 0, 0], max = [0.3, 0.1, 0.1] }\n";
    not(off, "body `column` has no mirror image");
    let middle = bin("pile", "-0.1, 0, 0", "0.1, 0.1, 0.1", "0, 0, 0");
    not(
        &(middle.clone() + &wall("side", "x", "0.5 m", "below", "free-slip")),
        "the wall x = 0.5 m has no mirror image",
    );
    let two = |at: &str, slip: &str| {
        wall("left", "x", at, "above", "free-slip") + &wall("right", "x", "0.5 m", "below", slip)
    };
    not(&(middle.clone() + &two("-0.51 m", "free-slip")), "the wall x = -0.51 m has no mirror image");
    not(&(middle.clone() + &two("-0.5 m", "no-slip")), "the wall x = -0.5 m has no mirror image");
    let belt = wall("lid", "z", "0.5 m", "below", "no-slip") + "velocity = [\"1 mm/s\", 0, 0]\n";
    not(&(middle.clone() + &belt), "the wall z = 0.5 m slides along x");
    not(&(middle.clone() + "[periodic]\nx = { from = -0.5, to = 0.5 }\n"), "it repeats itself along x");
    not(
        &bin("pile", "-0.1, 0, 0", "0.1, 0.1, 0.1", "0.001, 0, 0"),
        "body `pile` has no mirror image that moves along x",
    );
    let wedge = |name: &str, falls: &str, length: &str| {
        format!("[body.{name}]\nwedge = {{ corner = [0, 0, 0], size = [{length}, 0.2, 0.1], falls = \"{falls}\" }}\n")
    };
    not(&(wedge("a", "left", "0.3") + &wedge("b", "right", "0.31")), "body `a` has no mirror image");
    // A row of particles in the plane.
    not(&bin("pile", "-0.105, 0, 0", "0.105, 0.1, 0.1", "0, 0, 0"), "body `pile` is 21 spacings wide, an odd number");
    let tilted = format!("{AUTO}gravity = [1e-6, 0, -9.81]\n");
    is_not_reduced(&scene(&tilted, &middle), &["mirror symmetry about x = 0: gravity has a component along x"]);
    // Walls that do not fit the lattice of a half.
    let walls =
        wall("left", "x", "-0.505 m", "above", "free-slip") + &wall("right", "x", "0.505 m", "below", "free-slip");
    not(&(middle + &walls), "the scene would have a fault: wall.right.at: must be a whole number of spacings");
}

#[test]
fn terrain_is_not_reduced() {
    let folder = tempfile::tempdir().unwrap();
    let raster = "ncols 3\nnrows 3\nxllcenter -1\nyllcenter -1\ncellsize 1\n0 0 0\n0 0 0\n0 0 0\n";
    std::fs::write(folder.path().join("flat.asc"), raster).unwrap();
    let text = scene(
        AUTO,
        "[terrain]\nfile = \"flat.asc\"\nslip = \"no-slip\"\n[body.heap.release]\nthickness = 0.1\n\
                            polygon = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]\n",
    );
    let floor = &REST[REST.find("[wall").unwrap()..REST.find("[end]").unwrap()];
    let name = folder.path().join("scene.toml");
    let read = Scene::read(&name.display().to_string(), &text.replace(floor, "")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((read.space, read.symmetry), (Space::ThreeD, [false; 2]));
    assert!(read.chosen.unwrap().refused.iter().any(|why| why.contains("there is a terrain")));
}

const FLUID: &str = "space = \"auto\"\nspacing = \"1 cm\"\n[material.visco-plastic]\ndensity = 2000\nsound-speed = \"auto\"\n\
                     friction = 30\ncohesion = 0\nviscosity = 0.001\nviscosity-solid = 200\n[body.block]\n\
                     box = { min = [0, 0, 0], max = [0.2, 0.1, 0.2] }\n[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\n\
                     slip = \"no-slip\"\n[end]\ntime = 1\n";

#[test]
fn sound_is_ten_times_as_fast_as_a_fall() {
    let speed = |text: &str| good(text).material.sound_speed();
    // 10 sqrt(2 g H) = 10 sqrt(3.924), to three digits.
    assert_eq!(speed(FLUID), 19.8);
    is_as_by_hand(
        &FLUID.replace("space = \"auto\"", "space = \"3d\""),
        &FLUID.replace("\"auto\"", "\"3d\"").replace("sound-speed = \"3d\"", "sound-speed = 19.8"),
    );
    // 10 (sqrt(v^2 + 2 g H + 2 p/rho) + V): sqrt(9 + 3.924 + 1) + 0.5.
    let body = "max = [0.2, 0.1, 0.2] }\n";
    let fast = FLUID.replace(body, &format!("{body}velocity = [0, 3, 0]\n")).replace(
        "slip = \"no-slip\"\n",
        "slip = \"no-slip\"\nvelocity = [0, 0.5, 0]\n[initial]\nstress = \"pressure\"\npressure = 1000\n",
    );
    assert_eq!(speed(&fast), 42.3);
    // Down a slope to a wall: g_x counts along the way to it.
    let slope = format!("gravity = [3, 0, -9]\n{FLUID}");
    let message = "scene.toml:6:15: material.visco-plastic.sound-speed: \"auto\" needs a bound of the speeds, and gravity \
                   acts along x";
    bad(&slope, message);
    let stopped = slope + &wall("end", "x", "1 m", "below", "free-slip");
    // 2 (3 * 1 + 9 * 0.2) = 9.6.
    assert_eq!(speed(&stopped), 31.0);
    bad(&format!("gravity = 0\n{FLUID}"), "there is neither gravity nor a speed");
}

#[test]
fn runs_end_at_rest_where_they_can_come_to_rest() {
    let at_rest = |text: &str| {
        let scene = good(
            &text
                .replace("time = 1", "time = 1\nat-rest = \"auto\"")
                .replace("\"0.35 s\"", "\"0.35 s\"\nat-rest = \"auto\""),
        );
        let chosen = scene.chosen.expect("choices");
        let choice = chosen.choices.into_iter().find(|choice| choice.key == "end.at-rest").expect("its choice");
        (scene.end.at_rest, choice.why)
    };
    let is_none = |text: &str, words: &str| {
        let (fraction, why) = at_rest(text);
        assert!(fraction.is_none() && why.contains(words), "{fraction:?} {why}");
    };
    assert_eq!(at_rest(&scene(AUTO, &column(""))).0, Some(5e-5));
    assert_eq!(at_rest(FLUID).0, Some(5e-5));
    is_none(&FLUID.replace("friction = 30", "friction = 0"), "it sloshes");
    is_none(&scene(AUTO, &(column("") + "velocity = [0, 0, 1]\n")), "moves up");
    is_none(
        &scene(
            AUTO,
            &(block("-0.1", "0.2")
                + &sides("free-slip")
                + &wall("a", "x", "0.03 m", "above", "free-slip")
                + &wall("b", "x", "0.3 m", "below", "free-slip")),
        ),
        "it is held on every side",
    );
    let belt = wall("lid", "z", "0.5 m", "below", "no-slip") + "velocity = [0, \"1 m/s\", 0]\n";
    is_none(&scene(AUTO, &(column("") + &belt)), "a wall moves");
    let chute =
        "[periodic]\nx = { from = 0, to = 0.27 }\n".to_string() + &bin("layer", "0, 0, 0", "0.27, 0.1, 0.1", "0, 0, 0");
    is_none(&scene(&format!("{AUTO}gravity = [3, 0, -9]\n"), &chute), "it flows along the period, x");
    let floor = &REST[REST.find("[wall").unwrap()..REST.find("[end]").unwrap()];
    is_none(&scene(AUTO, &column("")).replace(floor, ""), "no floor catches it");
}

#[test]
fn the_hash_knows_the_choices_but_not_when_the_run_is_over() {
    let text = scene(AUTO, &column(""));
    let auto = good(&text);
    let hash = auto.hash_of(&text);
    assert_ne!(hash, Scene::hash(&text));
    let mut other = auto.clone();
    other.chosen.as_mut().unwrap().choices[0].value = "\"3d\"".into();
    assert_ne!(other.hash_of(&text), hash, "a program that chooses otherwise");
    let later = text.replace("\"0.35 s\"", "2\nat-rest = \"auto\"");
    assert_eq!(good(&later).hash_of(&later), hash);
    assert_eq!(Scene::changes("new", &text, &later).unwrap().len(), 2);
    // Where no key that binds is left open the hash is that of the text alone.
    let rings = scene("space = \"axisymmetric\"\n", &column("")).replace("\"0.35 s\"", "2\nat-rest = \"auto\"");
    assert_eq!(good(&rings).hash_of(&rings), Scene::hash(&rings));
}

#[test]
fn scenes_that_name_their_space_could_be_smaller() {
    let smaller =
        |text: &str| Scene::smaller("scene.toml", text, &Sources::from_bytes(&[])).map(|s| (s.space, s.symmetry));
    assert_eq!(smaller(&scene("space = \"3d\"\n", &column(""))), Some((Space::Axisymmetric, [false; 2])));
    let quarter = "space = \"3d\"\nsymmetry = [\"x\", \"y\"]\n";
    assert_eq!(smaller(&scene(quarter, &column(""))), Some((Space::Axisymmetric, [false; 2])));
    let pile = bin("pile", "-0.1, -0.2, 0", "0.1, 0.2, 0.1", "0, 0, 0");
    assert_eq!(smaller(&scene("space = \"3d\"\n", &pile)), Some((Space::ThreeD, [true; 2])));
    assert_eq!(smaller(&scene("space = \"3d\"\nsymmetry = []\n", &pile)), None, "said, and so meant");
    assert_eq!(smaller(&scene("space = \"plane-strain\"\n", &pile)), Some((Space::PlaneStrain, [true, false])));
    assert_eq!(smaller(&scene("space = \"axisymmetric\"\n", &column(""))), None);
    assert_eq!(smaller(&scene(AUTO, &column(""))), None);
    assert_eq!(smaller(&scene("space = \"3d\"\n", &bin("a", "0, 0, 0", "0.1, 0.2, 0.1", "0, 0, 0"))), None);
}

#[test]
fn faults_are_those_of_the_description() {
    bad(&scene("space = \"auot\"\n", &column("")), "did you mean `auto`?");
    bad(&scene(AUTO, &(column("") + "velocity = [0, 0, \"1 m\"]\n")), "scene.toml:");
    bad(&scene(AUTO, "[body.b]\nbox = { min = [0, 0, 0], max = [0.1, -0.1, 0.1] }\n"), "the upper corner's y");
    // With a line that is no TOML nothing is chosen, and nothing else is said.
    bad(&(scene(AUTO, &column("")) + "[output]\nsnapshots = 5 ms\n"), "not valid TOML");
}
