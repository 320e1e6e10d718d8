//! Viscosity between particles beyond the linear artificial one. Each adds to accelerations and to the heat that
//! [`super::momentum`] has begun.

use crate::algebra::{Matrix, Vector};
use crate::material::Mean;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::space::Space;
use crate::sweep::{Pairs, around};

/// Adds the acceleration by the viscosity of a fluid of variable viscosity (Szewc 2017, Eq 9, in volume form), m/s2:
///
/// ```text
/// 1/rho_i sum_j V_j (mu_i + mu_j) x_ij . grad_i W_ij/(r^2 + eta^2) v_ij      eta = 0.01 h
/// ```
///
/// or with 4 mu_i mu_j/(mu_i + mu_j) in place of the sum (Cleary & Monaghan 1999). It stands for div(mu grad v), without
/// the part of grad v^T. In the axisymmetric space pairs count by the mean of their radii, and -mu v_r/(rho r^2) is added.
pub fn between_particles<const D: usize, const N: usize, S: Space<D, N>>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    mean: Mean,
    acceleration: &mut [Vector<D>],
    heat: &mut [f64],
) {
    let eta2 = 1e-4 * pairs.h * pairs.h;
    for (i, (acceleration, heat)) in acceleration.iter_mut().zip(heat).enumerate() {
        let (x, v, mu, density) = (particles.x[i], particles.v[i], particles.viscosity[i], particles.density[i]);
        let metric = S::metric(x, pairs.spacing).abs();
        let mut sum = Vector::default();
        let mut power = 0.0;
        around(particles, &neighbors.support, i, |pair| {
            let other = particles.viscosity[pair.j];
            let both = match mean {
                Mean::Arithmetic => mu + other,
                Mean::Harmonic => 4.0 * mu * other / (mu + other).max(f64::MIN_POSITIVE),
            };
            let mean_metric = 0.5 * (metric + S::metric(particles.x[pair.j], pairs.spacing).abs());
            let weight = particles.volume[pair.j] * pair.slope * both * mean_metric * pair.r2() / (pair.r2() + eta2);
            let difference = v - particles.v[pair.j];
            sum += difference * weight;
            power += difference.norm2() * weight;
        });
        let per_mass = 1.0 / (density * metric);
        let hoop = S::strain_rate(&Matrix::default(), x, v, pairs.spacing) * mu;
        *acceleration += sum * per_mass + S::hoop(&hoop, density, x, pairs.spacing);
        *heat += -0.5 * power * per_mass - S::hoop(&hoop, density, x, pairs.spacing).dot(v);
    }
}

/// Quadratic artificial viscosity of impacts (von Neumann & Richtmyer 1950; Monaghan 1992): on approaching pairs the
/// pressures of both add up to
/// beta rho0 (h v_ij . x_ij/(r^2 + 0.01 h^2))^2. `strength`: beta rho0 h^2, Pa s2.
pub fn on_impact<const D: usize, const N: usize, S: Space<D, N>>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    strength: f64,
    acceleration: &mut [Vector<D>],
    heat: &mut [f64],
) {
    let eta2 = 0.01 * pairs.h * pairs.h;
    for (i, (acceleration, heat)) in acceleration.iter_mut().zip(heat).enumerate() {
        let v = particles.v[i];
        let metric = S::metric(particles.x[i], pairs.spacing).abs();
        let mut sum = Vector::default();
        let mut power = 0.0;
        around(particles, &neighbors.support, i, |pair| {
            let approach = (v - particles.v[pair.j]).dot(pair.d).min(0.0);
            let rate = approach / (pair.r2() + eta2);
            let mean_metric = 0.5 * (metric + S::metric(particles.x[pair.j], pairs.spacing).abs());
            let push = -strength * rate * rate * mean_metric * particles.volume[pair.j] * pair.slope;
            sum += pair.d * push;
            power += approach * push;
        });
        let per_mass = 1.0 / (particles.density[i] * metric);
        *acceleration += sum * per_mass;
        *heat -= 0.5 * power * per_mass;
    }
}
