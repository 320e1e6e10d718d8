//! The command line.

use clap::Parser;
use std::path::PathBuf;
use std::time::Duration;

/// Runs a prepared scene, or goes on where it stopped.
///
/// Alone or under mpirun. Started again in the same folder it resumes from the newest valid checkpoint; once the run
/// is done it does nothing. USR1, TERM, INT or a file named STOP in the run folder end it after a checkpoint.
#[derive(Debug, Parser)]
#[command(
    name = "sph-run",
    version,
    after_help = "Exit codes: 0 done, 2 usage or scene, 65 no valid input, \
70 numerical failure, 73 cannot write, 75 stopped early (the same command resumes), 76 locked by another run."
)]
pub struct Cli {
    /// The run folder made by sph-prep.
    pub run: PathBuf,

    /// Refuse a run that has begun instead of resuming it.
    #[arg(long)]
    pub new: bool,

    /// Stop after this many steps of this launch, with a checkpoint (exit code 75).
    #[arg(long, value_name = "N")]
    pub stop_after_steps: Option<u64>,

    /// How often to write a checkpoint: wall time such as 30s, 10min, 2h, or steps such as 500steps.
    #[arg(long, value_name = "INTERVAL", default_value = "10min")]
    pub checkpoint_every: Cadence,

    /// Generations of checkpoints to keep.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u64).range(1..))]
    pub checkpoint_keep: u64,

    /// Say nothing but errors.
    #[arg(long)]
    pub quiet: bool,

    /// Share the particles out anew whenever neighbour lists are built: slow, for tests.
    #[arg(long, hide = true)]
    pub always_rebalance: bool,
}

/// How often checkpoints are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cadence {
    Steps(u64),
    Wall(Duration),
}

impl std::str::FromStr for Cadence {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let split = text.find(|c: char| c.is_alphabetic()).unwrap_or(text.len());
        let (number, unit) = (text[..split].trim(), &text[split..]);
        let right = "expected a whole number with a unit: 500steps, 30s, 10min or 2h";
        let number: u64 = number.parse().map_err(|_| right.to_owned())?;
        let seconds = match unit {
            _ if number == 0 => return Err(format!("must be more than 0; {right}")),
            "step" | "steps" => return Ok(Self::Steps(number)),
            "s" => 1,
            "min" => 60,
            "h" => 3600,
            _ => return Err(right.to_owned()),
        };
        Ok(Self::Wall(Duration::from_secs(number.saturating_mul(seconds))))
    }
}
