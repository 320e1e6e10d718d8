//! Virtual wall particles (Yang et al. 2020, Eqs 29-32): on lattice sites behind the walls within reach of owned
//! material, with velocity and stress extrapolated from the material by Shepard's interpolation, then reflected.
//!
//! No rank holds the wall: each makes the sites it needs, from their lattice coordinates, whenever it builds its
//! neighbour lists, so walls go where the flow goes. Every rank extrapolates for itself; its halo is wide enough along
//! the walls for the same sums, term by term, on all of them.

use crate::algebra::Vector;
use crate::boundary::mirror::reflect_stress;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::rates::wall::{extrapolate, weights};
use crate::space::Space;
use crate::sweep::Pairs;
use formats::scene::{Parity, Site, WallLattice};

/// The virtual particles of one rank.
#[derive(Clone, Debug)]
pub struct Walls {
    lattice: WallLattice,
    volume: f64,
    parities: Vec<Parity>,
    weights: Vec<f64>,
}

impl Walls {
    /// For walls on `lattice`, whose particles have the given volume dx^D.
    pub fn new(lattice: WallLattice, volume: f64) -> Self {
        Self { lattice, volume, parities: Vec::new(), weights: Vec::new() }
    }

    /// Are there walls of virtual particles at all?
    pub fn has_sites(&self) -> bool {
        self.lattice.has_sites()
    }

    /// Signed distance of a point to the nearest wall of virtual particles, m.
    pub fn distance_of_sites<const D: usize, const N: usize, S: Space<D, N>>(&self, x: Vector<D>) -> f64 {
        self.lattice.distance_of_sites(S::to_disk(x))
    }

    /// Signed distance of a point to the nearest wall of any kind, m.
    pub fn distance<const D: usize, const N: usize, S: Space<D, N>>(&self, x: Vector<D>) -> f64 {
        self.lattice.distance(S::to_disk(x))
    }

    /// Appends the wall sites within `reach` of owned particles.
    pub fn create<const D: usize, const N: usize, S: Space<D, N>>(&mut self, p: &mut Particles<D, N>, reach: f64) {
        debug_assert_eq!(p.mirror, p.len());
        let mut sites: Vec<(u64, Site)> = Vec::new();
        let mut limit = 1 << 20;
        for i in 0..p.owned {
            self.lattice.near(S::to_disk(p.x[i]), reach, |site| sites.push((WallLattice::id(site), site)));
            // Neighbours name the same sites again and again: forget the copies before they fill the memory.
            if sites.len() > limit {
                unique(&mut sites);
                limit = limit.max(2 * sites.len());
            }
        }
        unique(&mut sites);
        self.parities.clear();
        for (key, site) in sites {
            let place = self.lattice.position(site);
            self.parities.push(self.lattice.parity(place));
            p.key.push(key);
            p.x.push(S::from_disk(place));
            p.volume.push(self.volume);
        }
        p.resize(p.key.len());
    }

    /// Extrapolates velocities; remembers the weights for the stresses of the same step.
    pub fn fill_motion<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
        &mut self,
        p: &mut Particles<D, N>,
        neighbors: &Neighbors,
        pairs: Pairs,
    ) {
        weights::<D, N, K>(p, neighbors, pairs, &mut self.weights);
        for (wall, parity) in self.parities.iter().enumerate() {
            let mut v = S::to_disk(extrapolate(neighbors, &self.weights, wall, &p.v));
            for a in 0..3 {
                v[a] = v[a] * parity.velocity[a] + parity.motion[a];
            }
            p.v[p.mirror + wall] = S::from_disk(v);
        }
    }

    /// Extrapolates a field that does not change across the wall.
    pub fn extend(&self, mirror: usize, neighbors: &Neighbors, field: &mut [f64]) {
        for wall in 0..self.parities.len() {
            field[mirror + wall] = extrapolate(neighbors, &self.weights, wall, field);
        }
    }

    /// Extrapolates stresses.
    pub fn fill_stress<const D: usize, const N: usize, S: Space<D, N>>(
        &self,
        p: &mut Particles<D, N>,
        neighbors: &Neighbors,
    ) {
        for (wall, parity) in self.parities.iter().enumerate() {
            let stress = S::stress_to_disk(extrapolate(neighbors, &self.weights, wall, &p.stress));
            p.stress[p.mirror + wall] = S::stress_from_disk(reflect_stress(stress, parity.reflected));
        }
    }
}

fn unique(sites: &mut Vec<(u64, Site)>) {
    sites.sort_unstable_by_key(|(key, _)| *key);
    sites.dedup_by_key(|(key, _)| *key);
}
