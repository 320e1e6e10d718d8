//! Vertical stress on the section (Yang et al. 2020, Fig 19).

use super::canvas::{self, viridis};
use super::panels::{self, Panel, Patch, Picture};
use crate::{analysis::Analysis, failure::Failure, section::Section};
use std::path::{Path, PathBuf};

/// Shades of colour.
const SHADES: f64 = 96.0;

/// Most cells in one panel; finer sections are shown coarser.
const MOST: usize = 6000;

/// The scale ends at the pressure that this part of the cells lies below: single particles go higher.
const SEEN: f64 = 0.99;

/// Draws `stress-sections.svg` and `.png`; nothing without gravity.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let (g, weight) = (&a.geometry, -a.geometry.gravity[2] * a.geometry.density);
    if weight <= 0.0 {
        return Ok(Vec::new());
    }
    let sections = || a.sections.iter().filter_map(|&k| Some((&a.moments[k], a.moments[k].section.as_ref()?)));
    let mut all: Vec<f64> =
        sections().flat_map(|s| &s.1.stress_zz).map(|s| -s / weight).filter(|p| p.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let highest = all.get((SEEN * all.len() as f64) as usize).copied().unwrap_or(0.0).max(1e-6);
    let panel = |(moment, section)| Panel {
        moment,
        patches: cells(a, section, &section.stress_zz, |s| -s / (weight * highest)),
        lines: Vec::new(),
    };
    let picture = Picture {
        name: "stress-sections",
        what: match (g.space.dimension(), g.radial) {
            (3, true) => "vertical stress, mean over the angle",
            _ => "vertical stress",
        },
        remark: format!("colours end where {} % of the cells lie below", 100.0 * SEEN),
        panels: sections().map(panel).collect(),
        legend_width: 150.0,
        without_strays: true,
    };
    panels::draw(a, folder, &picture, |area, at, lowest| {
        canvas::colour_bar(area, at[0], [at[1], lowest], [0.0, highest], "\u{2212}\u{03c3}zz/(\u{03c1}\u{2080}g) (m)")
    })
}

/// The section's cells with means of `values`, shade by shade; `part` says how far on viridis a value lies.
pub fn cells(a: &Analysis, section: &Section, values: &[f64], part: impl Fn(f64) -> f64) -> Vec<Patch> {
    let g = &a.geometry;
    let mut step = 1;
    while section.bins.div_ceil(step) * section.rows.div_ceil(step) > MOST {
        step += 1;
    }
    let mut cells = Vec::new();
    for j in (0..section.rows).step_by(step) {
        for k in (0..section.bins).step_by(step) {
            let block = (j..(j + step).min(section.rows))
                .flat_map(|j| (k..(k + step).min(section.bins)).map(move |k| values[j * section.bins + k]));
            let (sum, count) = block.filter(|s| s.is_finite()).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
            if count > 0.0 {
                let shade = (part(sum / count) * SHADES).clamp(0.0, SHADES) as u32;
                let half = 0.5 * step as f64 * g.dx;
                let at = [section.along(g, k) - 0.5 * g.dx + half, j as f64 * g.dx + half];
                cells.push((shade, Patch { at, half: [half * 1.15; 2], colour: viridis(f64::from(shade) / SHADES) }));
            }
        }
    }
    cells.sort_by_key(|c| c.0);
    cells.into_iter().map(|c| c.1).collect()
}
