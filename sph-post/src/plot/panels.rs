//! Vertical sections at several times, side by side at the same scale: what the pictures of particles have in common.

use super::canvas::{self, Area, Drawn, FINE, Frame, MARGIN, SMALL};
use super::{Lengths, Times, title};
use crate::{
    analysis::{Analysis, Moment},
    failure::Failure,
};
use plotters::{
    element::Rectangle,
    style::{
        Color, RGBColor,
        text_anchor::{HPos, VPos},
    },
};
use std::path::{Path, PathBuf};

/// Largest width and height of the part inside the axes of one panel, pixels.
const MOST: [f64; 2] = [430.0, 330.0];

/// The same where there is one panel only.
const MOST_OF_ONE: [f64; 2] = [820.0, 560.0];

/// A coloured rectangle: centre along the profile and above the floor, half of each side, m.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    pub at: [f64; 2],
    pub half: [f64; 2],
    pub colour: RGBColor,
}

/// One section.
pub struct Panel<'a> {
    pub moment: &'a Moment,
    /// Drawn in this order; one colour after the other keeps the file small.
    pub patches: Vec<Patch>,
    /// Lines on top, along the profile and above the floor, m.
    pub lines: Vec<Line>,
}

/// A line on a section.
pub struct Line {
    pub points: Vec<[f64; 2]>,
    pub colour: RGBColor,
    /// Pixels.
    pub width: f64,
    pub dashed: bool,
}

/// A picture of sections.
pub struct Picture<'a> {
    /// Name of the files.
    pub name: &'a str,
    /// What it shows, for the title.
    pub what: &'a str,
    /// A remark below the title; may be empty.
    pub remark: String,
    pub panels: Vec<Panel<'a>>,
    /// Room for the legend at the right, pixels.
    pub legend_width: f64,
    /// Leaves the picture where nothing but strays lies further out.
    pub without_strays: bool,
}

/// Draws the picture; `legend` draws on the area from a place at the upper right downward, which it is given with the
/// lowest place it may reach. Nothing without panels.
pub fn draw(
    a: &Analysis,
    folder: &Path,
    picture: &Picture,
    legend: impl Fn(&Area, [f64; 2], f64) -> Drawn,
) -> Result<Vec<PathBuf>, Failure> {
    let panels = &picture.panels;
    if panels.is_empty() {
        return Ok(Vec::new());
    }
    let (g, lengths, times) = (&a.geometry, Lengths::of(a), Times::of(a));
    // Both sides are shown where the other one is known by symmetry.
    let both = g.mirrored[0];
    let (x, y) = ranges(a, picture, &lengths);
    let most = if panels.len() == 1 { MOST_OF_ONE } else { MOST };
    let scale = (most[0] / (x[1] - x[0])).min(most[1] / (y[1] - y[0]));
    let size = [(x[1] - x[0]) * scale, (y[1] - y[0]) * scale];
    // Tall and narrow panels stand in one row, wide ones in two columns.
    let most_columns = if size[0] < 200.0 { 3 } else { 2 };
    let columns = panels.len().min(most_columns);
    let rows = panels.len().div_ceil(columns);
    // A panel needs room for its title.
    let step = [size[0].max(150.0) + 26.0, size[1] + 34.0];
    let remarks = if picture.remark.is_empty() { 0.0 } else { 20.0 };
    let origin = [MARGIN[0] + 8.0, 84.0 + remarks];
    let width = origin[0] + step[0] * columns as f64;
    let height = (origin[1] + step[1] * rows as f64 + MARGIN[1] - 20.0).max(300.0);
    // The title needs room too, however narrow the panels are.
    let paper = [(width + picture.legend_width).max(560.0) as i32, height as i32];
    canvas::save(folder, picture.name, paper, |area| {
        canvas::headline(area, &title(a, picture.what))?;
        let explained: Vec<String> =
            [lengths.explained(), times.explained.clone()].into_iter().filter(|t| !t.is_empty()).collect();
        canvas::write(area, &explained.join(",  "), 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        canvas::write(area, &picture.remark, 12.0, 50.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        for (k, panel) in panels.iter().enumerate() {
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
            let time = panel.moment.time;
            let text = format!("t = {} s", canvas::number((time * 1e5).round() / 1e5));
            let text = if times.unit == 1.0 { text } else { format!("{text} = {:.2} T", time / times.unit) };
            canvas::write(area, &text, left, top - 6.0, canvas::style(SMALL, HPos::Left, VPos::Bottom))?;
            canvas::axes(area, inner, &frame)?;
            patches(area, inner, &frame, &panel.patches, lengths.unit, both)?;
            for line in &panel.lines {
                drawn(area, inner, &frame, line, lengths.unit, both)?;
            }
        }
        let lowest = (origin[1] + step[1] * rows as f64 - 40.0).min(origin[1] + 300.0).max(origin[1] + 120.0);
        legend(area, [width + 4.0, origin[1] + 16.0], lowest)
    })
}

/// What all panels show along x and z, in units of length.
fn ranges(a: &Analysis, picture: &Picture, lengths: &Lengths) -> ([f64; 2], [f64; 2]) {
    let g = &a.geometry;
    let (mut x, mut z) = ([f64::INFINITY, f64::NEG_INFINITY], 0.0_f64);
    // Few particles fly far; they may leave the picture.
    let front = |m: &Moment| m.deposit.fronts.thickness.max(m.deposit.fronts.mass);
    let furthest = picture.panels.iter().map(|p| front(p.moment)).fold(0.0, f64::max);
    for patch in picture.panels.iter().flat_map(|p| &p.patches) {
        x = [x[0].min(patch.at[0]), x[1].max(patch.at[0])];
        z = z.max(patch.at[1] + patch.half[1]);
    }
    if !picture.without_strays {
        let marks = picture.panels.iter().flat_map(|p| &p.lines).flat_map(|l| &l.points);
        x[1] = marks.fold(x[1], |x, p| x.max(p[0]));
    }
    let right = if picture.without_strays { x[1].min(1.15 * furthest.max(g.dx)) } else { 1.04 * x[1] } + g.dx;
    let left = if g.mirrored[0] { -right } else { x[0].max(-2.0 * right - g.dx) - g.dx };
    let y = [-0.5 * g.dx / lengths.unit, 1.04 * z.max(g.dx) / lengths.unit];
    ([left, right].map(|x| x / lengths.unit), y)
}

fn patches(area: &Area, inner: [f64; 4], frame: &Frame, patches: &[Patch], unit: f64, both: bool) -> Drawn {
    let scale = (inner[2] - inner[0]) / (frame.x[1] - frame.x[0]);
    let sides: &[f64] = if both { &[1.0, -1.0] } else { &[1.0] };
    for patch in patches {
        for side in sides {
            let px = inner[0] + (side * patch.at[0] / unit - frame.x[0]) * scale;
            let py = inner[3] - (patch.at[1] / unit - frame.y[0]) * scale;
            let half = patch.half.map(|h| h / unit * scale);
            let inside = px - half[0] >= inner[0] - 0.5
                && px + half[0] <= inner[2] + 0.5
                && py - half[1] >= inner[1]
                && py + half[1] <= inner[3] + 0.5;
            if inside {
                let (a, b) = (canvas::place(px - half[0], py - half[1]), canvas::place(px + half[0], py + half[1]));
                // At least a quarter of a pixel wide, and no hairlines.
                let b = (b.0.max(a.0 + FINE / 4), b.1.max(a.1 + FINE / 4));
                area.draw(&Rectangle::new([a, b], patch.colour.filled()))?;
            }
        }
    }
    Ok(())
}

fn drawn(area: &Area, inner: [f64; 4], frame: &Frame, line: &Line, unit: f64, both: bool) -> Drawn {
    let scale = (inner[2] - inner[0]) / (frame.x[1] - frame.x[0]);
    let sides: &[f64] = if both { &[1.0, -1.0] } else { &[1.0] };
    for side in sides {
        let place = |p: &[f64; 2]| {
            let x = inner[0] + (side * p[0] / unit - frame.x[0]) * scale;
            (x, inner[3] - (p[1] / unit - frame.y[0]) * scale)
        };
        let finite = line.points.iter().filter(|p| p[0].is_finite() && p[1].is_finite());
        let points: Vec<(f64, f64)> = finite.map(place).collect();
        // Piece by piece, as far as it lies inside the frame.
        let pieces = points.windows(2).filter_map(|ends| inside([ends[0], ends[1]], inner));
        let mut joined: Vec<(f64, f64)> = Vec::new();
        for [from, to] in pieces {
            if joined.last() != Some(&from) {
                canvas::polyline(area, &joined, canvas::pen(line.colour, line.width), line.dashed)?;
                joined = vec![from];
            }
            joined.push(to);
        }
        canvas::polyline(area, &joined, canvas::pen(line.colour, line.width), line.dashed)?;
    }
    Ok(())
}

/// The part of a straight line that lies in a rectangle (left, top, right, bottom), if any: after Liang and Barsky (1984).
fn inside([a, b]: [(f64, f64); 2], [left, top, right, bottom]: [f64; 4]) -> Option<[(f64, f64); 2]> {
    let way = (b.0 - a.0, b.1 - a.1);
    let mut part = [0.0_f64, 1.0_f64];
    for (speed, room) in [(-way.0, a.0 - left), (way.0, right - a.0), (-way.1, a.1 - top), (way.1, bottom - a.1)] {
        if speed < 0.0 {
            part[0] = part[0].max(room / speed);
        } else if speed > 0.0 {
            part[1] = part[1].min(room / speed);
        } else if room < 0.0 {
            return None;
        }
    }
    // Ends that need no cut keep their bits, so that pieces join.
    let at = |t: f64| {
        if t == 0.0 {
            a
        } else if t == 1.0 {
            b
        } else {
            (a.0 + t * way.0, a.1 + t * way.1)
        }
    };
    (part[0] <= part[1]).then(|| part.map(at))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_at_the_frame_and_keep_their_slope() {
        let frame = [0.0, 0.0, 10.0, 10.0];
        assert_eq!(inside([(-5.0, -5.0), (15.0, 15.0)], frame), Some([(0.0, 0.0), (10.0, 10.0)]));
        assert_eq!(inside([(1.0, 2.0), (3.0, 4.0)], frame), Some([(1.0, 2.0), (3.0, 4.0)]));
        assert_eq!(inside([(5.0, 5.0), (-5.0, 0.0)], frame), Some([(5.0, 5.0), (0.0, 2.5)]));
        assert_eq!(inside([(3.0, -1.0), (3.0, 20.0)], frame), Some([(3.0, 0.0), (3.0, 10.0)]));
        assert_eq!(inside([(-1.0, 0.0), (-1.0, 20.0)], frame), None);
        assert_eq!(inside([(-3.0, 2.0), (2.0, -3.0)], frame), None);
    }
}
