//! Elastic, perfectly plastic material with the Drucker-Prager criterion.

use super::{History, Increment, Material, rotation};
use crate::algebra::Sym;
use formats::scene::{self, MeanStress, Rotation};

const THIRD: f64 = 1.0 / 3.0;

/// The Drucker-Prager law f = alpha I1 + sqrt(J2) - k with the potential g = alpha_psi I1 + sqrt(J2)
/// (Yang et al. 2020, Eqs 11-14).
///
/// A step is Hooke's law followed by the closed-form backward-Euler return to the cone, or to its apex where the cone
/// can't be reached. Without dilation this is the two-stage correction of Bui et al. (2008): tension cracking, then
/// radial scaling at fixed I1. With dilation the scaling would leave the flow rule; the return does not.
#[derive(Clone, Copy, Debug)]
pub struct DruckerPrager {
    /// Bulk modulus K, Pa.
    pub bulk: f64,
    /// Shear modulus G, Pa.
    pub shear: f64,
    /// Friction constant of the cone.
    pub alpha: f64,
    /// Cohesion constant of the cone, Pa.
    pub k: f64,
    /// Friction constant of the plastic potential.
    pub alpha_psi: f64,
    /// How the stress turns with the material.
    pub rotation: Rotation,
    /// I1 at the apex, Pa; infinite without friction, where the cone is a cylinder.
    apex: f64,
    /// 9 K alpha_psi/(G + 9 K alpha alpha_psi): fall of I1 per unit of f, 0 without dilation.
    relief: f64,
    /// Deviatoric plastic strain per fall of sqrt(J2): 1/(sqrt(3) G).
    strain_per_stress: f64,
    /// Where the mean stress comes from. From the density: p = K (rho/rho0 - 1), which without dilation is the integral of
    /// the rate, and remembers what a tension cut-off forgets: volume gained in free flight carries nothing until it is
    /// given back.
    pub mean_stress: MeanStress,
    /// Density rho0 without stress, kg/m3.
    pub density: f64,
}

impl DruckerPrager {
    /// The law of a checked scene.
    pub fn new(scene: &scene::DruckerPrager) -> Self {
        let (bulk, shear) = (scene.bulk(), scene.shear());
        let (alpha, k) = scene.cone.constants(scene.friction_deg, scene.cohesion);
        let (alpha_psi, _) = scene.cone.constants(scene.dilation_deg, 0.0);
        Self {
            bulk,
            shear,
            alpha,
            k,
            alpha_psi,
            rotation: scene.rotation,
            apex: if alpha > 0.0 { k / alpha } else { f64::INFINITY },
            relief: 9.0 * bulk * alpha_psi / (shear + 9.0 * bulk * alpha * alpha_psi),
            strain_per_stress: 1.0 / (3f64.sqrt() * shear),
            mean_stress: scene.mean_stress,
            density: scene.density,
        }
    }

    /// Yield function f, Pa: negative inside the cone.
    pub fn yield_function<const N: usize>(&self, stress: Sym<N>) -> f64 {
        let deviator = stress.deviator();
        self.alpha * stress.trace() + (0.5 * deviator.contract(deviator)).sqrt() - self.k
    }

    /// Hooke's law: the stress after an elastic strain.
    #[inline(always)]
    fn elastic<const N: usize>(&self, stress: Sym<N>, strain: Sym<N>) -> Sym<N> {
        let volumetric = (self.bulk - 2.0 * THIRD * self.shear) * strain.trace();
        stress + strain * (2.0 * self.shear) + Sym::isotropic(volumetric)
    }
}

impl Material for DruckerPrager {
    #[inline(always)]
    fn stress<const N: usize>(&self, stress: Sym<N>, step: &Increment<N>, history: &mut History) -> Sym<N> {
        let mut trial = self.elastic(stress, step.strain);
        if self.mean_stress == MeanStress::Density {
            let pressure = self.bulk * (step.density / self.density - 1.0);
            trial = trial.deviator() + Sym::isotropic(-pressure);
        }
        let trace = trial.trace();
        let deviator = trial - Sym::isotropic(trace * THIRD);
        let root_j2 = (0.5 * deviator.contract(deviator)).sqrt();
        let f = self.alpha * trace + root_j2 - self.k;
        if f <= 0.0 {
            return trial;
        }
        // On the cone sqrt(J2) follows from I1, and more exactly than from the multiplier. What the cone can't take
        // (nothing left of the deviator, or none to begin with) goes to the apex.
        let on_cone = trace - self.relief * f;
        let left = self.k - self.alpha * on_cone;
        if left > 0.0 && root_j2 > 0.0 {
            history.plastic_strain += (root_j2 - left).max(0.0) * self.strain_per_stress;
            deviator * (left / root_j2) + Sym::isotropic(on_cone * THIRD)
        } else {
            history.plastic_strain += root_j2 * self.strain_per_stress;
            Sym::isotropic(on_cone.min(self.apex) * THIRD)
        }
    }

    #[inline(always)]
    fn rotate<const N: usize>(&self, stress: Sym<N>, spin: [f64; 3], dt: f64) -> Sym<N> {
        rotation::rotate(stress, spin, dt, self.rotation)
    }
}
