//! Faults put into the system calls of `sph-run` by the library of `tests/shim`, which is preloaded.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::{fs, io};

/// One fault at one call. Calls are counted from 1, in each process on its own, among those the fault is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What happens: `kill`, `torn`, `short`, `flip`, `suspend`, `sleep:MS`, `slow:MS`, `clock:S`, `fail:CODE`, `fail-on:CODE`, `full:CODE`;
    /// `count` only lists the calls. See `tests/shim/plan.rs`.
    pub deed: String,
    /// At which call.
    pub at: u64,
    /// On which rank; on all where it is none.
    pub rank: Option<usize>,
    /// Kinds of calls, with commas; all that change something where it is empty.
    pub calls: String,
    /// Form of the paths within the folder, with `?` and `*`.
    pub files: String,
}

impl Fault {
    /// At a call that changes something, of any kind, anywhere in the folder, on rank 0.
    pub fn new(deed: impl Into<String>, at: u64) -> Self {
        Self { deed: deed.into(), at, rank: Some(0), calls: String::new(), files: "*".into() }
    }

    /// Lists the calls of all ranks.
    pub fn count() -> Self {
        Self { rank: None, ..Self::new("count", 0) }
    }

    /// Only calls of these kinds on paths of this form.
    pub fn of(self, calls: &str, files: &str) -> Self {
        Self { calls: calls.into(), files: files.into(), ..self }
    }

    /// On this rank.
    pub fn on(self, rank: usize) -> Self {
        Self { rank: Some(rank), ..self }
    }

    /// On every rank.
    pub fn on_all(self) -> Self {
        Self { rank: None, ..self }
    }

    /// Puts the fault into a command that works in `folder`. `log`, outside of it, gets a line for what was done.
    ///
    /// # Errors
    /// If the folder is not there.
    pub fn put(&self, command: &mut Command, library: &Path, folder: &Path, log: &Path) -> io::Result<()> {
        let at = self.at.to_string();
        let set: [(&str, &OsStr); 6] = [
            ("DO", self.deed.as_ref()),
            ("AT", at.as_ref()),
            ("CALLS", self.calls.as_ref()),
            ("FILES", self.files.as_ref()),
            ("FOLDER", &fs::canonicalize(folder)?.into_os_string()),
            ("LOG", log.as_os_str()),
        ];
        for (name, value) in set {
            command.env(format!("TALUS_FAULT_{name}"), value);
        }
        if let Some(rank) = self.rank {
            command.env("TALUS_FAULT_RANK", rank.to_string());
        }
        command.env("LD_PRELOAD", library);
        Ok(())
    }
}

/// A call the library has counted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Call {
    /// The rank that made it.
    pub rank: usize,
    /// Its number on this rank, from 1.
    pub number: u64,
    /// Its kind: see `tests/shim/plan.rs`.
    pub kind: String,
    /// Bytes to write or read; numbers in a message.
    pub bytes: u64,
    /// Path within the folder; of two names the new one.
    pub path: String,
}

/// The calls in a log of [`Fault::count`], in the order they began.
pub fn calls(log: &Path) -> Vec<Call> {
    let call = |line: &str| {
        let mut words = line.splitn(5, '\t');
        Some(Call {
            rank: words.next()?.parse().ok()?,
            number: words.next()?.parse().ok()?,
            kind: words.next()?.to_owned(),
            bytes: words.next()?.parse().ok()?,
            path: words.next()?.to_owned(),
        })
    };
    fs::read_to_string(log).unwrap_or_default().lines().filter_map(call).collect()
}

/// What struck, from the log: a line each, such as `struck: kill at sync of ckpt/gen-000002.tmp/state.hdf, call 17,
/// rank 0`.
pub fn struck(log: &Path) -> Vec<String> {
    fs::read_to_string(log).unwrap_or_default().lines().filter(|l| l.starts_with("struck")).map(Into::into).collect()
}

/// The library, built by the first call in the profile and the target folder of the test.
pub fn library() -> PathBuf {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| crate::build(&["--example", "shim"]).join("examples/libshim.so")).clone()
}
