//! Granular fluid whose friction depends on the inertial number.

use super::{History, Increment, Material, rotation};
use crate::algebra::Sym;
use formats::scene::{self, Curve, Norm, Rotation, Unyielded};

/// Shear rates below this, 1/s, are taken for it where they divide.
const SLOWEST: f64 = 1e-12;

/// The mu(I) law (Jop, Forterre & Pouliquen 2006): sqrt(J2) = mu(I) p with I = |gdot| d/sqrt(p/rho_s), and the pressure of
/// the equation of state p = c^2 (rho - rho0) (Yang et al. 2020, Eqs 3-7, with the norm of Jop et al.: as printed they
/// give sqrt(2) times the friction).
///
/// Where the material does not flow, the viscosity mu p/|gdot| grows without bound. It is either capped, or the deviator
/// is that of an elastic solid until sqrt(J2) reaches mu_s p (Dunatunga & Kamrin 2015). Without pressure there is no shear stress.
#[derive(Clone, Copy, Debug)]
pub struct MuI {
    density: f64,
    stiffness: f64,
    curve: Friction,
    grain_diameter: f64,
    grain_density: f64,
    /// |gdot|^2 over e:e.
    norm2: f64,
    tension: bool,
    unyielded: Unyielded,
    /// Largest viscosity times the length of the step: viscous_courant rho0 h^2, Pa s2.
    cap_times_step: f64,
}

/// mu(I), a pure function.
#[derive(Clone, Copy, Debug)]
pub struct Friction {
    /// mu_s.
    pub rest: f64,
    /// mu_2.
    pub fast: f64,
    /// I0.
    pub inertial_number: f64,
    /// Below this I the regularised branch holds; 0 without one.
    pub neutral: f64,
    /// Constant A of that branch.
    amplitude: f64,
}

impl Friction {
    /// alpha of Barker & Gray (2017), Eq 6.3: below 2, or the equations are ill posed at small I.
    const ALPHA: f64 = 1.9;
    /// mu_inf of Barker & Gray (2017): slope of mu at large I, which widens the well-posed range there.
    const MU_INF: f64 = 0.05;

    /// The curve of a scene.
    pub fn new(law: &scene::MuI) -> Self {
        let (rest, fast, inertial_number) = (law.friction_static, law.friction_dynamic, law.inertial_number);
        let plain = Self { rest, fast, inertial_number, neutral: 0.0, amplitude: 0.0 };
        match (law.curve, law.neutral_inertial_number()) {
            (Curve::PartiallyRegularised, Some(neutral)) => {
                let mu = Self { neutral, ..plain }.upper(neutral);
                Self { neutral, amplitude: neutral * (Self::ALPHA / (mu * mu)).exp(), ..plain }
            }
            _ => plain,
        }
    }

    /// mu(I): mu_s + (mu_2 - mu_s)/(1 + I0/I), or partially regularised: sqrt(alpha/ln(A/I)) below the lower neutral
    /// inertial number, (mu_s I0 + mu_2 I + mu_inf I^2)/(I0 + I) above (Barker & Gray 2017, Eqs 6.3, 6.4).
    #[inline(always)]
    pub fn at(&self, inertial_number: f64) -> f64 {
        if self.neutral == 0.0 {
            self.rest + (self.fast - self.rest) * inertial_number / (self.inertial_number + inertial_number)
        } else if inertial_number > self.neutral {
            self.upper(inertial_number)
        } else {
            (Self::ALPHA / (self.amplitude / inertial_number.max(f64::MIN_POSITIVE)).ln()).sqrt()
        }
    }

    fn upper(&self, i: f64) -> f64 {
        (self.rest * self.inertial_number + self.fast * i + Self::MU_INF * i * i) / (self.inertial_number + i)
    }
}

impl MuI {
    /// The law of a checked scene.
    pub fn new(law: &scene::MuI, scene: &scene::Scene) -> Self {
        Self {
            density: law.density,
            stiffness: law.sound_speed * law.sound_speed,
            curve: Friction::new(law),
            grain_diameter: law.grain_diameter,
            grain_density: law.grain_density,
            norm2: match law.norm {
                Norm::Jop => 2.0,
                Norm::Printed => 1.0,
            },
            tension: law.tension,
            unyielded: law.unyielded,
            cap_times_step: scene.numerics.viscous_courant * law.density * scene.h() * scene.h(),
        }
    }

    /// Pressure at a density, Pa.
    #[inline(always)]
    pub fn pressure(&self, density: f64) -> f64 {
        let pressure = self.stiffness * (density - self.density);
        if self.tension { pressure } else { pressure.max(0.0) }
    }

    /// Deviator of the fluid: 2 eta e with eta = mu(I) p/|gdot| up to the cap.
    #[inline(always)]
    fn flowing<const N: usize>(&self, pressure: f64, rate: Sym<N>, cap: f64) -> Sym<N> {
        let norm = (self.norm2 * rate.contract(rate)).sqrt().max(SLOWEST);
        let inertial_number = norm * self.grain_diameter / (pressure / self.grain_density).sqrt();
        let viscosity = (self.curve.at(inertial_number) * pressure / norm).min(cap);
        rate * (2.0 * viscosity)
    }

    /// sqrt(J2) at the end of a step whose elastic trial is `trial`: the root of tau = mu(I) p, with the inertial number of
    /// the plastic shear rate (trial - tau)/(G dt), a quadratic in tau (Dunatunga & Kamrin 2015, Eqs 3.30-3.34).
    #[inline(always)]
    fn yielding(&self, trial: f64, pressure: f64, shear: f64, dt: f64) -> f64 {
        let (slow, fast) = (self.curve.rest * pressure, self.curve.fast * pressure);
        if self.grain_diameter == 0.0 || fast <= slow {
            return slow;
        }
        let scale =
            shear * dt * self.curve.inertial_number * (pressure / self.grain_density).sqrt() / self.grain_diameter;
        let half = 0.5 * (fast + trial + scale);
        let product = fast * trial + slow * scale;
        // The smaller root, without the difference of nearly equal numbers.
        product / (half + (half * half - product).max(0.0).sqrt())
    }
}

impl Material for MuI {
    #[inline(always)]
    fn stress<const N: usize>(&self, stress: Sym<N>, step: &Increment<N>, history: &mut History) -> Sym<N> {
        let pressure = self.pressure(step.density);
        let strain = step.strain.deviator();
        if pressure <= 0.0 {
            history.plastic_strain += (2.0 / 3.0 * strain.contract(strain)).sqrt();
            return Sym::isotropic(-pressure);
        }
        let deviator = match self.unyielded {
            Unyielded::Cap(cap) => {
                history.plastic_strain += (2.0 / 3.0 * strain.contract(strain)).sqrt();
                let cap = cap.unwrap_or(self.cap_times_step / step.dt);
                self.flowing(pressure, strain * (1.0 / step.dt), cap)
            }
            Unyielded::Elastic(shear) => {
                let trial = stress.deviator() + strain * (2.0 * shear);
                let root_j2 = (0.5 * trial.contract(trial)).sqrt();
                if root_j2 <= self.curve.rest * pressure {
                    trial
                } else {
                    let left = self.yielding(root_j2, pressure, shear, step.dt);
                    history.plastic_strain += (root_j2 - left) / (3f64.sqrt() * shear);
                    trial * (left / root_j2)
                }
            }
        };
        deviator + Sym::isotropic(-pressure)
    }

    #[inline(always)]
    fn rotate<const N: usize>(&self, stress: Sym<N>, spin: [f64; 3], dt: f64) -> Sym<N> {
        match self.unyielded {
            Unyielded::Cap(_) => stress,
            Unyielded::Elastic(_) => rotation::rotate(stress, spin, dt, Rotation::HughesWinget),
        }
    }

    fn largest_viscosity(&self) -> Option<f64> {
        match self.unyielded {
            Unyielded::Cap(cap) => cap,
            Unyielded::Elastic(_) => None,
        }
    }
}
