//! Velocity gradient.

use crate::algebra::Matrix;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::sweep::around;

/// Velocity gradient of every owned particle, 1/s: sum_j V_j (v_j - v_i) (x) grad_i W_ij.
pub fn velocity_gradient<const D: usize, const N: usize>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    gradient: &mut [Matrix<D>],
) {
    for (i, gradient) in gradient.iter_mut().enumerate() {
        let v = particles.v[i];
        let mut sum = Matrix::default();
        around(particles, &neighbors.support, i, |pair| {
            sum.add_outer(particles.volume[pair.j] * pair.slope, particles.v[pair.j] - v, pair.d);
        });
        *gradient = sum;
    }
}
