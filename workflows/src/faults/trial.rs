//! Does one trial, and says what it found.

use super::ground::{Ground, HABITS, INTERVAL, hashes, put};
use super::launcher::{self, End};
use super::plan::{Trial, What, moment};
use super::results::Outcome;
use super::{Programs, launcher::HANGS};
use crate::{failure::Failure, paths};
use formats::{checkpoint, exit, folder::RunFolder};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{damage, shim};

/// How often a kill from outside is tried again where the run was over before.
const TRIES: u32 = 4;

/// In a folder of its own, which is kept in `runs/faults` where something is found.
pub fn carry_out(programs: &Programs, grounds: &[Ground], trial: &Trial, work: &Path) -> Result<Outcome, Failure> {
    let folder = work.join(trial.name.replace([' ', ',', '/', '.'], "-"));
    let attempt = Attempt { programs, ground: &grounds[trial.ground], trial, folder: RunFolder::new(&folder) };
    let mut outcome = match &trial.what {
        What::Call { .. } => attempt.at_a_call()?,
        What::Moment { part, rank } => attempt.at_a_moment(*part, *rank)?,
        What::Cut { .. } | What::Flip { .. } => attempt.damaged()?,
        What::Disk { size } => attempt.on_a_disk(*size)?,
    };
    if outcome.findings.is_empty() {
        let _ = fs::remove_dir_all(&folder);
    } else {
        let kept = paths::runs().join("faults").join(folder.file_name().unwrap_or_default());
        let _ = fs::remove_dir_all(&kept);
        launcher::copy(&folder, &kept)?;
        outcome.findings.push(format!("kept in {}", paths::short(&kept).display()));
        let _ = fs::remove_dir_all(&folder);
    }
    for extension in ["said", "struck"] {
        let _ = fs::remove_file(folder.with_extension(extension));
    }
    Ok(outcome)
}

struct Attempt<'a> {
    programs: &'a Programs,
    ground: &'a Ground,
    trial: &'a Trial,
    folder: RunFolder,
}

impl Attempt<'_> {
    fn command(&self, ranks: usize, options: &[&str]) -> Command {
        launcher::sph_run(&self.programs.sph_run, self.folder.path(), ranks, options)
    }

    fn at_a_call(&self) -> Result<Outcome, Failure> {
        let What::Call { fault, codes, goes_on } = &self.trial.what else { return Ok(Outcome::default()) };
        let from = if *goes_on { &self.ground.stopped } else { &self.ground.fresh };
        launcher::copy(from, self.folder.path())?;
        let mut command = self.command(self.trial.ranks, &HABITS);
        let log = self.log();
        put(fault, &mut command, self.programs, self.folder.path(), &log)?;
        let end = launcher::run(command, self.folder.path(), |_, _| {})?;
        let struck = shim::struck(&log).join(" ");
        let mut outcome = Outcome { struck: !struck.is_empty(), code: end.code, what: struck, ..Outcome::default() };
        let right = match codes.as_slice() {
            [] => end.code != exit::DONE && end.code != exit::RESUMABLE,
            codes => codes.contains(&end.code),
        };
        // Calls of other ranks may come in another number the next time.
        if outcome.struck {
            outcome.find(!right, "wrong code", || format!("exit code {}: {}", end.code, last_line(&end.said)));
        }
        self.judge(&end, &mut outcome)?;
        Ok(outcome)
    }

    fn at_a_moment(&self, part: f64, rank: Option<usize>) -> Result<Outcome, Failure> {
        let mut due = moment(part, self.ground.took[self.trial.ranks - 1]);
        for _ in 0..TRIES {
            let _ = fs::remove_dir_all(self.folder.path());
            launcher::copy(&self.ground.fresh, self.folder.path())?;
            let mut struck = None;
            let end = launcher::run(self.command(self.trial.ranks, &HABITS), self.folder.path(), |elapsed, child| {
                if elapsed < due || struck.is_some() {
                    return;
                }
                let ranks = launcher::processes(self.folder.path());
                if ranks.len() == self.trial.ranks {
                    match rank {
                        Some(rank) => launcher::kill(&ranks[rank..=rank]),
                        None => launcher::kill(&[&[child][..], &ranks].concat()),
                    }
                    struck = Some(elapsed);
                }
            })?;
            if let (Some(elapsed), true) = (struck, end.code != exit::DONE) {
                let what = format!("struck: kill after {} ms", elapsed.as_millis());
                let mut outcome = Outcome { struck: true, code: end.code, what, ..Outcome::default() };
                self.judge(&end, &mut outcome)?;
                return Ok(outcome);
            }
            due = due.mul_f64(0.7);
        }
        Ok(Outcome::default())
    }

    fn log(&self) -> PathBuf {
        let log = self.folder.path().with_extension("struck");
        let _ = fs::remove_file(&log);
        log
    }

    /// What is left after a launch that something was done to, and does the next one end with the same bits?
    fn judge(&self, end: &End, outcome: &mut Outcome) -> Result<(), Failure> {
        outcome.find(end.hung, "hang", || format!("no end within {} s", HANGS.as_secs()));
        let there = checkpoint::generations(&self.folder).unwrap_or_default();
        match checkpoint::latest(&self.folder) {
            Ok(Some(found)) => {
                let warnings: Vec<_> = found.warnings.iter().map(ToString::to_string).collect();
                outcome.find(!warnings.is_empty(), "lost generation", || warnings.join(" "));
                let reached = last_step(&self.folder);
                let step = found.manifest.step;
                outcome.find(reached > step + INTERVAL, "lost interval", || {
                    format!("step {reached} was done, the newest checkpoint is of {step}")
                });
            }
            Ok(None) => {
                let reached = last_step(&self.folder);
                outcome.find(reached > INTERVAL, "lost interval", || {
                    format!("no checkpoint, but step {reached} was done")
                });
            }
            Err(error) => outcome.find(true, "lost generation", || format!("of {there:?}: {error}")),
        }
        let options = ["--quiet", "--lock-patience", "1s"];
        let after = launcher::run(self.command(self.trial.ranks_after, &options), self.folder.path(), |_, _| {})?;
        outcome.find(after.hung, "hang", || "in going on".into());
        outcome.find(after.code != exit::DONE && !after.hung, "wrong code", || {
            format!("going on ended with exit code {}: {}", after.code, last_line(&after.said))
        });
        self.same(outcome);
        Ok(())
    }

    fn same(&self, outcome: &mut Outcome) {
        let here = hashes(&self.folder.out());
        let names = || {
            let all = here.keys().chain(self.ground.outputs.keys());
            let mut names: Vec<_> = all.filter(|name| here.get(*name) != self.ground.outputs.get(*name)).collect();
            names.dedup();
            format!("{names:?}")
        };
        outcome.find(here != self.ground.outputs, "other bits", names);
    }

    fn damaged(&self) -> Result<Outcome, Failure> {
        launcher::copy(&self.ground.stopped, self.folder.path())?;
        let newest = self.folder.generation(3);
        let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", newest.display()));
        let (file, needs_launch) = match self.trial.what {
            What::Cut { file, length } => (file, damage::cut(&newest.join(file), length).map(|()| true)),
            What::Flip { file, byte, bit } => {
                (file, damage::flip(&newest.join(file), byte, bit).map(|()| byte % 8 == 0))
            }
            _ => return Ok(Outcome::default()),
        };
        let needs_launch = needs_launch.map_err(fault)?;
        let mut outcome = Outcome { struck: true, what: format!("struck: {}", self.trial.name), ..Outcome::default() };
        let named = format!("gen-000003/{file}");
        let check = launcher::run(self.command(1, &["--check"]), self.folder.path(), |_, _| {})?;
        outcome.code = check.code;
        outcome.find(check.hung, "hang", || "in --check".into());
        let missed = check.code != exit::DONE || !check.said.contains(&named);
        outcome.find(missed, "missed", || format!("--check: exit code {}: {}", check.code, last_line(&check.said)));
        // The check and a launch share the verification; a launch of its own for an eighth of the bits is enough.
        if needs_launch {
            let end = launcher::run(self.command(1, &[]), self.folder.path(), |_, _| {})?;
            outcome.code = end.code;
            outcome.find(end.hung, "hang", || "in going on".into());
            outcome.find(end.code != exit::DONE, "wrong code", || format!("{}: {}", end.code, last_line(&end.said)));
            let passed_over = end.said.contains(&named) && end.said.contains("step 50");
            outcome.find(!passed_over, "missed", || format!("going on says: {}", end.said));
            self.same(&mut outcome);
        }
        Ok(outcome)
    }

    /// In a mount namespace of its own, with a disk that is too small at first.
    fn on_a_disk(&self, size: u64) -> Result<Outcome, Failure> {
        let launcher = |ranks: usize| if ranks == 1 { String::new() } else { format!("mpirun -n {ranks} ") };
        let disk = self.folder.path().with_extension("disk");
        for folder in [self.folder.path(), &disk] {
            fs::create_dir_all(folder).map_err(|e| Failure::cannot_write(format!("{}: {e}", folder.display())))?;
        }
        let script = format!(
            "mount -t tmpfs -o size={size}k none $1 || {{ echo no disk; exit 0; }}
            cp -r {fresh} $1/run || {{ echo no room for the scene; exit 0; }}
            {first}{run} $1/run {habits}; echo full $?
            {run} --check $1/run >/dev/null; echo check $?
            mount -o remount,size=64m none $1
            {then}{run} $1/run --quiet; echo room $?
            cp -r $1/run/. {result}",
            fresh = self.ground.fresh.display(),
            first = launcher(self.trial.ranks),
            then = launcher(self.trial.ranks_after),
            run = self.programs.sph_run.display(),
            habits = HABITS.join(" "),
            result = self.folder.path().display(),
        );
        // For the environment of the launches.
        let like = self.command(1, &[]);
        let mut command = Command::new("unshare");
        command.envs(like.get_envs().filter_map(|(name, value)| Some((name, value?))));
        command.args(["-m", "sh", "-c", &script, "sh"]).arg(&disk);
        let end = launcher::run(command, self.folder.path(), |_, _| {})?;
        let _ = fs::remove_dir_all(&disk);
        let code = |word: &str| end.said.lines().find_map(|line| line.strip_prefix(word)?.trim().parse::<i32>().ok());
        let full = code("full ").unwrap_or(-1);
        let mut outcome = Outcome { struck: full != -1 && full != exit::DONE, code: full, ..Outcome::default() };
        outcome.what = format!("struck: a disk of {size} KiB");
        if full == -1 && end.said.contains("no ") {
            outcome.what = last_line(&end.said);
            return Ok(outcome);
        }
        outcome.find(end.hung, "hang", || format!("no end within {} s", HANGS.as_secs()));
        outcome.find(![exit::DONE, exit::CANNOT_WRITE].contains(&full), "wrong code", || {
            format!("on the full disk {full}: {}", end.said)
        });
        outcome.find(code("check ") != Some(exit::DONE), "lost generation", || format!("check: {}", end.said));
        outcome.find(code("room ") != Some(exit::DONE), "wrong code", || format!("with room: {}", end.said));
        self.same(&mut outcome);
        Ok(outcome)
    }
}

/// The last step in the live history.
fn last_step(folder: &RunFolder) -> u64 {
    let history = fs::read_to_string(folder.history()).unwrap_or_default();
    let whole = &history[..history.rfind('\n').map_or(0, |end| end + 1)];
    whole.lines().filter_map(|line| line.split(',').nth(1)?.parse().ok()).last().unwrap_or(0)
}

/// What a program said that is about its end.
fn last_line(said: &str) -> String {
    let error = said.lines().find(|line| line.contains("error: "));
    error.or(said.lines().last()).unwrap_or_default().chars().take(300).collect()
}
