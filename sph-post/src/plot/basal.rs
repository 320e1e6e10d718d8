//! Stresses near the floor at the last time.

use super::canvas::{self, CURVES, Entry, Frame, MARGIN, SMALL};
use super::{Lengths, title};
use crate::{analysis::Analysis, failure::Failure};
use plotters::style::{
    RGBColor,
    text_anchor::{HPos, VPos},
};
use std::path::{Path, PathBuf};

/// Size of the part inside the axes, pixels.
const INNER: [f64; 2] = [560.0, 300.0];

/// Draws `basal-stress.svg` and `.png`; nothing where no material reaches the height the stresses are taken at.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let (g, lengths, last) = (&a.geometry, Lengths::of(a), a.last());
    let stresses = &last.basal.profile;
    let curve = |field: &[f64], sign: f64| -> Vec<(f64, f64)> {
        let bins = last.deposit.profile.bins(g);
        bins.map(|(x, k)| (x / lengths.unit, sign * field[k] / 1e3)).filter(|p| p.1.is_finite()).collect()
    };
    let normal = curve(&stresses.normal, -1.0);
    let shear = curve(&stresses.shear, 1.0);
    let hydrostatic = curve(&stresses.hydrostatic, -1.0);
    if normal.is_empty() {
        return Ok(Vec::new());
    }
    let points = || normal.iter().chain(&shear).chain(&hydrostatic);
    let (low, high) = points().fold((0.0_f64, 1e-9_f64), |(l, h), p| (l.min(p.1), h.max(p.1)));
    let (left, right) = points().fold((0.0_f64, 0.0_f64), |(l, r), p| (l.min(p.0), r.max(p.0)));
    let frame = Frame {
        x: [left * 1.04, right * 1.04],
        y: [low * 1.08, high * 1.08],
        x_name: Some(format!("{} {}", g.coordinate(), lengths.text)),
        y_name: Some("stress (kPa)".into()),
    };
    let inner = [MARGIN[0] + 8.0, 56.0, MARGIN[0] + 8.0 + INNER[0], 56.0 + INNER[1]];
    let paper = [(inner[2] + 210.0) as i32, (inner[3] + MARGIN[1] + 8.0) as i32];
    canvas::save(folder, "basal-stress", paper, |area| {
        let what = format!("stress {} mm above the floor", canvas::number((a.level * 1e5).round() / 1e2));
        canvas::headline(area, &title(a, &what))?;
        let explained = [format!("t = {} s", canvas::number((last.time * 1e5).round() / 1e5)), lengths.explained()];
        let explained: Vec<String> = explained.into_iter().filter(|t| !t.is_empty()).collect();
        canvas::write(area, &explained.join(",  "), 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        let mut chart = canvas::axes(area, inner, &frame)?;
        let grey = RGBColor(90, 90, 90);
        canvas::curve(&mut chart, &hydrostatic, canvas::pen(grey, 1.6))?;
        canvas::curve(&mut chart, &normal, canvas::pen(CURVES[0], 2.0))?;
        canvas::curve(&mut chart, &shear, canvas::pen(CURVES[1], 2.0))?;
        let axis = g.coordinate();
        let names = [
            "pressure \u{2212}\u{03c3}zz".to_string(),
            format!("shear \u{03c3}{axis}z"),
            "weight of the column".into(),
        ];
        let colours = [CURVES[0], CURVES[1], grey];
        let entries: Vec<Entry> =
            names.iter().zip(colours).map(|(text, colour)| Entry { text, colour, dashed: false }).collect();
        canvas::legend(area, inner[2] + 18.0, inner[1] + 12.0, &entries)
    })
}
