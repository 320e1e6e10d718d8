//! Velocity gradient.

use crate::algebra::{Matrix, Vector};
use crate::lanes::{Element, Lanes};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Block, Needs, Pair, Pairs, Sums, Sweep};

/// Velocity gradient of every owned particle, 1/s: sum_j V_j (v_j - v_i) (x) grad_i W_ij.
pub fn velocity_gradient<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    gradient: &mut [Matrix<D>],
) {
    let Particles { x, v, volume, .. } = particles;
    Sweep::owned(x, neighbors).run::<D, f64, K>(pairs, &mut VelocityGradient { v, volume, gradient });
}

struct VelocityGradient<'a, const D: usize, T> {
    v: &'a [Vector<D, T>],
    volume: &'a [T],
    gradient: &'a mut [Matrix<D>],
}

impl<const D: usize, T: Element> Sums<D, T> for VelocityGradient<'_, D, T> {
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<L: Lanes<Element = T>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<D, L>>) {
        let v = block.own(self.v);
        let mut sum: Matrix<D, L> = block.zero();
        for pair in pairs {
            let weight = block.same(self.volume[pair.j]) * pair.slope;
            sum.add_outer((block.all(&self.v[pair.j]) - v) * weight, pair.d);
        }
        block.put(self.gradient, sum);
    }
}
