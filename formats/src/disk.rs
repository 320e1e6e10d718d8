//! Writing that survives a crash: whole or not at all, and room made sure of beforehand.

use crate::provenance::host;
use crate::snapshot::FileError;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicU64, Ordering};

/// `path` with `.tmp` appended: where a file is written before it gets its name.
pub fn temporary(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".tmp");
    name.into()
}

/// Writes a small file whole or not at all: to `<path>.tmp`, fsync, rename, fsync of the folder.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let temporary = temporary(path);
    let written = File::create(&temporary).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    if let Err(error) = written {
        let _ = fs::remove_file(&temporary);
        return Err(FileError::writing(path, bytes.len() as u64, &error));
    }
    publish(&temporary, path)
}

/// Replaces a small file whole or not at all, without waiting for the disk: for what can be made again at any time.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let temporary = temporary(path);
    let written = fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, path));
    written.map_err(|error| {
        let _ = fs::remove_file(&temporary);
        FileError::writing(path, bytes.len() as u64, &error)
    })
}

/// Gives a finished file or folder its name, durably: rename, then fsync of the folder above.
pub fn publish(temporary: &Path, path: &Path) -> Result<(), FileError> {
    fs::rename(temporary, path).map_err(|error| FileError::writing(path, 0, &error))?;
    sync_folder(folder_of(path))
}

/// fsync of a file that others wrote.
pub fn sync_file(path: &Path) -> Result<(), FileError> {
    File::open(path).and_then(|file| file.sync_all()).map_err(|error| FileError::writing(path, 0, &error))
}

/// fsync of a folder: makes the names in it durable.
pub fn sync_folder(path: &Path) -> Result<(), FileError> {
    match File::open(path).and_then(|folder| folder.sync_all()) {
        // Some network file systems know no fsync of a folder.
        Err(error) if error.raw_os_error() == Some(libc::EINVAL) => Ok(()),
        other => other.map_err(|error| FileError::writing(path, 0, &error)),
    }
}

/// The folder a path lies in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Makes an empty file at `path` and finds out whether `needed` bytes fit, where the file system can tell.
pub(crate) fn reserve(path: &Path, needed: u64) -> Result<(), FileError> {
    let fault = |error: io::Error| FileError::writing(path, needed, &error);
    let file = File::create(path).map_err(fault)?;
    // SAFETY: a system call on an open file; it touches no memory of ours.
    let status = unsafe { libc::fallocate(file.as_raw_fd(), 0, 0, needed as libc::off_t) };
    let error = io::Error::last_os_error();
    if status != 0 && matches!(error.raw_os_error(), Some(libc::ENOSPC | libc::EDQUOT | libc::EFBIG)) {
        drop(file);
        let _ = fs::remove_file(path);
        return Err(fault(error));
    }
    file.set_len(0).map_err(fault)
}

/// An empty file for this process alone, in memory where the system has a place for that, and what `open` makes of its
/// path, which is gone after that.
pub(crate) fn in_memory<T>(open: impl FnOnce(&Path) -> T) -> io::Result<(File, T)> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let name = format!("talus-{}-{}-{}", host(), process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
    let make = |folder: &Path| {
        let path = folder.join(&name);
        // One left by a process of the same number.
        let _ = fs::remove_file(&path);
        let file = File::options().read(true).write(true).create_new(true).open(&path)?;
        Ok((file, path))
    };
    let (file, path) = make(Path::new("/dev/shm")).or_else(|_: io::Error| make(&std::env::temp_dir()))?;
    let opened = open(&path);
    let _ = fs::remove_file(&path);
    Ok((file, opened))
}

/// Makes the file at `path`, which is there, a copy of another. Every byte gets its place on the disk, so that writing
/// them later cannot fail for want of room; but only what is no hole in the original is written.
pub(crate) fn copy_sparse(original: &File, path: &Path) -> Result<(), FileError> {
    let fault = |needed, error: io::Error| FileError::writing(path, needed, &error);
    let length = original.metadata().map_err(|e| fault(0, e))?.len();
    let copy = || {
        let file = File::options().write(true).open(path)?;
        file.set_len(length)?;
        allocate(&file, length)?;
        let mut place = 0;
        while let Some(begin) = seek(original, place, libc::SEEK_DATA)? {
            let end = seek(original, begin, libc::SEEK_HOLE)?.unwrap_or(length);
            let mut bytes = vec![0; (end - begin) as usize];
            original.read_exact_at(&mut bytes, begin)?;
            file.write_all_at(&bytes, begin)?;
            place = end;
        }
        Ok(())
    };
    copy().map_err(|error| fault(length, error))
}

/// The next place from `place` on of this kind; `None` if there is none.
fn seek(file: &File, place: u64, kind: libc::c_int) -> io::Result<Option<u64>> {
    // SAFETY: a system call on an open file; it touches no memory of ours.
    match unsafe { libc::lseek(file.as_raw_fd(), place as libc::off_t, kind) } {
        -1 => match io::Error::last_os_error() {
            error if error.raw_os_error() == Some(libc::ENXIO) => Ok(None),
            error => Err(error),
        },
        found => Ok(Some(found as u64)),
    }
}

/// Gives every byte of a file its place on the disk.
fn allocate(file: &File, length: u64) -> io::Result<()> {
    if length == 0 {
        return Ok(());
    }
    // SAFETY: a system call on an open file; it touches no memory of ours.
    match unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, length as libc::off_t) } {
        0 => Ok(()),
        // A file system that can't allocate ahead: go on without the guard.
        libc::EOPNOTSUPP | libc::EINVAL | libc::ENOSYS => Ok(()),
        code => Err(io::Error::from_raw_os_error(code)),
    }
}
