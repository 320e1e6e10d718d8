//! The limits of a launch.
//!
//! - One process at a time in a run folder: a second launch exits with 76, on any number of ranks; a lock left by a
//!   killed process recovers at once on its own machine, after the patience on another; one that shows a sign of life holds;
//!   who slept so long that another took over exits with 76 and publishes nothing.
//! - A launch ends with a checkpoint before its wall limit, also where steps are slow; a limit shorter than what ending takes
//!   is an error; processes that are stopped for a while, or beyond their limit, do no harm.

use formats::{checkpoint, exit, folder::RunFolder, journal::Event, lock};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime};
use tests::shim::{self, Fault};
use tests::trial::{Trial, running, short};
use tests::{Output, WorkFolder, command, prepared, run, run_within};

/// A small column that goes on for as long as any test needs it.
const ENDLESS: &str = r#"
space = "plane-strain"
spacing = "20 mm"
symmetry = ["x"]
[material.drucker-prager]
density = "2600 kg/m3"
young = "0.4 MPa"
poisson = 0.3
friction = "25 deg"
cohesion = "0 Pa"
[body.column]
box = { min = [0, 0, 0], max = ["0.2 m", 0, "0.2 m"] }
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "3000 s"
[output]
snapshots = "1000 s"
history = "100 s"
"#;

/// Longer than anything here takes on a loaded machine.
const LONG: Duration = Duration::from_secs(60);

/// A launch under way; what it says goes to a file.
struct Launch {
    child: Child,
    said: PathBuf,
}

impl Launch {
    fn start(folder: &RunFolder, ranks: usize, options: &[&str]) -> Self {
        let mut arguments = vec![folder.path().as_os_str()];
        arguments.extend(options.iter().map(OsStr::new));
        let names = (0..).map(|number| folder.path().with_extension(format!("said-{number}")));
        let said = names.into_iter().find(|path| !path.exists()).expect("a free name");
        let file = File::create(&said).unwrap();
        let mut command = command("sph-run", &arguments, ranks);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(file).process_group(0);
        Self { child: command.spawn().unwrap(), said }
    }

    /// Waits until it has done steps and there is a checkpoint.
    #[track_caller]
    fn under_way(mut self, folder: &RunFolder) -> Self {
        wait_for("a checkpoint", || {
            assert!(self.runs(), "it ended: {}", self.said());
            checkpoints(folder) > 0 && self.said().contains(" %  t = ")
        });
        self
    }

    fn runs(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    fn said(&self) -> String {
        fs::read_to_string(&self.said).unwrap()
    }

    /// Waits for its end.
    #[track_caller]
    fn end(mut self) -> Output {
        wait_for("its end", || !self.runs());
        let status = self.child.wait().unwrap();
        let code = status.code().or_else(|| status.signal().map(|signal| 128 + signal)).unwrap();
        Output { code, stdout: String::new(), stderr: self.said(), timed_out: false }
    }
}

impl Drop for Launch {
    fn drop(&mut self) {
        if self.runs() {
            // The group is this launch's own.
            let _ = Command::new("kill").args(["-KILL", "--"]).arg(format!("-{}", self.child.id())).status();
            let _ = self.child.wait();
        }
    }
}

#[track_caller]
fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(began.elapsed() < LONG, "{what}: not within {LONG:?}");
        thread::sleep(Duration::from_millis(5));
    }
}

fn signal(name: &str, launch: &Launch) {
    let status = Command::new("kill").arg(format!("-{name}")).arg(launch.child.id().to_string()).status();
    assert!(status.unwrap().success(), "no process to send {name} to");
}

/// Checkpoints that were written and all that belongs to them done.
fn checkpoints(folder: &RunFolder) -> usize {
    Event::all(folder).iter().filter(|event| event.event == "checkpoint").count()
}

#[track_caller]
fn go(folder: &RunFolder, ranks: usize, options: &[&str], code: i32) -> Output {
    let mut arguments = vec![folder.path().as_os_str()];
    arguments.extend(options.iter().map(OsStr::new));
    run("sph-run", &arguments, ranks).expect(code)
}

/// What is published in a folder: every file that has its final name, its length and when it was written.
fn published(folder: &Path) -> BTreeMap<PathBuf, (u64, SystemTime)> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let facts = fs::metadata(&path).unwrap();
        match facts.is_dir() {
            _ if path.extension() == Some(OsStr::new("tmp")) => {}
            true => found.extend(published(&path)),
            false => drop(found.insert(path, (facts.len(), facts.modified().unwrap()))),
        }
    }
    found
}

/// Puts a lock in a folder as a process of another machine leaves it.
fn lock_from_elsewhere(folder: &RunFolder) {
    let text = r#"{"host": "elsewhere", "boot": "b", "pid": 7, "started": 1, "since": "2025-01-01T00:00:00Z"}"#;
    fs::write(folder.lock(), text).unwrap();
}

#[test]
fn second_launch_is_refused_while_the_first_runs() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", ENDLESS, 1);
    let mut first = Launch::start(&folder, 0, &["--checkpoint-every", "200steps"]).under_way(&folder);
    let holder = lock::holder(&folder.lock()).unwrap();
    assert_eq!((holder.pid, holder.runs()), (first.child.id(), Some(true)));
    for ranks in [0, 3] {
        let began = Instant::now();
        let refused = go(&folder, ranks, &[], exit::LOCKED);
        assert!(first.runs(), "the first has ended: nothing was tested");
        let pid = format!("process {}", holder.pid);
        assert!(refused.stderr.contains("LOCK") && refused.stderr.contains(&pid), "{refused}");
        assert!(began.elapsed() < LONG, "it waited");
    }
    assert_eq!(lock::holder(&folder.lock()), Some(holder));
    signal("TERM", &first);
    first.end().expect(exit::RESUMABLE);
    assert!(!folder.lock().exists());
    go(&folder, 0, &["--stop-after-steps", "1"], exit::RESUMABLE);
}

#[test]
fn lock_of_a_killed_process_recovers_and_one_of_many_gets_it() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", ENDLESS, 1);
    let first = Launch::start(&folder, 0, &["--checkpoint-every", "200steps"]).under_way(&folder);
    signal("KILL", &first);
    first.end().expect(137);
    let stale = lock::holder(&folder.lock()).expect("a lock is left");
    assert_eq!(stale.runs(), Some(false));
    let mut launches: Vec<_> = (0..4).map(|_| Launch::start(&folder, 0, &[])).collect();
    wait_for("all but one are refused", || launches.iter_mut().filter_map(|l| (!l.runs()).then_some(())).count() == 3);
    let (running, ended): (Vec<_>, Vec<_>) =
        launches.into_iter().map(|mut l| (l.runs(), l)).partition(|(runs, _)| *runs);
    for (_, refused) in ended {
        refused.end().expect(exit::LOCKED);
    }
    let (_, winner) = running.into_iter().next().expect("one goes on");
    assert_eq!(lock::holder(&folder.lock()).unwrap().pid, winner.child.id());
    wait_for("it works", || winner.said().contains("resuming"));
    signal("TERM", &winner);
    let output = winner.end().expect(exit::RESUMABLE);
    assert!(output.stderr.contains("taken over from"), "{output}");
    assert!(!folder.lock().exists());
}

#[test]
fn silent_lock_of_another_machine_recovers_after_the_patience() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", ENDLESS, 1);
    for ranks in [0, 2] {
        lock_from_elsewhere(&folder);
        let began = Instant::now();
        let options = ["--lock-patience", "1s", "--stop-after-steps", "1"];
        let output = go(&folder, ranks, &options, exit::RESUMABLE);
        assert!(began.elapsed() >= Duration::from_secs(1));
        let told = |text: &str| output.stderr.matches(text).count() == 1;
        assert!(told("held by process 7 on elsewhere") && told("up to 1 s") && told("taken over from"), "{output}");
        assert!(!folder.lock().exists());
    }
}

#[test]
fn beating_lock_of_another_machine_holds() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", ENDLESS, 1);
    lock_from_elsewhere(&folder);
    let (done, before) = (AtomicBool::new(false), published(folder.path()).len());
    thread::scope(|scope| {
        scope.spawn(|| {
            let file = File::options().write(true).open(folder.lock()).unwrap();
            while !done.load(Ordering::Relaxed) {
                thread::sleep(Duration::from_millis(100));
                file.set_modified(SystemTime::now()).unwrap();
            }
        });
        let began = Instant::now();
        let output = go(&folder, 0, &["--lock-patience", "40s"], exit::LOCKED);
        done.store(true, Ordering::Relaxed);
        // At the first beat, not at the end.
        assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
        assert!(output.stderr.contains("process 7 on elsewhere"), "{output}");
    });
    assert_eq!((lock::holder(&folder.lock()).unwrap().pid, published(folder.path()).len()), (7, before));
}

/// A launch is stopped; another, which can't ask about it, takes over, works and ends. The first wakes.
#[test]
fn who_sleeps_while_another_takes_over_publishes_nothing() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", ENDLESS, 1);
    for (number, options) in [["--checkpoint-every", "1s"], ["--wall-limit", "none"]].iter().enumerate() {
        let mut options = options.to_vec();
        options.extend(["--lock-patience", "500ms"]);
        let first = Launch::start(&folder, 0, &options).under_way(&folder);
        signal("STOP", &first);
        // Here it could be asked: let it be on another machine.
        let there = fs::read_to_string(folder.lock()).unwrap();
        let here = format!("\"host\": {:?}", lock::holder(&folder.lock()).unwrap().host);
        assert!(there.contains(&here), "{there}");
        let moved = work.write("moved", &there.replace(&here, "\"host\": \"elsewhere\""));
        fs::rename(moved, folder.lock()).unwrap();

        let second = go(&folder, 0, &["--lock-patience", "500ms", "--stop-after-steps", "60"], exit::RESUMABLE);
        assert!(second.stderr.contains("taken over from"), "{second}");
        let before = published(folder.path());
        signal("CONT", &first);
        // It is told to stop where it would not write by itself.
        if number == 1 {
            signal("TERM", &first);
        }
        let first = first.end().expect(exit::LOCKED);
        assert!(first.stderr.contains("LOCK: the lock was removed"), "{first}");
        let after = published(folder.path());
        let log = |path: &Path| path.starts_with(folder.log());
        let differ: Vec<_> =
            after.iter().filter(|(path, facts)| !log(path) && before.get(*path) != Some(facts)).collect();
        assert!(differ.is_empty() && after.len() >= before.len(), "written: {differ:?}");
    }
    go(&folder, 0, &["--stop-after-steps", "1"], exit::RESUMABLE);
}

/// A launch with a wall limit in the folder, acted upon once it is under way: how long it took.
#[track_caller]
fn ends_in_time(folder: &RunFolder, limit: u64, code: i32, act: impl FnOnce(&mut Launch)) -> (Duration, Output) {
    let began = Instant::now();
    let mut launch = Launch::start(folder, 0, &["--wall-limit", &format!("{limit}s")]);
    act(&mut launch);
    let output = launch.end().expect(code);
    (began.elapsed(), output)
}

#[test]
fn launches_end_with_a_checkpoint_before_their_wall_limit() {
    let work = WorkFolder::new();
    let [plain, slow, asleep] = ["plain", "slow", "asleep"].map(|name| prepared(&work, name, ENDLESS, 1));
    thread::scope(|scope| {
        scope.spawn(|| {
            let (took, _) = ends_in_time(&plain, 5, exit::RESUMABLE, |_| ());
            assert!(took < Duration::from_secs(5), "{took:?}");
        });
        // The process runs a tenth of the time.
        scope.spawn(|| {
            let mut stops = 0;
            let (took, _) = ends_in_time(&slow, 6, exit::RESUMABLE, |launch| {
                wait_for("its first steps", || slow.log().join("progress.json").exists());
                while launch.runs() {
                    signal("STOP", launch);
                    thread::sleep(Duration::from_millis(270));
                    signal("CONT", launch);
                    thread::sleep(Duration::from_millis(30));
                    stops += 1;
                }
            });
            assert!(took < Duration::from_secs(6) && stops > 2, "slow steps: {took:?}, stopped {stops} times");
        });
        // It can't stop in time, but nothing is lost.
        scope.spawn(|| {
            let (took, _) = ends_in_time(&asleep, 4, exit::RESUMABLE, |launch| {
                wait_for("its first steps", || asleep.log().join("progress.json").exists());
                signal("STOP", launch);
                thread::sleep(Duration::from_secs(4));
                signal("CONT", launch);
            });
            assert!(took > Duration::from_secs(4), "it did not sleep: {took:?}");
        });
    });
    for folder in [plain, slow, asleep] {
        assert_eq!(checkpoints(&folder), 1);
        let why = fs::read_to_string(folder.to_continue()).unwrap();
        assert!(why.contains("wall-limit"), "{why}");
        go(&folder, 0, &["--stop-after-steps", "1"], exit::RESUMABLE);
    }
}

/// A rank that is stopped before MPI is up keeps all others waiting in there: they end by themselves.
#[test]
fn a_start_that_hangs_ends() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", ENDLESS, 1);
    let mut launch = Launch::start(&folder, 3, &["--mpi-patience", "3s"]);
    let ranks = || running(folder.path(), "sph-run");
    wait_for("a rank", || !ranks().is_empty());
    let _ = Command::new("kill").args(["-STOP", &ranks()[0].to_string()]).status();
    assert!(launch.runs());
    let ended = launch.end();
    assert!(ended.code != exit::DONE && ended.stderr.contains("MPI has not started within 3 s"), "{ended}");
    assert!(!folder.out().exists() && !folder.lock().exists());
    assert!(ranks().is_empty(), "some are left");
    go(&folder, 2, &["--stop-after-steps", "1"], exit::RESUMABLE);
}

/// Every fsync of a checkpoint takes half a second, so ending takes 2.5 s, more than the two that are left in any case.
#[test]
fn a_slow_disk_is_reckoned_with() {
    let work = WorkFolder::new();
    let (folder, log) = (prepared(&work, "slow", ENDLESS, 1), work.join("log"));
    let options = ["--wall-limit", "8s", "--checkpoint-every", "500ms"].map(OsStr::new);
    let arguments = [&[folder.path().as_os_str()], &options[..]].concat();
    let mut command = command("sph-run", &arguments, 0);
    Fault::new("slow:500", 1).of("sync", "ckpt/*").put(&mut command, &shim::library(), folder.path(), &log).unwrap();
    let began = Instant::now();
    run_within(LONG, &mut command).expect(exit::RESUMABLE);
    assert!(began.elapsed() < Duration::from_secs(8), "{:?}", began.elapsed());
    assert_eq!(shim::struck(&log).len(), 1);
    assert!(fs::read_to_string(folder.to_continue()).unwrap().contains("wall-limit"));
    let newest = checkpoint::newest_manifest(&folder).unwrap().unwrap();
    assert!(newest.generation > 1 && newest.write_seconds > 0.5, "{newest:?}");
}

#[test]
fn the_time_of_day_may_jump() {
    let trial = Trial::new(short::RINGS);
    for (number, jump) in [-500_000_i64, 500_000].into_iter().enumerate() {
        let (folder, log) = (trial.fresh(&format!("jump-{number}")), trial.work.join(format!("log-{number}")));
        let options = ["--wall-limit", "10min", "--checkpoint-every", "40steps"].map(OsStr::new);
        let mut command = command("sph-run", &[&[folder.path().as_os_str()], &options[..]].concat(), 2);
        let fault = Fault::new(format!("clock:{jump}"), 60);
        fault.put(&mut command, &shim::library(), folder.path(), &log).unwrap();
        run_within(LONG, &mut command).expect(exit::DONE);
        assert_eq!(shim::struck(&log).len(), 1);
        let day = |event: &Event| event.at[..10].to_owned();
        let events = Event::all(&folder);
        assert_ne!(events.first().map(day), events.last().map(day), "it did not jump: {events:?}");
        trial.same(&folder);
    }
}

#[test]
fn wall_limit_shorter_than_ending_takes_is_an_error() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", ENDLESS, 1);
    let (_, output) = ends_in_time(&folder, 1, exit::USAGE, |_| ());
    assert!(output.stderr.contains("wall limit") && output.stderr.contains("--wall-limit"), "{output}");
    assert!(!folder.lock().exists() && checkpoints(&folder) == 0);
}
