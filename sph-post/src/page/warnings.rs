//! What a reader of the results should know first.

use super::{course::Course, html::quantity};
use crate::{analysis::Analysis, summary};
use formats::{folder::RunFolder, provenance};
use std::collections::BTreeSet;

/// Swelling that is worth a warning.
const SWOLLEN: f64 = 1.1;
/// Error of the energy balance, over the largest change of the potential energy.
const UNBALANCED: f64 = 0.02;
/// Share of the mass in stray particles.
const STRAYING: f64 = 0.02;
/// Kinetic energy over its peak, above which the run is not at rest.
const MOVING: f64 = 1e-3;
/// Force on the floor over the weight, off 1 by, once at rest.
const UNSUPPORTED: f64 = 0.1;
/// Density over that of the start.
const DENSE: f64 = 1.05;
/// Work of the busiest rank over the mean.
const UNEVEN: f64 = 1.5;

/// All of them, a sentence each.
pub fn all(a: &Analysis, run: &RunFolder, course: &Course) -> Vec<String> {
    let mut all = Vec::new();
    if run.out().join("fault.hdf").exists() {
        all.push("The computation failed: out/fault.hdf holds the particles of that moment.".to_string());
    }
    if !run.done().exists() {
        all.push("The run has not reached its end: all numbers are of the last snapshot so far.".to_string());
    }
    let last = a.last();
    let swollen = a.moments.iter().map(|m| m.deposit.volume_ratio).fold(0.0, f64::max);
    if swollen > SWOLLEN {
        all.push(format!("The material swelled: its volume reached {swollen:.2} times that of the start."));
    }
    if let Some(error) = a.partition.as_ref().map(crate::partition::Partition::error).filter(|e| e.abs() > UNBALANCED) {
        all.push(format!(
            "The energies do not add up: {:.1} % of the largest change of potential energy.",
            100.0 * error
        ));
    }
    if a.geometry.runs_outward && last.deposit.strays.share > STRAYING {
        let share = 100.0 * last.deposit.strays.share;
        all.push(format!("Stray particles hold {share:.1} % of the mass: the true front says little of the deposit."));
    }
    let moving = summary::kinetic_over_peak(a);
    if moving > MOVING {
        all.push(format!("The material still moves: the kinetic energy is {:.2} % of its peak.", 100.0 * moving));
    } else if (last.basal.ratio() - 1.0).abs() > UNSUPPORTED {
        let ratio = last.basal.ratio();
        all.push(format!(
            "At rest the floor should carry the weight; the stresses near it carry {ratio:.2} times that."
        ));
    }
    let column = |name: &str| a.history.as_ref().and_then(|h| h.column(name));
    if let Some(most) = column("below_floor").map(|c| c.iter().copied().fold(0.0, f64::max)).filter(|n| *n > 0.0) {
        all.push(format!("Up to {most} particles were below the floor at a time."));
    }
    let densest = column("max_density").map_or(0.0, |c| c.iter().copied().fold(0.0, f64::max));
    if densest > DENSE * a.geometry.density {
        all.push(format!("The density rose to {}: the material is too soft.", quantity(densest, "kg/m3")));
    }
    if let Some(worst) = course.imbalance().filter(|i| *i > UNEVEN) {
        all.push(format!("The busiest rank had {worst:.2} times the mean work."));
    }
    let entries = provenance::read(&run.provenance()).unwrap_or_default();
    let builds: BTreeSet<(String, String)> = entries.into_iter().map(|e| (e.build.version, e.build.commit)).collect();
    if builds.len() > 1 {
        all.push("Programs of different commits made this run: see the provenance.".to_string());
    }
    all
}
