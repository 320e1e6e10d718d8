//! What can go wrong with a file.

use crate::exit;
use serde::{Deserialize, Serialize};
use std::{io, path::Path};

/// What went wrong with a file. Every message names the file, what is wrong, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum FileError {
    /// No such file.
    #[error("{path}: no such file; check the path, or run the stage that makes it")]
    NotFound { path: String },
    /// There, but the system refuses to read it.
    #[error("{path}: cannot be read: {what}")]
    CannotRead { path: String, what: String },
    /// A sound file of another kind.
    #[error("{path}: not a file of this kind: {what}")]
    WrongKind { path: String, what: String },
    /// Written by a later version of this program.
    #[error("{path}: has format version {found}, this program reads up to {known}; use a newer program")]
    Newer { path: String, found: u64, known: u64 },
    /// Written by an earlier version of this program.
    #[error("{path}: has format version {found}, this program reads {known}; prepare the scene anew with sph-prep")]
    Older { path: String, found: u64, known: u64 },
    /// Of the right kind, but cut off or changed.
    #[error("{path}: damaged: {what}; restore it from a copy, or make it again")]
    Damaged { path: String, what: String },
    /// The system, or what was to be written, does not allow it.
    #[error("{path}: cannot be written: {what}")]
    CannotWrite { path: String, what: String },
    /// No room, on the disk or in the quota.
    #[error(
        "{path}: the disk or the quota is full: {needed} bytes are needed; make room and start the same command again"
    )]
    DiskFull { path: String, needed: u64 },
}

impl FileError {
    /// The exit code of [`crate::exit`]: `NO_INPUT` for reading, `CANNOT_WRITE` for writing.
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::NotFound { .. }
            | Self::CannotRead { .. }
            | Self::WrongKind { .. }
            | Self::Newer { .. }
            | Self::Older { .. }
            | Self::Damaged { .. } => exit::NO_INPUT,
            Self::CannotWrite { .. } | Self::DiskFull { .. } => exit::CANNOT_WRITE,
        }
    }

    /// From an error met in reading `path`.
    pub fn reading(path: &Path, error: &io::Error) -> Self {
        let path = path.display().to_string();
        match error.kind() {
            io::ErrorKind::NotFound => Self::NotFound { path },
            _ => Self::CannotRead { path, what: error.to_string() },
        }
    }

    /// From an error met in writing `needed` bytes to `path`.
    pub fn writing(path: &Path, needed: u64, error: &io::Error) -> Self {
        let path = path.display().to_string();
        match error.raw_os_error() {
            Some(libc::ENOSPC | libc::EDQUOT | libc::EFBIG) => Self::DiskFull { path, needed },
            _ => Self::CannotWrite { path, what: error.to_string() },
        }
    }

    /// `path` is damaged: `what`.
    pub(crate) fn damaged(path: &Path, what: impl ToString) -> Self {
        Self::Damaged { path: path.display().to_string(), what: what.to_string() }
    }

    /// `path` is of another kind: `what`.
    pub(crate) fn wrong_kind(path: &Path, what: impl ToString) -> Self {
        Self::WrongKind { path: path.display().to_string(), what: what.to_string() }
    }

    /// `path` cannot be written: `what`.
    pub(crate) fn cannot_write(path: &Path, what: impl ToString) -> Self {
        Self::CannotWrite { path: path.display().to_string(), what: what.to_string() }
    }
}
