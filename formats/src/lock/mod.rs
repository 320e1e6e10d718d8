//! One process at a time in a run folder, without `flock`, which network file systems do not keep reliably.
//!
//! A lock is a file that names its holder and that the holder changes every few seconds. The lock of a process of this
//! machine that has ended is taken over at once. A process elsewhere can't be asked: its lock is watched, and taken
//! over if it does not change. Whoever was silent so long, stopped or cut off, finds out with [`RunLock::still_ours`].

mod beat;
mod file;
mod holder;

use crate::exit;
use crate::snapshot::FileError;
use beat::Heart;
use file::{Found, Sign};
pub use holder::Holder;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long a lock of another machine is watched for a sign of life: longer than the minute for which clients of network
/// file systems may believe what they know of a file without asking, and a beat on top.
pub const PATIENCE: Duration = Duration::from_secs(75);
/// Beats of a holder in that time.
const BEATS: u32 = 5;

/// Why a lock was not taken, or was lost.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum LockError {
    /// Another process works in the folder.
    #[error("{path}: {holder} works in this folder since {}; wait until it has ended", holder.since)]
    Locked { path: String, holder: Box<Holder> },
    /// There is a lock that can't be understood, and that changes.
    #[error("{path}: held by a program of another version; wait until it has ended")]
    Unreadable { path: String },
    /// The lock is no longer held: this process was silent for too long, or somebody deleted the file.
    #[error("{path}: {}; this process writes nothing more", lost_to(.holder.as_deref()))]
    Lost { path: String, holder: Option<Box<Holder>> },
    /// The lock could not be written.
    #[error(transparent)]
    File(#[from] FileError),
}

fn lost_to(holder: Option<&Holder>) -> String {
    match holder {
        Some(holder) => format!("taken over by {holder} at {}, after no sign of life of this process", holder.since),
        None => "the lock was removed while this process worked in the folder".into(),
    }
}

impl LockError {
    /// The exit code of [`crate::exit`].
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::Locked { .. } | Self::Unreadable { .. } | Self::Lost { .. } => exit::LOCKED,
            Self::File(error) => error.exit_code(),
        }
    }
}

/// On what terms a lock is taken.
#[derive(Clone, Debug)]
pub struct Terms {
    /// How long to watch a lock of another machine. The own lock gives five beats in that time. Processes that share a
    /// folder need not agree: who beats slower is watched longer.
    pub patience: Duration,
    /// The batch job this process belongs to, for messages.
    pub job: Option<String>,
}

impl Default for Terms {
    fn default() -> Self {
        Self { patience: PATIENCE, job: None }
    }
}

/// A lock that is held; dropping it removes the file.
#[derive(Debug)]
pub struct RunLock {
    path: PathBuf,
    holder: Holder,
    heart: Heart,
}

impl RunLock {
    /// Takes the lock at `path` on the usual terms; says on standard error what it waits for. Serial: under MPI one
    /// rank alone.
    ///
    /// # Errors
    /// As [`RunLock::acquire_on`].
    pub fn acquire(path: &Path) -> Result<Self, LockError> {
        Self::acquire_on(path, &Terms::default(), |news| eprintln!("{news}"))
    }

    /// Takes the lock at `path`. `tell` gets a line for people before a wait and after a lock was taken over. Serial.
    ///
    /// # Errors
    /// `Locked` at once where the holder is known to live; `Unreadable`; `File` if the folder can't be written.
    pub fn acquire_on(path: &Path, terms: &Terms, mut tell: impl FnMut(&str)) -> Result<Self, LockError> {
        let mine = Holder::this(terms.job.clone(), terms.patience / BEATS);
        // More than once where others release, take over or give up just now.
        for _ in 0..100 {
            if file::create(path, &mine)? {
                return Self::held(path, mine);
            }
            let Some(found) = file::look(path)? else { continue };
            if !is_stale(path, &found, terms.patience, &mut tell)? {
                continue;
            }
            if file::replace(path, &found, &mine, terms.patience)? {
                tell(&format!("{}: taken over from {}, which no longer runs", path.display(), name(&found)));
                return Self::held(path, mine);
            }
        }
        Err(refused(path, file::look(path)?))
    }

    /// Is the lock still held by this process? Ask before anything is given its final name: a process that was stopped, or
    /// cut off from its files, may find another one at work. Reads one small file. Serial.
    ///
    /// # Errors
    /// `Lost`, and from then on always; `File` (exit code 73) if the lock can't be read.
    pub fn still_ours(&self) -> Result<(), LockError> {
        let found = file::look(&self.path).map_err(|error| match error {
            LockError::File(FileError::CannotRead { path, what }) => FileError::CannotWrite { path, what }.into(),
            other => other,
        })?;
        match found {
            Some(found) if found.is_of(&self.holder) && !self.heart.lost() => Ok(()),
            other => {
                let holder = other.and_then(|found| found.holder).filter(|holder| *holder != self.holder);
                Err(LockError::Lost { path: self.path.display().to_string(), holder: holder.map(Box::new) })
            }
        }
    }

    /// What the lock says of this process; its token tells this launch from any other.
    pub fn holder(&self) -> &Holder {
        &self.holder
    }

    fn held(path: &Path, holder: Holder) -> Result<Self, LockError> {
        file::sweep(path);
        match Heart::start(path, &holder) {
            Ok(heart) => Ok(Self { path: path.into(), holder, heart }),
            Err(error) => {
                file::release(path, &holder);
                Err(FileError::writing(path, 0, &error).into())
            }
        }
    }
}

impl Drop for RunLock {
    fn drop(&mut self) {
        self.heart.stop();
        file::release(&self.path, &self.holder);
    }
}

/// Who holds the lock at `path`, if anybody does and says so; for reports on a folder. Serial.
pub fn holder(path: &Path) -> Option<Holder> {
    file::look(path).ok()??.holder
}

/// Has the holder ended? Waits to find out where it can't be asked. False if the lock was released meanwhile.
fn is_stale(path: &Path, found: &Found, patience: Duration, tell: &mut impl FnMut(&str)) -> Result<bool, LockError> {
    match found.runs() {
        Some(false) => return Ok(true),
        Some(true) => return Err(refused(path, Some(found.clone()))),
        None => {}
    }
    // Five of its beats, should it have been told to beat slower.
    let beat = found.holder.as_ref().map_or(0, |holder| holder.beat_milliseconds);
    let patience = patience.max(BEATS * Duration::from_millis(beat));
    tell(&format!(
        "{}: held by {}, which can't be asked from here; waiting up to {} s for a sign of life",
        path.display(),
        name(found),
        patience.as_secs_f64()
    ));
    match file::watch(path, found, patience)? {
        Sign::None => Ok(true),
        Sign::Released => Ok(false),
        Sign::Alive => Err(refused(path, file::look(path)?.or_else(|| Some(found.clone())))),
    }
}

fn name(found: &Found) -> String {
    match &found.holder {
        Some(holder) => format!("{holder} since {}", holder.since),
        None => "a process that can't be named".into(),
    }
}

fn refused(path: &Path, found: Option<Found>) -> LockError {
    let path = path.display().to_string();
    match found.and_then(|found| found.holder) {
        Some(holder) => LockError::Locked { path, holder: Box::new(holder) },
        None => LockError::Unreadable { path },
    }
}

#[cfg(test)]
mod tests;
