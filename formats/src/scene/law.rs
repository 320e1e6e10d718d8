//! What follows from the parameters of a law alone: its wave speed, its equation of state, the energy it stores.

use super::{Cone, DruckerPrager, Material, MeanStress, MuI, Unyielded, ViscoPlastic};

impl Material {
    /// Density without stress, kg/m3.
    pub fn density(&self) -> f64 {
        match self {
            Self::DruckerPrager(law) => law.density,
            Self::MuI(law) => law.density,
            Self::ViscoPlastic(law) => law.density,
        }
    }

    /// Speed of compression waves, m/s (Yang et al. 2020, Eq 41).
    pub fn sound_speed(&self) -> f64 {
        match self {
            Self::DruckerPrager(law) => ((law.bulk() + 4.0 / 3.0 * law.shear()) / law.density).sqrt(),
            Self::MuI(law) => match law.unyielded {
                Unyielded::Cap(_) => law.sound_speed,
                Unyielded::Elastic(shear) => (law.sound_speed.powi(2) + 4.0 / 3.0 * shear / law.density).sqrt(),
            },
            Self::ViscoPlastic(law) => law.sound_speed,
        }
    }

    /// Is it a fluid: does all stress follow from density and strain rate, and none from the strain of earlier steps?
    pub fn is_fluid(&self) -> bool {
        match self {
            Self::DruckerPrager(_) => false,
            Self::MuI(law) => matches!(law.unyielded, Unyielded::Cap(_)),
            Self::ViscoPlastic(_) => true,
        }
    }

    /// Does the pressure follow from the density alone, whatever happened before?
    pub fn ties_pressure_to_density(&self) -> bool {
        match self {
            Self::DruckerPrager(law) => law.mean_stress == MeanStress::Density,
            Self::MuI(_) | Self::ViscoPlastic(_) => true,
        }
    }

    /// Horizontal over vertical stress where the elastic material is held on its sides: nu/(1 - nu); 1 of a fluid.
    pub fn elastic_k0(&self) -> f64 {
        match self {
            Self::DruckerPrager(law) => law.poisson / (1.0 - law.poisson),
            Self::MuI(law) => match law.unyielded {
                Unyielded::Cap(_) => 1.0,
                Unyielded::Elastic(shear) => {
                    let bulk = law.bulk();
                    (3.0 * bulk - 2.0 * shear) / (3.0 * bulk + 4.0 * shear)
                }
            },
            Self::ViscoPlastic(_) => 1.0,
        }
    }

    /// Density at which the pressure is `pressure`, kg/m3; the one without stress where a law does not tie the two.
    pub fn density_at(&self, pressure: f64) -> f64 {
        let rho0 = self.density();
        match self {
            Self::DruckerPrager(law) => match law.mean_stress {
                MeanStress::Rate => rho0,
                MeanStress::Density => rho0 * (1.0 + pressure / law.bulk()),
            },
            Self::MuI(law) => rho0 + pressure / law.sound_speed.powi(2),
            Self::ViscoPlastic(law) => {
                rho0 * (1.0 + pressure / law.stiffness()).powf(1.0 / ViscoPlastic::TAIT_EXPONENT)
            }
        }
    }

    /// Energy stored under a stress (XX YY ZZ XY YZ XZ, Pa) at a density (kg/m3) that can be had back, J/kg: the
    /// quadratic form of Hooke's law; of a fluid the work of its pressure, the integral of p/rho^2.
    pub fn stored_energy(&self, stress: [f64; 6], density: f64) -> f64 {
        let [xx, yy, zz, xy, yz, xz] = stress;
        let trace = xx + yy + zz;
        let square = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + yz * yz + xz * xz);
        let deviator = (square - trace * trace / 3.0).max(0.0);
        match self {
            Self::DruckerPrager(law) => {
                (trace * trace / (18.0 * law.bulk()) + deviator / (4.0 * law.shear())) / density
            }
            Self::MuI(law) => {
                let shear = match law.unyielded {
                    Unyielded::Cap(_) => 0.0,
                    Unyielded::Elastic(shear) => deviator / (4.0 * shear * density),
                };
                // Where nothing pulls, opening stores nothing.
                let density = if law.tension { density } else { density.max(law.density) };
                law.sound_speed.powi(2) * ((density / law.density).ln() + law.density / density - 1.0) + shear
            }
            Self::ViscoPlastic(law) => {
                let n = ViscoPlastic::TAIT_EXPONENT;
                let ratio = density / law.density;
                law.stiffness() / law.density * ((ratio.powf(n - 1.0) - 1.0) / (n - 1.0) + 1.0 / ratio - 1.0)
            }
        }
    }
}

impl MuI {
    /// Lower neutral inertial number of the curve mu_s + (mu_2 - mu_s)/(1 + I0/I): below it the incompressible equations are
    /// ill posed (Barker, Schaeffer, Bohorquez & Gray 2015). With x = I mu'(I)/mu they are well posed where
    /// 4 x^2 - 4 x + mu^2 (1 - x/2)^2 < 0. None where they are for no I.
    pub fn neutral_inertial_number(&self) -> Option<f64> {
        let posed = |ratio: f64| {
            let rise = (self.friction_dynamic - self.friction_static) * ratio / (1.0 + ratio);
            let mu = self.friction_static + rise;
            let x = rise / ((1.0 + ratio) * mu);
            4.0 * x * x - 4.0 * x + (mu * (1.0 - 0.5 * x)).powi(2) < 0.0
        };
        // In steps of a hundredth of a decade of I/I0, then by bisection.
        let step = |k: i32| 10f64.powf(f64::from(k) / 100.0);
        let first = (-800..=800).find(|&k| posed(step(k)))?;
        let (mut low, mut high) = (step(first - 1), step(first));
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if posed(middle) { high = middle } else { low = middle }
        }
        Some(high * self.inertial_number)
    }
}

impl ViscoPlastic {
    /// c^2 rho0/7, Pa.
    pub fn stiffness(&self) -> f64 {
        self.sound_speed.powi(2) * self.density / Self::TAIT_EXPONENT
    }

    /// Exponent of Tait's equation of state (Szewc 2017, Eq 11).
    pub const TAIT_EXPONENT: f64 = 7.0;
}

impl DruckerPrager {
    /// Is material below its density at the start in pieces? Not where it may be in tension, or gains volume by yielding.
    pub fn comes_apart(&self) -> bool {
        self.cohesion == 0.0 && self.dilation_deg == 0.0
    }

    /// Bulk modulus K, Pa.
    pub fn bulk(&self) -> f64 {
        self.young / (3.0 * (1.0 - 2.0 * self.poisson))
    }
    /// Shear modulus G, Pa.
    pub fn shear(&self) -> f64 {
        self.young / (2.0 * (1.0 + self.poisson))
    }
}

impl MuI {
    /// Bulk modulus rho0 c^2, Pa.
    pub fn bulk(&self) -> f64 {
        self.density * self.sound_speed.powi(2)
    }
}

impl Cone {
    /// Constants (alpha, k) of the cone that stands for a Mohr-Coulomb material; k has the unit of `cohesion`.
    pub fn constants(self, friction_deg: f64, cohesion: f64) -> (f64, f64) {
        let phi = friction_deg.to_radians();
        let (sin, cos, tan) = (phi.sin(), phi.cos(), phi.tan());
        let corners = |denominator: f64| (2.0 * sin / denominator, 6.0 * cohesion * cos / denominator);
        match self {
            Self::Compression => corners(3f64.sqrt() * (3.0 - sin)),
            Self::Extension => corners(3f64.sqrt() * (3.0 + sin)),
            Self::PlaneStrain => {
                let denominator = (9.0 + 12.0 * tan * tan).sqrt();
                (tan / denominator, 3.0 * cohesion / denominator)
            }
            Self::PlaneStrainIsochoric => (sin / 3.0, cohesion * cos),
        }
    }
}
