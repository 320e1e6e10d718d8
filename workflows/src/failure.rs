//! Why a workflow ended early, and the exit code that says so.

use formats::exit;

/// One message and one of the exit codes of [`formats::exit`].
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct Failure {
    /// The program's exit code.
    pub code: i32,
    /// What went wrong, where, and what to do.
    pub message: String,
}

impl Failure {
    /// A wrong word on the command line.
    pub fn usage(message: impl Into<String>) -> Self {
        Self { code: exit::USAGE, message: message.into() }
    }
    /// A file that is missing or not what it should be.
    pub fn no_input(message: impl Into<String>) -> Self {
        Self { code: exit::NO_INPUT, message: message.into() }
    }
    /// Output that cannot be written.
    pub fn cannot_write(message: impl Into<String>) -> Self {
        Self { code: exit::CANNOT_WRITE, message: message.into() }
    }
}

/// A program that could not be started at all.
impl From<xshell::Error> for Failure {
    fn from(error: xshell::Error) -> Self {
        Self::no_input(error.to_string())
    }
}
