//! Particle files: the same bytes on any number of ranks, and every kind of broken file named for what it is.

mod support;

use formats::schema::Kept;
use formats::snapshot::{self, Digests, FileError};
use mpi::traits::{Communicator as _, CommunicatorCollectives as _};
use std::fs;
use std::path::{Path, PathBuf};
use support::{header, rows, run};

/// Runs on each rank when started by `support::run`, and does nothing in an ordinary test run.
#[test]
fn on_ranks() {
    let Some((task, folder)) = support::task() else { return };
    let universe = mpi::initialize().unwrap();
    let comm = universe.world();
    let (rank, size) = (comm.rank() as u64, comm.size() as u64);
    let mine = |count| rows(count, rank, size);
    let file = |name: &str| folder.join(name);
    match task.as_str() {
        "write" => {
            for count in [3, 1000] {
                snapshot::write(&file(&format!("s{count}.hdf")), &header(count), &mine(count), Kept::Everywhere, &comm)
                    .unwrap();
                snapshot::write(&file(&format!("c{count}.hdf")), &header(count), &mine(count), Kept::Checkpoint, &comm)
                    .unwrap();
            }
        }
        "read" => {
            for count in [3, 1000] {
                let path = file(&format!("c{count}.hdf"));
                let range = snapshot::share(count, rank, size);
                let (found, read) = snapshot::read_rows(&path, range, &comm).unwrap();
                assert_eq!(found, header(count));
                assert!(read.same_bits(&mine(count)));
                // Ranges that overlap, and a rank with none.
                let range = if rank == 0 { 0..0 } else { 0..count };
                let (_, read) = snapshot::read_rows(&path, range.clone(), &comm).unwrap();
                assert_eq!(read.len() as u64, range.end);
            }
        }
        "full" => {
            // A small file fits under the limit, a large one does not; the old one stays.
            let path = file("full.hdf");
            let write = |count| snapshot::write(&path, &header(count), &mine(count), Kept::Checkpoint, &comm);
            write(3).unwrap();
            // After MPI has made its own, larger files.
            limit_files(250 << 10);
            let error = write(2000).unwrap_err();
            assert!(matches!(error, FileError::DiskFull { .. }), "{error}");
            assert_eq!(error.exit_code(), 73);
            assert_eq!(snapshot::read_header(&path).unwrap().count, 3);
            comm.barrier();
            assert!(!file("full.hdf.tmp").exists());
        }
        "fail" => fail_together(&folder, rank, size, &comm),
        other => panic!("no task {other}"),
    }
}

/// No file may grow beyond so many bytes from here on.
fn limit_files(bytes: u64) {
    let limit = libc::rlimit { rlim_cur: bytes, rlim_max: libc::RLIM_INFINITY };
    // SAFETY: two system calls; the limit lives as long as the call.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
        assert_eq!(libc::setrlimit(libc::RLIMIT_FSIZE, &limit), 0);
    }
}

/// One rank is wrong: all must return the same error, and none may hang.
fn fail_together(folder: &Path, rank: u64, size: u64, comm: &formats::h5::Communicator) {
    let last = rank == size - 1;
    let path = folder.join("kept.hdf");
    let write = |header: &_, rows: &_, path: &Path| snapshot::write(path, header, rows, Kept::Everywhere, comm);
    let (good_header, good) = (header(9), rows(9, rank, size));
    write(&good_header, &good, &path).unwrap();
    let before = fs::read(&path).unwrap();
    let refused = |outcome: Result<Digests, FileError>, word: &str| {
        let text = outcome.unwrap_err().to_string();
        assert!(text.contains(word), "{text}");
    };

    let mut bad = good.clone();
    if last {
        bad.stress[0][3] = f64::NAN;
    }
    refused(write(&good_header, &bad, &path), "stress of particle");
    let mut bad = good.clone();
    if last {
        bad.mass.pop();
    }
    refused(write(&good_header, &bad, &path), "mass has");
    let mut bad = good.clone();
    if last {
        bad.id[0] = 77;
    }
    refused(write(&good_header, &bad, &path), "holds particle 77");
    refused(write(&header(10), &good, &path), "10 particles");
    let mut other = good_header.clone();
    if last {
        other.step += 1;
    }
    if size > 1 {
        refused(write(&other, &good, &path), "disagree");
    }
    refused(write(&good_header, &good, &folder.join("none/x.hdf")), "none/x.hdf");
    assert_eq!(fs::read(&path).unwrap(), before);
    assert!(!folder.join("kept.hdf.tmp").exists());

    let read = |path: &Path, range| snapshot::read_rows(path, range, comm).unwrap_err();
    assert!(matches!(read(&folder.join("absent.hdf"), 0..1), FileError::NotFound { .. }));
    let range = if last { 0..10 } else { 0..1 };
    assert!(matches!(read(&path, range), FileError::Damaged { .. }));
    let cut = folder.join(format!("cut{size}.hdf"));
    if rank == 0 {
        fs::write(&cut, &before[..before.len() - 1]).unwrap();
    }
    assert!(matches!(read(&cut, 0..1), FileError::Damaged { .. }));
}

/// A folder with the files that one process wrote without mpirun.
fn written() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    run("write", folder.path(), 0);
    folder
}

#[test]
fn bytes_do_not_depend_on_the_number_of_ranks() {
    let names = ["s3.hdf", "c3.hdf", "s1000.hdf", "c1000.hdf"];
    let alone = written();
    let facts = |folder: &Path| -> Vec<(String, Vec<u8>)> {
        let fact = |name| (snapshot::digest(&folder.join(name)).unwrap(), fs::read(folder.join(name)).unwrap());
        names.into_iter().map(fact).collect()
    };
    let expected = facts(alone.path());
    for ranks in [1, 2, 3, 5] {
        let folder = tempfile::tempdir().unwrap();
        run("write", folder.path(), ranks);
        for (name, (found, expected)) in names.iter().zip(facts(folder.path()).iter().zip(&expected)) {
            assert_eq!(found.0, expected.0, "digest of {name} on {ranks} ranks");
            assert!(found.1 == expected.1, "bytes of {name} on {ranks} ranks");
        }
        run("read", alone.path(), ranks);
    }
}

#[test]
fn round_trip_keeps_every_bit() {
    let folder = written();
    let (found, all) = snapshot::read(&folder.path().join("c1000.hdf")).unwrap();
    assert_eq!(found, header(1000));
    assert_eq!(found.gravity[1].to_bits(), (-0.0f64).to_bits());
    assert!(all.same_bits(&rows(1000, 0, 1)));
    let (_, shown) = snapshot::read(&folder.path().join("s1000.hdf")).unwrap();
    assert!(shown.acceleration.is_empty());
    assert_eq!(shown.stress, all.stress);
    assert!(!folder.path().join("c1000.hdf.tmp").exists());
}

#[test]
fn digest_tells_contents_apart() {
    let folder = written();
    let names = ["s3.hdf", "c3.hdf", "s1000.hdf", "c1000.hdf"];
    let mut digests: Vec<_> = names.iter().map(|name| snapshot::digest(&folder.path().join(name)).unwrap()).collect();
    digests.sort();
    digests.dedup();
    assert_eq!(digests.len(), 4);
}

#[test]
fn failures_are_shared_by_all_ranks() {
    for ranks in [0, 2, 3] {
        let folder = tempfile::tempdir().unwrap();
        run("fail", folder.path(), ranks);
    }
}

/// A limit on the size of files stands in for a full disk: the system refuses the same calls.
#[test]
fn a_full_disk_is_found_out_before_writing() {
    for ranks in [0, 2] {
        let folder = tempfile::tempdir().unwrap();
        run("full", folder.path(), ranks);
    }
}

#[test]
fn cut_off_files_are_damaged() {
    let folder = written();
    let bytes = fs::read(folder.path().join("s1000.hdf")).unwrap();
    let path = folder.path().join("cut.hdf");
    for length in [0, 8, 20, 48, 96, 512, 2048, 4096, bytes.len() / 2, bytes.len() - 8, bytes.len() - 1] {
        fs::write(&path, &bytes[..length]).unwrap();
        let error = snapshot::read_header(&path).unwrap_err();
        assert!(matches!(error, FileError::Damaged { .. }), "{length} bytes: {error}");
        assert_eq!(error.exit_code(), 65);
        assert!(error.to_string().contains("cut.hdf"), "{error}");
    }
}

#[test]
fn foreign_files_are_of_the_wrong_kind() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("text.hdf"), "time,step\n0,1\n").unwrap();
    fs::write(path("short.hdf"), "a").unwrap();
    hdf5::File::create(path("foreign.hdf")).unwrap().create_group("results").unwrap();
    let other = hdf5::File::create(path("sph.hdf")).unwrap();
    other.create_group("sph").unwrap();
    drop(other);
    for name in ["text.hdf", "short.hdf", "foreign.hdf", "sph.hdf", "."] {
        let error = snapshot::read(&path(name)).unwrap_err();
        assert!(matches!(error, FileError::WrongKind { .. }), "{name}: {error}");
    }
    assert!(matches!(snapshot::read(&path("absent")).unwrap_err(), FileError::NotFound { .. }));
}

/// Changes a sound file through HDF5 and returns the error of reading it.
fn changed(folder: &Path, change: impl FnOnce(&hdf5::File)) -> FileError {
    let path: PathBuf = folder.join("changed.hdf");
    fs::copy(folder.join("c3.hdf"), &path).unwrap();
    let file = hdf5::File::open_rw(&path).unwrap();
    change(&file);
    file.close().unwrap();
    snapshot::read(&path).unwrap_err()
}

#[test]
fn changed_files_are_named_for_what_they_are() {
    let folder = written();
    let attribute = |name: &'static str, value: u64| {
        move |file: &hdf5::File| file.group("sph").unwrap().attr(name).unwrap().write_scalar(&value).unwrap()
    };
    let first = |name: &'static str, value: f64| {
        move |file: &hdf5::File| {
            let dataset = file.dataset(&format!("particles/{name}")).unwrap();
            let mut values = dataset.read_raw::<f64>().unwrap();
            values[0] = value;
            dataset.write_raw(&values).unwrap();
        }
    };
    let newer = changed(folder.path(), attribute("format_version", 3));
    assert!(matches!(newer, FileError::Newer { found: 3, known: 2, .. }), "{newer}");
    // Older files lack fields: their version is told, not what is missing.
    let older = changed(folder.path(), |file| {
        attribute("format_version", 1)(file);
        file.unlink("particles/stress_work").unwrap();
    });
    assert!(matches!(older, FileError::Older { found: 1, known: 2, .. }), "{older}");
    assert_eq!(older.exit_code(), 65);
    assert!(
        older.to_string().ends_with("has format version 1, this program reads 2; prepare the scene anew with sph-prep")
    );
    let damaged = |error: FileError, word: &str| {
        assert!(matches!(error, FileError::Damaged { .. }) && error.to_string().contains(word), "{error}");
    };
    damaged(changed(folder.path(), attribute("count", 4)), "shape");
    damaged(changed(folder.path(), attribute("count", u64::MAX)), "shape");
    damaged(changed(folder.path(), first("position", f64::NAN)), "position of particle 0");
    damaged(changed(folder.path(), first("mass", f64::INFINITY)), "mass of particle 0");
    damaged(changed(folder.path(), first("density", f64::NAN)), "density of particle 0");
    damaged(changed(folder.path(), |file| file.unlink("particles/stress").unwrap()), "stress");
    damaged(
        changed(folder.path(), |file| file.dataset("particles/id").unwrap().write_raw(&[0u64, 2, 1]).unwrap()),
        "row 1 holds particle 2",
    );
}

/// Every flipped bit of a small file is noticed, or changes nothing that is read but values: never a crash or a hang.
#[test]
fn flipped_bits_never_crash() {
    let folder = written();
    let sound = folder.path().join("c3.hdf");
    let (bytes, digest) = (fs::read(&sound).unwrap(), snapshot::digest(&sound).unwrap());
    let path = folder.path().join("flipped.hdf");
    let (mut noticed, mut values, mut unread) = (0, 0, 0);
    for place in 0..bytes.len() {
        let mut flipped = bytes.clone();
        flipped[place] ^= 1 << (place % 8);
        fs::write(&path, &flipped).unwrap();
        match snapshot::digest(&path) {
            Err(_) => noticed += 1,
            Ok(found) if found != digest => values += 1,
            Ok(_) => unread += 1,
        }
    }
    eprintln!("{} bytes: {noticed} noticed at once, {values} change the digest, {unread} are not ours", bytes.len());
    // Three particles of 22 numbers; the rest that is read carries HDF5's checksums.
    assert_eq!(values, 3 * 8 * 22);
    assert!(noticed > 0);
}
