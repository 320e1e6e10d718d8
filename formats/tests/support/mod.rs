//! Runs a part of this test binary again under MPI: the test called `on_ranks` is the part.
#![allow(dead_code, reason = "each test binary uses its own part")]

use formats::kernel::Kernel;
use formats::snapshot::{Header, Rows, share};
use formats::space::Space;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use std::{env, fs, thread};

const TASK: &str = "FORMATS_TEST_TASK";
const FOLDER: &str = "FORMATS_TEST_FOLDER";

/// The task and folder a test on ranks was started with; `None` in an ordinary test run.
pub fn task() -> Option<(String, std::path::PathBuf)> {
    Some((env::var(TASK).ok()?, env::var_os(FOLDER)?.into()))
}

/// Runs `task` in `folder` on so many ranks; with 0, on one without mpirun. Fails if it fails, or takes five minutes.
pub fn run(task: &str, folder: &Path, ranks: usize) {
    let this = env::current_exe().unwrap();
    let mut command = match ranks {
        0 => Command::new(&this),
        n => {
            let mut command = Command::new("mpirun");
            command.args(["-n", &n.to_string()]).arg(&this);
            command
        }
    };
    let log = folder.join(format!("log-{task}-{ranks}"));
    let file = fs::File::create(&log).unwrap();
    command.args(["--exact", "on_ranks", "--nocapture", "--test-threads=1"]).env(TASK, task).env(FOLDER, folder);
    let mut child = command.stdout(file.try_clone().unwrap()).stderr(file).spawn().unwrap();
    let end = Instant::now() + Duration::from_secs(300);
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status.to_string();
        }
        if Instant::now() > end {
            child.kill().unwrap();
            child.wait().unwrap();
            break "still running after five minutes".into();
        }
        thread::sleep(Duration::from_millis(10));
    };
    let text = fs::read_to_string(&log).unwrap();
    assert!(status == "exit status: 0", "task {task} on {ranks} ranks: {status}\n{text}");
}

/// A header of `count` particles, with numbers that have no short decimal form.
pub fn header(count: u64) -> Header {
    Header {
        title: "Säule, a = 1".into(),
        scene_hash: formats::provenance::sha256(b"scene"),
        space: Space::Axisymmetric,
        kernel: Kernel::WendlandC2,
        spacing: 0.1 + 0.2,
        h: 1.0 / 3.0,
        gravity: [0.0, -0.0, -9.81],
        time: 1e-3 / 7.0,
        step: 41,
        count,
    }
}

/// The rows of one rank, made from the row numbers alone.
pub fn rows(count: u64, rank: u64, size: u64) -> Rows {
    let range = share(count, rank, size);
    let number = |row: u64, salt: u64| ((row * 31 + salt) as f64).sin() / 3.0;
    let ids: Vec<u64> = range.clone().collect();
    let scalar = |salt: u64| ids.iter().map(|&row| number(row, salt)).collect();
    let vector = |salt: u64| ids.iter().map(|&row| [0, 1, 2].map(|k| number(row, salt + k))).collect();
    Rows {
        first: range.start,
        body: ids.iter().map(|row| row % 2).collect(),
        position: vector(1),
        velocity: ids.iter().map(|_| [0.0, -0.0, 1e-310]).collect(),
        acceleration: vector(7),
        mass: scalar(10),
        density: scalar(11),
        stress: ids.iter().map(|&row| [0, 1, 2, 3, 4, 5].map(|k| number(row, 12 + k))).collect(),
        stress_work: scalar(19),
        viscous_work: scalar(20),
        plastic_strain: scalar(18),
        id: ids.clone(),
    }
}
