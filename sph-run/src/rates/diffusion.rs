//! Diffusion that takes noise out of a field and leaves linear fields as they are.

use crate::algebra::{Matrix, Vector};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::sweep::around;
use std::ops::{Add, Mul, Sub};

/// What can diffuse: density, stress.
pub trait Diffusing: Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self> {}
impl<T: Copy + Default + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>> Diffusing for T {}

/// Gradient of a field at every owned particle, component by component: sum_j V_j (f_j - f_i) L_i grad_i W_ij over the
/// material (Yang et al. 2020, Eq 25).
pub fn gradient<const D: usize, const N: usize, T: Diffusing>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    correction: &[Matrix<D>],
    field: &[T],
    gradient: &mut Vec<[T; D]>,
) {
    gradient.clear();
    for i in 0..particles.owned {
        let own = field[i];
        let mut sum = [T::default(); D];
        around(particles, &neighbors.support, i, |pair| {
            if pair.j < particles.mirror {
                let difference = (field[pair.j] - own) * (particles.volume[pair.j] * pair.slope);
                for a in 0..D {
                    sum[a] = sum[a] + difference * pair.d.0[a];
                }
            }
        });
        let l = &correction[i].0;
        gradient.push(std::array::from_fn(|a| (0..D).fold(T::default(), |g, b| g + sum[b] * l[a][b])));
    }
}

/// Rate of change of a field at every owned particle, with `strength` = delta h c0, m2/s:
///
/// ```text
/// strength sum_j V_j (2 (f_j - f_i) x_ji/r^2 - [grad f_i + grad f_j]) . grad_i W_ij
/// ```
///
/// over the material: delta-SPH for the density (Antuono et al. 2010; Yang et al. 2020, Eqs 23, 24), and the same operator for
/// each component of the stress (Feng et al. 2021). The gradients take out what is linear, so that it does not bend the
/// profile at a free surface. What one particle gains the other loses: sum V df/dt = 0, with the sections of rings in the
/// axisymmetric space.
pub fn diffusion<const D: usize, const N: usize, T: Diffusing>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    strength: f64,
    field: &[T],
    gradient: &[[T; D]],
    rate: &mut Vec<T>,
) {
    let along = |g: &[T; D], d: Vector<D>| (0..D).fold(T::default(), |sum, a| sum + g[a] * d.0[a]);
    rate.clear();
    for i in 0..particles.owned {
        let (own, slope) = (field[i], gradient[i]);
        let mut sum = T::default();
        around(particles, &neighbors.support, i, |pair| {
            if pair.j < particles.mirror {
                // x_ji . grad W/r^2 = -slope.
                let linear = along(&slope, pair.d) + along(&gradient[pair.j], pair.d);
                let psi = (field[pair.j] - own) * 2.0 + linear;
                sum = sum - psi * (particles.volume[pair.j] * pair.slope);
            }
        });
        rate.push(sum * strength);
    }
}
