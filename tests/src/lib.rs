//! What tests of the programs share: building and finding them, work folders, running on ranks with a time limit, and
//! comparing results.

pub mod damage;
pub mod python;
pub mod rasters;
pub mod shim;
pub mod solids;
pub mod trial;

use formats::{folder::RunFolder, snapshot};
use std::ffi::OsStr;
use std::io::{Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Time a program may take unless a test says otherwise: generous, for loaded machines.
pub const TIME_LIMIT: Duration = Duration::from_secs(240);

/// The root of the repository.
pub fn repository() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().expect("the package lies in the repository").to_path_buf()
}

/// The target folder this test was built in, and its profile's folder in it.
pub fn target() -> (PathBuf, PathBuf) {
    let own = std::env::current_exe().expect("a test knows its own path");
    let profile = own.parent().and_then(Path::parent).expect("<target>/<profile>/deps/<test>").to_path_buf();
    (profile.parent().expect("<target>/<profile>").to_path_buf(), profile)
}

/// Path of `sph-prep`, `sph-run` or `sph-post`. They belong to other packages, so cargo does not build them for these
/// tests by itself: the first call does, in the profile and the target folder of the test. Cargo's own lock keeps
/// tests in other processes waiting meanwhile.
pub fn program(name: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| build(&["--bins"])).join(name)
}

/// Path of `workflows`, which `./talus` starts. As [`program`].
pub fn workflows() -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| build(&["--bins"])).join("workflows")
}

/// Has cargo build what the words say, in the profile and the target folder of the test; returns the profile's folder.
fn build(what: &[&str]) -> PathBuf {
    let (target, folder) = target();
    let profile = match folder.file_name().and_then(OsStr::to_str) {
        Some("debug") | None => "dev",
        Some(name) => name,
    };
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        // With the features of the whole workspace, as the tests are built: nothing is built twice.
        .args(["build", "--quiet", "--workspace", "--profile", profile])
        .args(what)
        .arg("--target-dir")
        .arg(target)
        .current_dir(repository())
        .output()
        .expect("cargo starts");
    assert!(output.status.success(), "the programs do not build:\n{}", String::from_utf8_lossy(&output.stderr));
    folder
}

/// Says that a test, or a part of it, is left out, and why. Straight to standard error: `cargo test` shows it at once,
/// because it captures the print macros only; nextest shows it at the end, as .config/nextest.toml has it.
pub fn left_out(reason: &str) {
    let name = std::thread::current().name().unwrap_or("a test").to_owned();
    // Nobody to tell where standard error is closed.
    let _ = writeln!(std::io::stderr(), "LEFT OUT: {name}: {reason}");
}

/// Fails the test where a program it needs is not on the path. `package`: what it is in.
#[track_caller]
pub fn expect_program(name: &str, package: &str) {
    let found = std::env::var_os("PATH")
        .is_some_and(|path| std::env::split_paths(&path).any(|folder| folder.join(name).is_file()));
    assert!(found, "{name} is not on the path; this test needs {package}, which `./talus test` installs where it may");
}

/// A folder that is removed with all it holds, kept where the test fails and TALUS_KEEP is set.
#[derive(Debug)]
pub struct WorkFolder(Option<tempfile::TempDir>);

impl WorkFolder {
    /// A new, empty folder.
    #[allow(clippy::new_without_default)]
    pub fn new() -> Self {
        Self(Some(tempfile::Builder::new().prefix("talus-").tempdir().expect("a temporary folder")))
    }
    /// The same in memory where the system has a place for that: many short runs that write much wait less.
    pub fn in_memory() -> Self {
        let made = tempfile::Builder::new().prefix("talus-").tempdir_in("/dev/shm");
        made.map_or_else(|_| Self::new(), |folder| Self(Some(folder)))
    }
    /// The folder.
    pub fn path(&self) -> &Path {
        self.0.as_ref().expect("there until it is dropped").path()
    }
    /// A path in it.
    pub fn join(&self, name: impl AsRef<Path>) -> PathBuf {
        self.path().join(name)
    }
    /// A file in it, written.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.join(name);
        std::fs::write(&path, text).expect("a file in the work folder");
        path
    }
}

impl Drop for WorkFolder {
    fn drop(&mut self) {
        if std::thread::panicking() && std::env::var_os("TALUS_KEEP").is_some() {
            let kept = self.0.take().map(tempfile::TempDir::keep);
            eprintln!("kept: {kept:?}");
        }
    }
}

/// What a program left.
#[derive(Clone, Debug)]
pub struct Output {
    /// Exit code; 128 plus the signal where one ended it.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
    /// Was it ended at the time limit?
    pub timed_out: bool,
}

impl Output {
    /// Fails the test with all that was said unless the code is the expected one.
    #[track_caller]
    pub fn expect(self, code: i32) -> Self {
        assert!(!self.timed_out, "the time limit was reached: {self}");
        assert_eq!(self.code, code, "{self}");
        self
    }
}

impl std::fmt::Display for Output {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "exit code {}\n--- stdout\n{}\n--- stderr\n{}", self.code, self.stdout, self.stderr)
    }
}

/// Runs one of the three programs on a number of ranks; 0: without mpirun.
pub fn run<A: AsRef<OsStr>>(name: &str, arguments: &[A], ranks: usize) -> Output {
    run_within(TIME_LIMIT, ends_by_itself(&mut command(name, arguments, ranks)))
}

/// For a command that nobody stops half way: where it fails, mpirun does not wait two seconds for ranks that are to end, as it
/// does otherwise. They have ended by themselves: all leave together, after what they had to say.
pub fn ends_by_itself(command: &mut Command) -> &mut Command {
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "0")
}

/// The command [`run`] would start, for tests that change its environment or stop it half way.
pub fn command<A: AsRef<OsStr>>(name: &str, arguments: &[A], ranks: usize) -> Command {
    let program = program(name);
    let mut command = match ranks {
        0 => Command::new(program),
        ranks => {
            let mut command = Command::new("mpirun");
            command.args(["-n", &ranks.to_string()]).arg(program);
            command
        }
    };
    // As .cargo/config.toml has it, for tests that are not started by cargo.
    for name in ["OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"] {
        command.env(name, "1");
    }
    // As `./talus test` has it, for tests that it did not start.
    for (name, value) in [("OMPI_MCA_pml", "ob1"), ("OMPI_MCA_mpi_yield_when_idle", "1")] {
        if std::env::var_os(name).is_none() {
            command.env(name, value);
        }
    }
    // Two jobs bound to the same cores would wait for each other.
    command.env("OMPI_MCA_hwloc_base_binding_policy", "none");
    command.args(arguments);
    command
}

/// Runs a command in a process group of its own, one at a time in this process; at the limit the whole group is ended.
pub fn run_within(limit: Duration, command: &mut Command) -> Output {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn()
        .unwrap_or_else(|e| panic!("cannot start {command:?}: {e}"));
    let stdout = collect(child.stdout.take().expect("piped"));
    let stderr = collect(child.stderr.take().expect("piped"));
    let (started, mut signals) = (Instant::now(), ["-TERM", "-KILL"].iter());
    let (mut timed_out, mut deadline) = (false, limit);
    let status = loop {
        if let Some(status) = child.try_wait().expect("a child can be waited for") {
            break status;
        }
        if started.elapsed() > deadline {
            // TERM first: mpirun's ranks are in groups of their own, and mpirun ends them only if it may.
            timed_out = true;
            deadline += Duration::from_secs(5);
            if let Some(signal) = signals.next() {
                let _ = Command::new("kill").args([signal, "--"]).arg(format!("-{}", child.id())).status();
            }
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let text = |thread: std::thread::JoinHandle<Vec<u8>>| {
        String::from_utf8_lossy(&thread.join().expect("a reader does not panic")).into_owned()
    };
    let code = status.code().or_else(|| status.signal().map(|signal| 128 + signal)).expect("code or signal");
    Output { code, stdout: text(stdout), stderr: text(stderr), timed_out }
}

fn collect(mut pipe: impl Read + Send + 'static) -> std::thread::JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = pipe.read_to_end(&mut bytes);
        bytes
    })
}

/// Prepares, computes and evaluates a scene in `work/<name>`; every stage must succeed.
#[track_caller]
pub fn whole_run(work: &WorkFolder, name: &str, scene: &str, ranks: usize) -> RunFolder {
    let folder = computed(work, name, scene, ranks);
    run("sph-post", &[folder.path()], 0).expect(formats::exit::DONE);
    folder
}

/// Prepares and computes a scene in `work/<name>`; both stages must succeed.
#[track_caller]
pub fn computed(work: &WorkFolder, name: &str, scene: &str, ranks: usize) -> RunFolder {
    let folder = prepared(work, name, scene, ranks);
    run("sph-run", &[folder.path()], ranks).expect(formats::exit::DONE);
    folder
}

/// Prepares a scene in `work/<name>`.
#[track_caller]
pub fn prepared(work: &WorkFolder, name: &str, scene: &str, ranks: usize) -> RunFolder {
    let file = work.write(&format!("{name}.toml"), scene);
    let folder = RunFolder::new(work.join(name));
    run("sph-prep", &[file.as_os_str(), OsStr::new("-o"), folder.path().as_os_str()], ranks)
        .expect(formats::exit::DONE);
    folder
}

/// Snapshots of a run in order: file name and digest, which does not depend on the number of ranks.
pub fn digests(folder: &RunFolder) -> Vec<(String, String)> {
    let entries = std::fs::read_dir(folder.out()).expect("a run has out/");
    let paths = entries.map(|entry| entry.expect("an entry of out/").path());
    let mut files: Vec<PathBuf> = paths.filter(|path| path.extension() == Some(OsStr::new("hdf"))).collect();
    files.sort();
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    files.iter().map(|path| (name(path), snapshot::digest(path).expect("a snapshot can be read"))).collect()
}

/// Fails unless two runs left the same bits: every snapshot and the history.
#[track_caller]
pub fn assert_same_bits(a: &RunFolder, b: &RunFolder) {
    let (here, there) = (digests(a), digests(b));
    assert!(!here.is_empty(), "{}: no snapshots", a.path().display());
    let names = |list: &[(String, String)]| list.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&here), names(&there));
    for ((name, one), (_, other)) in here.iter().zip(&there) {
        assert_eq!(one, other, "{name} differs between {} and {}", a.path().display(), b.path().display());
    }
    let history = |folder: &RunFolder| std::fs::read_to_string(folder.history()).expect("a run has a history");
    let (one, other) = (history(a), history(b));
    for (number, (left, right)) in one.lines().zip(other.lines()).enumerate() {
        assert_eq!(left, right, "line {} of the histories", number + 1);
    }
    assert_eq!(one.lines().count(), other.lines().count(), "lines of the histories");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_that_hangs_is_ended_with_its_children() {
        let work = WorkFolder::new();
        let file = work.join("pid");
        let script = format!("sleep 100 & echo $! > {}; echo said; wait", file.display());
        let output = run_within(Duration::from_millis(300), Command::new("sh").args(["-c", &script]));
        assert!(output.timed_out && output.stdout == "said\n", "{output}");
        let pid = std::fs::read_to_string(file).unwrap();
        std::thread::sleep(Duration::from_millis(200));
        let alive = std::fs::read_to_string(format!("/proc/{}/stat", pid.trim()));
        assert!(alive.map_or(true, |stat| stat.contains(") Z ")), "the child is still there");
    }

    #[test]
    fn codes_and_text_come_back() {
        let output = run_within(TIME_LIMIT, Command::new("sh").args(["-c", "echo out; echo err >&2; exit 65"]));
        assert_eq!((output.code, &*output.stdout, &*output.stderr), (65, "out\n", "err\n"));
        assert_eq!(run_within(TIME_LIMIT, Command::new("sh").args(["-c", "kill -9 $$"])).code, 137);
    }
}
