//! Virtual wall particles (Yang et al. 2020, Eqs 29-32): on lattice sites behind the walls within reach of owned
//! material, with velocity and stress extrapolated from the material by Shepard's interpolation, then reflected.
//!
//! No rank holds the wall: each makes the sites it needs, from their lattice coordinates, whenever it builds its
//! neighbour lists, so walls go where the flow goes. Every rank extrapolates for itself; its halo is wide enough along
//! the walls for the same sums, term by term, on all of them.

use crate::algebra::Vector;
use crate::boundary::mirror::reflect_stress;
use crate::boundary::periodic::Periods;
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
    /// Owned particles that may come to an obstacle before the next build of the lists.
    near_obstacles: Vec<u32>,
}

impl Walls {
    /// For walls on `lattice`, whose particles have the given volume dx^D.
    pub fn new(lattice: WallLattice, volume: f64) -> Self {
        Self { lattice, volume, parities: Vec::new(), near_obstacles: Vec::new() }
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

    /// How far around itself a particle is needed where lists reach so far, by its place, and the most that can be: near walls twice
    /// as far, by the wall particles that others see.
    pub fn reaches<const D: usize, const N: usize, S: Space<D, N>>(
        &self,
        reach: f64,
    ) -> (impl Fn(Vector<D>) -> f64 + use<D, N, S>, f64) {
        let widest = if self.has_sites() { 2.0 * reach } else { reach };
        let lattice = self.lattice.clone();
        let of = move |x| if lattice.distance_of_sites(S::to_disk(x)) < reach { widest } else { reach };
        (of, widest)
    }

    /// How many obstacles there are.
    pub fn obstacles(&self) -> usize {
        self.lattice.obstacles()
    }

    /// The obstacle of every wall particle, in their order: those of walls have none.
    pub fn of_obstacles(&self) -> impl Iterator<Item = Option<usize>> {
        self.parities.iter().map(|parity| parity.obstacle)
    }

    /// Puts owned particles back that have come below a terrain or into an obstacle in a drift of length `dt`: the virtual
    /// particles carry what is dense, but not what flies alone. They lose the velocity into it and, unless it is smooth, as much
    /// of that along it; nothing moves further than it would have gone without it.
    pub fn keep_out<const D: usize, const N: usize, S: Space<D, N>>(
        &self,
        p: &mut Particles<D, N>,
        periods: &Periods<D>,
        dt: f64,
    ) {
        if self.lattice.has_terrain() {
            for i in 0..p.owned {
                if let Some((n, depth, smooth)) = self.lattice.below_ground(S::to_disk(p.x[i])) {
                    put_back::<D, N, S>(p, i, (n, depth, smooth), periods, dt);
                }
            }
        }
        for i in self.near_obstacles.iter().map(|&i| i as usize) {
            if let Some(inside) = self.lattice.inside_obstacle(S::to_disk(p.x[i])) {
                put_back::<D, N, S>(p, i, (inside.normal, inside.depth, inside.smooth), periods, dt);
            }
        }
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
        let near = |x: Vector<D>| self.lattice.outside_obstacles(S::to_disk(x)) < reach;
        self.near_obstacles = (0..p.owned as u32).filter(|&i| near(p.x[i as usize])).collect();
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
            if let Some(n) = parity.normal {
                v = reflect_velocity(v, n);
            }
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
            let mut stress = S::stress_to_disk(*kept);
            if let Some(n) = parity.normal {
                stress = reflect_stress_in(stress, n);
            }
            *kept = S::stress_from_disk(reflect_stress(stress, parity.reflected));
        }
    }
}

/// Puts a particle back that has come through a surface of this normal, and is so deep behind it.
fn put_back<const D: usize, const N: usize, S: Space<D, N>>(
    p: &mut Particles<D, N>,
    i: usize,
    (n, depth, smooth): ([f64; 3], f64, bool),
    periods: &Periods<D>,
    dt: f64,
) {
    let v = S::to_disk(p.v[i]);
    let into: f64 = -(0..3).map(|a| v[a] * n[a]).sum::<f64>();
    if into <= 0.0 {
        return;
    }
    let back = depth.min(2.0 * into * dt);
    p.x[i] += periods.rounded(S::from_disk(n.map(|n| n * back)));
    let along = [0, 1, 2].map(|a| v[a] + into * n[a]);
    let speed = along.iter().map(|v| v * v).sum::<f64>().sqrt();
    let kept = if smooth { 1.0 } else { (1.0 - into / speed.max(into)).max(0.0) };
    p.v[i] = S::from_disk(along.map(|v| v * kept));
}

/// v - 2 (v.n) n
fn reflect_velocity(v: [f64; 3], n: [f64; 3]) -> [f64; 3] {
    let across: f64 = (0..3).map(|a| v[a] * n[a]).sum();
    [0, 1, 2].map(|a| v[a] - 2.0 * across * n[a])
}

/// R sigma R with R = 1 - 2 n n^T, in the order XX YY ZZ XY YZ XZ: sigma - 2 (t n^T + n t^T) + 4 (n.t) n n^T with the traction
/// t = sigma n.
fn reflect_stress_in(s: [f64; 6], n: [f64; 3]) -> [f64; 6] {
    let t = [
        s[0] * n[0] + s[3] * n[1] + s[5] * n[2],
        s[3] * n[0] + s[1] * n[1] + s[4] * n[2],
        s[5] * n[0] + s[4] * n[1] + s[2] * n[2],
    ];
    let normal: f64 = (0..3).map(|a| n[a] * t[a]).sum();
    let part = |a: usize, b: usize| 4.0 * normal * n[a] * n[b] - 2.0 * (t[a] * n[b] + n[a] * t[b]);
    let places = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];
    std::array::from_fn(|k| s[k] + part(places[k].0, places[k].1))
}

fn unique(sites: &mut Vec<(u64, Site)>) {
    sites.sort_unstable_by_key(|(key, _)| *key);
    sites.dedup_by_key(|(key, _)| *key);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_along_an_axis_reflects_as_that_axis_does() {
        let (s, v) = ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [1.0, 2.0, 3.0]);
        assert_eq!(reflect_stress_in(s, [0.0, 0.0, 1.0]), reflect_stress(s, [false, false, true]));
        assert_eq!(reflect_velocity(v, [0.0, 0.0, 1.0]), [1.0, 2.0, -3.0]);
    }

    #[test]
    fn on_a_tilted_plane_the_shear_traction_turns_around_and_the_normal_one_stays() {
        let (s, n) = ([-3.0, -1.0, -7.0, 0.5, -0.25, 2.0], [-0.6, 0.0, 0.8]);
        let traction = |s: [f64; 6]| [s[0] * n[0] + s[5] * n[2], s[3] * n[0] + s[4] * n[2], s[5] * n[0] + s[2] * n[2]];
        let (before, after) = (traction(s), traction(reflect_stress_in(s, n)));
        let normal: f64 = (0..3).map(|a| before[a] * n[a]).sum();
        for a in 0..3 {
            let shear = before[a] - normal * n[a];
            assert!((after[a] - (normal * n[a] - shear)).abs() < 1e-14, "{after:?}");
        }
        let twice = reflect_stress_in(reflect_stress_in(s, n), n);
        assert!(twice.iter().zip(s).all(|(a, b)| (a - b).abs() < 1e-14));
    }
}
