//! Jobs of Slurm.

use super::script::{GoOn, Script};
use crate::{failure::Failure, launch, paths};
use formats::{disk, exit, folder::RunFolder};
use std::path::{Path, PathBuf};
use xshell::{Shell, cmd};

/// Longest warning before the limit, s.
const WARNING: u32 = 120;

/// What a job asks of Slurm.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Slurm")]
pub struct Options {
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

impl Options {
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
            launcher: launch::launcher(),
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
        if nix_root() {
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
