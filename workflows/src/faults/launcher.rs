//! Starts programs that may hang, be killed, or leave others behind.

use crate::{failure::Failure, paths};
use std::fs::{self, File};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What a launch of a scene that takes a second may take before it counts as hanging.
pub const HANGS: Duration = Duration::from_secs(90);

/// How a launch ended.
#[derive(Clone, Debug)]
pub struct End {
    /// Exit code; 128 plus the signal where one ended it.
    pub code: i32,
    pub hung: bool,
    /// What it said, both outputs.
    pub said: String,
    /// Wall time.
    pub took: Duration,
}

/// A folder for the trials: in memory where the system has a place for that, because they write much.
pub fn work_folder() -> Result<PathBuf, Failure> {
    let name = format!("talus-faults-{}", std::process::id());
    let in_memory = Path::new("/dev/shm").join(&name);
    let folder = if fs::create_dir(&in_memory).is_ok() { in_memory } else { paths::runs().join(name) };
    fs::create_dir_all(&folder).map_err(|e| Failure::cannot_write(format!("{}: {e}", folder.display())))?;
    Ok(folder)
}

/// `sph-run` in a folder, alone or on several ranks.
pub fn sph_run(program: &Path, folder: &Path, ranks: usize, options: &[&str]) -> Command {
    let mut command = match ranks {
        0 | 1 => Command::new(program),
        ranks => {
            let mut command = Command::new("mpirun");
            command.args(["-n", &ranks.to_string()]).arg(program);
            command
        }
    };
    for name in ["OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"] {
        command.env(name, "1");
    }
    // Two jobs bound to the same cores would wait for each other.
    command.env("OMPI_MCA_hwloc_base_binding_policy", "none");
    // Ranks that are killed leave their shared memory behind: where it is removed with the trials.
    if let Some(work) = folder.parent() {
        command.env("OMPI_MCA_btl_vader_backing_directory", work);
    }
    // Ranks that wait for one that was killed as MPI started: well before that counts as a hang.
    command.arg(folder).args(["--mpi-patience", "30s"]).args(options);
    command
}

/// Runs a command in a process group of its own. `meanwhile` is asked all the time while it runs.
pub fn run(mut command: Command, folder: &Path, mut meanwhile: impl FnMut(Duration, u32)) -> Result<End, Failure> {
    let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", folder.display()));
    let said = folder.with_extension("said");
    let file = File::create(&said).map_err(fault)?;
    command.stdin(Stdio::null()).stdout(file.try_clone().map_err(fault)?).stderr(file).process_group(0);
    let mut child = command.spawn().map_err(|e| Failure::no_input(format!("cannot start {command:?}: {e}")))?;
    let (begun, mut hung) = (Instant::now(), false);
    let status = loop {
        if let Some(status) = child.try_wait().map_err(fault)? {
            break status;
        }
        if begun.elapsed() > HANGS && !hung {
            hung = true;
            kill(&[child.id()]);
            kill(&processes(folder));
        }
        meanwhile(begun.elapsed(), child.id());
        std::thread::sleep(Duration::from_millis(2));
    };
    // Ranks outlive an mpirun that was killed.
    let left = processes(folder);
    if !left.is_empty() {
        std::thread::sleep(Duration::from_millis(300));
        kill(&processes(folder));
    }
    let said =
        String::from_utf8_lossy(&fs::read(&said).map_err(fault)?).replace(&format!("{}", folder.display()), "RUN");
    Ok(End { code: crate::stage::code(status), hung, said, took: begun.elapsed() })
}

/// The ranks that work in a folder, rising.
pub fn processes(folder: &Path) -> Vec<u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let matches = |pid: &u32| {
        let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let mut arguments = line.split(|&byte| byte == 0);
        let first = arguments.next().unwrap_or_default();
        first.ends_with(b"/sph-run") && arguments.any(|argument| argument == folder.as_os_str().as_bytes())
    };
    let mut found: Vec<u32> =
        entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(matches).collect();
    found.sort_unstable();
    found
}

/// SIGKILL.
pub fn kill(processes: &[u32]) {
    if !processes.is_empty() {
        let names = processes.iter().map(ToString::to_string);
        // They may have ended by themselves just now.
        let _ = Command::new("kill").arg("-KILL").args(names).stderr(Stdio::null()).status();
    }
}

/// Copies a run folder.
pub fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    let fault = |path: &Path, e: std::io::Error| Failure::cannot_write(format!("{}: {e}", path.display()));
    fs::create_dir_all(to).map_err(|e| fault(to, e))?;
    for entry in fs::read_dir(from).map_err(|e| fault(from, e))? {
        let path = entry.map_err(|e| fault(from, e))?.path();
        let copied = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy(&path, &copied)?;
        } else {
            fs::copy(&path, &copied).map_err(|e| fault(&path, e))?;
        }
    }
    Ok(())
}
