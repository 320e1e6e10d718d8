//! Basal stress and the weight of the column above, each in terms of the largest measured stress (Yang et al. 2020, Fig 20).

use super::canvas::{self, CURVES, Entry, Frame, MARGIN, SMALL};
use super::title;
use crate::{
    analysis::Analysis,
    dip::{self, CENTRE, Dip},
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

/// Size of the part inside the axes, pixels.
const INNER: [f64; 2] = [560.0, 300.0];

/// Draws `basal-stress-normalised.svg` and `.png`: the last snapshot; nothing where there is no centre or no stress.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let (g, last) = (&a.geometry, a.last());
    let [on, off] = last.basal.dips;
    let (Some(centre), true) = (dip::centre(g), on.largest > 0.0) else { return Ok(Vec::new()) };
    let edge = last.deposit.fronts.thickness - centre;
    let curve = |field: &[f64]| -> Vec<(f64, f64)> {
        let bins = last.deposit.profile.bins(g).map(|(s, k)| ((s - centre) / edge, -field[k] / on.largest));
        bins.filter(|p| p.1.is_finite() && p.0 >= 0.0).collect()
    };
    let stresses = &last.basal.profile;
    let (measured, weight) = (curve(&stresses.normal), curve(&stresses.hydrostatic));
    let top = measured.iter().chain(&weight).fold(0.0_f64, |top, p| top.max(p.1));
    let low = measured.iter().fold(0.0_f64, |low, p| low.min(p.1));
    let axis = g.coordinate();
    let frame = Frame {
        x: [0.0, 1.04],
        y: [1.06 * low, 1.06 * top],
        x_name: Some(format!("{axis} / {axis} of the effective front")),
        y_name: Some("\u{2212}\u{03c3}zz / largest measured".into()),
    };
    let inner = [MARGIN[0] + 8.0, 76.0, MARGIN[0] + 8.0 + INNER[0], 76.0 + INNER[1]];
    let paper = [(inner[2] + 260.0) as i32, (inner[3] + MARGIN[1] + 8.0) as i32];
    canvas::save(folder, "basal-stress-normalised", paper, |area| {
        let what = format!("stress {} mm above the floor", canvas::number((a.level * 1e5).round() / 1e2));
        canvas::headline(area, &title(a, &what))?;
        let small = || canvas::style(SMALL, HPos::Left, VPos::Top);
        let time = canvas::number((last.time * 1e5).round() / 1e5);
        let largest = canvas::number((on.largest * 10.0).round() / 1e4);
        canvas::write(area, &format!("t = {time} s,  largest {largest} kPa,  front {edge:.4} m"), 12.0, 30.0, small())?;
        let ratio = |d: Dip| if d.ratio.is_nan() { "none".into() } else { format!("{:.3}", d.ratio) };
        let text = format!("centre over largest: {}; without the inner 2h: {}", ratio(on), ratio(off));
        canvas::write(area, &text, 12.0, 50.0, small())?;
        let mut chart = canvas::axes(area, inner, &frame)?;
        let shade = RGBColor(235, 235, 235);
        // Just inside the frame, which it would hide.
        let inset = 0.004 * (frame.y[1] - frame.y[0]);
        let ends = [(0.003, frame.y[0] + inset), (CENTRE * g.h / edge, frame.y[1] - inset)];
        chart.draw_series([Rectangle::new(ends, shade.filled())])?;
        let grey = RGBColor(90, 90, 90);
        canvas::curve(&mut chart, &weight, canvas::pen(grey, 1.6))?;
        canvas::curve(&mut chart, &measured, canvas::pen(CURVES[0], 2.0))?;
        let entries = [
            Entry { text: "measured", colour: CURVES[0], dashed: false },
            Entry { text: "weight of the column above", colour: grey, dashed: false },
        ];
        canvas::legend(area, inner[2] + 18.0, inner[1] + 12.0, &entries)?;
        let within = if g.radial { "within 2h of the axis" } else { "within 2h of the middle" };
        canvas::swatches(area, inner[2] + 18.0, inner[1] + 56.0, &[(RGBColor(215, 215, 215), within.into())])
    })
}
