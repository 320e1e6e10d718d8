//! The final state as a few numbers and a curve, for scripts: `post/summary.json` and `post/profile_final.csv`.

use crate::analysis::Analysis;
use crate::failure::Failure;
use formats::disk;
use std::path::{Path, PathBuf};

/// Writes both files and returns their paths. Lengths in m; what the scene has no meaning for is null.
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
    serde_json::json!({
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
        "final_height_m": last.deposit.height_centre,
        "max_height_m": last.deposit.height_max,
        "volume_ratio": last.deposit.volume_ratio,
        "basal_level_m": a.level,
        "basal_force_over_weight": last.basal.ratio(),
    })
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
