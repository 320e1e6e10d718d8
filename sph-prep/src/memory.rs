//! What a run needs of memory, and whether this machine can prepare it: a slip in the spacing is refused before
//! anything is made. Only the preparation's own need is held against this machine; the run may go to a larger one.

use crate::{failure::Failure, lattice::Lattice, summary, wall};
use formats::{scene::Scene, space::Space};
use mpi::{collective::SystemOperation, traits::*};

/// Memory `sph-run` needs for a particle, virtual ones included, bytes: state, rates, neighbour list and buffers of
/// the halo, and rows of a file. Measured: 581, a checkpoint included, with 1.2 10^7 particles in three dimensions on one
/// rank, up to 900 with 2 10^5, where whole huge pages count.
pub const BYTES_PER_PARTICLE: u64 = 900;

/// Memory the preparation needs for a particle, bytes: its row of 144 bytes, and what HDF5 and the exchange copy.
pub const BYTES_TO_PREPARE: u64 = 400;

/// Memory a rank needs to relax a particle of a body, bytes: its place, its move, its images and the cells. Each rank
/// relaxes whole bodies.
pub const BYTES_TO_RELAX: u64 = 200;

/// Memory a rank needs whatever it computes, bytes: the program, MPI and HDF5. Measured.
pub const BYTES_PER_RANK: u64 = 45_000_000;

/// Number of particles of a scene, found without counting them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Particles of the bodies.
    pub particles: u64,
    /// Virtual particles of walls within reach at the start.
    pub walls: u64,
    /// Particles of the largest body, where bodies are relaxed; else 0.
    pub relaxed: u64,
}

impl Load {
    /// Estimates a scene from the volumes of its bodies.
    pub fn of(scene: &Scene, lattices: &[Lattice]) -> Self {
        let estimates: Vec<u64> = lattices.iter().map(Lattice::estimate).collect();
        let relaxed = if scene.initial.relax > 0 { estimates.iter().copied().max().unwrap_or(0) } else { 0 };
        Self { particles: estimates.iter().sum(), walls: wall::within_reach(scene, lattices), relaxed }
    }

    /// Bytes `sph-run` is expected to need on that many ranks, all together.
    pub fn bytes(self, ranks: u64) -> u64 {
        (self.particles + self.walls) * BYTES_PER_PARTICLE + ranks * BYTES_PER_RANK
    }

    /// Bytes the preparation needs on that many ranks, all together.
    fn preparing(self, ranks: u64) -> u64 {
        self.particles * BYTES_TO_PREPARE + ranks * (self.relaxed * BYTES_TO_RELAX + BYTES_PER_RANK)
    }
}

/// Memory that is free for each rank, bytes: the least over the machines of the job, each shared by its own ranks.
/// Infinite where the system doesn't tell. Collective.
pub fn room(comm: &impl Communicator) -> f64 {
    let here = comm.split_shared(comm.rank()).size();
    let told = formats::memory::available();
    let mine = told.map_or(f64::INFINITY, |bytes| bytes as f64 / f64::from(here));
    let mut least = mine;
    comm.all_reduce_into(&mine, &mut least, SystemOperation::min());
    least
}

/// Refuses a scene whose preparation needs more than `room` bytes on each of `ranks` ranks.
///
/// # Errors
/// [`Failure::TooLarge`], with a spacing that would fit.
pub fn check(scene: &Scene, load: Load, room: f64, ranks: u64) -> Result<(), Failure> {
    let available = room * ranks as f64;
    if load.preparing(ranks) as f64 <= available {
        return Ok(());
    }
    let advice = match fitting(scene, load, available, ranks) {
        Some(spacing) => format!("a spacing of {} m would fit", summary::short(spacing)),
        None => "use fewer ranks, or a machine with more memory".to_owned(),
    };
    let (particles, needed) = (load.particles, summary::size(load.preparing(ranks)));
    Err(Failure::TooLarge { particles, needed, available: summary::size(available as u64), advice })
}

/// The scene's smallest spacing of two digits that needs no more than `available` bytes; none where the ranks by
/// themselves need more.
fn fitting(scene: &Scene, load: Load, available: f64, ranks: u64) -> Option<f64> {
    let left = available - (ranks * BYTES_PER_RANK) as f64;
    let particles = (load.preparing(ranks) - ranks * BYTES_PER_RANK) as f64;
    let dimension = if scene.space == Space::ThreeD { 3.0 } else { 2.0 };
    if left <= 0.0 {
        return None;
    }
    let mut trial = scene.clone();
    // Rounding to whole cells may make the first guess a little too fine.
    let mut guess = scene.spacing * (particles / left).powf(1.0 / dimension);
    for _ in 0..50 {
        let digit = 10f64.powf(guess.log10().floor() - 1.0);
        trial.spacing = (guess / digit).ceil() * digit;
        let lattices = crate::fill::lattices(&trial);
        let load = Load::of(&trial, &lattices);
        if load.preparing(ranks) as f64 <= available {
            return (load.particles > 0).then_some(trial.spacing);
        }
        guess = trial.spacing * 1.02;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fill, testing::scene};
    use formats::scene::{Shape, Slip, Wall};

    fn block(space: Space, spacing: f64) -> Scene {
        let mut scene = scene(space, spacing, Shape::Box { min: [0.0; 3], max: [0.1; 3] });
        scene.walls.push(Wall {
            axis: 2,
            at: 0.0,
            side: 1.0,
            slip: Slip::NoSlip,
            kind: formats::scene::WallKind::Virtual,
            velocity: [0.0; 3],
        });
        scene
    }

    fn load(scene: &Scene) -> Load {
        Load::of(scene, &fill::lattices(scene))
    }

    #[test]
    fn the_estimate_is_close_to_the_count() {
        for space in [Space::PlaneStrain, Space::Axisymmetric, Space::ThreeD] {
            let scene = block(space, 0.01);
            assert_eq!(load(&scene).particles, fill::serial(&scene).len() as u64, "{space:?}");
        }
        let load = load(&block(Space::ThreeD, 0.01));
        assert_eq!(load.bytes(2), (load.particles + load.walls) * BYTES_PER_PARTICLE + 90_000_000);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_a_spacing_that_does() {
        for space in [Space::PlaneStrain, Space::Axisymmetric, Space::ThreeD] {
            let scene = block(space, 1e-6);
            let room = 8e9;
            let failure = check(&scene, load(&scene), room, 3).unwrap_err();
            assert_eq!(failure.exit_code(), 2);
            assert!(failure.to_string().contains(&load(&scene).particles.to_string()), "{failure}");
            let spacing = fitting(&scene, load(&scene), 3.0 * room, 3).unwrap();
            let coarser = block(space, spacing);
            assert!(check(&coarser, load(&coarser), room, 3).is_ok(), "{spacing}");
            assert!(load(&coarser).preparing(3) as f64 > 0.7 * 3.0 * room, "no coarser than needed: {spacing}");
            assert!(check(&scene, load(&scene), f64::INFINITY, 3).is_ok());
        }
    }

    #[test]
    fn each_rank_relaxes_whole_bodies() {
        let mut scene = block(Space::ThreeD, 0.01);
        let (plain, room) = (load(&scene).preparing(3), 60e6);
        assert!(check(&scene, load(&scene), room, 3).is_ok());
        scene.initial.relax = 1;
        assert_eq!(load(&scene).preparing(3) - plain, 3 * 1000 * BYTES_TO_RELAX);
        scene.spacing = 0.001;
        let spacing = fitting(&scene, load(&scene), 3.0 * room, 3).unwrap();
        scene.initial.relax = 0;
        assert!(fitting(&scene, load(&scene), 3.0 * room, 3).unwrap() < spacing, "more memory, coarser");
    }

    #[test]
    fn ranks_alone_may_need_too_much() {
        let scene = block(Space::PlaneStrain, 0.01);
        let failure = check(&scene, load(&scene), 1e6, 1).unwrap_err();
        assert!(failure.to_string().contains("fewer ranks"), "{failure}");
    }
}
