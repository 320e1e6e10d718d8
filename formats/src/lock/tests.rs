use super::*;
use crate::provenance::sha256;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Barrier, Mutex};
use std::time::Instant;
use std::{fs, process, thread};

/// A patience that tests can afford: a beat every 60 ms.
const SHORT: Duration = Duration::from_millis(300);
/// One that does not end before a beat of another process comes, however loaded the machine.
const LONG: Duration = Duration::from_secs(20);

struct Place {
    folder: tempfile::TempDir,
    path: PathBuf,
    news: Mutex<Vec<String>>,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("LOCK");
        Self { folder, path, news: Mutex::default() }
    }

    fn acquire(&self) -> Result<RunLock, LockError> {
        self.acquire_within(SHORT)
    }

    fn acquire_within(&self, patience: Duration) -> Result<RunLock, LockError> {
        let terms = Terms { patience, job: Some("slurm 7".into()) };
        RunLock::acquire_on(&self.path, &terms, |line| self.news.lock().unwrap().push(line.into()))
    }

    /// A lock as a process of another machine left it.
    fn foreign(&self) -> Holder {
        let holder = Holder { host: "elsewhere".into(), ..Holder::this(None, SHORT / BEATS) };
        assert!(file::create(&self.path, &holder).unwrap());
        holder
    }

    fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
    }

    fn news(&self) -> String {
        self.news.lock().unwrap().join("\n")
    }
}

#[test]
fn second_is_refused_and_drop_releases() {
    let place = Place::new();
    let lock = place.acquire().unwrap();
    let error = place.acquire().unwrap_err();
    assert!(matches!(&error, LockError::Locked { holder, .. } if holder.pid == process::id()), "{error}");
    assert!(error.to_string().contains("slurm 7"), "{error}");
    assert_eq!(error.exit_code(), 76);
    assert_eq!(holder(&place.path).unwrap().runs(), Some(true));
    drop(lock);
    assert!(place.files().is_empty(), "{:?}", place.files());
    assert!(holder(&place.path).is_none());
    RunLock::acquire(&place.path).unwrap();
}

#[test]
fn lock_of_a_dead_process_is_taken_over_at_once() {
    let place = Place::new();
    // Killed but not yet collected, collected, and a living process with that number but another start.
    let mut child = process::Command::new("sleep").arg("60").spawn().unwrap();
    let mut held = Holder::this(None, Duration::from_secs(3600));
    held.pid = child.id();
    held.started = {
        let text = fs::read_to_string(format!("/proc/{}/stat", held.pid)).unwrap();
        text[text.rfind(')').unwrap() + 1..].split_whitespace().nth(19).unwrap().parse().unwrap()
    };
    assert!(file::create(&place.path, &held).unwrap());
    assert_eq!(place.acquire().unwrap_err().exit_code(), exit::LOCKED);
    child.kill().unwrap();
    let began = Instant::now();
    while held.runs() != Some(false) {
        assert!(began.elapsed() < Duration::from_secs(10));
    }
    drop(place.acquire().unwrap());
    child.wait().unwrap();
    assert!(!place.path.exists());
    assert!(file::create(&place.path, &Holder { pid: process::id(), started: 1, ..held }).unwrap());
    drop(place.acquire().unwrap());
    assert!(began.elapsed() < Duration::from_secs(60), "it waited for a beat");
    assert!(place.files().is_empty() && place.news().contains("no longer runs"), "{}", place.news());
}

#[test]
fn silent_lock_of_another_machine_is_taken_over_after_the_patience() {
    // As this version writes it, as an earlier one did, and one that can't be understood.
    let earlier = r#"{"host": "elsewhere", "boot": "b", "pid": 1, "started": 1, "since": "2025-01-01T00:00:00Z"}"#;
    for text in [None, Some(earlier), Some("?"), Some("")] {
        let place = Place::new();
        match text {
            None => drop(place.foreign()),
            Some(text) => fs::write(&place.path, text).unwrap(),
        }
        let began = Instant::now();
        let lock = place.acquire().unwrap();
        assert!(began.elapsed() >= SHORT, "{:?}", began.elapsed());
        let news = place.news();
        assert!(news.contains("0.3 s for a sign of life") && news.contains("taken over from"), "{news}");
        lock.still_ours().unwrap();
        drop(lock);
        assert!(place.files().is_empty(), "{:?}", place.files());
    }
}

#[test]
fn this_machine_before_its_restart_and_other_containers_are_watched_too() {
    let this = || Holder::this(None, SHORT / BEATS);
    for held in [Holder { boot: "another".into(), ..this() }, Holder { namespace: "pid:[1]".into(), ..this() }] {
        let place = Place::new();
        assert_eq!(held.runs(), None);
        assert!(file::create(&place.path, &held).unwrap());
        let began = Instant::now();
        place.acquire().unwrap();
        assert!(began.elapsed() >= SHORT);
    }
}

#[test]
fn beating_lock_of_another_machine_holds() {
    let place = Place::new();
    let held = place.foreign();
    let heart = Heart::start(&place.path, &held).unwrap();
    let began = Instant::now();
    let error = place.acquire_within(LONG).unwrap_err();
    assert!(matches!(&error, LockError::Locked { holder, .. } if **holder == held), "{error}");
    assert!(began.elapsed() < LONG / 2, "beats were missed: {:?}", began.elapsed());
    // The lock changes in place and stays what it is.
    assert!(!heart.lost() && file::look(&place.path).unwrap().unwrap().is_of(&held));
    assert!(fs::read_to_string(&place.path).unwrap().contains("\"beats\": \"000000000"));
    // Touched by whatever other means, too: it need not be understood.
    drop(heart);
    fs::write(&place.path, "?").unwrap();
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                thread::sleep(SHORT / BEATS);
                fs::File::options()
                    .append(true)
                    .open(&place.path)
                    .unwrap()
                    .set_modified(std::time::SystemTime::now())
                    .unwrap();
            }
        });
        let error = place.acquire_within(LONG).unwrap_err();
        done.store(true, Ordering::Relaxed);
        assert!(matches!(error, LockError::Unreadable { .. }), "{error}");
    });
}

#[test]
fn who_beats_slowly_is_watched_longer() {
    let place = Place::new();
    let held = Holder { beat_milliseconds: 200, host: "elsewhere".into(), ..Holder::this(None, SHORT) };
    assert!(file::create(&place.path, &held).unwrap());
    let began = Instant::now();
    place.acquire().unwrap();
    assert!(began.elapsed() >= Duration::from_secs(1));
}

#[test]
fn lock_that_is_released_during_the_watch_is_taken_at_once() {
    let place = Place::new();
    let held = place.foreign();
    thread::scope(|scope| {
        scope.spawn(|| {
            thread::sleep(SHORT / 4);
            file::release(&place.path, &held);
        });
        let began = Instant::now();
        place.acquire_within(LONG).unwrap();
        assert!(began.elapsed() < LONG / 2);
    });
}

/// A holder that wakes and finds another one at work, or its lock deleted.
#[test]
fn lost_lock_is_noticed_and_left_alone() {
    let place = Place::new();
    let lock = place.acquire().unwrap();
    lock.still_ours().unwrap();
    // As if it had been silent: the other takes what it believes to be stale.
    let found = file::look(&place.path).unwrap().unwrap();
    let other = Holder { host: "elsewhere".into(), ..Holder::this(None, SHORT) };
    assert!(file::replace(&place.path, &found, &other, SHORT).unwrap());
    let text = sha256(&fs::read(&place.path).unwrap());
    let error = lock.still_ours().unwrap_err();
    assert!(matches!(&error, LockError::Lost { holder: Some(h), .. } if **h == other), "{error}");
    assert_eq!(error.exit_code(), 76);
    // Its beats do not reach the other's file, and neither does its release.
    thread::sleep(SHORT);
    drop(lock);
    assert_eq!(text, sha256(&fs::read(&place.path).unwrap()));

    let place = Place::new();
    let lock = place.acquire().unwrap();
    fs::remove_file(&place.path).unwrap();
    assert!(matches!(lock.still_ours(), Err(LockError::Lost { holder: None, .. })));
    // Once lost it stays lost, even if the very same file came back.
    let began = Instant::now();
    while !lock.heart.lost() {
        assert!(began.elapsed() < Duration::from_secs(10));
        thread::sleep(SHORT / 50);
    }
    assert!(file::create(&place.path, &lock.holder).unwrap());
    assert!(matches!(lock.still_ours(), Err(LockError::Lost { holder: None, .. })));
}

/// Many find the same stale lock at the same moment: one gets it, all others are refused.
#[test]
fn of_many_contenders_exactly_one_wins() {
    const CONTENDERS: usize = 8;
    for round in 0..15 {
        let place = Place::new();
        if round % 5 == 0 {
            place.foreign();
        } else {
            let dead = Holder { started: 1, ..Holder::this(None, SHORT) };
            assert!(file::create(&place.path, &dead).unwrap());
        }
        let (barrier, end, won) = (Barrier::new(CONTENDERS), Barrier::new(CONTENDERS), AtomicUsize::new(0));
        thread::scope(|scope| {
            for _ in 0..CONTENDERS {
                scope.spawn(|| {
                    barrier.wait();
                    let lock = place.acquire();
                    match &lock {
                        Ok(lock) => {
                            won.fetch_add(1, Ordering::Relaxed);
                            lock.still_ours().unwrap();
                        }
                        Err(error) => assert!(matches!(error, LockError::Locked { .. }), "{error}"),
                    }
                    // Held until all have tried.
                    end.wait();
                });
            }
        });
        assert_eq!(won.load(Ordering::Relaxed), 1, "round {round}");
        assert!(place.files().is_empty(), "round {round}: {:?}", place.files());
    }
}

/// One at a time, always, while many come and go.
#[test]
fn never_two_at_once() {
    let place = Place::new();
    let (inside, taken) = (AtomicUsize::new(0), AtomicUsize::new(0));
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..50 {
                    if let Ok(lock) = place.acquire() {
                        assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                        lock.still_ours().unwrap();
                        assert_eq!(inside.fetch_sub(1, Ordering::SeqCst), 1);
                        taken.fetch_add(1, Ordering::Relaxed);
                    }
                }
            });
        }
    });
    assert!(taken.load(Ordering::Relaxed) > 0 && place.files().is_empty());
}
