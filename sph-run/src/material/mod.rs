//! Constitutive laws: pure and pointwise. A law sees one particle, never its neighbours.

pub mod drucker_prager;
pub mod mu_i;
pub mod rotation;
pub mod visco_plastic;

pub use drucker_prager::DruckerPrager;
pub use mu_i::MuI;
pub use visco_plastic::ViscoPlastic;

use crate::algebra::Sym;

/// What a particle remembers beside its stress.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct History {
    /// Accumulated deviatoric plastic strain, the sum of sqrt(2/3 e_p:e_p) over the steps; never falls.
    pub plastic_strain: f64,
}

/// No stress below the density `gate` (Dunatunga & Kamrin 2015, J. Fluid Mech. 779, 483): material that came apart must
/// close again before it carries. Without the gate a law that integrates rates answers compression at once, whatever
/// the density, and never gives back the volume it gained in free flight.
#[inline(always)]
pub fn gated<const N: usize>(stress: Sym<N>, density: f64, gate: f64) -> Sym<N> {
    if density < gate { Sym::default() } else { stress }
}

/// One step of one particle, as its law sees it.
#[derive(Clone, Copy, Debug)]
pub struct Increment<const N: usize> {
    /// D dt, D the rate of deformation.
    pub strain: Sym<N>,
    /// Density at the end, kg/m3.
    pub density: f64,
    /// Length of the step, s.
    pub dt: f64,
}

/// How two viscosities act between two particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mean {
    /// mu_i + mu_j.
    Arithmetic,
    /// 4 mu_i mu_j/(mu_i + mu_j).
    Harmonic,
}

/// A constitutive law.
pub trait Material: Copy + Send + Sync {
    /// Stress at the end of a step, Pa.
    ///
    /// - `stress`: at its start, already turned with the material by [`Material::rotate`];
    /// - `history`: brought up to date.
    fn stress<const N: usize>(&self, stress: Sym<N>, step: &Increment<N>, history: &mut History) -> Sym<N>;

    /// The stress turned by the spin of one step; `spin` as [`rotation::rotate`] takes it. As it is, unless the law
    /// integrates stress.
    fn rotate<const N: usize>(&self, stress: Sym<N>, _spin: [f64; 3], _dt: f64) -> Sym<N> {
        stress
    }

    /// Viscosity between particles, Pa s, of laws that have a [`Material::pair_viscosity`].
    fn viscosity<const N: usize>(&self, _step: &Increment<N>) -> f64 {
        0.0
    }

    /// How that viscosity acts; none where all of the stress is in [`Material::stress`].
    fn pair_viscosity(&self) -> Option<Mean> {
        None
    }

    /// Largest viscosity the time step must allow for, Pa s; none where there is no viscosity, or where it is capped by
    /// the time step itself.
    fn largest_viscosity(&self) -> Option<f64> {
        None
    }
}
