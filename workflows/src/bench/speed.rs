//! How fast the steps are: rates of one rank, of two copies of the one-rank job at once, and of two ranks.

use super::launches::{Launch, On, Place, processors};
use super::page::{self, Heading};
use super::rows::{self, Row};
use super::{Spread, folder, peak, programs, write};
use crate::{failure::Failure, paths};
use std::path::{Path, PathBuf};

/// What is measured, and how often.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Only rows whose names contain one of these words.
    #[arg(long, value_name = "WORD,..", value_delimiter = ',')]
    rows: Vec<String>,
    /// How often each figure is measured; 5 where it is left out.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    repeats: Option<u32>,
    /// Coarse scenes, few steps, once: shows in a minute that everything works. The page goes into the work folder.
    #[arg(long)]
    quick: bool,
    /// Take the scenes to the middle of their collapse anew.
    #[arg(long)]
    fresh: bool,
    /// Peak of one core in double precision; measured where it is left out.
    #[arg(long, value_name = "GFLOP/S")]
    peak: Option<f64>,
    /// Measure the programs in this folder instead of building them.
    #[arg(long, value_name = "DIR")]
    programs: Option<PathBuf>,
    /// Work folder; runs/bench/speed where it is left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Launches of one row, one of each kind a repeat.
#[derive(Clone, Debug)]
pub struct Measured {
    pub row: Row,
    /// One rank alone.
    pub one: Vec<Launch>,
    /// The same twice at once, on two cores; none on a machine with one.
    pub copies: Vec<[Launch; 2]>,
    pub two: Vec<Launch>,
}

/// The kinds of launches.
#[derive(Clone, Copy)]
enum Kind {
    One,
    Copies,
    Two,
}

/// Measures the chosen rows. Returns the page.
pub fn measure(options: &Options) -> Result<PathBuf, Failure> {
    let chosen = rows::chosen(&options.rows)?;
    let programs = programs(options.programs.as_deref())?;
    let work = match &options.out {
        Some(folder) => paths::from_caller(folder),
        None => paths::runs().join("bench").join("speed"),
    };
    let (work, repeats) = match options.quick {
        true => (work.join("quick"), options.repeats.unwrap_or(1)),
        false => (work, options.repeats.unwrap_or(5)),
    };
    let heading = Heading::now(&words(options))?;
    let peak = options.peak.map_or_else(peak::measured, |peak| 1e9 * peak);
    let mut measured = Vec::new();
    for row in chosen {
        let row = if options.quick { row.quick() } else { row };
        let place = Place::new(&work, row);
        place.prepare(&programs, options.fresh)?;
        measured.push((place, Measured { row, one: Vec::new(), copies: Vec::new(), two: Vec::new() }));
    }
    let sph_run = programs.path("sph-run");
    for repeat in 0..repeats {
        for (place, row) in &mut measured {
            once(place, row, &sph_run, repeat)?;
            let alone = row.one.last().map_or(0.0, Launch::rate);
            eprintln!("talus: {}, {} of {repeats}: {alone:.3} M particle-steps/s", row.row.name, repeat + 1);
        }
    }
    let measured: Vec<Measured> = measured.into_iter().map(|(_, row)| row).collect();
    let place = if options.quick { work } else { folder() };
    write(&place.join("speed.md"), &page::speed(&heading, &measured, peak, options.quick))
}

/// The words that measure the same again.
fn words(options: &Options) -> String {
    let mut words = String::from("speed");
    if !options.rows.is_empty() {
        words += &format!(" --rows {}", options.rows.join(","));
    }
    if let Some(repeats) = options.repeats {
        words += &format!(" --repeats {repeats}");
    }
    if options.quick {
        words += " --quick";
    }
    if let Some(folder) = &options.programs {
        words += &format!(" --programs {}", folder.display());
    }
    words
}

/// Each kind of launch once. What disturbs the machine for a while should not always meet the same kind.
fn once(place: &Place, row: &mut Measured, sph_run: &Path, repeat: u32) -> Result<(), Failure> {
    let cores = processors();
    let mut kinds = [Kind::One, Kind::Copies, Kind::Two];
    kinds.rotate_left(repeat as usize % 3);
    for kind in kinds {
        match (kind, cores.get(1)) {
            (Kind::One, _) => {
                let core = cores[repeat as usize % cores.len().min(2)];
                row.one.push(place.timed(sph_run, "one", On::Processor(core))?);
            }
            (Kind::Copies, Some(&second)) => {
                let copy = |number: u32, name: &'static str| place.timed(sph_run, name, On::Processor(number));
                let both = std::thread::scope(|scope| {
                    let other = scope.spawn(|| copy(second, "copy-1"));
                    let one = copy(cores[0], "copy-0");
                    other.join().map(|other| Ok::<_, Failure>([one?, other?]))
                });
                row.copies.push(both.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
            }
            (Kind::Two, Some(_)) => row.two.push(place.timed(sph_run, "two", On::Ranks(2))?),
            (Kind::Copies | Kind::Two, None) => {}
        }
    }
    Ok(())
}

impl Measured {
    /// Rates of one rank, million particle-steps per second.
    pub fn alone(&self) -> Spread {
        spread(self.one.iter().map(Launch::rate))
    }

    /// The mean rate of a copy.
    pub fn copy(&self) -> Option<Spread> {
        (!self.copies.is_empty()).then(|| spread(self.copies.iter().map(mean_rate)))
    }

    /// Rates of two ranks together.
    pub fn both(&self) -> Option<Spread> {
        (!self.two.is_empty()).then(|| spread(self.two.iter().map(Launch::rate)))
    }

    /// Two ranks over a copy, measured one after the other: 2 is all that two cores can bring, whatever the memory they share
    /// takes from each.
    pub fn gain(&self) -> Option<Spread> {
        let pairs = self.two.iter().zip(&self.copies);
        (!self.two.is_empty()).then(|| spread(pairs.map(|(two, copies)| two.rate() / mean_rate(copies))))
    }

    /// Two ranks over one alone.
    pub fn plain_gain(&self) -> Option<Spread> {
        (!self.two.is_empty()).then(|| spread(self.two.iter().zip(&self.one).map(|(two, one)| two.rate() / one.rate())))
    }

    /// Counted operations over what a core can do at most.
    pub fn share_of_peak(&self, peak: f64) -> f64 {
        let neighbours = spread(self.one.iter().map(|launch| launch.of("neighbours"))).median;
        1e6 * self.alone().median * neighbours * self.row.operations() as f64 / peak
    }
}

fn mean_rate(copies: &[Launch; 2]) -> f64 {
    0.5 * (copies[0].rate() + copies[1].rate())
}

/// Of some numbers.
pub fn spread(numbers: impl Iterator<Item = f64>) -> Spread {
    Spread::of(&numbers.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::super::launches::tests::launch;
    use super::*;

    pub fn measured(two: &[f64]) -> Measured {
        let copies = two.iter().map(|_| [launch(0.1, 1), launch(0.3, 1)]).collect();
        let one = [0.1, 0.2, 0.05].map(|seconds| launch(seconds, 1)).to_vec();
        let two = two.iter().map(|&seconds| launch(seconds, 2)).collect();
        Measured { row: rows::ROWS[0], one, copies, two }
    }

    #[test]
    fn rates_and_gains() {
        let row = measured(&[0.05, 0.1, 0.025]);
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        assert!(near(row.alone().median, 0.1) && near(row.alone().largest, 0.2) && near(row.alone().least, 0.05));
        // Copies at 0.1 and 0.0333.
        assert!(near(row.copy().unwrap().median, 0.2 / 3.0) && near(row.both().unwrap().median, 0.2));
        assert!(near(row.gain().unwrap().median, 3.0) && near(row.plain_gain().unwrap().median, 2.0));
        // 50 neighbours, 89 operations each.
        assert!(near(row.share_of_peak(0.89e9), 0.5));
        let single = measured(&[]);
        assert!(single.both().is_none() && single.gain().is_none() && single.copy().is_none());
    }

    #[test]
    fn words_come_back() {
        let options = Options {
            rows: vec!["rz".into(), "3d".into()],
            repeats: Some(3),
            quick: true,
            fresh: true,
            peak: None,
            programs: Some("old".into()),
            out: None,
        };
        assert_eq!(words(&options), "speed --rows rz,3d --repeats 3 --quick --programs old");
    }
}
