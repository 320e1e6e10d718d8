//! docs/charts/README.md: text by hand, with a part for every chart between `<!-- begin NAME -->` and `<!-- end NAME -->`.

use super::{
    definition::Chart,
    front::Rank,
    netcdf, picture,
    points::{Point, Points},
    reduction, singles,
};
use crate::{
    failure::Failure,
    paths,
    study::{
        page::replaced,
        results::{self, Results},
        table,
    },
};
use formats::disk;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Makes picture, file and part of the page anew; returns what was written.
pub fn refresh(chart: &Chart, results: &Results, points: &Points) -> Result<Vec<PathBuf>, Failure> {
    let page = paths::charts_page();
    let fault = |e: String| Failure::no_input(format!("{}: {e}", paths::short(&page).display()));
    let mut written = vec![results::path(&chart.study)];
    written.retain(|path| path.is_file());
    if !points.done.is_empty() {
        let path = page.with_file_name(format!("{}.png", chart.study.name));
        let cannot = |e: String| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display()));
        let png = picture::png(chart, points).map_err(cannot)?;
        disk::write_atomic(&path, &png).map_err(|e| cannot(e.to_string()))?;
        written.push(path);
    }
    written.extend(netcdf::write(chart, points)?);
    let text = std::fs::read_to_string(&page).map_err(|e| fault(e.to_string()))?;
    let mut text = replaced(&text, &chart.study.name, &part(chart, results, points)).map_err(fault)?;
    if chart.reduction.is_some() {
        let name = format!("{}/reduction", chart.study.name);
        text = replaced(&text, &name, &reduction::table(chart, results)).map_err(fault)?;
    }
    if let Some(group) = &chart.group {
        text = replaced(&text, group, &singles::table(group)?).map_err(fault)?;
    }
    disk::write_atomic(&page, text.as_bytes())
        .map_err(|e| Failure::cannot_write(format!("{}: {e}", paths::short(&page).display())))?;
    written.push(page);
    Ok(written)
}

/// The part of a chart.
pub fn part(chart: &Chart, results: &Results, points: &Points) -> String {
    let mut text = format!("Error: {}.", chart.error.words);
    if let Some(reference) = chart.error.reference {
        let _ = write!(
            text,
            " The reference itself is not known better than {}: {}.",
            short(reference),
            chart.error.reference_words
        );
    }
    if points.done.is_empty() {
        return text + "\n\n*Not run.*\n";
    }
    let _ = write!(text, "\n\n![{}]({}.png)\n\n", chart.study.title, chart.study.name);
    text += &verdict(chart, points);
    let runs: Vec<_> = chart.study.runs.iter().collect();
    let machine = super::machine(chart);
    let _ = writeln!(text, "\n{} settings. {} On {machine}.\n", points.done.len(), table::provenance(results, &runs));
    if !points.failed.is_empty() {
        let _ = writeln!(text, "Runs that ended with a numerical failure: {}.\n", points.failed.join("; "));
    }
    text + "<details><summary>All settings</summary>\n\n" + &all(chart, points) + "\n</details>\n"
}

fn all(chart: &Chart, points: &Points) -> String {
    let also: String = chart.also.iter().map(|column| format!(" {} |", column.title)).collect();
    let mut text = format!(
        "| setting | choice | resolution | particles | lattices | error |{also} processor time [s] | particle-steps [10⁶] | |\n|{}\n",
        "---|".repeat(9 + chart.also.len())
    );
    for p in &points.done {
        let name = if p.is_base() { "**default**".to_owned() } else { p.setting.clone() };
        let mark = if p.stale { " †" } else { "" };
        let also: String = p.also.iter().map(|value| format!(" {} |", short(*value))).collect();
        let _ = writeln!(
            text,
            "| {name}{mark} | {} | {} | {} | {} | {} ± {} |{also} {} | {} | {} |",
            p.series,
            p.resolution,
            p.particles,
            p.count,
            short(p.error[0]),
            short(p.error[1]),
            short(p.cost[0]),
            short(1e-6 * p.particle_steps),
            p.word(),
        );
    }
    text
}

/// Where the default lies among the settings of its own material, at each resolution: which point of the front is better, and by how much.
/// Then what other materials have on the front of all settings.
fn verdict(chart: &Chart, points: &Points) -> String {
    let list = |rank: Rank| {
        let of = points.done.iter().filter(|p| p.is_base() && p.rank == Some(rank)).map(|p| p.resolution.to_string());
        of.collect::<Vec<_>>()
    };
    let mut text = String::new();
    for (rank, words) in [(Rank::Front, "on the front"), (Rank::Near, "next to the front")] {
        let found = list(rank);
        if !found.is_empty() {
            let _ = writeln!(text, "- The default is {words} with resolution {}.", found.join(", "));
        }
    }
    let behind = points.done.iter().filter(|p| p.is_base() && p.is_behind());
    let mut groups: Vec<(&Point, Vec<&Point>)> = Vec::new();
    for base in behind {
        let Some(better) = best_instead(points, base) else { continue };
        match groups.iter_mut().find(|(known, _)| std::ptr::eq(*known, better)) {
            Some((_, group)) => group.push(base),
            None => groups.push((better, vec![base])),
        }
    }
    for (better, group) in groups {
        let of = |p: &Point| format!("{} ± {} in {} s", short(p.error[0]), short(p.error[1]), short(p.cost[0]));
        let is_judged = |p: &Point| chart.error.reference.is_none_or(|reference| p.error[0] > reference);
        let mark = |p: &Point| if is_judged(p) { "" } else { " (below what the reference can judge)" };
        let each = group.iter().map(|p| format!("with resolution {} {}{}", p.resolution, of(p), mark(p)));
        let each = each.collect::<Vec<_>>().join(", ");
        let _ = writeln!(text, "- *{}* (an error of {}) dominates the default: {each}.", better.label(), of(better));
    }
    let others: Vec<String> = points.done.iter().filter(|p| p.is_other_front()).map(Point::label).collect();
    if !others.is_empty() {
        let _ = writeln!(text, "- On the front of all settings are also of other materials: {}.", others.join("; "));
    }
    text
}

/// Of the points on the front of the own material that are not worse in both, the one of the least product of error and cost.
fn best_instead<'a>(points: &'a Points, base: &Point) -> Option<&'a Point> {
    let better = |p: &&Point| p.is_front() && p.cost[0] <= base.cost[0] && p.error[0] <= base.error[0];
    let product = |p: &Point| p.cost[0] * p.error[0];
    points.done.iter().filter(better).min_by(|a, b| product(a).total_cmp(&product(b)))
}

/// Three digits.
pub fn short(value: f64) -> String {
    table::short(value)
}
