//! - Always one valid generation: killed at any call of a commit and at random moments, on one rank or all, a run
//!   goes on without a person, loses at most one interval, and ends with the same bits.
//! - Any number of ranks goes on from any other, and checkpoints perturb nothing, however often they are written.
//! - What is cut off, changed or mixed up is found and named; the generation before is used, or none is left and the
//!   exit code says so.
//! - An older generation goes only after a newer one has been read back and published.

use formats::folder::RunFolder;
use formats::{checkpoint, exit};
use std::ffi::OsStr;
use std::fs;
use std::time::Duration;
use tests::command;
use tests::damage::{cut, flip, places};
use tests::shim::{Call, Fault};
use tests::trial::{Trial, calls, copy, launch, meanwhile, newest, processes, short, signal, strike};

/// Steps between checkpoints where a run is killed often.
pub(crate) const INTERVAL: u64 = 3;
pub(crate) const OFTEN: [&str; 2] = ["--checkpoint-every", "3steps"];

/// The last step that is in the live history, which is written as the run goes on.
fn last_line(folder: &RunFolder) -> u64 {
    let history = fs::read_to_string(folder.history()).unwrap_or_default();
    let whole = &history[..history.rfind('\n').map_or(0, |end| end + 1)];
    whole.lines().filter_map(|line| line.split(',').nth(1)?.parse().ok()).last().unwrap_or(0)
}

/// Fails unless all generations that were published are still good for a start, and no more than one interval of steps
/// is to be done again. Returns the newest generation.
#[track_caller]
pub(crate) fn nothing_lost(folder: &RunFolder, before: u64, struck: &str) -> u64 {
    let (generation, step) = newest(folder);
    assert!(generation >= before, "generation {before} is lost, {generation} is the newest; {struck}");
    let reached = last_line(folder);
    assert!(step + INTERVAL >= reached, "step {reached} was done, but the newest checkpoint is of {step}; {struck}");
    generation
}

#[test]
fn killed_at_any_kind_of_call() {
    let trial = Trial::in_memory(short::PLANE);
    let folder = trial.fresh("killed");
    let state = "ckpt/gen-??????.tmp/state.hdf.tmp";
    let manifest = "ckpt/gen-??????.tmp/MANIFEST.json.tmp";
    // The second of a launch where a commit has one of them; `torn` is after half of a write, and else after the call.
    let points = [
        ("torn", 1, "create", "LOCK.new*"),
        ("torn", 1, "link", "LOCK"),
        ("torn", 12, "write", "out/snapshot-000000.hdf.tmp"),
        ("kill", 1, "rename", "out/snapshot-000000.hdf"),
        ("torn", 1, "write", "out/history/000000.csv.tmp"),
        ("kill", 1, "rename", "out/index.json"),
        ("torn", 2, "folder", "ckpt/gen-??????.tmp"),
        ("kill", 3, "allocate", state),
        ("torn", 10, "write", state),
        ("torn", 60, "write", state),
        ("kill", 2, "sync", state),
        ("kill", 2, "rename", "ckpt/gen-??????.tmp/state.hdf"),
        ("torn", 2, "rename", "ckpt/gen-??????.tmp/state.hdf"),
        ("torn", 2, "write", manifest),
        ("kill", 2, "sync", manifest),
        ("kill", 2, "rename", "ckpt/gen-??????.tmp/MANIFEST.json"),
        ("torn", 2, "rename", "ckpt/gen-??????.tmp/MANIFEST.json"),
        ("kill", 2, "rename", "ckpt/gen-??????"),
        ("torn", 2, "rename", "ckpt/gen-??????"),
        ("kill", 2, "sync", "ckpt"),
        ("torn", 2, "write", "ckpt/LATEST.tmp"),
        ("kill", 2, "rename", "ckpt/gen-??????.*.tmp"),
        ("torn", 2, "rename", "ckpt/gen-??????.*.tmp"),
        ("torn", 1, "remove", "ckpt/gen-??????.*.tmp/*"),
        ("kill", 1, "rename", "DONE"),
        ("kill", 1, "remove", "LOCK"),
    ];
    let mut generation = 0;
    for (deed, at, kind, files) in points {
        assert!(!folder.done().exists(), "the run ended before {kind} of {files}");
        let (output, struck) = strike(&folder, 0, &OFTEN, &Fault::new(deed, at).of(kind, files));
        assert_eq!(output.code, 128 + 9, "{struck:?}: {output}");
        generation = nothing_lost(&folder, generation, &struck[0]);
    }
    trial.go(&folder, 3, &[], exit::DONE);
    trial.same(&folder);
}

#[test]
fn killed_on_one_of_several_ranks() {
    let trial = Trial::in_memory(short::SOLID);
    let folder = trial.fresh("killed");
    let state = "ckpt/gen-??????.tmp/state.hdf.tmp";
    let mut generation = 0;
    for (rank, deed, at, kind, files) in [
        (1, "torn", 20, "write", state),
        (2, "kill", 2, "sync", state),
        (0, "kill", 2, "rename", "ckpt/gen-??????"),
        (1, "kill", 30, "read", "ckpt/gen-??????.tmp/state.hdf"),
        (2, "torn", 3, "write", "out/snapshot-*"),
    ] {
        let (output, struck) = strike(&folder, 3, &OFTEN, &Fault::new(deed, at).of(kind, files).on(rank));
        assert!(![exit::DONE, exit::RESUMABLE].contains(&output.code), "{struck:?}: {output}");
        generation = nothing_lost(&folder, generation, &struck[0]);
    }
    trial.go(&folder, 2, &[], exit::DONE);
    trial.same(&folder);
}

/// By a signal from outside, one rank or all with mpirun.
#[test]
fn killed_at_random_moments() {
    let trial = Trial::in_memory(short::RINGS);
    let folder = trial.fresh("killed");
    let mut generation = 0;
    for (number, wait) in [0, 7, 13, 29].into_iter().enumerate() {
        let arguments = [folder.path().as_os_str(), OFTEN[0].as_ref(), OFTEN[1].as_ref()];
        let begun =
            || checkpoint::generations(&folder).unwrap_or_default().last().is_some_and(|&g| g >= generation + 2);
        let output = meanwhile(command("sph-run", &arguments, 3), begun, || {
            std::thread::sleep(Duration::from_millis(wait));
            let ranks = processes(folder.path(), "sph-run");
            if number % 2 == 0 {
                // mpirun first, or it would end the ranks in its own way.
                processes(folder.path(), "mpirun").iter().chain(&ranks).for_each(|&process| signal("KILL", process));
            } else {
                signal("KILL", ranks[number % ranks.len()]);
            }
        });
        assert!(!output.timed_out && ![exit::DONE, exit::RESUMABLE].contains(&output.code), "{output}");
        generation = nothing_lost(&folder, generation, "a kill from outside");
    }
    trial.go(&folder, 1, &[], exit::DONE);
    trial.same(&folder);
}

/// 1 to 8 ranks, 8 to 2, 2 to 1, 1 to 3, 3 to 5; with a checkpoint after every step, or hardly any, many kept or one.
#[test]
fn other_ranks_and_cadences() {
    let trial = Trial::in_memory(short::RINGS);
    let folder = trial.fresh("ranks");
    let mut reached = 0;
    for (ranks, steps, habits) in [
        (1, "31", &["--checkpoint-every", "1steps"][..]),
        (8, "17", &["--checkpoint-every", "7steps", "--checkpoint-keep", "5"]),
        (2, "1", &["--checkpoint-every", "1000steps"]),
        (1, "23", &["--checkpoint-every", "5steps", "--checkpoint-keep", "1"]),
        (3, "40", &["--checkpoint-every", "13steps", "--always-rebalance"]),
    ] {
        trial.go(&folder, ranks, &[&["--stop-after-steps", steps], habits].concat(), exit::RESUMABLE);
        reached += steps.parse::<u64>().unwrap();
        assert_eq!(newest(&folder).1, reached);
    }
    trial.go(&folder, 5, &["--checkpoint-every", "9steps"], exit::DONE);
    trial.same(&folder);
}

/// A run that was stopped with three generations.
fn with_three_generations(trial: &Trial) -> RunFolder {
    let folder = trial.fresh("three");
    let extra = ["--checkpoint-every", "20steps", "--checkpoint-keep", "3", "--stop-after-steps", "60"];
    trial.go(&folder, 1, &extra, exit::RESUMABLE);
    assert_eq!(newest(&folder), (3, 60));
    folder
}

#[test]
fn a_bit_in_any_dataset_or_attribute() {
    let trial = Trial::in_memory(short::SOLID);
    let folder = with_three_generations(&trial);
    let found = |file: &str, what: &str| {
        let error = checkpoint::verify(&folder, 3).expect_err(what);
        assert_eq!(error.exit_code(), exit::NO_INPUT);
        let said = error.to_string();
        assert!(said.contains(file) && said.contains("gen-000003"), "{what}: {said}");
        said
    };
    let state = folder.generation(3).join("state.hdf");
    let places = places(&state).unwrap();
    let count = |kind: &str| places.iter().filter(|place| place.what.starts_with(kind)).count();
    assert!(count("dataset") >= 14 && count("attribute") >= 30, "{places:?}");
    for (number, place) in places.iter().enumerate() {
        let byte = place.bytes.start + (place.bytes.end - place.bytes.start) * (number as u64 % 7) / 7;
        flip(&state, byte, number as u32).unwrap();
        let said = found("state.hdf", &place.what);
        if let Some(field) = place.what.strip_prefix("dataset /particles/") {
            assert!(said.contains(field), "a bit in {field}: {said}");
        }
        flip(&state, byte, number as u32).unwrap();
    }
    let manifest = folder.generation(3).join("MANIFEST.json");
    let said =
        |manifest: &std::path::Path| serde_json::from_slice::<serde_json::Value>(&fs::read(manifest).unwrap()).ok();
    let (original, mut the_same) = (said(&manifest), 0);
    for byte in (0..fs::metadata(&manifest).unwrap().len() - 1).step_by(5) {
        flip(&manifest, byte, byte as u32 / 5).unwrap();
        // The seventeenth digit of a number may leave it the same.
        if said(&manifest) == original {
            the_same += 1;
        } else {
            found("", &format!("byte {byte} of MANIFEST.json"));
        }
        flip(&manifest, byte, byte as u32 / 5).unwrap();
    }
    assert!(the_same <= 2, "{the_same} bits of the manifest do not count");
    checkpoint::verify(&folder, 3).unwrap();
    for file in [&state, &manifest] {
        let whole = fs::read(file).unwrap();
        for length in (0..whole.len()).step_by(4096).chain([whole.len() - 1]) {
            cut(file, length as u64).unwrap();
            found("", &format!("{} cut to {length}", file.display()));
        }
        fs::write(file, whole).unwrap();
    }
    checkpoint::verify(&folder, 3).unwrap();
}

/// The program itself: it names what is damaged, uses what is left, and doesn't hang; `--check` says the same.
#[test]
fn damaged_generations_are_passed_over() {
    let trial = Trial::in_memory(short::SOLID);
    let folder = with_three_generations(&trial);
    type Damage<'a> = (&'a str, usize, &'a dyn Fn(&RunFolder));
    let state = |folder: &RunFolder| folder.generation(3).join("state.hdf");
    let manifest = |folder: &RunFolder| folder.generation(3).join("MANIFEST.json");
    let cases: [Damage; 6] = [
        ("gen-000003/state.hdf", 0, &|folder| cut(&state(folder), 8192).unwrap()),
        ("gen-000003/state.hdf", 3, &|folder| cut(&state(folder), 0).unwrap()),
        ("gen-000003/state.hdf", 3, &|folder| flip(&state(folder), 9000, 1).unwrap()),
        ("gen-000003/MANIFEST.json", 0, &|folder| flip(&manifest(folder), 300, 2).unwrap()),
        ("gen-000003/MANIFEST.json", 0, &|folder| fs::remove_file(manifest(folder)).unwrap()),
        ("gen-000003/state.hdf", 0, &|folder| fs::remove_file(state(folder)).unwrap()),
    ];
    for (number, (named, ranks, damage)) in cases.into_iter().enumerate() {
        let damaged = copy(&folder, &format!("damaged-{number}"));
        damage(&damaged);
        let check = launch(&damaged, 0, &["--check"]).expect(exit::DONE);
        assert!(check.stdout.contains(named) && check.stdout.contains("gen-000002"), "{named}: {check}");
        let output = launch(&damaged, ranks, &["--stop-after-steps", "0"]).expect(exit::RESUMABLE);
        assert!(output.stderr.contains(named) && output.stderr.contains("step 40"), "{named}: {output}");
        if number == 2 {
            trial.go(&damaged, 2, &[], exit::DONE);
            trial.same(&damaged);
        }
    }
    for generation in 1..=3 {
        flip(&folder.generation(generation).join("state.hdf"), 5000 + generation, 3).unwrap();
    }
    for ranks in [0, 3] {
        let output = launch(&folder, ranks, &[]).expect(exit::NO_INPUT);
        let names_all = (1..=3).all(|generation| output.stderr.contains(&format!("gen-{generation:06}/state.hdf")));
        assert!(names_all, "{output}");
    }
    launch(&folder, 0, &["--check"]).expect(exit::NO_INPUT);
}

/// Parts of several generations, or of another run, in one folder.
#[test]
fn mixed_generations_are_refused() {
    let trial = Trial::in_memory(short::PLANE);
    let folder = with_three_generations(&trial);
    let other = Trial::in_memory(&short::PLANE.replace("1 m/s", "0.9 m/s"));
    let foreign = with_three_generations(&other);
    let place = |folder: &RunFolder, generation, name: &str| folder.generation(generation).join(name);
    type Mix<'a> = (&'a str, &'a dyn Fn(&RunFolder));
    let mixes: [Mix; 4] = [
        ("gen-000003/state.hdf", &|mixed| {
            fs::copy(place(mixed, 2, "state.hdf"), place(mixed, 3, "state.hdf")).unwrap();
        }),
        ("gen-000003", &|mixed| {
            fs::copy(place(mixed, 2, "MANIFEST.json"), place(mixed, 3, "MANIFEST.json")).unwrap();
        }),
        ("gen-000009", &|mixed| {
            fs::remove_dir_all(mixed.generation(3)).unwrap();
            let status =
                std::process::Command::new("cp").arg("-r").args([mixed.generation(2), mixed.generation(9)]).status();
            assert!(status.unwrap().success());
        }),
        ("gen-000003/state.hdf", &|mixed| {
            fs::copy(place(&foreign, 3, "state.hdf"), place(mixed, 3, "state.hdf")).unwrap();
        }),
    ];
    for (number, (named, mix)) in mixes.into_iter().enumerate() {
        let mixed = copy(&folder, &format!("mixed-{number}"));
        mix(&mixed);
        let output = launch(&mixed, 0, &["--stop-after-steps", "0"]).expect(exit::RESUMABLE);
        assert!(output.stderr.contains(named) && output.stderr.contains("step 40"), "{named}: {output}");
    }
    // All of another run's: whole generations, but of another scene.
    let mixed = copy(&folder, "mixed-all");
    fs::remove_dir_all(mixed.checkpoints()).unwrap();
    fs::rename(foreign.checkpoints(), mixed.checkpoints()).unwrap();
    let output = launch(&mixed, 0, &[]);
    assert!([exit::NO_INPUT, exit::USAGE].contains(&output.code), "{output}");
    assert!(output.stderr.contains("scene"), "{output}");
}

/// In the order of the calls: written, put on the disk, read back by every rank, sealed, published, and only then the
/// oldest goes.
#[test]
fn an_older_generation_goes_last() {
    let trial = Trial::in_memory(short::PLANE);
    for (ranks, keep) in [(1, 1), (3, 2)] {
        let folder = trial.fresh(&format!("keep-{keep}"));
        let kept = keep.to_string();
        let extra = ["--checkpoint-every", "20steps", "--checkpoint-keep", &kept, "--stop-after-steps", "100"];
        let kinds = "read,create,write,truncate,sync,rename,remove";
        let calls = calls(&folder, ranks, &extra, kinds, exit::RESUMABLE);
        let first =
            |what: &str, so: &dyn Fn(&Call) -> bool| calls.iter().position(so).unwrap_or_else(|| panic!("no {what}"));
        let last =
            |what: &str, so: &dyn Fn(&Call) -> bool| calls.iter().rposition(so).unwrap_or_else(|| panic!("no {what}"));
        let mut pruned = 0;
        for generation in keep + 1..=5 {
            let name = format!("ckpt/gen-{generation:06}");
            let within =
                |call: &Call, kind: &str, file: &str| call.kind == kind && call.path == format!("{name}.tmp/{file}");
            let written = last("write", &|call| within(call, "write", "state.hdf.tmp"));
            let synced = last("sync", &|call| within(call, "sync", "state.hdf.tmp"));
            for rank in 0..ranks {
                let read = last("reading back", &|call| call.rank == rank && within(call, "read", "state.hdf"));
                let sealed = first("manifest", &|call| within(call, "rename", "MANIFEST.json"));
                assert!(written < synced && synced < read && read < sealed, "{written} {synced} {read} {sealed}");
            }
            let manifest = last("sync of the manifest", &|call| within(call, "sync", "MANIFEST.json.tmp"));
            let sealed = last("manifest", &|call| within(call, "rename", "MANIFEST.json"));
            let published = first("publication", &|call| call.kind == "rename" && call.path == name);
            let durable = calls[published..].iter().position(|call| call.kind == "sync" && call.path == "ckpt");
            let durable = published + durable.expect("sync of ckpt/");
            // Of the one that goes, the first thing is that it loses its name.
            let oldest = format!("ckpt/gen-{:06}", generation - keep);
            let gone = first("removal", &|call| {
                call.path
                    .strip_prefix(&oldest)
                    .is_some_and(|rest| rest.starts_with(['.', '/']) && !rest.starts_with(".tmp"))
                    && ["rename", "remove", "write", "truncate"].contains(&&*call.kind)
            });
            assert!(manifest < sealed && sealed < published && published < durable && durable < gone);
            pruned += 1;
        }
        assert!(pruned >= 3 && newest(&folder) == (5, 100));
        assert_eq!(checkpoint::generations(&folder).unwrap().len() as u64, keep);
        let names: Vec<_> = fs::read_dir(folder.checkpoints()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert!(names.iter().all(|name| !OsStr::to_string_lossy(name).contains("tmp")), "{names:?}");
    }
}
