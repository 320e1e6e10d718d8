//! The lattice of virtual wall particles: which sites lie behind a wall, where they are, and what they are called.
//!
//! Walls are infinite planes, so no file lists their particles: whoever needs some asks for the sites near a point.
//! A site's place and number follow from its lattice coordinates alone, the same on every rank.
//!
//! Over a terrain the lattice is sheared: each column along z is moved so that the border between its cells -1 and 0 lies on
//! the ground. Cells keep their volume, all sites with k < 0 lie below the ground, and none comes nearer to it than half a
//! spacing along z, so that there are no steps in the floor.
//!
//! Obstacles are filled with sites of the lattice that is not sheared. Where a site also lies behind a wall or below the
//! ground, the wall or the ground has it: without a terrain it is the same site, and does what the wall does; over one, where
//! the walls' and the ground's sites are others, the obstacle has none there.

use super::{PeriodicAxis, Scene, Slip, Terrain, Wall, WallKind, solids::Solids};
use crate::space::Space;
use std::sync::Arc;

/// Lists of neighbours reach less far, in smoothing lengths. Behind a terrain sites are found as far.
pub const FARTHEST: f64 = 2.7;

/// Lattice coordinates of a site; unused axes are zero.
pub type Site = [i32; 3];

/// Over a terrain the sites of obstacles, which are not sheared, are numbered from here along z: less than half of it is what
/// either kind may have of them (see `obstacle::MOST_LAYERS`).
const PLAIN: i32 = 1 << 19;

/// Sites behind the walls of a scene.
#[derive(Clone, Debug)]
pub struct WallLattice {
    /// Those of kind `virtual` first.
    pub(super) walls: Vec<Wall>,
    /// How many of them are of that kind: only these have sites.
    pub(super) with_sites: usize,
    axes: &'static [usize],
    origin: [f64; 3],
    pub(super) spacing: f64,
    pub(super) periods: [Option<PeriodicAxis>; 3],
    pub(super) symmetric: [bool; 2],
    space: Space,
    pub(super) terrain: Option<Arc<Floor>>,
    pub(super) solids: Option<Arc<Solids>>,
    /// No reach may be larger over a terrain or near an obstacle, m.
    pub(super) farthest: f64,
}

/// A terrain, as sites need it.
#[derive(Debug)]
pub(super) struct Floor {
    terrain: Terrain,
    /// 1/sqrt(1 + s^2) with the steepest slope s within reach of each cell of the raster: no point of the ground is nearer than
    /// the height above it times that.
    nearer: Vec<f64>,
}

impl Floor {
    fn new(terrain: &Terrain, reach: f64) -> Self {
        let nearer = terrain.ground.steepest(reach).into_iter().map(|s| 1.0 / (1.0 + s * s).sqrt()).collect();
        Self { terrain: terrain.clone(), nearer }
    }
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
    /// Normal of a free-slip terrain or obstacle in which both are reflected before that.
    pub normal: Option<[f64; 3]>,
    /// The obstacle that it belongs to, by number.
    pub obstacle: Option<usize>,
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
        let farthest = FARTHEST * scene.h();
        let mut lattice = Self {
            walls,
            with_sites,
            axes: scene.space.axes(),
            origin,
            spacing: scene.spacing,
            periods,
            symmetric: scene.symmetry,
            space: scene.space,
            terrain: scene.terrain.as_ref().map(|terrain| Arc::new(Floor::new(terrain, farthest))),
            solids: None,
            farthest,
        };
        let lengths = periods.map(|period| period.map(|period| period.length));
        lattice.solids = Solids::new(&scene.obstacles, lengths, |triangle| lattice.hides(triangle));
        lattice
    }

    /// Where the borders of cells are counted from, m.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// The place whose ground is under a point: beyond planes of symmetry and walls the ground is a mirror image, beyond a period
    /// it repeats itself.
    fn fold(&self, x: [f64; 3]) -> [f64; 2] {
        let mut at = [x[0], if self.space == Space::ThreeD { x[1] } else { 0.0 }];
        for a in 0..2 {
            if let Some(period) = self.periods[a] {
                at[a] = period.wrap(at[a]);
            }
            if self.symmetric[a] {
                at[a] = at[a].abs();
            }
            for wall in self.walls.iter().filter(|wall| wall.axis == a) {
                if wall.side * (at[a] - wall.at) < 0.0 {
                    at[a] = 2.0 * wall.at - at[a];
                }
            }
        }
        at
    }

    /// Height of the ground under a point, m; none without a terrain.
    pub fn ground(&self, x: [f64; 3]) -> Option<f64> {
        let floor = self.terrain.as_ref()?;
        let [x, y] = self.fold(x);
        Some(floor.terrain.height(x, y))
    }

    /// Is there a terrain?
    pub fn has_terrain(&self) -> bool {
        self.terrain.is_some()
    }

    /// Where a point lies below the ground: the ground's normal, the distance to the plane across it, m, and whether the ground
    /// is smooth.
    pub fn below_ground(&self, x: [f64; 3]) -> Option<([f64; 3], f64, bool)> {
        let floor = self.terrain.as_ref()?;
        let at = self.fold(x);
        let depth = floor.terrain.height(at[0], at[1]) - x[2];
        (depth > 0.0).then(|| {
            let normal = self.normal(floor, x);
            (normal, depth * normal[2], floor.terrain.slip == Slip::FreeSlip)
        })
    }

    /// Lower bound of the distance to the ground, m; negative below it, infinite without a terrain.
    pub(super) fn above_ground(&self, x: [f64; 3]) -> f64 {
        let Some(floor) = &self.terrain else { return f64::INFINITY };
        let at = self.fold(x);
        let height = x[2] - floor.terrain.height(at[0], at[1]);
        if height > 0.0 { height * floor.nearer[floor.terrain.ground.cell_of(at[0], at[1])] } else { height }
    }

    /// Place of a site, m: the middle of its cell. Sites a period apart are exactly a period apart.
    pub fn position(&self, site: Site) -> [f64; 3] {
        let (mut x, mut home) = ([0.0; 3], [0.0; 3]);
        for &a in self.axes {
            let place = |i: i32| self.origin[a] + (f64::from(i) + 0.5) * self.spacing;
            x[a] = match self.periods[a] {
                None => place(site[a]),
                Some(period) => {
                    let cells = (period.length / self.spacing).round() as i32;
                    let periods = f64::from(site[a].div_euclid(cells));
                    home[a] = period.round(place(site[a].rem_euclid(cells)));
                    home[a] + periods * period.length
                }
            };
            if self.periods[a].is_none() {
                home[a] = x[a];
            }
        }
        if self.is_plain(site) {
            x[2] -= f64::from(PLAIN) * self.spacing;
        } else if let Some(ground) = self.ground(home) {
            x[2] = ground + (f64::from(site[2]) + 0.5) * self.spacing;
        }
        x
    }

    /// Is it a site of an obstacle over a terrain?
    fn is_plain(&self, site: Site) -> bool {
        self.solids.is_some() && self.terrain.is_some() && site[2] >= PLAIN / 2
    }

    /// The site's global number: bit 63 is set, then 21 bits an axis. Ascending order is lexicographic in z, y, x.
    pub fn id(site: Site) -> u64 {
        let part = |i: i32| (i64::from(i) + (1 << 20)) as u64 & 0x1f_ffff;
        1 << 63 | part(site[2]) << 42 | part(site[1]) << 21 | part(site[0])
    }

    /// Signed distance of a point to the nearest wall, m: positive on the material's side, infinite without walls. Above a terrain,
    /// and further than [`FARTHEST`] from an obstacle, it may be less, but is never more.
    pub fn distance(&self, x: [f64; 3]) -> f64 {
        nearest(&self.walls, x).min(self.above_ground(x)).min(self.outside_obstacles(x))
    }

    /// The same to the nearest wall that has sites.
    pub fn distance_of_sites(&self, x: [f64; 3]) -> f64 {
        nearest(&self.walls[..self.with_sites], x).min(self.above_ground(x)).min(self.outside_obstacles(x))
    }

    /// Is there a wall that has sites?
    pub fn has_sites(&self) -> bool {
        self.with_sites > 0 || self.terrain.is_some() || self.solids.is_some()
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
        let mut parity =
            Parity { velocity: [1.0; 3], motion: [0.0; 3], reflected: [false; 3], normal: None, obstacle: None };
        let mut stuck = 0.0;
        if let Some(floor) = &self.terrain
            && self.above_ground(x) < 0.0
        {
            match floor.terrain.slip {
                Slip::NoSlip => stuck += 1.0,
                Slip::FreeSlip => parity.normal = Some(self.normal(floor, x)),
            }
        }
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
        if stuck == 0.0
            && parity.normal.is_none()
            && !parity.reflected.contains(&true)
            && let Some(inside) = self.inside_obstacle(x)
        {
            parity.obstacle = Some(inside.obstacle);
            if inside.smooth {
                parity.normal = Some(inside.normal);
            } else {
                stuck = 1.0;
            }
        }
        if stuck > 0.0 {
            parity.velocity = parity.velocity.map(|factor| -factor);
            parity.motion = parity.motion.map(|sum| sum / stuck);
        }
        parity
    }

    /// Normal of the ground under a point: mirrored with it.
    fn normal(&self, floor: &Floor, x: [f64; 3]) -> [f64; 3] {
        let at = self.fold(x);
        let mut normal = floor.terrain.normal(self.space, at[0], at[1]);
        for a in 0..2 {
            let mirrored = self.symmetric[a] && x[a] < 0.0;
            let behind = |wall: &&Wall| wall.axis == a && wall.side * (x[a] - wall.at) < 0.0;
            if mirrored || self.walls.iter().any(|wall| behind(&wall)) {
                normal[a] = -normal[a];
            }
        }
        normal
    }

    /// Calls `visit` for every wall site within `reach` of `x`.
    pub fn near(&self, x: [f64; 3], reach: f64, mut visit: impl FnMut(Site)) {
        debug_assert!((self.terrain.is_none() && self.solids.is_none()) || reach <= self.farthest);
        if self.distance_of_sites(x) >= reach {
            return;
        }
        let (mut low, mut high) = ([0; 3], [0; 3]);
        for &a in self.axes {
            let s = (x[a] - self.origin[a]) / self.spacing - 0.5;
            low[a] = (s - reach / self.spacing).ceil() as i32;
            high[a] = (s + reach / self.spacing).floor() as i32;
        }
        let near_solid = self.solids.is_some() && self.outside_obstacles(x) < reach;
        let mut up = 0;
        if self.terrain.is_some() {
            self.near_terrain(x, reach, [low, high], &mut visit);
            if !near_solid {
                return;
            }
            up = PLAIN;
        }
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                for i in low[0]..=high[0] {
                    let site = [i, j, k + up];
                    let p = self.position(site);
                    let r2: f64 = self.axes.iter().map(|&a| (p[a] - x[a]).powi(2)).sum();
                    if r2 >= reach * reach {
                        continue;
                    }
                    let behind = nearest(&self.walls[..self.with_sites], p) < 0.0;
                    // Over a terrain what lies behind a wall has been visited.
                    if (behind && up == 0) || (!behind && near_solid && self.is_in_obstacle(site, p)) {
                        visit(site);
                    }
                }
            }
        }
    }
}

impl WallLattice {
    /// The same column by column, each with its own height.
    fn near_terrain(&self, x: [f64; 3], reach: f64, [low, high]: [Site; 2], mut visit: impl FnMut(Site)) {
        for j in low[1]..=high[1] {
            for i in low[0]..=high[0] {
                let foot = self.position([i, j, 0]);
                let across: f64 = self.axes.iter().filter(|&&a| a < 2).map(|&a| (foot[a] - x[a]).powi(2)).sum();
                let left = reach * reach - across;
                if left <= 0.0 {
                    continue;
                }
                let (layers, middle) = (left.sqrt() / self.spacing, (x[2] - foot[2]) / self.spacing);
                for k in (middle - layers).ceil() as i32..=(middle + layers).floor() as i32 {
                    let p = self.position([i, j, k]);
                    let r2 = across + (p[2] - x[2]).powi(2);
                    if r2 < reach * reach && (k < 0 || nearest(&self.walls[..self.with_sites], p) < 0.0) {
                        visit([i, j, k]);
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
        let moving = Parity {
            velocity: [-1.0; 3],
            motion: [1.0, 0.0, 0.0],
            reflected: [false; 3],
            normal: None,
            obstacle: None,
        };
        assert_eq!(smooth.parity([0.05, 0.0, -0.01]), moving);
        let side = Parity {
            velocity: [-1.0, 1.0, 1.0],
            motion: [0.0; 3],
            reflected: [true, false, false],
            normal: None,
            obstacle: None,
        };
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
