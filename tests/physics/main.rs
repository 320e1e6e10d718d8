//! What the programs compute, against closed forms: scenes as users write them, run by the real binaries.

mod collapse;
mod columns;
mod films;
mod flows;
mod fluids;
mod impacts;
mod obstacles;
mod precision;
mod rest;
mod slopes;
mod stepping;
mod terrain;
mod walls;

use formats::folder::RunFolder;
use formats::snapshot::{self, Header, Rows};

/// Viscosity and density as Yang et al. (2020) have them, with the steps of material that does not come apart: for what is held against
/// numbers that the little viscosity and the gate of dry sand blur.
const AS_YANG: &str = "viscosity = 0.1\ndensity-gate = 0\ncourant = 1";

/// A scene of one body; the standard material is that of Yang et al. 2020, Table 1.
#[derive(Clone, Debug)]
struct Scene {
    space: &'static str,
    spacing: f64,
    symmetry: &'static str,
    density: f64,
    young: f64,
    poisson: f64,
    cohesion: f64,
    body: &'static str,
    walls: String,
    numerics: &'static str,
    end: f64,
    history: f64,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            space: "plane-strain",
            spacing: 0.01,
            symmetry: "[]",
            density: 2600.0,
            young: 5.98e6,
            poisson: 0.3,
            cohesion: 0.0,
            body: "",
            walls: String::new(),
            numerics: "",
            end: 1.0,
            history: 0.01,
        }
    }
}

impl Scene {
    /// As a user would write it.
    fn text(&self) -> String {
        let Self { space, spacing, symmetry, density, young, poisson, cohesion, body, walls, numerics, end, history } =
            self;
        format!(
            "space = \"{space}\"\nspacing = {spacing}\nsymmetry = {symmetry}\n\
             [material.drucker-prager]\ndensity = {density}\nyoung = {young}\npoisson = {poisson}\n\
             friction = \"30 deg\"\ncohesion = {cohesion}\n\
             [body.column]\n{body}\n{walls}[numerics]\n{numerics}\n\
             [end]\ntime = {end}\n[output]\nsnapshots = {end}\nhistory = {history}\n"
        )
    }
}

/// A wall as a scene has it.
fn wall(name: &str, axis: &str, at: f64, side: &str, slip: &str) -> String {
    format!("[wall.{name}]\naxis = \"{axis}\"\nat = {at}\nside = \"{side}\"\nslip = \"{slip}\"\n")
}

/// Header and rows of the last snapshot of a run.
fn last(folder: &RunFolder) -> (Header, Rows) {
    let (name, _) = tests::digests(folder).pop().expect("a run leaves snapshots");
    snapshot::read(&folder.out().join(name)).expect("a snapshot can be read")
}

/// A column of a run's history, by its name without the unit.
fn history(folder: &RunFolder, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(folder.history()).expect("a run has a history");
    let mut lines = text.lines();
    let head = lines.next().expect("the history has a head");
    let column = head.split(',').position(|cell| cell.split(' ').next() == Some(name)).expect("a column of that name");
    let cell = |line: &str| line.split(',').nth(column).and_then(|cell| cell.parse().ok());
    lines.map(|line| cell(line).expect("a number in every line")).collect()
}
