//! The file of a lock: made whole or not at all, read, watched, and replaced by exactly one.
//!
//! Only operations that network file systems do as one are used: a hard link appears with its contents or fails, a
//! rename replaces, and opening a file asks the server whether it has changed.

use super::LockError;
use super::holder::Holder;
use crate::disk;
use crate::provenance::sha256;
use crate::snapshot::FileError;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::io::{self, Read, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};
use std::{fs, thread};

/// What follows the number of beats in the file.
pub(super) const AFTER_COUNT: &str = "\"\n}\n";

/// The number of beats, in the same number of bytes always: it is overwritten in place.
pub(super) fn count(beats: u64) -> [u8; 10] {
    let mut digits = [b'0'; 10];
    for (digit, power) in digits.iter_mut().rev().zip(0..) {
        *digit += (beats / 10u64.pow(power) % 10) as u8;
    }
    digits
}

#[derive(Serialize, Deserialize)]
struct Record {
    #[serde(flatten)]
    holder: Holder,
    /// Last, so that its place is known.
    #[serde(default)]
    beats: String,
}

/// A lock as it was seen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Found {
    pub(super) bytes: Vec<u8>,
    modified: Option<SystemTime>,
    inode: u64,
    /// `None` if it can't be understood.
    pub(super) holder: Option<Holder>,
}

impl Found {
    /// Is it the lock of this holder, the very one it took?
    pub(super) fn is_of(&self, holder: &Holder) -> bool {
        self.holder.as_ref() == Some(holder)
    }
    /// What tells it from any other lock.
    fn token(&self) -> String {
        match &self.holder {
            Some(holder) if !holder.token.is_empty() => holder.token.clone(),
            _ => sha256(&self.bytes)[..16].to_owned(),
        }
    }
    /// As [`Holder::runs`].
    pub(super) fn runs(&self) -> Option<bool> {
        self.holder.as_ref().and_then(Holder::runs)
    }
}

/// Makes a lock, whole or not at all. `false` if there is one already.
pub(super) fn create(path: &Path, holder: &Holder) -> Result<bool, LockError> {
    let fault = |error: &io::Error| LockError::from(FileError::writing(path, 0, error));
    let beats = String::from_utf8_lossy(&count(0)).into_owned();
    let mut text = serde_json::to_vec_pretty(&Record { holder: holder.clone(), beats })
        .map_err(|error| FileError::cannot_write(path, error))?;
    text.push(b'\n');
    let mine = beside(path, &format!("new-{}", holder.token));
    let written = fs::File::create(&mine).and_then(|mut file| {
        file.write_all(&text)?;
        file.sync_all()
    });
    let linked = written.and_then(|()| fs::hard_link(&mine, path));
    // The answer of a network file system may be lost and the question repeated: the number of names tells.
    let done = linked.is_ok() || fs::metadata(&mine).is_ok_and(|facts| facts.nlink() == 2);
    let _ = fs::remove_file(&mine);
    match linked {
        _ if done => {
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
                Err(error) => Err(fault(&error)),
            }
        }
        Err(error) => Err(fault(&error)),
        Ok(()) => Ok(true),
    }
}

/// Reads a lock; `None` if it is gone.
pub(super) fn look(path: &Path) -> Result<Option<Found>, LockError> {
    let read = fs::File::open(path).and_then(|mut file| {
        let facts = file.metadata()?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok((facts, bytes))
    });
    match read {
        Ok((facts, bytes)) => {
            let holder = serde_json::from_slice::<Record>(&bytes).ok().map(|record| record.holder);
            Ok(Some(Found { bytes, modified: facts.modified().ok(), inode: facts.ino(), holder }))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(FileError::reading(path, &error).into()),
    }
}

/// What was seen of a lock that was watched.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Sign {
    /// It changed: its holder lives, or somebody else has it.
    Alive,
    /// It was released.
    Released,
    /// Nothing in all that time.
    None,
}

/// Watches a lock for a sign of life. No clocks of machines are compared: time is counted here, and only while the
/// file could be seen, so that neither a file system that was away nor a watcher that slept is taken for a dead holder.
pub(super) fn watch(path: &Path, first: &Found, patience: Duration) -> Result<Sign, LockError> {
    let pause = (patience / 50).clamp(Duration::from_millis(2), Duration::from_secs(1));
    let (mut silent, mut seen) = (Duration::ZERO, Instant::now());
    let began = seen;
    while silent < patience {
        thread::sleep(pause);
        match look(path) {
            Ok(Some(now)) if now == *first => silent += seen.elapsed().min(2 * pause),
            Ok(Some(_)) => return Ok(Sign::Alive),
            Ok(None) => return Ok(Sign::Released),
            Err(error) if began.elapsed() > 4 * patience => return Err(error),
            Err(_) => {}
        }
        seen = Instant::now();
    }
    Ok(Sign::None)
}

/// Puts a lock of `mine` in the place of a stale one. Of all who try exactly one gets `true`.
///
/// Whoever replaces or removes a lock first makes a claim: a file named after that very lock. While it holds the claim
/// nobody else may touch that lock; renaming the claim over the lock is one act. A claim left by somebody who was
/// killed in between is itself a stale lock, and replaced as such.
pub(super) fn replace(path: &Path, stale: &Found, mine: &Holder, patience: Duration) -> Result<bool, LockError> {
    let claim = claim(path, stale);
    if !create(&claim, mine)? {
        let Some(other) = look(&claim)? else { return Ok(false) };
        if other.runs() != Some(false) && watch(&claim, &other, patience)? != Sign::None {
            return Ok(false);
        }
        if !replace(&claim, &other, mine, patience)? {
            return Ok(false);
        }
    }
    if look(path)?.is_none_or(|now| now.token() != stale.token()) {
        let _ = fs::remove_file(&claim);
        return Ok(false);
    }
    // Fails if somebody took our claim for stale; what lies there decides.
    let _ = fs::rename(&claim, path);
    disk::sync_folder(disk::folder_of(path))?;
    Ok(look(path)?.is_some_and(|now| now.is_of(mine)))
}

/// Removes the lock of `mine`, if it is still there and nobody is taking it over.
pub(super) fn release(path: &Path, mine: &Holder) {
    let Ok(Some(found)) = look(path) else { return };
    if !found.is_of(mine) {
        return;
    }
    let claim = claim(path, &found);
    match create(&claim, mine) {
        Ok(true) => {
            if matches!(look(path), Ok(Some(now)) if now.is_of(mine)) {
                let _ = fs::remove_file(path);
            }
            let _ = fs::remove_file(&claim);
        }
        Ok(false) => {}
        // No room for a claim on a full disk: the chance that just now somebody takes the lock over is small.
        Err(_) => {
            let _ = fs::remove_file(path);
        }
    }
}

/// Removes what processes of this machine left beside a lock when they were killed. Only for the holder of the lock.
pub(super) fn sweep(path: &Path) {
    let (Some(name), Ok(entries)) = (path.file_name(), fs::read_dir(disk::folder_of(path))) else { return };
    for entry in entries.flatten() {
        let other = entry.file_name();
        let ours = other
            .to_string_lossy()
            .strip_prefix(&*name.to_string_lossy())
            .is_some_and(|rest| rest.starts_with(".new-") || rest.starts_with(".claim-"));
        if ours && matches!(look(&entry.path()), Ok(Some(found)) if found.runs() == Some(false)) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn claim(path: &Path, of: &Found) -> PathBuf {
    beside(path, &format!("claim-{}", of.token()))
}

fn beside(path: &Path, what: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(format!(".{what}"));
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_ten_digits() {
        assert_eq!(&count(0), b"0000000000");
        assert_eq!(&count(1_234_567_089), b"1234567089");
        assert_eq!(&count(10_000_000_007), b"0000000007");
    }

    #[test]
    fn claims_of_the_dead_are_taken_over_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("LOCK");
        let beat = Duration::from_millis(20);
        let elsewhere = || Holder { host: "elsewhere".into(), ..Holder::this(None, beat) };
        let (dead, mine) = (elsewhere(), Holder::this(None, beat));
        assert!(create(&path, &dead).unwrap());
        let stale = look(&path).unwrap().unwrap();
        // One was killed with its claim, another while it replaced that claim.
        assert!(create(&claim(&path, &stale), &elsewhere()).unwrap());
        let first = look(&claim(&path, &stale)).unwrap().unwrap();
        let second = Holder { started: 1, ..Holder::this(None, beat) };
        assert!(create(&claim(&claim(&path, &stale), &first), &second).unwrap());
        assert!(replace(&path, &stale, &mine, Duration::from_millis(100)).unwrap());
        assert!(look(&path).unwrap().unwrap().is_of(&mine));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_claim_on_a_lock_that_is_gone_is_given_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("LOCK");
        let holder = || Holder::this(None, Duration::from_secs(1));
        let (old, new) = (holder(), holder());
        assert!(create(&path, &old).unwrap());
        let stale = look(&path).unwrap().unwrap();
        release(&path, &old);
        assert!(create(&path, &new).unwrap());
        assert!(!replace(&path, &stale, &holder(), Duration::ZERO).unwrap());
        release(&path, &old);
        assert!(look(&path).unwrap().unwrap().is_of(&new));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_lock_under_a_claim_is_not_released() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("LOCK");
        let holder = || Holder::this(None, Duration::from_secs(1));
        let (mine, other) = (holder(), holder());
        assert!(create(&path, &mine).unwrap());
        let found = look(&path).unwrap().unwrap();
        assert!(create(&claim(&path, &found), &other).unwrap());
        release(&path, &mine);
        assert!(path.exists());
    }

    #[test]
    fn what_the_dead_left_is_swept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("LOCK");
        let living = Holder::this(None, Duration::from_secs(1));
        let dead = Holder { started: 1, ..living.clone() };
        assert!(create(&beside(&path, "new-1"), &dead).unwrap() && create(&beside(&path, "claim-2"), &dead).unwrap());
        assert!(create(&beside(&path, "claim-3"), &living).unwrap() && create(&beside(&path, "else"), &dead).unwrap());
        sweep(&path);
        let mut left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["LOCK.claim-3", "LOCK.else"]);
    }
}
