//! Bingham fluid with a frictional yield stress.

use super::{History, Increment, Material, Mean};
use crate::algebra::Sym;
use formats::scene::{self, ViscousOperator};

/// Shear rates below this, 1/s, are taken for it where they divide.
const SLOWEST: f64 = 1e-12;

/// The visco-plastic law of Szewc (2017): Tait's equation of state p = c^2 rho0/7 ((rho/rho0)^7 - 1) (Eq 11) and the
/// viscosity mu = min(mu_inf + (cohesion + max(p, 0) tan phi)/|gdot|, mu_solid) with |gdot| = sqrt(2 e:e) (Eqs 14, 20; the
/// pressure clamped, or mu would turn negative at a free surface).
///
/// The viscous stress acts between particles (Eq 9), or is part of the stress tensor.
#[derive(Clone, Copy, Debug)]
pub struct ViscoPlastic {
    density: f64,
    stiffness: f64,
    friction: f64,
    cohesion: f64,
    viscosity: f64,
    viscosity_solid: f64,
    operator: ViscousOperator,
}

impl ViscoPlastic {
    /// The law of a checked scene.
    pub fn new(law: &scene::ViscoPlastic) -> Self {
        Self {
            density: law.density,
            stiffness: law.stiffness(),
            friction: law.friction_deg.to_radians().tan(),
            cohesion: law.cohesion,
            viscosity: law.viscosity,
            viscosity_solid: law.viscosity_solid,
            operator: law.operator,
        }
    }

    /// Pressure at a density, Pa; negative below rho0.
    #[inline(always)]
    pub fn pressure(&self, density: f64) -> f64 {
        let ratio = density / self.density;
        let cube = ratio * ratio * ratio;
        self.stiffness * (cube * cube * ratio - 1.0)
    }
}

impl Material for ViscoPlastic {
    #[inline(always)]
    fn stress<const N: usize>(&self, _: Sym<N>, step: &Increment<N>, history: &mut History) -> Sym<N> {
        let strain = step.strain.deviator();
        history.plastic_strain += (2.0 / 3.0 * strain.contract(strain)).sqrt();
        let pressure = Sym::isotropic(-self.pressure(step.density));
        match self.operator {
            ViscousOperator::Arithmetic | ViscousOperator::Harmonic => pressure,
            ViscousOperator::Tensor => pressure + strain * (2.0 * self.viscosity(step) / step.dt),
        }
    }

    #[inline(always)]
    fn viscosity<const N: usize>(&self, step: &Increment<N>) -> f64 {
        let rate = step.strain.deviator() * (1.0 / step.dt);
        let norm = (2.0 * rate.contract(rate)).sqrt().max(SLOWEST);
        let strength = self.cohesion + self.pressure(step.density).max(0.0) * self.friction;
        (self.viscosity + strength / norm).min(self.viscosity_solid)
    }

    fn pair_viscosity(&self) -> Option<Mean> {
        match self.operator {
            ViscousOperator::Arithmetic => Some(Mean::Arithmetic),
            ViscousOperator::Harmonic => Some(Mean::Harmonic),
            ViscousOperator::Tensor => None,
        }
    }

    fn largest_viscosity(&self) -> Option<f64> {
        Some(self.viscosity_solid)
    }
}
