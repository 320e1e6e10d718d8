//! Extrapolation of the material's state to wall particles (Yang et al. 2020, Eqs 27-32).

use crate::lanes::{Lanes, Parts};
use crate::neighbors::Neighbors;
use crate::physics::Kernel;
use crate::sweep::{Block, Needs, Pair, Pairs, Sums, Sweep};

/// Shepard's interpolation of a field at every wall particle, sum_j V_j W_wj f_j/sum_j V_j W_wj over the material; zero where
/// no material is in reach. `field` has all particles, those of the walls last: they get what the material around them has.
pub fn extrapolate<const D: usize, K: Kernel, F: Parts<Number = f64>>(
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    field: &mut [F],
) {
    let (movers, lists) = (&neighbors.movers[..], &neighbors.of_wall);
    let first = field.len() - lists.len();
    let (material, walls) = field.split_at_mut(first);
    let sweep = Sweep { movers, lists, part: 0..lists.len(), first };
    sweep.run::<K>(pairs.h, pairs.instructions, &mut Shepard { material, first, walls });
}

struct Shepard<'a, F> {
    material: &'a [F],
    first: usize,
    walls: &'a mut [F],
}

impl<const D: usize, F: Parts<Number = f64>> Sums<D, f64> for Shepard<'_, F> {
    const NEEDS: Needs = Needs::VALUE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let mut weights = block.number(0.0);
        let mut sum: F::With<L> = block.zero();
        for pair in pairs {
            let weight = pair.value * block.same(pair.other.weight);
            let value = block.all(&self.material[pair.j]);
            weights = weights + weight;
            sum = Parts::from_parts(|k| value.part(k).multiply_add(weight, sum.part(k)));
        }
        // 0/smallest where no material is in reach.
        let weights = weights.largest(block.number(f64::MIN_POSITIVE));
        block.put_from(self.first, self.walls, Parts::from_parts(|k| sum.part(k).over(weights)));
    }
}
