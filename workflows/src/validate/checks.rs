//! `checks.toml`: what a validation measures, on which case, and what it should be.
//!
//! ```toml
//! title = "Lube et al. 2004: axisymmetric columns"
//!
//! [[check]]
//! case = "column-rz-a1"            # of workflows/cases
//! measure = "runout"
//! law = "lube-runout"              # or value = 1.24, or as-case = "column-3d-quarter-a1", or at-most = 0.08
//! aspect = 1.0                     # of the law
//! tolerance = 0.15                 # relative; or within = 0.07, in the measure's own unit
//! source = "Lube et al. 2004"
//! ```

use super::{laws::Law, measure::Measure};
use crate::{failure::Failure, paths};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// One folder of tests/validation.
#[derive(Debug)]
pub struct Validation {
    /// Its folder's name.
    pub name: String,
    /// The folder, with the reference data.
    pub folder: PathBuf,
    /// One line.
    pub title: String,
    /// At least one.
    pub checks: Vec<Check>,
}

/// One number to hold against another.
#[derive(Debug)]
pub struct Check {
    /// Name of the case that is measured.
    pub case: String,
    /// What is measured.
    pub measure: Measure,
    /// What it should be.
    pub target: Target,
    /// Largest deviation; unused for upper bounds.
    pub tolerance: f64,
    /// Is the tolerance relative to the target?
    pub relative: bool,
    /// Where the target is from.
    pub source: String,
}

/// What a measure should be.
#[derive(Debug, PartialEq)]
pub enum Target {
    /// A number.
    Value(f64),
    /// A law at an aspect ratio.
    Law { law: Law, aspect: f64 },
    /// The same measure of another case.
    Case(String),
    /// Less than a number.
    AtMost(f64),
}

impl Check {
    /// The cases it needs.
    pub fn cases(&self) -> impl Iterator<Item = &str> {
        let other = match &self.target {
            Target::Case(other) => Some(other.as_str()),
            _ => None,
        };
        std::iter::once(self.case.as_str()).chain(other)
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawValidation {
    title: String,
    check: Vec<RawCheck>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct RawCheck {
    case: String,
    measure: Measure,
    value: Option<f64>,
    law: Option<Law>,
    aspect: Option<f64>,
    as_case: Option<String>,
    at_most: Option<f64>,
    tolerance: Option<f64>,
    within: Option<f64>,
    source: String,
}

/// Reads the validations of the given names, all where there are none.
pub fn read(names: &[String]) -> Result<Vec<Validation>, Failure> {
    let folder = paths::validation();
    let mut known: Vec<String> = std::fs::read_dir(&folder)
        .map_err(|e| Failure::no_input(format!("{}: cannot list the validations: {e}", folder.display())))?
        .flatten()
        .filter(|entry| entry.path().join("checks.toml").is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    known.sort();
    if let Some(unknown) = names.iter().find(|name| !known.contains(name)) {
        return Err(Failure::usage(format!("there is no validation `{unknown}`; there are: {}", known.join(", "))));
    }
    let chosen = known.iter().filter(|name| names.is_empty() || names.contains(name));
    chosen.map(|name| one(name, &folder.join(name))).collect()
}

fn one(name: &str, folder: &Path) -> Result<Validation, Failure> {
    let path = folder.join("checks.toml");
    let fault = |e: String| Failure::no_input(format!("{}: {e}", paths::short(&path).display()));
    let text = std::fs::read_to_string(&path).map_err(|e| fault(e.to_string()))?;
    let raw: RawValidation = toml::from_str(&text).map_err(|e| fault(e.to_string()))?;
    let checks = raw.check.into_iter().map(check).collect::<Result<_, _>>().map_err(fault)?;
    Ok(Validation { name: name.to_owned(), folder: folder.to_owned(), title: raw.title, checks })
}

fn check(raw: RawCheck) -> Result<Check, String> {
    let target = match (raw.value, raw.law, raw.aspect, raw.as_case, raw.at_most) {
        (Some(value), None, None, None, None) => Target::Value(value),
        (None, Some(law), Some(aspect), None, None) => Target::Law { law, aspect },
        (None, None, None, Some(case), None) => Target::Case(case),
        (None, None, None, None, Some(most)) => Target::AtMost(most),
        _ => return Err(format!("{}: give one of: value; law and aspect; as-case; at-most", raw.case)),
    };
    let (tolerance, relative) = match (raw.tolerance, raw.within, &target) {
        (None, None, Target::AtMost(_)) => (0.0, false),
        (Some(tolerance), None, t) if !matches!(t, Target::AtMost(_)) => (tolerance, true),
        (None, Some(within), t) if !matches!(t, Target::AtMost(_)) => (within, false),
        _ => return Err(format!("{}: give tolerance or within, and neither with at-most", raw.case)),
    };
    Ok(Check { case: raw.case, measure: raw.measure, target, tolerance, relative, source: raw.source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_checks_can_be_read_and_name_cases() {
        let validations = read(&[]).unwrap();
        assert!(validations.len() >= 3);
        for case in validations.iter().flat_map(|v| &v.checks).flat_map(Check::cases) {
            crate::cases::find(case).unwrap();
        }
        assert!(read(&["bars".into()]).unwrap_err().message.contains("bars-bui"));
    }

    #[test]
    fn a_check_needs_one_target_and_one_limit() {
        let parse = |keys: &str| {
            let text = format!("case = 'c'\nmeasure = 'runout'\nsource = 's'\n{keys}");
            check(toml::from_str(&text).unwrap())
        };
        assert_eq!(parse("value = 1.0\nwithin = 0.1").unwrap().target, Target::Value(1.0));
        assert!(parse("law = 'lube-runout'\naspect = 2.0\ntolerance = 0.1").unwrap().relative);
        for wrong in ["value = 1.0", "within = 0.1", "value = 1.0\nat-most = 2.0", "at-most = 2.0\nwithin = 1.0"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
        assert!(toml::from_str::<RawCheck>("case = 'c'\nmeasure = 'x'\nsource = 's'").is_err());
    }
}
