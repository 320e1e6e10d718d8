//! Launches of `sph-run` that are measured: each from a copy of a run that was taken to the middle of its collapse once.

use super::rows::Row;
use crate::stage::{self, Programs};
use crate::{failure::Failure, launch, paths};
use formats::{exit, folder::RunFolder};
use std::fs;
use std::path::{Path, PathBuf};
use xshell::cmd;

/// Where a row is measured: the run that is copied, its scenes, and the copies.
pub struct Place {
    folder: PathBuf,
    row: Row,
}

/// What a launch runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum On {
    /// One rank on one processor of the system.
    Processor(u32),
    /// Ranks wherever MPI puts them.
    Ranks(u32),
}

/// What a launch noted in `log/phases.csv`, by the names of the columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Launch {
    columns: Vec<(String, f64)>,
}

impl Place {
    /// The folder of a row under `work`.
    pub fn new(work: &Path, row: Row) -> Self {
        Self { folder: work.join(row.name), row }
    }

    /// The run that is copied.
    pub fn base(&self) -> PathBuf {
        self.folder.join("middle")
    }

    /// Takes the run to the middle of its collapse, on all cores, unless an earlier benchmark did.
    pub fn prepare(&self, programs: &Programs, fresh: bool) -> Result<(), Failure> {
        let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", self.folder.display()));
        fs::create_dir_all(&self.folder).map_err(fault)?;
        let (row, base) = (&self.row, RunFolder::new(self.base()));
        let now = row.scene(row.middle);
        let differs = fs::read_to_string(base.scene()).is_ok_and(|then| then != now);
        if base.path().exists() && (fresh || differs) {
            fs::remove_dir_all(base.path()).map_err(fault)?;
        }
        let scene = self.folder.join("middle.toml");
        fs::write(&scene, now).map_err(fault)?;
        // The same with a later end, for what goes on from there.
        fs::write(self.later(), row.scene(row.middle + 1.0)).map_err(fault)?;
        let (folder, ranks) = (base.path(), None);
        let log = self.folder.join("middle.txt");
        let again = "the same command, or with --fresh";
        let job = stage::Job { scene: &scene, folder, ranks, fresh: false, again, log: Some(&log) };
        if base.done().is_file() {
            return Ok(());
        }
        eprintln!("talus: {} goes to the middle of its collapse, once: {}", row.name, paths::short(&log).display());
        let passed = stage::prepare(programs, &job).and_then(|()| match stage::advance(programs, &job, &[])? {
            Some(end) => stage::passed("sph-run", end, &job),
            None => Ok(()),
        });
        let told = |e: Failure| Failure { message: format!("{}: {}", paths::short(&log).display(), e.message), ..e };
        passed.map_err(told)
    }

    fn later(&self) -> PathBuf {
        self.folder.join("later.toml")
    }

    /// A fresh copy of the prepared run.
    pub fn copy(&self, name: &str) -> Result<PathBuf, Failure> {
        let copy = self.folder.join(name);
        let _ = fs::remove_dir_all(&copy);
        copy_folder(&self.base(), &copy).map_err(|e| Failure::cannot_write(format!("{}: {e}", copy.display())))?;
        Ok(copy)
    }

    /// Words for sph-run that take the run in a copy on for some steps, with no output but the checkpoint at the end.
    pub fn words(&self, copy: &Path, steps: u64) -> Vec<String> {
        let (copy, later) = (copy.display().to_string(), self.later().display().to_string());
        let (steps, never) = (steps.to_string(), "1000h");
        let words = [&copy, "--quiet", "--scene", &later, "--stop-after-steps", &steps, "--checkpoint-every", never];
        words.map(str::to_owned).to_vec()
    }

    /// Launches a copy for the row's steps and removes it.
    pub fn timed(&self, sph_run: &Path, name: &str, on: On) -> Result<Launch, Failure> {
        let copy = self.copy(name)?;
        let (shell, words) = (launch::shell()?, self.words(&copy, self.row.steps));
        let command = match on {
            On::Processor(number) => {
                let number = number.to_string();
                cmd!(shell, "taskset -c {number} {sph_run}")
            }
            On::Ranks(ranks) => launch::parallel(&shell, sph_run, ranks),
        };
        let log = self.folder.join(format!("{name}.txt"));
        let end = launch::wait_with(command.args(words), launch::Stop::AtOnce, Some(&log))?;
        expect_stop(end, &log)?;
        let launch = Launch::read(&copy)?;
        let done = launch.of("steps");
        if done != self.row.steps as f64 {
            let message = format!("{}: sph-run stopped after {done} steps of {}", copy.display(), self.row.steps);
            return Err(Failure { code: exit::RESUMABLE, message });
        }
        let _ = fs::remove_dir_all(&copy);
        Ok(launch)
    }
}

/// A launch for a number of steps ends as one that was stopped.
pub fn expect_stop(end: launch::End, log: &Path) -> Result<(), Failure> {
    match stage::code(end.status) {
        _ if end.interrupted => Err(Failure { code: exit::RESUMABLE, message: "stopped on request".into() }),
        exit::RESUMABLE => Ok(()),
        code => {
            let message = format!("sph-run failed with exit code {code}, see {}", paths::short(log).display());
            Err(Failure { code, message })
        }
    }
}

impl Launch {
    /// The last one of a folder.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let path = RunFolder::new(folder).log().join("phases.csv");
        let fault = |what: &str| Failure::no_input(format!("{}: {what}", path.display()));
        let text = fs::read_to_string(&path).map_err(|e| fault(&e.to_string()))?;
        Self::parse(&text).ok_or_else(|| fault("is not what sph-run writes there"))
    }

    fn parse(text: &str) -> Option<Self> {
        let (head, line) = (text.lines().next()?, text.lines().skip(1).last()?);
        let named = |(name, cell): (&str, &str)| Some((name.split(' ').next()?.to_owned(), cell.parse().ok()?));
        let columns: Vec<_> = head.split(',').zip(line.split(',')).map(named).collect::<Option<_>>()?;
        let launch = Self { columns };
        let known = |name: &&str| launch.columns.iter().any(|(column, _)| column == name);
        let needed =
            ["steps", "particle_steps", "ranks", "loop", "output", "memory_largest", "memory_sum", "neighbours"];
        (head.split(',').count() == line.split(',').count() && needed.iter().all(known)).then_some(launch)
    }

    /// A column; 0 where there is none.
    pub fn of(&self, name: &str) -> f64 {
        self.columns.iter().find(|(column, _)| column == name).map_or(0.0, |(_, number)| *number)
    }

    /// Number of particles.
    pub fn particles(&self) -> f64 {
        self.of("particle_steps") / self.of("steps").max(1.0)
    }

    /// Time the steps took, s: what was put out, here the checkpoint at the end, is left out.
    pub fn seconds(&self) -> f64 {
        self.of("loop") - self.of("output")
    }

    /// Million particle-steps per second.
    pub fn rate(&self) -> f64 {
        1e-6 * self.of("particle_steps") / self.seconds()
    }

    /// Names of the phases of a step.
    pub fn phases(&self) -> Vec<&str> {
        let names = self.columns.iter().map(|(name, _)| name.as_str());
        let phases = names.skip_while(|name| *name != "loop").skip(1);
        phases.take_while(|name| *name != "memory_largest").filter(|name| *name != "output").collect()
    }

    /// Peak memory of all ranks, bytes a particle.
    pub fn bytes(&self) -> f64 {
        self.of("memory_sum") / self.particles()
    }
}

/// Copies what a run needs to go on; what earlier launches logged stays behind.
fn copy_folder(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let place = to.join(entry.file_name());
        if !entry.file_type()?.is_dir() {
            fs::copy(entry.path(), place)?;
        } else if entry.file_name() != "log" {
            copy_folder(&entry.path(), &place)?;
        }
    }
    Ok(())
}

/// Processors this process may run on, one a physical core.
pub fn processors() -> Vec<u32> {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap_or("0");
    let mut cores = std::collections::HashSet::new();
    let siblings = |number: &u32| {
        let path = format!("/sys/devices/system/cpu/cpu{number}/topology/thread_siblings_list");
        fs::read_to_string(path).unwrap_or_else(|_| number.to_string())
    };
    numbers(list).into_iter().filter(|number| cores.insert(siblings(number))).collect()
}

/// `0-2,5`: 0, 1, 2, 5.
fn numbers(list: &str) -> Vec<u32> {
    let part = |part: &str| -> Option<std::ops::RangeInclusive<u32>> {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.trim().parse().ok()?..=last.trim().parse().ok()?)
    };
    list.split(',').filter_map(part).flatten().collect()
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// A launch of 10 steps of 1000 particles in so many seconds, a quarter of them spent on lists.
    pub fn launch(seconds: f64, ranks: u32) -> Launch {
        let text = format!(
            "step [1],steps [1],particle_steps [1],ranks [1],loop [s],gradient [s],lists [s],output [s],\
             memory_largest [B],memory_sum [B],neighbours [1]\n1,2,3\n\
             30,10,10000,{ranks},{},{},{},0.5,400000,500000,50\n",
            seconds + 0.5,
            0.75 * seconds,
            0.25 * seconds
        );
        Launch::parse(&text).unwrap()
    }

    #[test]
    fn the_last_launch_is_read() {
        let launch = launch(0.1, 2);
        assert_eq!((launch.particles(), launch.of("ranks"), launch.bytes()), (1000.0, 2.0, 500.0));
        assert!((launch.rate() - 0.1).abs() < 1e-12 && (launch.seconds() - 0.1).abs() < 1e-12);
        assert_eq!(launch.phases(), ["gradient", "lists"]);
        assert_eq!(Launch::parse("steps [1],loop [s]\n1,2\n"), None);
        assert_eq!(Launch::parse("steps [1],loop [s]\n"), None);
    }

    #[test]
    fn lists_of_processors() {
        assert_eq!(numbers("0-2,5\n"), [0, 1, 2, 5]);
        assert_eq!(numbers("7"), [7]);
        assert!(!processors().is_empty());
    }

    #[test]
    fn a_copy_leaves_the_log_behind() {
        let work = tempfile::tempdir().unwrap();
        let (from, to) = (work.path().join("a"), work.path().join("b"));
        for folder in ["log", "ckpt/gen-1"] {
            fs::create_dir_all(from.join(folder)).unwrap();
            fs::write(from.join(folder).join("file"), folder).unwrap();
        }
        copy_folder(&from, &to).unwrap();
        assert_eq!(fs::read_to_string(to.join("ckpt/gen-1/file")).unwrap(), "ckpt/gen-1");
        assert!(!to.join("log").exists());
    }
}
