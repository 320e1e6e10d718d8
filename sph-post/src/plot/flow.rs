//! What stands and what flows, inside the material and over time.

use super::canvas::{self, CURVES, Frame, MARGIN, SMALL, viridis};
use super::panels::{self, Line, Panel, Patch, Picture};
use super::{Times, title};
use crate::{
    analysis::{Analysis, Moment},
    failure::Failure,
};
use plotters::style::{
    RGBColor,
    text_anchor::{HPos, VPos},
};
use std::path::{Path, PathBuf};

/// Size of the part inside the axes of the share over time, pixels.
const INNER: [f64; 2] = [560.0, 230.0];

/// Draws `static.svg`, `static-share.svg` and their `.png`; nothing where no threshold is known.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    if a.static_speed.is_nan() {
        return Ok(Vec::new());
    }
    let mut paths = sections(a, folder)?;
    paths.extend(share(a, folder)?);
    Ok(paths)
}

fn sections(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let g = &a.geometry;
    let colours: [RGBColor; 2] = [viridis(0.12), viridis(0.85)];
    let panel = |k: &usize| {
        let moment: &Moment = &a.moments[*k];
        let section = moment.section.as_ref()?;
        let column = |k: usize, low: f64, high: f64, colour| Patch {
            at: [section.along(g, k), 0.5 * (low + high)],
            half: [0.52 * g.dx, 0.5 * (high - low)],
            colour,
        };
        let still = (0..section.bins).filter(|&k| moment.flow.height[k] > 0.0);
        let flowing = (0..section.bins).filter(|&k| section.height[k] > moment.flow.height[k]);
        let mut patches: Vec<Patch> = still.map(|k| column(k, 0.0, moment.flow.height[k], colours[0])).collect();
        patches.extend(flowing.map(|k| column(k, moment.flow.height[k], section.height[k], colours[1])));
        Some(Panel { moment, patches, lines: Vec::<Line>::new() })
    };
    let picture = Picture {
        name: "static",
        what: "static and flowing material",
        remark: format!("threshold {}", threshold(a)),
        panels: a.sections.iter().filter_map(panel).collect(),
        legend_width: 120.0,
        without_strays: true,
    };
    panels::draw(a, folder, &picture, |area, at, _| {
        canvas::swatches(area, at[0], at[1], &[(colours[1], "flowing".into()), (colours[0], "static".into())])
    })
}

fn share(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let times = Times::of(a);
    let points: Vec<(f64, f64)> = a.moments.iter().map(|m| (m.time / times.unit, m.flow.share)).collect();
    let left = MARGIN[0] + 8.0;
    let inner = [left, 56.0, left + INNER[0], 56.0 + INNER[1]];
    let paper = [(inner[2] + 30.0) as i32, (inner[3] + MARGIN[1] + 8.0) as i32];
    canvas::save(folder, "static-share", paper, |area| {
        canvas::headline(area, &title(a, "static share"))?;
        let below = [format!("slower than {}", threshold(a)), times.explained.clone()];
        let below: Vec<String> = below.into_iter().filter(|t| !t.is_empty()).collect();
        canvas::write(area, &below.join(",  "), 12.0, 30.0, canvas::style(SMALL, HPos::Left, VPos::Top))?;
        let frame = Frame {
            x: [0.0, (a.last().time / times.unit).max(1e-9)],
            y: [0.0, 1.05],
            x_name: Some(times.text.clone()),
            y_name: Some("static volume / volume".into()),
        };
        let mut chart = canvas::axes(area, inner, &frame)?;
        canvas::curve(&mut chart, &points, canvas::pen(CURVES[0], 2.0))
    })
}

/// The threshold, with what it is of sqrt(g H0).
fn threshold(a: &Analysis) -> String {
    let text = format!("{} m/s", canvas::number((a.static_speed * 1e6).round() / 1e6));
    match a.geometry.time_scale().map(|t| a.geometry.height / t) {
        Some(scale) => {
            let percent = canvas::number((a.static_speed / scale * 1e4).round() / 1e2);
            format!("{text} = {percent} % of \u{221a}(gH\u{2080})")
        }
        None => text,
    }
}
