//! Numbers of a finished run: from `post/summary.json` and `post/profile_final.csv`, which `sph-post` writes.

use super::{checks::Validation, record::Record};
use crate::failure::Failure;
use formats::folder::RunFolder;
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// What is measured.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// (r - r0)/r0, with r the radius that holds 99.5 % of the mass. It follows single grains that left the deposit.
    Runout,
    /// (r - r0)/r0, with r up to which the deposit is at least dx/2 thick.
    RunoutThickness,
    /// r/r0, with r up to which the deposit is at least dx/2 thick.
    Front,
    /// Final height over r0.
    Height,
    /// Volume over the volume at the start.
    VolumeRatio,
    /// Force on the floor over the weight.
    BasalForce,
    /// sqrt(sum (h - h_e)^2/sum h_e^2) over the points of the free surface in the validation's reference.csv.
    ProfileDistance,
    /// Place where the final profile sinks below 3 mm, m.
    ProfileFront,
}

impl Measure {
    /// For tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::Runout => "run-out (99.5 % of mass)",
            Self::RunoutThickness => "run-out (thickness)",
            Self::Front => "front/r0 (thickness)",
            Self::Height => "height/r0",
            Self::VolumeRatio => "volume ratio",
            Self::BasalForce => "basal force/weight",
            Self::ProfileDistance => "profile distance Pd",
            Self::ProfileFront => "front at h = 3 mm [m]",
        }
    }
}

/// A finished run.
#[derive(Debug)]
pub struct Run {
    /// Run folder.
    pub folder: PathBuf,
    /// Initial spacing of the particles, m.
    pub spacing: f64,
    /// Which sources computed it, when, and from which scene.
    pub record: Record,
}

/// Final thickness over the distance from the origin.
#[derive(Debug, PartialEq)]
pub struct Profile(Vec<[f64; 2]>);

const FRONT_THICKNESS: f64 = 0.003;

/// The number of a run; failures name the file and what is missing in it.
pub fn measure(measure: Measure, run: &Run, validation: &Validation) -> Result<f64, Failure> {
    let post = RunFolder::new(&run.folder).post();
    let profile = || Profile::read(&post.join("profile_final.csv"), None);
    match measure {
        Measure::Runout => number(&post, "runout_mass_99_5"),
        Measure::RunoutThickness => number(&post, "runout_thickness"),
        Measure::Front => Ok(number(&post, "final_front_thickness_m")? / number(&post, "r0_m")?),
        Measure::Height => Ok(number(&post, "final_height_m")? / number(&post, "r0_m")?),
        Measure::VolumeRatio => number(&post, "volume_ratio"),
        Measure::BasalForce => number(&post, "basal_force_over_weight"),
        Measure::ProfileDistance => {
            let reference = Profile::read(&validation.folder.join("reference.csv"), Some("free_surface"))?;
            Ok(profile()?.distance(&reference))
        }
        Measure::ProfileFront => Ok(profile()?.front(FRONT_THICKNESS)),
    }
}

fn number(post: &Path, key: &str) -> Result<f64, Failure> {
    let path = post.join("summary.json");
    let missing =
        || Failure::no_input(format!("{}: `{key}` is not a number there", crate::paths::short(&path).display()));
    summary(post)?.get(key).and_then(Value::as_f64).ok_or_else(missing)
}

/// `post/summary.json`: null where the scene has no meaning for a number.
pub fn summary(post: &Path) -> Result<Value, Failure> {
    let path = post.join("summary.json");
    let fault = |e: String| Failure::no_input(format!("{}: {e}", crate::paths::short(&path).display()));
    let text = std::fs::read_to_string(&path).map_err(|e| fault(e.to_string()))?;
    serde_json::from_str(&text).map_err(|e| fault(e.to_string()))
}

/// What a table shows of every run, judged or not; none where the scene has no meaning for it.
#[derive(Debug, Default)]
pub struct Overview {
    /// (r - r0)/r0 with r the furthest particle, the radius of 99.5 % of the mass, and that of thickness dx/2.
    pub runouts: [Option<f64>; 3],
    /// Final height over r0.
    pub height: Option<f64>,
    /// Volume over the volume at the initial density.
    pub volume_ratio: Option<f64>,
    /// Force on the floor over the weight.
    pub basal_force: Option<f64>,
    /// How far the front of 99.5 % of the mass moved during the last T = sqrt(H0/g), over r0.
    pub front_last: Option<f64>,
    /// Final kinetic energy over its largest.
    pub kinetic_over_peak: Option<f64>,
    /// Material particles.
    pub particles: Option<u64>,
    /// Particles across the radius or length of the column.
    pub resolution: Option<f64>,
}

/// Reads the overview of a run.
pub fn overview(run: &Run) -> Result<Overview, Failure> {
    let summary = summary(&RunFolder::new(&run.folder).post())?;
    Ok(overview_of(&summary, run.spacing))
}

fn overview_of(summary: &Value, spacing: f64) -> Overview {
    let number = |key: &str| summary.get(key).and_then(Value::as_f64);
    let over_r0 = |length: f64| number("r0_m").map(|r0| length / r0);
    Overview {
        runouts: ["runout_furthest", "runout_mass_99_5", "runout_thickness"].map(number),
        height: number("final_height_m").and_then(over_r0),
        volume_ratio: number("volume_ratio"),
        basal_force: number("basal_force_over_weight"),
        front_last: number("front_mass_last_T"),
        kinetic_over_peak: number("kinetic_over_peak"),
        particles: summary.get("particles").and_then(Value::as_u64),
        resolution: number("r0_m").map(|r0| r0 / spacing),
    }
}

impl Profile {
    /// Reads a CSV file of `x,h` lines, or of `curve,x,h` lines of which one curve is taken.
    /// Lines that start with `#` are remarks, the first other line is the heading.
    pub fn read(path: &Path, curve: Option<&str>) -> Result<Self, Failure> {
        let fault = |e: String| Failure::no_input(format!("{}: {e}", crate::paths::short(path).display()));
        let text = std::fs::read_to_string(path).map_err(|e| fault(e.to_string()))?;
        Self::parse(&text, curve).map_err(fault)
    }

    fn parse(text: &str, curve: Option<&str>) -> Result<Self, String> {
        let mut points = Vec::new();
        let lines = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#') && !line.trim().is_empty());
        for (index, line) in lines.skip(1) {
            let numbers = match (curve, line.split_once(',')) {
                (Some(curve), Some((name, numbers))) if name.trim() == curve => numbers,
                (Some(_), Some(_)) => continue,
                _ => line,
            };
            let mut cells = numbers.split(',').map(|cell| cell.trim().parse::<f64>());
            match (cells.next(), cells.next()) {
                (Some(Ok(x)), Some(Ok(h))) => points.push([x, h]),
                _ => return Err(format!("line {}: two numbers expected, found `{numbers}`", index + 1)),
            }
        }
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        match points.is_empty() {
            true => Err("no points".into()),
            false => Ok(Self(points)),
        }
    }

    /// Thickness at x, m: linear between points, the first one's before it, zero beyond the last.
    /// Bins without material (not-a-number) count as zero.
    pub fn at(&self, x: f64) -> f64 {
        let thickness = |i: usize| if self.0[i][1].is_nan() { 0.0 } else { self.0[i][1] };
        let right = self.0.partition_point(|point| point[0] < x);
        if right == 0 {
            return thickness(0);
        }
        if right == self.0.len() {
            return 0.0;
        }
        let [left, here] = [self.0[right - 1][0], self.0[right][0]];
        let share = (x - left) / (here - left);
        (1.0 - share) * thickness(right - 1) + share * thickness(right)
    }

    /// Pd of Bui et al.'s profiles: distance to a measured surface, relative to it.
    pub fn distance(&self, reference: &Self) -> f64 {
        let (mut above, mut below) = (0.0, 0.0);
        for &[x, h] in &reference.0 {
            above += (self.at(x) - h).powi(2);
            below += h * h;
        }
        (above / below).sqrt()
    }

    /// All lengths times `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        Self(self.0.into_iter().map(|point| point.map(|length| factor * length)).collect())
    }

    /// Furthest place, m, up to which the layer from the origin on is at least `thickness` thick.
    fn front(&self, thickness: f64) -> f64 {
        let thin = self.0.iter().position(|point| point[1].is_nan() || point[1] < thickness);
        match thin {
            Some(0) => self.0[0][0],
            Some(i) => {
                let ([x0, h0], x1, h1) = (self.0[i - 1], self.0[i][0], self.at(self.0[i][0]));
                x0 + (h0 - thickness) / (h0 - h1) * (x1 - x0)
            }
            None => self.0[self.0.len() - 1][0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_against_itself_and_twice_itself() {
        let text = "# source\ncurve,x_m,y_m\na,0,0.1\na,0.2,0.05\nb,0.1,9\na,0.4,0.0\n";
        let reference = Profile::parse(text, Some("a")).unwrap();
        assert_eq!(reference.0.len(), 3);
        assert_eq!(reference.distance(&reference), 0.0);
        let twice = Profile::parse("x_m,h_m\n0,0.2\n0.2,0.1\n0.4,0\n", None).unwrap();
        assert!((twice.distance(&reference) - 1.0).abs() < 1e-12);
        assert!((reference.front(0.025) - 0.3).abs() < 1e-12);
        assert!((reference.at(0.1) - 0.075).abs() < 1e-12 && reference.at(0.5) == 0.0 && reference.at(-1.0) == 0.1);
        assert_eq!(Profile::parse("x,h\n0,0.1\n1,NaN\n", None).unwrap().front(0.1), 0.0);
        assert!(Profile::parse("x,h\n0;1\n", None).unwrap_err().contains("line 2"));
        assert!(Profile::parse("x,h\n", None).is_err());
    }

    #[test]
    fn what_a_summary_has_not_is_left_open() {
        let text = r#"{"r0_m": 0.1, "final_height_m": 0.05, "runout_thickness": 1.2, "front_mass_last_T": null}"#;
        let shown = overview_of(&serde_json::from_str(text).unwrap(), 0.004);
        assert_eq!((shown.height, shown.resolution), (Some(0.5), Some(25.0)));
        assert_eq!(shown.runouts, [None, None, Some(1.2)]);
        assert_eq!((shown.front_last, shown.kinetic_over_peak, shown.particles), (None, None, None));
    }

    #[test]
    fn the_bars_reference_has_its_front_where_its_header_says() {
        let path = crate::paths::validation().join("bars-bui/reference.csv");
        let bars = Profile::read(&path, Some("free_surface")).unwrap();
        let front = bars.front(FRONT_THICKNESS);
        assert!((front - 0.41).abs() < 0.01, "{front}");
        assert_eq!(bars.0.len(), 27);
    }
}
