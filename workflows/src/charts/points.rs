//! The points of a chart: a setting each, with the mean over its lattices.

use super::{
    definition::{BASE, Chart, PAIRS},
    front::{self, Place, Rank},
};
use crate::study::{
    definition::Run,
    numbers,
    results::{self, Line, Results},
    table::Known,
    template::{self, Value},
};

/// Least relative standard deviation of a processor time. On a machine that others work on as well, settings whose steps do the same work
/// (the cones of bars-bui) differ by up to 10 % per particle-step.
const COST_SCATTER: f64 = 0.1;
/// So many lattices tell their own scatter.
const ENOUGH: usize = 3;

/// A setting, all of whose runs are done.
#[derive(Clone, Debug)]
pub struct Point {
    /// `base` or the options: `wendland and mirror`.
    pub setting: String,
    /// The choice, `base` or `pairs`.
    pub series: String,
    /// Particles over the length the case is measured by.
    pub resolution: f64,
    /// Lattices.
    pub count: usize,
    /// Processor time, s, of the mean lattice on a machine that does nothing else, and its standard deviation.
    pub cost: [f64; 2],
    /// Mean error, and its standard deviation.
    pub error: [f64; 2],
    /// Means of what the chart's table has also.
    pub also: Vec<f64>,
    /// Mean.
    pub particle_steps: f64,
    /// Particles.
    pub particles: u64,
    /// Among the settings of the scene's own material; none for one of another material.
    pub rank: Option<Rank>,
    /// Among all settings.
    pub of_all: Rank,
    /// On the front, and better than a cheaper point of it by no more than the scatter? On that of all for another material.
    pub level: bool,
    /// Has the scene of a run changed since?
    pub stale: bool,
}

/// What became of a chart's settings.
#[derive(Clone, Debug, Default)]
pub struct Points {
    /// By cost.
    pub done: Vec<Point>,
    /// Settings of which a run ended with an error or without a finite error measure: `name (runs that did)`.
    pub failed: Vec<String>,
    /// Settings of which runs are missing.
    pub missing: usize,
}

impl Point {
    /// `default, 12`.
    pub fn label(&self) -> String {
        let setting = if self.is_base() { "default" } else { &self.setting };
        format!("{setting}, {}", self.resolution)
    }

    /// Is nothing in it changed?
    pub fn is_base(&self) -> bool {
        self.series == BASE
    }

    /// Is it a combination?
    pub fn is_pair(&self) -> bool {
        self.series == PAIRS
    }

    /// Is it of another material than the scene?
    pub fn is_other(&self) -> bool {
        self.rank.is_none()
    }

    /// On the front of the scene's own material?
    pub fn is_front(&self) -> bool {
        self.rank == Some(Rank::Front)
    }

    /// Of another material, and on the front of all settings?
    pub fn is_other_front(&self) -> bool {
        self.is_other() && self.of_all == Rank::Front
    }

    /// Does it count for nothing: dominated among its own, or of another material and dominated among all?
    pub fn is_behind(&self) -> bool {
        self.rank.unwrap_or(self.of_all) == Rank::Behind
    }

    /// For tables.
    pub fn word(&self) -> String {
        let rank = |rank: Rank| if self.level { "front, ~ a cheaper one" } else { rank.word() };
        match self.rank {
            Some(own) => rank(own).to_owned(),
            None => format!("other material; of all: {}", rank(self.of_all)),
        }
    }

    fn place(&self) -> Place {
        Place { cost: self.cost, error: self.error }
    }
}

/// The points, with their ranks.
pub fn of(chart: &Chart, results: &Results) -> Points {
    let mut points = Points::default();
    for runs in chart.study.runs.chunk_by(|a, b| setting(a) == setting(b)) {
        let lines: Vec<(&Run, &Line)> = runs.iter().filter_map(|run| Some((run, results.of(run)?))).collect();
        let (name, resolution) = setting(&runs[0]);
        if lines.len() < runs.len() {
            points.missing += 1;
            continue;
        }
        let known = Known { study: &chart.study, results };
        let of = |name: &str| -> Vec<f64> { lines.iter().map(|(run, _)| known.value(run, None, name)).collect() };
        let (errors, costs) = (of(&chart.error.expression), of(numbers::PROCESSOR));
        let sound = |k: &usize| errors[*k].is_finite() && costs[*k].is_finite();
        let bad = (0..lines.len()).filter(|k| !sound(k)).count();
        if bad > 0 {
            points.failed.push(format!("{name}, {resolution} ({bad} of {})", lines.len()));
            continue;
        }
        let steps = of(numbers::PARTICLE_STEPS);
        let cost = quiet_cost(&costs, &steps);
        let is_other = chart.is_other_material(&name);
        points.done.push(Point {
            setting: name,
            series: runs[0].series.clone(),
            resolution,
            count: lines.len(),
            cost: [cost[0], cost[1].max(COST_SCATTER * cost[0])],
            error: mean_and_deviation(&errors),
            also: chart.also.iter().map(|column| mean_and_deviation(&of(&column.expression))[0]).collect(),
            particle_steps: mean_and_deviation(&steps)[0],
            particles: lines.iter().filter_map(|(_, line)| line.particles).max().unwrap_or(0),
            rank: (!is_other).then_some(Rank::Behind),
            of_all: Rank::Behind,
            level: false,
            stale: lines.iter().any(|(run, line)| line.scene != results::hash(run)),
        });
    }
    few_lattices(&mut points.done);
    points.done.sort_by(|a, b| a.cost[0].total_cmp(&b.cost[0]).then_with(|| a.label().cmp(&b.label())));
    rank(&mut points.done);
    points
}

/// Ranks among these points alone: among all of them, and among those of the scene's own material.
pub fn rank(points: &mut [Point]) {
    let found = |points: &[&mut Point]| {
        let places: Vec<Place> = points.iter().map(|point| point.place()).collect();
        let ranks = front::ranks(&places);
        let levels = front::levels(&places, &ranks);
        ranks.into_iter().zip(levels)
    };
    let mut all: Vec<&mut Point> = points.iter_mut().collect();
    let ranks = found(&all);
    for (point, (rank, level)) in all.iter_mut().zip(ranks) {
        (point.of_all, point.level) = (rank, level);
    }
    all.retain(|point| !point.is_other());
    let ranks = found(&all);
    for (point, (rank, level)) in all.iter_mut().zip(ranks) {
        (point.rank, point.level) = (Some(rank), level);
    }
}

/// Two or fewer lattices may agree by chance: their scatter is at least the median of what all settings show, relative to the error.
fn few_lattices(points: &mut [Point]) {
    let mut known: Vec<f64> = points.iter().filter(|p| p.count > 1).map(|p| p.error[1] / p.error[0]).collect();
    known.retain(|scatter| scatter.is_finite());
    known.sort_by(f64::total_cmp);
    let median = known.get(known.len() / 2).copied().unwrap_or(0.0);
    for point in points.iter_mut().filter(|point| point.count < ENOUGH) {
        point.error[1] = point.error[1].max(median * point.error[0]);
    }
}

/// What runs of the same point share.
fn setting(run: &Run) -> (String, f64) {
    let text = run.parameters.iter().find_map(|(_, value)| match value {
        Value::Text(text) => Some(text.replace("-and-", " and ")),
        Value::Number(_) => None,
    });
    (text.unwrap_or_else(|| BASE.into()), template::number(&run.parameters, "resolution").unwrap_or(f64::NAN))
}

/// What else a machine does only adds to the time of a particle-step, so the least one of the lattices counts for all of them.
fn quiet_cost(costs: &[f64], steps: &[f64]) -> [f64; 2] {
    let least = costs.iter().zip(steps).map(|(cost, steps)| cost / steps).fold(f64::INFINITY, f64::min);
    mean_and_deviation(steps).map(|steps| steps * least)
}

fn mean_and_deviation(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    [mean, (squares / (n - 1.0).max(1.0)).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(count: usize, error: [f64; 2]) -> Point {
        Point {
            setting: BASE.into(),
            series: BASE.into(),
            resolution: 10.0,
            count,
            cost: [1.0, 0.05],
            error,
            also: Vec::new(),
            particle_steps: 1e6,
            particles: 100,
            rank: Some(Rank::Behind),
            of_all: Rank::Behind,
            level: false,
            stale: false,
        }
    }

    #[test]
    fn two_lattices_that_agree_are_not_trusted() {
        let mut points = [point(3, [1.0, 0.2]), point(3, [1.0, 0.02]), point(2, [2.0, 0.0]), point(1, [4.0, 0.0])];
        few_lattices(&mut points);
        // The median of 0.2, 0.02 and 0 is 0.02.
        assert_eq!(points.map(|p| p.error[1]), [0.2, 0.02, 0.04, 0.08]);
        assert_eq!(mean_and_deviation(&[1.0, 3.0]), [2.0, 2.0_f64.sqrt()]);
        assert_eq!(mean_and_deviation(&[1.0]), [1.0, 0.0]);
    }

    #[test]
    fn the_time_of_a_busy_machine_does_not_count() {
        // The second lattice took as many steps, and twice the time.
        assert_eq!(quiet_cost(&[1.0, 2.0], &[10.0, 10.0]), [1.0, 0.0]);
        assert_eq!(quiet_cost(&[1.0, 4.0], &[10.0, 20.0]), [1.5, 5.0 * 2.0_f64.sqrt() / 10.0]);
    }
}
