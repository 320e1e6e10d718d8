//! `bench`: what costs how much, measured so that anyone can repeat it.

mod callgrind;
mod checkpoint;
mod instructions;
pub mod launches;
pub mod page;
mod peak;
mod rows;
mod speed;

use crate::{failure::Failure, paths, stage::Programs};
use formats::disk;
use std::path::{Path, PathBuf};

/// What can be measured.
#[derive(Debug, clap::Subcommand)]
pub enum Bench {
    /// Checkpoints: bandwidth beside the file system's own, share of the time at the automatic interval, time to restart.
    Checkpoint {
        /// Particles of the scene, about.
        #[arg(long, value_name = "N", default_value_t = 1_000_000)]
        particles: u64,
        /// Numbers of ranks.
        #[arg(long, value_name = "N,..", value_delimiter = ',', default_values_t = [1, 2])]
        ranks: Vec<u32>,
    },
    /// Steps of a table of scenes: rates on one core and on two, shares of the parts of a step, memory.
    Speed {
        #[command(flatten)]
        options: speed::Options,
    },
    /// Instructions of a particle-step, beside earlier figures: for small changes, which times do not show.
    Instructions {
        #[command(flatten)]
        options: instructions::Options,
    },
}

/// Measures, and writes the table into tests/bench.
pub fn carry_out(bench: &Bench) -> Result<(), Failure> {
    let page = match bench {
        Bench::Checkpoint { particles, ranks } => checkpoint::measure(*particles, ranks)?,
        Bench::Speed { options } => speed::measure(options)?,
        Bench::Instructions { options } => instructions::measure(options)?,
    };
    println!("{}", paths::short(&page).display());
    Ok(())
}

/// Where the tables are kept.
pub fn folder() -> PathBuf {
    paths::repository().join("tests").join("bench")
}

/// The programs that are measured: built now, or those in a folder.
pub fn programs(folder: Option<&Path>) -> Result<Programs, Failure> {
    match folder {
        Some(folder) => Programs::installed(&paths::from_caller(folder)),
        None => Programs::build(),
    }
}

/// Writes a page, with the folders on the way to it. Returns its path.
pub fn write(page: &Path, text: &str) -> Result<PathBuf, Failure> {
    let folder = page.parent().unwrap_or(page);
    std::fs::create_dir_all(folder).map_err(|e| Failure::cannot_write(format!("{}: {e}", folder.display())))?;
    disk::write_atomic(page, text.as_bytes()).map_err(|e| Failure::cannot_write(e.to_string()))?;
    Ok(page.to_owned())
}

/// The processor's name.
pub fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    name.map_or_else(|| "unknown processor".into(), |(_, name)| name.trim().to_owned())
}

/// Least, middle and largest of some numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    least: f64,
    median: f64,
    largest: f64,
}

impl Spread {
    /// # Panics
    /// Of no numbers.
    fn of(numbers: &[f64]) -> Self {
        let mut sorted = numbers.to_vec();
        sorted.sort_by(f64::total_cmp);
        Self { least: sorted[0], median: sorted[sorted.len() / 2], largest: sorted[sorted.len() - 1] }
    }

    /// `0.52 (0.48 - 0.61)`.
    fn text(&self, digits: usize) -> String {
        let Self { least, median, largest } = self;
        format!("{median:.digits$} ({least:.digits$} - {largest:.digits$})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads() {
        let spread = Spread::of(&[3.0, 1.0, 2.0]);
        assert_eq!(spread, Spread { least: 1.0, median: 2.0, largest: 3.0 });
        assert_eq!(spread.text(1), "2.0 (1.0 - 3.0)");
    }
}
