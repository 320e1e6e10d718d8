//! `scaling`: Yang et al.'s tests of their parallel scheme (2020, sections 3.2 to 3.6) on a machine of few cores. Real runs
//! on more ranks than cores show whether the bits stay and how much processor time many ranks take beyond one;
//! the partitions of up to 4096 ranks are computed for real by `sph-run --plan`, and times predicted from them.

mod page;
mod picture;
mod planned;
mod runs;

use crate::bench::page::Heading;
use crate::bench::{folder, programs, write};
use crate::stage::Programs;
use crate::{failure::Failure, launch, paths};
use serde_json::Value;
use std::path::{Path, PathBuf};
use xshell::{Shell, cmd};

/// What is measured.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Numbers of ranks of the real runs, the first of which the others are held against; with 64 it takes minutes more.
    #[arg(long, value_name = "N,..", value_delimiter = ',', default_values_t = [1, 2, 4, 8, 16])]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=256))]
    ranks: Vec<u32>,
    /// Small and few: shows in seconds that everything works. The page goes into the work folder.
    #[arg(long)]
    quick: bool,
    /// Measure the programs in this folder instead of building them.
    #[arg(long, value_name = "DIR")]
    programs: Option<PathBuf>,
    /// Work folder; runs/bench/scaling where it is left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// How large everything is.
#[derive(Clone, Debug)]
struct Sizes {
    /// Particles of the strong test that is really run, and of each rank in the weak one.
    strong: u64,
    weak: u64,
    steps: u64,
    /// Cores of the predictions, the first for reference; particles of each, and of all.
    cores: Vec<u64>,
    per_core: Vec<u64>,
    total: Vec<u64>,
    /// Places in a prediction; of larger cases a sample.
    sample: u64,
    /// Partitions that are looked at closely: particles and ranks.
    partitions: Vec<(u64, Vec<u64>)>,
    /// Ranks on which particles really migrate, those counted for, and how many particles.
    migrating: Vec<u32>,
    migrating_virtually: u64,
    migrants: u64,
}

impl Sizes {
    fn new(quick: bool) -> Self {
        if quick {
            return Self {
                strong: 1728,
                weak: 512,
                steps: 10,
                cores: vec![8, 16],
                per_core: vec![500],
                total: vec![8000],
                sample: 4000,
                partitions: vec![(4096, vec![8])],
                migrating: vec![2],
                migrating_virtually: 16,
                migrants: 2000,
            };
        }
        let million = 1_000_000;
        Self {
            strong: 64_000,
            weak: 8000,
            steps: 40,
            cores: vec![32, 64, 128, 256, 512, 1024],
            per_core: vec![125_000, 250_000, 500_000],
            total: vec![8 * million, 16 * million, 32 * million],
            sample: 2 * million,
            partitions: vec![(8 * million, vec![64, 1024]), (32 * million, vec![256, 4096])],
            migrating: vec![4, 16, 64],
            migrating_virtually: 1024,
            migrants: million,
        }
    }
}

/// The scene of Yang et al.'s tests, about as many particles, ending at a time: 0.2 x 0.05 x 0.1 m between a wall behind it
/// and two beside it, on a rough floor. The spacing fits whole cells into each side.
fn scene(particles: u64, end: f64) -> String {
    let spacing = 0.05 / cells(particles) as f64;
    let wall = |name: &str, axis: &str, at: f64, side: &str, slip: &str| {
        format!("[wall.{name}]\naxis = \"{axis}\"\nat = \"{at} m\"\nside = \"{side}\"\nslip = \"{slip}\"\n")
    };
    format!(
        "title = \"Quasi-2D column collapse of the scaling tests\"\nspace = \"3d\"\nspacing = \"{spacing:?} m\"\n\
         [material.drucker-prager]\ndensity = \"2600 kg/m3\"\nyoung = \"5.98 MPa\"\npoisson = 0.3\n\
         friction = \"30 deg\"\ncohesion = \"0 Pa\"\n[body.column]\n\
         box = {{ min = [0, 0, 0], max = [\"0.2 m\", \"0.05 m\", \"0.1 m\"] }}\n{}{}{}{}\
         [end]\ntime = \"{end:?} s\"\n[output]\nsnapshots = \"{:?} s\"\nhistory = \"{:?} s\"\n",
        wall("floor", "z", 0.0, "above", "no-slip"),
        wall("back", "x", 0.0, "above", "free-slip"),
        wall("near", "y", 0.0, "above", "free-slip"),
        wall("far", "y", 0.05, "below", "free-slip"),
        end / 2.0,
        end / 2.0,
    )
}

/// Cells across the narrow side, of about so many particles: 4 n x n x 2 n.
fn cells(particles: u64) -> u64 {
    (particles as f64 / 8.0).cbrt().round().max(1.0) as u64
}

/// Measures, predicts, and writes the page.
pub fn carry_out(options: &Options) -> Result<(), Failure> {
    let programs = programs(options.programs.as_deref())?;
    let work = match &options.out {
        Some(folder) => paths::from_caller(folder),
        None => paths::runs().join("bench").join("scaling"),
    };
    std::fs::create_dir_all(&work).map_err(|e| Failure::cannot_write(format!("{}: {e}", work.display())))?;
    let (sizes, heading) = (Sizes::new(options.quick), Heading::of(words(options))?);
    let place = Place { programs: &programs, shell: launch::shell()?, work: &work };
    let mut ranks = options.ranks.clone();
    if options.quick {
        ranks.retain(|&ranks| ranks <= 2);
    }
    if ranks.is_empty() {
        return Err(Failure::usage("--quick runs on 1 and 2 ranks: --ranks has neither"));
    }
    let migrated = planned::migration(&place, &sizes)?;
    let real = runs::measure(&place, &sizes, &ranks)?;
    let partitions = planned::partitions(&place, &sizes)?;
    let predicted = planned::predict(&place, &sizes, real.cost)?;
    let folder = if options.quick { work.clone() } else { folder() };
    for set in &predicted {
        write(&folder.join(set.picture()), &picture::efficiency(set))?;
    }
    let text = page::scaling(&page::Page {
        heading: &heading,
        real: &real,
        partitions: &partitions,
        predicted: &predicted,
        migrated: &migrated,
        quick: options.quick,
    });
    let page = write(&folder.join("scaling.md"), &text)?;
    println!("{}", paths::short(&page).display());
    Ok(())
}

/// The words that measure the same again.
fn words(options: &Options) -> String {
    let ranks: Vec<String> = options.ranks.iter().map(u32::to_string).collect();
    let mut words = format!("./talus scaling --ranks {}", ranks.join(","));
    if options.quick {
        words += " --quick";
    }
    words
}

/// What measures, and where.
struct Place<'a> {
    programs: &'a Programs,
    shell: Shell,
    work: &'a Path,
}

impl Place<'_> {
    /// A scene in the work folder.
    fn written(&self, name: &str, text: &str) -> Result<PathBuf, Failure> {
        let path = self.work.join(format!("{name}.toml"));
        std::fs::write(&path, text).map_err(|e| Failure::cannot_write(format!("{}: {e}", path.display())))?;
        Ok(path)
    }

    /// What `sph-run --plan --json` says of a scene or a run on these numbers of ranks.
    fn plan(&self, path: &Path, ranks: &[u64], options: &[String]) -> Result<Value, Failure> {
        let ranks = ranks.iter().map(u64::to_string).collect::<Vec<_>>().join(",");
        let sph_run = self.programs.path("sph-run");
        let said = cmd!(self.shell, "{sph_run} --plan {path} --json --ranks {ranks} {options...}").quiet().read()?;
        parsed(&said)
    }
}

fn parsed(said: &str) -> Result<Value, Failure> {
    let fault = |e: serde_json::Error| Failure::no_input(format!("sph-run says what is no JSON ({e}): {said}"));
    serde_json::from_str(said).map_err(fault)
}

/// A number of a JSON object.
fn number(value: &Value, name: &str) -> f64 {
    value[name].as_f64().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::scene::Scene;

    #[test]
    fn scenes_are_sound_and_of_the_size_asked_for() {
        for particles in [512, 1728, 64_000, 125_000, 8_000_000, 512_000_000] {
            let scene = Scene::read("scaling.toml", &scene(particles, 0.01)).unwrap();
            let count = 0.001 / scene.spacing.powi(3);
            assert!((count / particles as f64 - 1.0).abs() < 0.1, "{count} of {particles}");
            assert_eq!(scene.walls.len(), 4);
        }
    }
}
