//! Where the potential energy went, and whether the energies add up (Szewc 2017, Fig 7).

use super::canvas::{self, Entry, Frame, INK, MARGIN, SMALL};
use super::{Times, title};
use crate::{analysis::Analysis, failure::Failure};
use formats::space::Space;
use plotters::style::{
    RGBColor,
    text_anchor::{HPos, VPos},
};
use std::path::{Path, PathBuf};

/// Size of the part inside each pair of axes, pixels.
const INNER: [[f64; 2]; 2] = [[560.0, 300.0], [560.0, 130.0]];

/// Of the same set as [`canvas::CURVES`].
const VISCOUS: RGBColor = RGBColor(86, 180, 233);

/// The least range of the error that is shown, %.
const LEAST_ERROR: f64 = 0.01;

/// A curve, its name and its colour.
type Curve = (&'static str, RGBColor, Vec<(f64, f64)>);

/// Draws `energies.svg` and `.png`; nothing where the history does not tell the work that was done.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let Some(p) = &a.partition else { return Ok(Vec::new()) };
    let times = Times::of(a);
    let start = a.start_potential();
    let relative = start > 0.0;
    let scale = if relative { start } else { 1.0 };
    let floor = start - p.potential[0];
    let curve = |values: &[f64], add: f64| -> Vec<(f64, f64)> {
        p.times.iter().zip(values).map(|(t, v)| (t / times.unit, (v + add) / scale)).collect()
    };
    let sum: Vec<f64> = (0..p.times.len())
        .map(|k| p.kinetic[k] + p.potential[k] + p.elastic[k] + p.plastic[k] + p.viscous[k])
        .collect();
    let curves: [Curve; 6] = [
        ("potential", canvas::CURVES[0], curve(&p.potential, floor)),
        ("kinetic", canvas::CURVES[1], curve(&p.kinetic, 0.0)),
        ("elastic", canvas::CURVES[2], curve(&p.elastic, 0.0)),
        ("plastic work", canvas::CURVES[3], curve(&p.plastic, 0.0)),
        ("viscous work", VISCOUS, curve(&p.viscous, 0.0)),
        ("sum", INK, curve(&sum, floor)),
    ];
    let closure: Vec<(f64, f64)> = p.times.iter().zip(&p.closure).map(|(t, c)| (t / times.unit, 100.0 * c)).collect();
    let range = |points: &mut dyn Iterator<Item = f64>, least: f64| {
        let [low, high] = points.filter(|v| v.is_finite()).fold([0.0_f64, least], |r, v| [r[0].min(v), r[1].max(v)]);
        [low * 1.06, high * 1.06]
    };
    let last = p.times.last().map_or(1.0, |t| t / times.unit).max(1e-9);
    let unit = if a.geometry.space == Space::PlaneStrain { "energy (J/m)" } else { "energy (J)" };
    let name = if relative { "energy / potential energy at the start" } else { unit };
    let left = MARGIN[0] + 8.0;
    let tops = [56.0, 56.0 + INNER[0][1] + MARGIN[1] + 22.0];
    let paper = [(left + INNER[0][0] + 220.0) as i32, (tops[1] + INNER[1][1] + MARGIN[1] + 8.0) as i32];
    canvas::save(folder, "energies", paper, |area| {
        canvas::headline(area, &title(a, "energies"))?;
        canvas::write(area, &times.explained, 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        let inner = |k: usize| [left, tops[k], left + INNER[k][0], tops[k] + INNER[k][1]];
        let frame = Frame {
            x: [0.0, last],
            y: range(&mut curves.iter().flat_map(|c| &c.2).map(|p| p.1), 1e-9),
            x_name: Some(times.text.clone()),
            y_name: Some(name.into()),
        };
        let mut chart = canvas::axes(area, inner(0), &frame)?;
        let mut entries = Vec::new();
        for (text, colour, points) in &curves {
            canvas::curve(&mut chart, points, canvas::pen(*colour, 2.0))?;
            entries.push(Entry { text, colour: *colour, dashed: false });
        }
        canvas::legend(area, inner(0)[2] + 18.0, inner(0)[1] + 12.0, &entries)?;
        let frame = Frame {
            y: range(&mut closure.iter().map(|p| p.1), LEAST_ERROR),
            y_name: Some("error (%)".into()),
            ..frame
        };
        let mut chart = canvas::axes(area, inner(1), &frame)?;
        canvas::curve(&mut chart, &closure, canvas::pen(INK, 2.0))?;
        let place = [inner(1)[2] + 18.0, inner(1)[1] + 12.0];
        canvas::legend(area, place[0], place[1], &[Entry { text: "error of the sum", colour: INK, dashed: false }])?;
        for (k, text) in ["over the largest change", "of potential energy"].into_iter().enumerate() {
            let small = canvas::style(SMALL, HPos::Left, VPos::Center);
            canvas::write(area, text, place[0] + 31.0, place[1] + 18.0 * (k + 1) as f64, small)?;
        }
        Ok(())
    })
}
