//! Numbers of a finished run beyond `post/summary.json`: what it cost, what its particles say against a closed form, and how far its
//! final profile is from a measured one.

use super::expression;
use crate::{failure::Failure, paths, validate::measure::Profile};
use formats::{folder::RunFolder, outputs::Index, snapshot, snapshot::Rows};
use serde::Deserialize;
use serde_json::Value as Json;
use std::path::PathBuf;

/// Processor time of the solver: between outputs, without what calls of MPI take, summed over ranks and launches, s.
pub const PROCESSOR: &str = "processor_s";
/// Particles times steps, over all launches.
pub const PARTICLE_STEPS: &str = "particle_steps";
/// Relative distance of the final profile from the measured one.
pub const DISTANCE: &str = "profile_distance";

/// Which of them.
#[derive(Clone, Debug, Default)]
pub struct Numbers {
    /// What the last snapshot says.
    pub fields: Vec<Field>,
    /// A measured profile.
    pub profile: Option<Measured>,
    /// Distances at which the thickness of the deposit is kept, m: `thickness_1` and so on.
    pub stations: Vec<f64>,
    /// Numbers that expressions of fields may name.
    pub constants: Vec<(String, f64)>,
}

/// A number from the particles of the last snapshot.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// Of the measure.
    pub name: String,
    /// Expression of the particle's x, z, u, w, density, stress_xx, stress_yy, stress_zz, stress_xz, and of constants.
    pub of: String,
    /// With it the measure is the root mean square of (of - exact)/over; without it, the mean of `of`.
    pub exact: Option<String>,
    /// One where it is left out.
    pub over: Option<String>,
}

/// A curve of a CSV file `curve,x,h`.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The file.
    pub file: PathBuf,
    /// Its curve.
    pub curve: String,
    /// Times which its lengths are in m.
    pub scale: f64,
}

impl Numbers {
    /// Puts them beside those of the summary. A run without a log has cost nothing that is known.
    pub fn add(&self, folder: &RunFolder, summary: &mut Json) -> Result<(), Failure> {
        if let Ok(log) = std::fs::read_to_string(folder.log().join("phases.csv")) {
            summary[PROCESSOR] = column(&log, "computed [s]").into();
            summary[PARTICLE_STEPS] = column(&log, "particle_steps [1]").into();
        }
        if self.profile.is_some() || !self.stations.is_empty() {
            let profile = Profile::read(&folder.post().join("profile_final.csv"), None)?;
            if let Some(measured) = &self.profile {
                summary[DISTANCE] = profile.distance(&measured.read()?).into();
            }
            for (k, &at) in self.stations.iter().enumerate() {
                summary[station(k)] = profile.at(at).into();
            }
        }
        if !self.fields.is_empty() {
            let rows = last(folder)?;
            for field in &self.fields {
                summary[&field.name] = field.value(&rows, &self.constants).into();
            }
        }
        Ok(())
    }

    /// Names of all of them.
    pub fn names(&self) -> Vec<String> {
        let cost = [PROCESSOR, PARTICLE_STEPS].map(str::to_owned);
        let distance = self.profile.as_ref().map(|_| DISTANCE.to_owned());
        let fields = self.fields.iter().map(|field| field.name.clone());
        cost.into_iter().chain(distance).chain((0..self.stations.len()).map(station)).chain(fields).collect()
    }
}

/// The measure of a station, counted from 0.
pub fn station(k: usize) -> String {
    format!("thickness_{}", k + 1)
}

impl Measured {
    /// The curve, in m.
    pub fn read(&self) -> Result<Profile, Failure> {
        Ok(Profile::read(&self.file, Some(&self.curve))?.scaled(self.scale))
    }
}

impl Field {
    /// Is every name in it known?
    pub fn check(&self, constants: &[(String, f64)]) -> Result<(), String> {
        let known = |name: &str| NAMES.contains(&name).then_some(1.0).or_else(|| constant(constants, name));
        let all = [Some(&self.of), self.exact.as_ref(), self.over.as_ref()];
        all.into_iter().flatten().try_for_each(|text| expression::evaluate(text, &known).map(|_| ()))
    }

    fn value(&self, rows: &Rows, constants: &[(String, f64)]) -> f64 {
        let of = |row: usize, text: &str| {
            let lookup = |name: &str| particle(rows, row, name).or_else(|| constant(constants, name));
            expression::evaluate(text, &lookup).unwrap_or(f64::NAN)
        };
        let n = rows.len() as f64;
        match &self.exact {
            None => (0..rows.len()).map(|row| of(row, &self.of)).sum::<f64>() / n,
            Some(exact) => {
                let over = |row| self.over.as_ref().map_or(1.0, |over| of(row, over));
                let square = |row| ((of(row, &self.of) - of(row, exact)) / over(row)).powi(2);
                ((0..rows.len()).map(square).sum::<f64>() / n).sqrt()
            }
        }
    }
}

const NAMES: [&str; 9] = ["x", "z", "u", "w", "density", "stress_xx", "stress_yy", "stress_zz", "stress_xz"];

fn particle(rows: &Rows, row: usize, name: &str) -> Option<f64> {
    let stress = |k: usize| rows.stress[row][k];
    Some(match name {
        "x" => rows.position[row][0],
        "z" => rows.position[row][2],
        "u" => rows.velocity[row][0],
        "w" => rows.velocity[row][2],
        "density" => rows.density[row],
        "stress_xx" => stress(0),
        "stress_yy" => stress(1),
        "stress_zz" => stress(2),
        "stress_xz" => stress(5),
        _ => return None,
    })
}

fn constant(constants: &[(String, f64)], name: &str) -> Option<f64> {
    constants.iter().find(|(known, _)| known == name).map(|(_, value)| *value)
}

/// The particles of the last snapshot.
fn last(folder: &RunFolder) -> Result<Rows, Failure> {
    let fault = |e: snapshot::FileError| Failure { code: e.exit_code(), message: e.to_string() };
    let index = Index::read(folder).map_err(fault)?.unwrap_or_default();
    let none = || Failure::no_input(format!("{}: no snapshots", paths::short(folder.path()).display()));
    let number = index.snapshots().map(|(number, _)| number).last().ok_or_else(none)?;
    Ok(snapshot::read(&folder.snapshot(number)).map_err(fault)?.1)
}

/// Sum of a column over the launches; not-a-number where there is none of that name.
fn column(log: &str, name: &str) -> f64 {
    let mut lines = log.lines();
    let Some(k) = lines.next().and_then(|head| head.split(',').position(|cell| cell == name)) else { return f64::NAN };
    lines.map(|line| line.split(',').nth(k).and_then(|cell| cell.parse().ok()).unwrap_or(f64::NAN)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_of_every_launch_counts() {
        let log = "step [1],particle_steps [1],computed [s]\n10,100,0.5\n30,200,1.25\n";
        assert_eq!((column(log, "computed [s]"), column(log, "particle_steps [1]")), (1.75, 300.0));
        assert!(column(log, "wall [s]").is_nan() && column("", "x").is_nan());
    }

    #[test]
    fn fields_are_means_or_errors_against_a_closed_form() {
        let rows = Rows {
            id: vec![0, 1],
            position: vec![[0.0, 0.0, 0.2], [0.0, 0.0, 0.4]],
            stress: vec![[-1.0, 0.0, -8.0, 0.0, 0.0, 0.0], [-3.0, 0.0, -5.0, 0.0, 0.0, 0.0]],
            ..Rows::default()
        };
        let constants = [("weight".to_owned(), 10.0)];
        let mut field = Field { name: "s".into(), of: "stress_xx".into(), exact: None, over: None };
        assert_eq!(field.value(&rows, &constants), -2.0);
        field.of = "stress_zz".into();
        field.exact = Some("-weight*(1 - z)".into());
        field.over = Some("weight".into());
        // (0, 0.1)
        assert!((field.value(&rows, &constants) - 0.1 / 2.0_f64.sqrt()).abs() < 1e-12);
        assert!(field.check(&constants).is_ok() && field.check(&[]).unwrap_err().contains("`weight` is not known"));
    }
}
