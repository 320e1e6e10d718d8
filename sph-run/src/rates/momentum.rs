//! Acceleration by stress and by the linear artificial viscosity.

use crate::algebra::{Matrix, Sym, Vector};
use crate::lanes::{Element, Lanes, Parts};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::space::Space;
use crate::sweep::{Block, Needs, Pair, Pairs, Sums, Sweep};
use std::marker::PhantomData;

/// A stress, alone or times the correction of the gradient.
pub trait Traction<const D: usize, const N: usize, T: Element>: Parts<Number = T> {
    /// (own + other + push I) . n
    fn on<S: Space<D, N>, L: Lanes<Element = T>>(
        own: Self::With<L>,
        other: Self::With<L>,
        push: L,
        n: Vector<D, L>,
    ) -> Vector<D, L>;
}

impl<const D: usize, const N: usize, T: Element> Traction<D, N, T> for Sym<N, T> {
    #[inline(always)]
    fn on<S: Space<D, N>, L: Lanes<Element = T>>(
        own: Sym<N, L>,
        other: Sym<N, L>,
        push: L,
        n: Vector<D, L>,
    ) -> Vector<D, L> {
        let mut sum = own + other;
        for a in 0..3 {
            sum.0[a] = sum.0[a] + push;
        }
        S::traction(&sum, n)
    }
}

impl<const D: usize, const N: usize, T: Element> Traction<D, N, T> for Matrix<D, T> {
    #[inline(always)]
    fn on<S: Space<D, N>, L: Lanes<Element = T>>(
        own: Matrix<D, L>,
        other: Matrix<D, L>,
        push: L,
        n: Vector<D, L>,
    ) -> Vector<D, L> {
        let mut sum = own + other;
        for a in 0..D {
            sum.0[a][a] = sum.0[a][a] + push;
        }
        sum.times(n)
    }
}

/// Artificial viscosity alpha (Yang et al. 2020, Eq 22, with the sign that takes energy out).
#[derive(Clone, Copy, Debug)]
pub struct Viscosity {
    /// alpha h c0 rho0, Pa s.
    pub strength: f64,
    /// It acts where v_ij . x_ij is below this: 0, approaching pairs only (Drucker-Prager), or infinity, all pairs (mu(I)).
    pub below: f64,
}

/// Acceleration of every owned particle, m/s2; gravity is added by the caller. `heat`: power the viscosity turns into
/// heat, W/kg, half of each pair's.
///
/// `weighted` is w sigma, or w sigma L, of every particle. The viscosity is pi = min(v_ij . x_ij, below)/r^2: of the printed
/// Eq 22 the sign that takes energy out.
pub fn momentum<const D: usize, const N: usize, S: Space<D, N>, K: Kernel, F: Traction<D, N, f64>>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    viscosity: Viscosity,
    weighted: &[F],
    acceleration: &mut [Vector<D>],
    heat: &mut [f64],
) {
    let Particles { x, v, volume, .. } = particles;
    let radius = if S::WEIGHTED { half_radii::<D, N, S>(x, pairs.spacing) } else { Vec::new() };
    let mut sums = Momentum {
        v,
        volume,
        weighted,
        radius: &radius,
        viscosity,
        acceleration,
        heat,
        space: PhantomData::<(S, [(); N])>,
    };
    Sweep::owned(x, neighbors).run::<D, f64, K>(pairs, &mut sums);
    for (i, (acceleration, heat)) in acceleration.iter_mut().zip(heat).enumerate() {
        let per_mass = 1.0 / (particles.density[i] * S::metric(x[i], pairs.spacing));
        *acceleration = *acceleration * per_mass;
        *heat *= -0.5 * per_mass;
    }
}

/// Half of |w| of every particle: image rings have negative radii, and the mean distance from the axis
/// weighs the viscosity.
pub(super) fn half_radii<const D: usize, const N: usize, S: Space<D, N>>(x: &[Vector<D>], spacing: f64) -> Vec<f64> {
    x.iter().map(|&x| 0.5 * S::metric(x, spacing).abs()).collect()
}

struct Momentum<'a, const D: usize, T, F, S> {
    v: &'a [Vector<D, T>],
    volume: &'a [T],
    weighted: &'a [F],
    radius: &'a [T],
    viscosity: Viscosity,
    acceleration: &'a mut [Vector<D>],
    heat: &'a mut [f64],
    /// The space S and its N.
    space: PhantomData<S>,
}

impl<const D: usize, const N: usize, T: Element, F: Traction<D, N, T>, S: Space<D, N>> Sums<D, T>
    for Momentum<'_, D, T, F, (S, [(); N])>
{
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<L: Lanes<Element = T>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<D, L>>) {
        let (v, own) = (block.own(self.v), block.own(self.weighted));
        let strength = block.number(self.viscosity.strength);
        let below = block.number(self.viscosity.below);
        let radius = if S::WEIGHTED { block.own_numbers(self.radius) } else { block.number(0.5) };
        let mut sum: Vector<D, L> = block.zero();
        let mut power = block.number(0.0);
        for pair in pairs {
            let j = pair.j;
            let approach = (v - block.all(&self.v[j])).dot(pair.d).least(below);
            let mut push = strength * approach * (pair.inverse * pair.inverse);
            if S::WEIGHTED {
                push = push * (radius + block.same(self.radius[j]));
            }
            let weight = block.same(self.volume[j]) * pair.slope;
            sum += F::on::<S, L>(own, block.all(&self.weighted[j]), push, pair.d * weight);
            power = (push * approach).multiply_add(weight, power);
        }
        block.put(self.acceleration, sum);
        block.put(self.heat, power);
    }
}
