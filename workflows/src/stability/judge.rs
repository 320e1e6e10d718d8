//! What a run is worth: holds, degrades, or fails.

use super::definition::{Map, Row};
use crate::study::{
    expression,
    results::{self, Results},
    template,
};
use formats::exit;

/// How a method stands up to a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// As if nothing were wrong.
    Holds,
    /// Visible, the result is still of use.
    Degrades,
    /// The result is of no use, or the computation broke down.
    Fails,
}

/// A cell of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell {
    /// The method has no meaning here.
    Empty,
    /// Not run, of a scene that has changed since, or ended by something that was not the computation.
    ToDo,
    /// It ran, but the measure has no value.
    NoValue,
    /// It broke down: exit code 70.
    Broke,
    /// Its number.
    Judged(Verdict, f64),
}

impl Cell {
    /// None where nothing is known.
    pub fn verdict(self) -> Option<Verdict> {
        match self {
            Self::Empty | Self::ToDo | Self::NoValue => None,
            Self::Broke => Some(Verdict::Fails),
            Self::Judged(verdict, _) => Some(verdict),
        }
    }
}

impl Verdict {
    /// For tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Degrades => "degrades",
            Self::Fails => "**fails**",
        }
    }
}

/// By the thresholds of a row. Which way is worse follows from their order.
pub fn verdict(row: &Row, value: f64) -> Verdict {
    let sign = if row.holds < row.degrades { 1.0 } else { -1.0 };
    match sign * value {
        v if v <= sign * row.holds => Verdict::Holds,
        v if v <= sign * row.degrades => Verdict::Degrades,
        _ => Verdict::Fails,
    }
}

/// The cell of a row and a method.
pub fn cell(map: &Map, results: &Results, row: &Row, method: &str) -> Cell {
    if map.run(row, method).is_none() {
        return Cell::Empty;
    }
    let now = |method: &str| {
        let run = map.run(row, method)?;
        results.of(run).filter(|line| line.scene == results::hash(run))
    };
    match now(method) {
        Some(line) if line.exit == exit::NUMERICAL => Cell::Broke,
        Some(line) if line.exit == exit::DONE => {
            let reference = row.reference.as_ref().and_then(|name| now(name));
            let of = |line: Option<&results::Line>, key: &str| line.and_then(|l| l.measures.get(key).copied());
            let lookup = |name: &str| {
                let constant = || template::number(&map.constants, name);
                let value = match name.strip_prefix("reference.") {
                    Some(key) => of(reference, key),
                    None => of(Some(line), name).or_else(constant),
                };
                Some(value.unwrap_or(f64::NAN))
            };
            // Its names were looked up when it was read.
            match expression::evaluate(&row.measure.expression, &lookup) {
                Ok(value) if value.is_finite() => Cell::Judged(verdict(row, value), value),
                _ => Cell::NoValue,
            }
        }
        _ => Cell::ToDo,
    }
}

/// A number short enough for a cell of the picture.
pub fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        v if !(0.00995..9950.0).contains(&v) => format!("{value:.0e}"),
        v if v >= 99.5 => format!("{value:.0}"),
        v if v >= 9.95 => format!("{value:.1}"),
        v if v >= 0.0995 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// Three digits, for tables.
pub fn three(value: f64) -> String {
    results::significant(format!("{value:.2e}").parse().unwrap_or(value))
}
