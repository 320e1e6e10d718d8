//! Folders of a kind, side by side, each with a TOML file that says what it is: studies, charts.

use crate::{failure::Failure, paths};
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Where such folders stand.
#[derive(Clone, Debug)]
pub struct Shelf {
    /// Holds them.
    pub folder: PathBuf,
    /// What each of them has.
    pub file: &'static str,
    /// What they are called.
    pub kind: &'static str,
}

impl Shelf {
    /// Names of the folders, sorted.
    pub fn names(&self) -> Result<Vec<String>, Failure> {
        let entries = std::fs::read_dir(&self.folder).map_err(|e| {
            Failure::no_input(format!("{}: cannot list its folders: {e}", paths::short(&self.folder).display()))
        })?;
        let is_one = |entry: &std::fs::DirEntry| entry.path().join(self.file).is_file();
        let mut names: Vec<String> =
            entries.flatten().filter(is_one).map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        Ok(names)
    }

    /// The folder of a name.
    pub fn find(&self, name: &str) -> Result<PathBuf, Failure> {
        let known = self.names()?;
        if known.iter().any(|k| k == name) {
            return Ok(self.folder.join(name));
        }
        Err(Failure::usage(format!("there is no {} `{name}`; there are: {}", self.kind, known.join(", "))))
    }
}

/// What a TOML file says.
pub fn parsed<T: DeserializeOwned>(path: &Path) -> Result<T, Failure> {
    let text = std::fs::read_to_string(path).map_err(|e| fault(path, &e.to_string()))?;
    toml::from_str(&text).map_err(|e| fault(path, &e.to_string()))
}

/// Something is wrong in a file.
pub fn fault(path: &Path, what: &str) -> Failure {
    Failure::no_input(format!("{}: {what}", paths::short(path).display()))
}
