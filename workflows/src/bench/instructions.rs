//! Counted instructions of a step: they hardly depend on what else the machine does, so that small changes show.

use super::callgrind::{self, Counts};
use super::launches::{Launch, Place, expect_stop};
use super::page::Heading;
use super::rows::{ROWS, Row};
use super::{folder, programs, write};
use crate::{failure::Failure, launch, paths};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use xshell::cmd;

/// Two launches of so many steps: their difference is free of the start, the end and the checkpoint.
const STEPS: [u64; 2] = [20, 60];
/// Functions on the page, and earlier figures.
const FUNCTIONS: usize = 15;
const EARLIER: usize = 30;

/// How instructions are counted.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// What counts them.
    #[arg(long, value_enum, default_value_t = Tool::Callgrind)]
    tool: Tool,
    /// A coarse scene and few steps: shows that everything works. The page goes into the work folder.
    #[arg(long)]
    quick: bool,
    /// Take the scene to the middle of its collapse anew.
    #[arg(long)]
    fresh: bool,
    /// Measure the programs in this folder instead of building them.
    #[arg(long, value_name = "DIR")]
    programs: Option<PathBuf>,
    /// Work folder; runs/bench/instructions where it is left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// A tool that counts instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Tool {
    /// valgrind's callgrind: by function; some fifty times slower; without AVX-512, so that programs which choose among
    /// vectors take AVX2.
    Callgrind,
    /// perf stat: the processor's own counter, which many virtual machines do not have.
    Perf,
}

impl Tool {
    fn name(self) -> &'static str {
        match self {
            Self::Callgrind => "callgrind",
            Self::Perf => "perf",
        }
    }

    /// Is it there?
    ///
    /// # Errors
    /// What is missing, and where to get it.
    fn check(self) -> Result<(), Failure> {
        let (program, package) = match self {
            Self::Callgrind => ("valgrind", "valgrind"),
            Self::Perf => ("perf", "linux-perf"),
        };
        let mut version = Command::new(program);
        version.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        version.status().map(|_| ()).map_err(|e| {
            Failure::no_input(format!(
                "{program}, which counts the instructions, cannot be started: {e}; on Debian and Ubuntu: apt-get install {package}"
            ))
        })
    }
}

/// Half of the fall of some 13 000 particles.
fn row(quick: bool) -> Row {
    let row = Row { name: "3d", spacing: 6.25, ..ROWS[0] };
    if quick { row.quick() } else { row }
}

/// Counts, and writes the page. Returns it.
pub fn measure(options: &Options) -> Result<PathBuf, Failure> {
    options.tool.check()?;
    let programs = programs(options.programs.as_deref())?;
    let work = match &options.out {
        Some(folder) => paths::from_caller(folder),
        None => paths::runs().join("bench").join("instructions"),
    };
    let work = if options.quick { work.join("quick") } else { work };
    let heading = Heading::now(&words(options))?;
    let place = Place::new(&work, row(options.quick));
    place.prepare(&programs, options.fresh)?;
    let steps = if options.quick { STEPS.map(|steps| steps / 10) } else { STEPS };
    let mut counts = Vec::new();
    for steps in steps {
        eprintln!("talus: {steps} steps under {}", options.tool.name());
        counts.push(counted(options.tool, &place, &programs.path("sph-run"), steps)?);
    }
    let (particles, few, many) = (counts[0].0, &counts[0].1, &counts[1].1);
    let particle_steps = particles * (steps[1] - steps[0]) as f64;
    let page = if options.quick { work } else { folder() }.join("instructions.md");
    let before = std::fs::read_to_string(&page).unwrap_or_default();
    let figure = Figure {
        tool: options.tool.name(),
        particles,
        steps,
        total: many.total.saturating_sub(few.total) as f64 / particle_steps,
        functions: many.since(few).into_iter().map(|(name, count)| (name, count as f64 / particle_steps)).collect(),
    };
    write(&page, &text(&heading, &figure, &before))
}

/// The words that count the same again.
fn words(options: &Options) -> String {
    let mut words = String::from("instructions");
    if options.tool != Tool::Callgrind {
        words += &format!(" --tool {}", options.tool.name());
    }
    if options.quick {
        words += " --quick";
    }
    if let Some(folder) = &options.programs {
        words += &format!(" --programs {}", folder.display());
    }
    words
}

/// Particles, and the instructions of a launch on one rank.
fn counted(tool: Tool, place: &Place, sph_run: &Path, steps: u64) -> Result<(f64, Counts), Failure> {
    let copy = place.copy(tool.name())?;
    let (shell, words) = (launch::shell()?, place.words(&copy, steps));
    let (result, log) = (copy.join("counts.txt"), copy.with_extension("txt"));
    let command = match tool {
        Tool::Callgrind => cmd!(shell, "valgrind --tool=callgrind --callgrind-out-file={result} {sph_run}"),
        Tool::Perf => cmd!(shell, "perf stat -x , -e instructions:u -o {result} {sph_run}"),
    };
    expect_stop(launch::wait_with(command.args(words), launch::Stop::AtOnce, Some(&log))?, &log)?;
    let text = std::fs::read_to_string(&result)
        .map_err(|e| Failure::no_input(format!("{}: {e}; see {}", result.display(), log.display())))?;
    let counts = match tool {
        Tool::Callgrind => callgrind::parse(&text),
        Tool::Perf => perf(&text).map(|total| Counts { total, ..Counts::default() }),
    };
    let counts = counts.ok_or_else(|| {
        Failure::no_input(match tool {
            Tool::Callgrind => format!("{}: not what callgrind writes", result.display()),
            Tool::Perf => "perf cannot count instructions on this machine: use --tool callgrind".into(),
        })
    })?;
    let particles = Launch::read(&copy)?.particles();
    let _ = std::fs::remove_dir_all(&copy);
    Ok((particles, counts))
}

/// The count in what `perf stat -x ,` wrote.
fn perf(text: &str) -> Option<u64> {
    text.lines().find(|line| line.contains(",instructions"))?.split(',').next()?.parse().ok()
}

/// What was counted.
struct Figure {
    tool: &'static str,
    particles: f64,
    steps: [u64; 2],
    /// A particle-step.
    total: f64,
    /// The same, by function, largest first.
    functions: Vec<(String, f64)>,
}

/// The page; `before`: the last one.
fn text(heading: &Heading, figure: &Figure, before: &str) -> String {
    let Figure { tool, particles, steps: [few, many], total, functions } = figure;
    // Only counts by the same tool, of as many particles and steps, can be compared.
    let what = format!("{tool} | {particles} | {few} to {many}");
    let earlier: Vec<&str> = before.lines().filter(|line| is_figure(line)).take(EARLIER).collect();
    let last = earlier.iter().find(|line| line.contains(&format!(" | {what} | "))).and_then(|line| total_of(line));
    let change = last.map_or_else(|| "-".into(), |last| format!("{:+.2} %", 100.0 * (total / last - 1.0)));
    let mut text = format!(
        "# Instructions of a particle-step\n\n{} A column in three dimensions (Drucker-Prager, cubic spline, no-slip floor) in the \
         middle of its collapse, on one rank. Counted are two launches; what the longer one has more, over its particle-steps, is \
         the figure: start and end drop out. It hardly depends on what else the machine does; but instructions are not time: \
         some do more than others, and some wait. callgrind knows no AVX-512: a program that chooses its vectors takes AVX2 \
         there.\n\n{HEAD}\n|---|---|---|---|---|---|---|\n",
        heading.text()
    );
    let _ = writeln!(text, "| {} | {what} | {total:.1} | {change} |", heading.cells());
    for line in earlier {
        let _ = writeln!(text, "{line}");
    }
    if !functions.is_empty() {
        text += "\nOf the newest, by function (what the compiler put into it included, what it calls not):\n\n\
                 | function | instructions a particle-step | share |\n|---|---|---|\n";
        for (name, count) in functions.iter().take(FUNCTIONS) {
            let _ = writeln!(text, "| `{}` | {count:.1} | {:.1} % |", name.replace('|', "/"), 100.0 * count / total);
        }
    }
    text
}

/// Columns of the figures.
const HEAD: &str = "| day | commit | tool | particles | steps | instructions a particle-step | change |";

/// Is this line a row below [`HEAD`]?
fn is_figure(line: &str) -> bool {
    line.starts_with("| 2") && line.matches(" | ").count() == HEAD.matches(" | ").count()
}

/// The figure in such a row.
fn total_of(line: &str) -> Option<f64> {
    line.split(" | ").nth(5)?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::scene::Scene;

    fn figure(total: f64, tool: &'static str) -> Figure {
        let functions = vec![("sweep<|i|>".into(), 0.75 * total), ("other".into(), 0.25 * total)];
        Figure { tool, particles: 12_880.0, steps: STEPS, total, functions }
    }

    #[test]
    fn earlier_figures_stay_below_the_new_one() {
        let heading = Heading::example();
        let first = text(&heading, &figure(8000.0, "callgrind"), "");
        assert!(first.contains("| 2026-01-31 | abc | callgrind | 12880 | 20 to 60 | 8000.0 | - |"), "{first}");
        assert!(first.contains("| `sweep</i/>` | 6000.0 | 75.0 % |"), "{first}");
        let other = text(&heading, &figure(5000.0, "perf"), &first);
        assert!(other.contains("| perf | 12880 | 20 to 60 | 5000.0 | - |"), "{other}");
        let third = text(&heading, &figure(6000.0, "callgrind"), &other);
        let rows: Vec<&str> = third.lines().filter(|line| is_figure(line)).collect();
        assert_eq!(rows.len(), 3, "{third}");
        assert!(rows[0].ends_with("| 6000.0 | -25.00 % |") && rows[1].contains("perf"), "{third}");
        assert_eq!(rows[2], first.lines().find(|line| is_figure(line)).unwrap());
    }

    #[test]
    fn what_perf_says() {
        let text = "# started on Mon Jan  1\n\n123456,,instructions:u,1000,100.00,,\n";
        assert_eq!(perf(text), Some(123_456));
        assert_eq!(perf("<not supported>,,instructions:u,0,100.00,,\n"), None);
        assert_eq!(perf(""), None);
    }

    #[test]
    fn its_scene_is_valid_and_small() {
        for row in [row(false), row(true)] {
            Scene::read("scene", &row.scene(row.middle)).unwrap_or_else(|error| panic!("{error}"));
        }
        let count = std::f64::consts::PI * (100.0 / row(false).spacing).powi(3);
        assert!((8_000.0..20_000.0).contains(&count), "{count}");
    }
}
