//! The only loops over pairs of particles. Each gathers into one particle, over its neighbours in ascending key:
//! the sums, and so the bits of the answer, do not depend on ranks, on lists, or on restarts.
//!
//! One work-conjugate pair of operators serves all spaces. With the volume V, the metric w (1, or the radius r in the
//! axisymmetric space, where V is the area of the ring's section) and the gradient of the kernel at i:
//!
//! ```text
//! grad v_i = sum_j V_j (v_j - v_i) (x) grad_i W_ij
//! a_i      = 1/(rho_i w_i) sum_j V_j [w_i sigma_i + w_j sigma_j + viscosity] . grad_i W_ij  (+ hoop term + g)
//! ```
//!
//! The force between two particles of the material is antisymmetric in i and j, and its power is minus the power of the
//! stress on the velocity gradient, to rounding: sum m v.a = -sum w V sigma:D (test C10). Images across the axis, which
//! have signed radii, and wall particles by Shepard's interpolation are not exactly conjugate.

use crate::algebra::{Matrix, Sym, Vector};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::space::Space;

/// What the sweeps need to know beside the particles.
#[derive(Clone, Copy, Debug)]
pub struct Pairs {
    /// Smoothing length h, m.
    pub h: f64,
    /// Lattice spacing dx, m.
    pub spacing: f64,
    /// alpha h c0 rho0 of the artificial viscosity, Pa s (Yang et al. 2020, Eq 22); 0 switches it off.
    pub viscosity: f64,
}

/// Scales that turn the kernel's pure numbers into W and grad W for one smoothing length.
#[derive(Clone, Copy)]
struct Scales {
    support2: f64,
    per_h: f64,
    value: f64,
    slope: f64,
}

impl Scales {
    fn new<const D: usize, K: Kernel>(h: f64) -> Self {
        let value = K::KIND.norm(D) / h.powi(D as i32);
        Self { support2: 4.0 * h * h, per_h: 1.0 / h, value, slope: value / (h * h) }
    }
}

/// Velocity gradient of every owned particle, 1/s.
pub fn velocity_gradient<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    gradient: &mut [Matrix<D>],
) {
    let scales = Scales::new::<D, K>(pairs.h);
    for (i, gradient) in gradient.iter_mut().enumerate() {
        let (x, v) = (particles.x[i], particles.v[i]);
        let mut sum = Matrix::default();
        for &j in neighbors.of_owned.of(i) {
            let j = j as usize;
            let d = x - particles.x[j];
            let r2 = d.norm2();
            if r2 < scales.support2 {
                let slope = scales.slope * K::KIND.slope_over_q(r2.sqrt() * scales.per_h);
                sum.add_outer(particles.volume[j] * slope, particles.v[j] - v, d);
            }
        }
        *gradient = sum;
    }
}

/// Acceleration of every owned particle by stress and artificial viscosity, m/s2; gravity is added by the caller.
///
/// `weighted` is w sigma of every particle. The viscosity acts on approaching pairs only and has the sign that takes
/// energy out: pi = min(v_ij . x_ij, 0)/r^2 (the printed Eq 22 of Yang et al. 2020 has the other one).
pub fn momentum<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    weighted: &[Sym<N>],
    acceleration: &mut [Vector<D>],
) {
    let scales = Scales::new::<D, K>(pairs.h);
    let nearest = 1e-6 * pairs.h * pairs.h;
    for (i, acceleration) in acceleration.iter_mut().enumerate() {
        let (x, v, own) = (particles.x[i], particles.v[i], weighted[i]);
        let metric = S::metric(x, pairs.spacing);
        let mut sum = Vector::default();
        for &j in neighbors.of_owned.of(i) {
            let j = j as usize;
            let d = x - particles.x[j];
            let r2 = d.norm2();
            if r2 < scales.support2 {
                let slope = scales.slope * K::KIND.slope_over_q(r2.sqrt() * scales.per_h);
                let approach = (v - particles.v[j]).dot(d).min(0.0) / r2.max(nearest);
                // Image rings have negative radii; the mean distance from the axis weighs the viscosity.
                let mean_metric = 0.5 * (metric.abs() + S::metric(particles.x[j], pairs.spacing).abs());
                let stress = S::traction(&(own + weighted[j]), d);
                let pair = stress + d * (pairs.viscosity * mean_metric * approach);
                sum += pair * (particles.volume[j] * slope);
            }
        }
        *acceleration = sum * (1.0 / (particles.density[i] * metric));
    }
}

/// Shepard weights V_j W_wj / sum V_k W_wk of the material around every wall particle, in the order of its list.
/// All zero where no material is in reach.
pub fn wall_weights<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    weights: &mut Vec<f64>,
) {
    let scales = Scales::new::<D, K>(pairs.h);
    weights.clear();
    for wall in 0..neighbors.of_wall.len() {
        let x = particles.x[particles.mirror + wall];
        let first = weights.len();
        let mut sum = 0.0;
        for &j in neighbors.of_wall.of(wall) {
            let r2 = (x - particles.x[j as usize]).norm2();
            let mut weight = 0.0;
            if r2 < scales.support2 {
                weight = particles.volume[j as usize] * scales.value * K::KIND.shape(r2.sqrt() * scales.per_h);
            }
            sum += weight;
            weights.push(weight);
        }
        if sum > 0.0 {
            for weight in &mut weights[first..] {
                *weight /= sum;
            }
        }
    }
}

/// Sum over the material around wall particle `wall` of weight times `field`.
pub fn extrapolate<T: Copy + Default + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>>(
    neighbors: &Neighbors,
    weights: &[f64],
    wall: usize,
    field: &[T],
) -> T {
    let first = neighbors.of_wall.start(wall);
    let list = neighbors.of_wall.of(wall).iter().zip(&weights[first..]);
    list.fold(T::default(), |sum, (&j, &weight)| sum + field[j as usize] * weight)
}
