//! The final state as a few numbers and a curve, for scripts: `post/summary.json` and `post/profile_final.csv`.

use crate::analysis::{Analysis, Moment};
use crate::failure::Failure;
use formats::disk;
use std::path::{Path, PathBuf};

/// Writes both files and returns their paths. Lengths in m; what has no meaning for the scene is null: run-outs where
/// [`Analysis::scaled`] gives none, r0 with several bodies.
///
/// Whether it has come to rest: `front_mass_last_T` is the change of the 99.5 % front during the last T = sqrt(H0/g), in
/// r0, null where run-outs are or the run is shorter than T; `kinetic_over_peak` is the kinetic energy at the end over its
/// peak. Both come from the history where there is one, since it is finer than the snapshots. `energy_closure` and
/// `dissipated_share` are there only where the history tells the work that was done ([`crate::partition::Partition`]),
/// and `peak_speed_m_s`, the largest speed of a particle, where it has the column `max_speed`. The last ones are those of
/// [`crate::health::Health`].
///
/// # Errors
/// Whatever can't be written.
pub fn write(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let [numbers, curve] = [folder.join("summary.json"), folder.join("profile_final.csv")];
    disk::write_atomic(&numbers, format!("{:#}\n", json(a)).as_bytes())?;
    disk::write_atomic(&curve, profile(a).as_bytes())?;
    Ok(vec![numbers, curve])
}

fn json(a: &Analysis) -> serde_json::Value {
    let last = a.last();
    let fronts = &last.deposit.fronts;
    let outward = a.geometry.runs_outward;
    let failure = a.failure.map(|k| &a.moments[k]);
    let line = failure.and_then(|m| m.failure_plane.line);
    let potential = a.start_potential();
    let [on_axis, off_axis] = last.basal.dips;
    let mut numbers = serde_json::json!({
        "title": a.scene.title,
        "scene_hash": a.hash,
        "final_time_s": last.time,
        "particles": last.particles,
        "r0_m": a.geometry.r0(),
        "final_front_m": fronts.furthest,
        "final_front_mass_99_5_m": fronts.mass,
        "final_front_thickness_m": fronts.thickness,
        "runout_furthest": a.scaled(fronts.furthest),
        "runout_mass_99_5": a.scaled(fronts.mass),
        "runout_thickness": a.scaled(fronts.thickness),
        "runout_true": a.scaled(fronts.furthest),
        "runout_effective": a.scaled(fronts.thickness),
        "stray_particles": outward.then_some(last.deposit.strays.count),
        "stray_mass_share": outward.then_some(last.deposit.strays.share),
        "final_height_m": last.deposit.height_centre,
        "max_height_m": last.deposit.height_max,
        "volume_ratio": last.deposit.volume_ratio,
        "front_mass_last_T": front_last(a),
        "kinetic_over_peak": kinetic_over_peak(a),
        "peak_speed_m_s": peak_speed(a),
        "basal_level_m": a.level,
        "basal_force_over_weight": last.basal.ratio(),
        "basal_centre_ratio": on_axis.ratio,
        "basal_max_distance_m": on_axis.radius,
        "basal_centre_ratio_off_axis": off_axis.ratio,
        "basal_max_distance_off_axis_m": off_axis.radius,
        "static_speed_m_s": a.static_speed,
        "static_share": last.flow.share,
        "failure_time_s": failure.map(|m| m.time),
        "failure_angle_deg": line.map(|l| l.angle_deg),
        "failure_scatter_m": line.map(|l| l.scatter),
        "mechanical_loss_share": mechanical_loss(a, potential),
    });
    if let Some(partition) = &a.partition {
        numbers["energy_closure"] = partition.error().into();
        numbers["dissipated_share"] = partition.dissipated(potential).into();
    }
    if let serde_json::Value::Object(numbers) = &mut numbers {
        numbers.extend(a.health.numbers().map(|(name, value)| (name.to_owned(), value.into())));
    }
    numbers
}

/// Potential energy of the start that is neither potential nor kinetic at the end, over that of the start (Szewc 2017,
/// Eq 31): dissipated, but for what is stored. NaN where it began on the floor.
fn mechanical_loss(a: &Analysis, potential: f64) -> f64 {
    let [high, fast] =
        [series(a, "potential_energy", |m| m.energy.potential), series(a, "kinetic_energy", |m| m.energy.kinetic)];
    match (high.first(), high.last(), fast.last()) {
        (Some(start), Some(end), Some(speed)) if potential > 0.0 => (start[1] - end[1] - speed[1]) / potential,
        _ => f64::NAN,
    }
}

/// A quantity over time: from a column of the history, else from the snapshots.
fn series(a: &Analysis, column: &str, of: impl Fn(&Moment) -> f64) -> Vec<[f64; 2]> {
    match a.history.as_ref().and_then(|h| Some((h.times(), h.column(column)?))) {
        Some((times, values)) => times.iter().zip(values).map(|(&t, &v)| [t, v]).collect(),
        None => a.moments.iter().map(|m| [m.time, of(m)]).collect(),
    }
}

/// NaN where it has no meaning.
fn front_last(a: &Analysis) -> f64 {
    let fronts = series(a, "front_mass_99_5", |m| m.deposit.fronts.mass);
    let (Some(period), Some(&[end, last])) = (a.geometry.time_scale(), fronts.last()) else { return f64::NAN };
    a.scaled(last) - a.scaled(at(&fronts, end - period))
}

/// Linear between the points, which ascend in time; NaN before the first.
fn at(points: &[[f64; 2]], time: f64) -> f64 {
    let after = points.partition_point(|p| p[0] < time);
    match points[after.saturating_sub(1)..] {
        [before, next, ..] if after > 0 => {
            before[1] + (next[1] - before[1]) * (time - before[0]) / (next[0] - before[0])
        }
        [first, ..] if first[0] == time => first[1],
        _ => f64::NAN,
    }
}

/// Kinetic energy at the end over its peak; NaN where nothing ever moved.
pub fn kinetic_over_peak(a: &Analysis) -> f64 {
    let energies = series(a, "kinetic_energy", |m| m.energy.kinetic);
    let peak = energies.iter().fold(0.0_f64, |peak, e| peak.max(e[1]));
    energies.last().map_or(f64::NAN, |e| e[1] / peak)
}

/// None without a history of it: snapshots are too far apart to see an impact.
fn peak_speed(a: &Analysis) -> Option<f64> {
    let speeds = a.history.as_ref()?.column("max_speed")?;
    Some(speeds.iter().fold(0.0, |peak, &v| peak.max(v)))
}

fn profile(a: &Analysis) -> String {
    let last = a.last();
    let name = a.geometry.coordinate();
    let rows = last.deposit.profile.bins(&a.geometry).map(|(at, k)| {
        let height = last.deposit.profile.height[k];
        format!("{at:e},{:e}\n", if height.is_nan() { 0.0 } else { height })
    });
    format!("{name}_m,h_m\n{}", rows.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_series_is_linear_between_its_points() {
        let points = [[1.0, 5.0], [2.0, 7.0], [4.0, 3.0]];
        assert_eq!([1.0, 1.5, 2.0, 3.0, 4.0].map(|t| at(&points, t)), [5.0, 6.0, 7.0, 5.0, 3.0]);
        assert!(at(&points, 0.9).is_nan() && at(&points, 4.1).is_nan() && at(&[], 0.0).is_nan());
    }
}
