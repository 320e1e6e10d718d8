//! The command line.

use crate::lanes::Instructions;
use crate::parallel::balance::By;
use crate::plan;
use clap::{Parser, ValueEnum, ValueHint};
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
    /// The run folder made by sph-prep; for --plan also a scene file.
    #[arg(value_hint = ValueHint::DirPath)]
    pub run: PathBuf,

    /// Refuse a run that has begun instead of resuming it.
    #[arg(long)]
    pub new: bool,

    /// Verify and list the checkpoints and outputs of the run, and compute nothing. Needs no mpirun.
    #[arg(long)]
    pub check: bool,

    /// Go on under a changed scene: a later end, other outputs. What else is changed in it is refused.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub scene: Option<PathBuf>,

    /// Go back to the checkpoint of this step (see --check) and go on from there. Later ones are set aside, and what was
    /// put out after it is dropped.
    #[arg(long, value_name = "STEP", conflicts_with = "new")]
    pub resume: Option<u64>,

    /// Stop in time, with a checkpoint (exit code 75), before so much wall time has gone by, such as 90min or 24h;
    /// `auto`: what the job has left, asked of Slurm, PBS or LSF.
    #[arg(long, value_name = "TIME", default_value = "auto")]
    pub wall_limit: WallLimit,

    /// Stop after this many steps of this launch, with a checkpoint (exit code 75).
    #[arg(long, value_name = "N")]
    pub stop_after_steps: Option<u64>,

    /// How often to write a checkpoint: wall time such as 30s, 10min, 2h, or steps such as 500steps; `auto`: the best
    /// interval for the measured cost of one and --mtbf, at most 5 % of the time.
    #[arg(long, value_name = "INTERVAL", default_value = "auto")]
    pub checkpoint_every: Cadence,

    /// Mean time between failures of the machine, for `--checkpoint-every auto`.
    #[arg(long, value_name = "TIME", default_value = "24h", value_parser = duration)]
    pub mtbf: Duration,

    /// Generations of checkpoints to keep.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u64).range(1..))]
    pub checkpoint_keep: u64,

    /// Besides, keep every K-th generation for ever.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u64).range(1..))]
    pub checkpoint_archive: Option<u64>,

    /// Vector instructions for the sums over pairs: avx512, avx2 or portable; `auto`: the most that the processor has.
    /// The results have the same bits with all of them.
    #[arg(long, value_name = "SET", default_value = "auto")]
    pub instructions: Wanted,

    /// What is shared out evenly among the ranks, looked at every 50 steps: `work`, the processor time that each was measured to
    /// take; `particles`, their numbers. The results have the same bits with both.
    #[arg(long, value_enum, value_name = "BY", default_value_t = By::Work)]
    pub balance: By,

    /// Say nothing but errors and warnings.
    #[arg(short, long)]
    pub quiet: bool,

    /// Say what goes into log/events.jsonl, too: launches, checkpoints, stops.
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,

    /// Share the particles out anew whenever neighbour lists are built: slow, for tests.
    #[arg(long, hide = true)]
    pub always_rebalance: bool,

    /// How long a lock of another machine is watched before it counts as left behind.
    #[arg(long, hide = true, default_value = "75s", value_parser = duration)]
    pub lock_patience: Duration,

    /// How long MPI may take to start.
    #[arg(long, hide = true, default_value = "10min", value_parser = duration)]
    pub mpi_patience: Duration,

    #[command(flatten)]
    pub plan: plan::Options,
}

/// The default of `--mpi-patience`.
pub const MPI_PATIENCE: Duration = Duration::from_secs(600);

/// How often checkpoints are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cadence {
    Auto,
    Steps(u64),
    Wall(Duration),
}

/// How long a launch may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WallLimit {
    /// As long as the scheduler says.
    Auto,
    None,
    Of(Duration),
}

/// Which instructions a run is to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// The most that the processor has.
    Auto,
    These(Instructions),
}

impl Wanted {
    /// What this processor computes with; what is wrong where it lacks them.
    pub fn here(self) -> Result<Instructions, String> {
        match self {
            Self::Auto => Ok(Instructions::best()),
            Self::These(instructions) if instructions.are_there() => Ok(instructions),
            Self::These(instructions) => {
                let best = Instructions::best();
                Err(format!(
                    "--instructions: the processor has no {instructions}; it has {best}; auto takes what there is"
                ))
            }
        }
    }
}

impl std::str::FromStr for Wanted {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            _ => Instructions::from_str(text, false)
                .map(Self::These)
                .map_err(|_| "expected auto, avx512, avx2 or portable".to_owned()),
        }
    }
}

impl std::str::FromStr for Cadence {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let right = "expected auto, or a time or whole number of steps above 0: 30s, 10min, 2h, 500steps";
        let steps = text.strip_suffix("steps").or_else(|| text.strip_suffix("step"));
        match steps.map(|number| number.trim().parse()) {
            _ if text == "auto" => Ok(Self::Auto),
            Some(Ok(0) | Err(_)) => Err(right.to_owned()),
            Some(Ok(number)) => Ok(Self::Steps(number)),
            None => duration(text).map(Self::Wall).map_err(|_| right.to_owned()),
        }
    }
}

impl std::str::FromStr for WallLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::None),
            _ => duration(text).map(Self::Of).map_err(|right| format!("expected auto, none, or: {right}")),
        }
    }
}

/// A length of time above 0: a whole number with a unit, or several.
fn duration(text: &str) -> Result<Duration, String> {
    match humantime::parse_duration(text) {
        Ok(time) if !time.is_zero() => Ok(time),
        _ => Err("a time above 0 with a unit, such as 30s, 10min, 2h or 1h30min".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_steps() {
        let minutes = |n: u64| Duration::from_secs(60 * n);
        assert_eq!("auto".parse(), Ok(Cadence::Auto));
        assert_eq!("500steps".parse(), Ok(Cadence::Steps(500)));
        assert_eq!("10min".parse(), Ok(Cadence::Wall(minutes(10))));
        assert_eq!("1h30min".parse(), Ok(WallLimit::Of(minutes(90))));
        assert_eq!("24h".parse(), Ok(WallLimit::Of(minutes(24 * 60))));
        assert_eq!(("auto".parse(), "none".parse()), (Ok(WallLimit::Auto), Ok(WallLimit::None)));
        for text in ["", "0s", "0steps", "5 parsecs", "1.5steps", "-3s", "10"] {
            assert!(text.parse::<Cadence>().is_err(), "{text}");
            assert!(text.parse::<WallLimit>().is_err(), "{text}");
        }
    }

    #[test]
    fn instructions() {
        for (text, wanted) in [
            ("auto", Wanted::Auto),
            ("avx512", Wanted::These(Instructions::Avx512)),
            ("avx2", Wanted::These(Instructions::Avx2)),
            ("portable", Wanted::These(Instructions::Portable)),
        ] {
            assert_eq!(text.parse(), Ok(wanted));
            // Whatever the processor has: what is handed on is there, what is not is named.
            match (wanted.here(), wanted) {
                (Ok(chosen), Wanted::Auto) => assert_eq!(chosen, Instructions::best()),
                (Ok(chosen), Wanted::These(these)) => assert!(chosen == these && these.are_there()),
                (Err(message), Wanted::These(these)) => {
                    assert!(!these.are_there() && message.contains(&these.to_string()), "{message}");
                }
                (Err(message), Wanted::Auto) => panic!("{message}"),
            }
        }
        for text in ["", "AVX2", "neon", "avx"] {
            assert!(text.parse::<Wanted>().is_err(), "{text}");
        }
    }
}
