//! The tensor that makes a gradient exact for linear fields.

use crate::algebra::Matrix;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Pairs, Scales, around};

/// Determinants of sum_j V_j x_ji (x) grad W below this belong to particles with hardly any neighbours, or all on one side:
/// they get the unit tensor. Inside it is 1, at a flat surface about 0.5, in a corner 0.25.
const LEAST_DETERMINANT: f64 = 0.15;

/// Which neighbours count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Among {
    /// The material, its copies and images.
    Material,
    /// Wall particles too.
    All,
}

impl Among {
    /// End of the indices that count.
    pub fn end<const D: usize, const N: usize>(self, particles: &Particles<D, N>) -> usize {
        match self {
            Self::Material => particles.mirror,
            Self::All => particles.len(),
        }
    }
}

/// L_i = (sum_j V_j x_ji (x) grad_i W_ij)^-1 of every owned particle, symmetric (Randles & Libersky 1996; Yang et al. 2020,
/// Eq 26).
pub fn correction<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    among: Among,
    correction: &mut Vec<Matrix<D>>,
) {
    let scales = Scales::new::<D, K>(pairs.h);
    let end = among.end(particles);
    correction.clear();
    for i in 0..particles.owned {
        let mut sum = Matrix::default();
        around::<D, N, K>(particles, neighbors.of_owned.of(i), scales, i, |pair| {
            if pair.j < end {
                sum.add_outer(-particles.volume[pair.j] * pair.slope, pair.d, pair.d);
            }
        });
        let determinant = sum.determinant();
        correction.push(if determinant < LEAST_DETERMINANT { Matrix::unit() } else { sum.inverse(determinant) });
    }
}
