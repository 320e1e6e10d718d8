//! The lattice of virtual wall particles: which sites lie behind a wall, where they are, and what they are called.
//!
//! Walls are infinite planes, so no file lists their particles: whoever needs some asks for the sites near a point.
//! A site's place and number follow from its lattice coordinates alone, the same on every rank.

use super::{Scene, Slip, Wall};
use crate::space::Space;

/// Lattice coordinates of a site; unused axes are zero.
pub type Site = [i32; 3];

/// Sites behind the walls of a scene.
#[derive(Clone, Debug)]
pub struct WallLattice {
    walls: Vec<Wall>,
    axes: &'static [usize],
    origin: [f64; 3],
    spacing: f64,
}

impl WallLattice {
    /// The lattice of a scene: cells of size dx whose borders pass through the walls and the symmetry planes.
    pub fn new(scene: &Scene) -> Self {
        let mut origin = [0.0; 3];
        for axis in 0..3 {
            // The axis of r-z is a plane of symmetry too: sites across it must be images of each other.
            let axis_of_rings = axis == 0 && scene.space == Space::Axisymmetric;
            let symmetric = axis_of_rings || (axis < 2 && scene.symmetry[axis]);
            if let Some([from, _]) = scene.periodic[axis] {
                origin[axis] = from;
            } else if let (false, Some(wall)) = (symmetric, scene.walls.iter().find(|w| w.axis == axis)) {
                origin[axis] = wall.at;
            }
        }
        Self { walls: scene.walls.clone(), axes: scene.space.axes(), origin, spacing: scene.spacing }
    }

    /// Place of a site, m: the middle of its cell.
    pub fn position(&self, site: Site) -> [f64; 3] {
        let mut x = [0.0; 3];
        for &a in self.axes {
            x[a] = self.origin[a] + (f64::from(site[a]) + 0.5) * self.spacing;
        }
        x
    }

    /// The site's global number: bit 63 is set, then 21 bits an axis. Ascending order is lexicographic in z, y, x.
    pub fn id(site: Site) -> u64 {
        let part = |i: i32| (i64::from(i) + (1 << 20)) as u64 & 0x1f_ffff;
        1 << 63 | part(site[2]) << 42 | part(site[1]) << 21 | part(site[0])
    }

    /// Signed distance of a point to the nearest wall, m: positive on the material's side, infinite without walls.
    pub fn distance(&self, x: [f64; 3]) -> f64 {
        self.walls.iter().map(|w| w.side * (x[w.axis] - w.at)).fold(f64::INFINITY, f64::min)
    }

    /// The walls a point lies behind.
    pub fn behind(&self, x: [f64; 3]) -> impl Iterator<Item = &Wall> {
        self.walls.iter().filter(move |w| w.side * (x[w.axis] - w.at) < 0.0)
    }

    /// What the wall does to a velocity and a stress extrapolated to `x` from the material. Behind free-slip walls
    /// both are reflected; behind any no-slip wall the velocity is then reversed (Yang et al. 2020, Eqs 31, 32, with the
    /// correction that only shear components with one normal index change sign).
    /// Returns the factors for the velocity's components, and whether each axis is reflected in the stress.
    pub fn parity(&self, x: [f64; 3]) -> ([f64; 3], [bool; 3]) {
        let (mut velocity, mut reflected, mut stuck) = ([1.0; 3], [false; 3], false);
        for wall in self.behind(x) {
            match wall.slip {
                Slip::NoSlip => stuck = true,
                Slip::FreeSlip => {
                    velocity[wall.axis] = -1.0;
                    reflected[wall.axis] = true;
                }
            }
        }
        if stuck {
            velocity = velocity.map(|factor| -factor);
        }
        (velocity, reflected)
    }

    /// Calls `visit` for every wall site within `reach` of `x`.
    pub fn near(&self, x: [f64; 3], reach: f64, mut visit: impl FnMut(Site)) {
        if self.distance(x) >= reach {
            return;
        }
        let (mut low, mut high) = ([0; 3], [0; 3]);
        for &a in self.axes {
            let s = (x[a] - self.origin[a]) / self.spacing - 0.5;
            low[a] = (s - reach / self.spacing).ceil() as i32;
            high[a] = (s + reach / self.spacing).floor() as i32;
        }
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                for i in low[0]..=high[0] {
                    let site = [i, j, k];
                    let p = self.position(site);
                    let r2: f64 = self.axes.iter().map(|&a| (p[a] - x[a]).powi(2)).sum();
                    if r2 < reach * reach && self.distance(p) < 0.0 {
                        visit(site);
                    }
                }
            }
        }
    }
}
