//! Exit codes, the same for all binaries and frozen in the README.

/// Everything asked for was done.
pub const DONE: i32 = 0;
/// The command line or the scene is wrong.
pub const USAGE: i32 = 2;
/// A file is missing, unreadable, damaged, or of another kind.
pub const NO_INPUT: i32 = 65;
/// The computation failed: not-a-number, runaway velocity, vanishing time step.
pub const NUMERICAL: i32 = 70;
/// Cannot write: no permission, read-only, disk full, output already there.
pub const CANNOT_WRITE: i32 = 73;
/// Stopped early on request; the same command resumes.
pub const RESUMABLE: i32 = 75;
/// Another process works in the same run folder.
pub const LOCKED: i32 = 76;
