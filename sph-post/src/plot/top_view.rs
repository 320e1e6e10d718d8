//! Height of the surface seen from above, in three dimensions.

use super::canvas::{self, Frame, MARGIN, SMALL, viridis};
use super::{Lengths, Times, outline, title};
use crate::{
    analysis::{Analysis, spread},
    deposit::Map,
    failure::Failure,
};
use plotters::{
    element::Rectangle,
    style::{
        Color,
        text_anchor::{HPos, VPos},
    },
};
use std::path::{Path, PathBuf};

/// Panels in the picture.
const PANELS: usize = 4;

/// Largest width and height of a panel inside its axes, pixels.
const MOST: [f64; 2] = [360.0, 360.0];

/// Most cells along a side; finer maps are shown coarser.
const CELLS: usize = 160;

/// Shades of colour.
const SHADES: f64 = 96.0;

/// Draws `top-view.svg` and `.png`; nothing in the plane spaces.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let (g, lengths, times) = (&a.geometry, Lengths::of(a), Times::of(a));
    let all: Vec<(f64, &Map)> = a.moments.iter().filter_map(|m| Some((m.time, m.deposit.map.as_ref()?))).collect();
    if all.is_empty() {
        return Ok(Vec::new());
    }
    let panels: Vec<_> = spread(all.len(), PANELS).into_iter().map(|k| all[k]).collect();
    let highest = panels.iter().flat_map(|p| &p.1.height).fold(1e-9_f64, |h, v| h.max(*v)) / lengths.unit;
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for (_, map) in &panels {
        for (at, c) in map.cells(g) {
            if map.height[c] > 0.0 {
                for i in 0..2 {
                    range[i] = [range[i][0].min(at[i] - g.dx), range[i][1].max(at[i] + g.dx)];
                }
            }
        }
    }
    for (i, r) in range.iter_mut().enumerate() {
        if g.mirrored[i] {
            r[0] = -r[1];
        }
        *r = if r[0] < r[1] { r.map(|v| v / lengths.unit) } else { [0.0, 1.0] };
    }
    let [x, y] = range;
    let scale = (MOST[0] / (x[1] - x[0])).min(MOST[1] / (y[1] - y[0]));
    let size = [(x[1] - x[0]) * scale, (y[1] - y[0]) * scale];
    let columns = panels.len().min(2);
    let rows = panels.len().div_ceil(columns);
    let step = [size[0].max(150.0) + 26.0, size[1] + 34.0];
    let origin = [MARGIN[0] + 8.0, 84.0];
    let width = origin[0] + step[0] * columns as f64;
    let height = (origin[1] + step[1] * rows as f64 + MARGIN[1] - 20.0).max(300.0);
    canvas::save(folder, "top-view", [(width + 100.0) as i32, height as i32], |area| {
        canvas::headline(area, &title(a, "height from above"))?;
        let explained: Vec<String> =
            [lengths.explained(), times.explained.clone()].into_iter().filter(|t| !t.is_empty()).collect();
        canvas::write(area, &explained.join(",  "), 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        for (k, (time, map)) in panels.iter().enumerate() {
            let (column, row) = (k % columns, k / columns);
            let (left, top) = (origin[0] + step[0] * column as f64, origin[1] + step[1] * row as f64);
            let frame = Frame {
                x,
                y,
                x_name: (k + columns >= panels.len()).then(|| format!("x {}", lengths.text)),
                y_name: (column == 0).then(|| format!("y {}", lengths.text)),
            };
            let inner = [left, top, left + size[0], top + size[1]];
            let text = format!("t = {:.2} {}", time / times.unit, if times.unit == 1.0 { "s" } else { "T" });
            canvas::write(area, &text, left, top - 6.0, canvas::style(SMALL, HPos::Left, VPos::Bottom))?;
            canvas::axes(area, inner, &frame)?;
            for (shade, at, half) in cells(a, map, lengths.unit, highest) {
                let px = inner[0] + (at[0] - x[0]) * scale;
                let py = inner[3] - (at[1] - y[0]) * scale;
                let (low, high) = (
                    canvas::place(px - half * scale, py - half * scale),
                    canvas::place(px + half * scale, py + half * scale),
                );
                if px > inner[0] && px < inner[2] && py > inner[1] && py < inner[3] {
                    area.draw(&Rectangle::new([low, high], viridis(f64::from(shade) / SHADES).filled()))?;
                }
            }
            for ends in outline::of_obstacles(a, lengths.unit, [x, y]) {
                let on = |p: [f64; 2]| (inner[0] + (p[0] - x[0]) * scale, inner[3] - (p[1] - y[0]) * scale);
                canvas::polyline(area, &ends.map(on), canvas::pen(outline::COLOUR, 1.0), false)?;
            }
        }
        let bar = [
            origin[1] + 16.0,
            (origin[1] + step[1] * rows as f64 - 40.0).min(origin[1] + 300.0).max(origin[1] + 120.0),
        ];
        canvas::colour_bar(area, width + 4.0, bar, [0.0, highest], &format!("h {}", lengths.text))
    })
}

/// Filled cells and their mirror images: shade, centre and half side in units of `unit`; sorted by shade.
fn cells(a: &Analysis, map: &Map, unit: f64, highest: f64) -> Vec<(u32, [f64; 2], f64)> {
    let g = &a.geometry;
    let coarse = map.size[0].max(map.size[1]).div_ceil(CELLS);
    let mut out = Vec::new();
    for j in (0..map.size[1]).step_by(coarse) {
        for i in (0..map.size[0]).step_by(coarse) {
            let height = map.height[j * map.size[0] + i] / unit;
            if height <= 0.0 {
                continue;
            }
            let shade = (height / highest * SHADES).min(SHADES) as u32;
            let centre = |first: i64, k: usize| ((first + k as i64) as f64 + 0.5 * coarse as f64) * g.dx / unit;
            let at = [centre(map.first[0], i), centre(map.first[1], j)];
            for signs in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
                if (0..2).all(|k| signs[k] > 0.0 || g.mirrored[k]) {
                    out.push((shade, [at[0] * signs[0], at[1] * signs[1]], 0.51 * coarse as f64 * g.dx / unit));
                }
            }
        }
    }
    out.sort_by_key(|c| c.0);
    out
}
