//! Particles coloured by the layer they began in (Yang et al. 2020, Figs 13, 14, 15 and 18).

use super::canvas::{self, viridis};
use super::panels::{self, Panel, Picture};
use super::particles::patch;
use crate::{analysis::Analysis, failure::Failure, layers::Layers, scatter::Scatter};
use plotters::style::{
    RGBColor,
    text_anchor::{HPos, VPos},
};
use std::path::{Path, PathBuf};

/// Most layers that a legend lists all of.
const LISTED: usize = 12;

/// Draws `layers-horizontal` and `layers-vertical`, each as `.svg` and `.png`; nothing where the start is not known.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let Some(layers) = &a.layers else { return Ok(Vec::new()) };
    let mut paths = horizontal(a, layers, folder)?;
    paths.extend(vertical(a, layers, folder)?);
    Ok(paths)
}

fn horizontal(a: &Analysis, layers: &Layers, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    picture(a, layers, folder, "layers-horizontal", "horizontal layers of the start", 0)
}

fn vertical(a: &Analysis, layers: &Layers, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let what = if a.geometry.radial { "concentric layers of the start" } else { "vertical layers of the start" };
    picture(a, layers, folder, "layers-vertical", what, 1)
}

fn picture(
    a: &Analysis,
    layers: &Layers,
    folder: &Path,
    name: &str,
    what: &str,
    which: usize,
) -> Result<Vec<PathBuf>, Failure> {
    let g = &a.geometry;
    let panel = |k: &usize| {
        let moment = &a.moments[*k];
        let scatter: &Scatter = moment.scatter.as_ref().filter(|s| s.squares.iter().all(|q| q.layers.is_some()))?;
        let mut marked: Vec<_> = scatter.squares.iter().filter_map(|q| Some((q.layers?[which], q))).collect();
        marked.sort_by_key(|m| m.0);
        let patches = marked.into_iter().map(|(n, q)| patch(g, scatter, q, colour(layers.count, n.into()))).collect();
        Some(Panel { moment, patches, lines: Vec::new() })
    };
    let picture = Picture {
        name,
        what,
        remark: String::new(),
        panels: a.sections.iter().filter_map(panel).collect(),
        legend_width: 170.0,
        without_strays: true,
    };
    let (ends, name) = if which == 0 { (layers.heights, "z") } else { (layers.distances, g.coordinate()) };
    panels::draw(a, folder, &picture, |area, at, lowest| {
        let title = format!("{} at the start (m)", name);
        if layers.count > LISTED {
            return canvas::colour_bar(area, at[0], [at[1], lowest], ends, &title);
        }
        let edge = |n: usize| ends[0] + (ends[1] - ends[0]) * n as f64 / layers.count as f64;
        let show = |v: f64| canvas::number((v * 1e5).round() / 1e5);
        // The uppermost, or outermost, first: as the layers lie.
        let entries: Vec<_> = (0..layers.count)
            .rev()
            .map(|n| (colour(layers.count, n), format!("{} to {}", show(edge(n)), show(edge(n + 1)))))
            .collect();
        let small = canvas::style(canvas::SMALL, HPos::Left, VPos::Bottom);
        canvas::write(area, &title, at[0], at[1] - 8.0, small)?;
        canvas::swatches(area, at[0], at[1] + 8.0, &entries)
    })
}

/// Layers from dark to light, the lowest and innermost dark.
fn colour(count: usize, n: usize) -> RGBColor {
    viridis(if count > 1 { n as f64 / (count - 1) as f64 } else { 0.5 })
}
