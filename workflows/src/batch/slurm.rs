//! Jobs of Slurm.

use super::script::{GoOn, Script};
use crate::{failure::Failure, launch, paths};
use formats::{disk, exit, folder::RunFolder};
use std::io::Write;
use std::path::{Path, PathBuf};
use xshell::{Shell, cmd};

/// Longest warning before the limit, s.
const WARNING: u32 = 120;

/// Options that mean nothing without Slurm.
pub const ONLY: [&str; 11] =
    ["time", "partition", "account", "qos", "nodes", "sbatch_option", "module", "setup", "chain", "warning", "dry_run"];

/// What a job asks of Slurm.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Slurm")]
pub struct Wishes {
    /// Time limit of a job, as Slurm writes it: 04:00:00, 1-12:00:00, 90 (minutes).
    #[arg(long, value_name = "LIMIT", value_parser = limit)]
    time: Option<String>,
    /// Partition.
    #[arg(long)]
    partition: Option<String>,
    /// Account.
    #[arg(long)]
    account: Option<String>,
    /// Quality of service.
    #[arg(long)]
    qos: Option<String>,
    /// Nodes.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    nodes: Option<u32>,
    /// One more word for sbatch, such as --sbatch-option=--mem=4G; may be given again.
    #[arg(long, value_name = "WORD", allow_hyphen_values = true)]
    sbatch_option: Vec<String>,
    /// `module load NAME` at the start of the job; may be given again.
    #[arg(long, value_name = "NAME")]
    module: Vec<String>,
    /// A file whose lines are put at the start of the job script.
    #[arg(long, value_name = "FILE")]
    setup: Option<PathBuf>,
    /// Submit a chain of K jobs, each after the one before, instead of one that goes back into the queue.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    chain: Option<u32>,
    /// How long before the limit Slurm sends USR1, should the run not have stopped by itself; 0: never.
    /// [default: 120, or a tenth of the limit]
    #[arg(long, value_name = "SECONDS")]
    warning: Option<u32>,
    /// Write the job script and print it, but submit nothing.
    #[arg(long)]
    dry_run: bool,
}

impl Wishes {
    /// The job script of a run.
    pub fn script(
        &self,
        run: &Path,
        programs: &Path,
        ranks: u32,
        name: &str,
        options: &[String],
    ) -> Result<Script, Failure> {
        let valued = [
            ("--time", self.time.clone()),
            ("--partition", self.partition.clone()),
            ("--account", self.account.clone()),
            ("--qos", self.qos.clone()),
            ("--nodes", self.nodes.map(|n| n.to_string())),
        ];
        let words = valued.into_iter().filter_map(|(option, value)| Some(format!("{option}={}", value?)));
        let tenth = self.time.as_deref().and_then(seconds).map_or(WARNING, |limit| (limit / 10).min(WARNING));
        Ok(Script {
            name: name.to_owned(),
            run: run.to_owned(),
            programs: programs.to_owned(),
            launcher: match launch::launcher() {
                words if words.is_empty() => vec!["mpirun".to_owned()],
                words => words,
            },
            ranks,
            go_on: if self.chain.is_some() { GoOn::Chain } else { GoOn::Requeue },
            sbatch: words.chain(self.sbatch_option.iter().cloned()).collect(),
            warning: self.warning.unwrap_or(tenth),
            setup: self.setup()?,
            options: options.to_vec(),
        })
    }

    fn setup(&self) -> Result<String, Failure> {
        let mut lines = Vec::new();
        if is_root() {
            lines.push("# Open MPI refuses to start as root otherwise.".to_owned());
            lines.push("export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1".to_owned());
        }
        if !self.module.is_empty() {
            // Not every shell that runs a script knows it.
            lines.push("command -v module >/dev/null || . /etc/profile".to_owned());
        }
        lines.extend(self.module.iter().map(|name| format!("module load {}", super::script::shell_word(name))));
        if let Some(file) = &self.setup {
            let file = paths::from_caller(file);
            let text = std::fs::read_to_string(&file)
                .map_err(|e| Failure::no_input(format!("{}: cannot read the set-up: {e}", file.display())))?;
            lines.push(text);
        }
        Ok(lines.join("\n"))
    }
}

/// Writes a job script into its run folder, and submits it unless it is a dry run.
pub fn submit(folder: &RunFolder, script: &Script, wishes: &Wishes) -> Result<(), Failure> {
    let file = folder.path().join("job.sh");
    let text = script.text()?;
    disk::write_atomic(&file, text.as_bytes()).map_err(|e| Failure { code: e.exit_code(), message: e.to_string() })?;
    let shown = super::script::shell_word(&file.display().to_string());
    if wishes.dry_run {
        // Nobody to tell where the reader has gone.
        let _ = std::io::stdout().write_all(text.as_bytes());
        eprintln!("talus: nothing is submitted; by hand: sbatch {shown}");
        return Ok(());
    }
    let shell = launch::shell()?;
    if let Some(job) = waiting(&shell, &file).first() {
        let message = format!("job {job} goes on with this run already; see squeue, or cancel it first: scancel {job}");
        return Err(Failure { code: exit::LOCKED, message });
    }
    let mut before: Option<String> = None;
    for _ in 0..wishes.chain.unwrap_or(1) {
        let after = before.as_ref().map(|job| format!("--dependency=afterany:{job}"));
        let submitted = cmd!(shell, "sbatch --parsable {after...} {file}").quiet().read();
        let answer = submitted.map_err(|e| {
            let so_far = before.as_ref().map_or(String::new(), |job| format!("; jobs up to {job} are in the queue"));
            Failure::no_input(format!("{e}{so_far}; by hand: sbatch {shown}"))
        })?;
        // `JOB` or `JOB;CLUSTER`.
        let job = answer.split(';').next().unwrap_or_default().trim().to_owned();
        println!("{job}");
        before = Some(job);
    }
    let run = super::script::shell_word(&paths::short(folder.path()).display().to_string());
    eprintln!("talus: submitted {shown}; how far it is: ./talus status {run}");
    Ok(())
}

/// Jobs of this user that run this script or wait for it; none where Slurm cannot be asked.
fn waiting(shell: &Shell, file: &Path) -> Vec<String> {
    let listed = cmd!(shell, "squeue --me --noheader --states=PENDING,CONFIGURING,RUNNING,SUSPENDED")
        .arg("--format=%A %o")
        .quiet()
        .ignore_stderr()
        .read();
    let matches = |line: &str| {
        let (job, command) = line.trim().split_once(' ')?;
        (Path::new(command.trim()) == file).then(|| job.to_owned())
    };
    listed.unwrap_or_default().lines().filter_map(matches).collect()
}

/// Does this process run as root?
fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata("/proc/self").is_ok_and(|own| own.uid() == 0)
}

fn limit(text: &str) -> Result<String, String> {
    match seconds(text) {
        Some(1..) => Ok(text.to_owned()),
        _ => {
            Err("expected minutes, or HOURS:MINUTES:SECONDS, or DAYS-HOURS:MINUTES:SECONDS, such as 04:00:00"
                .to_owned())
        }
    }
}

/// A time limit as `sbatch` takes it: MIN, MIN:SEC, H:MIN:SEC, D-H, D-H:MIN, D-H:MIN:SEC.
fn seconds(text: &str) -> Option<u32> {
    let (days, rest) = match text.split_once('-') {
        Some((days, rest)) => (Some(days.parse::<u32>().ok()?), rest),
        None => (None, text),
    };
    let fields = rest.split(':').map(|field| field.parse::<u32>().ok()).collect::<Option<Vec<_>>>()?;
    let (hours, minutes, seconds) = match (days, &fields[..]) {
        (None, [minutes]) => (0, *minutes, 0),
        (None, [minutes, seconds]) => (0, *minutes, *seconds),
        (Some(_), [hours]) => (*hours, 0, 0),
        (Some(_), [hours, minutes]) => (*hours, *minutes, 0),
        (_, [hours, minutes, seconds]) => (*hours, *minutes, *seconds),
        _ => return None,
    };
    let days = u64::from(days.unwrap_or(0));
    let total = ((days * 24 + u64::from(hours)) * 60 + u64::from(minutes)) * 60 + u64::from(seconds);
    u32::try_from(total).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_as_sbatch_does() {
        let known = [("90", 5400), ("1:30", 90), ("04:00:00", 14400), ("1-12", 129_600), ("1-0:30", 88_200)];
        for (text, expected) in known {
            assert_eq!(seconds(text), Some(expected), "{text}");
        }
        assert_eq!(seconds("2-01:02:03"), Some(2 * 86400 + 3723));
        for text in ["", "4h", "1:2:3:4", "-", "1-", "04:xx", "0", "9999999-0"] {
            assert!(limit(text).is_err(), "{text}");
        }
    }
}
