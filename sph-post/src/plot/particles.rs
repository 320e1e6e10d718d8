//! Particles coloured by their speed, at several times.

use super::canvas::{self, viridis};
use super::panels::{self, Panel, Patch, Picture};
use crate::{
    analysis::Analysis,
    failure::Failure,
    geometry::Geometry,
    scatter::{Scatter, Square},
};
use plotters::style::RGBColor;
use std::path::{Path, PathBuf};

/// Shades of colour: squares of one shade become one path.
pub const SHADES: f64 = 96.0;

/// Draws `particles.svg` and `.png`.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let shown = || a.spread.iter().filter_map(|&k| Some((&a.moments[k], a.moments[k].scatter.as_ref()?)));
    let fastest = shown().flat_map(|p| &p.1.squares).map(|q| q.speed).fold(0.0, f64::max);
    let panel = |(moment, scatter)| Panel {
        moment,
        patches: by_shade(&a.geometry, scatter, |q| q.speed / fastest.max(1e-300)),
        lines: Vec::new(),
    };
    let three = a.geometry.space.dimension() == 3;
    let picture = Picture {
        name: "particles",
        what: if three { "speed in a vertical section" } else { "speed" },
        remark: String::new(),
        panels: shown().map(panel).collect(),
        legend_width: 100.0,
        without_strays: true,
    };
    panels::draw(a, folder, &picture, |area, at, lowest| {
        canvas::colour_bar(area, at[0], [at[1], lowest], [0.0, fastest.max(1e-9)], "|v| (m/s)")
    })
}

/// Squares in viridis by a part of its way, shade by shade.
pub fn by_shade(g: &Geometry, scatter: &Scatter, part: impl Fn(&Square) -> f64) -> Vec<Patch> {
    let shade = |q: &Square| (part(q) * SHADES).clamp(0.0, SHADES) as u32;
    let mut order: Vec<(u32, &Square)> = scatter.squares.iter().map(|q| (shade(q), q)).collect();
    // Stable: the drawing is the same on every run.
    order.sort_by_key(|o| o.0);
    order.into_iter().map(|(shade, q)| patch(g, scatter, q, viridis(f64::from(shade) / SHADES))).collect()
}

/// A square in a colour.
pub fn patch(g: &Geometry, scatter: &Scatter, q: &Square, colour: RGBColor) -> Patch {
    // A little more than the particle's share: no white grout between neighbours.
    Patch { at: [q.at[0], q.at[1] - g.floor], half: [0.53 * scatter.size; 2], colour }
}
