//! Shifting of particles towards an even arrangement, inside the body only.

use crate::algebra::Vector;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::sweep::{Pairs, around};

/// Constant A of Skillen, Lind, Stansby & Rogers (2013) where the scene asks for shifting = 1.
const STRENGTH: f64 = 2.0;
/// Share of the full divergence of positions, sum_j V_j x_ji . grad W = D, below which a particle is at a free surface
/// (Lee et al. 2008 take 0.75). On a lattice it is 0.98 inside, 0.92 in the second layer, 0.7 in the first.
const INSIDE: f64 = 0.85;
/// Largest shift over spacing in one step.
const LARGEST: f64 = 0.05;

/// 1 for the owned particles at a free surface, 0 for all others.
pub fn surface<const D: usize, const N: usize>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    surface: &mut Vec<f64>,
) {
    surface.clear();
    for i in 0..particles.owned {
        let mut divergence = 0.0;
        around(particles, &neighbors.support, i, |pair| {
            divergence -= pair.r2() * particles.volume[pair.j] * pair.slope;
        });
        surface.push(if divergence < INSIDE * D as f64 { 1.0 } else { 0.0 });
    }
}

/// What is shifted, and how far.
#[derive(Clone, Copy, Debug)]
pub struct Shifting<'a> {
    /// Strength, 1 for the constant of Skillen et al.
    pub strength: f64,
    /// Length of the step, s.
    pub dt: f64,
    /// [`surface`] of all particles; 0 behind walls.
    pub surface: &'a [f64],
}

/// The shift of every owned particle in a step, m: -A h |v| dt grad C with the concentration gradient
/// grad C = sum_j V_j grad_i W_ij (Lind et al. 2012; Skillen et al. 2013). 0 where the support reaches a free surface: there
/// the gradient points into the body whatever the arrangement, and would press layers against the outermost one.
pub fn shift<const D: usize, const N: usize>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    shifting: Shifting<'_>,
    shift: &mut Vec<Vector<D>>,
) {
    let Shifting { strength, dt, surface } = shifting;
    shift.clear();
    for i in 0..particles.owned {
        let mut concentration = Vector::<D>::default();
        let mut open = surface[i];
        around(particles, &neighbors.support, i, |pair| {
            concentration += pair.d * (particles.volume[pair.j] * pair.slope);
            open += surface[pair.j];
        });
        let way = concentration * (-STRENGTH * strength * pairs.h * particles.v[i].norm() * dt);
        let scale = (LARGEST * pairs.spacing / way.norm().max(f64::MIN_POSITIVE)).min(1.0);
        shift.push(if open > 0.0 { Vector::default() } else { way * scale });
    }
}
