//! `runs/charts/NAME/chart.nc`: the points as a file for other programs.

use super::{
    definition::Chart,
    front::Rank,
    points::{Point, Points},
};
use crate::{failure::Failure, paths};
use formats::results::{Dataset, Role, Variable};
use std::path::PathBuf;

const OVER: &str = "setting";

/// Writes the file; none where no setting is done.
pub fn write(chart: &Chart, points: &Points) -> Result<Option<PathBuf>, Failure> {
    if points.done.is_empty() {
        return Ok(None);
    }
    let path = paths::chart_runs(&chart.study.name).join("chart.nc");
    let fault = |e: String| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display()));
    std::fs::create_dir_all(paths::chart_runs(&chart.study.name)).map_err(|e| fault(e.to_string()))?;
    dataset(chart, points).write(&path).map_err(|e| fault(e.to_string()))?;
    Ok(Some(path))
}

/// The points as a dataset.
pub fn dataset(chart: &Chart, points: &Points) -> Dataset {
    let mut data = Dataset { time_chunk: 1, ..Dataset::default() };
    data.attribute("title", chart.study.title.as_str());
    data.attribute("source", format!("Talus, ./talus {}", chart.study.words));
    data.attribute("comment", format!("error: {}; processor: {}", chart.error.words, super::machine(chart)));
    if let Some(reference) = chart.error.reference {
        data.attribute("reference_uncertainty", reference);
    }
    data.dimension(OVER, points.done.len());
    let of = |value: &dyn Fn(&Point) -> f64| points.done.iter().map(value).collect::<Vec<f64>>();
    let number = (0..points.done.len()).map(|k| k as f64).collect();
    // Flat files hold numbers only: names go into an attribute, in the order of the points.
    let names: Vec<String> = points.done.iter().map(|p| p.label().replace(", ", "@").replace(' ', "_")).collect();
    data.variable(
        Variable::new(OVER, Role::Coordinate, &[OVER], "number of the setting, by cost", "1", number)
            .with("names", names.join(" ")),
    );
    let mut put = |name: &str, long: &str, unit: &str, values: Vec<f64>| {
        data.variable(Variable::new(name, Role::Data, &[OVER], long, unit, values));
    };
    put("error", chart.error.title.trim_end_matches(" [1]"), "1", of(&|p| p.error[0]));
    put("error_std", "standard deviation of the error over the lattices", "1", of(&|p| p.error[1]));
    put("cost_seconds", "processor time of the solver, mean over the lattices", "s", of(&|p| p.cost[0]));
    put("cost_seconds_std", "standard deviation of the processor time, 10 % at least", "s", of(&|p| p.cost[1]));
    put("particle_steps", "particles times steps, mean over the lattices", "1", of(&|p| p.particle_steps));
    put("particles", "material particles", "1", of(&|p| p.particles as f64));
    put("resolution", "particles over the length of the case", "1", of(&|p| p.resolution));
    put("lattices", "disturbed lattices in the means", "1", of(&|p| p.count as f64));
    let own = |is: Rank| of(&|p| flag(p.rank == Some(is)));
    let all = |is: Rank| of(&|p| flag(p.of_all == is));
    let front = "1 on the Pareto front of error and cost among the settings of the scene's own material, else 0";
    put("on_front", front, "1", own(Rank::Front));
    put("near_front", "1 within the scatter of that front, else 0", "1", own(Rank::Near));
    put("on_front_of_all", "1 on the Pareto front of error and cost among all settings, else 0", "1", all(Rank::Front));
    put("near_front_of_all", "1 within the scatter of the front of all settings, else 0", "1", all(Rank::Near));
    put("other_material", "1 of another material than the scene, else 0", "1", of(&|p| flag(p.is_other())));
    put("default_setting", "1 where nothing is changed, else 0", "1", of(&|p| flag(p.is_base())));
    data
}

fn flag(is: bool) -> f64 {
    f64::from(u8::from(is))
}
