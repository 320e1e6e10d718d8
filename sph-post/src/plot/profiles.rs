//! Surfaces of the deposit over time.

use super::canvas::{self, Entry, Frame, MARGIN, SMALL, viridis};
use super::{Lengths, Times, law, title};
use crate::{
    analysis::{Analysis, spread},
    deposit::Profile,
    failure::Failure,
    geometry::Geometry,
};
use plotters::style::{
    RGBColor,
    text_anchor::{HPos, VPos},
};
use std::path::{Path, PathBuf};

/// Most curves in the picture.
const CURVES: usize = 21;

/// Largest size of the part inside the axes, pixels, and smallest.
pub const MOST: [f64; 2] = [820.0, 620.0];
pub const LEAST: [f64; 2] = [360.0, 160.0];

/// Draws `profiles.svg` and `.png`.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let (g, lengths, times) = (&a.geometry, Lengths::of(a), Times::of(a));
    let shown = spread(a.moments.len(), CURVES);
    let curves: Vec<(f64, Vec<(f64, f64)>)> =
        shown.iter().map(|&k| (a.moments[k].time, outline(g, &a.moments[k].deposit.profile, lengths.unit))).collect();
    let law = law(a).filter(|l| l.run_out.is_some() || l.height.is_some());
    let (mut x, mut top) = ([0.0_f64, 0.0_f64], 0.0_f64);
    for &(s, h) in curves.iter().flat_map(|c| &c.1) {
        x = [x[0].min(s), x[1].max(s)];
        top = top.max(h);
    }
    if let Some(run_out) = law.and_then(|l| l.run_out) {
        x[1] = x[1].max(1.0 + run_out);
    }
    x = [x[0] * 1.04, x[1] * 1.04];
    let y = [0.0, (top * 1.06).max(1e-9)];
    // Equal aspect; a range too short for its least size is shown longer.
    let scale = (MOST[0] / (x[1] - x[0])).min(MOST[1] / y[1]);
    let size = [((x[1] - x[0]) * scale).max(LEAST[0]), (y[1] * scale).max(LEAST[1])];
    let (x, y) = ([x[0], x[0] + size[0] / scale], [0.0, size[1] / scale]);
    let below = if law.is_some() { 30.0 } else { 0.0 };
    let inner = [MARGIN[0] + 8.0, 58.0, MARGIN[0] + 8.0 + size[0], 58.0 + size[1]];
    let paper = [(inner[2] + 90.0).max(560.0) as i32, (inner[3] + MARGIN[1] + 8.0 + below) as i32];
    canvas::save(folder, "profiles", paper, |area| {
        canvas::headline(area, &title(a, "surface over time"))?;
        let explained: Vec<String> =
            [lengths.explained(), times.explained.clone()].into_iter().filter(|t| !t.is_empty()).collect();
        canvas::write(area, &explained.join(",  "), 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        let frame = Frame {
            x,
            y,
            x_name: Some(format!("{} {}", g.coordinate(), lengths.text)),
            y_name: Some(format!("h {}", lengths.text)),
        };
        let mut chart = canvas::axes(area, inner, &frame)?;
        let last = (a.last().time / times.unit).max(1e-300);
        for (time, points) in &curves {
            let colour = viridis(time / times.unit / last);
            canvas::curve(&mut chart, points, canvas::pen(colour, 1.7))?;
        }
        canvas::colour_bar(area, inner[2] + 20.0, [inner[1] + 14.0, inner[3]], [0.0, last], &times.text)?;
        if let Some(law) = law {
            let grey = RGBColor(90, 90, 90);
            if let Some(run_out) = law.run_out {
                canvas::dashed(&mut chart, (1.0 + run_out, y[0]), (1.0 + run_out, y[1]), grey)?;
            }
            if let Some(height) = law.height {
                canvas::dashed(&mut chart, (x[0], height), (x[1], height), grey)?;
            }
            let known: Vec<&str> =
                [law.run_out.map(|_| "run-out"), law.height.map(|_| "height")].into_iter().flatten().collect();
            let text = format!("final {} of {}", known.join(" and "), law.source);
            let entry = Entry { text: &text, colour: grey, dashed: true };
            canvas::legend(area, inner[0], inner[3] + MARGIN[1] + 16.0, &[entry])?;
        }
        Ok(())
    })
}

/// The surface as a curve in units of `unit`: through the middle of every bin, down to the floor at the outer edge of
/// the last one before a gap: single particles further out are no surface.
pub fn outline(g: &Geometry, profile: &Profile, unit: f64) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = profile.bins(g).map(|(x, k)| (x / unit, profile.height[k] / unit)).collect();
    let highest = (0..points.len()).max_by(|&a, &b| points[a].1.total_cmp(&points[b].1)).unwrap_or(0);
    let gap = |k: &usize| points[*k].1 == 0.0;
    let end = (highest..points.len()).find(gap).unwrap_or(points.len());
    let begin = (0..highest).rev().find(gap).map_or(0, |k| k + 1);
    let mut points = points[begin..end].to_vec();
    let half = 0.5 * g.dx / unit;
    if let (Some(&first), Some(&last)) = (points.first(), points.last()) {
        let starts_at_middle = (g.mirrored[0] || g.radial) && begin == 0;
        points.insert(0, (first.0 - half, if starts_at_middle { first.1 } else { 0.0 }));
        points.push((last.0 + half, last.1.min(half * 2.0)));
        points.push((last.0 + half, 0.0));
    }
    points
}
