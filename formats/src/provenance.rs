//! Who made what, with which versions; and the hash that names contents.

use crate::{disk, snapshot::FileError};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io;
use std::{fs, path::Path, time::SystemTime};

/// The program as it was built, and the libraries it runs with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Build {
    /// Version of the release.
    pub version: String,
    /// Commit of the source, or `unknown`.
    pub commit: String,
    /// The compiler.
    pub compiler: String,
    /// Profile, optimisation and target.
    pub profile: String,
    /// Versions of the libraries: `hdf5`, `mpi`.
    pub libraries: BTreeMap<String, String>,
}

impl Build {
    /// Of this process.
    pub fn this() -> Self {
        let (major, minor, patch) = hdf5::library_version();
        let mpi = mpi::environment::library_version().unwrap_or_else(|_| "unknown".into());
        // Some MPI libraries answer with a paragraph, padded with NULs: its first line names the version.
        let mpi = mpi.trim_end_matches('\0').lines().next().unwrap_or("unknown").trim().to_string();
        let libraries = [("hdf5", format!("{major}.{minor}.{patch}")), ("mpi", mpi)];
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: option_env!("TALUS_COMMIT").unwrap_or("unknown").into(),
            compiler: option_env!("TALUS_COMPILER").unwrap_or("unknown").into(),
            profile: option_env!("TALUS_PROFILE").unwrap_or("unknown").into(),
            libraries: libraries.map(|(name, version)| (name.to_string(), version)).into(),
        }
    }
}

/// One entry of `provenance.json`: one run of one program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// Name of the program.
    pub program: String,
    /// What it was built from.
    #[serde(flatten)]
    pub build: Build,
    /// The command line, word by word.
    pub command: Vec<String>,
    /// When it began: UTC, RFC 3339.
    pub time: String,
    /// Number of MPI ranks.
    pub ranks: usize,
    /// Name of the machine of rank 0.
    pub host: String,
    /// What the program chose where the scene says `"auto"`, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub chosen: Vec<String>,
}

impl Entry {
    /// This process, now.
    pub fn this(program: &str, ranks: usize) -> Self {
        Self {
            program: program.into(),
            build: Build::this(),
            command: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
            time: now(),
            ranks,
            host: host(),
            chosen: Vec::new(),
        }
    }
}

/// The entries of a `provenance.json`, oldest first; none if there is no such file. Serial.
///
/// # Errors
/// `CannotRead`; `Damaged` if it is no list of entries.
pub fn read(path: &Path) -> Result<Vec<Entry>, FileError> {
    match fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map_err(|error| FileError::damaged(path, error)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(FileError::reading(path, &error)),
    }
}

/// Appends an entry; the file is replaced whole or not at all. Serial: one rank alone.
///
/// # Errors
/// As [`read`]; `CannotWrite`, `DiskFull`.
pub fn append(path: &Path, entry: Entry) -> Result<(), FileError> {
    let mut entries = read(path)?;
    entries.push(entry);
    let mut text = serde_json::to_vec_pretty(&entries).map_err(|error| FileError::cannot_write(path, error))?;
    text.push(b'\n');
    disk::write_atomic(path, &text)
}

/// The time now: UTC, RFC 3339, to the second.
pub fn now() -> String {
    humantime::format_rfc3339_seconds(SystemTime::now()).to_string()
}

/// The name of this machine.
pub(crate) fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let name = name.trim();
    if name.is_empty() { "unknown".into() } else { name.into() }
}

/// SHA-256 of `bytes`, as 64 lower-case hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// Bytes as lower-case hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
