//! tests/validation/RESULTS.md: one section a validation. What is judged, what else every run gave, and which commit
//! computed each run on which day.

use super::{
    Verdict,
    checks::Validation,
    measure::{self, Overview, Run},
    record::{self, Sources},
};
use crate::{failure::Failure, paths};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

const HEAD: &str = "# Validation results

Made by `./talus validate`; a section is replaced when its validation is run again. What each holds the programs
against, and why that measure, is in its `checks.toml`.

The second table of a section shows what is not judged as well. Run-out is (r - r0)/r0, with three radii r: of the furthest
particle; the one that holds 99.5 % of the mass; the one up to which the deposit is at least dx/2 thick. V/V0 is the volume
over the volume at the initial density, F/W the force on the floor over the weight. Then: by how much of r0 the 99.5 %
front moved during the last T = sqrt(H0/g), H0 the initial height; the final kinetic energy over its peak; and the particles
across r0. `scene` begins the SHA-256 of the case's `scene.toml`. A dash: the scene has no such number.
";

/// Digits of a scene's hash that are shown.
const HASH_DIGITS: usize = 8;

/// The file.
pub fn path() -> PathBuf {
    paths::validation().join("RESULTS.md")
}

/// Prints a validation's tables to standard error and puts them in the file, in the place of earlier ones. `sources`:
/// those that evaluated the runs.
pub fn write(
    validation: &Validation,
    verdicts: &[Verdict],
    runs: &BTreeMap<&str, &Run>,
    sources: &Sources,
) -> Result<(), Failure> {
    let overviews = runs.iter().map(|(case, run)| Ok((*case, measure::overview(run)?, *run)));
    let overviews = overviews.collect::<Result<Vec<_>, Failure>>()?;
    let made = format!("Evaluated by {sources}, {}.", record::today());
    let section = section(validation, verdicts, &overviews, &made);
    eprintln!("\n{section}");
    let fault = |e: std::io::Error| Failure::cannot_write(format!("{}: {e}", paths::short(&path()).display()));
    let earlier = match std::fs::read_to_string(path()) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
        Err(e) => return Err(fault(e)),
    };
    std::fs::write(path(), replaced(&earlier, &validation.name, &section)).map_err(fault)
}

// Writing to a String cannot fail, so what `writeln!` answers is dropped here.
fn section(validation: &Validation, verdicts: &[Verdict], runs: &[(&str, Overview, &Run)], made: &str) -> String {
    let mut text = format!("## {}\n\n{}. {made}\n\n", validation.name, validation.title);
    text += "| case | measure | here | reference | deviation | limit | holds | source |\n";
    text += "|---|---|---|---|---|---|---|---|\n";
    for v in verdicts {
        let (reference, deviation) = match v.reference {
            Some(r) => (format!("{r:.3}"), format!("{:+.1} %", 100.0 * (v.value / r - 1.0))),
            None => (DASH.into(), DASH.into()),
        };
        let holds = match v.within {
            Some(true) => "yes",
            Some(false) => "**no**",
            None => "not judged",
        };
        let _ = writeln!(
            text,
            "| {} | {} | {:.3} | {reference} | {deviation} | {} | {holds} | {} |",
            v.case, v.measure, v.value, v.limit, v.source
        );
    }
    text += "\n| case | run-out, furthest | run-out, 99.5 % of mass | run-out, thickness dx/2 | height/r0 | V/V0 | F/W \
             | 99.5 % front in the last T | kinetic energy/peak | particles | r0/dx | scene |\n";
    text += "|---|---|---|---|---|---|---|---|---|---|---|---|\n";
    for (case, shown, run) in runs {
        let cells = [
            fixed(shown.runouts[0]),
            fixed(shown.runouts[1]),
            fixed(shown.runouts[2]),
            fixed(shown.height),
            fixed(shown.volume_ratio),
            fixed(shown.basal_force),
            power(shown.front_last),
            power(shown.kinetic_over_peak),
            shown.particles.map_or_else(|| DASH.into(), |count| count.to_string()),
            shown.resolution.map_or_else(|| DASH.into(), |r| format!("{}", (10.0 * r).round() / 10.0)),
            run.record.scene.chars().take(HASH_DIGITS).collect(),
        ];
        let _ = writeln!(text, "| {case} | {} |", cells.join(" | "));
    }
    text += "\n| case | computed by | on | ranks | wall time |\n|---|---|---|---|---|\n";
    for (case, _, run) in runs {
        let record = &run.record;
        let time = record.seconds.map_or_else(|| DASH.into(), |seconds| format!("{seconds:.0} s"));
        let _ = writeln!(text, "| {case} | {} | {} | {} | {time} |", record.sources, record.date, record.ranks);
    }
    text
}

const DASH: &str = "–";

fn fixed(number: Option<f64>) -> String {
    number.map_or_else(|| DASH.into(), |value| format!("{value:.3}"))
}

/// For numbers that are small where all is well.
fn power(number: Option<f64>) -> String {
    number.map_or_else(|| DASH.into(), |value| format!("{value:.1e}"))
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

    #[test]
    fn figures_carry_the_commit_of_their_run_and_the_hash_of_its_scene() {
        let sources = Sources { commit: "0123456789ab".into(), changed: true };
        let mut record = record::Record::begun(&sources, "spacing = 1", 2);
        record.date = "2026-01-31".into();
        let run = Run { folder: "r".into(), spacing: 0.004, record };
        let shown =
            Overview { runouts: [Some(1.5), Some(1.25), Some(1.2)], front_last: Some(0.0123), ..Overview::default() };
        let validation = Validation { name: "v".into(), folder: "v".into(), title: "Title".into(), checks: Vec::new() };
        let verdict = |within, limit: &str| Verdict {
            case: "c".into(),
            measure: "m",
            source: "s".into(),
            value: 1.2,
            reference: Some(1.0),
            limit: limit.into(),
            within,
        };
        let verdicts = [verdict(Some(false), "±15 %"), verdict(None, "–")];
        let text = section(&validation, &verdicts, &[("c", shown, &run)], "Evaluated by x, today.");
        let hash = &formats::scene::Scene::text_hash("spacing = 1")[..8];
        for line in [
            "Title. Evaluated by x, today.",
            "| c | m | 1.200 | 1.000 | +20.0 % | ±15 % | **no** | s |",
            "| c | m | 1.200 | 1.000 | +20.0 % | – | not judged | s |",
            &format!("| c | 1.500 | 1.250 | 1.200 | – | – | – | 1.2e-2 | – | – | – | {hash} |"),
            "| c | 0123456789ab with uncommitted changes | 2026-01-31 | 2 | – |",
        ] {
            assert!(text.lines().any(|l| l == line), "no {line}\n{text}");
        }
        let tables = text.split("\n\n").filter(|part| part.starts_with('|'));
        for table in tables {
            let columns: Vec<usize> = table.trim_end().lines().map(|line| line.matches('|').count()).collect();
            assert!(columns.iter().all(|count| *count == columns[0]), "{table}");
        }
    }
}
