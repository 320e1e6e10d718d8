//! `faults`: the long campaign of kills, failing and full disks, and damage to files, against the release programs.
//! What the tests of `tests/restart` sample, it does at every call and place.
//!
//! Each trial is a small run of its own that something is done to, is held against the uninterrupted run, and has a
//! name that says all about it. Results go to `runs/faults/trials.csv` as they come, so a campaign that was stopped
//! goes on; tests/faults/REPORT.md is made of them.

mod ground;
mod launcher;
mod plan;
mod report;
mod results;
mod trial;

use crate::validate::record::Sources;
use crate::{failure::Failure, launch, paths, stage};
use formats::exit;
use ground::Ground;
use plan::Trial;
use results::Results;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use xshell::cmd;

/// How long a campaign is, and which trials are in it.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Kills: two thirds at calls, all of one rank's first, a third at random moments.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    pub kills: usize,
    /// Of all other trials do every K-th only.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub every: u64,
    /// Chooses moments, places and bits.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Only trials whose name begins so, such as `kill` or "full plane".
    #[arg(long, value_name = "NAME")]
    pub only: Option<String>,
    /// Stop after so many hours; the same command goes on.
    #[arg(long, value_name = "H")]
    pub hours: Option<f64>,
    /// Trials at a time; the machine's cores where it is left out.
    #[arg(long, value_name = "N")]
    pub jobs: Option<usize>,
}

/// The programs, and the library that makes system calls fail.
#[derive(Clone, Debug)]
pub struct Programs {
    pub sph_prep: PathBuf,
    pub sph_run: PathBuf,
    pub shim: PathBuf,
}

/// Does what is still to be done, and makes the report. Fails with exit code 70 where something was found.
pub fn carry_out(options: &Options) -> Result<(), Failure> {
    let begun = Instant::now();
    let programs = build()?;
    let work = launcher::work_folder()?;
    let sources = Sources::now()?;
    let outcome = campaign(options, &programs, &work, &sources, begun);
    // What failed was moved away.
    let _ = std::fs::remove_dir_all(&work);
    outcome
}

fn campaign(
    options: &Options,
    programs: &Programs,
    work: &std::path::Path,
    sources: &Sources,
    begun: Instant,
) -> Result<(), Failure> {
    eprintln!("talus: uninterrupted runs, and a count of their calls");
    let grounds = ground::all(programs, work)?;
    let trials = plan::all(options, &grounds);
    let mut results = Results::open(sources, options.seed)?;
    let wanted = |trial: &&Trial| options.only.as_ref().is_none_or(|only| trial.name.starts_with(only));
    let to_do: Vec<&Trial> = trials.iter().filter(wanted).filter(|trial| !results.has(&trial.name)).collect();
    eprintln!("talus: {} trials, {} of them still to do", trials.iter().filter(wanted).count(), to_do.len());
    let limit = options.hours.map(|hours| Duration::from_secs_f64(hours.max(0.0) * 3600.0));
    let left = run_all(options, programs, &grounds, work, &to_do, &mut results, || {
        limit.is_some_and(|limit| begun.elapsed() > limit)
    })?;
    let found = report::write(&results, sources, options.seed, left)?;
    println!("{}", paths::short(&report::path()).display());
    if left > 0 {
        let message = format!("stopped with {left} trials to do; go on with the same command");
        return Err(Failure { code: exit::RESUMABLE, message });
    }
    match found {
        0 => Ok(()),
        found => Err(Failure {
            code: exit::NUMERICAL,
            message: format!("{found} trials found something, see the report; their folders are in runs/faults"),
        }),
    }
}

/// Does trials, some at a time. Returns how many were left undone.
fn run_all(
    options: &Options,
    programs: &Programs,
    grounds: &[Ground],
    work: &std::path::Path,
    trials: &[&Trial],
    results: &mut Results,
    time_is_up: impl Fn() -> bool + Sync,
) -> Result<usize, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(|e| Failure::no_input(format!("cannot watch for signals: {e}")))?;
    }
    let jobs = options.jobs.unwrap_or_else(|| launch::cores() as usize).max(1);
    let (next, total) = (AtomicUsize::new(0), trials.len());
    let kept = Mutex::new((results, None));
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) && !time_is_up() {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(trial) = trials.get(number) else { return };
                    let outcome = trial::carry_out(programs, grounds, trial, work);
                    let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                    let told = outcome.and_then(|outcome| {
                        if !outcome.findings.is_empty() {
                            eprintln!("talus: {}: {}", trial.name, outcome.findings.join("; "));
                            eprintln!(
                                "talus:   once more: ./talus faults --seed {} --only \"{}\"",
                                options.seed, trial.name
                            );
                        }
                        kept.0.add(&trial.name, outcome)
                    });
                    if let Err(failure) = told {
                        kept.1.get_or_insert(failure);
                        return;
                    }
                    if (number + 1).is_multiple_of(50) || number + 1 == total {
                        eprintln!("talus: {} of {total} trials", number + 1);
                    }
                }
            });
        }
    });
    let (results, failure) = kept.into_inner().unwrap_or_else(PoisonError::into_inner);
    match failure {
        Some(failure) => Err(failure),
        None => Ok(trials.iter().filter(|trial| !results.has(&trial.name)).count()),
    }
}

/// Builds the programs and the library in release.
fn build() -> Result<Programs, Failure> {
    let shell = launch::shell()?;
    let own = std::env::current_exe().map_err(|e| Failure::no_input(format!("cannot find this program: {e}")))?;
    let target = own.parent().and_then(std::path::Path::parent).map(std::path::Path::to_path_buf);
    let target = target.ok_or_else(|| Failure::no_input(format!("{}: not in a target folder", own.display())))?;
    let cargo = stage::cargo();
    for what in [&["-p", "sph-prep", "-p", "sph-run"][..], &["-p", "tests", "--example", "shim"]] {
        cmd!(shell, "{cargo} build --quiet --release --target-dir {target} {what...}").quiet().run()?;
    }
    let release = target.join("release");
    Ok(Programs {
        sph_prep: release.join("sph-prep"),
        sph_run: release.join("sph-run"),
        shim: release.join("examples/libshim.so"),
    })
}
