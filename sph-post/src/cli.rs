//! The command line.

use crate::basal::Level;
use clap::Parser;
use std::path::PathBuf;

/// Evaluate a run: deposit, run-out, basal stresses, energies, and pictures of them.
///
/// Works on the snapshots that are there, also while the run goes on; every call evaluates all of them anew.
/// Serial: under mpirun one rank works and the others wait.
#[derive(Clone, Debug, Parser)]
#[command(name = "sph-post", version, after_help = EXIT_CODES)]
pub struct Arguments {
    /// The run folder
    pub run: PathBuf,
    /// Height above the floor at which basal stresses are taken: smoothing lengths, or a length as "12 mm"
    #[arg(long, value_name = "HEIGHT", default_value = "3 h", value_parser = Level::parse)]
    pub basal_height: Level,
    /// Print paths, warnings and errors only
    #[arg(short, long)]
    pub quiet: bool,
}

const EXIT_CODES: &str = "\
Exit codes:
   0  post/ is written; the paths are on standard output
   2  the command line, or the scene in the run folder, is wrong
  65  no run, or one of its files is missing, damaged, or of another scene
  70  the program failed: a bug
  73  post/ cannot be written";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
        let arguments = Arguments::try_parse_from(["sph-post", "run/"]).unwrap();
        assert_eq!(arguments.basal_height, Level::Smoothing(3.0));
        assert!(Arguments::try_parse_from(["sph-post", "run/", "--basal-height", "3 kg"]).is_err());
    }
}
