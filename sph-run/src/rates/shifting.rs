//! Shifting of particles towards an even arrangement, inside the body only.

use crate::algebra::Vector;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Pairs, Scales, around};

/// Constant A of Skillen, Lind, Stansby & Rogers (2013) where the scene asks for shifting = 1.
const STRENGTH: f64 = 2.0;
/// Share of the full divergence of positions, sum_j V_j x_ji . grad W = D, below which a particle is at a free surface (Lee et
/// al. 2008 take 0.75): gradients of concentration there point out of the body.
const INSIDE: f64 = 0.9;
/// Largest shift over spacing in one step.
const LARGEST: f64 = 0.05;

/// The shift of every owned particle in a step, m: -A h |v| dt grad C with the concentration gradient
/// grad C = sum_j V_j grad_i W_ij (Lind et al. 2012; Skillen et al. 2013); 0 at free surfaces.
pub fn shift<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    strength: f64,
    dt: f64,
    shift: &mut Vec<Vector<D>>,
) {
    let scales = Scales::new::<D, K>(pairs.h);
    shift.clear();
    for i in 0..particles.owned {
        let mut concentration = Vector::<D>::default();
        let mut divergence = 0.0;
        around::<D, N, K>(particles, neighbors.of_owned.of(i), scales, i, |pair| {
            let weight = particles.volume[pair.j] * pair.slope;
            concentration += pair.d * weight;
            divergence -= pair.r2 * weight;
        });
        let full = divergence > INSIDE * D as f64;
        let way = concentration * (-STRENGTH * strength * pairs.h * particles.v[i].norm() * dt);
        let scale = (LARGEST * pairs.spacing / way.norm().max(f64::MIN_POSITIVE)).min(1.0);
        shift.push(if full { way * scale } else { Vector::default() });
    }
}
