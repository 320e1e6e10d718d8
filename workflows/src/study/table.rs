//! Tables of the page: a line a run, or means over runs.

use super::{
    definition::{Choice, Run, Study, Tabulated},
    expression,
    results::{self, Line, Results},
    template::{self, Value},
};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// What is known of a run: names of parameters, measures, constants and references.
pub struct Known<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its results.
    pub results: &'a Results,
}

const NOT_RUN: &str = "not run";
const DASH: &str = "–";

impl Known<'_> {
    /// Value of an expression of a run; not-a-number where something in it is not there.
    pub fn value(&self, run: &Run, beside: Option<&Run>, text: &str) -> f64 {
        let lookup = |name: &str| match (name.strip_prefix("other."), beside) {
            (Some(name), Some(other)) => self.name(other, name),
            (Some(_), None) => Some(f64::NAN),
            (None, _) => self.name(run, name),
        };
        expression::evaluate(text, &lookup).unwrap_or(f64::NAN)
    }

    /// Is it the run that is missing, and not a reference that ends before?
    fn needs_a_run(&self, run: &Run, text: &str) -> bool {
        let is_known = |name: &str| {
            let of_study = self.study.constants.iter().any(|(known, _)| known == name);
            of_study
                || self.study.references.iter().any(|r| r.name == name)
                || self.study.parameters.iter().any(|p| p == name)
        };
        let lookup = |name: &str| if is_known(name) { self.name(run, name) } else { Some(1.0) };
        expression::evaluate(text, &lookup).is_ok_and(f64::is_finite)
    }

    fn name(&self, run: &Run, name: &str) -> Option<f64> {
        let line = self.line(run);
        let of = |value: Option<f64>| value.unwrap_or(f64::NAN);
        if let Some(number) =
            template::number(&run.parameters, name).or_else(|| template::number(&self.study.constants, name))
        {
            return Some(number);
        }
        if let Some(reference) = self.study.references.iter().find(|reference| reference.name == name) {
            return Some(reference.at(of(template::number(&run.parameters, &reference.of))));
        }
        Some(match name {
            "particles" => of(line.and_then(|line| line.particles).map(|n| n as f64)),
            "wall_s" => of(line.and_then(|line| line.seconds)),
            _ => of(line.and_then(|line| line.measures.get(name).copied())),
        })
    }

    /// The line of a run that did not fail.
    pub fn line(&self, run: &Run) -> Option<&Line> {
        self.results.of(run).filter(|line| line.exit == 0)
    }
}

/// The table as Markdown, with a line below that tells how much of it is there, and who computed it.
pub fn table(study: &Study, results: &Results, table: &Tabulated) -> String {
    let known = Known { study, results };
    let runs = study.chosen(&Choice { series: table.series.clone(), only: table.only.clone() });
    let lines = match table.mean.is_empty() {
        true => runs.iter().map(|run| single(&known, table, run)).collect(),
        false => means(&known, table, &runs),
    };
    let keys = table.mean.iter().map(String::as_str).chain((!table.mean.is_empty()).then_some("runs"));
    let head: Vec<&str> = keys.chain(table.columns.iter().map(|column| column.title.as_str())).collect();
    let mut text = format!("| {} |\n|{}\n", head.join(" | "), "---|".repeat(head.len()));
    for line in lines {
        let _ = writeln!(text, "| {} |", line.join(" | "));
    }
    text + "\n" + &provenance(results, &runs) + "\n"
}

/// `3 of 5 runs, computed by a1b2c3 from 2026-01-01 to 2026-01-02.` And what the marks mean, where there are any.
pub fn provenance(results: &Results, runs: &[&Run]) -> String {
    let lines: Vec<&Line> = runs.iter().filter_map(|run| results.of(run)).collect();
    let mut text = format!("{} of {} runs", lines.iter().filter(|line| line.exit == 0).count(), runs.len());
    let set = |of: fn(&Line) -> &str| lines.iter().map(|line| of(line)).collect::<BTreeSet<_>>();
    let (commits, dates) = (set(|line| &line.commit), set(|line| &line.date));
    if let (Some(first), Some(last)) = (dates.first(), dates.last()) {
        let days = if first == last { (*first).to_string() } else { format!("{first} to {last}") };
        let _ = write!(text, ", computed by {}, {days}", commits.into_iter().collect::<Vec<_>>().join(", "));
    }
    text += ".";
    if runs.iter().any(|run| is_stale(results, run)) {
        text += " †: the scene has changed since.";
    }
    text
}

fn is_stale(results: &Results, run: &Run) -> bool {
    results.of(run).is_some_and(|line| line.scene != results::hash(run))
}

fn single(known: &Known, table: &Tabulated, run: &Run) -> Vec<String> {
    let other = table.beside.as_deref().and_then(|series| beside(known.study, run, series));
    let mark = if is_stale(known.results, run) { " †" } else { "" };
    let cell = |text: &str| {
        let parameter = run.parameters.iter().find(|(name, _)| name == text);
        match (text, parameter) {
            ("series", _) => return run.series.clone(),
            (_, Some((_, value))) => return value.to_string(),
            _ => {}
        }
        match (known.results.of(run), known.value(run, other, text)) {
            (_, value) if value.is_finite() => short(value),
            (None, _) if known.needs_a_run(run, text) => NOT_RUN.into(),
            (Some(line), _) if line.exit != 0 && known.needs_a_run(run, text) => format!("failed ({})", line.exit),
            _ if other.is_some_and(|other| known.line(other).is_none()) && text.contains("other.") => NOT_RUN.into(),
            _ => DASH.into(),
        }
    };
    let mut cells: Vec<String> = table.columns.iter().map(|column| cell(&column.expression)).collect();
    if let Some(first) = cells.first_mut() {
        *first += mark;
    }
    cells
}

/// The run of another series whose parameters that both have are equal.
pub(super) fn beside<'a>(study: &'a Study, run: &Run, series: &str) -> Option<&'a Run> {
    let fits = |other: &Run| {
        let have = |name: &String| other.parameters.iter().find(|(known, _)| known == name);
        run.parameters.iter().all(|(name, value)| have(name).is_none_or(|(_, known)| known == value))
    };
    study.runs.iter().find(|other| other.series == series && fits(other))
}

fn means(known: &Known, table: &Tabulated, runs: &[&Run]) -> Vec<Vec<String>> {
    let key = |run: &Run, name: &String| match run.parameters.iter().find(|(known, _)| known == name) {
        Some((_, value)) => value.clone(),
        None if name == "series" => Value::Text(run.series.clone()),
        None => Value::Text(DASH.into()),
    };
    let mut groups: Vec<(Vec<Value>, Vec<&Run>)> = Vec::new();
    for &run in runs {
        let keys: Vec<Value> = table.mean.iter().map(|name| key(run, name)).collect();
        match groups.iter_mut().find(|(known, _)| *known == keys) {
            Some((_, runs)) => runs.push(run),
            None => groups.push((keys, vec![run])),
        }
    }
    let line = |(keys, runs): (Vec<Value>, Vec<&Run>)| {
        let done = runs.iter().filter(|run| known.line(run).is_some()).count();
        let mean = |text: &str| {
            let other = |run| table.beside.as_deref().and_then(|series| beside(known.study, run, series));
            let values: Vec<f64> = runs.iter().map(|run| known.value(run, other(run), text)).collect();
            let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
            let of = table.fit.as_ref().map(|of| runs.iter().map(|run| known.value(run, None, of)));
            match (finite.len(), of) {
                (0, _) if done == 0 && runs.iter().any(|run| known.results.of(run).is_some()) => "failed".to_owned(),
                (0, _) if done == 0 => NOT_RUN.to_owned(),
                (0, _) => DASH.to_owned(),
                (_, None) if table.spread => mean_and_spread(&finite),
                (n, None) => short(finite.iter().sum::<f64>() / n as f64),
                (_, Some(of)) => match power_law(&of.zip(values.iter().copied()).collect::<Vec<_>>()) {
                    Some([factor, power]) => format!("{} x^{power:.2}", short(factor)),
                    None => DASH.to_owned(),
                },
            }
        };
        let cells = table.columns.iter().map(|column| mean(&column.expression));
        keys.iter().map(Value::to_string).chain([format!("{done} of {}", runs.len())]).chain(cells).collect()
    };
    groups.into_iter().map(line).collect()
}

/// Mean, and the standard deviation of the values (not of their mean), with one digit; none of a single value.
pub fn mean_and_spread(values: &[f64]) -> String {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    match values.len() {
        0 | 1 => short(mean),
        _ => format!("{} ± {}", short(mean), one_digit((squares / (n - 1.0)).sqrt())),
    }
}

/// One digit, as far as the fourth decimal.
fn one_digit(value: f64) -> String {
    match value {
        0.0 => "0".into(),
        v if v < 1e-4 => format!("{v:.0e}"),
        v => format!("{v:.*}", (-v.log10().floor()).clamp(0.0, 4.0) as usize),
    }
}

/// Factor and power of y = c x^n by least squares of the logarithms; none through fewer than three points.
fn power_law(points: &[(f64, f64)]) -> Option<[f64; 2]> {
    let positive = points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0);
    let logs: Vec<(f64, f64)> = positive.map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let sums = logs.iter().fold((0.0, 0.0), |s, p| (s.0 + (p.0 - x) * (p.1 - y), s.1 + (p.0 - x).powi(2)));
    let power = sums.0 / sums.1;
    (logs.len() >= 3 && power.is_finite()).then(|| [(y - power * x).exp(), power])
}

/// Three digits.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let power = value.abs().log10().floor();
    match power as i32 {
        ..=-4 => format!("{value:.1e}"),
        5.. => format!("{value:.2e}"),
        power => format!("{value:.*}", (2 - power).clamp(0, 4) as usize),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_found_again() {
        let points: Vec<_> = [0.5, 1.0, 2.0, 4.0].iter().map(|&x: &f64| (x, 1.6 * x.powf(0.5))).collect();
        let [factor, power] = power_law(&points).unwrap();
        assert!((factor - 1.6).abs() < 1e-12 && (power - 0.5).abs() < 1e-12, "{factor} {power}");
        assert_eq!(power_law(&points[..2]), None);
        assert_eq!(power_law(&[(1.0, f64::NAN), (2.0, 1.0), (3.0, 1.0)]), None);
    }

    #[test]
    fn the_spread_is_the_standard_deviation_of_the_runs() {
        assert_eq!(mean_and_spread(&[1.18, 1.24, 1.21]), "1.21 ± 0.03");
        assert_eq!(mean_and_spread(&[0.5]), "0.500");
        assert_eq!(mean_and_spread(&[2.0, 2.0]), "2.00 ± 0");
        assert_eq!([12.0, 0.25, 0.004, 2e-6].map(one_digit), ["12", "0.2", "0.004", "2e-6"]);
    }

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.0, "0"),
            (1.23456, "1.23"),
            (0.012345, "0.0123"),
            (625.0, "625"),
            (12345.0, "12345"),
            (1.2345e-5, "1.2e-5"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
    }
}
