//! `validate`: runs cases and holds them against published numbers, as `tests/validation/<name>/checks.toml` says.

mod checks;
mod laws;
pub mod measure;
pub mod record;
mod report;

use crate::{cases, failure::Failure, launch, paths, stage};
use checks::{Check, Target, Validation};
use formats::{
    exit,
    folder::RunFolder,
    scene::{self, Scene},
    snapshot,
};
use measure::{Measure, Run};
use record::{Earlier, Record, Sources};
use std::collections::BTreeMap;
use std::time::Instant;

/// Runs the validations of the given names, all where there are none, and writes their sections of RESULTS.md.
/// Fails with exit code 70 where a measured number misses its limit.
pub fn all(names: &[String], ranks: Option<u32>, reuse: bool) -> Result<(), Failure> {
    let validations = checks::read(names)?;
    let programs = stage::Programs::build()?;
    let sources = Sources::now()?;
    let (mut runs, mut missed) = (BTreeMap::new(), 0);
    for validation in &validations {
        for check in &validation.checks {
            for case in check.cases() {
                if !runs.contains_key(case) {
                    runs.insert(case.to_owned(), run(&programs, &sources, case, ranks, reuse)?);
                }
            }
        }
        let verdicts = validation.checks.iter().map(|check| judge(validation, check, &runs));
        let verdicts: Vec<_> = verdicts.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
        missed += verdicts.iter().filter(|verdict| verdict.within == Some(false)).count();
        let used = validation.checks.iter().flat_map(Check::cases).filter_map(|case| Some((case, runs.get(case)?)));
        report::write(validation, &verdicts, &used.collect(), &sources)?;
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

/// Runs a case into runs/validation: afresh, because programs may have changed since, unless earlier runs may be used
/// and this one says of itself that it is of the same scene.
fn run(
    programs: &stage::Programs,
    sources: &Sources,
    case: &str,
    ranks: Option<u32>,
    reuse: bool,
) -> Result<Run, Failure> {
    let found = cases::find(case)?;
    let text = std::fs::read_to_string(&found.scene)
        .map_err(|e| Failure::no_input(format!("{}: cannot read the scene: {e}", found.scene.display())))?;
    let scene =
        Scene::read_with(case, &text, &scene::Sources::of(&found.scene)).map_err(|e| Failure::usage(e.to_string()))?;
    let folder = paths::runs().join("validation").join(&found.name);
    let job = stage::Job {
        scene: &found.scene,
        folder: &folder,
        ranks,
        fresh: false,
        again: "./talus validate --reuse",
        log: None,
    };
    let earlier = match reuse {
        true => record::earlier(&folder, &text, sources),
        false => Earlier::Useless("not asked for"),
    };
    let record = match earlier {
        // Of a run that is done only the results are made again, by today's sph-post: the report names both sources.
        Earlier::Done(record) | Earlier::Begun(record) => {
            stage::run(programs, &job)?;
            record
        }
        Earlier::Useless(why) => {
            if reuse {
                eprintln!("talus: {case} is run afresh: an earlier run cannot be used: {why}");
            }
            let started = Instant::now();
            stage::prepare(programs, &stage::Job { fresh: true, ..job })?;
            let header = snapshot::read_header(&RunFolder::new(&folder).initial())
                .map_err(|e| Failure { code: e.exit_code(), message: e.to_string() })?;
            let mut record = Record::begun(sources, &text, launch::ranks(ranks, header.count));
            record.write(&folder)?;
            stage::compute(programs, &job)?;
            record.seconds = Some(started.elapsed().as_secs_f64());
            record.write(&folder)?;
            record
        }
    };
    Ok(Run { folder, spacing: scene.spacing, record })
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
    /// Does it hold? None: shown, not judged.
    pub within: Option<bool>,
}

/// A check against its limit, with other definitions of the same front below it: shown, not judged.
fn judge(validation: &Validation, check: &Check, runs: &BTreeMap<String, Run>) -> Result<Vec<Verdict>, Failure> {
    let mut verdicts = vec![judged(validation, check, check.measure, runs)?];
    let beside: &[Measure] = match check.measure {
        Measure::Runout => &[Measure::RunoutThickness],
        Measure::RunoutThickness => &[Measure::Runout],
        Measure::Front => &[Measure::RunoutThickness, Measure::Runout],
        _ => &[],
    };
    for &measure in beside {
        let shown = judged(validation, check, measure, runs)?;
        verdicts.push(Verdict { limit: "–".into(), within: None, ..shown });
    }
    Ok(verdicts)
}

fn judged(
    validation: &Validation,
    check: &Check,
    measure: Measure,
    runs: &BTreeMap<String, Run>,
) -> Result<Verdict, Failure> {
    let measured = |case: &str| match runs.get(case) {
        Some(run) => measure::measure(measure, run, validation),
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
    Ok(Verdict { case, measure: measure.title(), source, value, reference, limit, within: Some(within) })
}
