//! Acceleration by stress and by the linear artificial viscosity.

use crate::algebra::{Matrix, Sym, Vector};
use crate::lanes::{Element, Lanes, Parts, prefetch};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::space::Space;
use crate::sweep::{Block, Mover, Needs, Pair, Pairs, Sums};
use std::marker::PhantomData;
use std::ops::Range;

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

/// What the acceleration needs of a particle beside its place and velocity, side by side in memory.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct Stressed<F, T> {
    /// w sigma, or w sigma L.
    weighted: F,
    /// As [`Mover::weight`].
    weight: T,
    /// |w|/2: image rings have negative radii, and the mean distance from the axis weighs the viscosity.
    radius: T,
}

impl<F: Parts> Stressed<F, F::Number> {
    /// The particles of a part, behind those before it, with `weighted(i)` = w sigma or w sigma L of each. `per_volume`:
    /// [`crate::sweep::weight`].
    pub fn part<const D: usize, const N: usize, S: Space<D, N>, G: Parts<Number = f64>>(
        part: Range<usize>,
        particles: &Particles<D, N>,
        spacing: f64,
        per_volume: f64,
        weighted: impl Fn(usize) -> G,
        stressed: &mut Vec<Self>,
    ) where
        F::Number: Element,
    {
        let of = F::Number::of;
        stressed.truncate(part.start);
        stressed.extend(part.map(|i| {
            let weighted = weighted(i);
            Self {
                weighted: F::from_parts(|k| of(weighted.part(k))),
                weight: of(particles.volume[i] * per_volume),
                radius: of(half_radius::<D, N, S>(particles.x[i], spacing)),
            }
        }));
    }
}

/// |w|/2
pub(super) fn half_radius<const D: usize, const N: usize, S: Space<D, N>>(x: Vector<D>, spacing: f64) -> f64 {
    0.5 * S::metric(x, spacing).abs()
}

/// Acceleration of the owned particles of a part, in whole blocks, m/s2; gravity is added by the caller. `heat`: power the
/// viscosity turns into heat, W/kg, half of each pair's.
///
/// The viscosity is pi = min(v_ij . x_ij, below)/r^2: of the printed Eq 22 the sign that takes energy out.
pub fn momentum<const D: usize, const N: usize, S: Space<D, N>, K: Kernel, F: Traction<D, N, T>, T: Element>(
    part: Range<usize>,
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    viscosity: Viscosity,
    stressed: &[Stressed<F, T>],
    (acceleration, heat): (&mut [Vector<D>], &mut [f64]),
) {
    let (movers, unit) = (T::movers(neighbors), T::unit(pairs.h));
    let viscosity = Viscosity { strength: viscosity.strength / unit, ..viscosity };
    let space = PhantomData::<(S, [(); N])>;
    let sums = &mut Momentum { movers, stressed, viscosity, acceleration, heat, space };
    neighbors.sweep_part::<K, T>(pairs, part.clone(), sums);
    let results = acceleration[part.clone()].iter_mut().zip(&mut heat[part.clone()]);
    for (i, (acceleration, heat)) in part.zip(results) {
        let per_mass = 1.0 / (particles.density[i] * S::metric(particles.x[i], pairs.spacing) * unit);
        *acceleration = *acceleration * per_mass;
        *heat *= -0.5 * per_mass;
    }
}

struct Momentum<'a, const D: usize, T: Element, F, S> {
    movers: &'a [Mover<D, T>],
    stressed: &'a [Stressed<F, T>],
    viscosity: Viscosity,
    acceleration: &'a mut [Vector<D>],
    heat: &'a mut [f64],
    /// The space S and its N.
    space: PhantomData<S>,
}

impl<'b, const D: usize, const N: usize, T: Element, F: Traction<D, N, T>, S: Space<D, N>> Sums<D, T>
    for Momentum<'b, D, T, F, (S, [(); N])>
{
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn fetch(&self) -> impl Fn(usize) + use<'b, D, N, T, F, S> {
        let stressed = self.stressed;
        move |j| prefetch(&stressed[j])
    }

    #[inline(always)]
    fn block<'a, L: Lanes<Element = T>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let v = block.own_of(self.movers, |mover| &mover.v);
        let own = block.own_of(self.stressed, |stressed| &stressed.weighted);
        let radius = block.own_number_of(self.stressed, |stressed| stressed.radius);
        let strength = block.number(self.viscosity.strength);
        let below = block.number(self.viscosity.below);
        let mut sum: Vector<D, L> = block.zero();
        let mut power = block.number(0.0);
        for pair in pairs {
            let other = &self.stressed[pair.j];
            let approach = (v - block.all(&pair.other.v)).dot(pair.d).least(below);
            let mut push = strength * approach * (pair.inverse * pair.inverse);
            if S::WEIGHTED {
                push = push * (radius + block.same(other.radius));
            }
            let weight = block.same(other.weight) * pair.slope;
            sum += F::on::<S, L>(own, block.all(&other.weighted), push, pair.d * weight);
            power = (push * approach).multiply_add(weight, power);
        }
        block.put(self.acceleration, sum);
        block.put(self.heat, power);
    }
}
