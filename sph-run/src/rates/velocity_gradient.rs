//! Velocity gradient.

use crate::algebra::Matrix;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Pairs, Scales, around};

/// Velocity gradient of every owned particle, 1/s: sum_j V_j (v_j - v_i) (x) grad_i W_ij.
pub fn velocity_gradient<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    gradient: &mut [Matrix<D>],
) {
    let scales = Scales::new::<D, K>(pairs.h);
    for (i, gradient) in gradient.iter_mut().enumerate() {
        let v = particles.v[i];
        let mut sum = Matrix::default();
        around::<D, N, K>(particles, neighbors.of_owned.of(i), scales, i, |pair| {
            sum.add_outer(particles.volume[pair.j] * pair.slope, particles.v[pair.j] - v, pair.d);
        });
        *gradient = sum;
    }
}
