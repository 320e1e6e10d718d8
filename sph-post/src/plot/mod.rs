//! Pictures: SVG, PNG and PDF of the same drawing, side by side in `post/`.

mod basal;
mod basal_normalised;
mod canvas;
mod coloured;
mod energies;
mod failure_plane;
mod flow;
mod front;
mod layers;
mod outline;
mod panels;
mod particles;
mod profiles;
mod runout;
mod series;
mod shear;
mod stress;
mod surfaces;
mod terrain;
mod top_view;

use crate::{analysis::Analysis, failure::Failure, geometry::Law};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Draws everything the run has to show, and returns the paths.
///
/// # Errors
/// Where a picture can't be written.
pub fn pictures(analysis: &Analysis, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let all = [
        profiles::draw,
        surfaces::draw,
        front::draw,
        runout::draw,
        series::draw,
        energies::draw,
        particles::draw,
        coloured::draw,
        layers::draw,
        flow::draw,
        failure_plane::draw,
        top_view::draw,
        shear::draw,
        terrain::draw,
        stress::draw,
        basal::draw,
        basal_normalised::draw,
    ];
    // Each by one thread; the paths, and what went wrong first, in this order.
    let drawn: Vec<Result<Vec<PathBuf>, Failure>> = all.par_iter().map(|draw| draw(analysis, folder)).collect();
    Ok(drawn.into_iter().collect::<Result<Vec<_>, _>>()?.concat())
}

/// The law to draw; none where measured curves of the very case are given.
fn law(a: &Analysis) -> Option<Law> {
    a.geometry.law().filter(|_| a.reference.is_none())
}

/// How lengths are shown: over r0 where there is one, else in m.
struct Lengths {
    /// m.
    unit: f64,
    /// What stands behind the name of an axis: `/ r0`, `(m)`.
    text: String,
}

impl Lengths {
    fn of(analysis: &Analysis) -> Self {
        match analysis.geometry.r0() {
            // r0 stands for the radius, L0 for the length of a body that is none.
            Some(r0) if analysis.geometry.radial => Self { unit: r0, text: "/ r\u{2080}".into() },
            Some(r0) => Self { unit: r0, text: "/ L\u{2080}".into() },
            None => Self { unit: 1.0, text: "(m)".into() },
        }
    }

    /// `r0 = 0.1 m`, for titles; nothing where lengths are in m.
    fn explained(&self) -> String {
        match self.text.strip_prefix("/ ") {
            Some(name) => format!("{name} = {} m", canvas::number(self.unit)),
            None => String::new(),
        }
    }
}

/// How times are shown: over T = sqrt(H0/g) where there is one, else in s.
struct Times {
    /// s.
    unit: f64,
    /// Name of the axis.
    text: String,
    /// `T = 0.1 s`, or nothing.
    explained: String,
}

impl Times {
    fn of(analysis: &Analysis) -> Self {
        match analysis.geometry.time_scale() {
            Some(unit) => {
                let explained = format!("T = \u{221a}(H\u{2080}/g) = {} s", canvas::number((unit * 1e5).round() / 1e5));
                Self { unit, text: "t / T".into(), explained }
            }
            None => Self { unit: 1.0, text: "t (s)".into(), explained: String::new() },
        }
    }
}

/// Title of a picture: the scene's, cut where it is too long, and what the picture shows.
fn title(analysis: &Analysis, what: &str) -> String {
    let title = &analysis.scene.title;
    let short: String = title.chars().take(60).collect();
    let dots = if title.chars().count() > 60 { "\u{2026}" } else { "" };
    if title.is_empty() { what.into() } else { format!("{short}{dots}: {what}") }
}
