//! The tensor that makes a gradient exact for linear fields.

use crate::algebra::Matrix;
use crate::lanes::Lanes;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Block, Needs, Pair, Pairs, Sums};

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
pub fn correction<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    among: Among,
    correction: &mut Vec<Matrix<D>>,
) {
    correction.clear();
    correction.resize(particles.owned, Matrix::default());
    let mut sums = Moments { end: among.end(particles), moments: correction };
    neighbors.sweep::<K, f64>(pairs, &mut sums);
    for moment in correction {
        let inverse = moment.inverse(moment.determinant());
        // Not a number where the determinant is 0: no comparison holds.
        let sound = inverse.0.iter().flatten().map(|l| l * l).sum::<f64>() <= LARGEST * LARGEST;
        *moment = if sound { inverse } else { Matrix::unit() };
    }
}

/// sum_j V_j x_ji (x) grad_i W_ij
struct Moments<'a, const D: usize> {
    end: usize,
    moments: &'a mut [Matrix<D>],
}

impl<const D: usize> Sums<D, f64> for Moments<'_, D> {
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let mut sum: Matrix<D, L> = block.zero();
        for pair in pairs.filter(|pair| pair.j < self.end) {
            let weight = block.same(-pair.other.weight) * pair.slope;
            sum.add_outer(pair.d * weight, pair.d);
        }
        block.put(self.moments, sum);
    }
}
