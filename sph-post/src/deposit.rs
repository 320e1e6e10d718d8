//! The shape of the material: its surface, how far it ran, how much it swelled.
//!
//! Everything is sorted into bins one spacing wide that begin at the axis or at x = 0.

use crate::{geometry::Geometry, sample::Sampler};
use formats::{snapshot::Rows, space::Space};

/// Most bins along a profile, and along each side of a map; material beyond is left out of both.
const MOST_BINS: [i64; 2] = [20_000, 2_000];

/// Columns of the material along r or x; bin `k` lies between (first + k) dx and (first + k + 1) dx.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Profile {
    /// Number of the first bin.
    pub first: i64,
    /// Height of the surface above the floor in the middle of the bin, m; the mean over the other direction in 3-D.
    pub height: Vec<f64>,
    /// Volume in the bin over its area, m.
    pub thickness: Vec<f64>,
}

/// Height of the surface over x and y, in square bins; row by row along x.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// Numbers of the first bin along x and y.
    pub first: [i64; 2],
    /// Numbers of bins along x and y.
    pub size: [usize; 2],
    /// m; `height[j * size[0] + i]`.
    pub height: Vec<f64>,
}

/// How far the material reaches from the axis ([`formats::scene::Scene::is_radial`]), or from x = 0 along +x, m. What
/// runs towards -x is not seen: where a body can do that, no run-out is taken from them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fronts {
    /// The furthest particle, and half a spacing.
    pub furthest: f64,
    /// What contains 99.5 % of the mass.
    pub mass: f64,
    /// Where the thickness falls below half a spacing for the first time, seen from the bulk.
    pub thickness: f64,
}

/// Particles that left the body and ran on by themselves (Yang et al. 2020, section 3.8 and Fig 11): those whose middle lies
/// beyond the effective front, which is the one by thickness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strays {
    /// How many.
    pub count: usize,
    /// Their mass over that of all.
    pub share: f64,
}

/// The deposit in one snapshot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deposit {
    /// Along r or x.
    pub profile: Profile,
    /// Over x and y, in 3-D.
    pub map: Option<Map>,
    /// Run-out.
    pub fronts: Fronts,
    /// What lies beyond the effective front.
    pub strays: Strays,
    /// Largest height of the surface within two spacings of the axis or of x = 0, m.
    pub height_centre: f64,
    /// Largest height of the surface anywhere, m.
    pub height_max: f64,
    /// Sum of m/rho over the volume at the start.
    pub volume_ratio: f64,
}

impl Deposit {
    /// The shape of `rows`.
    pub fn new(g: &Geometry, rows: &Rows, sampler: &Sampler) -> Self {
        let map = (g.space == Space::ThreeD).then(|| Map::new(g, rows, sampler));
        let thickness = thickness_of(g, rows, |_| true);
        let mut profile = Profile { first: thickness.first, height: Vec::new(), thickness: thickness.values };
        profile.height = match &map {
            Some(map) => map.mean(g, profile.first, profile.thickness.len(), &map.height, true),
            None => (0..profile.thickness.len())
                .map(|k| surface(g, sampler, [(profile.first + k as i64) as f64 * g.dx + 0.5 * g.dx, 0.0]))
                .collect(),
        };
        let fronts = fronts(g, rows, &profile);
        let strays = strays(g, rows, fronts.thickness);
        profile.trim();
        let top = |heights: &mut dyn Iterator<Item = (f64, f64)>| {
            heights.fold([0.0_f64; 2], |[centre, all], (away, h)| {
                [if away < 2.0 * g.dx { centre.max(h) } else { centre }, all.max(h)]
            })
        };
        let [height_centre, height_max] = match &map {
            Some(map) => top(&mut map.cells(g).map(|(x, c)| (x[0].hypot(x[1]), map.height[c]))),
            None => top(&mut profile.bins(g).map(|(x, k)| (x.abs(), profile.height[k]))),
        };
        let volume: f64 = rows.mass.iter().zip(&rows.density).map(|(m, rho)| m / rho).sum();
        let mass: f64 = rows.mass.iter().sum();
        Self { profile, map, fronts, strays, height_centre, height_max, volume_ratio: volume * g.density / mass }
    }
}

/// Height of the surface over the floor at the horizontal position `at`, m; 0 where there is no material.
///
/// The surface lies where the filled fraction (sum of V W, with the floor as a mirror) falls through 1/2, looked for
/// from the top of the contiguous stack of particles downward. Beside a cliff, where the column is less than full, the
/// fraction is taken relative to that inside the column. The stack begins at the floor and ends below the first gap of
/// more than 2h: what flies higher is ignored. Columns less than half as full as a wide layer of
/// their height hold no more than single particles and count as empty.
pub fn surface(g: &Geometry, sampler: &Sampler, at: [f64; 2]) -> f64 {
    let stack = sampler.stack([at[0], at[1], 0.0], g.h);
    let mut top = g.floor;
    for z in stack {
        if z - top > 2.0 * g.h {
            break;
        }
        top = top.max(z);
    }
    if top == g.floor {
        return 0.0;
    }
    let fraction = |z: f64| {
        let mirrored = if z < g.floor + 2.0 * g.h { sampler.fraction([at[0], at[1], 2.0 * g.floor - z]) } else { 0.0 };
        sampler.fraction([at[0], at[1], z]) + mirrored
    };
    let depths = [top - g.h, top - 2.0 * g.h, g.floor];
    let inside = depths.iter().map(|&z| fraction(z.max(g.floor))).fold(0.0, f64::max);
    let full = (inside / sampler.slab(top - g.floor + 0.5 * g.dx)).min(1.0);
    if full < 0.5 {
        return 0.0;
    }
    let wanted = 0.5 * full;
    let (mut low, mut high) = (top + g.dx, top + 2.0 * g.dx);
    while fraction(low) < wanted {
        high = low;
        low -= 0.5 * g.dx;
        if low <= g.floor {
            low = g.floor;
            break;
        }
    }
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        *(if fraction(middle) < wanted { &mut high } else { &mut low }) = middle;
    }
    0.5 * (low + high) - g.floor
}

/// Values in consecutive bins.
pub struct Bins {
    /// Number of the first bin.
    pub first: i64,
    /// One a bin.
    pub values: Vec<f64>,
}

/// The bins that particles lie in, from `low` to `high`, no more than `most`.
fn range(low: f64, high: f64, dx: f64, most: i64) -> (i64, usize) {
    if low > high {
        return (0, 1);
    }
    let first = (low / dx).floor().max(-most as f64) as i64;
    let last = (high / dx).floor().min(most as f64) as i64;
    (first, (last - first + 1).clamp(1, 2 * most) as usize)
}

/// Volume per area, of the rows that count, in the bins that all rows need. Every particle is spread evenly over one spacing,
/// so that a bin's content changes smoothly.
pub fn thickness_of(g: &Geometry, rows: &Rows, counts: impl Fn(usize) -> bool) -> Bins {
    let along = || rows.position.iter().map(|&x| g.along(x));
    let (low, high) = along().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s), h.max(s)));
    // No bins behind a wall: what is spread beyond it, or has sunk into it, belongs to the bin before it.
    let [lowest, highest] = [g.walls[0] + 1e-6 * g.dx, g.walls[1] - 1e-6 * g.dx];
    let low = if g.radial || g.mirrored[0] { 0.0 } else { (low - 0.499 * g.dx).max(lowest) };
    let high = (high.max(low) + 0.499 * g.dx).min(highest);
    let (first, count) = range(low, high, g.dx, MOST_BINS[0]);
    let mut values = vec![0.0; count];
    for (row, s) in along().enumerate().filter(|(row, _)| counts(*row)) {
        let volume = rows.mass[row] / rows.density[row];
        let left = s / g.dx - 0.5 - first as f64;
        let (k, part) = (left.floor(), left - left.floor());
        for (k, share) in [(k, 1.0 - part), (k + 1.0, part)] {
            // What would lie beyond the axis or the plane of symmetry comes back by mirroring.
            let k = if k < 0.0 && (g.radial || g.mirrored[0]) { -1.0 - k } else { k };
            let k = if lowest.is_finite() { k.max(0.0) } else { k };
            let k = if highest.is_finite() { k.min(count as f64 - 1.0) } else { k };
            if k >= 0.0 && k < count as f64 {
                values[k as usize] += volume * share;
            }
        }
    }
    values.iter_mut().enumerate().for_each(|(k, v)| *v /= g.bin_area(first + k as i64));
    Bins { first, values }
}

fn fronts(g: &Geometry, rows: &Rows, profile: &Profile) -> Fronts {
    let mut order: Vec<(f64, f64)> = rows.position.iter().zip(&rows.mass).map(|(&x, &m)| (g.along(x), m)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = rows.mass.iter().sum();
    let wanted = 0.995 * total;
    let mut below = (order.first().map_or(0.0, |f| f.0), 0.0);
    let mut mass = below.0;
    for &(s, m) in &order {
        let sum = below.1 + m;
        mass = s;
        if sum >= wanted {
            mass = below.0 + (s - below.0) * (wanted - below.1) / m;
            break;
        }
        below = (s, sum);
    }
    let furthest = order.last().map_or(0.0, |f| f.0) + 0.5 * g.dx;
    // A bin counts as filled as a whole, so the edge could lie beyond the last particle.
    Fronts { furthest, mass, thickness: edge(g, profile).min(furthest) }
}

fn strays(g: &Geometry, rows: &Rows, front: f64) -> Strays {
    let beyond = rows.position.iter().zip(&rows.mass).filter(|(x, _)| g.along(**x) > front);
    let (count, mass) = beyond.fold((0, 0.0), |(n, sum), (_, m)| (n + 1, sum + m));
    Strays { count, share: mass / rows.mass.iter().sum::<f64>() }
}

/// From the bin that holds most volume outward to the first one thinner than half a spacing; that one counts by
/// the part of it that its content would fill half a spacing high.
fn edge(g: &Geometry, profile: &Profile) -> f64 {
    let (least, t) = (0.5 * g.dx, &profile.thickness);
    let volume = |k: usize| t[k] * g.bin_area(profile.first + k as i64);
    let Some(mut k) = (0..t.len()).max_by(|&a, &b| volume(a).total_cmp(&volume(b))) else { return 0.0 };
    while k < t.len() && t[k] >= least {
        k += 1;
    }
    let rest = t.get(k).map_or(0.0, |t| t / least);
    ((profile.first + k as i64) as f64 + rest) * g.dx
}

impl Profile {
    /// Leaves out empty bins at the ends.
    fn trim(&mut self) {
        let filled = |k: &usize| self.height[*k] > 0.0 || self.thickness[*k] > 1e-12 * self.thickness[0].max(1e-300);
        let end = (0..self.height.len()).rev().find(filled).map_or(1, |k| k + 1);
        let begin = (0..end).find(filled).unwrap_or(0);
        self.height = self.height[begin..end].to_vec();
        self.thickness = self.thickness[begin..end].to_vec();
        self.first += begin as i64;
    }

    /// Middle of every bin, m, and its place in the vectors.
    pub fn bins(&self, g: &Geometry) -> impl Iterator<Item = (f64, usize)> {
        let (first, dx) = (self.first, g.dx);
        (0..self.height.len()).map(move |k| (((first + k as i64) as f64 + 0.5) * dx, k))
    }
}

impl Map {
    fn new(g: &Geometry, rows: &Rows, sampler: &Sampler) -> Self {
        let (mut first, mut size) = ([0; 2], [0; 2]);
        for a in 0..2 {
            let (low, high) =
                rows.position.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x[a]), h.max(x[a])));
            (first[a], size[a]) = range(low, high, g.dx, MOST_BINS[1]);
            if g.mirrored[a] {
                size[a] = (size[a] as i64 + first[a]).max(1) as usize;
                first[a] = 0;
            }
        }
        let mut map = Self { first, size, height: vec![0.0; size[0] * size[1]] };
        let heights = map.cells(g).map(|(x, _)| surface(g, sampler, x)).collect();
        map.height = heights;
        map
    }

    /// Middle of every cell, m, and its place in the vector.
    pub fn cells(&self, g: &Geometry) -> impl Iterator<Item = ([f64; 2], usize)> {
        let (first, nx, dx) = (self.first, self.size[0], g.dx);
        (0..self.size[0] * self.size[1]).map(move |c| {
            let x = [(first[0] + (c % nx) as i64) as f64, (first[1] + (c / nx) as i64) as f64];
            (x.map(|x| (x + 0.5) * dx), c)
        })
    }

    /// Means of a field on the cells over the other direction (angle, or y), in bins along the profile. Cells without a
    /// value (NaN) don't count, nor do those outside the map, unless they hold `zero_outside`. NaN where none counts.
    pub fn mean(&self, g: &Geometry, first: i64, count: usize, field: &[f64], zero_outside: bool) -> Vec<f64> {
        let mut sums = vec![0.0; count];
        let mut seen = vec![0.0_f64; count];
        for (x, c) in self.cells(g) {
            let k = (g.along([x[0], x[1], 0.0]) / g.dx).floor() as i64 - first;
            let Some(k) = usize::try_from(k).ok().filter(|&k| k < count) else { continue };
            if !field[c].is_nan() {
                sums[k] += field[c];
                seen[k] += 1.0;
            }
        }
        for (k, seen) in seen.iter_mut().enumerate() {
            let bin = first + k as i64;
            if zero_outside && (*seen == 0.0 || g.radial && self.leaves(g, bin)) {
                *seen = (*seen).max(g.bin_area(bin) / (g.dx * g.dx));
            }
        }
        sums.iter().zip(&seen).map(|(sum, seen)| sum / seen).collect()
    }

    /// Does the ring of bin `k` leave the map?
    fn leaves(&self, g: &Geometry, k: i64) -> bool {
        (0..2).any(|a| {
            let below = !g.mirrored[a] && self.first[a] > -k - 1;
            below || self.first[a] + (self.size[a] as i64) < k + 1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{block, geometry, jitter, push};
    use formats::kernel::Kernel;
    use std::f64::consts::PI;

    fn deposit(g: &Geometry, rows: &Rows) -> Deposit {
        Deposit::new(g, rows, &Sampler::new(g, rows))
    }

    #[test]
    fn a_lattice_block_has_exactly_its_height_and_length() {
        for space in Space::ALL {
            for kernel in Kernel::ALL {
                for layers in [1, 2, 3, 12] {
                    let mut g = geometry(space, kernel, 0.01);
                    g.width = if space == Space::ThreeD { 0.14 } else { 1.0 };
                    let rows = block(&g, [14, if space == Space::ThreeD { 14 } else { 1 }, layers]);
                    let d = deposit(&g, &rows);
                    let height = layers as f64 * g.dx;
                    let what = format!("{space:?} {kernel:?} {layers}");
                    assert_eq!(d.profile.first, 0, "{what}");
                    assert_eq!(d.profile.height.len(), 14, "{what}");
                    for h in &d.profile.height {
                        let allowed = if layers < 3 { 0.1 } else { 0.05 };
                        assert!((h - height).abs() < allowed * g.dx, "{what}: {} of {layers}", h / g.dx);
                    }
                    for t in &d.profile.thickness {
                        assert!((t / height - 1.0).abs() < 1e-9, "{what}: {t}");
                    }
                    assert!((d.fronts.furthest - 0.14).abs() < 1e-12, "{what}");
                    assert!((d.fronts.thickness - 0.14).abs() < 1e-9, "{what}: {:?}", d.fronts);
                    assert!((d.volume_ratio - 1.0).abs() < 1e-12, "{what}");
                }
            }
        }
    }

    #[test]
    fn a_tall_lattice_column_is_exact_to_a_hundredth_of_a_spacing() {
        let g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01);
        let d = deposit(&g, &block(&g, [14, 1, 20]));
        for h in &d.profile.height[..11] {
            assert!((h - 0.2).abs() < 0.01 * g.dx, "{}", h / g.dx);
        }
    }

    #[test]
    fn what_flies_is_not_the_deposit() {
        let g = geometry(Space::Axisymmetric, Kernel::CubicSpline, 0.01);
        let mut rows = block(&g, [14, 1, 12]);
        let before = deposit(&g, &rows);
        push(&mut rows, [0.055, 0.0, 0.12 + 2.2 * g.h], 2.0 * PI * 0.055 * 1e-4 * g.density, g.density);
        push(&mut rows, [0.5, 0.0, 0.055], 2.0 * PI * 0.5 * 1e-5 * g.density, g.density);
        let after = deposit(&g, &rows);
        assert_eq!(before.profile.height[..14], after.profile.height[..14]);
        assert!((after.fronts.furthest - 0.505).abs() < 1e-12);
        assert_eq!(before.fronts.thickness, after.fronts.thickness);
        assert_eq!(before.height_max, after.height_max);
        assert_eq!(before.strays, Strays::default());
        assert!(after.strays.count == 1 && after.strays.share > 0.0, "{:?}", after.strays);
        assert!((after.fronts.mass - before.fronts.mass).abs() < g.dx);
    }

    #[test]
    fn a_cone_has_its_volume_profile_and_edge() {
        for space in Space::ALL {
            let g = Geometry { radial: space != Space::PlaneStrain, ..geometry(space, Kernel::CubicSpline, 0.005) };
            let (r, h) = (0.2, 0.1);
            let mut rows = block(&g, [40, if space == Space::ThreeD { 40 } else { 1 }, 20]);
            let inside = |x: &[f64; 3]| x[2] < h * (1.0 - g.along(*x) / r);
            let keep: Vec<bool> = rows.position.iter().map(inside).collect();
            let mut kept = Rows::default();
            for (i, _) in keep.iter().enumerate().filter(|k| *k.1) {
                push(&mut kept, rows.position[i], rows.mass[i], rows.density[i]);
            }
            rows = kept;
            jitter(&mut rows, &g, 0.1);
            let d = deposit(&g, &rows);
            for (x, k) in d.profile.bins(&g).filter(|b| b.0 < 0.18) {
                let exact = h * (1.0 - x / r);
                // The tip is rounder than a cone.
                let allowed = if x < 0.02 { 1.2 } else { 0.7 };
                assert!((d.profile.height[k] - exact).abs() < allowed * g.dx, "{space:?} {x}: {}", d.profile.height[k]);
            }
            let volume: f64 =
                d.profile.bins(&g).map(|(_, k)| d.profile.height[k] * g.bin_area(d.profile.first + k as i64)).sum();
            let exact = match space {
                Space::PlaneStrain => 0.5 * r * h,
                Space::Axisymmetric => PI * r * r * h / 3.0,
                Space::ThreeD => PI * r * r * h / 12.0,
            };
            assert!((volume / exact - 1.0).abs() < 0.03, "{space:?}: {volume} {exact}");
            assert!((d.fronts.thickness - r).abs() < 1.5 * g.dx, "{space:?}: {:?}", d.fronts);
            // 99.5 % of a cone lies within 0.9587 r, of a wedge within 0.9293 r.
            let quantile = if space == Space::PlaneStrain { 0.9293 } else { 0.9587 };
            assert!((d.fronts.mass - quantile * r).abs() < g.dx, "{space:?}: {:?}", d.fronts);
        }
    }
}
