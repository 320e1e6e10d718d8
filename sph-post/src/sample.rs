//! Fields at any point, from the particles around it.
//!
//! First-order weighted least squares with the scene's kernel: exact for linear fields wherever enough particles
//! lie around, also at free surfaces and walls (Liu & Liu 2003, section 4; the moment matrix is that of the moving
//! least squares of Dilts 1999). Particles are mirrored at the axis and at planes of symmetry.

use crate::geometry::Geometry;
use formats::{kernel::Kernel, snapshot::Rows};
use std::collections::HashMap;

/// A particle, or the mirror image of one.
#[derive(Clone, Copy, Debug)]
struct Point {
    x: [f64; 3],
    /// Volume m/rho; the area in the r-z plane where the space is axisymmetric, m2.
    volume: f64,
    row: u32,
    /// Mirrored at x = 0, at y = 0?
    flipped: [bool; 2],
}

/// The particles of one snapshot, ready to be asked for values anywhere.
pub struct Sampler {
    kernel: Kernel,
    h: f64,
    dimension: usize,
    /// Sorted by column, then by z.
    points: Vec<Point>,
    columns: HashMap<[i32; 2], (u32, u32)>,
    /// See [`Sampler::slab`].
    slabs: Vec<f64>,
    dx: f64,
}

/// What lies near a point.
#[derive(Clone, Copy, Debug)]
pub struct Neighbour {
    /// Its row, also of an image.
    pub row: usize,
    /// Is it a mirror image?
    pub is_image: bool,
    /// Distance, m.
    pub distance: f64,
    /// Its place from the point, m.
    pub offset: [f64; 3],
    /// V W.
    pub weight: f64,
}

/// Weights of the rows around a point. Their sum is one.
pub struct Stencil {
    rows: Vec<(u32, [bool; 2], f64)>,
}

impl Sampler {
    /// Particles of `rows` and the images of those within the kernel's reach of the axis or a plane of symmetry.
    pub fn new(geometry: &Geometry, rows: &Rows) -> Self {
        let reach = 2.0 * geometry.h;
        let mut points = Vec::with_capacity(rows.len());
        for row in 0..rows.len() {
            let x = rows.position[row];
            let volume = geometry.kernel_volume(x, rows.mass[row] / rows.density[row]);
            let near = [0, 1].map(|a| geometry.mirrored[a] && x[a] < reach);
            for flipped in [[false, false], [true, false], [false, true], [true, true]] {
                if (0..2).any(|a| flipped[a] && !near[a]) {
                    continue;
                }
                let mut image = x;
                (0..2).filter(|&a| flipped[a]).for_each(|a| image[a] = -x[a]);
                points.push(Point { x: image, volume, row: row as u32, flipped });
            }
        }
        let column = |p: &Point| [(p.x[0] / reach).floor() as i32, (p.x[1] / reach).floor() as i32];
        points.sort_by(|p, q| column(p).cmp(&column(q)).then(p.x[2].total_cmp(&q.x[2])));
        let mut columns: HashMap<[i32; 2], (u32, u32)> = HashMap::new();
        for (i, p) in points.iter().enumerate() {
            columns.entry(column(p)).or_insert((i as u32, i as u32)).1 = i as u32 + 1;
        }
        let (kernel, h, dimension) = (geometry.kernel, geometry.h, geometry.space.dimension());
        let slabs = slabs(geometry);
        Self { kernel, h, dimension, points, columns, slabs, dx: geometry.dx }
    }

    /// The filled fraction on a floor under a wide slab of this thickness (m), the floor being a mirror: below 1 where
    /// the slab is thinner than the kernel's reach.
    pub fn slab(&self, thickness: f64) -> f64 {
        let layers = (thickness / self.dx).clamp(0.0, (self.slabs.len() - 1) as f64);
        let k = (layers as usize).min(self.slabs.len() - 2);
        let part = layers - k as f64;
        self.slabs[k] * (1.0 - part) + self.slabs[k + 1] * part
    }

    /// Calls `visit` with every point closer than 2h to `at`, and its distance over h.
    fn around(&self, at: [f64; 3], mut visit: impl FnMut(&Point, f64)) {
        let reach = 2.0 * self.h;
        let middle = [0, 1].map(|a| (at[a] / reach).floor() as i32);
        for i in middle[0].saturating_sub(1)..=middle[0].saturating_add(1) {
            for j in middle[1].saturating_sub(1)..=middle[1].saturating_add(1) {
                let Some(&(begin, end)) = self.columns.get(&[i, j]) else { continue };
                let column = &self.points[begin as usize..end as usize];
                let low = column.partition_point(|p| p.x[2] <= at[2] - reach);
                for p in column[low..].iter().take_while(|p| p.x[2] < at[2] + reach) {
                    let r2: f64 = (0..3).map(|a| (p.x[a] - at[a]).powi(2)).sum();
                    if r2 < reach * reach {
                        visit(p, r2.sqrt() / self.h);
                    }
                }
            }
        }
    }

    /// Everything closer than 2h to `at`, images too.
    pub fn neighbours(&self, at: [f64; 3], mut visit: impl FnMut(Neighbour)) {
        let norm = self.kernel.norm(self.dimension) / self.h.powi(self.dimension as i32);
        self.around(at, |p, q| {
            visit(Neighbour {
                row: p.row as usize,
                is_image: p.flipped != [false; 2],
                distance: q * self.h,
                offset: [0, 1, 2].map(|a| p.x[a] - at[a]),
                weight: p.volume * norm * self.kernel.shape(q),
            });
        });
    }

    /// The share of space around `at` that is filled with material: sum of V W, about 1 inside, 1/2 on a plane
    /// surface, 0 outside.
    pub fn fraction(&self, at: [f64; 3]) -> f64 {
        let mut sum = 0.0;
        self.around(at, |p, q| sum += p.volume * self.kernel.shape(q));
        sum * self.kernel.norm(self.dimension) / self.h.powi(self.dimension as i32)
    }

    /// Heights of the particles (not of images) no further than `lateral` from the vertical line through `at`,
    /// measured along each horizontal axis; ascending. `lateral` is at most 2h.
    pub fn stack(&self, at: [f64; 3], lateral: f64) -> Vec<f64> {
        let reach = 2.0 * self.h;
        let middle = [0, 1].map(|a| (at[a] / reach).floor() as i32);
        let mut heights = Vec::new();
        for i in middle[0].saturating_sub(1)..=middle[0].saturating_add(1) {
            for j in middle[1].saturating_sub(1)..=middle[1].saturating_add(1) {
                let Some(&(begin, end)) = self.columns.get(&[i, j]) else { continue };
                let near = |p: &&Point| (0..2).all(|a| (p.x[a] - at[a]).abs() < lateral);
                heights.extend(self.points[begin as usize..end as usize].iter().filter(near).map(|p| p.x[2]));
            }
        }
        heights.sort_by(f64::total_cmp);
        heights
    }

    /// The weights at a point, or `None` where fewer than three particles lie around it.
    /// Where they lie too badly for a linear fit (in a line, or all on one side), the weights are those of Shepard.
    pub fn stencil(&self, at: [f64; 3]) -> Option<Stencil> {
        let mut rows = Vec::with_capacity(64);
        let mut offsets = Vec::with_capacity(64);
        self.around(at, |p, q| {
            rows.push((p.row, p.flipped, p.volume * self.kernel.shape(q)));
            offsets.push([0, 1, 2].map(|a| (p.x[a] - at[a]) / self.h));
        });
        let sum: f64 = rows.iter().map(|r| r.2).sum();
        if rows.len() < 3 || sum <= 0.0 {
            return None;
        }
        rows.iter_mut().for_each(|r| r.2 /= sum);
        let mut centre = [0.0; 3];
        for (r, d) in rows.iter().zip(&offsets) {
            (0..3).for_each(|a| centre[a] += r.2 * d[a]);
        }
        let mut spread = [[0.0; 3]; 3];
        for (r, d) in rows.iter().zip(&offsets) {
            for a in 0..3 {
                for b in 0..3 {
                    spread[a][b] += r.2 * (d[a] - centre[a]) * (d[b] - centre[b]);
                }
            }
        }
        let axes: &[usize] = if self.dimension == 3 { &[0, 1, 2] } else { &[0, 2] };
        if let Some(tilt) = solve(&spread, centre, axes) {
            let reach: f64 = (0..3).map(|a| tilt[a] * centre[a]).sum();
            if reach < FURTHEST {
                for (r, d) in rows.iter_mut().zip(&offsets) {
                    let slope: f64 = (0..3).map(|a| tilt[a] * (d[a] - centre[a])).sum();
                    r.2 *= 1.0 - slope;
                }
            }
        }
        Some(Stencil { rows })
    }

    /// The gradient of a vector field at a point, `[a][b]` = df_a/dx_b, of the same linear fit; zero across the plane of the
    /// plane spaces. Images carry the mirrored vector. `None` where the particles allow no linear fit.
    pub fn gradient(&self, at: [f64; 3], field: &[[f64; 3]]) -> Option<[[f64; 3]; 3]> {
        /// A particle near the point: its weight, its place from there in h, its value.
        struct Seen {
            w: f64,
            d: [f64; 3],
            f: [f64; 3],
        }
        let mut points = Vec::with_capacity(64);
        self.around(at, |p, q| {
            let d = [0, 1, 2].map(|a| (p.x[a] - at[a]) / self.h);
            points.push(Seen { w: p.volume * self.kernel.shape(q), d, f: mirrored(field[p.row as usize], p.flipped) });
        });
        let sum: f64 = points.iter().map(|p| p.w).sum();
        if points.len() < 3 || sum <= 0.0 {
            return None;
        }
        let mean = |pick: &dyn Fn(&Seen) -> f64| points.iter().map(|p| p.w * pick(p)).sum::<f64>() / sum;
        let centre = [0, 1, 2].map(|a| mean(&|p| p.d[a]));
        let spread = [0, 1, 2].map(|a| [0, 1, 2].map(|b| mean(&|p| (p.d[a] - centre[a]) * (p.d[b] - centre[b]))));
        let axes: &[usize] = if self.dimension == 3 { &[0, 1, 2] } else { &[0, 2] };
        let mut gradient = [[0.0; 3]; 3];
        for (a, row) in gradient.iter_mut().enumerate() {
            let right = [0, 1, 2].map(|b| mean(&|p| (p.d[b] - centre[b]) * p.f[a]));
            *row = solve(&spread, right, axes)?.map(|slope| slope / self.h);
        }
        Some(gradient)
    }
}

/// A vector as its image has it.
fn mirrored(v: [f64; 3], flipped: [bool; 2]) -> [f64; 3] {
    [if flipped[0] { -v[0] } else { v[0] }, if flipped[1] { -v[1] } else { v[1] }, v[2]]
}

/// Filled fractions on the floor under 0, 1, 2 .. lattice layers, up to the kernel's reach.
fn slabs(g: &Geometry) -> Vec<f64> {
    let (dimension, ratio) = (g.space.dimension(), g.h / g.dx);
    let most = (2.0 * ratio).ceil() as i32 + 1;
    let across = if dimension == 3 { -most..=most } else { 0..=0 };
    let norm = g.kernel.norm(dimension) / ratio.powi(dimension as i32);
    let mut sums = vec![0.0];
    for layer in 0..most {
        let z = f64::from(layer) + 0.5;
        let mut sum = sums[layer as usize];
        for i in -most..=most {
            for j in across.clone() {
                let r = (f64::from(i * i + j * j) + z * z).sqrt();
                sum += 2.0 * norm * g.kernel.shape(r / ratio);
            }
        }
        sums.push(sum);
    }
    sums
}

/// Smallest pivot of the spread of the particles around a point, in h2, that allows a linear fit. Inside a lattice
/// the pivots are 0.2 (cubic spline) to 0.13 (Wendland C2); on its surface about a third of that.
const SMALLEST_PIVOT: f64 = 4e-3;

/// Largest squared distance of a point from the centre of its particles, over their spread: further out the linear
/// fit would be an extrapolation. On a plane surface it is about 3.
const FURTHEST: f64 = 16.0;

/// Solves `matrix` y = `right` on the given axes by Cholesky's decomposition; `None` if too close to singular.
fn solve(matrix: &[[f64; 3]; 3], right: [f64; 3], axes: &[usize]) -> Option<[f64; 3]> {
    let n = axes.len();
    let mut l = [[0.0; 3]; 3];
    for i in 0..n {
        for j in 0..=i {
            let mut sum = matrix[axes[i]][axes[j]];
            (0..j).for_each(|k| sum -= l[i][k] * l[j][k]);
            if i == j {
                if sum < SMALLEST_PIVOT {
                    return None;
                }
                l[i][i] = sum.sqrt();
            } else {
                l[i][j] = sum / l[j][j];
            }
        }
    }
    let mut y = [0.0; 3];
    for i in 0..n {
        let mut sum = right[axes[i]];
        (0..i).for_each(|k| sum -= l[i][k] * y[k]);
        y[i] = sum / l[i][i];
    }
    let mut out = [0.0; 3];
    for i in (0..n).rev() {
        let mut sum = y[i];
        (i + 1..n).for_each(|k| sum -= l[k][i] * out[axes[k]]);
        out[axes[i]] = sum / l[i][i];
    }
    Some(out)
}

impl Stencil {
    /// The value of a scalar field, which images share.
    pub fn even(&self, field: &[f64]) -> f64 {
        self.rows.iter().map(|&(row, _, w)| w * field[row as usize]).sum()
    }

    /// The value of a vector field; images carry the mirrored vector.
    pub fn vector(&self, field: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for &(row, flipped, w) in &self.rows {
            let f = mirrored(field[row as usize], flipped);
            (0..3).for_each(|a| sum[a] += w * f[a]);
        }
        sum
    }

    /// The value of a symmetric tensor field, XX YY ZZ XY YZ XZ; images carry the mirrored tensor.
    pub fn symmetric(&self, field: &[[f64; 6]]) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for &(row, [x, y], w) in &self.rows {
            let f = field[row as usize];
            // A component changes sign with every flipped axis it names once.
            let odd = [false, false, false, x != y, y, x];
            for c in 0..6 {
                sum[c] += if odd[c] { -w * f[c] } else { w * f[c] };
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{block, geometry, jitter};
    use formats::space::Space;

    /// A tensor with one component that mirroring leaves alone: a scalar.
    fn even(value: f64) -> [f64; 6] {
        [value, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    #[test]
    fn linear_fields_are_exact_up_to_the_free_surface() {
        for space in Space::ALL {
            for kernel in Kernel::ALL {
                let g = geometry(space, kernel, 0.01);
                let mut rows = block(&g, [10, if space == Space::ThreeD { 10 } else { 1 }, 10]);
                jitter(&mut rows, &g, 0.15);
                let sampler = Sampler::new(&g, &rows);
                let y = if space == Space::ThreeD { 0.05 } else { 0.0 };
                for at in [[0.05, y, 0.05], [0.05, y, 0.098], [0.098, y, 0.098], [0.0, 0.0, 0.0], [0.001, y, 0.1]] {
                    // Near a plane of symmetry a scalar is even, so linear in z only.
                    let slope = if at[0] < 0.05 { 0.0 } else { 1.5 };
                    let linear = |x: [f64; 3]| 3.0 - 2.0 * x[2] + slope * x[0];
                    let field: Vec<[f64; 6]> = rows.position.iter().map(|&x| even(linear(x))).collect();
                    let s = sampler.stencil(at).unwrap();
                    let error = (s.symmetric(&field)[0] - linear(at)).abs();
                    assert!(error < 1e-12, "{space:?} {kernel:?} {at:?}: {error:e}");
                }
            }
        }
    }

    #[test]
    fn odd_components_vanish_on_the_plane_of_symmetry_and_are_linear_across_it() {
        let g = geometry(Space::ThreeD, Kernel::CubicSpline, 0.01);
        let mut rows = block(&g, [8, 8, 8]);
        jitter(&mut rows, &g, 0.15);
        let stress: Vec<[f64; 6]> =
            rows.position.iter().map(|x| [1.0, 2.0, x[2], 0.0, 3.0 * x[1], 5.0 * x[0]]).collect();
        let sampler = Sampler::new(&g, &rows);
        for at in [[0.0, 0.0, 0.03], [0.004, 0.0, 0.001], [0.002, 0.003, 0.079]] {
            let s = sampler.stencil(at).unwrap();
            let t = s.symmetric(&stress);
            let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b} at {at:?}");
            close(t[2], at[2]);
            close(t[3], 0.0);
            close(t[4], 3.0 * at[1]);
            close(t[5], 5.0 * at[0]);
        }
    }

    #[test]
    fn a_line_of_particles_falls_back_to_shepard_and_two_give_nothing() {
        let g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01);
        let mut rows = block(&g, [1, 1, 5]);
        rows.position.iter_mut().for_each(|x| x[0] += 0.5);
        let at = [0.505, 0.0, 0.025];
        let sampler = Sampler::new(&g, &rows);
        assert!((sampler.stencil(at).unwrap().symmetric(&[even(4.0); 5])[0] - 4.0).abs() < 1e-14);
        assert!(sampler.stencil([0.505, 0.0, 0.066]).is_none());
        assert!(sampler.stencil([9.0, 0.0, 0.0]).is_none());
    }

    #[test]
    fn the_fraction_is_one_inside_and_half_on_a_surface() {
        let g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01);
        let rows = block(&g, [20, 1, 20]);
        let sampler = Sampler::new(&g, &rows);
        assert!((sampler.fraction([0.105, 0.0, 0.105]) - 1.0).abs() < 2e-3);
        assert!((sampler.fraction([0.105, 0.0, 0.2]) - 0.5).abs() < 5e-3);
        // On the plane of symmetry the material goes on.
        assert!((sampler.fraction([0.0, 0.0, 0.1]) - 1.0).abs() < 1e-2);
        assert_eq!(sampler.fraction([0.1, 0.0, 0.3]), 0.0);
    }
}
