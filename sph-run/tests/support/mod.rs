//! What tests of the solver share.

// Each test program uses some of it.
#![allow(dead_code)]

pub mod memory;

use formats::h5::Communicator;
use sph_run::algebra::{Sym, Vector};
use sph_run::lanes::{Element, Instructions, Parts};
use sph_run::material::{History, Increment, Material};
use sph_run::neighbors::Neighbors;
use sph_run::parallel::Reduce;
use sph_run::particles::{Particles, key};
use sph_run::physics::Kernel;
use sph_run::rates::momentum::{Stressed, Traction, Viscosity, momentum};
use sph_run::space::Space;
use sph_run::sweep::{Pairs, Precision, weight};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Numbers in [-1, 1), the same on every machine.
pub struct Random(pub u64);
impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    pub fn vector<const D: usize>(&mut self, scale: f64) -> Vector<D> {
        Vector(std::array::from_fn(|_| scale * self.next()))
    }
    pub fn sym<const N: usize>(&mut self, scale: f64) -> Sym<N> {
        Sym(std::array::from_fn(|_| scale * self.next()))
    }
}

/// A block of `side`^D particles with spacing 1, jittered, with random velocities and stresses.
pub fn block<const D: usize, const N: usize, S: Space<D, N>>(side: usize, jitter: f64) -> Particles<D, N> {
    let mut random = Random(7);
    let mut p = Particles::<D, N>::default();
    for k in 0..side.pow(D as u32) {
        let place: Vector<D> = Vector(std::array::from_fn(|a| (k / side.pow(a as u32) % side) as f64 + 0.5));
        p.key.push(key(k as u64, 0));
        p.x.push(place + random.vector(jitter));
        p.v.push(random.vector(1.0));
        p.stress.push(random.sym(1.0));
        p.density.push(1.0 + 0.1 * random.next());
        p.mass.push(S::volume(1.0, 1.0, place, 1.0).recip() * p.density[k]);
        p.a.push(Vector::default());
        p.history.push(Default::default());
        p.work.push(Default::default());
        p.body.push(0);
    }
    let count = p.key.len();
    p.own(count);
    for i in 0..count {
        p.volume[i] = S::volume(p.mass[i], p.density[i], p.x[i], 1.0);
    }
    p
}

/// Pairs of particles with spacing 1, in f64, by the best instructions there are.
pub fn pairs(h: f64) -> Pairs {
    Pairs { h, spacing: 1.0, instructions: Instructions::best(), precision: Precision::Double }
}

/// Neighbours of particles, ready for sweeps.
pub fn neighbors<const D: usize, const N: usize, K: Kernel>(
    p: &Particles<D, N>,
    reach: f64,
    pairs: Pairs,
) -> Neighbors<D> {
    let mut neighbors = Neighbors::default();
    neighbors.build(p, reach, pairs);
    neighbors.refresh::<N, K>(p, pairs);
    neighbors.find(&p.x, pairs);
    neighbors
}

/// Accelerations, and heat of the viscosity, by w sigma or w sigma L of each particle, in numbers T.
pub fn accelerate<const D: usize, const N: usize, S, K, T, G>(
    p: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    viscosity: Viscosity,
    weighted: impl Fn(usize) -> G,
) -> (Vec<Vector<D>>, Vec<f64>)
where
    S: Space<D, N>,
    K: Kernel,
    T: Element,
    G: Parts<Number = f64>,
    G::With<T>: Traction<D, N, T>,
{
    let mut stressed: Vec<Stressed<G::With<T>, T>> = Vec::new();
    let per_volume = weight::<D, K>(pairs.h, T::unit(pairs.h));
    Stressed::part::<D, N, S, G>(0..p.len(), p, pairs.spacing, per_volume, weighted, &mut stressed);
    let (mut a, mut heat) = (vec![Vector::default(); p.owned], vec![0.0; p.owned]);
    momentum::<D, N, S, K, _, T>(0..p.owned, p, neighbors, pairs, viscosity, &stressed, (&mut a, &mut heat));
    (a, heat)
}

/// sqrt(J2)
pub fn root_j2<const N: usize>(s: Sym<N>) -> f64 {
    (0.5 * s.deviator().contract(s.deviator())).sqrt()
}

/// The stress of a law that forgets the old one, at a rate of deformation and a density.
pub fn stress<const N: usize>(law: &impl Material, rate: Sym<N>, density: f64, dt: f64) -> Sym<N> {
    law.stress(Sym::default(), &Increment { strain: rate * dt, density, dt }, &mut History::default())
}

#[track_caller]
pub fn close(got: f64, want: f64, tolerance: f64) {
    let error = (got - want).abs() / if want == 0.0 { 1.0 } else { want.abs() };
    assert!(error <= tolerance, "got {got:e}, want {want:e}: error {error:e} above {tolerance:e}");
}

/// Every so many-th of these points, as this rank's resting particles of 2600 kg/m3.
pub fn in_turn<const D: usize, const N: usize, S: Space<D, N>>(
    comm: &Communicator,
    points: &[[f64; 3]],
    mass: f64,
) -> Particles<D, N> {
    let mut mine = Particles::default();
    for (n, &x) in points.iter().enumerate().skip(Reduce::rank(comm)).step_by(Reduce::size(comm)) {
        mine.key.push(key(n as u64, 0));
        mine.x.push(S::from_disk(x));
    }
    let count = mine.key.len();
    (mine.mass, mine.density) = (vec![mass; count], vec![2600.0; count]);
    (mine.a, mine.history) = (vec![Default::default(); count], vec![Default::default(); count]);
    (mine.work, mine.body) = (vec![Default::default(); count], vec![0; count]);
    mine.own(count);
    mine
}

/// Runs the test of this name again under mpirun, on each of these numbers of ranks. `None` when that is done; under mpirun MPI,
/// where a rank that fails ends all of them.
#[track_caller]
pub fn under_mpi(test: &str, sizes: &[usize]) -> Option<mpi::environment::Universe> {
    const MARK: &str = "TALUS_TEST_UNDER_MPI";
    let Ok(size) = std::env::var(MARK) else {
        for size in sizes.iter().map(usize::to_string) {
            let mut mpirun = std::process::Command::new("mpirun");
            mpirun.args(["-n", &size]).arg(std::env::current_exe().unwrap());
            mpirun.args(["--exact", test, "--nocapture", "--test-threads=1"]);
            let output = mpirun.env(MARK, &size).output().expect("mpirun starts");
            let said = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
            let passed = output.status.success() && said[0].contains("1 passed");
            assert!(passed, "{size} ranks, {}: {}\n{}", output.status, said[0], said[1]);
        }
        return None;
    };
    let universe = mpi::initialize().expect("MPI starts");
    assert_eq!(size, Reduce::size(&Communicator::world()).to_string());
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        hook(info);
        mpi::traits::Communicator::abort(&Communicator::world(), 1);
    }));
    Some(universe)
}

/// MPI with one rank for every test of a program, one test at a time.
pub fn alone() -> (MutexGuard<'static, ()>, Communicator) {
    static STARTED: OnceLock<()> = OnceLock::new();
    static TURN: Mutex<()> = Mutex::new(());
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    STARTED.get_or_init(|| {
        let (universe, _) = mpi::initialize_with_threading(mpi::Threading::Serialized).expect("MPI starts");
        // It ends with the process.
        std::mem::forget(universe);
    });
    (turn, Communicator::world())
}
