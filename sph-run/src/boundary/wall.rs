//! Virtual wall particles (Yang et al. 2020, Eqs 29-32): on lattice sites behind the walls within reach of owned
//! material, with velocity and stress extrapolated from the material by Shepard's interpolation, then reflected.
//!
//! No rank holds the wall: each makes the sites it needs, from their lattice coordinates, whenever it builds its
//! neighbour lists, so walls go where the flow goes. Every rank extrapolates for itself; its halo is wide enough along
//! the walls for the same sums, term by term, on all of them.

use crate::algebra::Vector;
use crate::boundary::mirror::reflect_stress;
use crate::neighbors::{Neighbors, blocks_order};
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::rates::wall::extrapolate;
use crate::space::Space;
use crate::sweep::Pairs;
use formats::scene::{Parity, Site, WallLattice};

/// The virtual particles of one rank.
#[derive(Clone, Debug)]
pub struct Walls {
    lattice: WallLattice,
    volume: f64,
    parities: Vec<Parity>,
}

impl Walls {
    /// For walls on `lattice`, whose particles have the given volume dx^D.
    pub fn new(lattice: WallLattice, volume: f64) -> Self {
        Self { lattice, volume, parities: Vec::new() }
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
        let places: Vec<[f64; 3]> = sites.iter().map(|&(_, site)| self.lattice.position(site)).collect();
        let order = blocks_order(&places.iter().map(|&place| S::from_disk(place)).collect::<Vec<_>>());
        for i in order {
            let ((key, _), place) = (sites[i as usize], places[i as usize]);
            self.parities.push(self.lattice.parity(place));
            p.key.push(key);
            p.x.push(S::from_disk(place));
            p.volume.push(self.volume);
        }
        p.resize(p.key.len());
    }

    /// Extrapolates velocities.
    pub fn fill_motion<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
        &self,
        p: &mut Particles<D, N>,
        neighbors: &Neighbors<D>,
        pairs: Pairs,
    ) {
        extrapolate::<D, K, _>(neighbors, pairs, &mut p.v);
        for (parity, kept) in self.parities.iter().zip(&mut p.v[p.mirror..]) {
            let mut v = S::to_disk(*kept);
            for a in 0..3 {
                v[a] = v[a] * parity.velocity[a] + parity.motion[a];
            }
            *kept = S::from_disk(v);
        }
    }

    /// Extrapolates stresses.
    pub fn fill_stress<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
        &self,
        p: &mut Particles<D, N>,
        neighbors: &Neighbors<D>,
        pairs: Pairs,
    ) {
        extrapolate::<D, K, _>(neighbors, pairs, &mut p.stress);
        for (parity, kept) in self.parities.iter().zip(&mut p.stress[p.mirror..]) {
            *kept = S::stress_from_disk(reflect_stress(S::stress_to_disk(*kept), parity.reflected));
        }
    }
}

fn unique(sites: &mut Vec<(u64, Site)>) {
    sites.sort_unstable_by_key(|(key, _)| *key);
    sites.dedup_by_key(|(key, _)| *key);
}
