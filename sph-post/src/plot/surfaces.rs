//! Surfaces at a few set times (Szewc 2017, Fig 3).

use super::canvas::{self, Entry, Frame, MARGIN, SMALL, viridis};
use super::profiles::{LEAST, MOST, outline};
use super::{Lengths, Times, title};
use crate::{
    analysis::{Analysis, at_times},
    failure::Failure,
};
use plotters::style::text_anchor::{HPos, VPos};
use std::path::{Path, PathBuf};

/// The times, in T; the end of the run is the last one.
const SHOWN: [f64; 6] = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0];

/// Draws `surfaces.svg` and `.png`; nothing without a time scale.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let (g, lengths, times) = (&a.geometry, Lengths::of(a), Times::of(a));
    let Some(scale) = g.time_scale() else { return Ok(Vec::new()) };
    let all: Vec<f64> = a.moments.iter().map(|m| m.time).collect();
    let shown = at_times(&all, &SHOWN, scale);
    let curves: Vec<(String, Vec<(f64, f64)>)> = shown
        .iter()
        .map(|&k| {
            let m = &a.moments[k];
            (format!("t = {:.2} T", m.time / scale), outline(g, &m.deposit.profile, lengths.unit))
        })
        .collect();
    let measured: Vec<(f64, f64)> =
        a.reference.iter().flat_map(|r| &r.surface).map(|p| scaled(p, lengths.unit)).collect();
    let points = || curves.iter().flat_map(|c| &c.1).chain(&measured);
    let x = points().fold([0.0_f64; 2], |x, p| [x[0].min(p.0), x[1].max(p.0)]).map(|x| x * 1.04);
    let top = 1.06 * points().fold(1e-9_f64, |top, p| top.max(p.1));
    // Equal aspect; a range too short for its least size is shown longer.
    let scale = (MOST[0] / (x[1] - x[0])).min(MOST[1] / top);
    let size = [((x[1] - x[0]) * scale).max(LEAST[0]), (top * scale).max(LEAST[1])];
    let inner = [MARGIN[0] + 8.0, 58.0, MARGIN[0] + 8.0 + size[0], 58.0 + size[1]];
    let low = inner[3].max(inner[1] + 20.0 * (curves.len() + 1) as f64);
    let paper = [(inner[2] + 165.0).max(560.0) as i32, (low + MARGIN[1] + 8.0) as i32];
    canvas::save(folder, "surfaces", paper, |area| {
        canvas::headline(area, &title(a, "surface"))?;
        let explained: Vec<String> =
            [lengths.explained(), times.explained.clone()].into_iter().filter(|t| !t.is_empty()).collect();
        canvas::write(area, &explained.join(",  "), 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        let frame = Frame {
            x: [x[0], x[0] + size[0] / scale],
            y: [0.0, size[1] / scale],
            x_name: Some(format!("{} {}", g.coordinate(), lengths.text)),
            y_name: Some(format!("h {}", lengths.text)),
        };
        let mut chart = canvas::axes(area, inner, &frame)?;
        let mut entries = Vec::new();
        for (k, (text, points)) in curves.iter().enumerate() {
            // Yellow is too light for a line on white.
            let colour = viridis(0.92 * k as f64 / (curves.len() - 1).max(1) as f64);
            canvas::curve(&mut chart, points, canvas::pen(colour, 2.0))?;
            entries.push(Entry { text, colour, dashed: false });
        }
        if !measured.is_empty() {
            canvas::marks(&mut chart, &measured)?;
            let at = [inner[2] + 18.0, inner[1] + 12.0 + 20.0 * entries.len() as f64];
            canvas::mark_legend(area, at, "measured, final")?;
        }
        canvas::legend(area, inner[2] + 18.0, inner[1] + 12.0, &entries)
    })
}

/// A point in units of `unit`.
fn scaled(p: &[f64; 2], unit: f64) -> (f64, f64) {
    (p[0] / unit, p[1] / unit)
}
