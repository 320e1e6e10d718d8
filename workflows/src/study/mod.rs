//! `study`: families of runs over parameters, kept as one line a run in `tests/validation/<study>/results.csv`, and shown in
//! VALIDATION.md. The keys of `study.toml` are told in `tests/validation/README.md`.

pub mod batch;
pub mod chart;
pub mod cost;
mod coverage;
pub mod definition;
pub mod expression;
pub mod numbers;
pub mod page;
pub mod paper;
mod reference;
pub mod results;
pub mod table;
pub mod template;
#[cfg(test)]
mod tests;

use crate::{failure::Failure, paths};
use definition::Study;
use results::Results;
use std::time::Duration;

/// How a study is carried out.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Only these series.
    #[arg(long, value_name = "SERIES", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Keep results that other sources computed from the same scene.
    #[arg(long)]
    pub reuse: bool,
    /// MPI ranks of each run; one where several run at a time, else as many as the scene can feed.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub ranks: Option<u32>,
    /// Runs at a time.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), default_value_t = 1)]
    pub jobs: u32,
    /// Only so many of the runs that are to do: the cheapest ones.
    #[arg(long, value_name = "N")]
    pub first: Option<usize>,
    /// Begin no further run once those of this call have taken so much processor time, such as 20m.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub budget: Option<Duration>,
    /// Run nothing: tables and pictures from the results that are kept.
    #[arg(long, conflicts_with_all = ["evaluate", "first", "budget"])]
    pub draw: bool,
    /// Run nothing new: sph-post again on the run folders that are done, for measures that are new.
    #[arg(long, conflicts_with = "first")]
    pub evaluate: bool,
}

/// Prints the studies, and how much of each is done.
pub fn list() -> Result<(), Failure> {
    for name in definition::shelf().names()? {
        let study = Study::named(&name)?;
        let results = Results::read(&study)?;
        println!("{name:<16} {}: {}", study.title, progress(&study, &results));
        println!("{:<16} series: {}", "", study.series.join(", "));
    }
    Ok(())
}

/// `3 of 5 runs, about 12 min left`.
pub fn progress(study: &Study, results: &Results) -> String {
    let is_now =
        |run: &&definition::Run| results.of(run).is_some_and(|line| line.exit == 0 && line.scene == results::hash(run));
    let done = study.runs.iter().filter(is_now).count();
    let left = study.runs.iter().filter(|run| !is_now(run)).map(|run| run.seconds).sum();
    let rest = if done == study.runs.len() { String::new() } else { format!(", about {} left", duration(left)) };
    format!("{done} of {} runs{rest}", study.runs.len())
}

/// Runs what is not there yet, then refreshes tables and pictures.
pub fn carry_out(name: &str, options: &Options) -> Result<(), Failure> {
    let study = Study::named(name)?;
    study.check_series(&options.only)?;
    let mut results = Results::read(&study)?;
    let ended = match options.draw {
        true => Ok(()),
        false => batch::run(&study, &mut results, options),
    };
    // Also after a stop: what is there is shown.
    for path in page::refresh(&study, &results)? {
        println!("{}", paths::short(&path).display());
    }
    ended
}

/// `40 s`, `12 min`, `3.4 h`.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
