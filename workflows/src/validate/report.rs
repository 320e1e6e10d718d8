//! tests/validation/RESULTS.md: one section a validation, each with the commit and the day it was run.

use super::{Verdict, checks::Validation, measure::Run};
use crate::{failure::Failure, launch, paths};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use xshell::{Shell, cmd};

const HEAD: &str = "# Validation results\n\nMade by `./talus validate`; a section is replaced when its validation is run \
again. What each holds the programs\nagainst is in its `checks.toml`.\n";

/// The file.
pub fn path() -> PathBuf {
    paths::validation().join("RESULTS.md")
}

/// Prints a validation's table to standard error and puts it in the file, in the place of an earlier one.
pub fn write(validation: &Validation, verdicts: &[Verdict], runs: BTreeMap<&str, &Run>) -> Result<(), Failure> {
    let section = section(validation, verdicts, &runs, &made(&launch::shell()?));
    eprintln!("\n{section}");
    let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", paths::short(&path()).display()));
    let earlier = match std::fs::read_to_string(path()) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
        Err(e) => return Err(fault(e)),
    };
    std::fs::write(path(), replaced(&earlier, &validation.name, &section)).map_err(fault)
}

fn section(validation: &Validation, verdicts: &[Verdict], runs: &BTreeMap<&str, &Run>, made: &str) -> String {
    let mut text = format!("## {}\n\n{}. {made}\n\n", validation.name, validation.title);
    text += "| case | measure | here | reference | deviation | limit | holds | source |\n";
    text += "|---|---|---|---|---|---|---|---|\n";
    for v in verdicts {
        let (reference, deviation) = match v.reference {
            Some(r) => (format!("{r:.3}"), format!("{:+.1} %", 100.0 * (v.value / r - 1.0))),
            None => ("–".into(), "–".into()),
        };
        let holds = if v.within { "yes" } else { "**no**" };
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| {} | {} | {:.3} | {reference} | {deviation} | {} | {holds} | {} |",
            v.case, v.measure, v.value, v.limit, v.source
        );
    }
    text += "\n| case | particles | ranks | wall time |\n|---|---|---|---|\n";
    for (case, run) in runs {
        let time = run.seconds.map_or_else(|| "an earlier run".into(), |seconds| format!("{seconds:.0} s"));
        let _ = writeln!(text, "| {case} | {} | {} | {time} |", run.particles, run.ranks);
    }
    text
}

/// The file's text with one section replaced or added; sections stay sorted by name.
fn replaced(earlier: &str, name: &str, section: &str) -> String {
    let mut sections: BTreeMap<&str, &str> = BTreeMap::new();
    let normal = format!("\n{earlier}");
    for old in normal.split("\n## ").skip(1) {
        sections.insert(old.lines().next().unwrap_or_default().trim(), old.trim_end());
    }
    let new = section.trim_start_matches("## ").trim_end();
    sections.insert(name, new);
    sections.values().fold(HEAD.to_owned(), |text, section| text + "\n## " + section + "\n")
}

/// Which sources, and when.
fn made(shell: &Shell) -> String {
    let read = |command: xshell::Cmd<'_>| command.quiet().ignore_stderr().read().unwrap_or_default();
    let commit = match read(cmd!(shell, "git rev-parse --short=12 HEAD")) {
        empty if empty.is_empty() => "unknown".to_owned(),
        commit => commit,
    };
    let changes = read(cmd!(shell, "git status --porcelain -- . :!tests/validation/RESULTS.md"));
    let changed = if changes.is_empty() { "" } else { " with uncommitted changes" };
    format!("Commit {commit}{changed}, {}.", read(cmd!(shell, "date -u +%Y-%m-%d")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_section_of_that_name_is_replaced() {
        let first = replaced("", "b", "## b\n\none\n");
        let second = replaced(&first, "a", "## a\n\ntwo\n");
        let third = replaced(&second, "b", "## b\n\nthree\n");
        assert_eq!(third, format!("{HEAD}\n## a\n\ntwo\n\n## b\n\nthree\n"));
    }
}
