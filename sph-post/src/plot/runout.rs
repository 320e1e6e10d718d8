//! The true run-out of strays against the effective one of the continuous deposit (Yang et al. 2020, Fig 11).

use super::canvas::{self, CURVES, Entry};
use super::panels::{self, Line, Panel, Picture};
use super::particles::patch;
use crate::{analysis::Analysis, failure::Failure};
use plotters::style::RGBColor;
use std::path::{Path, PathBuf};

/// Grey of the deposit.
const BODY: RGBColor = RGBColor(150, 150, 150);

/// Draws `run-out.svg` and `.png`: the last snapshot.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let (g, last) = (&a.geometry, a.last());
    let Some(scatter) = &last.scatter else { return Ok(Vec::new()) };
    let sorted = [false, true].into_iter().flat_map(|stray| scatter.squares.iter().filter(move |q| q.stray == stray));
    let patches = sorted.map(|q| patch(g, scatter, q, if q.stray { CURVES[1] } else { BODY })).collect();
    let fronts = &last.deposit.fronts;
    let top = last.deposit.height_max * 0.6;
    let mark = |at: f64, colour, dashed| Line { points: vec![[at, 0.0], [at, top]], colour, width: 2.0, dashed };
    let [effective, mass, true_] = [CURVES[0], CURVES[2], CURVES[1]];
    let lines = vec![
        mark(fronts.thickness, effective, false),
        mark(fronts.mass, mass, true),
        mark(fronts.furthest, true_, true),
    ];
    let scaled = |front: f64| {
        let value = a.scaled(front);
        if value.is_nan() { format!("{front:.4} m") } else { format!("{front:.4} m, run-out {value:.3}") }
    };
    let strays = last.deposit.strays;
    let picture = Picture {
        name: "run-out",
        what: if g.space.dimension() == 3 {
            "effective and true run-out, vertical section"
        } else {
            "effective and true run-out"
        },
        remark: if !g.runs_outward {
            String::new()
        } else {
            format!(
                "{} particles, {:.2} % of the mass, lie beyond the effective front",
                strays.count,
                100.0 * strays.share
            )
        },
        panels: vec![Panel { moment: last, patches, lines }],
        legend_width: 360.0,
        without_strays: false,
    };
    let texts = [
        format!("effective: {}", scaled(fronts.thickness)),
        format!("99.5 % of the mass: {}", scaled(fronts.mass)),
        format!("true: {}", scaled(fronts.furthest)),
    ];
    panels::draw(a, folder, &picture, |area, at, _| {
        let entries: Vec<Entry> = texts
            .iter()
            .zip([(effective, false), (mass, true), (true_, true)])
            .map(|(text, (colour, dashed))| Entry { text, colour, dashed })
            .collect();
        canvas::legend(area, at[0], at[1], &entries)?;
        let squares = [(BODY, "deposit".to_string()), (CURVES[1], "stray particles".to_string())];
        canvas::swatches(area, at[0], at[1] + 66.0, &squares)
    })
}
