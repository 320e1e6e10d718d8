//! Obstacles, as wall sites need them: what is inside, how far the surface is, and which part of it material can touch.

use super::{Obstacle, Site, Slip, WallLattice, fit::TOLERANCE};
use crate::stl::{Solid, Triangle};
use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

/// Samples of a surface are at most about so many.
const SAMPLES: f64 = 20_000.0;

/// So many sites are kept in mind.
const MOST_KNOWN: usize = 1 << 22;

/// Where a point inside of an obstacle would come out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inside {
    /// Number of the obstacle.
    pub obstacle: usize,
    /// Unit vector outwards through the nearest point of the surface that material can touch.
    pub normal: [f64; 3],
    /// Distance of that point, m.
    pub depth: f64,
    /// Does it let the material slide?
    pub smooth: bool,
}

/// An obstacle much of which is thin.
#[derive(Clone, Debug, PartialEq)]
pub struct Thin {
    /// Its name.
    pub name: String,
    /// Its least thickness, m.
    pub least: f64,
    /// The share of its surface where it is thinner than asked for.
    pub share: f64,
}

/// The obstacles of a scene.
#[derive(Debug)]
pub(super) struct Solids {
    /// Of the obstacles.
    names: Vec<String>,
    list: Vec<Standing>,
    /// What must be added to a place to see copies beyond the ends of periods, m; nothing first.
    shifts: Vec<[f64; 3]>,
    /// Sites that were asked for: it takes long to find out, and comes to the same.
    known: Mutex<HashMap<Site, bool>>,
}

/// A part of an obstacle.
#[derive(Debug)]
struct Standing {
    /// The obstacle's number.
    number: usize,
    smooth: bool,
    solid: Solid,
    /// Triangles that no material can touch: behind walls, below the ground. They tell the inside, but reflect nothing.
    hidden: Vec<bool>,
}

/// A point of a surface, its normal, and the area it stands for, m2.
pub(super) type Sample = ([f64; 3], [f64; 3], f64);

impl Solids {
    /// None without obstacles.
    pub fn new(
        obstacles: &[Obstacle],
        periods: [Option<f64>; 3],
        hidden: impl Fn(&Triangle) -> bool,
    ) -> Option<Arc<Self>> {
        let parts = obstacles.iter().enumerate().flat_map(|(number, obstacle)| {
            let smooth = obstacle.slip == Slip::FreeSlip;
            obstacle.solid.parts().into_iter().map(move |solid| (number, smooth, solid))
        });
        let list = parts.map(|(number, smooth, solid)| {
            let hidden = solid.triangles.iter().map(&hidden).collect();
            Standing { number, smooth, solid, hidden }
        });
        let list: Vec<_> = list.collect();
        let names = obstacles.iter().map(|obstacle| obstacle.name.clone()).collect();
        let mut shifts = vec![[0.0; 3]];
        for (a, length) in periods.into_iter().enumerate() {
            let Some(length) = length else { continue };
            for n in 0..shifts.len() {
                for side in [-1.0, 1.0] {
                    let mut shift = shifts[n];
                    shift[a] = side * length;
                    shifts.push(shift);
                }
            }
        }
        (!list.is_empty()).then(|| Arc::new(Self { names, list, shifts, known: Mutex::default() }))
    }

    /// Distance of a place between the ends of periods to the nearest surface, m, negative inside. Further away than
    /// `limit` it may be less, but is never more, nor less than the limit.
    pub fn distance(&self, home: [f64; 3], limit: f64) -> f64 {
        let all = self.list.iter().flat_map(|standing| self.shifts.iter().map(move |shift| (standing, shift)));
        all.map(|(standing, shift)| standing.solid.distance(moved(home, shift), limit)).fold(f64::INFINITY, f64::min)
    }

    /// The obstacle that such a place lies in; of several the one it lies deepest in, and of these the first.
    pub fn around(&self, home: [f64; 3]) -> Option<Inside> {
        let mut deepest: Option<Inside> = None;
        for Standing { number, smooth, solid, hidden } in &self.list {
            for shift in &self.shifts {
                let x = moved(home, shift);
                if !solid.contains(x) {
                    continue;
                }
                // Where material can touch nothing of it nothing needs to be pushed out.
                let Some(found) = solid.nearest(x, |t| !hidden[t]) else { continue };
                if deepest.is_none_or(|deepest| found.distance > deepest.depth) {
                    deepest = Some(Inside {
                        obstacle: *number,
                        normal: found.normal,
                        depth: found.distance,
                        smooth: *smooth,
                    });
                }
            }
        }
        deepest
    }

    /// Is a site one of theirs? `find` is asked once.
    pub fn has(&self, site: Site, find: impl FnOnce() -> bool) -> bool {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() > MOST_KNOWN {
            known.clear();
        }
        *known.entry(site).or_insert_with(find)
    }

    /// Points about `step` apart on what material can touch of an obstacle, fewer on large ones.
    pub fn surface(&self, number: usize, step: f64) -> Vec<Sample> {
        let parts = self.list.iter().filter(|part| part.number == number);
        parts.flat_map(|part| part.surface(step)).collect()
    }

    /// The obstacles of which a twentieth of the surface, or more, has another side less than `thickness` behind it.
    pub fn thin(&self, thickness: f64) -> Vec<Thin> {
        let one = |(number, name): (usize, &String)| {
            let (mut all, mut thin, mut least) = (0.0, 0.0, f64::INFINITY);
            for part in self.list.iter().filter(|part| part.number == number) {
                for (x, normal, area) in part.surface(0.5 * thickness) {
                    all += area;
                    if let Some(through) = part.through(x, normal, thickness) {
                        thin += area;
                        least = least.min(through);
                    }
                }
            }
            let share = thin / all;
            (share >= 0.05).then(|| Thin { name: name.clone(), least, share })
        };
        self.names.iter().enumerate().filter_map(one).collect()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.names.len()
    }
}

impl Standing {
    /// Points on what material can touch of it.
    fn surface(&self, step: f64) -> Vec<Sample> {
        let Self { solid, hidden, .. } = self;
        let open = || solid.triangles.iter().zip(hidden).filter(|(_, hidden)| !**hidden).map(|(t, _)| t);
        let total: f64 = open().map(|t| area(t).0).sum();
        let step = step.max((total / SAMPLES).sqrt());
        let mut samples = Vec::new();
        for t in open() {
            let (area, normal) = area(t);
            let n = ((area.sqrt() / step).ceil() as usize).max(1);
            let part = 1.0 / n as f64;
            // n^2 like triangles: those that stand on their side, and those between them.
            for (i, j, third) in
                (0..n).flat_map(|i| (0..n - i).flat_map(move |j| [(i, j, 1.0 / 3.0), (i, j, 2.0 / 3.0)]))
            {
                if third > 0.5 && i + j + 2 > n {
                    continue;
                }
                let (u, v) = ((i as f64 + third) * part, (j as f64 + third) * part);
                let x = [0, 1, 2].map(|a| t[0][a] + u * (t[1][a] - t[0][a]) + v * (t[2][a] - t[0][a]));
                samples.push((x, normal, area * part * part));
            }
        }
        samples
    }

    /// How far it is from a point of the surface straight through to another side that material can touch, where that is less
    /// than `most`; to a 64th of that.
    fn through(&self, x: [f64; 3], normal: [f64; 3], most: f64) -> Option<f64> {
        let mut depth = most / 64.0;
        while depth < most {
            let nearest = self.solid.nearest([0, 1, 2].map(|a| x[a] - depth * normal[a]), |_| true)?;
            if !nearest.inside {
                return (!self.hidden[nearest.triangle]).then_some(depth);
            }
            depth += nearest.distance.max(most / 64.0);
        }
        None
    }
}

/// Obstacles.
impl WallLattice {
    /// How many there are.
    pub fn obstacles(&self) -> usize {
        self.solids.as_ref().map_or(0, |solids| solids.len())
    }

    /// The obstacle that a point lies in, and where it would come out.
    pub fn inside_obstacle(&self, x: [f64; 3]) -> Option<Inside> {
        let solids = self.solids.as_ref()?;
        let (home, sign) = self.home(x);
        let inside = solids.around(home)?;
        Some(Inside { normal: [0, 1, 2].map(|a| sign[a] * inside.normal[a]), ..inside })
    }

    /// Distance to the nearest obstacle, m: negative inside, infinite where there is none.
    pub fn outside_obstacles(&self, x: [f64; 3]) -> f64 {
        self.solids.as_ref().map_or(f64::INFINITY, |solids| solids.distance(self.home(x).0, self.farthest))
    }

    /// Obstacles that are thinner than `thickness` in a good part.
    pub fn thin_obstacles(&self, thickness: f64) -> Vec<Thin> {
        self.solids.as_ref().map_or(Vec::new(), |solids| solids.thin(thickness))
    }

    /// Points about a spacing apart on what material can touch of all obstacles, with normals and areas.
    pub fn surface_of_obstacles(&self) -> Vec<Sample> {
        let all = self.solids.iter().flat_map(|solids| (0..solids.len()).map(move |n| solids.surface(n, self.spacing)));
        all.flatten().collect()
    }

    /// The same place, between the ends of periods and on the material's side of planes of symmetry and mirrors, and which
    /// components of vectors have been turned around on the way. Obstacles are mirrored and repeated with the material.
    fn home(&self, x: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let (mut at, mut sign) = (x, [1.0; 3]);
        for a in 0..3 {
            if let Some(period) = self.periods[a] {
                at[a] = period.wrap(at[a]);
            }
            if a < 2 && self.symmetric[a] && at[a] < 0.0 {
                (at[a], sign[a]) = (-at[a], -sign[a]);
            }
            for wall in self.walls[self.with_sites..].iter().filter(|wall| wall.axis == a) {
                if wall.side * (at[a] - wall.at) < 0.0 {
                    (at[a], sign[a]) = (2.0 * wall.at - at[a], -sign[a]);
                }
            }
        }
        (at, sign)
    }

    /// Is a site that lies behind no wall one of an obstacle?
    pub(super) fn is_in_obstacle(&self, site: Site, p: [f64; 3]) -> bool {
        let Some(solids) = &self.solids else { return false };
        let found = || self.above_ground(p) >= 0.0 && solids.around(self.home(p).0).is_some();
        solids.has(site, found)
    }

    /// Can no material touch a triangle? It lies behind a wall, a plane of symmetry or the end of a period, or below the ground.
    pub(super) fn hides(&self, triangle: &Triangle) -> bool {
        let slack = TOLERANCE * self.spacing;
        let beyond = |axis: usize, side: f64, at: f64| triangle.iter().all(|x| side * (x[axis] - at) <= slack);
        let by_plane = self.walls.iter().any(|wall| beyond(wall.axis, wall.side, wall.at))
            || (0..2).any(|a| self.symmetric[a] && beyond(a, 1.0, 0.0));
        let by_period = (0..3).any(|a| {
            self.periods[a]
                .is_some_and(|period| beyond(a, 1.0, period.from) || beyond(a, -1.0, period.from + period.length))
        });
        by_plane || by_period || (self.terrain.is_some() && self.is_buried(triangle, 6))
    }

    /// Does the ground cover a triangle? It is looked at in 4^n parts.
    fn is_buried(&self, triangle: &Triangle, n: u32) -> bool {
        let covered = |x: &[f64; 3]| self.ground(*x).is_some_and(|ground| x[2] <= ground + TOLERANCE * self.spacing);
        let [a, b, c] = *triangle;
        let middle = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|k| 0.5 * (p[k] + q[k]));
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        triangle.iter().all(covered)
            && (n == 0
                || [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].iter().all(|part| self.is_buried(part, n - 1)))
    }
}

fn moved(x: [f64; 3], by: &[f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|a| x[a] + by[a])
}

/// Area and unit normal.
fn area([a, b, c]: &Triangle) -> (f64, [f64; 3]) {
    let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
    let across = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let double = across.iter().map(|c| c * c).sum::<f64>().sqrt();
    (0.5 * double, across.map(|c| c / double))
}
