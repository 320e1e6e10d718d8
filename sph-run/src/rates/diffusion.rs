//! Diffusion that takes noise out of a field and leaves linear fields as they are.

use crate::algebra::Matrix;
use crate::lanes::{Lanes, Parts};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Block, Needs, Pair, Pairs, Sums};

/// What can diffuse: density, stress.
pub trait Diffusing: Parts<Number = f64> + Default {}
impl<F: Parts<Number = f64> + Default> Diffusing for F {}

/// Gradient of a field at every owned particle, component by component: sum_j V_j (f_j - f_i) L_i grad_i W_ij over the
/// material (Yang et al. 2020, Eq 25).
pub fn gradient<const D: usize, const N: usize, K: Kernel, F: Diffusing>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    correction: &[Matrix<D>],
    field: &[F],
    gradient: &mut Vec<[F; D]>,
) {
    gradient.clear();
    gradient.resize(particles.owned, [F::default(); D]);
    let mut sums = Gradient { end: particles.mirror, field, gradient };
    neighbors.sweep::<K, f64>(pairs, &mut sums);
    for (gradient, Matrix(l)) in gradient.iter_mut().zip(correction) {
        let plain = *gradient;
        *gradient =
            std::array::from_fn(|a| F::from_parts(|k| (0..D).fold(0.0, |sum, b| sum + plain[b].part(k) * l[a][b])));
    }
}

struct Gradient<'a, const D: usize, F> {
    end: usize,
    field: &'a [F],
    gradient: &'a mut [[F; D]],
}

impl<const D: usize, F: Diffusing> Sums<D, f64> for Gradient<'_, D, F> {
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let own = block.own(self.field);
        let mut sum: [F::With<L>; D] = block.zero();
        for pair in pairs.filter(|pair| pair.j < self.end) {
            let weight = block.same(pair.other.weight) * pair.slope;
            let other = block.all(&self.field[pair.j]);
            for a in 0..D {
                let way = pair.d.0[a] * weight;
                sum[a] = Parts::from_parts(|k| (other.part(k) - own.part(k)).multiply_add(way, sum[a].part(k)));
            }
        }
        block.put(self.gradient, sum);
    }
}

/// Rate of change of a field at every owned particle, with `strength` = delta h c0, m2/s:
///
/// ```text
/// strength sum_j V_j (2 (f_j - f_i) x_ji/r^2 - [grad f_i + grad f_j]) . grad_i W_ij
/// ```
///
/// over the material: delta-SPH for the density (Antuono et al. 2010; Yang et al. 2020, Eqs 23, 24), and the same operator for
/// each component of the stress (Feng et al. 2021). The gradients take out what is linear, so that it does not bend the
/// profile at a free surface. What one particle gains the other loses: sum V df/dt = 0, with the sections of rings in the
/// axisymmetric space.
pub fn diffusion<const D: usize, const N: usize, K: Kernel, F: Diffusing>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    strength: f64,
    field: &[F],
    gradient: &[[F; D]],
    rate: &mut Vec<F>,
) {
    rate.clear();
    rate.resize(particles.owned, F::default());
    let mut sums = Diffusion { end: particles.mirror, strength, field, gradient, rate };
    neighbors.sweep::<K, f64>(pairs, &mut sums);
}

struct Diffusion<'a, const D: usize, F> {
    end: usize,
    strength: f64,
    field: &'a [F],
    gradient: &'a [[F; D]],
    rate: &'a mut [F],
}

impl<const D: usize, F: Diffusing> Sums<D, f64> for Diffusion<'_, D, F> {
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let (own, slope) = (block.own(self.field), block.own(self.gradient));
        let two = block.number(2.0);
        let mut sum: F::With<L> = block.zero();
        for pair in pairs.filter(|pair| pair.j < self.end) {
            // x_ji . grad W/r^2 = -slope.
            let weight = block.same(-pair.other.weight) * pair.slope;
            let (other, slope_there) = (block.all(&self.field[pair.j]), block.all(&self.gradient[pair.j]));
            sum = Parts::from_parts(|k| {
                let mut psi = (other.part(k) - own.part(k)) * two;
                for a in 0..D {
                    psi = (slope[a].part(k) + slope_there[a].part(k)).multiply_add(pair.d.0[a], psi);
                }
                psi.multiply_add(weight, sum.part(k))
            });
        }
        let strength = block.number(self.strength);
        block.put(self.rate, Parts::from_parts(|k| sum.part(k) * strength));
    }
}
