//! Starting programs, on one rank or on many.

use crate::failure::Failure;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use xshell::{Cmd, Shell, cmd};

/// Below this many particles a rank costs more than it brings.
const PARTICLES_PER_RANK: u64 = 1000;

/// A shell whose commands run at the repository's root.
pub fn shell() -> Result<Shell, Failure> {
    let shell = Shell::new()?;
    shell.change_dir(crate::paths::repository());
    Ok(shell)
}

/// How many ranks to start: as many as asked for, else one a core, but no more than the scene can feed.
pub fn ranks(asked: Option<u32>, particles: u64) -> u32 {
    let fed = u32::try_from(particles / PARTICLES_PER_RANK).unwrap_or(u32::MAX).max(1);
    asked.unwrap_or_else(|| cores().min(fed))
}

/// Physical cores this process may use: two threads of a core gain nothing in the pair sums.
pub fn cores() -> u32 {
    let usable = std::thread::available_parallelism().map_or(1, |n| n.get());
    let mut physical = std::collections::HashSet::new();
    for entry in std::fs::read_dir("/sys/devices/system/cpu").into_iter().flatten().flatten() {
        if let Ok(siblings) = std::fs::read_to_string(entry.path().join("topology/thread_siblings_list")) {
            physical.insert(siblings);
        }
    }
    let cores = if physical.is_empty() { usable } else { usable.min(physical.len()) };
    u32::try_from(cores).unwrap_or(1)
}

/// The command that starts `program` on `ranks` ranks: under the words of TALUS_MPIRUN (`srun --mpi=pmix`), else
/// `mpirun`, which one rank does without.
pub fn parallel<'a>(shell: &'a Shell, program: &Path, ranks: u32) -> Cmd<'a> {
    let words = launcher();
    let ranks_word = ranks.to_string();
    match words.split_first() {
        Some((launcher, options)) => cmd!(shell, "{launcher} {options...} -n {ranks_word} {program}"),
        None if ranks == 1 => cmd!(shell, "{program}"),
        None => cmd!(shell, "mpirun -n {ranks_word} {program}"),
    }
}

/// The words of TALUS_MPIRUN; none where it is not set.
pub fn launcher() -> Vec<String> {
    let words = std::env::var("TALUS_MPIRUN").unwrap_or_default();
    words.split_whitespace().map(str::to_owned).collect()
}

/// How a program ended.
#[derive(Clone, Copy, Debug)]
pub struct End {
    /// Its status.
    pub status: ExitStatus,
    /// Was this process told to stop meanwhile?
    pub interrupted: bool,
}

/// What a request to stop (an interrupt from the keyboard, or SIGTERM) does to a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// It is ended.
    AtOnce,
    /// It gets SIGUSR1, which mpirun hands to all ranks and `sph-run` answers with a checkpoint. It runs in a process
    /// group of its own, because mpirun kills its ranks a second after an interrupt. A second request ends it.
    Gently,
}

/// Starts a program and waits for it. What it writes to standard output goes to standard error: there only the
/// workflow's own result paths belong. This process outlives requests to stop, so that it can say how to go on.
pub fn wait(command: Cmd<'_>, stop: Stop) -> Result<End, Failure> {
    wait_with(command, stop, None)
}

/// The same; with a log, both outputs go to the end of that file.
pub fn wait_with(command: Cmd<'_>, stop: Stop, log: Option<&Path>) -> Result<End, Failure> {
    let name = command.to_string();
    let cannot = |what: &str, e: std::io::Error| Failure::no_input(format!("cannot {what} `{name}`: {e}"));
    let requested = Arc::new(AtomicBool::new(false));
    let watch = |signal| signal_hook::flag::register(signal, Arc::clone(&requested)).map_err(|e| cannot("start", e));
    let watches = [watch(SIGINT)?, watch(SIGTERM)?];
    let mut command = Command::from(command);
    match log {
        None => command.stdout(Stdio::from(std::io::stderr())),
        Some(log) => {
            let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", log.display()));
            let file = std::fs::File::options().create(true).append(true).open(log).map_err(fault)?;
            command.stdout(file.try_clone().map_err(fault)?).stderr(file)
        }
    };
    if stop == Stop::Gently {
        command.process_group(0).stdin(Stdio::null());
    }
    let mut child = command.spawn().map_err(|e| cannot("start", e))?;
    let mut requests = 0;
    let status = loop {
        if let Some(status) = child.try_wait().map_err(|e| cannot("wait for", e))? {
            break status;
        }
        if requested.swap(false, Ordering::Relaxed) {
            requests += 1;
            let gently = stop == Stop::Gently && requests == 1;
            if gently {
                eprintln!("talus: stopping after a checkpoint; once more stops at once");
            }
            let signal = if gently { "-USR1" } else { "-TERM" };
            // The child may have ended by itself just now: then there is nobody to tell.
            let _ = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status();
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    for watch in watches {
        signal_hook::low_level::unregister(watch);
    }
    Ok(End { status, interrupted: requests > 0 || requested.load(Ordering::Relaxed) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_scenes_get_few_ranks() {
        assert_eq!(ranks(None, 10), 1);
        assert_eq!(ranks(None, 999), 1);
        assert!(ranks(None, u64::MAX) >= 1);
        assert_eq!(ranks(Some(7), 10), 7);
    }
}
