//! What is computed for numbers of ranks that this machine does not have.

use super::{Place, Sizes, number, parsed, scene};
use crate::failure::Failure;
use crate::launch;
use serde_json::Value;
use xshell::cmd;

/// Cost of a particle and step of Yang et al.'s code, microseconds: 11.7 10^6 particles for 140 000 steps on 512 cores in 12 to 24 h.
pub const YANGS_COST: f64 = 18.0;

/// A partition that is looked at closely.
#[derive(Clone, Debug)]
pub struct Looked {
    pub state: &'static str,
    pub particles: f64,
    /// A row of a plan.
    pub row: Value,
}

/// Efficiencies over numbers of cores, for one size.
#[derive(Clone, Debug)]
pub struct Set {
    pub weak: bool,
    /// Sizes: particles a core, or all.
    pub curves: Vec<Curve>,
}

#[derive(Clone, Debug)]
pub struct Curve {
    pub size: u64,
    pub points: Vec<Point>,
}

/// Some cores.
#[derive(Clone, Debug)]
pub struct Point {
    pub cores: u64,
    pub row: Value,
    /// Relative to the fewest cores of the curve: with this program's cost of a particle, and with Yang et al.'s.
    pub efficiency: f64,
    pub slower: f64,
}

impl Set {
    /// `weak` or `strong`.
    pub fn name(&self) -> &'static str {
        if self.weak { "weak" } else { "strong" }
    }

    /// The name of its picture.
    pub fn picture(&self) -> String {
        format!("scaling-{}.svg", self.name())
    }
}

/// Both of Yang et al.'s tests, predicted. `cost`: of a particle, microseconds.
pub fn predict(place: &Place, sizes: &Sizes, cost: f64) -> Result<Vec<Set>, Failure> {
    let options = [
        "--cost".to_owned(),
        cost.to_string(),
        "--beside".to_owned(),
        YANGS_COST.to_string(),
        "--sample".to_owned(),
        sizes.sample.to_string(),
    ];
    let set = |weak: bool, all: &[u64]| -> Result<Set, Failure> {
        let mut curves = Vec::new();
        for &size in all {
            eprintln!("talus: {} scaling with {size} particles", if weak { "weak" } else { "strong" });
            let rows = match weak {
                true => {
                    let row = |&cores: &u64| -> Result<Value, Failure> {
                        let scene = place.written("planned", &scene(size * cores, 0.1))?;
                        Ok(place.plan(&scene, &[cores], &options)?["rows"][0].take())
                    };
                    sizes.cores.iter().map(row).collect::<Result<Vec<_>, _>>()?
                }
                false => {
                    let scene = place.written("planned", &scene(size, 0.1))?;
                    let plan = place.plan(&scene, &sizes.cores, &options)?;
                    plan["rows"].as_array().cloned().unwrap_or_default()
                }
            };
            curves.push(Curve { size, points: points(&rows, &sizes.cores) });
        }
        Ok(Set { weak, curves })
    };
    Ok(vec![set(true, &sizes.per_core)?, set(false, &sizes.total)?])
}

/// Efficiencies relative to the first: by the time one core needs for one particle and step.
fn points(rows: &[Value], cores: &[u64]) -> Vec<Point> {
    let per_particle = |row: &Value, cores: u64, name: &str| number(row, name) * cores as f64 / number(row, "owned");
    let relative = |row: &Value, cores_here: u64, name: &str| {
        per_particle(&rows[0], cores[0], name) / per_particle(row, cores_here, name)
    };
    let point = |(row, &cores): (&Value, &u64)| Point {
        cores,
        efficiency: relative(row, cores, "seconds-per-step"),
        slower: relative(row, cores, "beside-seconds-per-step"),
        row: row.clone(),
    };
    rows.iter().zip(cores).map(point).collect()
}

/// Partitions of the column as it starts, spreads and lies, with all their particles.
pub fn partitions(place: &Place, sizes: &Sizes) -> Result<Vec<Looked>, Failure> {
    let mut looked = Vec::new();
    for (particles, ranks) in &sizes.partitions {
        let scene = place.written("partition", &scene(*particles, 0.1))?;
        for state in ["start", "spreading", "deposit"] {
            eprintln!("talus: partitions of {particles} particles, {state}");
            let plan = place.plan(&scene, ranks, &["--state".to_owned(), state.to_owned()])?;
            for row in plan["rows"].as_array().into_iter().flatten() {
                looked.push(Looked { state, particles: number(&plan, "particles"), row: row.clone() });
            }
        }
    }
    Ok(looked)
}

/// Yang et al.'s stress case of the migration, really on few ranks and counted for many.
pub fn migration(place: &Place, sizes: &Sizes) -> Result<Vec<Value>, Failure> {
    let (sph_run, here) = (place.programs.path("sph-run"), place.work);
    let particles = sizes.migrants.to_string();
    let mut all = Vec::new();
    for &ranks in &sizes.migrating {
        eprintln!("talus: migration of {particles} particles on {ranks} ranks");
        let command = launch::parallel(&place.shell, &sph_run, ranks).arg(here).args(["--migration", &particles]);
        all.push(parsed(&command.quiet().read()?)?);
    }
    let ranks = sizes.migrating_virtually.to_string();
    let words = ["--plan", "--migration", &particles, "--ranks", &ranks];
    let said = cmd!(place.shell, "{sph_run} {here} {words...}").quiet().read()?;
    all.push(parsed(&said)?);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn efficiency_is_relative_to_the_fewest_cores() {
        let row = |owned: u64, seconds: f64| json!({"owned": owned, "seconds-per-step": seconds, "beside-seconds-per-step": 1.0});
        // Twice the cores for the same particles: ideal would be half the time.
        let strong = points(&[row(1000, 1.0), row(1000, 0.625)], &[32, 64]);
        assert_eq!((strong[0].efficiency, strong[1].efficiency, strong[1].slower), (1.0, 0.8, 0.5));
        let weak = points(&[row(1000, 1.0), row(2000, 1.25)], &[32, 64]);
        assert_eq!((weak[1].efficiency, weak[1].slower), (0.8, 1.0));
    }
}
