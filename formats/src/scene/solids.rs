//! Obstacles, as wall sites need them: what is inside, how far the surface is, and which part of it material can touch.

use super::{Obstacle, Site, Slip};
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
    list: Vec<Standing>,
    /// What must be added to a place to see copies beyond the ends of periods, m; nothing first.
    shifts: Vec<[f64; 3]>,
    /// Sites that were asked for: it takes long to find out, and comes to the same.
    known: Mutex<HashMap<Site, bool>>,
}

#[derive(Debug)]
struct Standing {
    obstacle: Obstacle,
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
        let standing = |obstacle: &Obstacle| {
            let hidden = obstacle.solid.triangles.iter().map(&hidden).collect();
            Standing { obstacle: obstacle.clone(), hidden }
        };
        let list: Vec<_> = obstacles.iter().map(standing).collect();
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
        (!list.is_empty()).then(|| Arc::new(Self { list, shifts, known: Mutex::default() }))
    }

    /// Distance of a place between the ends of periods to the nearest surface, m, negative inside. Further away than
    /// `limit` it may be less, but is never more, nor less than the limit.
    pub fn distance(&self, home: [f64; 3], limit: f64) -> f64 {
        let all = self.list.iter().flat_map(|standing| self.shifts.iter().map(move |shift| (standing, shift)));
        all.map(|(standing, shift)| standing.obstacle.solid.distance(moved(home, shift), limit))
            .fold(f64::INFINITY, f64::min)
    }

    /// The obstacle that such a place lies in; of several the one it lies deepest in, and of these the first.
    pub fn around(&self, home: [f64; 3]) -> Option<Inside> {
        let mut deepest: Option<Inside> = None;
        for (number, Standing { obstacle, hidden }) in self.list.iter().enumerate() {
            for shift in &self.shifts {
                let x = moved(home, shift);
                if !obstacle.solid.contains(x) {
                    continue;
                }
                // Where material can touch nothing of it nothing needs to be pushed out.
                let Some(found) = obstacle.solid.nearest(x, |t| !hidden[t]) else { continue };
                if deepest.is_none_or(|deepest| found.distance > deepest.depth) {
                    let smooth = obstacle.slip == Slip::FreeSlip;
                    deepest = Some(Inside { obstacle: number, normal: found.normal, depth: found.distance, smooth });
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
        let Standing { obstacle, hidden } = &self.list[number];
        let open = || obstacle.solid.triangles.iter().zip(hidden).filter(|(_, hidden)| !**hidden).map(|(t, _)| t);
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

    /// The obstacles of which a twentieth of the surface, or more, has another side less than `thickness` behind it.
    pub fn thin(&self, thickness: f64) -> Vec<Thin> {
        let one = |(number, standing): (usize, &Standing)| {
            let (mut all, mut thin, mut least) = (0.0, 0.0, f64::INFINITY);
            for (x, normal, area) in self.surface(number, 0.5 * thickness) {
                all += area;
                if let Some(through) = standing.through(x, normal, thickness) {
                    thin += area;
                    least = least.min(through);
                }
            }
            let share = thin / all;
            (share >= 0.05).then(|| Thin { name: standing.obstacle.name.clone(), least, share })
        };
        self.list.iter().enumerate().filter_map(one).collect()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.list.len()
    }
}

impl Standing {
    /// How far it is from a point of the surface straight through to another side that material can touch, where that is less
    /// than `most`; to a 64th of that.
    fn through(&self, x: [f64; 3], normal: [f64; 3], most: f64) -> Option<f64> {
        let solid: &Solid = &self.obstacle.solid;
        let mut depth = most / 64.0;
        while depth < most {
            let nearest = solid.nearest([0, 1, 2].map(|a| x[a] - depth * normal[a]), |_| true)?;
            if !nearest.inside {
                return (!self.hidden[nearest.triangle]).then_some(depth);
            }
            depth += nearest.distance.max(most / 64.0);
        }
        None
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
