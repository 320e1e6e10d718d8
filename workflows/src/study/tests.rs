//! The studies that come along, and small ones made up here.

use super::{
    batch,
    definition::{self, Study},
    page,
    results::{self, Line, Results},
    table,
    template::Value,
};
use crate::paths;
use formats::scene::Scene;
use std::collections::BTreeMap;
use std::path::Path;

fn all() -> Vec<Study> {
    definition::shelf()
        .names()
        .unwrap()
        .iter()
        .map(|name| Study::named(name).unwrap_or_else(|e| panic!("{e}")))
        .collect()
}

#[test]
fn every_run_of_every_study_is_a_valid_scene() {
    let studies = all();
    let names: Vec<&str> = studies.iter().map(|study| study.name.as_str()).collect();
    assert_eq!(names, ["choices", "columns", "columns-3d", "columns-plane", "time-step"]);
    for study in studies {
        assert!(study.runs.len() >= 10, "{}", study.name);
        for run in &study.runs {
            // Reading the study has checked them; what stays is that the values have arrived.
            let scene = Scene::read(&run.name, &run.scene).unwrap();
            let resolution = super::template::number(&run.parameters, "resolution").unwrap();
            let r0 = if run.scene.contains("0.097") { 0.097 } else { 0.1 };
            assert!((scene.spacing * resolution / r0 - 1.0).abs() < 0.04, "{}: {}", run.name, scene.spacing);
            assert!(!scene.title.contains('{') && run.seconds > 0.01, "{}", run.name);
        }
    }
}

#[test]
fn the_page_has_markers_for_every_table_and_picture_and_no_others() {
    let page = std::fs::read_to_string(paths::page()).unwrap();
    let mut wanted: Vec<String> = all().iter().flat_map(Study::marked).chain([page::COVERAGE.to_owned()]).collect();
    let mut found: Vec<String> = page::markers(&page).into_iter().map(str::to_owned).collect();
    wanted.sort();
    found.sort();
    assert_eq!(found, wanted);
    for name in wanted {
        assert!(page.contains(&format!("<!-- end {name} -->")), "{name}");
    }
}

#[test]
fn between_the_markers_only_is_replaced() {
    let page = "# Page\n\ntext\n<!-- begin s/t -->\nold\n<!-- end s/t -->\nmore\n<!-- begin s/t2 -->\nkept\n<!-- end s/t2 -->\n";
    let new = page::replaced(page, "s/t", "| a |\n").unwrap();
    assert_eq!(new, page.replace("\nold\n", "\n\n| a |\n\n"));
    assert_eq!(page::replaced(&new, "s/t", "| a |\n").unwrap(), new);
    assert!(page::replaced(page, "s/x", "").unwrap_err().contains("begin s/x"));
    assert!(page::replaced(&format!("{page}{page}"), "s/t", "").unwrap_err().contains("twice"));
}

const STUDY: &str = r#"
title = "Made up"
measures = ["runout", "height = final / r0"]
[constants]
r0 = 0.1
[[series]]
name = "b"
scene = ["t.toml"]
values = [{ aspect = [10, 2] }]
[[series]]
name = "a"
scene = ["t.toml"]
set.numerics.courant = "{0.1*3}"
variants = [{ name = "soft", set = { material.drucker-prager.young = 1e6 } }, { name = "hard" }]
values = [{ aspect = [2] }]
[[reference]]
name = "twice"
label = "2 a"
expression = "2*aspect*sqrt(9 - aspect)/sqrt(9 - aspect)"
[[table]]
name = "all"
columns = ["series = series", "a = aspect", "run-out = runout", "over 2a = runout/twice"]
[[table]]
name = "mean"
mean = ["series"]
columns = ["error [%] = 100*abs(runout/twice - 1)"]
[[table]]
name = "pairs"
series = ["a"]
beside = "b"
columns = ["variant = variant", "ratio = runout/other.runout"]
"#;

const TEMPLATE: &str = r#"
title = "a = {aspect}"
space = "axisymmetric"
spacing = {r0/10}
[material.drucker-prager]
density = 2600
young = 5.98e6
poisson = 0.3
friction = 30
cohesion = 0
[body.column]
cylinder = { radius = {r0}, height = {r0*aspect} }
[wall.floor]
axis = "z"
at = 0
side = "above"
slip = "no-slip"
[end]
time = 1
"#;

fn made_up(folder: &Path, study: &str) -> Result<Study, crate::failure::Failure> {
    std::fs::write(folder.join("study.toml"), study).unwrap();
    std::fs::write(folder.join("t.toml"), TEMPLATE).unwrap();
    Study::read("made-up", folder)
}

fn line(study: &Study, name: &str, runout: f64) -> Line {
    let run = study.runs.iter().find(|run| run.name == name).unwrap();
    Line {
        particles: Some(100),
        measures: BTreeMap::from([("runout".to_owned(), runout)]),
        seconds: Some(4.0),
        ranks: 1,
        commit: "abc".into(),
        date: "2026-01-31".into(),
        scene: results::hash(run),
        exit: 0,
    }
}

#[test]
fn lists_are_combined_with_variants() {
    let work = tempfile::tempdir().unwrap();
    let study = made_up(work.path(), STUDY).unwrap();
    let names: Vec<&str> = study.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, ["b-aspect-10", "b-aspect-2", "a-aspect-2-soft", "a-aspect-2-hard"]);
    assert_eq!(study.parameters, ["aspect", "variant"]);
    assert_eq!(study.runs[2].parameters[1], ("variant".into(), Value::Text("soft".into())));
    let scene = |k: usize| Scene::read("s", &study.runs[k].scene).unwrap();
    assert_eq!((scene(2).numerics.courant, scene(1).title.as_str()), (0.3, "a = 2"));
    assert!(study.runs[2].scene.contains("young = 1000000.0") && study.runs[3].scene.contains("young = 5980000.0"));
    for (from, to, fault) in [
        ("r0 = 0.1", "", "`r0` is not known"),
        ("runout/twice\"]", "runout/thrice\"]", "`thrice` is not known"),
        ("aspect = [10, 2]", "aspect = [2, 2]", "twice"),
        ("beside = \"b\"", "beside = \"c\"", "no series `c`"),
        ("aspect = [10, 2]", "aspect = [-1]", "out of range"),
        ("mean = [\"series\"]", "spread = true", "spread goes with mean"),
        ("title", "titel", "titel"),
    ] {
        let failure = made_up(work.path(), &STUDY.replacen(from, to, 1)).unwrap_err();
        assert!(failure.message.contains(fault), "{failure}");
    }
}

#[test]
fn results_come_back_as_they_were_and_sorted() {
    let work = tempfile::tempdir().unwrap();
    let study = made_up(work.path(), STUDY).unwrap();
    assert_eq!(Results::read(&study).unwrap(), Results::default());
    let mut results = Results::default();
    for (name, runout) in [("a-aspect-2-soft", 1.25), ("b-aspect-10", 1.234_567_8e-5), ("b-aspect-2", 3.0)] {
        results.0.insert(name.into(), line(&study, name, runout));
    }
    let failed =
        Line { exit: 70, seconds: None, particles: None, measures: BTreeMap::new(), ..line(&study, "b-aspect-2", 0.0) };
    results.0.insert("b-aspect-2".into(), failed);
    results.0.insert("gone".into(), line(&study, "b-aspect-2", 1.0));
    results.write(&study).unwrap();
    let text = std::fs::read_to_string(results::path(&study)).unwrap();
    let hash = |k: usize| results::hash(&study.runs[k]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "run,series,aspect,variant,particles,runout,height,wall_s,ranks,commit,date,scene,exit");
    assert_eq!(lines[1], format!("b-aspect-2,b,2,,,,,,1,abc,2026-01-31,{},70", hash(1)));
    // 10 after 2: by size, not by letters.
    assert_eq!(lines[2], format!("b-aspect-10,b,10,,100,1.23457e-5,,4,1,abc,2026-01-31,{},0", hash(0)));
    assert_eq!(lines[3], format!("a-aspect-2-soft,a,2,soft,100,1.25,,4,1,abc,2026-01-31,{},0", hash(2)));
    assert_eq!(lines.len(), 4);
    let back = Results::read(&study).unwrap();
    back.write(&study).unwrap();
    assert_eq!(std::fs::read_to_string(results::path(&study)).unwrap(), text);
    assert_eq!(back.0["a-aspect-2-soft"], results.0["a-aspect-2-soft"]);
    // A measure more changes no line that is there.
    let wider = made_up(work.path(), &STUDY.replace("\"runout\",", "\"runout\", \"new\",")).unwrap();
    assert_eq!(Results::read(&wider).unwrap(), back);
    std::fs::write(results::path(&study), text.replace(",1.25,", ",much,")).unwrap();
    assert!(Results::read(&study).unwrap_err().message.contains("line 4: runout"));
}

#[test]
fn what_is_there_is_not_run_again() {
    let work = tempfile::tempdir().unwrap();
    let study = made_up(work.path(), STUDY).unwrap();
    let run = &study.runs[1];
    let known = line(&study, &run.name, 1.0);
    let is_to_do = |line: &Line, commit: &str, reuse: bool| batch::is_to_do(run, Some(line), commit, reuse);
    assert!(batch::is_to_do(run, None, "abc", true));
    assert!(!is_to_do(&known, "abc", false) && is_to_do(&known, "def", false) && !is_to_do(&known, "def", true));
    assert!(is_to_do(&Line { scene: "0".into(), ..known.clone() }, "abc", true));
    // The same programs fail the same way; what was killed may do better.
    let ended = |exit: i32| Line { exit, ..known.clone() };
    assert!(
        !is_to_do(&ended(70), "abc", false) && is_to_do(&ended(70), "def", true) && is_to_do(&ended(137), "abc", true)
    );
}

#[test]
fn measures_are_taken_by_key_and_may_be_missing() {
    let work = tempfile::tempdir().unwrap();
    let study = made_up(work.path(), STUDY).unwrap();
    let of = |text: &str| batch::measures(&study, &serde_json::from_str(text).unwrap());
    let all = of(r#"{ "runout": 1.5, "final": 0.08, "r0": 0.1, "title": "x" }"#);
    assert_eq!((all["runout"], all["height"]), (1.5, 0.08 / 0.1));
    assert!(of(r#"{ "runout": null, "final": 0.08 }"#).is_empty());
}

#[test]
fn tables_say_what_is_not_there() {
    let work = tempfile::tempdir().unwrap();
    let study = made_up(work.path(), STUDY).unwrap();
    let mut results = Results::default();
    results.0.insert("b-aspect-2".into(), line(&study, "b-aspect-2", 5.0));
    results.0.insert("a-aspect-2-hard".into(), line(&study, "a-aspect-2-hard", 4.0));
    let failed = Line { exit: 70, measures: BTreeMap::new(), ..line(&study, "a-aspect-2-soft", 0.0) };
    results.0.insert("a-aspect-2-soft".into(), failed);
    let before = results.clone();
    let shown = |k: usize| table::table(&study, &before, &study.tables[k]);
    let has = |text: &str, line: &str| assert!(text.lines().any(|l| l == line), "no {line}\n{text}");
    let text = shown(0);
    has(&text, "| series | a | run-out | over 2a |");
    // Where the reference has ended, there is nothing to run for.
    has(&text, "| b | 10 | not run | – |");
    has(&text, "| b | 2 | 5.00 | 1.25 |");
    has(&text, "| a | 2 | failed (70) | failed (70) |");
    has(&text, "2 of 4 runs, computed by abc, 2026-01-31.");
    has(&shown(1), "| b | 1 of 2 | 25.0 |");
    results.0.get_mut("b-aspect-2").unwrap().exit = 70;
    has(&table::table(&study, &results, &study.tables[1]), "| b | 0 of 2 | failed |");
    results.0.get_mut("b-aspect-2").unwrap().exit = 0;
    let text = table::table(&study, &results, &study.tables[2]);
    has(&text, "| hard | 0.800 |");
    has(&text, "| soft | failed (70) |");
    results.0.get_mut("b-aspect-2").unwrap().scene = "00000000".into();
    let text = table::table(&study, &results, &study.tables[0]);
    has(&text, "| b † | 2 | 5.00 | 1.25 |");
    assert!(text.contains("†: the scene has changed since"));
}
