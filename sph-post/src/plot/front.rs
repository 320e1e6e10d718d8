//! How the front goes: where it is, and how fast.

use super::canvas::{self, CURVES, Entry, Frame, MARGIN, SMALL};
use super::{Times, law, title};
use crate::{analysis::Analysis, failure::Failure};
use plotters::style::{
    RGBColor,
    text_anchor::{HPos, VPos},
};
use std::path::{Path, PathBuf};

/// Size of the part inside each pair of axes, pixels.
const INNER: [[f64; 2]; 2] = [[560.0, 280.0], [560.0, 150.0]];

/// Speeds are differences over this part of what is shown: shorter ones show the spacing of the particles.
const PART: f64 = 1.0 / 40.0;

/// A curve over time.
type Points = Vec<(f64, f64)>;

/// Draws `front.svg`, `.png` and `.pdf`; nothing with a single snapshot and no history, nor where
/// material that leaves on one side comes in on the other.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let times = Times::of(a);
    let from_snapshots = |pick: &dyn Fn(&crate::deposit::Fronts) -> f64| -> Points {
        a.moments.iter().map(|m| (m.time, pick(&m.deposit.fronts))).collect()
    };
    // The history is finer, and counts the front in the same way where profiles do.
    let finer = |name: &str, pick: &dyn Fn(&crate::deposit::Fronts) -> f64| -> Points {
        let column = a.history.as_ref().and_then(|h| Some((h.times(), h.column(name)?)));
        column.map_or_else(|| from_snapshots(pick), |(t, x)| t.iter().copied().zip(x.iter().copied()).collect())
    };
    let mass = finer("front_mass_99_5", &|f| f.mass);
    let fronts: [(&str, RGBColor, Points); 3] = [
        ("true: furthest particle", CURVES[1], from_snapshots(&|f| f.furthest)),
        ("99.5 % of the mass", CURVES[2], mass.clone()),
        ("effective: thickness \u{2265} dx/2", CURVES[0], from_snapshots(&|f| f.thickness)),
    ];
    let last = mass.last().map_or(0.0, |p| p.0).max(a.last().time);
    if last <= 0.0 || mass.len() < 2 || a.scene.periodic[0].is_some() {
        return Ok(Vec::new());
    }
    let scaled = a.geometry.runs_outward;
    let value = |front: f64| if scaled { a.scaled(front) } else { front };
    let law = law(a).and_then(|l| Some((l.run_out?, format!("final, {}", l.source))));
    let wave = a.geometry.time_scale().map(|t| a.geometry.height / t);
    let speeds: Points =
        speeds(&mass, PART * last).into_iter().map(|(t, v)| (t / times.unit, v / wave.unwrap_or(1.0))).collect();
    let name = match (scaled, a.geometry.radial) {
        (true, true) => "(r \u{2212} r\u{2080}) / r\u{2080}",
        (true, false) => "(x \u{2212} L\u{2080}) / L\u{2080}",
        (false, true) => "r (m)",
        (false, false) => "x (m)",
    };
    let left = MARGIN[0] + 8.0;
    let tops = [56.0, 56.0 + INNER[0][1] + MARGIN[1] + 22.0];
    let paper = [(left + INNER[0][0] + 250.0) as i32, (tops[1] + INNER[1][1] + MARGIN[1] + 8.0) as i32];
    let inner = |k: usize| [left, tops[k], left + INNER[k][0], tops[k] + INNER[k][1]];
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let [low, high] = values.filter(|v| v.is_finite()).fold([0.0_f64, 1e-9], |r, v| [r[0].min(v), r[1].max(v)]);
        [low * 1.06, high * 1.06]
    };
    canvas::save(folder, "front", paper, |area| {
        let what = if scaled { "front and run-out" } else { "front" };
        canvas::headline(area, &title(a, what))?;
        canvas::write(area, &times.explained, 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        let points = fronts.iter().flat_map(|f| &f.2).map(|p| value(p.1));
        let mut frame = Frame {
            x: [0.0, last / times.unit],
            y: range(&mut points.chain(law.iter().map(|l| l.0))),
            x_name: Some(times.text.clone()),
            y_name: Some(name.into()),
        };
        let mut chart = canvas::axes(area, inner(0), &frame)?;
        let mut entries = Vec::new();
        for (text, colour, points) in &fronts {
            let points: Points = points.iter().map(|p| (p.0 / times.unit, value(p.1))).collect();
            canvas::curve(&mut chart, &points, canvas::pen(*colour, 2.0))?;
            entries.push(Entry { text, colour: *colour, dashed: false });
        }
        if let Some((run_out, source)) = &law {
            let grey = RGBColor(90, 90, 90);
            canvas::dashed(&mut chart, (0.0, *run_out), (frame.x[1], *run_out), grey)?;
            entries.push(Entry { text: source, colour: grey, dashed: true });
        }
        canvas::legend(area, inner(0)[2] + 18.0, inner(0)[1] + 12.0, &entries)?;
        frame.y = range(&mut speeds.iter().map(|p| p.1));
        frame.y_name = Some(if wave.is_some() { "speed / \u{221a}(gH\u{2080})" } else { "speed (m/s)" }.into());
        let mut chart = canvas::axes(area, inner(1), &frame)?;
        canvas::curve(&mut chart, &speeds, canvas::pen(CURVES[2], 2.0))?;
        let entry = Entry { text: "speed of the 99.5 % front", colour: CURVES[2], dashed: false };
        canvas::legend(area, inner(1)[2] + 18.0, inner(1)[1] + 12.0, &[entry])
    })
}

/// Differences of a curve whose times ascend, over at least `period`.
fn speeds(points: &[(f64, f64)], period: f64) -> Points {
    let mut out = Vec::new();
    let mut before = 0;
    for k in 1..points.len() {
        while before + 1 < k && points[k].0 - points[before + 1].0 >= period {
            before += 1;
        }
        let (a, b) = (points[before], points[k]);
        if b.0 - a.0 >= period * (1.0 - 1e-9) || k + 1 == points.len() {
            out.push((0.5 * (a.0 + b.0), (b.1 - a.1) / (b.0 - a.0)));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_of_a_falling_body() {
        let points: Points = (0..=100).map(|k| (f64::from(k) * 0.01, 5.0 * (f64::from(k) * 0.01).powi(2))).collect();
        let found = speeds(&points, 0.05);
        assert!(found.len() > 90 && found.iter().all(|(t, v)| (v - 10.0 * t).abs() < 1e-9), "{found:?}");
        assert_eq!(speeds(&[(0.0, 1.0), (2.0, 5.0)], 0.1), [(1.0, 2.0)]);
    }
}
