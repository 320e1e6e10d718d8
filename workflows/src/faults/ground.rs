//! What trials start from: a scene in each space, prepared, computed without a stop, and its calls counted.

use super::Programs;
use super::launcher::{self, End};
use crate::failure::Failure;
use formats::{exit, folder::RunFolder, provenance::sha256};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use tests::shim::{self, Call, Fault};
use tests::trial::short;

/// Most ranks of a trial.
pub const MOST_RANKS: usize = 5;

/// Steps between checkpoints.
pub const INTERVAL: u64 = 25;

/// Options of every launch that something is done to.
pub const HABITS: [&str; 3] = ["--quiet", "--checkpoint-every", "25steps"];

/// Kinds of calls: those that change something, and all.
pub const CHANGES: &str = "";
pub const ALL: &str = "open,read,create,write,truncate,allocate,sync,rename,link,remove,folder";

/// One scene.
#[derive(Debug)]
pub struct Ground {
    pub name: &'static str,
    /// As `sph-prep` leaves it.
    pub fresh: PathBuf,
    /// Bytes of the files in out/ after the whole run, hashed, by their paths in there.
    pub outputs: BTreeMap<PathBuf, String>,
    /// The calls that change something, of an uninterrupted run on 1 to [`MOST_RANKS`] ranks.
    pub calls: Vec<Vec<Call>>,
    /// All calls of one rank, reads too.
    pub all_calls: Vec<Call>,
    /// Wall time on so many ranks.
    pub took: Vec<Duration>,
    /// Stopped with three generations.
    pub stopped: PathBuf,
    /// All calls of a launch that goes on there, of one rank and of three.
    pub calls_after: [Vec<Call>; 2],
}

/// The three of them.
pub fn all(programs: &Programs, work: &Path) -> Result<Vec<Ground>, Failure> {
    let scenes = [("plane", short::PLANE), ("rings", short::RINGS), ("solid", short::SOLID)];
    scenes.into_iter().map(|(name, scene)| make(programs, work, name, scene)).collect()
}

fn make(programs: &Programs, work: &Path, name: &'static str, scene: &str) -> Result<Ground, Failure> {
    let file = work.join(format!("{name}.toml"));
    // Half the time is enough for three checkpoints and snapshots.
    let scene = scene.replace("150 ms", "75 ms");
    fs::write(&file, scene).map_err(|e| Failure::cannot_write(format!("{}: {e}", file.display())))?;
    let fresh = work.join(format!("{name}-fresh"));
    let mut prepare = Command::new(&programs.sph_prep);
    prepare.arg(&file).arg("-o").arg(&fresh);
    done(launcher::run(prepare, &fresh, |_, _| {})?, exit::DONE)?;

    let (mut calls, mut took) = (Vec::new(), Vec::new());
    let (mut outputs, mut all_calls) = (BTreeMap::new(), Vec::new());
    for ranks in 1..=MOST_RANKS {
        let (folder, counted, end) = count(programs, work, &fresh, &format!("{name}-{ranks}"), ranks, CHANGES)?;
        let here = hashes(&RunFolder::new(&folder).out());
        if ranks == 1 {
            outputs = here;
        } else if here != outputs {
            return Err(Failure::no_input(format!("{name}: an uninterrupted run on {ranks} ranks has other bits")));
        }
        calls.push(counted);
        took.push(end.took);
        if ranks == 1 {
            all_calls = count(programs, work, &fresh, &format!("{name}-all"), ranks, ALL)?.1;
        }
    }
    let stopped = work.join(format!("{name}-stopped"));
    launcher::copy(&fresh, &stopped)?;
    let options = ["--quiet", "--checkpoint-every", "25steps", "--checkpoint-keep", "3", "--stop-after-steps", "75"];
    done(
        launcher::run(launcher::sph_run(&programs.sph_run, &stopped, 1, &options), &stopped, |_, _| {})?,
        exit::RESUMABLE,
    )?;
    let one = count(programs, work, &stopped, &format!("{name}-after-1"), 1, ALL)?.1;
    let three = count(programs, work, &stopped, &format!("{name}-after-3"), 3, ALL)?.1;
    Ok(Ground { name, fresh, outputs, calls, all_calls, took, stopped, calls_after: [one, three] })
}

/// Runs without a fault, and counts.
fn count(
    programs: &Programs,
    work: &Path,
    fresh: &Path,
    name: &str,
    ranks: usize,
    kinds: &str,
) -> Result<(PathBuf, Vec<Call>, End), Failure> {
    let folder = work.join(name);
    launcher::copy(fresh, &folder)?;
    let mut command = launcher::sph_run(&programs.sph_run, &folder, ranks, &HABITS);
    let log = folder.with_extension("calls");
    put(&Fault::count().of(kinds, "*"), &mut command, programs, &folder, &log)?;
    let end = done(launcher::run(command, &folder, |_, _| {})?, exit::DONE)?;
    Ok((folder, shim::calls(&log), end))
}

/// Puts a fault into a command.
pub fn put(
    fault: &Fault,
    command: &mut Command,
    programs: &Programs,
    folder: &Path,
    log: &Path,
) -> Result<(), Failure> {
    let cannot = |e| Failure::no_input(format!("{}: {e}", folder.display()));
    fault.put(command, &programs.shim, folder, log).map_err(cannot)
}

fn done(end: End, code: i32) -> Result<End, Failure> {
    match end.code == code && !end.hung {
        true => Ok(end),
        false => Err(Failure::no_input(format!("an undisturbed run ended with code {}:\n{}", end.code, end.said))),
    }
}

/// Hashes of all files below a folder, by their paths in it; a file that can't be read has none.
pub fn hashes(folder: &Path) -> BTreeMap<PathBuf, String> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(place) = open.pop() {
        for entry in fs::read_dir(&place).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap_or(&path).to_path_buf();
                found.insert(name, fs::read(&path).map_or_else(|e| e.to_string(), |bytes| sha256(&bytes)));
            }
        }
    }
    found
}
