//! What can go wrong.

use formats::{exit, scene::SceneError, snapshot::FileError};

/// A failure; its message names the file and says what would be right.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The folder is no run.
    #[error("{path}: not a run folder: {what}; `sph-prep scene.toml -o {path}` makes one")]
    NoRun {
        /// The folder.
        path: String,
        /// What is missing.
        what: String,
    },
    /// The scene in the folder is not one.
    #[error("{0}\nthe scene of a run must stay as it was prepared")]
    Scene(#[from] SceneError),
    /// A file can't be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The system gives no threads.
    #[error("cannot start the threads: {0}; fewer can be asked for with --threads")]
    Threads(std::io::Error),
    /// A picture can't be drawn.
    #[error("{path}: cannot be drawn: {what}")]
    Picture {
        /// The picture.
        path: String,
        /// The reason.
        what: String,
    },
}

impl Failure {
    /// The exit code it leads to.
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::Scene(_) | Self::Threads(_) => exit::USAGE,
            Self::NoRun { .. } => exit::NO_INPUT,
            Self::File(error) => error.exit_code(),
            Self::Picture { .. } => exit::CANNOT_WRITE,
        }
    }
}
