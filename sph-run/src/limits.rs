//! Requests to stop early: signals, a stop file.

use formats::folder::RunFolder;
use serde::{Deserialize, Serialize};
use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Why a run ends before its time. Where several apply, on one rank or on different ones, the largest counts: what a
/// person or a scheduler asked for comes before what a launch was told at its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// The number of steps of this launch is done.
    Steps = 1,
    /// The wall time of the job is nearly used up.
    WallLimit = 2,
    /// A file named STOP appeared in the run folder.
    StopFile = 3,
    /// TERM, INT, USR1 or USR2 came.
    Signal = 4,
}

impl Reason {
    const ALL: [Self; 4] = [Self::Steps, Self::WallLimit, Self::StopFile, Self::Signal];

    /// A number above 0 for reductions by maximum.
    pub fn code(self) -> u8 {
        self as u8
    }
    /// The reason with this number; none for 0.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|reason| reason.code() == code)
    }
    /// Its name in files: `steps`, `wall-limit`, `stop-file`, `signal`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Steps => "steps",
            Self::WallLimit => "wall-limit",
            Self::StopFile => "stop-file",
            Self::Signal => "signal",
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What may end a run before its time. Each rank has one: a signal can reach any of them.
#[derive(Debug)]
pub struct Limits {
    signalled: Arc<AtomicBool>,
    stop_file: PathBuf,
    looked: Instant,
    found: bool,
}

impl Limits {
    /// Catches USR1, USR2, TERM and INT from now on. Call it before MPI starts: a signal before that kills the process.
    /// USR2 is what LSF sends at the run limit.
    pub fn watch_signals() -> Arc<AtomicBool> {
        let signalled = Arc::new(AtomicBool::new(false));
        for signal in [SIGUSR1, SIGUSR2, SIGTERM, SIGINT] {
            // Fails for forbidden signals only, which these are not.
            let _ = signal_hook::flag::register(signal, Arc::clone(&signalled));
        }
        signalled
    }

    /// Also watches the stop file of a run folder.
    pub fn new(signalled: Arc<AtomicBool>, folder: &RunFolder) -> Self {
        Self { signalled, stop_file: folder.stop(), looked: Instant::now(), found: false }
    }

    /// Was this rank asked to stop, and by whom? Looks for the file at most twice a second, and only where `may_look`.
    pub fn reason(&mut self, may_look: bool) -> Option<Reason> {
        if may_look && !self.found && self.looked.elapsed() > Duration::from_millis(500) {
            self.looked = Instant::now();
            self.found = self.stop_file.exists();
        }
        if self.signalled.load(Ordering::Relaxed) {
            return Some(Reason::Signal);
        }
        self.found.then_some(Reason::StopFile)
    }
}

/// Removes a stop file that is there before a run starts: it was meant for an earlier launch. True if there was one.
/// Serial: one rank alone, which holds the lock.
pub fn clear_stale_stop_file(folder: &RunFolder) -> bool {
    std::fs::remove_file(folder.stop()).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread::sleep;

    fn wait() {
        sleep(Duration::from_millis(510));
    }

    #[test]
    fn reasons_survive_a_reduction() {
        for reason in Reason::ALL {
            assert_eq!(Reason::from_code(reason.code()), Some(reason));
            assert_eq!(serde_json::to_string(&reason).unwrap(), format!("\"{reason}\""));
        }
        assert_eq!(Reason::from_code(0), None);
        assert!(Reason::ALL.is_sorted_by_key(|reason| reason.code()) && Reason::ALL.is_sorted());
    }

    #[test]
    fn stop_file_is_seen_by_those_who_look_and_cleared() {
        let work = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(work.path());
        assert!(!clear_stale_stop_file(&folder));
        let mut limits = Limits::new(Arc::default(), &folder);
        std::fs::write(folder.stop(), "").unwrap();
        wait();
        assert_eq!(limits.reason(false), None);
        assert_eq!(limits.reason(true), Some(Reason::StopFile));
        assert!(limits.reason(false).is_some());
        assert!(clear_stale_stop_file(&folder) && !folder.stop().exists());
        let mut limits = Limits::new(Arc::default(), &folder);
        wait();
        assert_eq!(limits.reason(true), None);
    }

    #[test]
    fn signals_are_seen_on_any_rank() {
        let work = tempfile::tempdir().unwrap();
        for signal in [SIGUSR1, SIGUSR2, SIGTERM, SIGINT] {
            let mut limits = Limits::new(Limits::watch_signals(), &RunFolder::new(work.path()));
            assert_eq!(limits.reason(false), None);
            signal_hook::low_level::raise(signal).unwrap();
            assert_eq!(limits.reason(false), Some(Reason::Signal));
        }
    }
}
