//! Run-out and energies over time.

use super::canvas::{self, CURVES, Entry, Frame, MARGIN, SMALL};
use super::{Times, law, title};
use crate::{analysis::Analysis, failure::Failure};
use formats::space::Space;
use plotters::style::{
    RGBColor,
    text_anchor::{HPos, VPos},
};
use std::path::{Path, PathBuf};

/// Size of the part inside each pair of axes, pixels.
const INNER: [f64; 2] = [560.0, 230.0];

/// A curve and its name.
type Curve = (&'static str, Vec<(f64, f64)>);

/// Draws `time-series.svg` and `.png`.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let times = Times::of(a);
    let (fronts, fronts_name) = fronts(a, times.unit);
    let (energies, energies_name) = energies(a, times.unit);
    let law = law(a);
    let reference = law.and_then(|l| l.run_out);
    let known = law.map_or(String::new(), |l| format!("final, {}", l.source));
    // A history may be ahead of the snapshots, while the run goes on.
    let ends = [Some(a.last().time), a.history.as_ref().and_then(|h| h.times().last().copied())];
    let last = (ends.into_iter().flatten().fold(0.0, f64::max) / times.unit).max(1e-9);
    let left = MARGIN[0] + 8.0;
    let tops = [56.0, 56.0 + INNER[1] + MARGIN[1] + 22.0];
    let paper = [(left + INNER[0] + 250.0) as i32, (tops[1] + INNER[1] + MARGIN[1] + 8.0) as i32];
    canvas::save(folder, "time-series", paper, |area| {
        canvas::headline(area, &title(a, "run-out and energies"))?;
        canvas::write(area, &times.explained, 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        for (k, (curves, name)) in [(&fronts, &fronts_name), (&energies, &energies_name)].into_iter().enumerate() {
            let reference = reference.filter(|_| k == 0);
            let values = curves.iter().flat_map(|c| &c.1).map(|p| p.1).filter(|v| v.is_finite()).chain(reference);
            let (low, high) = values.fold((0.0_f64, 1e-9_f64), |(l, h), v| (l.min(v), h.max(v)));
            let frame = Frame {
                x: [0.0, last],
                y: [low * 1.06, high * 1.06],
                x_name: Some(times.text.clone()),
                y_name: Some(name.clone()),
            };
            let inner = [left, tops[k], left + INNER[0], tops[k] + INNER[1]];
            let mut chart = canvas::axes(area, inner, &frame)?;
            let mut entries = Vec::new();
            for ((text, points), colour) in curves.iter().zip(CURVES) {
                canvas::curve(&mut chart, points, canvas::pen(colour, 2.0))?;
                entries.push(Entry { text, colour, dashed: false });
            }
            if let Some(run_out) = reference {
                let grey = RGBColor(90, 90, 90);
                canvas::dashed(&mut chart, (0.0, run_out), (last, run_out), grey)?;
                entries.push(Entry { text: &known, colour: grey, dashed: true });
            }
            canvas::legend(area, inner[2] + 18.0, inner[1] + 12.0, &entries)?;
        }
        Ok(())
    })
}

/// The three run-outs, relative to the start where that has a meaning.
fn fronts(a: &Analysis, unit: f64) -> (Vec<Curve>, String) {
    let scaled = a.geometry.runs_outward;
    let value = |front: f64| if scaled { a.scaled(front) } else { front };
    let curve = |pick: &dyn Fn(&crate::deposit::Fronts) -> f64| {
        a.moments.iter().map(|m| (m.time / unit, value(pick(&m.deposit.fronts)))).collect()
    };
    let name = match (scaled, a.geometry.radial) {
        (true, true) => "(r \u{2212} r\u{2080}) / r\u{2080}",
        (true, false) => "(x \u{2212} L\u{2080}) / L\u{2080}",
        (false, true) => "r (m)",
        (false, false) => "x (m)",
    };
    let curves = vec![
        ("true: furthest particle", curve(&|f| f.furthest)),
        ("99.5 % of the mass", curve(&|f| f.mass)),
        ("effective: thickness \u{2265} dx/2", curve(&|f| f.thickness)),
    ];
    (curves, name.into())
}

/// Energies over that of the start, the potential one measured from the floor; from the history where there is one, since it is finer.
fn energies(a: &Analysis, unit: f64) -> (Vec<Curve>, String) {
    let from_history = a.history.as_ref().and_then(|h| {
        let column = |name| h.column(name);
        let parts = [column("kinetic_energy")?, column("potential_energy")?, column("elastic_energy")?];
        Some((0..h.times().len()).map(|k| (h.times()[k], parts.map(|p| p[k]))).collect::<Vec<_>>())
    });
    let mut rows = from_history.unwrap_or_else(|| {
        a.moments.iter().map(|m| (m.time, [m.energy.kinetic, m.energy.potential, m.energy.elastic])).collect()
    });
    rows.iter_mut().for_each(|r| r.1[1] = a.moments[0].energy.above_floor(&a.geometry, r.1[1]));
    let start: f64 = rows.first().map_or(0.0, |r| r.1.iter().sum());
    let joule = if a.geometry.space == Space::PlaneStrain { "energy (J/m)" } else { "energy (J)" };
    let (scale, name) = if start > 0.0 { (start, "energy / energy at the start") } else { (1.0, joule) };
    let curve = |pick: &dyn Fn([f64; 3]) -> f64| rows.iter().map(|r| (r.0 / unit, pick(r.1) / scale)).collect();
    let curves = vec![
        ("kinetic", curve(&|e| e[0])),
        ("potential", curve(&|e| e[1])),
        ("elastic", curve(&|e| e[2])),
        ("dissipated", curve(&|e| start - e.iter().sum::<f64>())),
    ];
    (curves, name.into())
}
