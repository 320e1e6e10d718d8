//! tests/faults/REPORT.md and the counts beside it.

use super::results::{self, Outcome, Results};
use crate::validate::record::{Sources, today};
use crate::{failure::Failure, launch, paths};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

/// What may be found, and what it means.
const FINDINGS: [(&str, &str); 6] = [
    ("lost generation", "a generation that was published is not sound"),
    ("lost interval", "more than one interval between checkpoints is to be done again"),
    ("hang", "no end within 90 s of a run that takes one"),
    ("other bits", "the outputs after going on are not those of the uninterrupted run"),
    ("wrong code", "another exit code than the one that is right, or going on failed"),
    ("missed", "damage that was not noticed, or not named"),
];

/// Groups of trials: how their names begin, and what was done.
const GROUPS: [(&str, &str); 8] = [
    ("kill", "SIGKILL"),
    ("full", "no room from a write or allocation on"),
    ("disk", "a real disk that is too small"),
    ("io", "an I/O error in a call that changes something"),
    ("read", "an I/O error in opening or reading"),
    ("resume", "the same in going on from a checkpoint"),
    ("cut", "a generation's file cut off at a border of 4 KiB"),
    ("flip", "a bit changed in a dataset, an attribute or the manifest"),
];

/// Where the report is.
pub fn path() -> PathBuf {
    paths::repository().join("tests/faults/REPORT.md")
}

/// Writes both files; returns how many trials found something. `left`: trials still to do.
pub fn write(results: &Results, sources: &Sources, seed: u64, left: usize) -> Result<usize, Failure> {
    let path = path();
    let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display()));
    fs::create_dir_all(path.with_file_name("")).map_err(fault)?;
    fs::write(&path, page(&results.trials, sources, seed, left)).map_err(fault)?;
    let lines: String = results.trials.iter().map(|(name, outcome)| results::line(name, outcome)).collect();
    fs::write(path.with_file_name("trials.csv"), format!("trial,struck,exit code,what,findings\n{lines}"))
        .map_err(fault)?;
    Ok(results.trials.values().filter(|outcome| !outcome.findings.is_empty()).count())
}

fn page(trials: &BTreeMap<String, Outcome>, sources: &Sources, seed: u64, left: usize) -> String {
    let cores = launch::cores();
    let mut page = format!(
        "# Faults\n\nWritten by `./talus faults --seed {seed}` on {}, commit {sources}, {cores} cores. Every trial is a run \
         of a small scene that something is done to; then the same command goes on, on 1 to 5 ranks, and its outputs \
         are held against those of the uninterrupted run, byte for byte. What each trial did is in [trials.csv](trials.csv).\n",
        today()
    );
    if left > 0 {
        let _ = write!(page, "\nNot finished: {left} trials are still to do.\n");
    }
    let group = |name: &'static str| trials.iter().filter(move |(trial, _)| trial.split(' ').next() == Some(name));
    let _ = write!(page, "\n| what was done | trials | struck |");
    for (finding, _) in FINDINGS {
        let _ = write!(page, " {finding} |");
    }
    let _ = writeln!(page, "\n|---|---:|---:|{}", "---:|".repeat(FINDINGS.len()));
    for (name, what) in GROUPS {
        let struck = group(name).filter(|(_, outcome)| outcome.struck).count();
        let _ = write!(page, "| {what} | {} | {struck} |", group(name).count());
        for (finding, _) in FINDINGS {
            let _ = write!(page, " {} |", group(name).map(|(_, outcome)| outcome.count(finding)).sum::<usize>());
        }
        page.push('\n');
    }
    page.push_str("\nColumns:");
    for (finding, meaning) in FINDINGS {
        let _ = write!(page, "\n- {finding}: {meaning};");
    }
    page.pop();
    page.push_str(".\n");

    let kills = |so: &dyn Fn(&str) -> bool| group("kill").filter(|(name, outcome)| outcome.struck && so(name)).count();
    let _ = writeln!(page, "\nKills by space and ranks:\n\n| | 1 | 2 | 3 | 4 | 5 | at a call | from outside |");
    let _ = writeln!(page, "|---|---:|---:|---:|---:|---:|---:|---:|");
    for space in ["plane", "rings", "solid"] {
        let _ = write!(page, "| {space} |");
        for ranks in 1..=5 {
            let _ = write!(page, " {} |", kills(&|name| name.starts_with(&format!("kill {space} {ranks} ranks"))));
        }
        let at = |word: &str| kills(&|name| name.starts_with(&format!("kill {space} ")) && name.contains(word));
        let _ = writeln!(page, " {} | {} |", at(" call "), at(" moment "));
    }
    let found: Vec<_> = trials.iter().filter(|(_, outcome)| !outcome.findings.is_empty()).collect();
    if !found.is_empty() {
        page.push_str("\n## Found\n\n");
        for (name, outcome) in found.iter().take(100) {
            let _ = writeln!(page, "- `{name}` ({}): {}", outcome.what, outcome.findings.join("; "));
        }
        let _ =
            writeln!(page, "\n{} trials found something. Once more: `./talus faults --only \"NAME\"`.", found.len());
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_counts() {
        let struck = Outcome { struck: true, code: 137, ..Outcome::default() };
        let mut lost = struck.clone();
        lost.find(true, "lost generation", || "gen-000002".into());
        let trials = BTreeMap::from([
            ("kill plane 3 ranks, rank 1 call 3".to_owned(), struck.clone()),
            ("kill plane 3 ranks, moment 7, all".to_owned(), lost),
            ("kill solid 1 ranks, rank 0 call 9".to_owned(), Outcome::default()),
            ("io plane 1 ranks, rank 0 call 2".to_owned(), struck),
        ]);
        let page = page(&trials, &Sources { commit: "abc".into(), changed: false }, 4, 0);
        assert!(page.contains("| SIGKILL | 3 | 2 | 1 | 0 | 0 | 0 | 0 | 0 |"), "{page}");
        assert!(page.contains("| an I/O error in a call that changes something | 1 | 1 | 0 |"), "{page}");
        assert!(page.contains("| plane | 0 | 0 | 2 | 0 | 0 | 1 | 1 |") && page.contains("| solid | 0 |"), "{page}");
        assert!(page.contains("## Found") && page.contains("gen-000002") && page.contains("commit abc"), "{page}");
    }
}
