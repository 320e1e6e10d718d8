//! Checkpoints: one sound generation always there, and anything torn, flipped or mixed passed over.

mod support;

use formats::checkpoint::{self, Found, Generation, Keep, Outputs};
use formats::folder::RunFolder;
use formats::provenance::{self, Entry};
use formats::snapshot::{self, FileError, Header};
use mpi::traits::Communicator as _;
use std::cell::Cell;
use std::fs;
use std::path::Path;
use support::{header, rows, run};

const COUNT: u64 = 100;

#[test]
fn on_ranks() {
    let Some((task, folder)) = support::task() else { return };
    let universe = mpi::initialize().unwrap();
    let comm = universe.world();
    let (rank, size) = (comm.rank() as u64, comm.size() as u64);
    let folder = RunFolder::new(folder);
    let outputs = Outputs { segments: Vec::new(), pending: "0,1\n".into() };
    // A number that a careless JSON reader gets wrong in its last bit.
    let clock = serde_json::json!({ "next_snapshot": 0.1f64 + 0.2, "sum": 5e-324, "long": 1.2345678901234567e-7 });
    let lost = Cell::new(false);
    let commit = |step: u64, keep: Keep| {
        let header = Header { step, ..header(COUNT) };
        let still_ours = || match lost.get() {
            true => Err(FileError::CannotWrite { path: "LOCK".into(), what: "lost".into() }),
            false => Ok(()),
        };
        let new = Generation {
            folder: &folder,
            header: &header,
            rows: &rows(COUNT, rank, size),
            clock: &clock,
            outputs: Some(&outputs),
            scene: "spacing = 1",
            job: Some("slurm 7"),
            keep,
            still_ours: &still_ours,
        };
        checkpoint::commit(&new, &comm)
    };
    let two = Keep { newest: 2, archive: None };
    match task.as_str() {
        "one" => {
            commit(7, two).unwrap();
        }
        "five" => {
            for step in 1..=5 {
                assert_eq!(commit(step, two).unwrap(), step);
            }
        }
        "archive" => {
            for step in 1..=7 {
                commit(step, Keep { newest: 1, archive: Some(3) }).unwrap();
            }
        }
        "latest" => {
            let found = checkpoint::latest(&folder).unwrap().unwrap();
            assert_eq!((found.manifest.clock, found.manifest.outputs), (clock, outputs));
            let (_, read) = snapshot::read_rows(&found.state, snapshot::share(COUNT, rank, size), &comm).unwrap();
            assert!(read.same_bits(&rows(COUNT, rank, size)));
        }
        "lost" => {
            lost.set(true);
            let error = commit(9, two).unwrap_err();
            assert!(error.to_string().contains("lost"), "{error}");
        }
        other => panic!("no task {other}"),
    }
}

/// A run folder after a task.
fn after(task: &str, ranks: usize) -> (tempfile::TempDir, RunFolder) {
    let place = tempfile::tempdir().unwrap();
    let folder = RunFolder::new(place.path());
    run(task, place.path(), ranks);
    (place, folder)
}

fn latest(folder: &RunFolder) -> Found {
    checkpoint::latest(folder).unwrap().unwrap()
}

fn flip(path: &Path, place: usize) {
    let mut bytes = fs::read(path).unwrap();
    let place = place % bytes.len();
    bytes[place] ^= 4;
    fs::write(path, bytes).unwrap();
}

#[test]
fn written_on_one_number_of_ranks_read_on_another() {
    let mut digests = Vec::new();
    for ranks in [0, 2, 3] {
        let (place, folder) = after("one", ranks);
        let found = latest(&folder);
        assert!(found.warnings.is_empty());
        assert_eq!((found.manifest.generation, found.manifest.step), (1, 7));
        assert_eq!(found.manifest.ranks, ranks.max(1) as u64);
        digests.push((found.manifest.digests, found.manifest.state_checksum));
        for other in [0, 2, 5] {
            run("latest", place.path(), other);
        }
    }
    digests.dedup();
    assert_eq!(digests.len(), 1);
}

#[test]
fn keeps_the_newest_and_clears_what_was_unfinished() {
    let (place, folder) = after("five", 2);
    assert_eq!(checkpoint::generations(&folder).unwrap(), [4, 5]);
    assert_eq!(latest(&folder).manifest.step, 5);
    assert_eq!(fs::read_to_string(folder.checkpoints().join("LATEST")).unwrap(), "gen-000005\n");

    // Left by a process that was killed in a commit: ignored, then removed.
    let stale = folder.checkpoints().join("gen-000006.tmp");
    fs::create_dir(&stale).unwrap();
    fs::write(stale.join("state.hdf"), "half").unwrap();
    assert_eq!(latest(&folder).manifest.generation, 5);
    run("one", place.path(), 1);
    assert_eq!(checkpoint::generations(&folder).unwrap(), [5, 6]);
    assert!(!stale.exists());
}

#[test]
fn every_third_is_archived() {
    let (_place, folder) = after("archive", 1);
    assert_eq!(checkpoint::generations(&folder).unwrap(), [3, 6, 7]);
    assert_eq!(latest(&folder).manifest.parent, Some(6));
}

#[test]
fn nothing_there_is_no_error() {
    let place = tempfile::tempdir().unwrap();
    assert_eq!(checkpoint::latest(&RunFolder::new(place.path())).unwrap(), None);
}

#[test]
fn damaged_generations_are_passed_over() {
    let (_place, folder) = after("five", 1);
    let newest = folder.generation(5);
    let files = ["state.hdf", "MANIFEST.json"];
    let sound: Vec<_> = files.iter().map(|name| fs::read(newest.join(name)).unwrap()).collect();
    let restore = || files.iter().zip(&sound).for_each(|(name, bytes)| fs::write(newest.join(name), bytes).unwrap());
    let passed_over = |what: &str| {
        let found = latest(&folder);
        assert_eq!((found.manifest.generation, found.warnings.len()), (4, 1), "{what}");
        assert!(found.warnings[0].to_string().contains("gen-000005"), "{:?}", found.warnings);
    };
    for name in files {
        let path = newest.join(name);
        let length = fs::read(&path).unwrap().len();
        for place in (0..length).step_by(length / 40).filter(|&p| !fs::read(&path).unwrap()[p].is_ascii_whitespace()) {
            flip(&path, place);
            passed_over(&format!("{name}, byte {place}"));
            restore();
        }
        for length in [0, 1, length / 2, length - 1] {
            fs::write(&path, &fs::read(&path).unwrap()[..length]).unwrap();
            passed_over(&format!("{name}, {length} bytes"));
            restore();
        }
        fs::remove_file(&path).unwrap();
        passed_over(&format!("{name} removed"));
        restore();
        fs::copy(folder.generation(4).join(name), &path).unwrap();
        passed_over(&format!("{name} of another generation"));
        restore();
    }
    assert!(latest(&folder).warnings.is_empty());

    for generation in [4, 5] {
        flip(&folder.generation(generation).join("state.hdf"), 3000);
    }
    let error = checkpoint::latest(&folder).unwrap_err();
    assert!(matches!(error, FileError::Damaged { .. }), "{error}");
    assert!(error.to_string().contains("gen-000004") && error.to_string().contains("gen-000005"), "{error}");
}

/// A checkpoint of an earlier version is sound: it is named for what it is, not passed over as damaged.
#[test]
fn checkpoints_of_an_older_version_are_told_apart() {
    let (_place, folder) = after("one", 1);
    let (state, manifest) = (folder.generation(1).join("state.hdf"), folder.generation(1).join("MANIFEST.json"));
    let file = hdf5::File::open_rw(&state).unwrap();
    file.group("sph").unwrap().attr("format_version").unwrap().write_scalar(&1u64).unwrap();
    file.close().unwrap();
    let mut sealed: serde_json::Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
    sealed["manifest"]["state_checksum"] = checkpoint::checksum(&state).unwrap().into();
    sealed["sha256"] = provenance::sha256(sealed["manifest"].to_string().as_bytes()).into();
    fs::write(&manifest, sealed.to_string()).unwrap();
    let error = checkpoint::latest(&folder).unwrap_err();
    assert!(matches!(error, FileError::Older { found: 1, known: 2, .. }), "{error}");
}

#[test]
fn a_failed_commit_leaves_the_older_ones() {
    let (place, folder) = after("five", 2);
    run("lost", place.path(), 2);
    assert_eq!(checkpoint::generations(&folder).unwrap(), [4, 5]);
    assert!(latest(&folder).warnings.is_empty());
    assert!(!folder.checkpoints().join("gen-000006.tmp").exists());
}

#[test]
fn provenance_grows_by_whole_entries() {
    let place = tempfile::tempdir().unwrap();
    let path = RunFolder::new(place.path()).provenance();
    for ranks in [1, 4] {
        provenance::append(&path, Entry::this("test", ranks)).unwrap();
    }
    let entries = provenance::read(&path).unwrap();
    assert_eq!(entries.iter().map(|entry| entry.ranks).collect::<Vec<_>>(), [1, 4]);
    assert!(entries[0].time.ends_with('Z') && entries[0].build.libraries["hdf5"].starts_with("1."));
    fs::write(&path, "[").unwrap();
    assert!(matches!(provenance::append(&path, Entry::this("test", 1)), Err(FileError::Damaged { .. })));
    assert_eq!(fs::read_to_string(&path).unwrap(), "[");
}
