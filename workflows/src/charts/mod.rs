//! `chart`: error against cost of the choices a scene has, for cases with a reference, and the Pareto front of them. The engine is that of
//! [`crate::study`]: templates, runs, results, expressions. The keys of `chart.toml` are told in `tests/charts/README.md`.

mod definition;
mod front;
mod netcdf;
mod page;
mod pairs;
mod picture;
mod points;
mod reduction;
mod singles;
#[cfg(test)]
mod tests;

use crate::{
    bench,
    failure::Failure,
    paths,
    study::{self, Options, batch, numbers, results::Results},
};
use definition::{Chart, PAIRS};
use formats::disk;
use std::path::PathBuf;
use std::time::Duration;

/// Prints the charts, and how much of each is done.
pub fn list() -> Result<(), Failure> {
    for name in definition::shelf().names()? {
        let mut chart = Chart::named(&name)?;
        let has_pairs = pairs::add_kept(&mut chart)?;
        let results = Results::read(&chart.study)?;
        let points = points::of(&chart, &results);
        let more = if has_pairs { "" } else { ", pairs not chosen yet" };
        println!("{name:<16} {}: {}{more}", chart.study.title, study::progress(&chart.study, &results));
        println!("{:<16} {} settings are done; series: {}", "", points.done.len(), chart.study.series.join(", "));
    }
    Ok(())
}

/// Runs what is not there yet, single options first, then pairs of the promising ones; then refreshes table, picture and file.
pub fn carry_out(name: &str, options: &Options) -> Result<(), Failure> {
    let mut chart = Chart::named(name)?;
    chart.study.check_series(&options.only)?;
    let has_pairs = pairs::add_kept(&mut chart)?;
    let mut results = Results::read(&chart.study)?;
    let ended = if options.draw { Ok(()) } else { run(&mut chart, &mut results, options, has_pairs) };
    // Also after a stop: what is there is shown.
    let points = points::of(&chart, &results);
    for path in page::refresh(&chart, &results, &points)? {
        println!("{}", paths::short(&path).display());
    }
    ended
}

fn run(chart: &mut Chart, results: &mut Results, options: &Options, has_pairs: bool) -> Result<(), Failure> {
    note_machine(chart)?;
    let before = results.clone();
    batch::run(&chart.study, results, options)?;
    if has_pairs || options.evaluate || !pairs::choose(chart, results)? {
        return Ok(());
    }
    let is_new = |(name, line): &(&String, &study::results::Line)| before.0.get(*name) != Some(line);
    let cost = |line: &study::results::Line| line.measures.get(numbers::PROCESSOR).copied().unwrap_or(0.0);
    let spent: f64 = results.0.iter().filter(is_new).map(|(_, line)| cost(line)).sum();
    let budget = options.budget.map(|budget| budget.saturating_sub(Duration::from_secs_f64(spent)));
    let first = options.first.map(|_| 0);
    batch::run(&chart.study, results, &Options { budget, first, ..options.clone() })
}

/// The names of the processors that computed a chart, in `processor.txt` beside its results.
fn machine(chart: &Chart) -> String {
    let text = std::fs::read_to_string(machine_path(chart)).unwrap_or_default();
    let names: Vec<&str> = text.lines().collect();
    if names.is_empty() { "an unknown processor".into() } else { names.join(", ") }
}

fn machine_path(chart: &Chart) -> PathBuf {
    chart.study.folder.join("processor.txt")
}

fn note_machine(chart: &Chart) -> Result<(), Failure> {
    let (path, name) = (machine_path(chart), bench::processor());
    let text = std::fs::read_to_string(&path).unwrap_or_default();
    if text.lines().any(|line| line == name) {
        return Ok(());
    }
    disk::write_atomic(&path, format!("{text}{name}\n").as_bytes())
        .map_err(|e| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display())))
}
