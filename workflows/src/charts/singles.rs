//! Each setting alone against the default at the same resolution, over all charts of a group: what is the same in several charts is more
//! than chance.

use super::{
    definition::{self, Chart},
    page::short,
    points::{self, Point, Points},
};
use crate::{failure::Failure, study::results::Results};
use std::fmt::Write as _;

/// A setting over the charts that have it.
#[derive(Debug, PartialEq)]
pub struct Row {
    /// Of the option.
    pub setting: String,
    /// Geometric mean of the ratios of the errors to those of the default.
    pub error: f64,
    /// The same of the processor times.
    pub cost: f64,
    /// Points that are more accurate by more than one combined standard deviation.
    pub better: usize,
    /// Points that are less accurate by more than that.
    pub worse: usize,
    /// All of them: a chart and a resolution each.
    pub of: usize,
    /// Settings at a resolution of which a run broke down.
    pub broken: usize,
}

/// The table of a group as Markdown, from the kept results.
pub fn table(group: &str) -> Result<String, Failure> {
    let mut charts = Vec::new();
    for name in definition::shelf().names()? {
        let chart = Chart::named(&name)?;
        if chart.group.as_deref() == Some(group) {
            let points = points::of(&chart, &Results::read(&chart.study)?);
            charts.push((chart, points));
        }
    }
    let names: Vec<&str> = charts.iter().map(|(chart, _)| chart.study.name.as_str()).collect();
    let mut text = format!("Of {}.\n\n", names.join(", "));
    text += "| setting | error | time | better | worse | of | broke down |\n|---|---|---|---|---|---|---|\n";
    for row in rows(&charts) {
        let Row { setting, error, cost, better, worse, of, broken } = row;
        let broken = if broken == 0 { String::new() } else { broken.to_string() };
        let (error, cost) = if of == 0 { ("–".into(), "–".into()) } else { (short(error), short(cost)) };
        let _ = writeln!(text, "| {setting} | {error} | {cost} | {better} | {worse} | {of} | {broken} |");
    }
    Ok(text)
}

/// In the order in which the charts name the options; those of another material are left out.
pub fn rows(charts: &[(Chart, Points)]) -> Vec<Row> {
    let mut names: Vec<&str> = Vec::new();
    for (chart, _) in charts {
        for option in chart.choices.iter().filter(|choice| !choice.material).flat_map(|choice| &choice.options) {
            if !names.contains(&option.name.as_str()) {
                names.push(&option.name);
            }
        }
    }
    names.iter().map(|name| row(name, charts)).collect()
}

fn row(name: &str, charts: &[(Chart, Points)]) -> Row {
    let mut row = Row { setting: name.into(), error: 0.0, cost: 0.0, better: 0, worse: 0, of: 0, broken: 0 };
    for (_, points) in charts {
        let base = |point: &Point| points.done.iter().find(|p| p.is_base() && p.resolution == point.resolution);
        for (point, base) in points.done.iter().filter(|p| p.setting == name).filter_map(|p| Some((p, base(p)?))) {
            row.error += (point.error[0] / base.error[0]).ln();
            row.cost += (point.cost[0] / base.cost[0]).ln();
            let beyond = (point.error[0] - base.error[0]) / point.error[1].hypot(base.error[1]);
            row.better += usize::from(beyond < -1.0);
            row.worse += usize::from(beyond > 1.0);
            row.of += 1;
        }
        row.broken += points.failed.iter().filter(|failed| failed.starts_with(&format!("{name}, "))).count();
    }
    (row.error, row.cost) = ((row.error / row.of as f64).exp(), (row.cost / row.of as f64).exp());
    row
}
