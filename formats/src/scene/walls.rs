//! The lattice of virtual wall particles: which sites lie behind a wall, where they are, and what they are called.
//!
//! Walls are infinite planes, so no file lists their particles: whoever needs some asks for the sites near a point.
//! A site's place and number follow from its lattice coordinates alone, the same on every rank.

use super::{PeriodicAxis, Scene, Slip, Wall, WallKind};
use crate::space::Space;

/// Lattice coordinates of a site; unused axes are zero.
pub type Site = [i32; 3];

/// Sites behind the walls of a scene.
#[derive(Clone, Debug)]
pub struct WallLattice {
    /// Those of kind `virtual` first.
    walls: Vec<Wall>,
    /// How many of them are of that kind: only these have sites.
    with_sites: usize,
    axes: &'static [usize],
    origin: [f64; 3],
    spacing: f64,
    periods: [Option<PeriodicAxis>; 3],
}

/// What a wall does to the velocity and the stress extrapolated behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parity {
    /// Factor of each component of the velocity.
    pub velocity: [f64; 3],
    /// What is added to it then, m/s.
    pub motion: [f64; 3],
    /// Is the axis reflected in the stress?
    pub reflected: [bool; 3],
}

impl WallLattice {
    /// The lattice of a scene: cells of size dx whose borders pass through the walls and the symmetry planes.
    pub fn new(scene: &Scene) -> Self {
        let mut origin = [0.0; 3];
        for axis in 0..3 {
            // The axis of r-z is a plane of symmetry too: sites across it must be images of each other.
            let axis_of_rings = axis == 0 && scene.space == Space::Axisymmetric;
            let symmetric = axis_of_rings || (axis < 2 && scene.symmetry[axis]);
            if let Some(period) = scene.periodic_axis(axis) {
                origin[axis] = period.from;
            } else if let (false, Some(wall)) = (symmetric, scene.walls.iter().find(|w| w.axis == axis)) {
                origin[axis] = wall.at;
            }
        }
        let (mut walls, others): (Vec<_>, Vec<_>) = scene.walls.iter().partition(|wall| wall.kind == WallKind::Virtual);
        let with_sites = walls.len();
        walls.extend(others);
        let periods = [0, 1, 2].map(|axis| scene.periodic_axis(axis));
        Self { walls, with_sites, axes: scene.space.axes(), origin, spacing: scene.spacing, periods }
    }

    /// Place of a site, m: the middle of its cell. Sites a period apart are exactly a period apart.
    pub fn position(&self, site: Site) -> [f64; 3] {
        let mut x = [0.0; 3];
        for &a in self.axes {
            let place = |i: i32| self.origin[a] + (f64::from(i) + 0.5) * self.spacing;
            x[a] = match self.periods[a] {
                None => place(site[a]),
                Some(period) => {
                    let cells = (period.length / self.spacing).round() as i32;
                    let periods = f64::from(site[a].div_euclid(cells));
                    period.round(place(site[a].rem_euclid(cells))) + periods * period.length
                }
            };
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
        nearest(&self.walls, x)
    }

    /// The same to the nearest wall that has sites.
    pub fn distance_of_sites(&self, x: [f64; 3]) -> f64 {
        nearest(&self.walls[..self.with_sites], x)
    }

    /// Is there a wall that has sites?
    pub fn has_sites(&self) -> bool {
        self.with_sites > 0
    }

    /// The walls with sites that a point lies behind.
    pub fn behind(&self, x: [f64; 3]) -> impl Iterator<Item = &Wall> {
        self.walls[..self.with_sites].iter().filter(move |w| w.side * (x[w.axis] - w.at) < 0.0)
    }

    /// What the walls do to a velocity and a stress extrapolated to `x` from the material. Behind free-slip walls
    /// both are reflected; behind any no-slip wall the velocity v then becomes 2 V - v (Yang et al. 2020, Eqs 31, 32, with
    /// the corrections that only shear components with one normal index change sign, and that a wall may slide along
    /// itself with a velocity V; in the corner of two no-slip walls V is the mean of theirs).
    pub fn parity(&self, x: [f64; 3]) -> Parity {
        let mut parity = Parity { velocity: [1.0; 3], motion: [0.0; 3], reflected: [false; 3] };
        let mut stuck = 0.0;
        for wall in self.behind(x) {
            match wall.slip {
                Slip::NoSlip => {
                    stuck += 1.0;
                    for a in 0..3 {
                        parity.motion[a] += 2.0 * wall.velocity[a];
                    }
                }
                Slip::FreeSlip => {
                    parity.velocity[wall.axis] = -1.0;
                    parity.reflected[wall.axis] = true;
                }
            }
        }
        if stuck > 0.0 {
            parity.velocity = parity.velocity.map(|factor| -factor);
            parity.motion = parity.motion.map(|sum| sum / stuck);
        }
        parity
    }

    /// Calls `visit` for every wall site within `reach` of `x`.
    pub fn near(&self, x: [f64; 3], reach: f64, mut visit: impl FnMut(Site)) {
        if self.distance_of_sites(x) >= reach {
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
                    if r2 < reach * reach && self.distance_of_sites(p) < 0.0 {
                        visit(site);
                    }
                }
            }
        }
    }
}

/// Signed distance of a point to the nearest of some walls, m.
fn nearest(walls: &[Wall], x: [f64; 3]) -> f64 {
    walls.iter().map(|w| w.side * (x[w.axis] - w.at)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(walls: &str) -> WallLattice {
        let text = format!(
            "space = \"plane-strain\"\nspacing = 0.01\n{walls}[material.drucker-prager]\ndensity = 2600\nyoung = 6e6\n\
             poisson = 0.3\nfriction = 30\ncohesion = 0\n[body.box]\nbox = {{ min = [0, 0, 0], max = [0.1, 0, 0.1] }}\n\
             [end]\ntime = 1\n"
        );
        WallLattice::new(&Scene::read("scene.toml", &text).expect("a sound scene"))
    }

    const FLOOR: &str =
        "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\nvelocity = [0.5, 0, 0]\n";
    const SIDE: &str = "[wall.side]\naxis = \"x\"\nat = 0.1\nside = \"below\"\nslip = ";

    #[test]
    fn walls_turn_what_is_extrapolated() {
        let smooth = lattice(&format!("{FLOOR}{SIDE}\"free-slip\"\n"));
        let moving = Parity { velocity: [-1.0; 3], motion: [1.0, 0.0, 0.0], reflected: [false; 3] };
        assert_eq!(smooth.parity([0.05, 0.0, -0.01]), moving);
        let side = Parity { velocity: [-1.0, 1.0, 1.0], motion: [0.0; 3], reflected: [true, false, false] };
        assert_eq!(smooth.parity([0.11, 0.0, 0.05]), side);
        let corner = Parity { velocity: [1.0, -1.0, -1.0], reflected: side.reflected, ..moving };
        assert_eq!(smooth.parity([0.11, 0.0, -0.01]), corner);
        // Two no-slip walls: the mean of their motions.
        let rough = lattice(&format!("{FLOOR}{SIDE}\"no-slip\"\n"));
        assert_eq!(rough.parity([0.11, 0.0, -0.01]), Parity { motion: [0.5, 0.0, 0.0], ..moving });
    }

    #[test]
    fn mirror_walls_have_no_sites() {
        let mixed = lattice(&format!("{SIDE}\"no-slip\"\nkind = \"mirror\"\n{FLOOR}"));
        let x = [0.1 - 0.005, 0.0, 0.005];
        assert!((mixed.distance(x) - 0.005).abs() < 1e-15 && (mixed.distance([0.095, 0.0, 0.5]) - 0.005).abs() < 1e-15);
        assert!((mixed.distance_of_sites([0.095, 0.0, 0.5]) - 0.5).abs() < 1e-15);
        let mut sites = 0;
        mixed.near(x, 0.024, |site| {
            assert!(mixed.position(site)[2] < 0.0);
            sites += 1;
        });
        assert!(sites > 5);
        assert!(!lattice(&format!("{SIDE}\"no-slip\"\nkind = \"mirror\"\n")).has_sites());
    }

    #[test]
    fn sites_a_period_apart_are_exactly_that() {
        let text = format!("periodic = {{ x = {{ from = -0.1, to = 0.2 }} }}\n{FLOOR}");
        let lattice = lattice(&text);
        let length = PeriodicAxis::new([-0.1, 0.2]).length;
        for i in -40..80 {
            let (here, there) = (lattice.position([i, 0, -1])[0], lattice.position([i + 30, 0, -1])[0]);
            assert_eq!(there - here, length);
            assert!((here - (f64::from(i) + 0.5) * 0.01 + 0.1).abs() < 1e-14);
        }
    }
}
