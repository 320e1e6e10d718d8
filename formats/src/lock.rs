//! One process at a time in a run folder, without `flock`, which network file systems do not keep reliably.

use crate::disk;
use crate::exit;
use crate::provenance::{host, now};
use crate::snapshot::FileError;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::{fs, process};

/// Who holds a lock.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Name of the machine.
    pub host: String,
    /// Number of its start (boot), so that a process number of an earlier one is not mistaken.
    pub boot: String,
    /// Process number.
    pub pid: u32,
    /// When the process started, in clock ticks since the machine's start.
    pub started: u64,
    /// When the lock was taken: UTC, RFC 3339.
    pub since: String,
}

/// Why a lock was not taken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum LockError {
    /// Another process works in the folder, or did on a machine that can't be asked from here.
    #[error(
        "{path}: process {} on {} works in this folder since {}; wait for it, or delete the file if it no longer runs",
        holder.pid, holder.host, holder.since
    )]
    Locked { path: String, holder: Holder },
    /// There is a lock that can't be understood.
    #[error("{path}: a lock that names no process; delete the file if no process works in this folder")]
    Unreadable { path: String },
    /// The lock could not be written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl LockError {
    /// The exit code of [`crate::exit`].
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::Locked { .. } | Self::Unreadable { .. } => exit::LOCKED,
            Self::File(error) => error.exit_code(),
        }
    }
}

/// A lock that is held; dropping it removes the file. A lock left by a process that was killed on this machine is
/// recognised and taken over.
#[derive(Debug)]
pub struct RunLock {
    path: PathBuf,
    holder: Holder,
}

impl RunLock {
    /// Takes the lock at `path`. Serial: under MPI one rank alone.
    ///
    /// # Errors
    /// `Locked`, `Unreadable`, or `File` if the folder can't be written.
    pub fn acquire(path: &Path) -> Result<Self, LockError> {
        let holder = Holder {
            host: host(),
            boot: boot(),
            pid: process::id(),
            started: started(process::id()).unwrap_or(0),
            since: now(),
        };
        // Twice at most: once more after a stale lock was removed.
        for _ in 0..2 {
            if create(path, &holder)? {
                return Ok(Self { path: path.into(), holder });
            }
            match read(path)? {
                None => {}
                Some(other) if other.is_gone() => remove_stale(path, &other),
                Some(other) => return Err(LockError::Locked { path: path.display().to_string(), holder: other }),
            }
        }
        // Taken by another process that came in between.
        match read(path)? {
            Some(holder) => Err(LockError::Locked { path: path.display().to_string(), holder }),
            None => Err(LockError::Unreadable { path: path.display().to_string() }),
        }
    }
}

impl Drop for RunLock {
    fn drop(&mut self) {
        // Only our own: a user may have deleted it, and another process taken it since.
        if matches!(read(&self.path), Ok(Some(holder)) if holder == self.holder) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

impl Holder {
    /// Is it certain that this process no longer runs? Only its own machine can tell.
    fn is_gone(&self) -> bool {
        self.host == host() && (self.boot != boot() || started(self.pid) != Some(self.started))
    }
}

/// Makes the lock, whole or not at all. `false` if there is one already.
fn create(path: &Path, holder: &Holder) -> Result<bool, LockError> {
    let fault = |error: &io::Error| FileError::writing(path, 0, error);
    let text = serde_json::to_vec_pretty(holder).map_err(|error| FileError::cannot_write(path, error))?;
    let mine = beside(path, "new");
    let written = fs::File::create(&mine).and_then(|mut file| {
        file.write_all(&text)?;
        file.sync_all()
    });
    // A hard link appears at once with its contents, and fails if the name is taken, on network file systems too.
    let linked = written.and_then(|()| fs::hard_link(&mine, path));
    let _ = fs::remove_file(&mine);
    match linked {
        Ok(()) => {
            disk::sync_folder(disk::folder_of(path))?;
            Ok(true)
        }
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
        Err(error) if matches!(error.raw_os_error(), Some(libc::EPERM | libc::EOPNOTSUPP | libc::ENOSYS)) => {
            // A file system without hard links.
            let created = fs::File::options().write(true).create_new(true).open(path);
            match created.and_then(|mut file| file.write_all(&text)) {
                Ok(()) => Ok(true),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
                Err(error) => Err(fault(&error).into()),
            }
        }
        Err(error) => Err(fault(&error).into()),
    }
}

/// Reads a lock; `None` if it is gone.
fn read(path: &Path) -> Result<Option<Holder>, LockError> {
    match fs::read(path) {
        Ok(text) => match serde_json::from_slice(&text) {
            Ok(holder) => Ok(Some(holder)),
            Err(_) => Err(LockError::Unreadable { path: path.display().to_string() }),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(FileError::reading(path, &error).into()),
    }
}

/// Removes a stale lock. Two processes may find the same one: whoever moves away a fresh lock by mistake puts it back.
fn remove_stale(path: &Path, stale: &Holder) {
    let aside = beside(path, "stale");
    if fs::rename(path, &aside).is_ok() {
        if !matches!(read(&aside), Ok(Some(holder)) if holder == *stale) {
            let _ = fs::hard_link(&aside, path);
        }
        let _ = fs::remove_file(&aside);
    }
}

/// A name beside `path` that no other process uses.
fn beside(path: &Path, what: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(format!(".{what}-{}-{}", host(), process::id()));
    name.into()
}

/// The machine's start.
fn boot() -> String {
    fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default().trim().into()
}

/// When a process started, in clock ticks since the machine's start; `None` if there is no such process, or it has
/// ended and only waits to be collected.
fn started(pid: u32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The second field, the program's name, is in brackets and may hold anything; the third is the state.
    let mut fields = text[text.rfind(')')? + 1..].split_whitespace();
    if matches!(fields.next()?, "Z" | "X") {
        return None;
    }
    fields.nth(18)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_is_refused_and_drop_releases() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("LOCK");
        let lock = RunLock::acquire(&path).unwrap();
        let error = RunLock::acquire(&path).unwrap_err();
        assert!(matches!(&error, LockError::Locked { holder, .. } if holder.pid == process::id()), "{error}");
        assert_eq!(error.exit_code(), 76);
        drop(lock);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        RunLock::acquire(&path).unwrap();
    }

    #[test]
    fn lock_of_a_dead_process_is_taken_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("LOCK");
        // Killed but not yet collected, collected, and a living process with that number but another start.
        let mut child = process::Command::new("sleep").arg("60").spawn().unwrap();
        let pid = child.id();
        let held = Holder { host: host(), boot: boot(), pid, started: started(pid).unwrap(), since: now() };
        assert!(create(&path, &held).unwrap());
        assert_eq!(RunLock::acquire(&path).unwrap_err().exit_code(), exit::LOCKED);
        child.kill().unwrap();
        child.wait().unwrap();
        drop(RunLock::acquire(&path).unwrap());
        assert!(!path.exists());
        assert!(create(&path, &Holder { pid: process::id(), started: 1, ..held }).unwrap());
        drop(RunLock::acquire(&path).unwrap());
    }

    #[test]
    fn lock_of_another_machine_holds() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("LOCK");
        let held = Holder { host: "elsewhere".into(), boot: boot(), pid: 1, started: 1, since: now() };
        assert!(create(&path, &held).unwrap());
        assert_eq!(RunLock::acquire(&path).unwrap_err().exit_code(), exit::LOCKED);
        fs::write(&path, "?").unwrap();
        assert!(matches!(RunLock::acquire(&path), Err(LockError::Unreadable { .. })));
    }
}
