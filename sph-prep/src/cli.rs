//! The command line.

use clap::{Parser, ValueHint};
use std::path::PathBuf;

/// Make a run folder from a scene: particles, the scene as it was, and where they come from.
///
/// Works alone or under mpirun; the particles are the same on any number of ranks. `sph-prep explain scene.toml` says in
/// plain words what a scene is, what computing it takes and what it leaves out, and makes nothing.
#[derive(Clone, Debug, Parser)]
#[command(name = "sph-prep", version, after_help = EXIT_CODES)]
pub struct Arguments {
    /// The scene file
    #[arg(value_hint = ValueHint::FilePath)]
    pub scene: PathBuf,
    /// The run folder to make; it must not exist yet, or be empty
    #[arg(short, long, value_name = "RUN", value_hint = ValueHint::DirPath)]
    pub output: PathBuf,
    /// Print warnings and errors only
    #[arg(short, long)]
    pub quiet: bool,
}

const EXIT_CODES: &str = "\
Exit codes:
   0  the run folder is ready; its path is on standard output
   2  the command line or the scene is wrong, or the scene needs more memory than there is
  65  the scene file is missing or not a text file
  70  a bug: the program has panicked
  73  the run folder cannot be written, or is not empty";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
        let arguments = Arguments::try_parse_from(["sph-prep", "scene.toml", "-o", "run/"]).unwrap();
        assert!(!arguments.quiet);
    }
}
