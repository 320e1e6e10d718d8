//! Artificial stress against clumping in tension (Monaghan 2000; Gray, Monaghan & Swift 2001; Bui et al. 2008).

use crate::algebra::{Sym, Vector, tensile_part};
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::space::Space;
use crate::sweep::{Pairs, Scales, around};

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
    neighbors: &Neighbors,
    pairs: Pairs,
    opposing: &[Sym<N>],
    acceleration: &mut [Vector<D>],
) {
    let scales = Scales::new::<D, K>(pairs.h);
    let near = scales.value::<K>(pairs.spacing * pairs.spacing);
    let exponent = scales.value::<K>(0.0) / near;
    for (i, acceleration) in acceleration.iter_mut().enumerate() {
        let own = opposing[i];
        let metric = S::metric(particles.x[i], pairs.spacing);
        let mut sum = Vector::default();
        around(particles, &neighbors.support, i, |pair| {
            let both = own + opposing[pair.j];
            // Most pairs are not in tension, and powers are dear.
            if both != Sym::default() {
                let f = (scales.value::<K>(pair.r2()) / near).powf(exponent);
                sum += S::traction(&both, pair.d) * (f * particles.volume[pair.j] * pair.slope);
            }
        });
        *acceleration += sum * (1.0 / (particles.density[i] * metric));
    }
}
