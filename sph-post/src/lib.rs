//! `sph-post`: from the snapshots of a run to numbers (`post/results.nc`, `post/history.nc`) and pictures.
//!
//! Serial: one snapshot is in memory at a time. [`geometry`] says what the scene means for the evaluation,
//! [`sample`] gives fields at any point, [`deposit`], [`basal`] and [`energy`] evaluate one snapshot,
//! [`analysis`] goes through the run, [`netcdf`], [`plot`] and [`report`] show what it found.

pub mod analysis;
pub mod basal;
pub mod cli;
pub mod deposit;
pub mod energy;
pub mod failure;
pub mod geometry;
pub mod history;
pub mod netcdf;
pub mod plot;
pub mod report;
pub mod sample;
pub mod scatter;
pub mod summary;
#[cfg(test)]
mod testing;

use analysis::Analysis;
use clap::Parser;
use cli::Arguments;
use failure::Failure;
use formats::{exit, folder::RunFolder, snapshot::FileError};
use std::{ffi::OsString, path::PathBuf};

/// Runs the whole stage and returns the exit code.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> i32 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(message) => {
            // Help goes to standard output, errors to standard error; a closed pipe is nobody's concern.
            let _ = message.print();
            return if message.use_stderr() { exit::USAGE } else { exit::DONE };
        }
    };
    match evaluate(&arguments) {
        Ok(paths) => {
            paths.iter().for_each(|path| println!("{}", path.display()));
            exit::DONE
        }
        Err(failure) => {
            eprintln!("sph-post: error: {failure}");
            failure.exit_code()
        }
    }
}

/// Evaluates the run and returns the paths of what it wrote.
fn evaluate(arguments: &Arguments) -> Result<Vec<PathBuf>, Failure> {
    let folder = RunFolder::new(&arguments.run);
    let analysis = Analysis::of(&folder, arguments.basal_height)?;
    let post = folder.post();
    std::fs::create_dir_all(&post).map_err(|error| FileError::writing(&post, 0, &error))?;
    let mut paths = vec![post.join("results.nc")];
    netcdf::results(&analysis).write(&paths[0])?;
    if let Some(history) = &analysis.history {
        let path = post.join("history.nc");
        netcdf::history(&analysis, history).write(&path)?;
        paths.push(path);
    }
    paths.extend(summary::write(&analysis, &post)?);
    paths.extend(plot::pictures(&analysis, &post)?);
    if !arguments.quiet {
        eprint!("{}", report::table(&analysis));
    }
    Ok(paths)
}
