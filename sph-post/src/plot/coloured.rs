//! Particles coloured by a field of one's choice.

use super::canvas;
use super::panels::{self, Panel, Picture};
use super::particles::{SHADES, patch};
use crate::{analysis::Analysis, failure::Failure, field::Field};
use std::path::{Path, PathBuf};

/// Colours span what lies between these parts of the values: single particles go further.
const SEEN: [f64; 2] = [0.01, 0.99];

/// Draws `particles-FIELD` for every field that was asked for.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut paths = Vec::new();
    for (number, field) in a.colours.iter().enumerate() {
        paths.extend(one(a, folder, number, field)?);
    }
    Ok(paths)
}

fn one(a: &Analysis, folder: &Path, number: usize, field: &Field) -> Result<Vec<PathBuf>, Failure> {
    let shown = || a.spread.iter().filter_map(|&k| Some((&a.moments[k], a.moments[k].scatter.as_ref()?)));
    let values = shown().flat_map(|s| s.1.fields[number].iter().copied());
    let [low, high] = range(values.filter(|v| v.is_finite()).collect());
    let panels = shown().map(|(moment, scatter)| {
        let shade = |v: f64| (((v - low) / (high - low)) * SHADES).clamp(0.0, SHADES) as u32;
        let found = scatter.squares.iter().zip(&scatter.fields[number]).filter(|(_, v)| v.is_finite());
        let mut order: Vec<_> = found.map(|(q, v)| (shade(*v), q)).collect();
        order.sort_by_key(|o| o.0);
        let colour = |shade: u32| canvas::viridis(f64::from(shade) / SHADES);
        let patches = order.into_iter().map(|(shade, q)| patch(&a.geometry, scatter, q, colour(shade))).collect();
        Panel { moment, patches, lines: Vec::new() }
    });
    let words = field.name.replace('_', " ");
    let where_ = if a.geometry.space.dimension() == 3 { " in a vertical section" } else { "" };
    // Large numbers are easier to read with a prefix.
    let (scale, prefix) = match (field.unit, low.abs().max(high.abs())) {
        ("Pa", most) if most >= 1e6 => (1e6, "M"),
        ("Pa", most) if most >= 1e3 => (1e3, "k"),
        _ => (1.0, ""),
    };
    let unit = if field.unit.is_empty() { String::new() } else { format!(" ({prefix}{})", field.unit) };
    let turns = ["velocity_x", "stress_xy", "stress_xz"].contains(&field.name);
    let mirrored =
        if turns && a.geometry.mirrored[0] { "; of the other sign on the left, the mirror image" } else { "" };
    let picture = Picture {
        name: &format!("particles-{}", field.name),
        what: &format!("{words}{where_}"),
        remark: format!("colours span {} to {} % of the particles{mirrored}", 100.0 * SEEN[0], 100.0 * SEEN[1]),
        panels: panels.collect(),
        legend_width: 140.0,
        without_strays: true,
    };
    panels::draw(a, folder, &picture, |area, at, lowest| {
        let name = format!("{}{unit}", field.symbol);
        canvas::colour_bar(area, at[0], [at[1], lowest], [low / scale, high / scale], &name)
    })
}

/// What the colours span; never empty.
fn range(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return [0.0, 1.0] };
    let [low, high] = SEEN.map(|part| values[(part * last as f64).round() as usize]);
    // One value only: a little around it.
    let least = 1e-6 * low.abs().max(high.abs()).max(1e-6);
    if high - low > least { [low, high] } else { [low - least, low + least] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_leave_out_what_lies_far_off() {
        let mut values: Vec<f64> = (0..=1000).map(f64::from).collect();
        values[1000] = 1e9;
        assert_eq!(range(values), [10.0, 990.0]);
        let [low, high] = range(vec![5.0; 9]);
        assert!(low < 5.0 && high > 5.0 && high - low < 1e-4);
        assert_eq!(range(Vec::new()), [0.0, 1.0]);
    }
}
