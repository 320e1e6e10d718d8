//! Extrapolation of the material's state to wall particles (Yang et al. 2020, Eqs 27-32).

use crate::lanes::{Lanes, Parts};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Block, Needs, Pair, Pairs, Sums, Sweep};

/// Shepard's interpolation of a field at every wall particle, sum_j V_j W_wj f_j/sum_j V_j W_wj over the material; zero where
/// no material is in reach. `field` holds all particles of the material, and may hold more.
pub fn extrapolate<const D: usize, const N: usize, K: Kernel, F: Parts<Number = f64> + Default>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    field: &[F],
    at_walls: &mut Vec<F>,
) {
    at_walls.clear();
    at_walls.resize(particles.len() - particles.mirror, F::default());
    let first = particles.mirror;
    let (movers, lists) = (&neighbors.movers[..], &neighbors.of_wall);
    let sweep = Sweep { movers, lists, part: 0..lists.len(), first };
    sweep.run::<K>(pairs.h, pairs.instructions, &mut Shepard { field, first, at_walls });
}

struct Shepard<'a, F> {
    field: &'a [F],
    first: usize,
    at_walls: &'a mut [F],
}

impl<const D: usize, F: Parts<Number = f64>> Sums<D, f64> for Shepard<'_, F> {
    const NEEDS: Needs = Needs::VALUE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let mut weights = block.number(0.0);
        let mut sum: F::With<L> = block.zero();
        for pair in pairs {
            let weight = pair.value * block.same(pair.other.weight);
            let value = block.all(&self.field[pair.j]);
            weights = weights + weight;
            sum = Parts::from_parts(|k| value.part(k).multiply_add(weight, sum.part(k)));
        }
        // 0/smallest where no material is in reach.
        let weights = weights.largest(block.number(f64::MIN_POSITIVE));
        block.put_from(self.first, self.at_walls, Parts::from_parts(|k| sum.part(k).over(weights)));
    }
}
