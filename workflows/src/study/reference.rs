//! `reference.csv` of a study: published power laws, y = coef a^expo for a_lo <= a < a_hi, each with its source.

use super::expression;
use serde::Deserialize;
use std::path::Path;

/// A curve to compare with.
#[derive(Debug)]
pub struct Reference {
    /// Its name in expressions.
    pub name: String,
    /// For legends.
    pub label: String,
    /// The parameter it is a function of.
    pub of: String,
    /// The function.
    pub law: Law,
}

/// A function of one number.
#[derive(Debug)]
pub enum Law {
    /// Power laws, each on its range.
    Branches(Vec<Branch>),
    /// An expression.
    Expression(String),
}

/// `coef a^expo` for `a_lo <= a < a_hi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Branch {
    /// Range of a.
    pub range: [f64; 2],
    /// Factor.
    pub coefficient: f64,
    /// Power.
    pub exponent: f64,
}

/// As in study.toml: rows of reference.csv by source, quantity and, where needed, geometry; or an expression.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Raw {
    name: String,
    label: String,
    #[serde(default = "aspect")]
    of: String,
    source: Option<String>,
    quantity: Option<String>,
    expression: Option<String>,
}

fn aspect() -> String {
    "aspect".into()
}

impl Reference {
    /// Its value; not-a-number outside of its range.
    pub fn at(&self, x: f64) -> f64 {
        match &self.law {
            Law::Branches(branches) => {
                let last = branches.iter().map(|b| b.range[1]).fold(f64::MIN, f64::max);
                let inside = |b: &&Branch| b.range[0] <= x && (x < b.range[1] || x == b.range[1] && x == last);
                branches.iter().find(inside).map_or(f64::NAN, |b| b.coefficient * x.powf(b.exponent))
            }
            Law::Expression(text) => {
                let of = |name: &str| (name == self.of).then_some(x);
                expression::evaluate(text, &of).unwrap_or(f64::NAN)
            }
        }
    }

    /// The ranges on which it is drawn in one piece, within the axis.
    pub fn pieces(&self, axis: [f64; 2]) -> Vec<[f64; 2]> {
        let cut = |range: [f64; 2]| [range[0].max(axis[0]), range[1].min(axis[1])];
        let ranges = match &self.law {
            Law::Branches(branches) => branches.iter().map(|b| cut(b.range)).collect(),
            Law::Expression(_) => vec![axis],
        };
        ranges.into_iter().filter(|range: &[f64; 2]| range[0] < range[1]).collect()
    }
}

/// The references of a study.
pub fn read(folder: &Path, raw: Vec<Raw>) -> Result<Vec<Reference>, String> {
    let path = folder.join("reference.csv");
    let rows = match raw.iter().any(|raw| raw.source.is_some()) {
        true => std::fs::read_to_string(&path).map_err(|e| format!("reference.csv: {e}"))?,
        false => String::new(),
    };
    raw.into_iter().map(|raw| one(raw, &rows)).collect()
}

fn one(raw: Raw, rows: &str) -> Result<Reference, String> {
    let law = match (&raw.source, &raw.quantity, raw.expression) {
        (Some(source), Some(quantity), None) => Law::Branches(branches(rows, source, quantity)?),
        (None, None, Some(text)) => {
            expression::evaluate(&text, &|name| (name == raw.of).then_some(1.0))?;
            Law::Expression(text)
        }
        _ => return Err(format!("reference {}: give source and quantity, or an expression", raw.name)),
    };
    Ok(Reference { name: raw.name, label: raw.label, of: raw.of, law })
}

/// Columns `source,quantity,a_lo,a_hi,coef,expo`, then where it was read; remarks begin with `#`.
fn branches(rows: &str, source: &str, quantity: &str) -> Result<Vec<Branch>, String> {
    let mut found = Vec::new();
    for (index, line) in rows.lines().enumerate() {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        if line.starts_with('#') || cells.len() < 6 || cells[0] != source || cells[1] != quantity {
            continue;
        }
        let numbers: Vec<f64> = cells[2..6].iter().filter_map(|cell| cell.parse().ok()).collect();
        let &[low, high, coefficient, exponent] = numbers.as_slice() else {
            return Err(format!("reference.csv, line {}: four numbers expected after the quantity", index + 1));
        };
        found.push(Branch { range: [low, high], coefficient, exponent });
    }
    match found.is_empty() {
        true => Err(format!("reference.csv: no line of `{source}` and `{quantity}`")),
        false => Ok(found),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: &str = "# remark\nsource,quantity,a_lo,a_hi,coef,expo,trace\nL,runout,0,1.7,1.24,1,Eq 45\nL,runout,1.7,30,1.6,0.5,Eq 45\n";

    #[test]
    fn branches_hold_on_their_ranges() {
        let law = Law::Branches(branches(ROWS, "L", "runout").unwrap());
        let reference = Reference { name: "l".into(), label: "L".into(), of: "aspect".into(), law };
        for a in [0.5, 1.0, 1.7, 4.0, 30.0] {
            assert!((reference.at(a) - formats::laws::lube_runout(a)).abs() < 1e-12, "{a}");
        }
        assert!(reference.at(30.1).is_nan() && reference.at(-0.1).is_nan());
        assert_eq!(reference.pieces([0.1, 10.0]), [[0.1, 1.7], [1.7, 10.0]]);
        assert!(branches(ROWS, "L", "height").unwrap_err().contains("no line"));
        assert!(branches("L,runout,0,1,x,1", "L", "runout").unwrap_err().contains("line 1"));
    }
}
