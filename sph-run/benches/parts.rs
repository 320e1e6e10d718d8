//! Times of the parts of a step, in one process: `cargo bench -p sph-run`, or `cargo bench -p sph-run -- rebuild` for one of them.
//! Rates of whole runs, on one rank and on several, are measured by `./talus bench speed`.
//!
//! A block rests on a no-slip floor, endless along x and y, so that one rank has copies to exchange: its own.

use criterion::{BatchSize, BenchmarkId, Criterion, SamplingMode, Throughput};
use formats::checkpoint::{self, Generation, Keep};
use formats::folder::RunFolder;
use formats::h5::Communicator;
use formats::scene::Scene;
use formats::snapshot::Rows;
use sph_run::dispatch::{Job, resolve};
use sph_run::parallel::Reduce;
use sph_run::parallel::halo::{Fields, Halo};
use sph_run::parallel::orb::Tree;
use sph_run::particles::Particles;
use sph_run::physics::Physics;
use sph_run::resume::clock_to_json;
use sph_run::simulation::{Clock, Simulation};
use sph_run::space::Space;
use sph_run::timestep::Requests;
use std::hint::black_box;
use std::time::Duration;

/// Particles along an edge: 19 683 and 195 112 in all.
const SIDES: [usize; 2] = [27, 58];
/// Spacing, m, and density, kg/m3.
const DX: f64 = 0.01;
const DENSITY: f64 = 2600.0;
/// Ranks the domain is cut for.
const RANKS: usize = 64;

fn main() {
    // It ends with the process.
    let (universe, _) = mpi::initialize_with_threading(mpi::Threading::Serialized).expect("MPI starts");
    let comm = Communicator::world();
    let mut criterion =
        Criterion::default().sample_size(10).measurement_time(Duration::from_secs(4)).configure_from_args();
    for side in SIDES {
        let text = scene(side);
        let scene = Scene::read("block.toml", &text).unwrap_or_else(|error| panic!("{error}"));
        resolve(&scene, Parts { criterion: &mut criterion, comm: &comm, scene: &scene, text: &text, side });
    }
    criterion.final_summary();
    drop(universe);
}

fn scene(side: usize) -> String {
    let edge = side as f64 * DX;
    let ends = format!("{{ from = 0, to = {edge} }}");
    format!(
        "title = \"Block\"\nspace = \"3d\"\nspacing = {DX}\n[periodic]\nx = {ends}\ny = {ends}\n\
         [material.drucker-prager]\ndensity = {DENSITY}\nyoung = 5.98e6\npoisson = 0.3\nfriction = 30\ncohesion = 0\n\
         [body.block]\nbox = {{ min = [0, 0, 0], max = [{edge}, {edge}, {edge}] }}\n\
         [wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n[end]\ntime = 1\n"
    )
}

/// A lattice, disturbed by up to a tenth of the spacing in a way that is the same on every machine.
fn rows(side: usize) -> Rows {
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let count = side.pow(3);
    let place = |k: usize, a: u32| (k / side.pow(a) % side) as f64 + 0.5;
    let mut at = |k: usize, a: u32| (place(k, a) + 0.1 * random()) * DX;
    Rows {
        first: 0,
        id: (0..count as u64).collect(),
        body: vec![0; count],
        position: (0..count).map(|k| [at(k, 0), at(k, 1), at(k, 2)]).collect(),
        velocity: vec![[0.0; 3]; count],
        acceleration: vec![[0.0; 3]; count],
        mass: vec![DENSITY * DX.powi(3); count],
        density: vec![DENSITY; count],
        stress: vec![[0.0; 6]; count],
        stress_work: vec![0.0; count],
        viscous_work: vec![0.0; count],
        plastic_strain: vec![0.0; count],
    }
}

/// All ranks' particles on one.
struct AllHere;

impl Reduce for AllHere {
    fn size(&self) -> usize {
        RANKS
    }
    fn rank(&self) -> usize {
        0
    }
    fn sum(&self, _: &mut [u64]) {}
    fn min(&self, _: &mut [f64]) {}
    fn max(&self, _: &mut [f64]) {}
}

struct Parts<'a> {
    criterion: &'a mut Criterion,
    comm: &'a Communicator,
    scene: &'a Scene,
    text: &'a str,
    side: usize,
}

impl Job for Parts<'_> {
    type Output = ();
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) {
        let count = self.side.pow(3) as u64;
        let particles = Particles::<D, N>::from_rows::<P::Space>(&rows(self.side));
        let mut run = Simulation::<D, N, P>::new(self.comm, self.scene, material, particles, count, Clock::default());
        run.begin();
        let mut group = self.criterion.benchmark_group("parts");
        group.sampling_mode(SamplingMode::Flat).throughput(Throughput::Elements(count));
        let named = |name: &str| BenchmarkId::new(name, count);

        group.bench_function(named("step"), |bencher| {
            bencher.iter(|| {
                let mut plan = run.plan(f64::INFINITY, Requests::default()).expect("a sound state");
                plan.lists_go_stale = false;
                run.step(&plan);
            });
        });
        group.bench_function(named("rebuild"), |bencher| bencher.iter(|| run.rebuild()));

        let axes = self.scene.space.axes();
        let places: Vec<[f64; 3]> = run.particles.x.iter().map(|&x| P::Space::to_disk(x)).collect();
        let places = &places[..run.particles.owned];
        group.bench_function(named("orb for 64 ranks"), |bencher| {
            bencher.iter(|| black_box(Tree::build(places.iter().copied(), None, axes, &AllHere)));
        });

        let reach = 2.0 * run.parameters.h + run.parameters.skin;
        let mut owned = run.particles.clone();
        owned.own(owned.owned);
        group.bench_function(named("halo plan"), |bencher| {
            let plan = |mut particles: Particles<D, N>| {
                let mut halo = Halo::plan(self.comm, &particles.x, run.periods.shifts(), |_| reach, reach);
                halo.create(self.comm, &mut particles);
                black_box(halo);
                // Freeing it is not measured.
                particles
            };
            bencher.iter_batched(|| owned.clone(), plan, BatchSize::PerIteration);
        });
        group.bench_function(named("halo fill"), |bencher| {
            bencher.iter(|| run.partition.halo.fill(self.comm, &mut run.particles, Fields::Motion));
        });
        group.bench_function(named("halo and walls fill"), |bencher| {
            bencher.iter(|| {
                run.fill(Fields::Motion);
                run.fill(Fields::Stress);
            });
        });

        let work = tempfile::tempdir().expect("a work folder");
        let folder = RunFolder::new(work.path());
        let hash = Scene::hash(self.text);
        group.bench_function(named("checkpoint"), |bencher| {
            bencher.iter(|| {
                let new = Generation {
                    folder: &folder,
                    header: &run.header(self.scene, &hash),
                    rows: &run.rows(),
                    clock: &clock_to_json(&run.clock, false),
                    outputs: None,
                    scene: self.text,
                    job: None,
                    keep: Keep { newest: 1, archive: None },
                    still_ours: &|| Ok(()),
                };
                checkpoint::commit(&new, self.comm).unwrap_or_else(|error| panic!("{error}"))
            });
        });
        group.finish();
    }
}
