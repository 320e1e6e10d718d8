//! What a run puts out reads as if it had never been interrupted.
//!
//! - Killed between checkpoints: times rise, nothing twice, no gap, the same bytes as without; what lies past the
//!   checkpoint is dropped, and `sph-post` reads what is committed only.
//! - A stop file is honoured once, and one from before the launch does not stop it.
//! - The views and the hint `LATEST` are not relied on; a piece that is relied on is refused where it is damaged.

use formats::outputs::Index;
use formats::{checkpoint, exit, folder::RunFolder};
use std::fs;
use std::io::Write;
use tests::shim::{self, Fault};
use tests::trial::{Trial, launch, short, state};
use tests::{TIME_LIMIT, WorkFolder, command, prepared, run, run_within};

/// Times of the history, as a user reads them.
fn times(folder: &RunFolder) -> Vec<f64> {
    let text = fs::read_to_string(folder.history()).unwrap();
    text.lines().skip(1).map(|line| line.split(',').next().unwrap().parse().unwrap()).collect()
}

/// A folder in which a launch was killed when the index had just got its `renames`-th entry of that launch, far past
/// the only checkpoint.
fn killed_past_its_checkpoint(trial: &Trial, name: &str, renames: u64) -> RunFolder {
    let folder = trial.fresh(name);
    trial.go(&folder, 2, &["--stop-after-steps", "41"], exit::RESUMABLE);
    let log = trial.work.join(format!("{name}.log"));
    let mut killed = command("sph-run", &[folder.path()], 1);
    let fault = Fault::new("kill", renames + 1).of("rename", "out/index.json");
    fault.put(&mut killed, &shim::library(), folder.path(), &log).unwrap();
    assert_ne!(run_within(TIME_LIMIT, &mut killed).code, exit::DONE);
    assert_eq!(shim::struck(&log).len(), 1, "it was not killed");
    folder
}

#[test]
fn killed_between_checkpoints() {
    let trial = Trial::new(short::RINGS);
    let folder = killed_past_its_checkpoint(&trial, "killed", 3);
    let listed = Index::read(&folder).unwrap().unwrap().segments.len();
    let manifest = checkpoint::newest_manifest(&folder).unwrap().unwrap();
    assert!(manifest.outputs.segments.len() < listed, "nothing lies past the checkpoint");
    let lines = times(&folder).len();
    assert!(lines > manifest.clock["lines"].as_u64().unwrap() as usize);

    // Torn, as a full disk or a lost machine leaves it; and a snapshot that nobody lists.
    fs::File::options().append(true).open(folder.history()).unwrap().write_all(b"1.5e-1,7").unwrap();
    fs::copy(folder.initial(), folder.snapshot(99)).unwrap();
    fs::write(folder.out().join("snapshot-000004.hdf.tmp"), "half").unwrap();
    run("sph-post", &[folder.path()], 0).expect(exit::DONE);

    trial.go(&folder, 3, &[], exit::DONE);
    trial.same(&folder);
    let times = times(&folder);
    assert!(times.is_sorted_by(|a, b| a < b), "{times:?}");
}

#[test]
fn views_and_hints_are_not_relied_on() {
    let trial = Trial::new(short::PLANE);
    let folder = killed_past_its_checkpoint(&trial, "views", 2);
    for view in [folder.history(), folder.series(), folder.index()] {
        fs::remove_file(view).unwrap();
    }
    fs::write(folder.checkpoints().join("LATEST"), "gen-000077\n").unwrap();
    fs::remove_dir_all(folder.log()).unwrap();
    trial.go(&folder, 2, &[], exit::DONE);
    trial.same(&folder);
}

#[test]
fn a_damaged_piece_of_history_is_refused_and_a_snapshot_may_be_moved() {
    let trial = Trial::new(short::RINGS);
    let folder = trial.fresh("damaged");
    trial.go(&folder, 1, &["--stop-after-steps", "150"], exit::RESUMABLE);
    let piece = folder.history_piece(1);
    let sound = fs::read(&piece).unwrap();
    let mut flipped = sound.clone();
    flipped[400] ^= 1;
    fs::write(&piece, &flipped).unwrap();
    let before = state(&folder.out());
    let refused = launch(&folder, 2, &[]).expect(exit::NO_INPUT);
    assert!(refused.stderr.contains("history/000001.csv: damaged"), "{refused}");
    assert_eq!(state(&folder.out()), before);
    let checked = run("sph-run", &[folder.path().as_os_str(), "--check".as_ref()], 0).expect(exit::NO_INPUT);
    assert!(checked.stdout.contains("000001.csv: damaged"), "{checked}");

    fs::write(&piece, &sound).unwrap();
    run("sph-run", &[folder.path().as_os_str(), "--check".as_ref()], 0).expect(exit::DONE);
    let away = trial.work.join("away.hdf");
    fs::rename(folder.snapshot(0), &away).unwrap();
    trial.go(&folder, 1, &[], exit::DONE);
    assert!(!fs::read_to_string(folder.series()).unwrap().contains("snapshot-000000"), "it is not there");
    run("sph-post", &[folder.path()], 0).expect(exit::DONE);
    fs::rename(&away, folder.snapshot(0)).unwrap();
    fs::copy(trial.reference.series(), folder.series()).unwrap();
    trial.same(&folder);
}

/// A segment ends after a thousand lines also where no snapshot does, wherever the run was stopped.
#[test]
fn long_histories_come_in_pieces() {
    let scene = short::RINGS.replace("history = \"7 ms\"", "history = \"0.1 ms\"").replace("\"40 ms\"", "\"140 ms\"");
    let trial = Trial::new(&scene);
    let index = Index::read(&trial.reference).unwrap().unwrap();
    let pieces: Vec<_> = index.segments.iter().map(|s| (s.history.lines, s.snapshot.is_some())).collect();
    assert_eq!(pieces, [(1, true), (1000, false), (400, true), (100, true)]);
    let folder = trial.fresh("pieces");
    for steps in ["997", "5", "2"] {
        trial.go(&folder, 1, &["--stop-after-steps", steps], exit::RESUMABLE);
    }
    trial.go(&folder, 2, &[], exit::DONE);
    trial.same(&folder);
}

#[test]
fn a_stop_file_from_before_the_launch_does_not_stop_it() {
    let trial = Trial::new(short::RINGS);
    let folder = trial.fresh("stale");
    fs::write(folder.stop(), "").unwrap();
    let done = trial.go(&folder, 2, &[], exit::DONE);
    assert!(done.stderr.contains("STOP"), "{done}");
    assert!(!folder.stop().exists());
    trial.same(&folder);
}

/// Back to an archived checkpoint, also of a run that is done: what came after it is dropped and computed again.
#[test]
fn going_back_to_an_earlier_checkpoint() {
    let trial = Trial::new(short::RINGS);
    let folder = trial.fresh("back");
    let options = ["--checkpoint-every", "40steps", "--checkpoint-keep", "1", "--checkpoint-archive", "2"];
    trial.go(&folder, 2, &options, exit::DONE);
    let generations = checkpoint::generations(&folder).unwrap();
    assert!(generations.starts_with(&[2, 4]), "{generations:?}");
    let before = state(folder.path());
    let refused = launch(&folder, 1, &["--resume", "41"]).expect(exit::NO_INPUT);
    assert!(refused.stderr.contains("no checkpoint of step 41; there are those of 80, 160"), "{refused}");
    assert_eq!(state(folder.path()), before);

    trial.go(&folder, 1, &["--resume", "80", "--stop-after-steps", "1"], exit::RESUMABLE);
    assert!(!folder.done().exists());
    assert_eq!(checkpoint::generations(&folder).unwrap(), [2, 3]);
    assert!(folder.checkpoints().join("aside-000004-1").join("MANIFEST.json").exists());
    let index = Index::read(&folder).unwrap().unwrap();
    assert!(index.segments.iter().all(|segment| segment.step <= 81) && !folder.snapshot(3).exists());
    trial.go(&folder, 3, &[], exit::DONE);
    trial.same(&folder);
}

#[test]
fn every_launch_that_computes_leaves_a_line_of_its_phases() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", short::PLANE, 1);
    launch(&folder, 1, &["--stop-after-steps", "8"]).expect(exit::RESUMABLE);
    launch(&folder, 2, &["--stop-after-steps", "0"]).expect(exit::RESUMABLE);
    launch(&folder, 2, &["--stop-after-steps", "12"]).expect(exit::RESUMABLE);
    let text = fs::read_to_string(folder.log().join("phases.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 3, "{text}");
    let column = |name: &str| rows[0].iter().position(|cell| *cell == name).unwrap_or_else(|| panic!("{name}: {text}"));
    let number = |row: usize, name: &str| -> f64 { rows[row][column(name)].parse().unwrap() };
    for (row, ranks, step, steps) in [(1, 1.0, 8.0, 8.0), (2, 2.0, 20.0, 12.0)] {
        let facts = ["ranks [1]", "step [1]", "steps [1]"].map(|name| number(row, name));
        assert_eq!(facts, [ranks, step, steps], "{text}");
        let whole = column("loop [s]");
        let phases: f64 = rows[row][whole + 1..]
            .iter()
            .zip(&rows[0][whole + 1..])
            .map(
                |(cell, name)| {
                    if name.ends_with(" [s]") && *name != "computed [s]" { cell.parse::<f64>().unwrap() } else { 0.0 }
                },
            )
            .sum();
        assert!((phases - number(row, "loop [s]")).abs() < 1e-5 && phases > 0.0, "{text}");
        assert!(number(row, "computed [s]") > 0.0, "{text}");
        // Its last act, the checkpoint, is one of the phases.
        assert!(number(row, "output [s]") > 0.0 && number(row, "lists [s]") >= 0.0, "{text}");
        assert!(number(row, "memory_sum [B]") >= ranks * 1e6, "{text}");
    }
}
