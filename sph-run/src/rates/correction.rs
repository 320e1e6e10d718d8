//! The tensor that makes a gradient exact for linear fields.

use crate::algebra::Matrix;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::sweep::around;

/// Largest norm sqrt(L:L) of a correction. Beyond it a particle has hardly any neighbours, or all in a row or a plane, and
/// gets the unit tensor: it would amplify noise, and swing too fast for the time step. Inside the norm is sqrt(D), on flat
/// surfaces 3, in corners of blocks 5 (in the plane) and 6 to 8 (3-D), disturbed by 0.15 dx up to 10.5. The determinant
/// would not do: in corners in 3-D it is as small as where five particles meet by chance.
const LARGEST: f64 = 11.0;

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
pub fn correction<const D: usize, const N: usize>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    among: Among,
    correction: &mut Vec<Matrix<D>>,
) {
    let end = among.end(particles);
    correction.clear();
    for i in 0..particles.owned {
        let mut sum = Matrix::default();
        around(particles, &neighbors.support, i, |pair| {
            if pair.j < end {
                sum.add_outer(-particles.volume[pair.j] * pair.slope, pair.d, pair.d);
            }
        });
        let inverse = sum.inverse(sum.determinant());
        // Not a number where the determinant is 0: no comparison holds.
        let sound = inverse.0.iter().flatten().map(|l| l * l).sum::<f64>() <= LARGEST * LARGEST;
        correction.push(if sound { inverse } else { Matrix::unit() });
    }
}
