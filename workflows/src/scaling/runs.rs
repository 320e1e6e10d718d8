//! Real runs on more and more ranks: the same bits, and what the ranks' processors take together.

use super::{Place, Sizes, number, scene};
use crate::bench::launches::Launch;
use crate::failure::Failure;
use crate::stage;
use formats::folder::RunFolder;
use formats::scene::Scene;
use serde_json::Value;
use std::path::PathBuf;

/// A run on some ranks.
#[derive(Clone, Debug)]
pub struct Ran {
    pub ranks: u32,
    pub particles: f64,
    /// Processor time of a particle-step, all ranks together, waiting left out, s.
    pub cost: f64,
    /// Digests of the snapshots and the text of the history.
    pub outputs: Vec<(String, String)>,
    /// What the plan says of the scene on so many ranks.
    pub plan: Value,
}

/// All of them.
#[derive(Clone, Debug)]
pub struct Real {
    pub strong: Vec<Ran>,
    pub weak: Vec<Ran>,
    /// Cost of a particle by the fewest ranks of the strong test, walls and images told apart, microseconds.
    pub cost: f64,
}

impl Ran {
    /// Copies over owned particles.
    pub fn halo_share(&self) -> f64 {
        number(&self.plan["rows"][0], "halo-share")
    }

    /// Processor time over that of one rank, as the plan has it.
    pub fn overhead(&self) -> f64 {
        number(&self.plan["rows"][0], "overhead")
    }
}

/// Runs both tests.
pub fn measure(place: &Place, sizes: &Sizes, ranks: &[u32]) -> Result<Real, Failure> {
    let (mut strong, mut weak) = (Vec::new(), Vec::new());
    for &ranks in ranks {
        strong.push(run(place, &format!("strong-{ranks}"), sizes.strong, sizes.steps, ranks)?);
        weak.push(run(place, &format!("weak-{ranks}"), sizes.weak * u64::from(ranks), sizes.steps, ranks)?);
    }
    let first = place.work.join(format!("strong-{}", ranks[0]));
    let cost = 1e6 * number(&place.plan(&first, &[u64::from(ranks[0])], &[])?, "cost");
    Ok(Real { strong, weak, cost })
}

fn run(place: &Place, name: &str, particles: u64, steps: u64, ranks: u32) -> Result<Ran, Failure> {
    let folder: PathBuf = place.work.join(name);
    let fault = |e: formats::scene::SceneError| Failure::usage(e.to_string());
    let read = Scene::read(name, &scene(particles, 1.0)).map_err(fault)?;
    let end = steps as f64 * read.numerics.courant * read.h() / read.material.sound_speed();
    // As few digits as the history will print.
    let end = format!("{end:.4e}").parse().unwrap_or(end);
    let scene = place.written(name, &scene(particles, end))?;
    let log = place.work.join(format!("{name}.txt"));
    let again = "the same command";
    let job = stage::Job { scene: &scene, folder: &folder, ranks: Some(ranks), fresh: true, again, log: Some(&log) };
    eprintln!("talus: {name}: {particles} particles, {ranks} ranks");
    stage::prepare(place.programs, &job)?;
    let options = ["--quiet", "--checkpoint-every", "1000h"].map(str::to_owned);
    if let Some(end) = stage::advance(place.programs, &job, &options)? {
        stage::passed("sph-run", end, &job)?;
    }
    let (launch, run) = (Launch::read(&folder)?, RunFolder::new(&folder));
    let mut outputs = tests::digests(&run);
    let history = std::fs::read_to_string(run.history());
    outputs.push(("history".into(), history.map_err(|e| Failure::no_input(format!("{name}: {e}")))?));
    let plan = place.plan(&scene, &[u64::from(ranks)], &[])?;
    Ok(Ran {
        ranks,
        particles: launch.particles(),
        cost: launch.of("computed") / launch.of("particle_steps"),
        outputs,
        plan,
    })
}
