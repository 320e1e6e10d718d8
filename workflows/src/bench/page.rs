//! The page on speed.

use super::launches::Launch;
use super::rows::MAIN;
use super::speed::{Measured, spread};
use super::{Spread, processor};
use crate::{failure::Failure, launch, validate::record};
use formats::provenance;
use std::fmt::Write;

/// When, what and where was measured.
#[derive(Clone, Debug)]
pub struct Heading {
    command: String,
    day: String,
    commit: String,
    /// Are there changes that are not committed?
    changed: bool,
    processor: String,
    cores: u32,
    load: String,
}

impl Heading {
    /// Of a benchmark that begins now, by these words behind `./talus bench`.
    pub fn now(words: &str) -> Result<Self, Failure> {
        Self::of(format!("./talus bench {words}"))
    }

    /// Of measurements that begin now, by this command.
    pub fn of(command: String) -> Result<Self, Failure> {
        let sources = record::Sources::now()?;
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        Ok(Self {
            command,
            day: provenance::now()[..10].to_owned(),
            commit: sources.commit,
            changed: sources.changed,
            processor: processor(),
            cores: launch::cores(),
            load: load.split(' ').next().unwrap_or_default().to_owned(),
        })
    }

    /// `By ..., 2026-01-31, commit ..., a processor, 2 cores (load average before: 0.10).`
    pub fn text(&self) -> String {
        let Self { command, day, commit, processor, cores, load, .. } = self;
        let changed = if self.changed { ", with changes that are not committed" } else { "" };
        format!(
            "By `{command}`, {day}, commit {commit}{changed}, {processor}, {cores} cores (load average before: {load})."
        )
    }

    /// One for tests.
    #[cfg(test)]
    pub fn example() -> Self {
        let [command, day, commit, processor, load] =
            ["./talus bench speed", "2026-01-31", "abc", "A processor", "0.10"].map(str::to_owned);
        Self { command, day, commit, changed: false, processor, cores: 2, load }
    }

    /// The day, and the commit, with a plus where it was changed: cells of a table.
    pub fn cells(&self) -> String {
        format!("{} | {}{}", self.day, self.commit, if self.changed { "+" } else { "" })
    }
}

/// Another program's rate on one core, million particle-steps per second.
struct Peer {
    name: &'static str,
    case: &'static str,
    differs: &'static str,
    rate: f64,
}

/// Measured with the same compiler generation on two cores of a shared AMD server with AVX-512.
const PEERS: [Peer; 6] = [
    Peer {
        name: "GraSPH (Fortran, MPI)",
        case: "Drucker-Prager in 3-D, 125 000 particles, 56 neighbours",
        differs: "double precision; four evaluations of the forces a step (Runge-Kutta): 0.89 million evaluations",
        rate: 0.22,
    },
    Peer {
        name: "SPHinXsys (C++, TBB)",
        case: "granular repose angle in 3-D, 48 000 particles, 74 neighbours",
        differs: "double precision; neighbours found anew every step; 236 000 wall particles, which the rate does not count",
        rate: 0.13,
    },
    Peer {
        name: "DualSPHysics 5.4 (C++, OpenMP)",
        case: "water in 3-D, 120 000 particles, 56 neighbours",
        differs: "pairs in single precision; pressure only, no stress tensor; Verlet; 60 000 wall particles not counted",
        rate: 0.75,
    },
    Peer {
        name: "DualSPHysics, non-Newtonian 5.0",
        case: "Herschel-Bulkley-Papanastasiou fluid in 3-D",
        differs: "pairs in single precision; a stress tensor without memory; Verlet",
        rate: 0.51,
    },
    Peer {
        name: "GeoTaichi (Python, Taichi)",
        case: "Drucker-Prager in 3-D, 64 000 points",
        differs: "double precision; the material point method: points and a grid, no pairs",
        rate: 0.51,
    },
    Peer {
        name: "CB-Geo mpm (C++)",
        case: "Mohr-Coulomb in 3-D",
        differs: "double precision; the material point method",
        rate: 0.53,
    },
];

const HOW: &str = "Each row is a column, 0.1 m high and wide (in the plane one half of it, beside its plane of symmetry), that \
was let go on a no-slip floor and is measured from half of its fall, at 0.1 s, over a fixed number of steps: lists, walls, halo, \
laws and the reduction of each step count, start-up and the checkpoint at the end do not (`./talus bench checkpoint` has those). \
`main` and `3d` are the same at two sizes. *1 rank*: alone on its core. *Copy of two*: two copies of that job at once, each pinned to \
a core, mean of both: what the shared memory takes away. *2 ranks*: one job on both cores, both together. The kinds take turns. \
Medians of the repeats, least and largest in brackets.";

const COLUMNS: &str = "*2 ranks : copy*: the gain by a second core; 2 is all there is. *Neighbours*: within the support 2h, of all \
kinds, a mean over particles. *Memory*: peak of one rank's resident memory over its particles, with the program, MPI and the \
buffers of reading and writing: in small scenes mostly that. *Operations*: a pair's, counted from the formulae of the distance, the kernel's slope, the \
velocity gradient and the momentum with its linear viscosity, every addition, multiplication, division, root, minimum and maximum as \
one. *Of peak*: rate x neighbours x operations over what one core does in a loop of fused multiply-adds in double precision. Pairs \
that are looked at but lie outside of the support, points, walls and lists do the rest, and are not counted.";

/// The page.
pub fn speed(heading: &Heading, rows: &[Measured], peak: f64, quick: bool) -> String {
    let quick = if quick { "Coarse scenes, few steps, from early on: **these figures mean nothing.** " } else { "" };
    let mut text = format!("# How fast the steps are\n\n{} {quick}{HOW}\n\n", heading.text());
    text += "Million particle-steps per second:\n\n\
             | row | space | law | kernel | precision | particles | steps | 1 rank | copy of two | 2 ranks | 2 ranks : copy | 2 ranks : 1 |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|\n";
    let cell = |spread: Option<Spread>, digits: usize| spread.map_or_else(|| "-".into(), |s| s.text(digits));
    for measured in rows {
        let (row, one) = (&measured.row, &measured.one[0]);
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            row.name,
            row.space.name(),
            row.law.name(),
            row.kernel.name(),
            row.precision,
            one.particles(),
            row.steps,
            measured.alone().text(3),
            cell(measured.copy(), 3),
            cell(measured.both(), 3),
            cell(measured.gain(), 2),
            cell(measured.plain_gain(), 2),
        );
    }
    let _ = write!(
        text,
        "\n| row | neighbours | operations a pair | of peak ({:.1} GFLOP/s) | memory, bytes a particle |\n|---|---|---|---|---|\n",
        1e-9 * peak
    );
    for measured in rows {
        let median = |of: &dyn Fn(&Launch) -> f64| spread(measured.one.iter().map(of)).median;
        let (neighbours, memory) = (median(&|launch| launch.of("neighbours")), median(&|launch| launch.bytes()));
        let (name, operations) = (measured.row.name, measured.row.operations());
        let share = 100.0 * measured.share_of_peak(peak);
        let _ = writeln!(text, "| {name} | {neighbours:.1} | {operations} | {share:.1} % | {memory:.0} |");
    }
    let _ = write!(
        text,
        "\n{COLUMNS}\n\n## Where the time goes\n\nPercent of the steps' time, in the launch of the middle rate; on two ranks means of both.\n"
    );
    phases(&mut text, "one rank", rows.iter().map(|row| (row.row.name, row.one.as_slice())));
    phases(&mut text, "two ranks", rows.iter().map(|row| (row.row.name, row.two.as_slice())));
    if let Some(main) = rows.iter().find(|row| row.row.name == MAIN) {
        peers(&mut text, main.alone().median);
    }
    text
}

fn phases<'a>(text: &mut String, title: &str, rows: impl Iterator<Item = (&'a str, &'a [Launch])>) {
    let rows: Vec<_> = rows.filter(|(_, launches)| !launches.is_empty()).collect();
    let Some((_, launches)) = rows.first() else { return };
    let names = launches[0].phases();
    let _ = write!(text, "\n| {title} | {} |\n|---|{}\n", names.join(" | "), "---|".repeat(names.len()));
    for (row, launches) in &rows {
        let launch = middle(launches);
        let share = |name: &&str| format!("{:.1}", 100.0 * launch.of(name) / launch.seconds());
        let shares: Vec<String> = names.iter().map(share).collect();
        let _ = writeln!(text, "| {row} | {} |", shares.join(" | "));
    }
}

/// The launch of the middle rate: its shares add up, which medians of each would not.
fn middle(launches: &[Launch]) -> &Launch {
    let mut sorted: Vec<&Launch> = launches.iter().collect();
    sorted.sort_by(|a, b| a.rate().total_cmp(&b.rate()));
    sorted[sorted.len() / 2]
}

fn peers(text: &mut String, main: f64) {
    *text += "\n## Beside other programs\n\nTheir rates on one core, measured before with the programs as published and on an AMD Zen 5 \
              server: another processor is faster or slower by itself. No two of them compute the same: a ratio says how much material moves in a second of \
              computing, not who solves a problem best.\n\n\
              | program | case | what differs | rate | `main` over it |\n|---|---|---|---|---|\n";
    for Peer { name, case, differs, rate } in &PEERS {
        let _ = writeln!(text, "| {name} | {case} | {differs} | {rate} | {:.1} |", main / rate);
    }
}

#[cfg(test)]
mod tests {
    use super::super::launches::tests::launch;
    use super::super::rows::ROWS;
    use super::*;

    /// Rows of tables have as many cells as their heads.
    fn is_even(page: &str) -> bool {
        let mut width = None;
        page.lines().all(|line| {
            let cells = line.matches('|').count();
            let even = cells == 0 || width.is_none_or(|width| width == cells);
            width = (cells > 0).then_some(cells);
            even
        })
    }

    #[test]
    fn the_page_has_all_tables() {
        let two = || vec![launch(0.05, 2)];
        let one = || vec![launch(0.1, 1)];
        let copies = || vec![[launch(0.125, 1), launch(0.125, 1)]];
        let rows = [0, 6].map(|row| Measured { row: ROWS[row], one: one(), copies: copies(), two: two() });
        let page = speed(&Heading::example(), &rows, 0.89e9, false);
        assert!(is_even(&page), "{page}");
        for text in [
            "By `./talus bench speed`, 2026-01-31, commit abc, A processor, 2 cores (load average before: 0.10).",
            "| main | 3d | drucker-prager | cubic-spline | f64 | 1000 | 100 | 0.100 (0.100 - 0.100) | 0.080 ",
            "| 2.50 (2.50 - 2.50) | 2.00 (2.00 - 2.00) |",
            "| main | 50.0 | 89 | 50.0 % | 500 |",
            "of peak (0.9 GFLOP/s)",
            "| one rank | gradient | lists |",
            "| two ranks | gradient | lists |",
            "| rz | 75.0 | 25.0 |",
            "| 0.22 | 0.5 |",
        ] {
            assert!(page.contains(text), "{text}\n{page}");
        }
    }

    #[test]
    fn shares_are_those_of_the_middle_launch() {
        let launches = [0.3, 0.1, 0.2].map(|seconds| launch(seconds, 1));
        assert_eq!(middle(&launches), &launches[2]);
    }

    #[test]
    fn one_core_and_other_rows_leave_tables_out() {
        let rows = [Measured { row: ROWS[5], one: vec![launch(0.1, 1)], copies: vec![], two: vec![] }];
        let page = speed(&Heading::example(), &rows, 1e9, true);
        assert!(is_even(&page) && page.contains("| 0.100 (0.100 - 0.100) | - | - | - | - |"), "{page}");
        assert!(page.contains("mean nothing"), "{page}");
        assert!(!page.contains("two ranks |") && !page.contains("Beside other programs"), "{page}");
    }
}
