//! What a reduced model costs: the base and the options of a choice at one resolution, side by side; the last option is the full model.

use super::definition::Chart;
use super::page::short;
use crate::study::{
    definition::Run,
    numbers::{self, station},
    results::Results,
    table::{Known, mean_and_spread},
    template,
};
use std::fmt::Write as _;

/// Columns beyond name, cost and profile: title and measure.
const COLUMNS: [(&str, &str); 5] = [
    ("run-out, 99.5 % of mass", "runout_mass_99_5"),
    ("height/r0", "height"),
    ("V/V0", "volume_ratio"),
    ("basal force/weight", "basal_force_over_weight"),
    ("basal centre/largest", "basal_centre_ratio"),
];

/// The table as Markdown; means over the lattices, and their standard deviations.
pub fn table(chart: &Chart, results: &Results) -> String {
    let Some(reduction) = &chart.reduction else { return String::new() };
    let Some(choice) = chart.choices.iter().find(|choice| choice.name == reduction.choice) else {
        return String::new();
    };
    let names: Vec<Option<&str>> =
        std::iter::once(None).chain(choice.options.iter().map(|option| Some(option.name.as_str()))).collect();
    let runs_of = |name: Option<&str>| -> Vec<&Run> {
        let is = |run: &&Run| {
            let setting = run.parameters.iter().find(|(key, _)| key == "setting").map(|(_, value)| value.to_string());
            let resolution = template::number(&run.parameters, "resolution");
            setting.as_deref() == name && resolution == Some(reduction.resolution) && run.series != super::PAIRS
        };
        chart.study.runs.iter().filter(is).collect()
    };
    let known = Known { study: &chart.study, results };
    let values = |name: Option<&str>, text: &str| -> Vec<f64> {
        runs_of(name).iter().map(|run| known.value(run, None, text)).collect()
    };
    let mean = |name: Option<&str>, text: &str| {
        let values = values(name, text);
        values.iter().sum::<f64>() / values.len() as f64
    };
    let full = names.last().copied().flatten();
    let mut text = format!(
        "| model | particles | {} | profile, from that of the full model | processor time [s] | of the full one |\n|{}\n",
        COLUMNS.map(|(title, _)| title).join(" | "),
        "---|".repeat(COLUMNS.len() + 5)
    );
    for &name in &names {
        if runs_of(name).iter().any(|run| known.line(run).is_none()) {
            let _ = writeln!(text, "| {} | not run |{}", name.unwrap_or("default"), " |".repeat(COLUMNS.len() + 3));
            continue;
        }
        let columns = COLUMNS.map(|(_, measure)| mean_and_spread(&values(name, measure)));
        let of = |name: Option<&str>| -> Vec<f64> {
            (0..chart.study.numbers.stations.len()).map(|k| mean(name, &station(k))).collect()
        };
        let cost = mean(name, numbers::PROCESSOR);
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | 1/{} |",
            name.unwrap_or("default"),
            mean(name, "particles"),
            columns.join(" | "),
            or_dash(distance(&of(name), &of(full))),
            short(cost),
            or_dash(mean(full, numbers::PROCESSOR) / cost),
        );
    }
    text
}

/// Not known where the full model has not been run.
fn or_dash(value: f64) -> String {
    if value.is_finite() { short(value) } else { "–".into() }
}

/// Root of the sum of the squares of the differences over that of the second.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = |of: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(a, b)| of(*a, *b).powi(2)).sum::<f64>();
    (squares(&|a, b| a - b) / squares(&|_, b| b)).sqrt()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_distance_is_relative_to_the_full_model() {
        assert_eq!(super::distance(&[1.0, 2.0], &[1.0, 2.0]), 0.0);
        assert_eq!(super::distance(&[2.0, 0.0], &[1.0, 0.0]), 1.0);
    }
}
