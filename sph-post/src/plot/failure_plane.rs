//! The failure plane of a column that begins to fall (Szewc 2017, Fig 8).

use super::canvas::{self, Entry, viridis};
use super::panels::{self, Line, Panel, Patch, Picture};
use super::particles::by_shade;
use crate::{analysis::Analysis, failure::Failure};
use plotters::{
    element::Rectangle,
    style::{Color, RGBColor},
};
use std::path::{Path, PathBuf};

/// The particles on the surface: seen on all of viridis.
const MARK: RGBColor = RGBColor(213, 60, 0);

/// The surface, seen on all of viridis but its brightest end.
const SURFACE: RGBColor = RGBColor(255, 255, 255);

/// The straight line, seen on viridis and on white.
const STRAIGHT: RGBColor = RGBColor(230, 110, 170);

/// A measured line, seen on viridis and on white.
const MEASURED: RGBColor = RGBColor(86, 180, 233);

/// Draws `failure-plane.svg` and `.png`; nothing where the snapshot nearest to the wanted time shows no plane.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let Some(moment) = a.failure.map(|k| &a.moments[k]) else { return Ok(Vec::new()) };
    let (g, plane) = (&a.geometry, &moment.failure_plane);
    let (Some(line), Some(scatter)) = (plane.line, &moment.scatter) else { return Ok(Vec::new()) };
    let mut patches = by_shade(g, scatter, |q| q.speed / plane.top_speed);
    let mark = |at: &[f64; 2]| Patch { at: *at, half: [0.3 * g.dx; 2], colour: MARK };
    patches.extend(plane.marked.iter().map(mark));
    let contour: Vec<[f64; 2]> = plane.surface.iter().enumerate().map(|(j, s)| [*s, (j as f64 + 0.5) * g.dx]).collect();
    let [low, high] = line.ends;
    // On to the floor and as far up again, to read the angle from, but not across the axis.
    let reach = |z: f64| low[0] + (high[0] - low[0]) * (z - low[1]) / (high[1] - low[1]);
    let begin = g.extent.map_or(0.0, |e| e[0]);
    let meets = low[1] + (high[1] - low[1]) * (begin - low[0]) / (high[0] - low[0]);
    let top = if high[0] < low[0] { meets } else { f64::INFINITY };
    let top = top.min(high[1] + low[1]).min(moment.deposit.height_max);
    let points = a.reference.as_ref().map_or(Vec::new(), |r| r.failure.clone());
    let is_measured = points.len() > 1;
    let measured = is_measured.then_some(Line { points, colour: MEASURED, width: 2.2, dashed: false });
    let picture = Picture {
        name: "failure-plane",
        what: "failure plane",
        remark: format!(
            "the plane rises at {:.1}\u{b0}; points deviate from it by {:.2} dx (root mean square)",
            line.angle_deg,
            line.scatter / g.dx
        ),
        panels: vec![Panel {
            moment,
            patches,
            lines: measured
                .into_iter()
                .chain([
                    Line { points: contour, colour: SURFACE, width: 1.6, dashed: false },
                    Line {
                        points: vec![[reach(0.0), 0.0], [reach(top), top]],
                        colour: STRAIGHT,
                        width: 2.6,
                        dashed: true,
                    },
                ])
                .collect(),
        }],
        legend_width: 270.0,
        without_strays: true,
    };
    panels::draw(a, folder, &picture, |area, at, lowest| {
        let end = (lowest - 110.0).max(at[1] + 90.0);
        canvas::colour_bar(area, at[0], [at[1], end], [0.0, plane.top_speed], "|v| (m/s)")?;
        let marks = [(MARK, "9.5 to 10.5 % of the top speed".to_string())];
        canvas::swatches(area, at[0], end + 28.0, &marks)?;
        // A white line needs a dark ground.
        let ground = [canvas::place(at[0], end + 43.5), canvas::place(at[0] + 24.0, end + 56.5)];
        area.draw(&Rectangle::new(ground, viridis(0.1).filled()))?;
        let mut lines = vec![
            Entry { text: "10 % of the top speed", colour: SURFACE, dashed: false },
            Entry { text: "straight line through its middle", colour: STRAIGHT, dashed: true },
        ];
        if is_measured {
            lines.push(Entry { text: "measured", colour: MEASURED, dashed: false });
        }
        canvas::legend(area, at[0], end + 50.0, &lines)
    })
}
