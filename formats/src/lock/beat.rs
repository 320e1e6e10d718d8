//! The beat of a lock: its file changes as long as its holder lives.

use super::file::{self, Found};
use super::holder::Holder;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime};

/// A thread that renews a lock until it is stopped or finds that the lock is no longer its own.
#[derive(Debug)]
pub(super) struct Heart {
    state: Arc<State>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct State {
    stop: Mutex<bool>,
    stopped: Condvar,
    lost: AtomicBool,
}

impl Heart {
    /// Begins to beat in the file of a lock that is held.
    pub(super) fn start(path: &Path, holder: &Holder) -> io::Result<Self> {
        let state = Arc::<State>::default();
        let mut beats = Beats {
            // Opened once: opened again at each beat it could be the file of somebody who has just taken the lock over.
            file: File::options().write(true).open(path)?,
            path: path.into(),
            holder: holder.clone(),
            count: 0,
        };
        let shared = Arc::clone(&state);
        let period = Duration::from_millis(holder.beat_milliseconds);
        let thread = thread::Builder::new().name("lock".into()).spawn(move || {
            while shared.wait(period) {
                if !beats.beat() {
                    shared.lost.store(true, Ordering::Relaxed);
                    return;
                }
            }
        })?;
        Ok(Self { state, thread: Some(thread) })
    }

    /// Was the lock found to be somebody else's?
    pub(super) fn lost(&self) -> bool {
        self.state.lost.load(Ordering::Relaxed)
    }

    /// Stops and closes the file.
    pub(super) fn stop(&mut self) {
        *self.state.stop.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.state.stopped.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Heart {
    fn drop(&mut self) {
        self.stop();
    }
}

impl State {
    /// Waits for the next beat; false if there is none.
    fn wait(&self, period: Duration) -> bool {
        let stop = self.stop.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.stopped.wait_timeout_while(stop, period, |stop| !*stop);
        !*waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

struct Beats {
    file: File,
    path: PathBuf,
    holder: Holder,
    count: u64,
}

impl Beats {
    /// Renews the lock. False if it is no longer ours.
    fn beat(&mut self) -> bool {
        match file::look(&self.path) {
            Ok(Some(found)) if found.is_of(&self.holder) => {
                self.count += 1;
                // Two signs: the time of change waits for no data that is on its way to the disk, and the number also
                // tells where times are coarse. Where one fails, on a full disk, say, the other may not.
                let _ = self.file.set_modified(SystemTime::now());
                let written = self.file.write_all_at(&file::count(self.count), found.count_at());
                let _ = written.and_then(|()| self.file.sync_data());
                true
            }
            Ok(_) => false,
            // The file system is away: once it is back the next beat tells.
            Err(_) => true,
        }
    }
}

impl Found {
    /// Where the number of beats stands.
    fn count_at(&self) -> u64 {
        (self.bytes.len() - file::AFTER_COUNT.len() - file::count(0).len()) as u64
    }
}
