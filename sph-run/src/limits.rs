//! Requests to stop early: signals, a stop file, a number of steps.

use formats::folder::RunFolder;
use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What may end a run before its time. Each rank has one: a signal can reach any of them.
#[derive(Debug)]
pub struct Limits {
    signalled: Arc<AtomicBool>,
    stop_file: std::path::PathBuf,
    looked: Instant,
    found: bool,
}

impl Limits {
    /// Catches USR1, TERM and INT from now on. Call it before MPI starts: a signal before that kills the process.
    pub fn watch_signals() -> Arc<AtomicBool> {
        let signalled = Arc::new(AtomicBool::new(false));
        for signal in [SIGUSR1, SIGTERM, SIGINT] {
            // Fails for forbidden signals only, which these are not.
            let _ = signal_hook::flag::register(signal, Arc::clone(&signalled));
        }
        signalled
    }

    /// Also watches the stop file of a run folder.
    pub fn new(signalled: Arc<AtomicBool>, folder: &RunFolder) -> Self {
        Self { signalled, stop_file: folder.stop(), looked: Instant::now(), found: false }
    }

    /// Was this rank asked to stop? Looks for the file at most twice a second, and only where `may_look`.
    pub fn stop(&mut self, may_look: bool) -> bool {
        if may_look && !self.found && self.looked.elapsed() > Duration::from_millis(500) {
            self.looked = Instant::now();
            self.found = self.stop_file.exists();
        }
        self.found || self.signalled.load(Ordering::Relaxed)
    }
}
