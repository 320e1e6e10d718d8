//! Particles coloured by their speed, at several times.

use super::canvas::{self, Area, Drawn, FINE, Frame, MARGIN, SMALL, viridis};
use super::{Lengths, Times, title};
use crate::{analysis::Analysis, failure::Failure, scatter::Scatter};
use plotters::{
    element::Rectangle,
    style::{
        Color,
        text_anchor::{HPos, VPos},
    },
};
use std::path::{Path, PathBuf};

/// Shades of colour: squares of one shade become one path.
const SHADES: f64 = 96.0;

/// Largest width and height of the part inside the axes of one panel, pixels.
const MOST: [f64; 2] = [430.0, 330.0];

/// Draws `particles.svg` and `.png`.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let (g, lengths, times) = (&a.geometry, Lengths::of(a), Times::of(a));
    let panels: Vec<(f64, &Scatter)> = a.moments.iter().filter_map(|m| Some((m.time, m.scatter.as_ref()?))).collect();
    if panels.is_empty() {
        return Ok(Vec::new());
    }
    // Both sides are shown where the other one is known by symmetry.
    let both = g.mirrored[0];
    let (mut x, mut z, mut fastest) = ([f64::INFINITY, f64::NEG_INFINITY], 0.0_f64, 0.0_f64);
    // Few particles fly far; they may leave the picture.
    let furthest = a.moments.iter().map(|m| m.deposit.fronts.thickness.max(m.deposit.fronts.mass)).fold(0.0, f64::max);
    for (at, speed) in panels.iter().flat_map(|p| &p.1.squares) {
        x = [x[0].min(at[0]), x[1].max(at[0])];
        z = z.max(at[1] - g.floor);
        fastest = fastest.max(*speed);
    }
    let right = x[1].min(1.15 * furthest.max(g.dx)) + g.dx;
    let x = [if both { -right } else { x[0].max(-2.0 * right - g.dx) - g.dx }, right].map(|x| x / lengths.unit);
    let y = [-0.5 * g.dx / lengths.unit, 1.05 * z.max(g.dx) / lengths.unit];
    let scale = (MOST[0] / (x[1] - x[0])).min(MOST[1] / (y[1] - y[0]));
    let size = [(x[1] - x[0]) * scale, (y[1] - y[0]) * scale];
    // Tall and narrow panels stand in one row, wide ones in two columns.
    let most_columns = if size[0] < 200.0 { 3 } else { 2 };
    let columns = panels.len().min(most_columns);
    let rows = panels.len().div_ceil(columns);
    // A panel needs room for its title.
    let step = [size[0].max(150.0) + 26.0, size[1] + 34.0];
    let origin = [MARGIN[0] + 8.0, 84.0];
    let width = origin[0] + step[0] * columns as f64;
    let height = (origin[1] + step[1] * rows as f64 + MARGIN[1] - 20.0).max(300.0);
    let paper = [(width + 100.0) as i32, height as i32];
    canvas::save(folder, "particles", paper, |area| {
        let what = if g.space.dimension() == 3 { "speed in a vertical section" } else { "speed" };
        canvas::write(area, &title(a, what), 12.0, 8.0, canvas::style(15.0, HPos::Left, VPos::Top))?;
        let explained: Vec<String> =
            [lengths.explained(), times.explained.clone()].into_iter().filter(|t| !t.is_empty()).collect();
        canvas::write(area, &explained.join(",  "), 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        for (k, (time, scatter)) in panels.iter().enumerate() {
            let (column, row) = (k % columns, k / columns);
            let (left, top) = (origin[0] + step[0] * column as f64, origin[1] + step[1] * row as f64);
            let lowest = k + columns >= panels.len();
            let frame = Frame {
                x,
                y,
                x_name: lowest.then(|| format!("{} {}", g.coordinate(), lengths.text)),
                y_name: (column == 0).then(|| format!("z {}", lengths.text)),
            };
            let inner = [left, top, left + size[0], top + size[1]];
            let text = format!("t = {} s", canvas::number((time * 1e5).round() / 1e5));
            let text = if times.unit == 1.0 { text } else { format!("{text} = {:.2} T", time / times.unit) };
            canvas::write(area, &text, left, top - 6.0, canvas::style(SMALL, HPos::Left, VPos::Bottom))?;
            canvas::axes(area, inner, &frame)?;
            squares(area, inner, &frame, scatter, [lengths.unit, fastest, g.floor], both)?;
        }
        let bar = [
            origin[1] + 16.0,
            (origin[1] + step[1] * rows as f64 - 40.0).min(origin[1] + 300.0).max(origin[1] + 120.0),
        ];
        canvas::colour_bar(area, width + 4.0, bar, [0.0, fastest.max(1e-9)], "|v| (m/s)")
    })
}

fn squares(
    area: &Area,
    inner: [f64; 4],
    frame: &Frame,
    s: &Scatter,
    [unit, fastest, floor]: [f64; 3],
    both: bool,
) -> Drawn {
    let scale = (inner[2] - inner[0]) / (frame.x[1] - frame.x[0]);
    // A little more than the particle's share: no white grout between neighbours.
    let half = 0.53 * s.size / unit * scale;
    let mut shaded: Vec<(u32, [f64; 2])> = Vec::with_capacity(s.squares.len() * 2);
    for (at, speed) in &s.squares {
        let shade = (speed / fastest.max(1e-300) * SHADES).min(SHADES) as u32;
        shaded.push((shade, *at));
        if both {
            shaded.push((shade, [-at[0], at[1]]));
        }
    }
    // Stable: the drawing is the same on every run.
    shaded.sort_by_key(|s| s.0);
    for (shade, at) in shaded {
        let px = inner[0] + (at[0] / unit - frame.x[0]) * scale;
        let py = inner[3] - ((at[1] - floor) / unit - frame.y[0]) * scale;
        let inside = px - half >= inner[0] - 0.5
            && px + half <= inner[2] + 0.5
            && py - half >= inner[1]
            && py + half <= inner[3] + 0.5;
        if inside {
            let (a, b) = (canvas::place(px - half, py - half), canvas::place(px + half, py + half));
            // At least one unit wide, and no hairlines.
            let b = (b.0.max(a.0 + FINE / 4), b.1.max(a.1 + FINE / 4));
            area.draw(&Rectangle::new([a, b], viridis(f64::from(shade) / SHADES).filled()))?;
        }
    }
    Ok(())
}
