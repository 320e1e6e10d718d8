//! `sph-post`: from the snapshots of a run to numbers (`post/results.nc`, `post/history.nc`) and pictures.
//!
//! Threads ([`workers`]) evaluate a snapshot each; of several ranks one works. [`geometry`] says what the scene means for the evaluation,
//! [`sample`] gives fields at any point, [`deposit`], [`basal`], [`dip`], [`energy`], [`layers`], [`section`], [`flow`], [`shear`] and
//! [`failure_plane`] evaluate one snapshot, [`health`] says how sound the run is, [`analysis`] goes through the run, [`partition`] through its history, [`terrain`] maps what
//! happened on a terrain, [`netcdf`], [`plot`], [`page`] and [`report`] show what it found.

pub mod analysis;
pub mod basal;
pub mod cli;
pub mod deposit;
pub mod dip;
pub mod energy;
pub mod failure;
pub mod failure_plane;
pub mod field;
pub mod flow;
pub mod geometry;
pub mod health;
pub mod history;
pub mod layers;
pub mod netcdf;
pub mod page;
pub mod partition;
pub mod plot;
pub mod reference;
pub mod report;
pub mod sample;
pub mod scatter;
pub mod section;
pub mod shear;
pub mod summary;
pub mod terrain;
#[cfg(test)]
mod testing;
pub mod workers;

use analysis::{Analysis, Choices};
use cli::Arguments;
use failure::Failure;
use formats::{
    about::{self, Asked},
    exit,
    folder::RunFolder,
    news::{self, Level},
    snapshot::FileError,
};
use mpi::{topology::SimpleCommunicator, traits::Communicator as _};
use std::{ffi::OsString, io::Write as _, path::PathBuf};

/// Runs the whole stage and returns the exit code. MPI is set up and wound up within: of several ranks the first one works
/// and speaks, the others wait and return [`exit::DONE`].
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> i32 {
    // Of its threads none but the first calls MPI, unless one panics.
    let Some((universe, _)) = mpi::initialize_with_threading(mpi::Threading::Serialized) else {
        news::fail("MPI is running already; it can be started only once", exit::NUMERICAL);
        return exit::NUMERICAL;
    };
    abort_all_ranks_on_panic();
    if universe.world().rank() == 0 { work(arguments) } else { exit::DONE }
}

/// A rank that panics while others wait for it would hang the job.
fn abort_all_ranks_on_panic() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        report(panic);
        SimpleCommunicator::world().abort(exit::NUMERICAL);
    }));
}

/// What rank 0 does.
fn work(arguments: impl IntoIterator<Item = OsString>) -> i32 {
    let arguments = match about::parse::<Arguments>(arguments) {
        Ok(Asked::Work(arguments)) => arguments,
        Ok(Asked::Text(text)) => {
            // Whoever closed the pipe has read enough.
            let _ = std::io::stdout().write_all(&text);
            return exit::DONE;
        }
        Err(message) => {
            // Help goes to standard output, errors to standard error; a closed pipe is nobody's concern.
            let _ = message.print();
            return if message.use_stderr() { exit::USAGE } else { exit::DONE };
        }
    };
    let threads = workers::pool(arguments.threads.map(usize::from)).map_err(Failure::Threads);
    match threads.and_then(|threads| threads.install(|| evaluate(&arguments))) {
        Ok(paths) => {
            let mut out = std::io::stdout().lock();
            // Whoever closed the pipe wants no more paths; the files are there all the same.
            let _ = paths.iter().try_for_each(|path| writeln!(out, "{}", path.display())).and_then(|()| out.flush());
            exit::DONE
        }
        Err(failure) => {
            news::fail(&failure.to_string(), failure.exit_code());
            failure.exit_code()
        }
    }
}

/// Evaluates the run and returns the paths of what it wrote.
fn evaluate(arguments: &Arguments) -> Result<Vec<PathBuf>, Failure> {
    let folder = RunFolder::new(&arguments.run);
    let choices = Choices {
        basal_height: arguments.basal_height,
        layers: arguments.layers.into(),
        static_speed: arguments.static_speed,
        failure_time: arguments.failure_time,
        colours: arguments.color.clone(),
        grain_diameter: arguments.grain_diameter,
        reference: arguments.reference.as_deref().map(reference::Reference::read).transpose()?,
    };
    let analysis = Analysis::of(&folder, choices)?;
    let post = folder.post();
    std::fs::create_dir_all(&post).map_err(|error| FileError::writing(&post, 0, &error))?;
    let mut paths = vec![post.join("results.nc")];
    netcdf::results(&analysis).write(&paths[0])?;
    if let Some(maps) = netcdf::terrain(&analysis) {
        let path = post.join("terrain.nc");
        maps.write(&path)?;
        paths.push(path);
    }
    if let Some(history) = &analysis.history {
        let path = post.join("history.nc");
        netcdf::history(&analysis, history).write(&path)?;
        paths.push(path);
    }
    paths.extend(summary::write(&analysis, &post)?);
    let pictures = plot::pictures(&analysis, &post)?;
    let report = page::write(&analysis, &folder, &pictures)?;
    paths.extend(pictures);
    paths.push(report);
    if !arguments.quiet {
        news::show(Level::Note, &report::table(&analysis));
    }
    Ok(paths)
}
