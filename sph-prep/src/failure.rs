//! What can go wrong, and how all ranks hear of it.

use formats::{exit, scene::SceneError, snapshot::FileError};
use mpi::{collective::SystemOperation, traits::*};
use std::path::{Path, PathBuf};

/// A failure, as the rank knows it that met it.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The scene file can't be read.
    #[error("{}: cannot read the scene: {why}", path.display())]
    NoScene {
        /// The scene file.
        path: PathBuf,
        /// What the system says.
        why: String,
    },
    /// The scene is wrong.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene needs more memory than there is.
    #[error("about {particles} particles need {needed} of memory, {available} are available; {advice}")]
    TooLarge {
        /// Estimated number of particles.
        particles: u64,
        /// Memory `sph-run` would need, all ranks together.
        needed: String,
        /// Memory available to all ranks.
        available: String,
        /// What would fit.
        advice: String,
    },
    /// The run folder can't be made.
    #[error("{}: {why}", path.display())]
    Output {
        /// The run folder, or what stands in its way.
        path: PathBuf,
        /// What is wrong, and what would be right.
        why: String,
    },
    /// A particle file can't be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Another rank met the failure and tells of it.
    #[error("another rank failed with exit code {0}")]
    Elsewhere(i32),
}

impl Failure {
    /// The exit code it leads to.
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::NoScene { .. } => exit::NO_INPUT,
            Self::Scene(_) | Self::TooLarge { .. } => exit::USAGE,
            Self::Output { .. } => exit::CANNOT_WRITE,
            Self::File(error) => error.exit_code(),
            Self::Elsewhere(code) => *code,
        }
    }

    /// The run folder can't be made because of what the system says.
    pub fn output(path: &Path, error: &std::io::Error) -> Self {
        Self::Output { path: path.to_owned(), why: format!("cannot write here: {error}") }
    }
}

/// Makes a result known to all ranks: if any rank failed, all of them do, each with its own failure if it has one.
/// Collective.
pub fn agree<T>(comm: &impl Communicator, result: Result<T, Failure>) -> Result<T, Failure> {
    let mine = result.as_ref().err().map_or(0, Failure::exit_code);
    let mut worst = 0;
    comm.all_reduce_into(&mine, &mut worst, SystemOperation::max());
    match result {
        Ok(_) if worst != 0 => Err(Failure::Elsewhere(worst)),
        other => other,
    }
}
