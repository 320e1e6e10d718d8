//! The text of the job script: `job.sh` with what belongs to one run filled in, every word quoted.

use crate::failure::Failure;
use std::path::{Path, PathBuf};

/// How a run goes on after a slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GoOn {
    /// The job is put back into the queue.
    Requeue,
    /// The next job of a chain takes over.
    Chain,
}

/// What a job script says.
#[derive(Clone, Debug)]
pub struct Script {
    /// Name of the job.
    pub name: String,
    /// Run folder, absolute.
    pub run: PathBuf,
    /// Folder of the three programs, absolute.
    pub programs: PathBuf,
    /// What starts parallel programs: `mpirun`, or the words of TALUS_MPIRUN.
    pub launcher: Vec<String>,
    /// MPI ranks.
    pub ranks: u32,
    /// How it goes on.
    pub go_on: GoOn,
    /// Words for `sbatch`, one a line: `--time=04:00:00`.
    pub sbatch: Vec<String>,
    /// Slurm sends USR1 so many seconds before the limit; 0: never.
    pub warning: u32,
    /// Lines that come first: modules.
    pub setup: String,
    /// More options of `sph-run`.
    pub options: Vec<String>,
}

const TEMPLATE: &str = include_str!("job.sh");

impl Script {
    /// The text.
    ///
    /// # Errors
    /// Usage, where a word holds a line break, which no `#SBATCH` line can.
    pub fn text(&self) -> Result<String, Failure> {
        let launcher: Vec<String> = self.launcher.iter().map(|word| shell_word(word)).collect();
        let options: String = self.options.iter().map(|word| format!(" {}", shell_word(word))).collect();
        let go_on = match self.go_on {
            GoOn::Requeue => "requeue",
            GoOn::Chain => "chain",
        };
        let setup = match self.setup.trim_end() {
            "" => String::new(),
            lines => format!("{lines}\n"),
        };
        let filled = [
            ("@SBATCH@", self.sbatch_lines()?),
            ("@SETUP@\n", setup),
            ("@RUN@", path_word(&self.run)?),
            ("@PROGRAMS@", path_word(&self.programs)?),
            ("@RANKS@", self.ranks.to_string()),
            ("@GO_ON@", go_on.to_owned()),
            ("@LAUNCHER@", launcher.join(" ")),
            ("@OPTIONS@", options),
        ];
        // Piece by piece, so that what is filled in is never taken for a mark.
        let (mut text, mut rest) = (String::new(), TEMPLATE);
        for (mark, value) in filled {
            let Some((before, after)) = rest.split_once(mark) else { continue };
            text += before;
            text += &value;
            rest = after;
        }
        text += rest;
        Ok(text)
    }

    fn sbatch_lines(&self) -> Result<String, Failure> {
        let requeue = match self.go_on {
            GoOn::Requeue => "--requeue",
            GoOn::Chain => "--no-requeue",
        };
        let mut words = vec![
            format!("--job-name={}", self.name),
            format!("--chdir={}", self.run.display()),
            "--output=log/job-%j.txt".to_owned(),
            "--open-mode=append".to_owned(),
            requeue.to_owned(),
            format!("--ntasks={}", self.ranks),
        ];
        if self.warning > 0 {
            words.push(format!("--signal=B:USR1@{}", self.warning));
        }
        words.extend(self.sbatch.iter().cloned());
        let line = |word: &String| Ok(format!("#SBATCH {}", sbatch_word(word)?));
        let lines: Result<Vec<_>, Failure> = words.iter().map(line).collect();
        Ok(lines?.join("\n"))
    }
}

/// A path as a word for the shell.
fn path_word(path: &Path) -> Result<String, Failure> {
    let text = path.to_str().filter(|text| !text.contains('\n'));
    text.map(shell_word).ok_or_else(|| Failure::usage(format!("{path:?}: a job script needs a path of plain text")))
}

/// A word that a POSIX shell reads back as it is.
pub fn shell_word(word: &str) -> String {
    match plain(word) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// A word as `sbatch` reads it from an `#SBATCH` line: within double quotes a backslash protects those and itself.
fn sbatch_word(word: &str) -> Result<String, Failure> {
    if word.contains('\n') {
        return Err(Failure::usage(format!("{word:?}: a word for sbatch cannot hold a line break")));
    }
    let quoted = |text: &str| format!("\"{}\"", text.replace('\\', r"\\").replace('"', "\\\""));
    Ok(match word.split_once('=') {
        _ if plain(word) => word.to_owned(),
        Some((option, value)) if plain(option) => format!("{option}={}", quoted(value)),
        _ => quoted(word),
    })
}

/// Only letters that mean nothing to a shell or to sbatch.
fn plain(word: &str) -> bool {
    !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric() || "_-./:=,+@%".contains(c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch;
    use std::path::Path;
    use xshell::cmd;

    fn script() -> Script {
        Script {
            name: "column $1".into(),
            run: "/runs/it's \"a\" $run".into(),
            programs: "/programs".into(),
            launcher: vec!["srun".into(), "--mpi=pmix".into()],
            ranks: 64,
            go_on: GoOn::Requeue,
            sbatch: vec!["--time=04:00:00".into(), "--comment=a \"b\" \\c".into()],
            warning: 120,
            setup: "module load openmpi\n".into(),
            options: vec!["--checkpoint-every".into(), "2 h".into()],
        }
    }

    #[test]
    fn words_come_back_from_the_shell() {
        let shell = launch::shell().unwrap();
        for word in ["plain", "", "a b", "it's", "\"$HOME\" `id` \\ * ~ #", "-n", "'", "a\\'b", "ä=µ", "@RUN@"] {
            let line = format!("printf %s {}", shell_word(word));
            assert_eq!(cmd!(shell, "sh -c {line}").quiet().read().unwrap(), word, "{line}");
        }
        assert_eq!(shell_word("--time=04:00:00"), "--time=04:00:00");
    }

    /// As Slurm 22.05 reads it.
    #[test]
    fn words_for_sbatch_are_in_double_quotes() {
        assert_eq!(sbatch_word("--time=04:00:00").unwrap(), "--time=04:00:00");
        assert_eq!(sbatch_word("--chdir=/a b/c").unwrap(), "--chdir=\"/a b/c\"");
        assert_eq!(sbatch_word(r#"--comment=it's "b" \c"#).unwrap(), r#"--comment="it's \"b\" \\c""#);
        assert_eq!(sbatch_word("a b").unwrap(), "\"a b\"");
        assert_eq!(sbatch_word("--comment=a\nb").unwrap_err().code, formats::exit::USAGE);
    }

    #[test]
    fn every_mark_is_filled_in() {
        let text = script().text().unwrap();
        let left = ["@SBATCH@", "@SETUP@", "@RUN@", "@PROGRAMS@", "@RANKS@", "@GO_ON@", "@LAUNCHER@", "@OPTIONS@"];
        assert!(left.iter().all(|mark| TEMPLATE.contains(mark) && !text.contains(mark)), "{text}");
        let lines = [
            "#SBATCH --job-name=\"column $1\"",
            "#SBATCH --requeue",
            "#SBATCH --signal=B:USR1@120",
            "#SBATCH --comment=\"a \\\"b\\\" \\\\c\"",
            "module load openmpi",
            "run='/runs/it'\\''s \"a\" $run'",
            "programs=/programs",
            "ranks=${SLURM_NTASKS:-64}",
            "parallel() { exec srun --mpi=pmix -n \"$ranks\" \"$@\"; }",
        ];
        for line in lines {
            assert!(text.lines().any(|l| l == line), "no line {line}\n{text}");
        }
        assert!(text.contains("${changed:+--scene scene.toml} --checkpoint-every '2 h'\n"), "{text}");
        // What is filled in may look like a mark.
        let odd = Script { run: "/@RANKS@".into(), setup: String::new(), warning: 0, go_on: GoOn::Chain, ..script() };
        let text = odd.text().unwrap();
        assert!(text.contains("run=/@RANKS@\n") && text.contains("\nset -u\n") && !text.contains("USR1@"), "{text}");
        assert!(text.contains("\ngo_on=chain ") && text.contains("\n#SBATCH --no-requeue\n"), "{text}");
        let broken = Script { run: "/a\nb".into(), ..script() };
        assert_eq!(broken.text().unwrap_err().code, formats::exit::USAGE);
    }

    #[test]
    fn the_script_is_a_sound_shell_script() {
        let (shell, work) = (launch::shell().unwrap(), tempfile::tempdir().unwrap());
        for go_on in [GoOn::Requeue, GoOn::Chain] {
            let file = work.path().join("job.sh");
            std::fs::write(&file, Script { go_on, ..script() }.text().unwrap()).unwrap();
            cmd!(shell, "sh -n {file}").quiet().run().unwrap();
            if ["/usr/bin/shellcheck", "/usr/local/bin/shellcheck"].iter().any(|path| Path::new(path).exists()) {
                let said = cmd!(shell, "shellcheck --severity=warning {file}").quiet().ignore_status().read().unwrap();
                assert!(said.is_empty(), "{said}");
            }
        }
    }
}
