//! What a landslide did, on a relief of its terrain.

use super::{
    canvas::{self, Frame, MARGIN, SMALL, viridis},
    outline, title,
};
use crate::{analysis::Analysis, failure::Failure, terrain::Maps};
use plotters::{
    element::Rectangle,
    style::{
        Color, RGBColor,
        text_anchor::{HPos, VPos},
    },
};
use std::path::{Path, PathBuf};

/// Largest width and height of a panel inside its axes, pixels.
const MOST: [f64; 2] = [380.0, 340.0];

/// Most cells along a side; finer maps are shown coarser.
const CELLS: usize = 200;

/// Lines of equal height on the relief.
const LINES: usize = 14;

/// Draws `terrain.svg` and `.png`; nothing without maps.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let Some(maps) = &a.maps else { return Ok(Vec::new()) };
    let ends = |axis: usize| {
        let half = 0.5 * maps.terrain.ground.cell[axis];
        [place_of(maps, axis, 0) - half, place_of(maps, axis, maps.size[axis] - 1) + half]
    };
    let (x, y) = (ends(0), ends(1));
    let scale = (MOST[0] / (x[1] - x[0])).min(MOST[1] / (y[1] - y[0]));
    let size = [(x[1] - x[0]) * scale, (y[1] - y[0]) * scale];
    let step = [size[0].max(170.0) + 150.0, size[1].max(150.0) + 56.0];
    let origin = [MARGIN[0] + 20.0, 84.0];
    let panels = [
        ("largest thickness", "m", maps.largest(&maps.thickness)),
        ("largest speed", "m/s", maps.largest(&maps.speed)),
        ("arrival", "s", maps.arrival()),
        ("deposit", "m", maps.deposit()),
    ];
    let paper = [origin[0] + 2.0 * step[0], origin[1] + 2.0 * step[1] + MARGIN[1] - 20.0];
    canvas::save(folder, "terrain", paper.map(|s| s as i32), |area| {
        canvas::headline(area, &title(a, "on the terrain"))?;
        let line = interval(maps);
        let [east, north, _] = maps.terrain.origin;
        let at = if [east, north] == [0.0; 2] {
            String::new()
        } else {
            format!("; 0 is at {east} m, {north} m of the raster")
        };
        let explained = format!("lines of equal height every {} m{at}", canvas::number(line));
        canvas::write(area, &explained, 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        for (k, (name, unit, field)) in panels.iter().enumerate() {
            let (left, top) = (origin[0] + step[0] * (k % 2) as f64, origin[1] + step[1] * (k / 2) as f64);
            let inner = [left, top, left + size[0], top + size[1]];
            let frame =
                Frame { x, y, x_name: (k >= 2).then(|| "x (m)".into()), y_name: (k % 2 == 0).then(|| "y (m)".into()) };
            canvas::write(area, name, left, top - 6.0, canvas::style(SMALL, HPos::Left, VPos::Bottom))?;
            canvas::axes(area, inner, &frame)?;
            let most = field.iter().copied().filter(|v| v.is_finite()).fold(0.0_f64, f64::max);
            for (colour, cell) in cells(maps, field, most) {
                let (at, half) = (
                    [0, 1].map(|a| place_of(maps, a, cell[a])),
                    [0, 1].map(|a| 0.5 * maps.terrain.ground.cell[a] * cell[2] as f64),
                );
                let px = [at[0] - half[0], at[0] + half[0]].map(|v| (inner[0] + (v - x[0]) * scale).min(inner[2]));
                let py = [at[1] - half[1], at[1] + half[1]].map(|v| (inner[3] - (v - y[0]) * scale).max(inner[1]));
                let corners = [canvas::place(px[0].max(inner[0]), py[0].min(inner[3])), canvas::place(px[1], py[1])];
                area.draw(&Rectangle::new(corners, colour.filled()))?;
            }
            for ends in lines(maps, line) {
                let on = |p: [f64; 2]| (inner[0] + (p[0] - x[0]) * scale, inner[3] - (p[1] - y[0]) * scale);
                let pen = canvas::pen(RGBColor(110, 100, 90), 0.6);
                canvas::polyline(area, &[on(ends[0]), on(ends[1])], pen, false)?;
            }
            for ends in outline::of_obstacles(a, 1.0, [x, y]) {
                let on = |p: [f64; 2]| (inner[0] + (p[0] - x[0]) * scale, inner[3] - (p[1] - y[0]) * scale);
                canvas::polyline(area, &ends.map(on), canvas::pen(outline::COLOUR, 1.0), false)?;
            }
            let bar = [top + 10.0, (top + 10.0 + size[1].min(240.0)).max(top + 110.0)];
            canvas::colour_bar(area, left + size[0] + 16.0, bar, [0.0, most.max(1e-9)], &format!("({unit})"))?;
        }
        Ok(())
    })
}

/// Height between lines: round.
fn interval(maps: &Maps) -> f64 {
    let (low, high) = maps
        .ground()
        .into_iter()
        .filter(|z| z.is_finite())
        .fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
    match canvas::ticks(low, high.max(low + 1e-6), LINES)[..] {
        [a, b, ..] => b - a,
        _ => high - low,
    }
}

/// Colour of each cell, its numbers along x and y, and how many cells it stands for along each.
fn cells(maps: &Maps, field: &[f64], most: f64) -> Vec<(RGBColor, [usize; 3])> {
    let ([nx, ny], ground) = (maps.size, maps.ground());
    let coarse = nx.max(ny).div_ceil(CELLS);
    let mut out = Vec::new();
    for j in (0..ny).step_by(coarse) {
        for i in (0..nx).step_by(coarse) {
            let c = j * nx + i;
            let colour = match field[c] {
                v if v.is_finite() => viridis((v / most).clamp(0.0, 1.0)),
                _ => relief(maps, &ground, i, j),
            };
            out.push((colour, [i, j, coarse]));
        }
    }
    out
}

/// Grey by the light from the north-west.
fn relief(maps: &Maps, ground: &[f64], i: usize, j: usize) -> RGBColor {
    let [nx, ny] = maps.size;
    let z = ground[j * nx + i];
    if z.is_nan() {
        return RGBColor(255, 255, 255);
    }
    let other = |i: usize, j: usize| Some(ground[j * nx + i]).filter(|z| z.is_finite()).unwrap_or(z);
    let (east, north) = (other((i + 1).min(nx - 1), j), other(i, (j + 1).min(ny - 1)));
    let cell = maps.terrain.ground.cell;
    let slope = [(east - z) / cell[0], (north - z) / cell[1]];
    let light = (0.5 * slope[0] - 0.5 * slope[1] + 0.7) / (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
    let grey = (150.0 + 105.0 * light.clamp(0.0, 1.0)) as u8;
    RGBColor(grey, grey, grey)
}

/// Pieces of the lines of equal height: ends in the coordinates of the scene. In each square between the middles of four
/// cells, or as many rows and columns further as are shown as one, a line crosses two sides or all four.
fn lines(maps: &Maps, interval: f64) -> Vec<[[f64; 2]; 2]> {
    let ([nx, ny], ground) = (maps.size, maps.ground());
    let coarse = nx.max(ny).div_ceil(CELLS);
    let place = |i: usize, j: usize| [place_of(maps, 0, i), place_of(maps, 1, j)];
    let mut out = Vec::new();
    for j in (0..ny.saturating_sub(coarse)).step_by(coarse) {
        for i in (0..nx.saturating_sub(coarse)).step_by(coarse) {
            let corners = [(i, j), (i + coarse, j), (i + coarse, j + coarse), (i, j + coarse)];
            let z = corners.map(|(i, j)| ground[j * nx + i] / interval);
            if z.iter().any(|z| z.is_nan()) {
                continue;
            }
            let (low, high) = (z.iter().copied().fold(f64::MAX, f64::min), z.iter().copied().fold(f64::MIN, f64::max));
            for level in low.ceil() as i64..=high.floor() as i64 {
                let level = level as f64;
                let crossings: Vec<[f64; 2]> = (0..4)
                    .filter(|&k| (z[k] < level) != (z[(k + 1) % 4] < level))
                    .map(|k| {
                        let (next, part) = ((k + 1) % 4, (level - z[k]) / (z[(k + 1) % 4] - z[k]));
                        let (a, b) = (place(corners[k].0, corners[k].1), place(corners[next].0, corners[next].1));
                        [0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis]))
                    })
                    .collect();
                out.extend(crossings.chunks_exact(2).map(|pair| [pair[0], pair[1]]));
            }
        }
    }
    out
}

/// Middle of a cell in the coordinates of the scene, m.
fn place_of(maps: &Maps, axis: usize, n: usize) -> f64 {
    maps.coordinate(axis, n) - maps.terrain.origin[axis]
}
