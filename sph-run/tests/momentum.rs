//! Forces over all ranks add up to nothing: row H7 of the list of verification tests, on 1, 2, 3 and 5 ranks.
//! The test starts itself again under mpirun.

use crate::support::under_mpi;
use formats::scene::Scene;
use sph_run::algebra::Sym;
use sph_run::dispatch::{Job, resolve};
use sph_run::exact::{Sum, reduce};
use sph_run::parallel::Reduce;
use sph_run::parallel::halo::Fields;
use sph_run::particles::{Particles, id, key};
use sph_run::physics::Physics;
use sph_run::simulation::{Clock, Simulation};
use sph_run::space::Space;

/// Cells along an edge of the block.
const SIDE: usize = 9;

/// A free block without gravity, walls or symmetry: only pairs of particles act.
const SCENE: &str = r#"
space = "3d"
spacing = "10 mm"
gravity = 0
[material.drucker-prager]
density = "2600 kg/m3"
young = "0.6 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.block]
box = { min = [0, 0, 0], max = ["90 mm", "90 mm", "90 mm"] }
[end]
time = "1 s"
"#;

#[test]
fn h7_each_pair_counts_once_on_each_side() {
    let test = "momentum::h7_each_pair_counts_once_on_each_side";
    let Some(universe) = under_mpi(test, &[1, 2, 3, 5]) else { return };
    let scene = Scene::read("scene", SCENE).unwrap();
    resolve(&scene, Balance { comm: &universe.world(), scene: &scene });
}

struct Balance<'a> {
    comm: &'a formats::h5::Communicator,
    scene: &'a Scene,
}

impl Job for Balance<'_> {
    type Output = ();

    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) {
        // Particle n starts on rank n mod p, with a stress and a velocity that follow from n.
        let noise = |n: usize, k: usize| ((n * 31 + k * 17) as f64 * 0.7).sin();
        let mut particles = Particles::<D, N>::default();
        for n in (0..SIDE.pow(3)).filter(|n| n % self.comm.size() == self.comm.rank()) {
            let cell = [n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE];
            particles.key.push(key(n as u64, 0));
            let place = std::array::from_fn(|a| (cell[a] as f64 + 0.5 + 0.2 * noise(n, a)) * self.scene.spacing);
            particles.x.push(P::Space::from_disk(place));
            particles.v.push(P::Space::from_disk(std::array::from_fn(|a| noise(n, 3 + a))));
            particles.stress.push(Sym(std::array::from_fn(|a| 1e3 * noise(n, 6 + a))));
            particles.a.push(Default::default());
            particles.mass.push(2600.0 * self.scene.spacing.powi(3));
            particles.density.push(2600.0 * (1.0 + 0.05 * noise(n, 12)));
            particles.history.push(Default::default());
            particles.work.push(Default::default());
            particles.body.push(0);
        }
        let count = particles.key.len();
        particles.own(count);
        let total = (SIDE as u64).pow(3);
        let mut simulation =
            Simulation::<D, N, P>::new(self.comm, self.scene, material, particles, total, Clock::default());
        simulation.fill(Fields::Stress);
        simulation.begin();

        let p = &simulation.particles;
        let mut sums = vec![Sum::new(1.0); 2 * D + 1];
        for i in 0..p.owned {
            for axis in 0..D {
                let force = p.mass[i] * p.a[i].0[axis];
                sums[axis].add(force);
                sums[D + axis].add(force.abs());
            }
            sums[2 * D].add(id(p.key[i]) as f64);
        }
        reduce(self.comm, &mut sums);
        assert_eq!(sums[2 * D].value(), (total * (total - 1) / 2) as f64, "every particle is owned once");
        for axis in 0..D {
            let (sum, size) = (sums[axis].value(), sums[D + axis].value());
            // Rounding of the pair terms, as in C8.
            assert!(size > 1.0 && sum.abs() / size < 1e-15 * (total as f64).sqrt(), "axis {axis}: {}", sum / size);
        }
    }
}
