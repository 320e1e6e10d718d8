//! `[material]` of a scene: exactly one constitutive law, and its parameters.

use super::{
    Cone, Curve, DruckerPrager, Material, MeanStress, MuI, Norm, Rotation, Unyielded, ViscoPlastic, ViscousOperator,
    raw::{Allowed, Found, NOT_NEGATIVE, POSITIVE, Table},
};
use crate::units::Dimension;

const POISSON: Allowed = Allowed { says: "in [0, 0.5)", holds: |v| (0.0..0.5).contains(&v) };
const FRICTION: Allowed = Allowed { says: "in [0, 90) degrees", holds: |v| (0.0..90.0).contains(&v) };

/// The laws there are, by their keys.
const LAWS: [&str; 3] = ["drucker-prager", "mu-i", "visco-plastic"];

/// The one law of a scene.
pub(super) fn read(root: &Table<'_>) -> Option<Material> {
    let table = root.needed_child("material");
    let given: Vec<_> = LAWS.into_iter().filter(|key| table.has(key)).collect();
    match given.as_slice() {
        [] if table.is_there() => {
            let message = format!("names no law; one of {} is needed, e.g. [material.drucker-prager]", LAWS.join(", "));
            table.faults.structure(table.offset, &table.path, message);
        }
        [] | [_] => {}
        [_, second, ..] => {
            let message = format!("has several laws ({}); exactly one is needed", given.join(", "));
            table.faults.structure(table.child_offset(second), &table.path, message);
        }
    }
    let law = drucker_prager(table.child("drucker-prager")).map(Material::DruckerPrager);
    let law = mu_i(table.child("mu-i")).map(Material::MuI).or(law);
    let law = visco_plastic(table.child("visco-plastic")).map(Material::ViscoPlastic).or(law);
    table.finish();
    law.filter(|_| given.len() == 1)
}

fn or<T>(found: Option<Found<T>>, default: T) -> T {
    found.map_or(default, |found| found.value)
}

fn drucker_prager(table: Table<'_>) -> Option<DruckerPrager> {
    let density = table.needed("density", Dimension::Density, &POSITIVE);
    let young = table.needed("young", Dimension::Stress, &POSITIVE);
    let poisson = table.needed("poisson", Dimension::Number, &POISSON);
    let friction = table.needed("friction", Dimension::Angle, &FRICTION);
    let dilation = table.number("dilation", Dimension::Angle, &NOT_NEGATIVE);
    let cohesion = table.needed("cohesion", Dimension::Stress, &NOT_NEGATIVE);
    let cones = [
        ("compression", Cone::Compression),
        ("extension", Cone::Extension),
        ("plane-strain", Cone::PlaneStrain),
        ("plane-strain-isochoric", Cone::PlaneStrainIsochoric),
    ];
    let cone = table.choice("cone", &cones);
    let rotations = [("jaumann", Rotation::Jaumann), ("hughes-winget", Rotation::HughesWinget)];
    let rotation = table.choice("rotation", &rotations);
    let means = [("rate", MeanStress::Rate), ("density", MeanStress::Density)];
    let mean_stress = table.choice("mean-stress", &means);
    if let (Some(dilation), Some(friction)) = (&dilation, &friction)
        && dilation.value > friction.value
    {
        let (source, friction) = (table.faults.source(dilation), friction.value);
        let message =
            format!("{source} is out of range; it must be in [0, {friction}] degrees, up to the friction angle");
        table.faults.at(dilation, message);
    }
    if let (Some(mean), Some(dilation)) = (&mean_stress, &dilation)
        && mean.value == MeanStress::Density
        && dilation.value > 0.0
    {
        let message = "\"density\" ties the mean stress to the density, which plastic dilation changes; set dilation = 0, \
                       or \"rate\"";
        table.faults.at(mean, message);
    }
    table.finish();
    Some(DruckerPrager {
        density: density?.value,
        young: young?.value,
        poisson: poisson?.value,
        friction_deg: friction?.value,
        dilation_deg: or(dilation, 0.0),
        cohesion: cohesion?.value,
        cone: or(cone, Cone::Compression),
        rotation: or(rotation, Rotation::Jaumann),
        mean_stress: or(mean_stress, MeanStress::Rate),
    })
}

fn mu_i(table: Table<'_>) -> Option<MuI> {
    #[derive(Clone, Copy, PartialEq)]
    enum Kind {
        Cap,
        Elastic,
    }
    let density = table.needed("density", Dimension::Density, &POSITIVE);
    let sound_speed = table.needed("sound-speed", Dimension::Velocity, &POSITIVE);
    let friction_static = table.needed("friction-static", Dimension::Number, &POSITIVE);
    let friction_dynamic = table.number("friction-dynamic", Dimension::Number, &POSITIVE);
    let inertial_number = table.number("inertial-number", Dimension::Number, &POSITIVE);
    let grain_diameter = table.number("grain-diameter", Dimension::Length, &POSITIVE);
    let grain_density = table.number("grain-density", Dimension::Density, &POSITIVE);
    let norm = table.choice("norm", &[("jop", Norm::Jop), ("printed", Norm::Printed)]);
    let curves = [("jop", Curve::Jop), ("partially-regularised", Curve::PartiallyRegularised)];
    let curve = table.choice("curve", &curves);
    let unyielded = table.choice("unyielded", &[("cap", Kind::Cap), ("elastic", Kind::Elastic)]);
    let cap = table.number("viscosity-cap", Dimension::Viscosity, &POSITIVE);
    let shear = table.number("shear-modulus", Dimension::Stress, &POSITIVE);
    let tension = table.choice("tension", &[("none", false), ("kept", true)]);

    let rates = friction_dynamic.as_ref().zip(friction_static.as_ref()).is_some_and(|(d, s)| d.value > s.value);
    if let (Some(dynamic), Some(rest)) = (&friction_dynamic, &friction_static)
        && dynamic.value < rest.value
    {
        table.faults.at(dynamic, format!("must be {} or greater, the friction at rest", rest.value));
    }
    for (key, what, given) in [
        ("inertial-number", "the inertial number I0", inertial_number.is_some()),
        ("grain-diameter", "the diameter of the grains", grain_diameter.is_some()),
    ] {
        if rates && !given && !table.has(key) {
            let message = format!("missing; {what} is needed where friction-dynamic is above friction-static");
            table.faults.structure(table.offset, &table.path_of(key), message);
        }
    }
    if let (Some(curve), true) = (&curve, friction_dynamic.is_none() || !rates)
        && curve.value == Curve::PartiallyRegularised
    {
        table.faults.at(curve, "\"partially-regularised\" needs friction-dynamic above friction-static");
    }
    if let (Some(shear), Some(density), Some(c)) = (&shear, &density, &sound_speed) {
        let most = 1.5 * density.value * c.value * c.value;
        if shear.value > most {
            let (source, reason) = (table.faults.source(shear), "Poisson's ratio would be negative");
            table.faults.at(shear, format!("{source} is above 3/2 rho c^2 = {most} Pa: {reason}; it must not be"));
        }
    }
    let elastic = unyielded.as_ref().is_some_and(|kind| kind.value == Kind::Elastic);
    if let (Some(cap), true) = (&cap, elastic) {
        table.faults.at(cap, "is used only with unyielded = \"cap\"; drop this key");
    }
    if let (Some(shear), false) = (&shear, elastic) {
        table.faults.at(shear, "is used only with unyielded = \"elastic\"; set that, or drop this key");
    }
    if let (Some(curve), true) = (&curve, elastic)
        && curve.value == Curve::PartiallyRegularised
    {
        let message = "\"partially-regularised\" flows under any shear stress: it goes with unyielded = \"cap\" only";
        table.faults.at(curve, message);
    }
    if let (Some(norm), true) = (&norm, elastic)
        && norm.value == Norm::Printed
    {
        table.faults.at(norm, "\"printed\" goes with unyielded = \"cap\" only");
    }
    let dynamic_place = friction_dynamic.clone();
    let faults = table.faults;
    table.finish();
    let (density, sound_speed, friction_static) = (density?.value, sound_speed?.value, friction_static?.value);
    let regularised = curve.as_ref().is_some_and(|found| found.value == Curve::PartiallyRegularised);
    // Poisson's ratio 0.3 with the bulk modulus K = rho c^2: G/K = 3/2 (1 - 2 nu)/(1 + nu).
    let shear = or(shear, 6.0 / 13.0 * density * sound_speed * sound_speed);
    let law = MuI {
        density,
        sound_speed,
        friction_static,
        friction_dynamic: or(friction_dynamic, friction_static),
        inertial_number: or(inertial_number, 1.0),
        grain_diameter: or(grain_diameter, 0.0),
        grain_density: or(grain_density, density),
        norm: or(norm, Norm::Jop),
        curve: or(curve, Curve::Jop),
        unyielded: if elastic { Unyielded::Elastic(shear) } else { Unyielded::Cap(cap.map(|found| found.value)) },
        tension: or(tension, false),
    };
    if let (true, None, Some(dynamic)) = (regularised && rates, law.neutral_inertial_number(), &dynamic_place) {
        let message = "with these friction coefficients the equations are ill posed at any inertial number, so there is \
                       nothing to join \"partially-regularised\" to; raise friction-dynamic";
        faults.at(dynamic, message);
    }
    Some(law)
}

fn visco_plastic(table: Table<'_>) -> Option<ViscoPlastic> {
    let density = table.needed("density", Dimension::Density, &POSITIVE);
    let sound_speed = table.needed("sound-speed", Dimension::Velocity, &POSITIVE);
    let friction = table.needed("friction", Dimension::Angle, &FRICTION);
    let cohesion = table.needed("cohesion", Dimension::Stress, &NOT_NEGATIVE);
    let viscosity = table.needed("viscosity", Dimension::Viscosity, &NOT_NEGATIVE);
    let solid = table.needed("viscosity-solid", Dimension::Viscosity, &POSITIVE);
    let operators = [
        ("arithmetic", ViscousOperator::Arithmetic),
        ("harmonic", ViscousOperator::Harmonic),
        ("tensor", ViscousOperator::Tensor),
    ];
    let operator = table.choice("operator", &operators);
    if let (Some(solid), Some(viscosity)) = (&solid, &viscosity)
        && solid.value < viscosity.value
    {
        table.faults.at(solid, format!("must be {} Pa s or greater, the viscosity of fast flow", viscosity.value));
    }
    table.finish();
    Some(ViscoPlastic {
        density: density?.value,
        sound_speed: sound_speed?.value,
        friction_deg: friction?.value,
        cohesion: cohesion?.value,
        viscosity: viscosity?.value,
        viscosity_solid: solid?.value,
        operator: or(operator, ViscousOperator::Arithmetic),
    })
}
