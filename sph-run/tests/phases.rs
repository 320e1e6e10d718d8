//! The stopwatch of the steps: its phases add up to the loop around them, and each part of a step is in the phase it is
//! meant to be in.

use crate::support::{alone, block};
use formats::scene::Scene;
use sph_run::dispatch::{Job, resolve};
use sph_run::phases::{Phase, Stopwatch, columns};
use sph_run::physics::Physics;
use sph_run::simulation::{Clock, Simulation};
use sph_run::timestep::Requests;
use std::collections::BTreeMap;
use std::time::Instant;

const SIDE: usize = 9;
const STEPS: u64 = 30;

/// Numbers by their columns, and seconds of the loop as seen from outside.
struct Loop<'a>(&'a Scene);

impl Job for Loop<'_> {
    type Output = (BTreeMap<String, f64>, f64);
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) -> Self::Output {
        let (_turn, comm) = alone();
        // Spacing 1, speeds up to 1, stresses far below the modulus.
        let particles = block::<D, N, P::Space>(SIDE, 0.05);
        let count = particles.owned as u64;
        let mut run = Simulation::<D, N, P>::new(&comm, self.0, material, particles, count, Clock::default());
        run.begin();
        let begun = Instant::now();
        run.watch = Stopwatch::start();
        for step in 0..STEPS {
            let mut plan = run.plan(f64::INFINITY, Requests::default()).expect("a sound state");
            plan.lists_go_stale |= step % 10 == 0;
            run.step(&plan);
        }
        let seconds = begun.elapsed().as_secs_f64();
        let line = run.phases_line(0);
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let names: Vec<String> = columns().split(',').map(|name| name.split(' ').next().unwrap().to_owned()).collect();
        assert_eq!(names.len(), cells.len());
        (names.into_iter().zip(cells).collect(), seconds)
    }
}

fn scene(numerics: &str) -> Scene {
    let text = format!(
        "space = \"3d\"\nspacing = 1\ngravity = [0, 0, 0]\n[material.drucker-prager]\ndensity = 1\nyoung = 1e3\n\
         poisson = 0.3\nfriction = 30\ncohesion = 1e3\n[body.block]\nbox = {{ min = [0, 0, 0], max = [9, 9, 9] }}\n\
         [wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n{numerics}\n[end]\ntime = 1e3\n"
    );
    Scene::read("block.toml", &text).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn phases_add_up_to_the_loop() {
    let scene = scene("");
    let (line, seconds) = resolve(&scene, Loop(&scene));
    let phases: f64 = Phase::ALL.iter().map(|phase| line[phase.name()]).sum();
    // To rounding among themselves; nothing lies between the two clocks but a pause of the machine.
    assert!((phases - line["loop"]).abs() < 1e-5, "{phases}: {line:?}");
    assert!((phases / seconds - 1.0).abs() < 0.1, "{phases} of {seconds}: {line:?}");
    let share = |phase: Phase| line[phase.name()] / phases;
    for phase in [Phase::Gradient, Phase::Material, Phase::Acceleration, Phase::Walls, Phase::Lists, Phase::Motion] {
        assert!(share(phase) > 1e-4, "{phase:?}: {line:?}");
    }
    // Nothing was exchanged, switched on or written.
    assert!(share(Phase::Stabilisers) + share(Phase::Output) < 0.02, "{line:?}");
    let count = (SIDE as u64).pow(3);
    assert_eq!((line["steps"], line["particle_steps"], line["ranks"]), (30.0, (STEPS * count) as f64, 1.0));
    // One rank waits for nobody; other programs may have the processor meanwhile.
    assert!(line["computed"] > 0.0 && line["computed"] < 1.01 * line["loop"] + 1e-3, "{line:?}");
    // Inside of a lattice there are 56 within 2.4 spacings; a block of 9 has as much surface as inside.
    assert!((30.0..60.0).contains(&line["neighbours"]), "{line:?}");
    assert!(line["memory_largest"] > 1e6 && line["memory_largest"] == line["memory_sum"], "{line:?}");
}

#[test]
fn stabilisers_are_told_apart() {
    let scene = scene("[numerics]\nstress-diffusion = 0.1\ngradient-correction = \"variational\"\nshifting = 0.1\n");
    let (line, _) = resolve(&scene, Loop(&scene));
    // Two correction tensors, two gradients, the diffusion, two sums of the shifting, beside the two sums of the plain scheme.
    assert!(line["stabilisers"] > 0.5 * (line["gradient"] + line["acceleration"]), "{line:?}");
}
