//! What can go wrong in a run, and the exit code each leads to.

use formats::exit;
use formats::snapshot::FileError;
use std::path::PathBuf;

/// The computation failed. Found in the reduction of a step, so by all ranks at once.
#[derive(Clone, Copy, Debug, thiserror::Error)]
pub enum Fault {
    #[error("a velocity, acceleration, density or stress is not a finite number after step {step}")]
    NotFinite { step: u64 },
    #[error(
        "a particle moves at {speed:.3e} m/s after step {step}, many times the speed of sound ({sound_speed:.3e} m/s)"
    )]
    Runaway { step: u64, speed: f64, sound_speed: f64 },
    #[error("the time step has shrunk to {time_step:.3e} s after step {step}")]
    TimeStepVanishes { step: u64, time_step: f64 },
}

/// Why a run ended without being done.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{0}\nhelp: correct the scene and prepare it again with sph-prep")]
    Scene(#[from] formats::scene::SceneError),
    #[error("{fault}\nthe state is kept for diagnosis in {}\nhelp: reduce numerics.courant or raise numerics.viscosity", .state.display())]
    Numerical { fault: Fault, state: PathBuf },
    #[error("{}: {message}", .path.display())]
    Input { path: PathBuf, message: String },
    #[error("{}: {message}", .path.display())]
    CannotWrite { path: PathBuf, message: String },
    #[error("{}: the run has begun\nhelp: leave --new out to resume it, or choose another folder", .path.display())]
    HasBegun { path: PathBuf },
    #[error("{}: end.time: {end} s has passed: the run is at {time} s; a later end is needed", .path.display())]
    EndHasPassed { path: PathBuf, end: f64, time: f64 },
    #[error("{0}, or --wall-limit none")]
    LimitTooShort(String),
    #[error("{0}")]
    NoSuchInstructions(String),
    #[error("{0}")]
    Plan(String),
    /// On a rank that learnt of rank 0's failure; rank 0 tells the user.
    #[error("rank 0 failed")]
    Elsewhere { code: i32 },
    #[error(transparent)]
    Locked(#[from] formats::lock::LockError),
}

impl RunError {
    /// See [`formats::exit`].
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::File(e) => e.exit_code(),
            Self::Scene(_)
            | Self::HasBegun { .. }
            | Self::EndHasPassed { .. }
            | Self::LimitTooShort(_)
            | Self::NoSuchInstructions(_)
            | Self::Plan(_) => exit::USAGE,
            Self::Numerical { .. } => exit::NUMERICAL,
            Self::Input { .. } => exit::NO_INPUT,
            Self::CannotWrite { .. } => exit::CANNOT_WRITE,
            Self::Elsewhere { code } => *code,
            Self::Locked(e) => e.exit_code(),
        }
    }
}
