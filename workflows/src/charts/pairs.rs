//! Which options are taken two at a time: chosen once from the results of the single ones, and kept in `pairs.csv`, so that a call
//! that goes on has the same ones whatever the processor times of the rest turn out to be.

use super::{
    definition::{BASE, Chart},
    front::Rank,
    points::{self, Point},
};
use crate::{failure::Failure, paths, study::results::Results};
use formats::disk;
use std::path::PathBuf;

const HEAD: &str = "first,second";
/// So many options are combined, where there are so many.
const LEAST: usize = 4;
/// So many pairs of the scene's own material are also run at the lower resolution.
const BEST: usize = 2;

/// The file of a chart.
pub fn path(chart: &Chart) -> PathBuf {
    chart.study.folder.join("pairs.csv")
}

/// Adds the runs of the pairs that were chosen earlier. Those whose options are no longer there, or no longer go together, are passed over.
pub fn add_kept(chart: &mut Chart) -> Result<bool, Failure> {
    let path = path(chart);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(false),
        Err(e) => return Err(Failure::no_input(format!("{}: {e}", paths::short(&path).display()))),
    };
    let mut best = 0;
    for (first, second) in text.lines().skip(1).filter_map(|line| line.split_once(',')) {
        let is_own = ![first, second].iter().any(|option| chart.is_other_material(option));
        let lower = chart.pairs.lower.filter(|_| is_own && best < BEST);
        let resolutions: Vec<f64> = lower.into_iter().chain([chart.pairs.resolution]).collect();
        if let Ok(runs) = chart.pair(first, second, &resolutions) {
            chart.study.runs.extend(runs);
            best += usize::from(is_own);
        }
    }
    Ok(true)
}

/// Chooses, keeps the choice, and adds the runs; nothing while single runs are missing. Those of the scene's own material come first, as if
/// there were no others, and then those of all settings that are not among them.
pub fn choose(chart: &mut Chart, results: &Results) -> Result<bool, Failure> {
    let points = points::of(chart, results);
    if points.missing > 0 {
        return Ok(false);
    }
    let own: Vec<Point> = points.done.iter().filter(|point| !point.is_other()).cloned().collect();
    let mut pairs = promising(chart, &own);
    let others = promising(chart, &points.done).into_iter().filter(|pair| !pairs.contains(pair)).collect::<Vec<_>>();
    pairs.extend(others);
    let text = pairs.iter().fold(HEAD.to_owned(), |text, [first, second]| format!("{text}\n{first},{second}")) + "\n";
    let path = path(chart);
    disk::write_atomic(&path, text.as_bytes())
        .map_err(|e| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display())))?;
    add_kept(chart)
}

/// Pairs of [`candidates`], in the order of what they promise: error and cost, each over that of the base, multiplied, as if what two
/// options do did not depend on each other. Not more than the chart wants; none of options that exclude each other or make no
/// valid scene.
pub fn promising(chart: &Chart, points: &[Point]) -> Vec<[String; 2]> {
    let at = |point: &&Point| point.resolution == chart.pairs.resolution && !point.is_pair();
    let single: Vec<Point> = points.iter().filter(at).cloned().collect();
    let Some(base) = single.iter().find(|point| point.setting == BASE).cloned() else { return Vec::new() };
    let gain = |point: &Point| (point.error[0] / base.error[0]).ln() + (point.cost[0] / base.cost[0]).ln();
    let options = candidates(chart, single);
    let mut pairs: Vec<(f64, [String; 2])> = Vec::new();
    for (k, first) in options.iter().enumerate() {
        for second in &options[k + 1..] {
            pairs.push((gain(first) + gain(second), [first.setting.clone(), second.setting.clone()]));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    let fits = |pair: &[String; 2]| chart.pair(&pair[0], &pair[1], &[chart.pairs.resolution]).is_ok();
    pairs.into_iter().map(|(_, pair)| pair).filter(fits).take(chart.pairs.most).collect()
}

/// Options that lie on or next to the front of the single ones at the resolution of the pairs, the base among them. Where they are fewer
/// than four, also those of the front that is left without them, and so on. By name.
fn candidates(chart: &Chart, mut single: Vec<Point>) -> Vec<Point> {
    let is_alone = |point: &Point| chart.option(&point.setting).is_none_or(|(_, option)| option.alone);
    let mut found: Vec<Point> = Vec::new();
    while found.len() < LEAST && !single.is_empty() {
        points::rank(&mut single);
        let (behind, ahead): (Vec<Point>, Vec<Point>) = single.into_iter().partition(|p| p.of_all == Rank::Behind);
        found.extend(ahead.into_iter().filter(|point| !is_alone(point)));
        single = behind;
    }
    found.sort_by(|a, b| a.setting.cmp(&b.setting));
    found
}
