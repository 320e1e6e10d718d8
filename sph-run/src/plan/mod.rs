//! `sph-run --plan`: what a run would be like on numbers of ranks, without running it. The partition, the halo, the images
//! and the wall sites are those of a real run, made by the same functions on one rank after the other; the time of a step is
//! predicted from them by a few stated constants ([`cost`]).

pub mod cost;
pub mod measured;
pub mod migration;
pub mod partition;
pub mod places;
mod table;

use crate::error::RunError;
use cost::{Costs, Machine};
use formats::{exit, news};
use partition::Partition;
use places::{Source, State};
use std::path::Path;

/// What is asked for, and the constants of the prediction.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Planning")]
pub struct Options {
    /// Run nothing: predict how a scene (a path that ends in .toml) or the run of a folder does on the numbers of ranks in
    /// --ranks, and advise on how many to ask for. Needs no mpirun. See docs/scaling.md.
    #[arg(long, conflicts_with_all = ["new", "check", "scene", "resume"])]
    pub plan: bool,

    /// Numbers of ranks; powers of two where they are left out.
    #[arg(long, value_name = "N,..", value_delimiter = ',', requires = "plan")]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=MOST_RANKS))]
    pub ranks: Vec<u64>,

    /// Plan a scene as it starts, or with its material spread as by half of the run-out or as a deposit.
    #[arg(long, value_enum, requires = "plan", default_value_t = State::Start)]
    pub state: State,

    /// Time one particle takes a step on one rank; of the run's log where there is one, else a default of the space.
    #[arg(long, value_name = "MICROSECONDS", requires = "plan", value_parser = positive)]
    pub cost: Option<f64>,

    /// Latency of a message, with what the programs spend on it.
    #[arg(long, value_name = "MICROSECONDS", requires = "plan", default_value = "3", value_parser = positive)]
    pub latency: f64,

    /// Bandwidth of one rank while all ranks send.
    #[arg(long, value_name = "GB/S", requires = "plan", default_value = "0.5", value_parser = positive)]
    pub bandwidth: f64,

    /// Share of the exchange that goes on behind computation, 0 to 1.
    #[arg(long, value_name = "SHARE", requires = "plan", default_value = "0", value_parser = share)]
    pub overlap: f64,

    /// Of a scene with more particles, plan as many of them, spread evenly.
    #[arg(long, value_name = "PARTICLES", requires = "plan", default_value_t = 40_000_000)]
    #[arg(value_parser = clap::value_parser!(u64).range(1000..))]
    pub sample: u64,

    /// Predict with this cost, too; told by --json alone.
    #[arg(long, hide = true, value_name = "MICROSECONDS", requires = "plan", value_parser = positive)]
    pub beside: Option<f64>,

    /// As one JSON object, for scripts.
    #[arg(long, requires = "plan")]
    pub json: bool,

    /// Under mpirun: send so many particles from slices to their boxes, through neighbours and by one exchange among all.
    #[arg(long, hide = true, value_name = "PARTICLES")]
    pub migration: Option<u64>,
}

/// More boxes than that are no machine's.
const MOST_RANKS: u64 = 65_536;

/// Prints the plan of what lies at `path`. The exit code.
pub fn report(path: &Path, options: &Options) -> i32 {
    if let Some(particles) = options.migration {
        options.ranks.iter().for_each(|&ranks| println!("{}", migration::counted_json(particles, ranks as usize)));
        return exit::DONE;
    }
    match plan(path, options) {
        Ok(text) => {
            // Nobody to tell where the reader has gone.
            let _ = std::io::Write::write_all(&mut std::io::stdout().lock(), text.as_bytes());
            exit::DONE
        }
        Err(error) => {
            news::fail(&error.to_string(), error.exit_code());
            error.exit_code()
        }
    }
}

/// The plan as text or JSON.
///
/// # Errors
/// Where the scene or the folder cannot be read, holds nothing, or has fewer particles than ranks.
pub fn plan(path: &Path, options: &Options) -> Result<String, RunError> {
    let source = Source::read(path, options.state, options.sample)?;
    let count = source.count();
    let unusable = |message: String| RunError::Plan(format!("{}: {message}", path.display()));
    let mut ranks = match options.ranks.is_empty() {
        true => powers(count),
        false => options.ranks.clone(),
    };
    ranks.sort_unstable();
    ranks.dedup();
    if let Some(&most) = ranks.last().filter(|&&most| most > count) {
        let message = format!("--ranks {most}: more than the {count} particles; at most so many have work");
        return Err(unusable(message));
    }
    if let Some(&most) = ranks.last().filter(|&&most| 100 * most > source.points.len() as u64 && source.weight > 1.0) {
        let message = format!("--ranks {most}: too many for a sample of {}; raise --sample", source.points.len());
        return Err(unusable(message));
    }
    let measured = match options.cost {
        Some(_) => None,
        None => measured::Log::find(path, count),
    };
    let costs = match (options.cost, &measured) {
        (Some(microseconds), _) => Costs::given(microseconds),
        (None, Some(log)) => {
            let then =
                Partition::of(&source.scene, &source.points, log.ranks.min(count) as usize).weighed(source.weight);
            Costs::measured(log, &then)
        }
        (None, None) => Costs::of_space(source.scene.space),
    };
    let machine =
        Machine { latency: 1e-6 * options.latency, bandwidth: 1e9 * options.bandwidth, overlap: options.overlap };
    let rows: Vec<table::Row> = ranks
        .iter()
        .map(|&ranks| {
            let partition = Partition::of(&source.scene, &source.points, ranks as usize).weighed(source.weight);
            let predicted = cost::predict(&partition, &costs, &machine);
            let beside = options.beside.map(|cost| cost::predict(&partition, &Costs::given(cost), &machine));
            table::Row { partition, predicted, beside }
        })
        .collect();
    let table = table::Table { source: &source, costs: &costs, machine: &machine, rows: &rows };
    Ok(if options.json { table.json() } else { table.text() })
}

/// 1, 2, 4 .. as long as each has a thousand particles, up to 4096.
fn powers(count: u64) -> Vec<u64> {
    (0..13).map(|k| 1 << k).filter(|&ranks| ranks == 1 || count / ranks >= 1000).collect()
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        _ => Err("a number above 0 is needed".into()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if (0.0..=1.0).contains(&number) => Ok(number),
        _ => Err("a number from 0 to 1 is needed".into()),
    }
}
