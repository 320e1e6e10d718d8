//! `validate`: runs cases and holds them against published numbers, as `tests/validation/<name>/checks.toml` says.

mod checks;
mod laws;
mod measure;
mod report;

use crate::{cases, failure::Failure, launch, paths, stage};
use checks::{Check, Target, Validation};
use formats::{exit, folder::RunFolder, snapshot};
use measure::Run;
use std::collections::BTreeMap;
use std::time::Instant;

/// Runs the validations of the given names, all where there are none, and writes their sections of RESULTS.md.
/// Fails with exit code 70 where a measured number misses its limit.
pub fn all(names: &[String], ranks: Option<u32>, reuse: bool) -> Result<(), Failure> {
    let validations = checks::read(names)?;
    let programs = stage::Programs::build()?;
    let (mut runs, mut missed) = (BTreeMap::new(), 0);
    for validation in &validations {
        for check in &validation.checks {
            for case in check.cases() {
                if !runs.contains_key(case) {
                    runs.insert(case.to_owned(), run(&programs, case, ranks, reuse)?);
                }
            }
        }
        let verdicts =
            validation.checks.iter().map(|check| judge(validation, check, &runs)).collect::<Result<Vec<_>, _>>()?;
        missed += verdicts.iter().filter(|verdict| !verdict.within).count();
        let used = validation.checks.iter().flat_map(Check::cases).filter_map(|case| Some((case, runs.get(case)?)));
        report::write(validation, &verdicts, used.collect())?;
    }
    println!("{}", paths::short(&report::path()).display());
    match missed {
        0 => Ok(()),
        1 => Err(Failure { code: exit::NUMERICAL, message: "one number is outside its limit, see above".into() }),
        n => {
            Err(Failure { code: exit::NUMERICAL, message: format!("{n} numbers are outside their limits, see above") })
        }
    }
}

/// Runs a case into runs/validation: afresh, because programs may have changed since.
fn run(programs: &stage::Programs, case: &str, ranks: Option<u32>, reuse: bool) -> Result<Run, Failure> {
    let found = cases::find(case)?;
    let folder = paths::runs().join("validation").join(&found.name);
    let reused = reuse && RunFolder::new(&folder).done().is_file();
    let started = Instant::now();
    let job =
        stage::Job { scene: &found.scene, folder: &folder, ranks, fresh: !reuse, again: "./talus validate --reuse" };
    stage::run(programs, &job)?;
    let header = snapshot::read_header(&RunFolder::new(&folder).initial())
        .map_err(|e| Failure { code: e.exit_code(), message: e.to_string() })?;
    Ok(Run {
        folder,
        particles: header.count,
        ranks: launch::ranks(ranks, header.count),
        seconds: (!reused).then(|| started.elapsed().as_secs_f64()),
    })
}

/// One check, measured.
#[derive(Debug)]
pub struct Verdict {
    /// Case, measure, and where the reference is from.
    pub case: String,
    pub measure: &'static str,
    pub source: String,
    /// Measured number.
    pub value: f64,
    /// Number it is held against; none for upper bounds.
    pub reference: Option<f64>,
    /// The limit in words.
    pub limit: String,
    /// Does it hold?
    pub within: bool,
}

fn judge(validation: &Validation, check: &Check, runs: &BTreeMap<String, Run>) -> Result<Verdict, Failure> {
    let measured = |case: &str| match runs.get(case) {
        Some(run) => measure::measure(check.measure, run, validation),
        None => Err(Failure::no_input(format!("{case}: not run"))),
    };
    let value = measured(&check.case)?;
    let reference = match &check.target {
        Target::Value(reference) => Some(*reference),
        Target::Law { law, aspect } => Some(law.at(*aspect)),
        Target::Case(other) => Some(measured(other)?),
        Target::AtMost(_) => None,
    };
    let (within, limit) = match (&check.target, reference) {
        (Target::AtMost(most), _) => (value < *most, format!("< {most}")),
        (_, Some(reference)) if check.relative => {
            ((value / reference - 1.0).abs() <= check.tolerance, format!("±{:.0} %", 100.0 * check.tolerance))
        }
        (_, reference) => {
            ((value - reference.unwrap_or(0.0)).abs() <= check.tolerance, format!("±{}", check.tolerance))
        }
    };
    let (case, source) = (check.case.clone(), check.source.clone());
    Ok(Verdict { case, measure: check.measure.title(), source, value, reference, limit, within })
}
