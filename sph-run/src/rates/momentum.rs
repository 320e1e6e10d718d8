//! Acceleration by stress and by the linear artificial viscosity.

use crate::algebra::{Matrix, Sym, Vector};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::space::Space;
use crate::sweep::{Pairs, around};
use std::ops::Add;

/// A stress, alone or times the correction of the gradient.
pub trait Traction<const D: usize, const N: usize>: Copy + Add<Output = Self> {
    /// stress . n
    fn on<S: Space<D, N>>(&self, n: Vector<D>) -> Vector<D>;
}

impl<const D: usize, const N: usize> Traction<D, N> for Sym<N> {
    #[inline(always)]
    fn on<S: Space<D, N>>(&self, n: Vector<D>) -> Vector<D> {
        S::traction(self, n)
    }
}

impl<const D: usize, const N: usize> Traction<D, N> for Matrix<D> {
    #[inline(always)]
    fn on<S: Space<D, N>>(&self, n: Vector<D>) -> Vector<D> {
        self.times(n)
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
pub fn momentum<const D: usize, const N: usize, S: Space<D, N>, T: Traction<D, N>>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    viscosity: Viscosity,
    weighted: &[T],
    acceleration: &mut [Vector<D>],
    heat: &mut [f64],
) {
    let nearest = 1e-6 * pairs.h * pairs.h;
    for (i, (acceleration, heat)) in acceleration.iter_mut().zip(heat).enumerate() {
        let (v, own) = (particles.v[i], weighted[i]);
        let metric = S::metric(particles.x[i], pairs.spacing);
        let mut sum = Vector::default();
        let mut power = 0.0;
        around(particles, &neighbors.support, i, |pair| {
            let j = pair.j;
            let approach = (v - particles.v[j]).dot(pair.d).min(viscosity.below);
            // Image rings have negative radii; the mean distance from the axis weighs the viscosity.
            let mean_metric = 0.5 * (metric.abs() + S::metric(particles.x[j], pairs.spacing).abs());
            let push = viscosity.strength * mean_metric * approach / pair.r2().max(nearest);
            let weight = particles.volume[j] * pair.slope;
            sum += ((own + weighted[j]).on::<S>(pair.d) + pair.d * push) * weight;
            power += push * approach * weight;
        });
        *acceleration = sum * (1.0 / (particles.density[i] * metric));
        *heat = -0.5 * power / (particles.density[i] * metric);
    }
}
