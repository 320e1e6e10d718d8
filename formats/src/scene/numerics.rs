//! `[numerics]` of a scene: time step, viscosity, and the stabilisers, each of them off unless the law or the scene asks.

use super::{
    Material, Numerics, Precision,
    raw::{Allowed, Found, NOT_NEGATIVE, Table},
};
use crate::{kernel::Kernel, space::Space, units::Dimension};

const COURANT: Allowed = Allowed { says: "in (0, 1.7]", holds: |v| v > 0.0 && v <= 1.7 };
const VISCOUS_COURANT: Allowed = Allowed { says: "in (0, 0.25]", holds: |v| v > 0.0 && v <= 0.25 };
const UNIT: Allowed = Allowed { says: "in [0, 1]", holds: |v| (0.0..=1.0).contains(&v) };
const QUADRATIC: Allowed = Allowed { says: "in [0, 10]", holds: |v| (0.0..=10.0).contains(&v) };
const DENSITY_GATE: Allowed =
    Allowed { says: "in [0, 1), a fraction of the initial density", holds: |v| (0.0..1.0).contains(&v) };

/// What the defaults and limits depend on.
pub(super) struct Place {
    pub space: Option<Space>,
    pub kernel: Kernel,
    pub h_over_dx: f64,
    /// Whether any axis has a period.
    pub periodic: bool,
    /// What lets the material flow; None where it can only settle.
    pub flow: Option<String>,
}

/// The numbers, with the defaults of the law; None without a law.
pub(super) fn read(root: &Table<'_>, place: Place, material: Option<&Material>) -> Option<Numerics> {
    let table = root.child("numerics");
    let courant = table.number("courant", Dimension::Number, &COURANT);
    let viscous_courant = table.number("viscous-courant", Dimension::Number, &VISCOUS_COURANT);
    let viscosity = table.number("viscosity", Dimension::Number, &UNIT);
    let acts = table.choice("viscosity-acts", &[("approach", true), ("always", false)]);
    let quadratic_viscosity = table.number("quadratic-viscosity", Dimension::Number, &QUADRATIC);
    let damping = table.number("damping", Dimension::Rate, &NOT_NEGATIVE);
    let forced = table.choice("damping-in-flow", &[("refused", false), ("forced", true)]);
    let density_gate = table.number("density-gate", Dimension::Number, &DENSITY_GATE);
    let density_diffusion = table.number("density-diffusion", Dimension::Number, &UNIT);
    let stress_diffusion = table.number("stress-diffusion", Dimension::Number, &UNIT);
    let artificial_stress = table.number("artificial-stress", Dimension::Number, &UNIT);
    let corrections = [("none", false), ("variational", true)];
    let gradient_correction = table.choice("gradient-correction", &corrections);
    let shifting = table.number("shifting", Dimension::Number, &UNIT);

    let precision = table.choice("precision", &[("f64", Precision::Double), ("mixed", Precision::Mixed)]);

    // Places in f32 round differently on the two sides of a border, and a restart tells particles on the other one.
    if let Some(found) = &precision
        && found.value == Precision::Mixed
        && place.periodic
    {
        let source = table.faults.source(found);
        let message = format!("{source} with a period: the bits of the answer would depend on where a run was stopped");
        table.faults.at(found, format!("{message}; set \"f64\", or take walls instead of the period"));
    }

    let corrected = gradient_correction.as_ref().is_some_and(|found| found.value);
    let (limit, reason) = if place.space == Some(Space::Axisymmetric) {
        let reason = "the hoop stress of the innermost rings limits the time step in the axisymmetric space";
        (ring_limit(place.kernel, place.h_over_dx), reason)
    } else if corrected {
        (CORRECTED_LIMIT, "corrected gradients stiffen free surfaces and corners, which limits the time step")
    } else {
        (f64::INFINITY, "")
    };
    // Up to 92 % of the limit is stable in tests.
    let most = (92.0 * limit).floor() / 100.0;
    if let Some(found) = &courant
        && found.value > most
    {
        let source = table.faults.source(found);
        table.faults.at(found, format!("{source} is too large; it must be in (0, {most}] here: {reason}"));
    }
    if let (Some(found), Some(flow)) = (&damping, &place.flow)
        && found.value > 0.0
        && !forced.as_ref().is_some_and(|forced| forced.value)
    {
        let message = format!("damps a flow ({flow}): run-outs would be too short, and speeds too low");
        table.faults.at(found, format!("{message}; drop it, or set damping-in-flow = \"forced\""));
    }
    if let Some(material) = material {
        let useless = |found: &Option<Found<f64>>, is_useless: bool, reason: &str| {
            if let (Some(found), true) = (found, is_useless) {
                table.faults.at(found, format!("{reason}; drop this key"));
            }
        };
        let gate = density_gate.clone().filter(|found| found.value > 0.0);
        let reason = "the pressure of this law follows from the density, so that lost volume comes back without a gate";
        useless(&gate, material.ties_pressure_to_density(), reason);
        let diffused = stress_diffusion.clone().filter(|found| found.value > 0.0);
        let reason =
            "the stress of a fluid follows from density and strain rate: what is diffused would be lost at once";
        useless(&diffused, material.is_fluid(), reason);
        let reason = "is used only with a viscosity, that of visco-plastic or of mu-i with unyielded = \"cap\"";
        useless(&viscous_courant, !material.is_fluid(), reason);
    }
    table.finish();
    let or = |found: Option<Found<f64>>, default| found.map_or(default, |found| found.value);
    let most_diffused =
        [&density_diffusion, &stress_diffusion].into_iter().flatten().fold(0.0, |a: f64, b| a.max(b.value));
    let most_viscous = viscosity.as_ref().map_or(0.0, |found| found.value);
    let default = Defaults::of(material?);
    let courant_free = if limit.is_infinite() { default.courant } else { default.courant.min(LIMITED_COURANT) };
    let step = courant_free.min(0.8 * limit).min(0.25 / most_diffused).min(0.6 / most_viscous);
    Some(Numerics {
        courant: or(courant, step),
        viscous_courant: or(viscous_courant, 0.125),
        viscosity: or(viscosity, default.viscosity),
        viscosity_on_approach: acts.map_or(default.on_approach, |found| found.value),
        quadratic_viscosity: or(quadratic_viscosity, 0.0),
        damping: or(damping, 0.0),
        density_gate: or(density_gate, default.density_gate),
        density_diffusion: or(density_diffusion, default.density_diffusion),
        stress_diffusion: or(stress_diffusion, 0.0),
        artificial_stress: or(artificial_stress, 0.0),
        gradient_correction: corrected,
        shifting: or(shifting, 0.0),
        precision: precision.map_or(Precision::Double, |found| found.value),
    })
}

/// What a scene has where it says nothing, by its material.
struct Defaults {
    /// Before what diffuses, rings and corrected gradients, which limit it further; see the study `time-step` of VALIDATION.md.
    courant: f64,
    viscosity: f64,
    on_approach: bool,
    density_gate: f64,
    density_diffusion: f64,
}

impl Defaults {
    /// Sand that comes apart: what lies on or next to the front of the charts of error against cost. What holds together, or
    /// gains volume, is in no chart, and blocks that bounce want viscosity and short steps: there, and for the fluids, the
    /// viscosities of Yang et al. (2020) and Szewc (2017).
    ///
    /// Steps: columns of sand change from 1.9 on; blocks that do not yield, dropped at c/7, burst at 1.0 with a viscosity of
    /// 0.03 and at 1.2 with 0.1. Visco-plastic fluids break at 1.4. A chute of mu(I) is 2 to 3 % slower at 1.0, and a cap
    /// that follows from the step falls with it.
    fn of(material: &Material) -> Self {
        match material {
            Material::DruckerPrager(law) if law.comes_apart() => {
                // The pressure that follows from the density has its gate in itself.
                let density_gate = if material.ties_pressure_to_density() { 0.0 } else { 0.98 };
                Self { courant: 1.4, viscosity: 0.03, on_approach: true, density_gate, density_diffusion: 0.0 }
            }
            Material::DruckerPrager(_) => {
                Self { courant: 1.0, viscosity: 0.1, on_approach: true, density_gate: 0.0, density_diffusion: 0.0 }
            }
            Material::MuI(_) => {
                Self { courant: 0.6, viscosity: 0.01, on_approach: false, density_gate: 0.0, density_diffusion: 0.1 }
            }
            Material::ViscoPlastic(_) => {
                Self { courant: 0.6, viscosity: 0.0, on_approach: false, density_gate: 0.0, density_diffusion: 0.0 }
            }
        }
    }
}

/// Default Courant number of rings and of corrected gradients, if 0.8 of their limit is not less.
const LIMITED_COURANT: f64 = 0.6;

/// Largest stable dt c/h of leap-frog with corrected gradients: measured on free blocks with random velocities, 1.09 (plane)
/// and 1.00 (3-D) for the cubic spline at h = 1.2 dx, 1.02 and 0.94 for Wendland at 1.5625, down to 0.92 with particles
/// disturbed by 0.15 dx. Rings at the axis limit it more, corrected or not.
const CORRECTED_LIMIT: f64 = 0.92;

/// Largest stable dt c/h of leap-frog where rings lie at dx/2 from the axis: omega^2 = (2 c/(L h))^2 + (2 c/dx)^2, with
/// L the limit without rings, measured on free blocks. Measured with rings: 0.75 to 0.80 for the cubic spline at
/// h = 1.2 dx, 0.60 to 0.65 for Wendland at 1.5625, 0.45 to 0.50 at 2.
fn ring_limit(kernel: Kernel, h_over_dx: f64) -> f64 {
    let free = match kernel {
        Kernel::CubicSpline => 1.86,
        Kernel::WendlandC2 => 1.76,
    };
    free / (1.0 + (free * h_over_dx).powi(2)).sqrt()
}
