//! Results of trials, one a line, written as they come: `runs/faults/trials.csv`.

use crate::validate::record::Sources;
use crate::{failure::Failure, paths};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write;
use std::path::PathBuf;

/// What came of a trial.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Did what was to be done happen?
    pub struck: bool,
    /// Exit code of the launch it was done to.
    pub code: i32,
    /// What was done, in the words of the one who did it.
    pub what: String,
    /// Kind and words of everything that should not be.
    pub findings: Vec<String>,
}

impl Outcome {
    /// Notes a finding of this kind if there is one.
    pub fn find(&mut self, so: bool, kind: &str, words: impl FnOnce() -> String) {
        if so {
            self.findings.push(format!("{kind}: {}", words()));
        }
    }

    /// How many findings of a kind.
    pub fn count(&self, kind: &str) -> usize {
        self.findings.iter().filter(|finding| finding.starts_with(&format!("{kind}: "))).count()
    }
}

/// All results of one version of the programs and one seed.
pub struct Results {
    file: File,
    path: PathBuf,
    pub trials: BTreeMap<String, Outcome>,
}

impl Results {
    /// Opens the file; what other sources or another seed left in it is begun anew.
    pub fn open(sources: &Sources, seed: u64) -> Result<Self, Failure> {
        let path = paths::runs().join("faults/trials.csv");
        let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display()));
        fs::create_dir_all(paths::runs().join("faults")).map_err(fault)?;
        let head = format!("# {sources}, seed {seed}\n");
        let text = fs::read_to_string(&path).unwrap_or_default();
        let trials = text.strip_prefix(&head).map(|lines| lines.lines().filter_map(parse).collect());
        let anew = trials.is_none();
        let mut file = File::options().create(true).append(true).open(&path).map_err(fault)?;
        if anew {
            file.set_len(0).and_then(|()| file.write_all(head.as_bytes())).map_err(fault)?;
        }
        Ok(Self { file, trials: trials.unwrap_or_default(), path })
    }

    /// Is this trial done?
    pub fn has(&self, name: &str) -> bool {
        self.trials.contains_key(name)
    }

    /// Adds a result.
    pub fn add(&mut self, name: &str, outcome: Outcome) -> Result<(), Failure> {
        let line = line(name, &outcome);
        let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", paths::short(&self.path).display()));
        self.file.write_all(line.as_bytes()).map_err(fault)?;
        self.trials.insert(name.to_owned(), outcome);
        Ok(())
    }
}

/// As a line of CSV.
pub fn line(name: &str, outcome: &Outcome) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace(['"', '\n', '\r'], " "));
    let findings = outcome.findings.join(" | ");
    format!(
        "{},{},{},{},{}\n",
        quoted(name),
        u8::from(outcome.struck),
        outcome.code,
        quoted(&outcome.what),
        quoted(&findings)
    )
}

fn parse(line: &str) -> Option<(String, Outcome)> {
    let (name, rest) = line.strip_prefix('"')?.split_once("\",")?;
    let (struck, rest) = rest.split_once(',')?;
    let (code, rest) = rest.split_once(",\"")?;
    let (what, findings) = rest.strip_suffix('"')?.split_once("\",\"")?;
    let findings = findings.split(" | ").filter(|finding| !finding.is_empty()).map(Into::into).collect();
    let outcome = Outcome { struck: struck == "1", code: code.parse().ok()?, what: what.into(), findings };
    Some((name.to_owned(), outcome))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_back() {
        let mut outcome =
            Outcome { struck: true, code: 137, what: "struck: kill, call 3".into(), ..Outcome::default() };
        outcome.find(false, "hang", || unreachable!());
        let read = |outcome: &Outcome| parse(line("kill plane 3 ranks, rank 1 call 3", outcome).trim_end()).unwrap();
        assert_eq!(read(&outcome), ("kill plane 3 ranks, rank 1 call 3".into(), outcome.clone()));
        outcome.find(true, "hang", || "no end".into());
        outcome.find(true, "other bits", || "[history.csv]".into());
        assert_eq!(read(&outcome).1, outcome);
        assert_eq!((outcome.count("hang"), outcome.count("lost generation")), (1, 0));
        // Half a line, of a campaign that was killed.
        assert_eq!(parse("\"kill plane 3 ranks, ra"), None);
    }
}
