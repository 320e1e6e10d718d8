//! Writing that survives a crash: whole or not at all, and room made sure of beforehand.

use crate::snapshot::FileError;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

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

/// Gives every byte of the file at `path` its place on the disk, so that writing them cannot fail for want of room.
/// Call when the file has its final length.
pub(crate) fn allocate(path: &Path) -> Result<(), FileError> {
    let fault = |needed, error: io::Error| FileError::writing(path, needed, &error);
    let file = File::options().write(true).open(path).map_err(|e| fault(0, e))?;
    let length = file.metadata().map_err(|e| fault(0, e))?.len();
    if length == 0 {
        return Ok(());
    }
    // SAFETY: a system call on an open file; it touches no memory of ours.
    match unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, length as libc::off_t) } {
        0 => Ok(()),
        // A file system that can't allocate ahead: go on without the guard.
        libc::EOPNOTSUPP | libc::EINVAL | libc::ENOSYS => Ok(()),
        code => Err(fault(length, io::Error::from_raw_os_error(code))),
    }
}
