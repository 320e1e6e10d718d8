//! Starts the stages of a run in order. `./talus` at the root of the repository hands its words to this program.

mod batch;
mod bench;
mod cases;
mod charts;
mod failure;
mod faults;
mod gate;
mod launch;
mod paths;
mod scaling;
mod shelf;
mod stability;
mod stage;
mod status;
mod study;
mod validate;

use clap::{Parser, Subcommand};
use failure::Failure;
use std::path::PathBuf;

/// Granular flows by SPH: from a scene to results.
#[derive(Debug, Parser)]
#[command(name = "talus", version, disable_help_subcommand = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a small column collapse from start to end, into runs/demo.
    Demo {
        #[command(flatten)]
        how: How,
    },
    /// Run one case, or a scene file of your own.
    Case {
        /// Name of a case (see `cases`), or path of a scene file that ends in .toml.
        name: String,
        /// Run folder; runs/NAME where it is left out.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        how: How,
    },
    /// List the cases.
    Cases,
    /// Run a case or a scene in slices: as jobs of Slurm, or as wall time on this machine (--local).
    Batch {
        /// Name of a case, path of a scene file that ends in .toml, or a run folder to go on with.
        name: String,
        #[command(flatten)]
        options: Box<batch::Options>,
    },
    /// Say how far runs are: what is done, how much is left, when it ends.
    Status {
        /// Run folders.
        #[arg(required = true, value_name = "RUN")]
        runs: Vec<PathBuf>,
        /// As a JSON array, for scripts.
        #[arg(long)]
        json: bool,
    },
    /// Run the validation cases and hold them against published numbers; writes tests/validation/RESULTS.md.
    Validate {
        /// Folders under tests/validation; all where none is named.
        names: Vec<String>,
        /// MPI ranks; the machine's cores where it is left out.
        #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
        ranks: Option<u32>,
        /// Use runs of the same scene in runs/validation again; their figures keep the commit that computed them.
        #[arg(long)]
        reuse: bool,
    },
    /// Run what a study still lacks, cheapest runs first, then refresh its tables and pictures; list the studies.
    Study {
        /// Folder under tests/validation; the studies are listed where none is named.
        name: Option<String>,
        #[command(flatten)]
        options: study::Options,
    },
    /// Chart error against cost of the choices a scene has, with the front of the best ones: docs/charts; list the charts.
    Chart {
        /// Folder under tests/charts; the charts are listed where none is named.
        name: Option<String>,
        #[command(flatten)]
        options: study::Options,
    },
    /// Run each method on scenes that make SPH fail, as far as that is missing, and draw who stands where: docs/stability.
    Stability {
        #[command(flatten)]
        options: study::Options,
    },
    /// Measure what costs how much; writes tests/bench.
    Bench {
        #[command(subcommand)]
        bench: bench::Bench,
    },
    /// Scale as Yang et al. 2020 do: what many ranks take beyond one, measured here, and what 1024 would reach, predicted
    /// from the partition; writes tests/bench/scaling.md.
    Scaling {
        #[command(flatten)]
        options: scaling::Options,
    },
    /// Kill, starve and damage small runs some thousand times, and see whether any work is lost; writes
    /// tests/faults/REPORT.md. Takes about an hour.
    Faults {
        #[command(flatten)]
        options: faults::Options,
    },
    /// Run every test of the repository; ends with exit code 1 where one fails.
    Test {
        /// Handed on to the test runner.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Print this help.
    Help,
}

/// How a run is started.
#[derive(Clone, Copy, Debug, clap::Args)]
struct How {
    /// MPI ranks; the machine's cores (fewer for small scenes) where it is left out.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    ranks: Option<u32>,
    /// Remove an earlier run in the same folder and start afresh.
    #[arg(long)]
    fresh: bool,
}

fn main() {
    let command = Arguments::parse().command;
    if let Err(failure) = carry_out(command) {
        eprintln!("talus: {failure}");
        std::process::exit(failure.code);
    }
}

fn carry_out(command: Command) -> Result<(), Failure> {
    match command {
        Command::Demo { how } => run(&cases::find("column-demo")?, None, paths::runs().join("demo"), how, "demo"),
        Command::Case { name, out, how } => {
            let case = cases::find(&name)?;
            let again = format!("case {name}");
            let folder = match &out {
                Some(folder) => paths::from_caller(folder),
                None => paths::runs().join(&case.name),
            };
            run(&case, out.as_deref(), folder, how, &again)
        }
        Command::Cases => cases::list(),
        Command::Batch { name, options } => batch::carry_out(&name, &options),
        Command::Status { runs, json } => status::tell(&runs, json),
        Command::Validate { names, ranks, reuse } => validate::all(&names, ranks, reuse),
        Command::Study { name: None, .. } => study::list(),
        Command::Study { name: Some(name), options } => study::carry_out(&name, &options),
        Command::Chart { name: None, .. } => charts::list(),
        Command::Chart { name: Some(name), options } => charts::carry_out(&name, &options),
        Command::Stability { options } => stability::carry_out(&options),
        Command::Bench { bench } => bench::carry_out(&bench),
        Command::Scaling { options } => scaling::carry_out(&options),
        Command::Faults { options } => faults::carry_out(&options),
        Command::Test { arguments } => gate::test(&arguments),
        Command::Help => {
            use clap::CommandFactory;
            Arguments::command().print_long_help().map_err(|e| Failure::cannot_write(format!("cannot print: {e}")))
        }
    }
}

/// Runs a case and prints where its results are. `again`: the words that start the same once more.
fn run(
    case: &cases::Case,
    out: Option<&std::path::Path>,
    folder: PathBuf,
    how: How,
    again: &str,
) -> Result<(), Failure> {
    let mut again = format!("./talus {again}");
    if let Some(out) = out {
        again += &format!(" --out {}", out.display());
    }
    if let Some(ranks) = how.ranks {
        again += &format!(" --ranks {ranks}");
    }
    let programs = stage::Programs::build()?;
    let job = stage::Job {
        scene: &case.scene,
        folder: &folder,
        ranks: how.ranks,
        fresh: how.fresh,
        again: &again,
        log: None,
    };
    stage::run(&programs, &job)?;
    eprintln!("talus: finished: {}", case.title);
    for path in stage::results(&folder) {
        println!("{}", paths::short(&path).display());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_sound() {
        Arguments::command().debug_assert();
        let parse = |words: &str| Arguments::try_parse_from(format!("talus {words}").split(' '));
        assert!(parse("batch x.toml --ranks 4 --chain 3 --sbatch-option=--mem=4G -- --mtbf 2h").is_ok());
        assert!(parse("batch x.toml --local --slice 10min --slices 2 -- --quiet").is_ok());
        for words in ["batch x --local", "batch x --slice 1min", "batch x --slurm --local --slice 1min", "status"] {
            assert!(parse(words).is_err(), "{words}");
        }
        assert!(
            parse("batch x --ranks 2 --time 4h").is_err() && parse("batch x --local --slice 9s --chain 2").is_err()
        );
    }
}
