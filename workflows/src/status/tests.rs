use super::*;
use formats::provenance::now;

/// A prepared run folder, without particles.
fn prepared() -> (tempfile::TempDir, RunFolder) {
    let place = tempfile::tempdir().unwrap();
    let folder = RunFolder::new(place.path());
    let scene = paths::repository().join("workflows/cases/column-demo/scene.toml");
    fs::copy(scene, folder.scene()).unwrap();
    fs::create_dir(folder.log()).unwrap();
    (place, folder)
}

fn state(folder: &RunFolder) -> State {
    Status::of(folder).unwrap().state
}

fn progress(elapsed: f64, left: f64, deadline: f64) -> Progress {
    Progress {
        time: 0.1,
        end: 0.4,
        step: 1000,
        time_step: 1e-4,
        particles: 5000,
        ranks: 2,
        rate: 1e6,
        elapsed,
        left: Some(left),
        updated: now(),
        job: Some("slurm 7".into()),
        deadline: moment(SystemTime::now(), deadline),
    }
}

/// Leaves the lock of this process, with one word of it changed.
fn leave_lock(folder: &RunFolder, old: &str, new: &str) {
    let lock = lock::RunLock::acquire(&folder.lock()).unwrap();
    let text = fs::read_to_string(folder.lock()).unwrap();
    assert!(text.contains(old), "{text}");
    drop(lock);
    fs::write(folder.lock(), text.replace(old, new)).unwrap();
}

#[test]
fn every_state_is_told() {
    let place = tempfile::tempdir().unwrap();
    let folder = RunFolder::new(place.path());
    assert_eq!(Status::of(&folder).unwrap_err().code, formats::exit::NO_INPUT);
    let (_place, folder) = prepared();
    fs::rename(folder.scene(), folder.path().join("scene.toml")).unwrap();
    assert_eq!(state(&folder), State::NotPrepared);
    fs::rename(folder.path().join("scene.toml"), folder.scene()).unwrap();
    assert_eq!(state(&folder), State::NotStarted);

    let lock = lock::RunLock::acquire(&folder.lock()).unwrap();
    assert_eq!(state(&folder), State::Running);
    progress(10.0, 60.0, 300.0).write(&folder).unwrap();
    let running = Status::of(&folder).unwrap();
    assert_eq!((running.state, running.step, running.time), (State::Running, 1000, 0.1));
    assert!(running.ends.is_some() && running.more_slices == Some(0));
    drop(lock);

    // The process is gone: what it said last is not kept, the checkpoint is.
    let own = format!("\"pid\": {}", std::process::id());
    leave_lock(&folder, &own, "\"pid\": 4194305");
    let broken = Status::of(&folder).unwrap();
    assert_eq!((broken.state, broken.step), (State::BrokenOff, 0));
    // On another machine: as long as its lock is renewed.
    fs::remove_file(folder.lock()).unwrap();
    leave_lock(&folder, "\"host\": \"", "\"host\": \"far-");
    assert_eq!(state(&folder), State::Running);
    let long_ago = SystemTime::now() - Duration::from_secs(600);
    fs::File::options().append(true).open(folder.lock()).unwrap().set_modified(long_ago).unwrap();
    assert_eq!(state(&folder), State::Silent);
    fs::remove_file(folder.lock()).unwrap();

    Event::now("failed", 5, 0.1, 1).append(&folder).unwrap();
    assert_eq!(state(&folder), State::Failed);
    fs::write(folder.to_continue(), r#"{"reason":"wall-limit","step":7,"time":0.5}"#).unwrap();
    let stopped = Status::of(&folder).unwrap();
    let stop = Stop { reason: "wall-limit".into(), step: Some(7), time: Some(0.5) };
    assert_eq!((stopped.state, stopped.stop), (State::Stopped, Some(stop)));
    fs::write(folder.done(), "").unwrap();
    let done = Status::of(&folder).unwrap();
    assert_eq!((done.state, done.fraction(), done.left), (State::Done, Some(1.0), None));
}

/// Slices of 100 s: of the present one 60 s are left, 290 s are to compute.
#[test]
fn slices_are_counted() {
    let (_place, folder) = prepared();
    let lock = lock::RunLock::acquire(&folder.lock()).unwrap();
    let scene = fs::read_to_string(folder.scene()).unwrap();
    let end = Scene::read("scene", &scene).unwrap().end.time;
    let to_end = end * 0.25;
    Progress { time: end - to_end, end, ..progress(40.0, 290.0, 60.0) }.write(&folder).unwrap();
    let running = Status::of(&folder).unwrap();
    assert!((running.left.unwrap() - 290.0).abs() < 1e-6, "{running:?}");
    assert_eq!(running.more_slices, Some(3), "{running:?}");
    let shown = text::long(&running, SystemTime::now());
    assert!(shown.contains("slurm 7, has to end at") && shown.contains("3 more slices after it"), "{shown}");
    assert!(shown.contains("75.0 %") && shown.contains("5000") && shown.lines().count() <= 15, "{shown}");
    // Stopped with no checkpoint: all is to do again, which is four times as much.
    drop(lock);
    let broken = Status::of(&folder).unwrap();
    assert_eq!((broken.state, broken.more_slices), (State::BrokenOff, Some(12)), "{broken:?}");
}

#[test]
fn durations_have_two_parts() {
    let shown = [(0.4, "0 s"), (59.0, "59 s"), (60.0, "1 min"), (725.0, "12 min 5 s"), (12_000.0, "3 h 20 min")];
    for (seconds, expected) in shown {
        assert_eq!(text::duration(seconds), expected);
    }
    assert_eq!(text::duration(187_200.0), "2 d 4 h");
    assert_eq!(text::duration(-3.0), "0 s");
}

#[test]
fn events_end_the_text() {
    let (_place, folder) = prepared();
    for step in 0..9 {
        let what = format!("gen-{step:06}");
        Event { what, ..Event::now("checkpoint", step, 0.1, 2) }.append(&folder).unwrap();
    }
    let shown = text::long(&Status::of(&folder).unwrap(), SystemTime::now());
    assert!(
        shown.ends_with("gen-000008\n") && shown.contains("gen-000005") && !shown.contains("gen-000004"),
        "{shown}"
    );
}
