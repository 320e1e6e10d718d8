//! Artificial stress against clumping in tension (Monaghan 2000; Gray, Monaghan & Swift 2001; Bui et al. 2008).

use crate::algebra::{Sym, Vector, tensile_part};
use crate::lanes::Lanes;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::rates::momentum::Traction;
use crate::space::Space;
use crate::sweep::{Block, Needs, Pair, Pairs, Sums};
use std::marker::PhantomData;

/// The stress that holds particles apart: -epsilon w times the tensile principal stresses, of every particle.
pub fn opposing<const D: usize, const N: usize, S: Space<D, N>>(
    particles: &Particles<D, N>,
    epsilon: f64,
    spacing: f64,
    opposing: &mut Vec<Sym<N>>,
) {
    opposing.clear();
    opposing.extend(particles.stress.iter().zip(&particles.x).map(|(&stress, &x)| {
        let tension = tensile_part(S::stress_to_disk(stress));
        S::stress_from_disk(tension) * (-epsilon * S::metric(x, spacing))
    }));
}

/// Adds the acceleration 1/(rho_i w_i) sum_j V_j f^n (R_i + R_j) . grad_i W_ij to every owned particle, with f = W(r)/W(dx)
/// and n = W(0)/W(dx), 2.55 for the cubic spline at h = 1.2 dx. `opposing`: R, see [`opposing`].
pub fn artificial_stress<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    opposing: &[Sym<N>],
    acceleration: &mut [Vector<D>],
) {
    let mut force = vec![Vector::default(); particles.owned];
    let shape = |r: f64| K::KIND.shape(r / pairs.h);
    let near = shape(pairs.spacing) * pairs.h.powi(K::VALUE_POWER) / K::VALUE;
    let exponent = shape(0.0) / shape(pairs.spacing);
    let sums = Repulsion { opposing, near, exponent, force: &mut force, space: PhantomData };
    let mut sums: Repulsion<'_, D, N, S> = sums;
    neighbors.sweep::<K, f64>(pairs, &mut sums);
    for (i, acceleration) in acceleration.iter_mut().enumerate() {
        *acceleration += force[i] * (1.0 / (particles.density[i] * S::metric(particles.x[i], pairs.spacing)));
    }
}

struct Repulsion<'a, const D: usize, const N: usize, S> {
    opposing: &'a [Sym<N>],
    /// W(dx), with the factor that the values of pairs have.
    near: f64,
    exponent: f64,
    force: &'a mut [Vector<D>],
    space: PhantomData<S>,
}

impl<const D: usize, const N: usize, S: Space<D, N>> Sums<D, f64> for Repulsion<'_, D, N, S> {
    const NEEDS: Needs = Needs { value: true, ..Needs::SLOPE };

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let own = block.own(self.opposing);
        let in_tension = block.any_lane(self.opposing, |opposing| *opposing != Sym::default());
        let zero = block.number(0.0);
        let mut sum: Vector<D, L> = block.zero();
        for pair in pairs {
            let other = &self.opposing[pair.j];
            // Most pairs are not in tension, and powers are dear.
            if in_tension || *other != Sym::default() {
                let value = pair.value;
                let f = block.lanes(|k| (value.lane(k) / self.near).powf(self.exponent));
                let weight = f * block.same(pair.other.weight) * pair.slope;
                sum += <Sym<N> as Traction<D, N, f64>>::on::<S, L>(own, block.all(other), zero, pair.d * weight);
            }
        }
        block.put(self.force, sum);
    }
}
