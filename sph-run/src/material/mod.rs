//! Constitutive laws: pure and pointwise. A law sees one particle, never its neighbours.

pub mod drucker_prager;
pub mod rotation;

pub use drucker_prager::DruckerPrager;

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

/// A constitutive law.
pub trait Material: Copy + Send + Sync {
    /// Stress at the end of a step, Pa.
    ///
    /// - `stress`: at its start, already turned with the material by [`Material::rotate`];
    /// - `strain`: increment D dt, D the rate of deformation;
    /// - `history`: brought up to date.
    fn stress<const N: usize>(&self, stress: Sym<N>, strain: Sym<N>, history: &mut History) -> Sym<N>;

    /// The stress turned by the spin of one step; `spin` as [`rotation::rotate`] takes it.
    fn rotate<const N: usize>(&self, stress: Sym<N>, spin: [f64; 3], dt: f64) -> Sym<N>;

    /// Elastic energy stored in unit volume under a stress, J/m3.
    fn elastic_energy<const N: usize>(&self, stress: Sym<N>) -> f64;

    /// Speed of compression waves at the density of the start, m/s.
    fn sound_speed(&self) -> f64;
}
