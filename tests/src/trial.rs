//! What tests that stop, kill or damage a run share: a scene with its uninterrupted answer, folders to compute it in
//! again, and means to do something to a run under way.

use crate::shim::{self, Fault};
use crate::{Output, TIME_LIMIT, WorkFolder, assert_same_bits, command, computed, run, run_within};
use formats::checkpoint;
use formats::folder::RunFolder;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};
use std::{fs, process, thread};

/// Short scenes, one a space: a few hundred particles and steps, well below a second on one rank. The last interval of
/// each output is shorter than the others.
pub mod short {
    /// A column that is thrown off its plane of symmetry against a smooth wall.
    pub const PLANE: &str = r#"
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
box = { min = [0, 0, 0], max = ["0.2 m", 0, "0.3 m"] }
velocity = ["1 m/s", 0, 0]
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[wall.side]
axis = "x"
at = "0.26 m"
side = "below"
slip = "free-slip"
[numerics]
courant = 0.6
[end]
time = "150 ms"
[output]
snapshots = "40 ms"
history = "7 ms"
"#;

    /// A jittered column around the axis.
    pub const RINGS: &str = r#"
space = "axisymmetric"
spacing = "20 mm"
[material.drucker-prager]
density = "2600 kg/m3"
young = "0.4 MPa"
poisson = 0.3
friction = "25 deg"
cohesion = "0 Pa"
[body.column]
cylinder = { radius = "0.2 m", height = "0.3 m" }
velocity = ["0.5 m/s", 0, 0]
[initial]
jitter = 0.05
seed = 3
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "150 ms"
[output]
snapshots = "40 ms"
history = "7 ms"
"#;

    /// A quarter of a cylinder between two planes of symmetry.
    pub const SOLID: &str = r#"
space = "3d"
spacing = "20 mm"
symmetry = ["x", "y"]
[material.drucker-prager]
density = "2600 kg/m3"
young = "0.4 MPa"
poisson = 0.3
friction = "25 deg"
cohesion = "0 Pa"
[body.column]
cylinder = { radius = "0.1 m", height = "0.16 m" }
velocity = ["0.8 m/s", "0.3 m/s", 0]
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[numerics]
courant = 0.6
[end]
time = "150 ms"
[output]
snapshots = "40 ms"
history = "7 ms"
"#;
}

/// One scene, its answer by one rank, and folders to compute it in again.
#[derive(Debug)]
pub struct Trial {
    /// Everything of this trial lies in it.
    pub work: WorkFolder,
    /// The uninterrupted run.
    pub reference: RunFolder,
}

impl Trial {
    /// Computes the scene once, on one rank.
    #[track_caller]
    pub fn new(scene: &str) -> Self {
        Self::within(WorkFolder::new(), scene)
    }

    /// The same, with its folders in memory.
    #[track_caller]
    pub fn in_memory(scene: &str) -> Self {
        Self::within(WorkFolder::in_memory(), scene)
    }

    #[track_caller]
    fn within(work: WorkFolder, scene: &str) -> Self {
        let reference = computed(&work, "one", scene, 1);
        let steps = steps(&reference);
        assert!((120..2000).contains(&steps), "{steps} steps are not a test");
        Self { work, reference }
    }

    /// A folder with the reference's particles, as `sph-prep` leaves it.
    pub fn fresh(&self, name: &str) -> RunFolder {
        let folder = RunFolder::new(self.work.join(name));
        fs::create_dir(folder.path()).unwrap();
        for file in [RunFolder::scene, RunFolder::initial, RunFolder::provenance] {
            fs::copy(file(&self.reference), file(&folder)).unwrap();
        }
        let [from, to] = [self.reference.path(), folder.path()].map(formats::scene::Sources::folder);
        if from.exists() {
            fs::create_dir(&to).unwrap();
            for entry in fs::read_dir(from).unwrap().flatten() {
                fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
            }
        }
        folder
    }

    /// Fails unless the run is done and left the same bits as the reference, file by file.
    #[track_caller]
    pub fn same(&self, folder: &RunFolder) {
        assert!(folder.done().exists());
        assert_same_bits(&self.reference, folder);
        let (here, there) = (outputs(&self.reference), outputs(folder));
        assert_eq!(here.keys().collect::<Vec<_>>(), there.keys().collect::<Vec<_>>());
        for (name, hash) in &here {
            assert_eq!(*hash, there[name], "{name:?}: the bytes differ in {}", folder.path().display());
        }
    }

    /// Goes on in a folder. `extra` are options of `sph-run`.
    #[track_caller]
    pub fn go(&self, folder: &RunFolder, ranks: usize, extra: &[&str], code: i32) -> Output {
        launch(folder, ranks, extra).expect(code)
    }
}

/// Starts `sph-run` in a folder. `extra` are its options.
pub fn launch(folder: &RunFolder, ranks: usize, extra: &[&str]) -> Output {
    let mut arguments = vec![folder.path().as_os_str()];
    arguments.extend(extra.iter().map(OsStr::new));
    run("sph-run", &arguments, ranks)
}

/// Time a launch of a short scene may take under a fault before it counts as hanging: a second or two on a machine
/// that has nothing else to do.
pub const HANGS: Duration = Duration::from_secs(60);

/// Starts `sph-run` in a folder with a fault, which must strike, and may not hang. Returns also what struck.
#[track_caller]
pub fn strike(folder: &RunFolder, ranks: usize, extra: &[&str], fault: &Fault) -> (Output, Vec<String>) {
    let log = folder.path().with_extension("struck");
    let _ = fs::remove_file(&log);
    let mut arguments = vec![folder.path().as_os_str()];
    arguments.extend(extra.iter().map(OsStr::new));
    let mut command = command("sph-run", &arguments, ranks);
    fault.put(&mut command, &shim::library(), folder.path(), &log).expect("the folder is there");
    let output = run_within(HANGS, &mut command);
    let struck = shim::struck(&log);
    assert!(!output.timed_out, "it hangs under {fault:?}: {struck:?}\n{output}");
    assert!(!struck.is_empty(), "there was no such call: {fault:?}\n{output}");
    (output, struck)
}

/// The calls a launch makes, of all ranks, in the order they began. `kinds` as in [`Fault`].
#[track_caller]
pub fn calls(folder: &RunFolder, ranks: usize, extra: &[&str], kinds: &str, code: i32) -> Vec<shim::Call> {
    let log = folder.path().with_extension("calls");
    let mut arguments = vec![folder.path().as_os_str()];
    arguments.extend(extra.iter().map(OsStr::new));
    let mut command = command("sph-run", &arguments, ranks);
    Fault::count().of(kinds, "*").put(&mut command, &shim::library(), folder.path(), &log).expect("the folder");
    run_within(HANGS, &mut command).expect(code);
    shim::calls(&log)
}

/// Number and step of the newest generation, which must be sound; 0, 0 where there is none.
#[track_caller]
pub fn newest(folder: &RunFolder) -> (u64, u64) {
    let found = checkpoint::latest(folder).unwrap_or_else(|error| panic!("{error}"));
    let Some(found) = found else { return (0, 0) };
    assert!(found.warnings.is_empty(), "a newer generation is damaged: {:?}", found.warnings);
    (found.manifest.generation, found.manifest.step)
}

/// Steps of a run, from the last line of its history.
pub fn steps(folder: &RunFolder) -> u64 {
    let history = fs::read_to_string(folder.history()).unwrap();
    history.lines().last().and_then(|line| line.split(',').nth(1)?.parse().ok()).expect("a second column")
}

/// A copy of a run folder, beside it.
pub fn copy(folder: &RunFolder, name: &str) -> RunFolder {
    let copied = RunFolder::new(folder.path().with_file_name(name));
    let status = process::Command::new("cp").arg("-r").arg(folder.path()).arg(copied.path()).status();
    assert!(status.expect("cp starts").success());
    copied
}

/// SHA-256 of a file's bytes.
pub fn hash(path: &Path) -> String {
    formats::provenance::sha256(&fs::read(path).unwrap())
}

/// Hashes of the bytes of every file in `out/` and below, by its path in there.
pub fn outputs(folder: &RunFolder) -> BTreeMap<PathBuf, String> {
    let name = |path: &Path| path.strip_prefix(folder.out()).expect("it lies in out/").to_path_buf();
    state(&folder.out()).into_keys().map(|path| (name(&path), hash(&path))).collect()
}

/// Every file below a folder, its length and when it was written.
pub fn state(folder: &Path) -> BTreeMap<PathBuf, (u64, SystemTime)> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let facts = fs::metadata(&path).unwrap();
        if facts.is_dir() {
            found.extend(state(&path));
        } else {
            found.insert(path, (facts.len(), facts.modified().unwrap()));
        }
    }
    found
}

/// Starts a run with a checkpoint every 20 steps and, once there are two, does something to it.
pub fn while_running(folder: &RunFolder, ranks: usize, act: impl FnOnce(&RunFolder) + Send) -> Output {
    let arguments = [folder.path().as_os_str(), "--checkpoint-every".as_ref(), "20steps".as_ref()];
    let manifest = folder.generation(2).join("MANIFEST.json");
    meanwhile(command("sph-run", &arguments, ranks), || manifest.exists(), || act(folder))
}

/// Runs a command and, once something is so, does something. Fails the test where it is not so within a minute.
#[track_caller]
pub fn meanwhile(mut command: process::Command, so: impl Fn() -> bool + Send, act: impl FnOnce() + Send) -> Output {
    thread::scope(|scope| {
        scope.spawn(|| {
            assert!(appears(Duration::from_secs(60), so), "not within a minute");
            act();
        });
        run_within(TIME_LIMIT, &mut command)
    })
}

/// Waits until something is so; `false` where it is not within the limit.
pub fn appears(limit: Duration, so: impl Fn() -> bool) -> bool {
    let deadline = Instant::now() + limit;
    while !so() {
        if Instant::now() > deadline {
            return false;
        }
        thread::sleep(Duration::from_millis(2));
    }
    true
}

/// Processes of a program that name this folder in their arguments; at least one.
///
/// # Panics
/// If there is none.
pub fn processes(folder: &Path, program: &str) -> Vec<u32> {
    let found = running(folder, program);
    assert!(!found.is_empty(), "no {program} runs in {}", folder.display());
    found
}

/// As [`processes`], where there may be none.
pub fn running(folder: &Path, program: &str) -> Vec<u32> {
    let numbers = fs::read_dir("/proc").unwrap().filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok());
    let matches = |pid: &u32| {
        let Ok(line) = fs::read(format!("/proc/{pid}/cmdline")) else { return false };
        let arguments: Vec<&[u8]> = line.split(|&byte| byte == 0).collect();
        let name = Path::new(OsStr::from_bytes(arguments[0])).file_name();
        name == Some(OsStr::new(program)) && arguments.contains(&folder.as_os_str().as_bytes())
    };
    numbers.filter(matches).collect()
}

/// Sends a signal, by its name without SIG, to a process that is there.
pub fn signal(name: &str, process: u32) {
    let status = process::Command::new("kill").args(["-s", name, &process.to_string()]).status();
    assert!(status.expect("kill starts").success());
}
