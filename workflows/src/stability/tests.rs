use super::{
    definition::{FAILURES, KEYS, Map, Row},
    judge::{Cell, Verdict, cell, short, three, verdict},
    page, picture,
};
use crate::{
    failure::Failure,
    paths,
    study::{
        definition::Run,
        results::{self, Line, Results},
    },
};
use formats::exit;
use std::path::Path;

const METHODS: &str = r#"
[constants]
twice = 2.0

[materials.drucker-prager]
density = 2600.0
young = 5.98e6
poisson = 0.3
friction = 30.0
cohesion = 0.0

[materials.mu-i]
density = 2600.0
sound-speed = 40.0
friction-static = 0.5

[[method]]
name = "plain"
title = "as it is"

[[method]]
name = "slow"
title = "short steps"
set.numerics.courant = 0.2

[[method]]
name = "fluid"
title = "fluid"
material = "mu-i"
set.material.mu-i.unyielded = "elastic"
"#;

const ROW: &str = r#"
failure = 3
title = "noise"
why = "Because."
expected = "Much."
measure = "noise = twice*stress_noise"
holds = 0.1
degrades = 0.4
methods = ["plain", "slow"]

[scene]
space = "plane-strain"
spacing = 0.01
end = { time = 0.1 }

[scene.body.b]
box = { min = [0, 0, 0], max = [0.1, 0, 0.1] }

[material.drucker-prager]
cohesion = 500.0

[material.mu-i]
friction-static = 0.6

[set.slow.initial]
jitter = 0.05
"#;

const SHARED: &str = r#"
failure = 7
title = "relative"
why = "Because."
expected = "Less."
found = "It was."
measure = "over the first = volume_ratio/reference.volume_ratio"
holds = 0.9
degrades = 0.5
reference = "plain"
methods = ["slow", "plain"]
runs_of = "f03-noise"
"#;

fn made_up(methods: &str, row: &str, shared: &str) -> Result<Map, Failure> {
    let work = tempfile::tempdir().unwrap();
    for (name, text) in [("methods", methods), ("f03-noise", row), ("f07-relative", shared)] {
        std::fs::write(work.path().join(name).with_extension("toml"), text).unwrap();
    }
    Map::read(work.path())
}

fn line(run: &Run, exit: i32, measures: &[(&str, f64)]) -> Line {
    Line {
        measures: measures.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
        commit: "abc".into(),
        date: "2026-01-31".into(),
        scene: results::hash(run),
        ranks: 1,
        exit,
        ..Line::default()
    }
}

#[test]
fn runs_are_scenes_with_the_material_and_the_keys_of_a_method() {
    let map = made_up(METHODS, ROW, SHARED).unwrap();
    let names: Vec<&str> = map.study.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, ["f03-noise-plain", "f03-noise-slow"]);
    let titles: Vec<&str> = map.study.measures.iter().map(|measure| measure.title.as_str()).collect();
    assert_eq!(titles, ["stress_noise", "volume_ratio"]);
    let slow = &map.study.runs[1].scene;
    for part in ["cohesion = 500.0", "courant = 0.2", "jitter = 0.05", "young = 5980000.0"] {
        assert!(slow.contains(part), "{part}\n{slow}");
    }
    assert!(!map.study.runs[0].scene.contains("jitter") && !slow.contains("mu-i"));
    let fluid = made_up(METHODS, &ROW.replace("\"slow\"]", "\"slow\", \"fluid\"]"), SHARED).unwrap();
    let fluid = &fluid.study.runs[2].scene;
    assert!(fluid.contains("friction-static = 0.6") && fluid.contains("elastic") && !fluid.contains("drucker"));
    // Both rows look at the same runs, each with its own measure.
    let run = |row: usize| map.run(&map.rows[row], "slow").map(|run| run.name.as_str());
    assert_eq!((run(0), run(1)), (Some("f03-noise-slow"), Some("f03-noise-slow")));
    assert_eq!(map.rows_of(&["F07".into()]).unwrap(), ["f03-noise"]);
    assert_eq!(map.rows_of(&["f3".into(), "f07-relative".into()]).unwrap(), ["f03-noise", "f03-noise"]);
    assert!(map.rows_of(&["F9".into()]).unwrap_err().message.contains("f03-noise"));
}

#[test]
fn faults_are_told_with_their_place() {
    for (what, from, to, fault) in [
        (0, "title = \"short steps\"", "titel = \"x\"", "methods.toml"),
        (0, "courant = 0.2", "courant = 9.0", "numerics.courant"),
        (1, "why = ", "whi = ", "unknown field `whi`"),
        (1, "why = ", "whi = ", "line 4"),
        (1, "stress_noise\"", "stres_noise\"", "f03-noise.toml: measure: `twice*stres_noise`: the name `stres_noise`"),
        (1, "stress_noise\"", "reference.stress_noise\"", "reference.stress_noise"),
        (1, "stress_noise\"", "\"", "a number or a name is missing"),
        (1, "\"slow\"]", "\"quick\"]", "methods: there is no method `quick`; methods.toml has: plain, slow, fluid"),
        (1, "methods = [\"plain\", \"slow\"]", "methods = [\"plain\"]", "set.slow"),
        (1, "failure = 3", "failure = 21", "F21 is none of F1 to F20"),
        (1, "failure = 3", "failure = 4", "begins with f04"),
        (1, "degrades = 0.4", "degrades = 0.1", "two different numbers"),
        (1, "cohesion = 500.0", "cohesian = 500.0", "cohesian"),
        (2, "\"f03-noise\"", "\"f04-noise\"", "no row `f04-noise`"),
        (2, "reference = \"plain\"", "reference = \"fluid\"", "`fluid` is not among the methods"),
        (2, "[\"slow\", \"plain\"]", "[\"fluid\", \"plain\"]", "`f03-noise` has no runs of `fluid`"),
        (2, "runs_of = \"f03-noise\"", "", "scene: it is missing"),
        (2, "runs_of = \"f03-noise\"", "runs_of = \"f03-noise\"\nscene.space = \"3d\"", "those of the other row"),
    ] {
        let mut texts = [METHODS, ROW, SHARED].map(str::to_owned);
        assert!(texts[what].contains(from), "{from}");
        texts[what] = texts[what].replacen(from, to, 1);
        let failure = made_up(&texts[0], &texts[1], &texts[2]).unwrap_err();
        assert!(failure.message.contains(fault) && failure.code != 0, "{fault}: {failure}");
        assert!(failure.message.contains(".toml"), "{failure}");
    }
}

#[test]
fn thresholds_judge_in_either_direction() {
    let map = made_up(METHODS, ROW, SHARED).unwrap();
    let of = |row: usize, values: [f64; 5]| values.map(|value| verdict(&map.rows[row], value));
    use Verdict::{Degrades, Fails, Holds};
    assert_eq!(of(0, [-1.0, 0.1, 0.11, 0.4, 0.41]), [Holds, Holds, Degrades, Degrades, Fails]);
    assert_eq!(of(1, [2.0, 0.9, 0.89, 0.5, 0.49]), [Holds, Holds, Degrades, Degrades, Fails]);
}

#[test]
fn what_breaks_down_fails_and_what_was_killed_is_to_do() {
    let map = made_up(METHODS, ROW, SHARED).unwrap();
    let [plain, slow] = [&map.study.runs[0], &map.study.runs[1]];
    let mut results = Results::default();
    let now = |results: &Results, row: usize, method: &str| cell(&map, results, &map.rows[row], method);
    assert_eq!([now(&results, 0, "plain"), now(&results, 0, "fluid")], [Cell::ToDo, Cell::Empty]);
    results.0.insert(plain.name.clone(), line(plain, 0, &[("stress_noise", 0.03), ("volume_ratio", 2.0)]));
    results.0.insert(slow.name.clone(), line(slow, 0, &[("stress_noise", 0.3), ("volume_ratio", 1.2)]));
    assert_eq!(now(&results, 0, "plain"), Cell::Judged(Verdict::Holds, 0.06));
    assert_eq!(now(&results, 0, "slow"), Cell::Judged(Verdict::Fails, 0.6));
    assert_eq!(now(&results, 1, "slow"), Cell::Judged(Verdict::Degrades, 0.6));
    results.0.insert(slow.name.clone(), line(slow, 0, &[("volume_ratio", 1.2)]));
    assert_eq!(now(&results, 0, "slow"), Cell::NoValue);
    results.0.insert(slow.name.clone(), line(slow, exit::NUMERICAL, &[]));
    assert_eq!((now(&results, 0, "slow"), now(&results, 0, "slow").verdict()), (Cell::Broke, Some(Verdict::Fails)));
    for killed in [137, 143, exit::RESUMABLE, exit::CANNOT_WRITE] {
        results.0.insert(slow.name.clone(), line(slow, killed, &[("stress_noise", 0.03)]));
        assert_eq!(now(&results, 0, "slow"), Cell::ToDo, "{killed}");
    }
    // Of another scene.
    results.0.insert(slow.name.clone(), Line { scene: "0".into(), ..line(slow, 0, &[("stress_noise", 0.03)]) });
    assert_eq!(now(&results, 0, "slow"), Cell::ToDo);
    // The reference broke down: nothing to compare with.
    results.0.insert(slow.name.clone(), line(slow, 0, &[("volume_ratio", 1.2)]));
    results.0.insert(plain.name.clone(), line(plain, exit::NUMERICAL, &[]));
    assert_eq!(now(&results, 1, "slow"), Cell::NoValue);
}

#[test]
fn the_page_has_a_table_for_each_row_and_the_picture_a_cell_for_each_pair() {
    let map = made_up(METHODS, ROW, SHARED).unwrap();
    let [plain, slow] = [&map.study.runs[0], &map.study.runs[1]];
    let mut results = Results::default();
    results.0.insert(plain.name.clone(), line(plain, 0, &[("stress_noise", 0.03), ("volume_ratio", 2.0)]));
    results.0.insert(slow.name.clone(), line(slow, exit::NUMERICAL, &[]));
    let text = page::section(&map, &results, &map.rows[0]);
    for wanted in [
        "### F3: noise (`f03-noise`)",
        "`twice*stress_noise`; holds ≤ 0.1, degrades ≤ 0.4, else fails.",
        "| as it is | 0.06 | holds |",
        "| short steps | broke down (70) | **fails** |",
    ] {
        assert!(text.lines().any(|line| line.contains(wanted)), "{wanted}\n{text}");
    }
    assert!(!text.contains("| fluid |") && !text.contains("Found"));
    let text = page::section(&map, &results, &map.rows[1]);
    assert!(text.contains("(reference: `plain`); holds ≥ 0.9") && text.ends_with("*Found:* It was."), "{text}");
    let text = page::summary(&map, &results);
    assert!(text.contains("2 cells hold, 0 degrade, 2 fail. 1 of 2 runs, computed by abc, 2026-01-31."), "{text}");
    results.0.remove(&slow.name);
    assert!(page::summary(&map, &results).contains("0 fail, 2 are open"));
    assert!(picture::png(&map, &results).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn numbers_are_short() {
    for (value, text) in [
        (0.0, "0"),
        (0.059_96, "0.060"),
        (0.0996, "0.10"),
        (1.244, "1.24"),
        (9.96, "10.0"),
        (-0.34, "-0.34"),
        (123.4, "123"),
        (-1.03e-3, "-1e-3"),
        (2.3e-5, "2e-5"),
        (1.2e6, "1e6"),
    ] {
        assert_eq!(short(value), text, "{value}");
        assert!(text.len() <= 6);
    }
    assert_eq!([1.244_56, 0.0, 4.191e-5, -0.034_449].map(three), ["1.24", "0", "4.19e-5", "-0.0344"]);
}

/// The map that is kept.
#[test]
fn every_failure_has_a_row() {
    let map = Map::read(&paths::stability()).unwrap();
    let has = |number: u32| map.rows.iter().any(|row: &Row| row.failure == number);
    let missing: Vec<u32> = (1..=FAILURES).filter(|number| !has(*number)).collect();
    assert!(missing.is_empty(), "no row for F{missing:?}");
    // Titles fit into the picture.
    map.rows.iter().for_each(|row| assert!(row.title.chars().count() <= 42, "{}", row.title));
    map.methods.iter().for_each(|method| assert!(method.title.chars().count() <= 36, "{}", method.title));
    let used = |name: &String| map.rows.iter().any(|row| row.methods.contains(name));
    map.methods.iter().for_each(|method| assert!(used(&method.name), "{} is nowhere", method.name));
}

/// What measures may name is what `sph-post` writes.
#[test]
fn keys_are_those_of_the_summary() {
    let source = |name: &str| std::fs::read_to_string(paths::repository().join("sph-post/src").join(name)).unwrap();
    let sources = [source("summary.rs"), source("health/mod.rs")].concat();
    for key in KEYS {
        assert!(sources.contains(&format!("\"{key}\"")), "{key}");
    }
    let health = source("health/mod.rs");
    let listed = health.split("(\"").skip(1).filter_map(|rest| rest.split('"').next());
    for key in listed {
        assert!(KEYS.contains(&key), "{key} of health/mod.rs is not among the keys");
    }
}

/// The page that is kept is that of the results that are kept.
#[test]
fn the_page_is_up_to_date() {
    let map = Map::read(&paths::stability()).unwrap();
    let results = Results::read(&map.study).unwrap();
    let text = std::fs::read_to_string(paths::stability_page()).unwrap();
    for row in &map.rows {
        let section = page::section(&map, &results, row);
        assert!(text.contains(&section), "{}: ./talus stability --draw makes it anew\n{section}", row.name);
    }
    assert!(text.contains(&page::summary(&map, &results)));
    assert!(Path::new(&paths::stability_page()).with_file_name("map.png").is_file());
}
