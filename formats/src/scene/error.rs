//! Faults of a scene file.

/// One fault: where, what, and what would be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Line, counted from 1.
    pub line: usize,
    /// Column, counted from 1.
    pub column: usize,
    /// Key path, e.g. `material.drucker-prager.friction`.
    pub key: String,
    /// What is wrong, and what would be right.
    pub message: String,
}

/// All faults of a scene file.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("{}", self.report())]
pub struct SceneError {
    /// The file's name.
    pub file: String,
    /// At least one, in the order of the file.
    pub faults: Vec<Fault>,
}

impl SceneError {
    /// One line a fault: `file:line:column: key: message`.
    pub fn report(&self) -> String {
        let line = |f: &Fault| {
            let key = if f.key.is_empty() { String::new() } else { format!("{}: ", f.key) };
            format!("{}:{}:{}: {key}{}", self.file, f.line, f.column, f.message)
        };
        self.faults.iter().map(line).collect::<Vec<_>>().join("\n")
    }
}
