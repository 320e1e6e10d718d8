//! Velocity gradient.

use crate::algebra::Matrix;
use crate::lanes::{Element, Lanes};
use crate::neighbors::Neighbors;
use crate::physics::Kernel;
use crate::sweep::{Block, Mover, Needs, Pair, Pairs, Sums};

/// Velocity gradient of every owned particle, 1/s: sum_j V_j (v_j - v_i) (x) grad_i W_ij.
pub fn velocity_gradient<const D: usize, K: Kernel, T: Element>(
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    gradient: &mut [Matrix<D>],
) {
    gradient_of_part::<D, K, T>(neighbors, pairs, 0, gradient);
}

/// As [`velocity_gradient`], of the particles from `first` on, which begins a block.
pub fn gradient_of_part<const D: usize, K: Kernel, T: Element>(
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    first: usize,
    gradient: &mut [Matrix<D>],
) {
    let movers = T::movers(neighbors);
    let scale = 1.0 / T::unit(pairs.h);
    let part = first..first + gradient.len();
    neighbors.sweep_part::<K, T>(pairs, part, &mut VelocityGradient { movers, scale, first, gradient });
}

struct VelocityGradient<'a, const D: usize, T: Element> {
    movers: &'a [Mover<D, T>],
    scale: f64,
    first: usize,
    gradient: &'a mut [Matrix<D>],
}

impl<const D: usize, T: Element> Sums<D, T> for VelocityGradient<'_, D, T> {
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = T>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let v = block.own_of(self.movers, |mover| &mover.v);
        let mut sum: Matrix<D, L> = block.zero();
        for pair in pairs {
            let weight = block.same(pair.other.weight) * pair.slope;
            sum.add_outer((block.all(&pair.other.v) - v) * weight, pair.d);
        }
        block.put_from(self.first, self.gradient, sum.times_number(block.number(self.scale)));
    }
}
