//! A changed scene on resume: what may not change is refused, all at once and with nothing touched; what may is applied, noted
//! in the events, and leaves what the scene would have left had it been so from the start.

use formats::{exit, folder::RunFolder, scene::Scene, snapshot};
use std::path::PathBuf;
use tests::trial::{Trial, launch, short, state};
use tests::{Output, WorkFolder, computed, prepared, run};

/// A scene of the short ones with other ends and intervals: parts of a second that are powers of two, so that all multiples are
/// exact and steps are shortened at the same times, however the run gets there.
fn scene(end: f64, snapshots: f64, history: f64) -> String {
    let (head, _) = short::PLANE.split_once("[end]").expect("it has an end");
    format!("{head}[end]\ntime = {end}\n[output]\nsnapshots = {snapshots}\nhistory = {history}\n")
}

const SNAPSHOTS: f64 = 1.0 / 32.0;
const HISTORY: f64 = 1.0 / 128.0;
const SOONER: f64 = 3.0 / 32.0;
const LATER: f64 = 5.0 / 32.0;

/// Goes on with a changed scene.
fn with_scene(work: &WorkFolder, folder: &RunFolder, text: &str, ranks: usize, extra: &[&str]) -> Output {
    let file = work.write("changed.toml", text);
    let file = file.to_str().expect("a plain name");
    launch(folder, ranks, &[&["--scene", file], extra].concat())
}

fn events(folder: &RunFolder) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(folder.log().join("events.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Times of the history's lines and of the snapshots, s.
fn times(folder: &RunFolder) -> (Vec<f64>, Vec<f64>) {
    let history = std::fs::read_to_string(folder.history()).unwrap();
    let lines = history.lines().filter_map(|line| line.split(',').next()?.parse().ok()).collect();
    let entries = std::fs::read_dir(folder.out()).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == "hdf")).collect();
    files.sort();
    (lines, files.iter().map(|path| snapshot::read_header(path).unwrap().time).collect())
}

#[test]
fn an_end_put_off_leaves_the_same_bits() {
    let (sooner, later) = (scene(SOONER, SNAPSHOTS, HISTORY), scene(LATER, SNAPSHOTS, HISTORY));
    let trial = Trial::new(&later);
    assert_eq!(Scene::hash(&sooner), Scene::hash(&later));

    let done = computed(&trial.work, "done", &sooner, 1);
    assert_eq!(times(&done).1.last(), Some(&SOONER), "the run was over");
    with_scene(&trial.work, &done, &later, 2, &[]).expect(exit::DONE);
    trial.same(&done);
    assert_eq!(std::fs::read_to_string(done.scene()).unwrap(), later);
    let changed: Vec<_> = events(&done).into_iter().filter(|event| event["event"] == "scene-changed").collect();
    assert!(changed.len() == 1 && changed[0].to_string().contains("end.time"), "{changed:?}");
    run("sph-post", &[done.path()], 0).expect(exit::DONE);

    // Once more, with the scene and without: nothing happens.
    let before = state(done.path());
    with_scene(&trial.work, &done, &later, 1, &[]).expect(exit::DONE);
    launch(&done, 1, &[]).expect(exit::DONE);
    assert_eq!(before, state(done.path()));

    let begun = prepared(&trial.work, "begun", &sooner, 1);
    launch(&begun, 1, &["--stop-after-steps", "60"]).expect(exit::RESUMABLE);
    let resumed = with_scene(&trial.work, &begun, &later, 1, &[]).expect(exit::DONE);
    assert!(resumed.stderr.contains("resuming"), "{resumed}");
    trial.same(&begun);

    let prepared = prepared(&trial.work, "prepared", &sooner, 1);
    with_scene(&trial.work, &prepared, &later, 1, &[]).expect(exit::DONE);
    trial.same(&prepared);
}

#[test]
fn outputs_go_on_at_multiples_of_the_new_intervals() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", &scene(LATER, SNAPSHOTS, HISTORY), 1);
    launch(&folder, 1, &["--stop-after-steps", "80"]).expect(exit::RESUMABLE);
    let text = std::fs::read_to_string(folder.path().join("CONTINUE")).unwrap();
    let at = serde_json::from_str::<serde_json::Value>(&text).unwrap()["time"].as_f64().unwrap();
    assert!((2.0 * SNAPSHOTS..LATER - SNAPSHOTS).contains(&at), "half way: {at}");

    // Longer lines, and snapshots that are no multiple of the old ones; a title on top.
    let (snapshots, history) = (3.0 / 256.0, 1.0 / 64.0);
    let changed = format!("title = \"Changed\"\n{}", scene(LATER, snapshots, history));
    // Stopped again soon after: from then on the run goes on with what it was given, without being told again.
    with_scene(&work, &folder, &changed, 2, &["--stop-after-steps", "3"]).expect(exit::RESUMABLE);
    launch(&folder, 1, &[]).expect(exit::DONE);

    let expected = |old: f64, new: f64| {
        let multiples = |interval: f64| (0..).map(move |k| f64::from(k) * interval);
        let mut times: Vec<f64> = multiples(old).take_while(|t| *t <= at).collect();
        times.extend(multiples(new).skip_while(|t| *t <= at).take_while(|t| *t < LATER));
        times.push(LATER);
        times
    };
    let (lines, files) = times(&folder);
    assert_eq!(lines, expected(HISTORY, history));
    assert_eq!(files, expected(SNAPSHOTS, snapshots));
    let last = snapshot::read_header(&folder.snapshot(files.len() as u64 - 1)).unwrap();
    assert_eq!(last.title, "Changed");
    run("sph-post", &[folder.path()], 0).expect(exit::DONE);
}

#[test]
fn what_may_not_change_is_refused_and_nothing_touched() {
    let work = WorkFolder::new();
    let text = scene(SOONER, SNAPSHOTS, HISTORY);
    let folder = prepared(&work, "run", &text, 1);
    launch(&folder, 1, &["--stop-after-steps", "30"]).expect(exit::RESUMABLE);
    let refused = |folder: &RunFolder, text: &str, ranks: usize, words: &[&str]| {
        let before = state(folder.path());
        let output = with_scene(&work, folder, text, ranks, &[]).expect(exit::USAGE);
        for word in words {
            assert_eq!(output.stderr.matches(word).count(), 1, "{word}: {output}");
        }
        assert_eq!(before, state(folder.path()));
    };
    let later = scene(LATER, SNAPSHOTS, HISTORY);
    let other = later.replace("25 deg", "26 deg").replace("spacing = \"20 mm\"", "spacing = \"10 mm\"");
    let both = ["changed.toml:3:11: spacing: ", "changed.toml:9:12: material.drucker-prager.friction: "];
    refused(&folder, &other, 2, &both);
    refused(&folder, &later.replace("25 deg", "95 deg"), 1, &["material.drucker-prager.friction: "]);
    refused(&folder, &scene(1.0 / 256.0, 1.0 / 512.0, 1.0 / 512.0), 1, &["end.time: "]);
    // The run goes on as if nobody had asked; and what is over refuses the same.
    launch(&folder, 1, &[]).expect(exit::DONE);
    refused(&folder, &other, 1, &both);
    refused(&folder, &scene(SOONER / 2.0, SNAPSHOTS, HISTORY), 1, &["end.time: "]);
}
