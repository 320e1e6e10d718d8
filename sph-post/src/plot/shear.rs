//! Shear rate and inertial number on the section.

use super::canvas;
use super::panels::{self, Panel, Picture};
use super::stress::cells;
use crate::{
    analysis::{Analysis, Moment},
    failure::Failure,
    section::Section,
    shear::Shear,
};
use std::path::{Path, PathBuf};

/// The scale of shear rates ends where this part of the cells lies below.
const SEEN: f64 = 0.99;

/// Powers of ten of the inertial number that are shown: from creep to the collisional regime.
const POWERS: [f64; 2] = [-4.0, 0.0];

/// Draws `shear-rate` and, where the grains are known, `inertial-number`; nothing where nothing shears.
pub fn draw(a: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let shown: Vec<(&Moment, &Section, &Shear)> = a
        .sections
        .iter()
        .map(|&k| &a.moments[k])
        .filter_map(|m| Some((m, m.section.as_ref()?, m.shear.as_ref()?)))
        .collect();
    let mut paths = rates(a, folder, &shown)?;
    paths.extend(numbers(a, folder, &shown)?);
    Ok(paths)
}

fn rates(a: &Analysis, folder: &Path, shown: &[(&Moment, &Section, &Shear)]) -> Result<Vec<PathBuf>, Failure> {
    let unit = a.geometry.time_scale().unwrap_or(1.0);
    let mut all: Vec<f64> = shown.iter().flat_map(|s| &s.2.rate).copied().filter(|r| r.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let highest = all.get((SEEN * all.len() as f64) as usize).copied().unwrap_or(0.0);
    if highest <= 0.0 {
        return Ok(Vec::new());
    }
    let panels = shown.iter().map(|(moment, section, shear)| {
        let patches = cells(a, section, &shear.rate, |rate| rate / highest);
        Panel { moment, patches, lines: Vec::new() }
    });
    let picture = Picture {
        name: "shear-rate",
        what: "shear rate",
        remark: format!("colours end where {} % of the cells lie below", 100.0 * SEEN),
        panels: panels.collect(),
        legend_width: 150.0,
        without_strays: true,
    };
    let (range, name) = if a.geometry.time_scale().is_some() {
        ([0.0, highest * unit], "shear rate \u{b7} T")
    } else {
        ([0.0, highest], "shear rate (1/s)")
    };
    panels::draw(a, folder, &picture, |area, at, lowest| canvas::colour_bar(area, at[0], [at[1], lowest], range, name))
}

fn numbers(a: &Analysis, folder: &Path, shown: &[(&Moment, &Section, &Shear)]) -> Result<Vec<PathBuf>, Failure> {
    let Some(grains) = a.grains else { return Ok(Vec::new()) };
    let part = |number: f64| (number.max(1e-300).log10() - POWERS[0]) / (POWERS[1] - POWERS[0]);
    let panels = shown.iter().filter_map(|(moment, section, shear)| {
        let patches = cells(a, section, shear.inertial.as_ref()?, part);
        Some(Panel { moment, patches, lines: Vec::new() })
    });
    let picture = Picture {
        name: "inertial-number",
        what: "inertial number",
        remark: format!(
            "grains of {} mm and {} kg/m\u{b3}; nothing where nothing is pressed",
            canvas::number(grains.diameter * 1e3),
            canvas::number(grains.density)
        ),
        panels: panels.collect(),
        legend_width: 150.0,
        without_strays: true,
    };
    panels::draw(a, folder, &picture, |area, at, lowest| {
        canvas::colour_bar(area, at[0], [at[1], lowest], POWERS, "log\u{2081}\u{2080} I")
    })
}
