//! - A full disk, a used-up quota, an I/O error at any write: an exit code of its own, no hang, the older generations
//!   intact, and the same command goes on once there is room.
//! - A folder that is read-only, taken away during the run, or no longer ours to write.
//! - TERM, USR1 and INT to any rank or to mpirun, in a step, in a write, twice: all ranks stop after a checkpoint.

use crate::generations::{OFTEN, nothing_lost};
use formats::folder::RunFolder;
use formats::{checkpoint, exit};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use tests::shim::{self, Fault, library};
use tests::trial::{
    HANGS, Trial, appears, calls, copy, launch, meanwhile, newest, processes, short, signal, strike, while_running,
};
use tests::{Output, command, left_out, program, run_within};

const STATE: &str = "ckpt/gen-??????.tmp/state.hdf.tmp";
const MANIFEST: &str = "ckpt/gen-??????.tmp/MANIFEST.json.tmp";

/// Launches with one fault after the other in one folder, each on the ranks it names: all must end with a code of
/// `codes`, lose nothing, and leave a folder in which the last launch, without a fault, ends with the same bits.
#[track_caller]
fn one_after_another(trial: &Trial, name: &str, faults: &[(usize, Fault)], codes: &[i32]) {
    let folder = trial.fresh(name);
    let mut generation = 0;
    for (ranks, fault) in faults {
        let (output, struck) = strike(&folder, *ranks, &OFTEN, fault);
        assert!(codes.contains(&output.code), "{struck:?}: {output}");
        assert!(output.stderr.contains("sph-run: error: "), "{struck:?}: {output}");
        // Where nothing can be changed any more, the lock stays too; the next launch knows that its process is gone.
        let unlocked = fault.deed.starts_with("fail-on") || !folder.lock().exists();
        assert!(!folder.done().exists() && unlocked, "{struck:?}: {output}");
        generation = nothing_lost(&folder, generation, &struck[0]);
    }
    assert!(generation > 0, "no checkpoint was written meanwhile");
    trial.go(&folder, 3, &[], exit::DONE);
    trial.same(&folder);
}

#[test]
fn disk_full_at_any_write() {
    let full = |at, kind: &str, files: &str| Fault::new(format!("full:{}", libc::ENOSPC), at).of(kind, files);
    let faults = [
        (0, full(1, "write", "LOCK.new*")),
        (0, full(1, "allocate", "out/snapshot-*")),
        // Of the file's structure, then of rows.
        (0, full(1, "write", "out/snapshot-*")),
        (0, full(13, "write", "out/snapshot-*")),
        (0, full(1, "write", "out/history/000000.csv.tmp")),
        (0, full(1, "write", "out/index.json.tmp")),
        (0, full(3, "allocate", STATE)),
        (0, full(4, "allocate", STATE)),
        (0, full(1, "write", STATE)),
        (0, full(65, "write", STATE)),
        (0, full(2, "write", MANIFEST)),
        (0, full(3, "write", "out/history.csv")),
        (3, full(3, "allocate", STATE)),
        (3, full(20, "write", STATE).on(1)),
        (3, full(20, "write", STATE).on(2)),
    ];
    one_after_another(&Trial::in_memory(short::PLANE), "full", &faults, &[exit::CANNOT_WRITE]);
}

#[test]
fn calls_that_fail() {
    let fails = |code: i32, at, kind: &str, files: &str| Fault::new(format!("fail:{code}"), at).of(kind, files);
    let on = |code: i32, at, kind: &str, files: &str| Fault::new(format!("fail-on:{code}"), at).of(kind, files);
    let faults = [
        (0, fails(libc::EROFS, 1, "create", "LOCK.new*")),
        (0, fails(libc::EDQUOT, 12, "write", "out/snapshot-*")),
        (0, fails(libc::EIO, 1, "sync", "out/snapshot-*")),
        (0, fails(libc::EIO, 40, "write", STATE)),
        (0, fails(libc::EDQUOT, 2, "write", MANIFEST)),
        (0, fails(libc::EIO, 2, "sync", MANIFEST)),
        (0, fails(libc::EIO, 2, "rename", "ckpt/gen-??????")),
        (0, fails(libc::EIO, 2, "sync", "ckpt/gen-??????.tmp")),
        // From then on nothing can be changed at all.
        (0, on(libc::EROFS, 200, "", "*")),
        (0, on(libc::EACCES, 2, "folder", "ckpt/*")),
        (3, fails(libc::EIO, 17, "write", STATE).on(1)),
        (3, fails(libc::EIO, 2, "sync", STATE).on(2)),
        (3, on(libc::EACCES, 2, "create", STATE).on(1)),
    ];
    one_after_another(&Trial::in_memory(short::SOLID), "fail", &faults, &[exit::CANNOT_WRITE]);
}

/// What is read back is not what was written, or can't be read.
#[test]
fn written_wrongly() {
    let faults = [
        (0, Fault::new("flip", 65).of("write", STATE)),
        (0, Fault::new(format!("fail-on:{}", libc::EIO), 40).of("read", "ckpt/gen-??????.tmp/state.hdf")),
        (3, Fault::new("flip", 20).of("write", STATE).on(2)),
        (3, Fault::new(format!("fail-on:{}", libc::EIO), 40).of("read", "ckpt/gen-??????.tmp/state.hdf").on(1)),
    ];
    let trial = Trial::in_memory(short::RINGS);
    one_after_another(&trial, "wrongly", &faults, &[exit::CANNOT_WRITE, exit::NO_INPUT]);

    // Half written, and said so: no fault at all.
    let folder = trial.fresh("short");
    let (output, struck) = strike(&folder, 0, &OFTEN, &Fault::new("short", 60).of("write", STATE));
    assert_eq!(output.code, exit::DONE, "{struck:?}: {output}");
    trial.same(&folder);
    // An output that went wrong on the way to the disk is found by the check.
    let folder = trial.fresh("output");
    let (output, struck) = strike(&folder, 0, &[], &Fault::new("flip", 5).of("write", "out/snapshot-*"));
    if output.code == exit::DONE {
        let check = launch(&folder, 0, &["--check"]).expect(exit::NO_INPUT);
        assert!(check.stdout.contains("out/snapshot-"), "{struck:?}: {check}");
    }
}

/// Of the particles at the start or in going on, on any rank: noticed, and not taken for particles.
#[test]
fn reads_that_fail() {
    let fails = |at, kind: &str, files: &str| Fault::new(format!("fail:{}", libc::EIO), at).of(kind, files);
    let trial = Trial::in_memory(short::RINGS);
    let folder = trial.fresh("reads");
    let failed = |ranks: usize, fault: Fault, file: &str| {
        let (output, struck) = strike(&folder, ranks, &OFTEN, &fault);
        assert_eq!(output.code, exit::NO_INPUT, "{struck:?}: {output}");
        assert!(output.stderr.contains(file), "{struck:?}: {output}");
    };
    // The last open is for the rows, and so are the last reads.
    let opens = |file: &str, rank: usize| {
        let copied = copy(&folder, "counted");
        let calls = calls(&copied, 3, &["--stop-after-steps", "0"], "open,read", exit::RESUMABLE);
        fs::remove_dir_all(copied.path()).unwrap();
        let count =
            |kind: &str| calls.iter().filter(|c| c.rank == rank && c.kind == kind && c.path == file).count() as u64;
        (count("open"), count("read"))
    };
    let (open, read) = opens("initial.hdf", 1);
    assert!(open > 0 && read > 5);
    failed(3, fails(open, "open", "initial.hdf").on(1), "initial.hdf");
    for number in [read - 4, read] {
        failed(3, fails(number, "read", "initial.hdf").on(1), "initial.hdf");
    }
    failed(0, fails(read, "read", "initial.hdf"), "initial.hdf");
    trial.go(&folder, 2, &["--stop-after-steps", "50"], exit::RESUMABLE);
    let state = "ckpt/gen-000001/state.hdf";
    let (open, read) = opens(state, 2);
    assert!(open > 0 && read > 5);
    failed(3, fails(open, "open", state).on(2), state);
    failed(3, fails(read - 2, "read", state).on(2), state);
    trial.go(&folder, 3, &[], exit::DONE);
    trial.same(&folder);
}

/// Runs a shell script in a mount namespace of its own, where `$1` is a folder a disk can be mounted on; `None`, and
/// said so, where the system doesn't let this user.
fn with_a_disk(folder: &Path, script: &str) -> Option<Output> {
    fs::create_dir_all(folder).unwrap();
    let shell = |option: &str, script: &str| {
        let mut command = command("sph-run", &[] as &[&str], 0);
        let environment: Vec<_> = command.get_envs().map(|(k, v)| (k.to_owned(), v.unwrap().to_owned())).collect();
        command = Command::new("unshare");
        command.envs(environment).args([option, "sh", "-c", script, "sh"]).arg(folder);
        command
    };
    let may = |option: &&str| {
        let mut probe = shell(option, "mount -t tmpfs -o size=64k none \"$1\"");
        probe.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null());
        probe.status().is_ok_and(|status| status.success())
    };
    let Some(option) = ["-m", "-rm"].into_iter().find(may) else {
        left_out("no file system can be mounted here");
        return None;
    };
    let output = run_within(HANGS, &mut shell(option, script));
    assert!(!output.timed_out, "{output}");
    Some(output)
}

#[test]
fn a_disk_that_is_really_full() {
    let trial = Trial::in_memory(short::PLANE);
    // Room for the particles and no snapshot, for snapshots and no checkpoint, for one checkpoint and no second.
    for (size, launcher) in [("72k", ""), ("160k", ""), ("220k", ""), ("260k", "mpirun -n 2")] {
        let (fresh, result) = (trial.fresh(&format!("{size}-before")), trial.work.join(size));
        let run = program("sph-run").display().to_string();
        let script = format!(
            "mount -t tmpfs -o size={size} none $1 && cp -r {fresh} $1/run || exit 9
            {launcher} {run} $1/run --checkpoint-every 20steps --checkpoint-keep 1; echo full $?
            {run} --check $1/run >&2; echo check $?
            mount -o remount,size=64m none $1 || exit 9
            {launcher} {run} $1/run; echo room $?
            cp -r $1/run {result}",
            fresh = fresh.path().display(),
            result = result.display(),
        );
        let Some(output) = with_a_disk(&trial.work.join("disk"), &script) else { return };
        let said = |line: &str| output.stdout.lines().any(|said| said == line);
        assert!(said(&format!("full {}", exit::CANNOT_WRITE)) && said("check 0") && said("room 0"), "{size}: {output}");
        assert!(output.stderr.contains("full"), "{size}: {output}");
        trial.same(&RunFolder::new(result));
    }
}

#[test]
fn a_folder_that_is_read_only() {
    let trial = Trial::in_memory(short::PLANE);
    let begun = trial.fresh("begun");
    trial.go(&begun, 0, &["--stop-after-steps", "20"], exit::RESUMABLE);
    let script = format!(
        "mount -t tmpfs none $1 && cp -r {} $1/run && mount -o remount,ro none $1 || exit 9
        {run} $1/run; echo one $?; mpirun -n 2 {run} $1/run; echo two $?
        {run} --check $1/run; echo check $?",
        begun.path().display(),
        run = program("sph-run").display(),
    );
    let Some(output) = with_a_disk(&trial.work.join("disk"), &script) else { return };
    let said = |line: &str| output.stdout.lines().any(|said| said == line);
    let code = exit::CANNOT_WRITE;
    assert!(said(&format!("one {code}")) && said(&format!("two {code}")) && said("check 0"), "{output}");
}

/// The folder is there no more in the middle of the run; put back, the same command goes on.
#[test]
fn a_folder_that_is_taken_away() {
    let trial = Trial::in_memory(short::PLANE);
    let missing = launch(&RunFolder::new(trial.work.join("nowhere")), 0, &[]).expect(exit::NO_INPUT);
    assert!(missing.stderr.contains("nowhere"), "{missing}");
    for ranks in [0, 3] {
        let folder = trial.fresh(&format!("taken-{ranks}"));
        let aside = trial.work.join(format!("aside-{ranks}"));
        let output = while_running(&folder, ranks, |folder| fs::rename(folder.path(), &aside).unwrap());
        // Where the lock is missed first, the folder counts as another's.
        assert!([exit::CANNOT_WRITE, exit::LOCKED].contains(&output.code), "{output}");
        assert!(!folder.path().exists(), "it is made again in another place");
        fs::rename(&aside, folder.path()).unwrap();
        assert!(newest(&folder).0 >= 2);
        trial.go(&folder, ranks, &["--lock-patience", "1s"], exit::DONE);
        trial.same(&folder);
    }
}

/// Launches a run that waits in a write of its second checkpoint, and meanwhile does something to it.
#[track_caller]
fn in_a_write(folder: &RunFolder, ranks: usize, wait: u32, act: impl FnOnce() + Send) -> Output {
    let log = folder.path().with_extension("struck");
    let _ = fs::remove_file(&log);
    let arguments = [folder.path().as_os_str(), OFTEN[0].as_ref(), OFTEN[1].as_ref()];
    let mut command = command("sph-run", &arguments, ranks);
    // What mpirun gives its ranks after a TERM, once to go on and once to end, s.
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "3");
    let fault = Fault::new(format!("sleep:{wait}"), 2).of("sync", STATE);
    fault.put(&mut command, &library(), folder.path(), &log).unwrap();
    let output = meanwhile(command, || log.exists(), act);
    assert!(!output.timed_out && shim::struck(&log).len() == 1, "{output}");
    output
}

#[test]
fn signals() {
    let trial = Trial::in_memory(short::SOLID);
    let folder = trial.fresh("signals");
    let mut before = (0, 0);
    let mut stopped = |output: Output, code: i32, what: &str| {
        assert_eq!(output.code, code, "{what}: {output}");
        let (generation, step) = newest(&folder);
        assert!(generation > before.0 && step > before.1, "{what}: no checkpoint after {before:?}: {output}");
        before = (generation, step);
        let text = fs::read_to_string(folder.to_continue()).unwrap_or_else(|_| panic!("{what}: no CONTINUE: {output}"));
        let marked: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert!(marked["reason"] == "signal" && marked["step"] == step, "{what}: {text}");
        assert!(!folder.done().exists() && !folder.lock().exists());
    };
    let rank = |number: usize| processes(folder.path(), "sph-run")[number];
    let mpirun = || processes(folder.path(), "mpirun")[0];
    // In a write; twice on one rank, and on several at once.
    let output = in_a_write(&folder, 0, 200, || signal("INT", rank(0)));
    stopped(output, exit::RESUMABLE, "INT");
    let output = in_a_write(&folder, 0, 200, || ["TERM", "TERM", "USR1"].iter().for_each(|name| signal(name, rank(0))));
    stopped(output, exit::RESUMABLE, "TERM twice");
    let output = in_a_write(&folder, 3, 300, || signal("TERM", rank(1)));
    stopped(output, exit::RESUMABLE, "TERM to one of three");
    let output = in_a_write(&folder, 3, 300, || (0..3).for_each(|number| signal("USR1", rank(number))));
    stopped(output, exit::RESUMABLE, "USR1 to all");
    let output = in_a_write(&folder, 2, 300, || signal("USR1", mpirun()));
    stopped(output, exit::RESUMABLE, "USR1 to mpirun");
    // In a step, most likely.
    let next = |from: u64| {
        let folder = &folder;
        move || checkpoint::generations(folder).unwrap_or_default().last().is_some_and(|&newest| newest > from)
    };
    let arguments = [folder.path().as_os_str(), OFTEN[0].as_ref(), OFTEN[1].as_ref()];
    let output = meanwhile(command("sph-run", &arguments, 3), next(newest(&folder).0), || signal("INT", rank(2)));
    stopped(output, exit::RESUMABLE, "INT in a step");
    // mpirun hands TERM on after a while, ends its ranks after another, and answers with status 1 whatever they say: the
    // mark says that the run can go on.
    let output = in_a_write(&folder, 2, 3300, || signal("TERM", mpirun()));
    stopped(output, 1, "TERM to mpirun");
    trial.go(&folder, 2, &[], exit::DONE);
    assert!(!folder.to_continue().exists());
    trial.same(&folder);
}

/// A rank that is suspended and goes on later.
#[test]
fn suspended_for_a_while() {
    let trial = Trial::in_memory(short::PLANE);
    let folder = trial.fresh("suspended");
    let log = folder.path().with_extension("struck");
    let arguments = [folder.path().as_os_str(), OFTEN[0].as_ref(), OFTEN[1].as_ref()];
    let mut command = command("sph-run", &arguments, 2);
    Fault::new("suspend", 2).of("sync", STATE).on(1).put(&mut command, &library(), folder.path(), &log).unwrap();
    let output = meanwhile(
        command,
        || log.exists(),
        || {
            assert!(!appears(Duration::from_millis(500), || folder.done().exists()), "it runs on");
            processes(folder.path(), "sph-run").into_iter().for_each(|process| signal("CONT", process));
        },
    );
    output.expect(exit::DONE);
    trial.same(&folder);
}
