//! Scenes: laws, stabilisers and the state at the start, and what follows from a law alone.

#[path = "support/scenes.rs"]
mod scenes;

use formats::scene::{
    Cone, Curve, DruckerPrager, Initial, InitialStress, Lattice, Material, MeanStress, MuI, Norm, Numerics, Precision,
    Rotation, Scene, Unyielded, ViscoPlastic, ViscousOperator,
};
use scenes::{bad, faults, good};

/// A chute of grains. The law's own keys are lines 6 to 8.
const GRAINS: &str = r#"space = "plane-strain"
spacing = "5 mm"
gravity = ["3 m/s2", 0, "-9 m/s2"]
periodic.x = { from = 0, to = "0.2 m" }
[material.mu-i]
density = "1500 kg/m3"
sound-speed = "20 m/s"
friction-static = 0.4
[body.layer]
box = { min = [0, 0, 0], max = [0.2, 0, 0.1] }
[wall.bed]
axis = "z"
at = 0
side = "above"
slip = "no-slip"
[numerics]
courant = 0.5
[initial]
jitter = 0
[end]
time = 1
"#;

/// A block of the visco-plastic fluid. The law's own keys are lines 4 to 9.
const FLUID: &str = r#"space = "3d"
spacing = "5 mm"
[material.visco-plastic]
density = "2.6 g/cm3"
sound-speed = "10 m/s"
friction = "22 deg"
cohesion = "1 kPa"
viscosity = "1 mPa s"
viscosity-solid = "0.2 kPa s"
[body.column]
box = { min = [0, 0, 0], max = [0.1, 0.1, 0.1] }
[numerics]
courant = 0.5
[initial]
jitter = 0
[end]
time = 1
"#;

/// Soil on a floor, free on its sides. The law's own keys are lines 4 to 8.
const SOIL: &str = r#"space = "plane-strain"
spacing = "5 mm"
[material.drucker-prager]
density = 1800
young = "2 MPa"
poisson = 0.25
friction = 30
cohesion = "1 kPa"
[body.column]
box = { min = [0, 0, 0], max = [0.1, 0, 0.1] }
[numerics]
courant = 0.5
[initial]
jitter = 0
[end]
time = 1
"#;

fn read(text: &str) -> Scene {
    Scene::read("scene.toml", text).unwrap_or_else(|error| panic!("{error}"))
}

fn grains() -> MuI {
    MuI {
        density: 1500.0,
        sound_speed: 20.0,
        friction_static: 0.4,
        friction_dynamic: 0.4,
        inertial_number: 1.0,
        grain_diameter: 0.0,
        grain_density: 1500.0,
        norm: Norm::Jop,
        curve: Curve::Jop,
        unyielded: Unyielded::Cap(None),
        tension: false,
    }
}

fn fluid() -> ViscoPlastic {
    ViscoPlastic {
        density: 2600.0,
        sound_speed: 10.0,
        friction_deg: 22.0,
        cohesion: 1000.0,
        viscosity: 1e-3,
        viscosity_solid: 200.0,
        operator: ViscousOperator::Arithmetic,
    }
}

fn soil(mean_stress: MeanStress) -> DruckerPrager {
    DruckerPrager {
        density: 1800.0,
        young: 2e6,
        poisson: 0.25,
        friction_deg: 30.0,
        dilation_deg: 0.0,
        cohesion: 1000.0,
        cone: Cone::Compression,
        rotation: Rotation::Jaumann,
        mean_stress,
    }
}

/// All stabilisers off.
fn plain() -> Numerics {
    Numerics {
        courant: 0.5,
        viscous_courant: 0.125,
        viscosity: 0.0,
        viscosity_on_approach: false,
        quadratic_viscosity: 0.0,
        damping: 0.0,
        density_gate: 0.0,
        density_diffusion: 0.0,
        stress_diffusion: 0.0,
        artificial_stress: 0.0,
        gradient_correction: false,
        shifting: 0.0,
        precision: Precision::Double,
    }
}

#[test]
fn the_least_of_each_law_gets_its_defaults() {
    let scene = read(GRAINS);
    assert_eq!(scene.material, Material::MuI(grains()));
    assert_eq!(scene.numerics, Numerics { viscosity: 0.01, density_diffusion: 0.1, ..plain() });
    assert_eq!(scene.initial.lattice, Lattice::Cubic);
    let scene = read(FLUID);
    assert_eq!(scene.material, Material::ViscoPlastic(fluid()));
    assert_eq!(scene.numerics, plain());
    let scene = read(SOIL);
    assert_eq!(scene.material, Material::DruckerPrager(soil(MeanStress::Rate)));
    assert_eq!(scene.numerics, Numerics { viscosity: 0.1, viscosity_on_approach: true, ..plain() });
}

#[test]
fn every_key_of_the_laws_is_read() {
    let all = "friction-static = 0.38\nfriction-dynamic = 0.64\ninertial-number = 0.279\ngrain-diameter = \"0.53 mm\"\n\
               grain-density = \"2.5 g/cm3\"\nnorm = \"printed\"\ncurve = \"partially-regularised\"\n\
               unyielded = \"cap\"\nviscosity-cap = \"2 kPa s\"\ntension = \"kept\"";
    let expected = MuI {
        friction_static: 0.38,
        friction_dynamic: 0.64,
        inertial_number: 0.279,
        grain_diameter: 0.53e-3,
        grain_density: 2500.0,
        norm: Norm::Printed,
        curve: Curve::PartiallyRegularised,
        unyielded: Unyielded::Cap(Some(2000.0)),
        tension: true,
        ..grains()
    };
    assert_eq!(good(GRAINS, "friction-static = 0.4", all).material, Material::MuI(expected));
    let names = "friction-static = 0.4\nnorm = \"jop\"\ncurve = \"jop\"\ntension = \"none\"\nunyielded = \"elastic\"";
    let elastic = |shear| Material::MuI(MuI { unyielded: Unyielded::Elastic(shear), ..grains() });
    // Poisson's ratio 0.3: G/K = 3 (1 - 2 nu)/(2 (1 + nu)).
    assert_eq!(good(GRAINS, "friction-static = 0.4", names).material, elastic(6.0 / 13.0 * 1500.0 * 20.0 * 20.0));
    let shear = format!("{names}\nshear-modulus = \"0.2 MPa\"");
    assert_eq!(good(GRAINS, "friction-static = 0.4", &shear).material, elastic(2e5));

    for (name, operator) in [
        ("arithmetic", ViscousOperator::Arithmetic),
        ("harmonic", ViscousOperator::Harmonic),
        ("tensor", ViscousOperator::Tensor),
    ] {
        let scene = good(FLUID, "[body.column]", &format!("operator = \"{name}\"\n[body.column]"));
        assert_eq!(scene.material, Material::ViscoPlastic(ViscoPlastic { operator, ..fluid() }));
    }
    for (name, mean_stress) in [("rate", MeanStress::Rate), ("density", MeanStress::Density)] {
        let scene = good(SOIL, "cohesion", &format!("mean-stress = \"{name}\"\ncohesion"));
        assert_eq!(scene.material, Material::DruckerPrager(soil(mean_stress)));
    }
}

#[test]
fn every_key_of_the_numerics_is_read() {
    let keys = "viscosity = 0.2\nviscosity-acts = \"always\"\nquadratic-viscosity = 2\ndamping = \"3 1/s\"\n\
                damping-in-flow = \"forced\"\ndensity-gate = 0.9\ndensity-diffusion = 0.3\nstress-diffusion = 0.4\n\
                artificial-stress = 0.5\ngradient-correction = \"variational\"\nshifting = 0.6\n\
                precision = \"mixed\"\ncourant";
    let expected = Numerics {
        courant: 0.5,
        viscous_courant: 0.125,
        viscosity: 0.2,
        viscosity_on_approach: false,
        quadratic_viscosity: 2.0,
        damping: 3.0,
        density_gate: 0.9,
        density_diffusion: 0.3,
        stress_diffusion: 0.4,
        artificial_stress: 0.5,
        gradient_correction: true,
        shifting: 0.6,
        precision: Precision::Mixed,
    };
    assert_eq!(good(SOIL, "courant", keys).numerics, expected);
    let keys = "viscous-courant = 0.2\nviscosity = 0.1\nviscosity-acts = \"approach\"\ndensity-diffusion = 0\n\
                gradient-correction = \"none\"\ndamping-in-flow = \"refused\"\nprecision = \"f64\"\ncourant";
    let expected = Numerics { viscous_courant: 0.2, viscosity: 0.1, viscosity_on_approach: true, ..plain() };
    assert_eq!(good(FLUID, "courant", keys).numerics, expected);
    assert_eq!(good(GRAINS, "courant", keys).numerics, expected);
}

#[test]
fn every_key_of_the_start_is_read() {
    let start = |scene, keys: &str| good(scene, "jitter = 0", &format!("{keys}\njitter = 0")).initial;
    let initial = Initial { stress: InitialStress::Zero, lattice: Lattice::Cubic, jitter: 0.0, seed: 1, relax: 0 };
    for (name, lattice) in
        [("cubic", Lattice::Cubic), ("hexagonal", Lattice::Hexagonal), ("body-centred", Lattice::BodyCentred)]
    {
        assert_eq!(start(FLUID, &format!("lattice = \"{name}\"")), Initial { lattice, ..initial });
    }
    assert_eq!(start(SOIL, "lattice = \"hexagonal\"").lattice, Lattice::Hexagonal);
    let pressure = start(GRAINS, "stress = \"pressure\"\npressure = \"0.6 kPa\"");
    assert_eq!(pressure, Initial { stress: InitialStress::Pressure(600.0), ..initial });
    assert_eq!(start(FLUID, "stress = \"hydrostatic\"").stress, InitialStress::Hydrostatic);
    // K0 follows from the elasticity: nu/(1 - nu).
    let coefficient = |scene: Scene| match scene.initial.stress {
        InitialStress::K0 { coefficient } => coefficient,
        other => panic!("{other:?}"),
    };
    let of_soil = coefficient(good(SOIL, "jitter", "stress = \"k0\"\njitter"));
    assert!((of_soil - 1.0 / 3.0).abs() < 1e-15, "{of_soil}");
    let elastic = GRAINS.replace("[body.layer]", "unyielded = \"elastic\"\n[body.layer]");
    let of_grains = coefficient(good(&elastic, "jitter", "stress = \"k0\"\njitter"));
    assert!((of_grains - 3.0 / 7.0).abs() < 1e-15, "of Poisson's ratio 0.3: {of_grains}");
}

#[test]
fn mu_i_out_of_range_or_incomplete() {
    let key = |name: &str| format!("material.mu-i.{name}");
    bad(GRAINS, "\"1500 kg/m3\"", "0", (6, 11), &key("density"), "greater than 0");
    bad(GRAINS, "\"20 m/s\"", "\"20 m\"", (7, 15), &key("sound-speed"), "is a length; a velocity is needed");
    bad(
        GRAINS,
        "sound-speed = \"20 m/s\"\n",
        "",
        (5, 11),
        &key("sound-speed"),
        "a velocity such as \"1 m/s\" is needed",
    );
    bad(GRAINS, "friction-static = 0.4", "friction-static = 0", (8, 19), &key("friction-static"), "greater than 0");
    bad(GRAINS, "friction-static = 0.4\n", "", (5, 11), &key("friction-static"), "missing; a number without unit");
    let add = |keys: &str, place, name: &str, phrase: &str| {
        bad(GRAINS, "[body.layer]", &format!("{keys}\n[body.layer]"), place, &key(name), phrase);
    };
    add("friction-dynamic = 0.3", (9, 20), "friction-dynamic", "must be 0.4 or greater, the friction at rest");
    let (number, grain) = ("inertial-number = 0.3", "grain-diameter = \"1 mm\"");
    add(
        &format!("friction-dynamic = 0.6\n{number}"),
        (5, 11),
        "grain-diameter",
        "the diameter of the grains is needed",
    );
    add(&format!("friction-dynamic = 0.6\n{grain}"), (5, 11), "inertial-number", "the inertial number I0 is needed");
    add("inertial-number = 0", (9, 19), "inertial-number", "greater than 0");
    add("grain-diameter = \"-1 mm\"", (9, 18), "grain-diameter", "greater than 0");
    add("grain-density = 0", (9, 17), "grain-density", "greater than 0");
    add("norm = \"jopp\"", (9, 8), "norm", "did you mean `jop`? valid: jop, printed");
    let regularised = "curve = \"partially-regularised\"";
    add(regularised, (9, 9), "curve", "needs friction-dynamic above friction-static");
    add("curve = \"barker\"", (9, 9), "curve", "valid: jop, partially-regularised");
    add("unyielded = \"solid\"", (9, 13), "unyielded", "valid: cap, elastic");
    add("viscosity-cap = \"1 Pa\"", (9, 17), "viscosity-cap", "a viscosity is needed (units: mPa s, Pa s, kPa s)");
    add("viscosity-cap = 0", (9, 17), "viscosity-cap", "greater than 0");
    let elastic = "unyielded = \"elastic\"";
    add(&format!("{elastic}\nviscosity-cap = 1"), (10, 17), "viscosity-cap", "only with unyielded = \"cap\"");
    add("shear-modulus = \"1 kPa\"", (9, 17), "shear-modulus", "only with unyielded = \"elastic\"");
    // 3/2 of 1500 kg/m3 (20 m/s)^2.
    let message = "\"1 MPa\" is above 3/2 rho c^2 = 900000 Pa: Poisson's ratio would be negative";
    add(&format!("{elastic}\nshear-modulus = \"1 MPa\""), (10, 17), "shear-modulus", message);
    add(&format!("{elastic}\nnorm = \"printed\""), (10, 8), "norm", "goes with unyielded = \"cap\" only");
    add("tension = \"some\"", (9, 11), "tension", "valid: none, kept");
    add("friction = 30", (9, 1), "friction", "unknown key `friction`");
}

#[test]
fn visco_plastic_out_of_range_or_incomplete() {
    let key = |name: &str| format!("material.visco-plastic.{name}");
    bad(FLUID, "\"2.6 g/cm3\"", "0", (4, 11), &key("density"), "greater than 0");
    bad(FLUID, "\"10 m/s\"", "0", (5, 15), &key("sound-speed"), "greater than 0");
    bad(FLUID, "\"22 deg\"", "90", (6, 12), &key("friction"), "in [0, 90) degrees");
    bad(FLUID, "\"1 kPa\"", "-1", (7, 12), &key("cohesion"), "0 or greater");
    bad(FLUID, "\"1 mPa s\"", "-1", (8, 13), &key("viscosity"), "0 or greater");
    bad(FLUID, "\"1 mPa s\"", "\"1 MPa s\"", (8, 13), &key("viscosity"), "unknown unit `MPas`");
    bad(
        FLUID,
        "viscosity-solid = \"0.2 kPa s\"\n",
        "",
        (3, 11),
        &key("viscosity-solid"),
        "such as \"200 Pa s\" is needed",
    );
    let message = "must be 0.001 Pa s or greater, the viscosity of fast flow";
    bad(FLUID, "\"0.2 kPa s\"", "1e-4", (9, 19), &key("viscosity-solid"), message);
    let operator = "operator = \"mean\"\n[body.column]";
    bad(FLUID, "[body.column]", operator, (10, 12), &key("operator"), "valid: arithmetic, harmonic, tensor");
}

#[test]
fn laws_that_are_none_or_several_or_do_not_fit() {
    let none = "[material]\n[body.column]";
    let law = &SOIL[SOIL.find("[material").unwrap()..SOIL.find("[body").unwrap()];
    let message = "names no law; one of drucker-prager, mu-i, visco-plastic is needed, e.g. [material.drucker-prager]";
    bad(SOIL, &format!("{law}[body.column]"), none, (3, 2), "material", message);
    let several = &FLUID[FLUID.find("[material").unwrap()..FLUID.find("[body").unwrap()];
    let message = "has several laws (drucker-prager, visco-plastic); exactly one is needed";
    bad(SOIL, "[body.column]", &format!("{several}[body.column]"), (9, 11), "material", message);
    let message = "unknown key `mui`; did you mean `mu-i`?";
    let [fault] = &faults(&GRAINS.replace("mu-i]", "mui]"))[1..] else { panic!("no law, and one unknown") };
    assert!(fault.key == "material.mui" && fault.message.contains(message), "{fault:?}");
    // Plastic dilation changes the density.
    let both = "dilation = 5\nmean-stress = \"density\"\ncohesion";
    let message = "which plastic dilation changes; set dilation = 0, or \"rate\"";
    bad(SOIL, "cohesion", both, (9, 15), "material.drucker-prager.mean-stress", message);
}

#[test]
fn numerics_out_of_range_or_without_effect() {
    let soil = |keys: &str, place, name: &str, phrase: &str| {
        bad(SOIL, "courant", &format!("{keys}\ncourant"), place, &format!("numerics.{name}"), phrase);
    };
    soil("quadratic-viscosity = 11", (12, 23), "quadratic-viscosity", "in [0, 10]");
    soil("density-diffusion = 2", (12, 21), "density-diffusion", "in [0, 1]");
    soil("stress-diffusion = -1", (12, 20), "stress-diffusion", "in [0, 1]");
    soil("artificial-stress = 1.1", (12, 21), "artificial-stress", "in [0, 1]");
    soil("shifting = 1.1", (12, 12), "shifting", "in [0, 1]");
    soil("density-gate = 1", (12, 16), "density-gate", "in [0, 1), a fraction of the initial density");
    soil("viscosity-acts = \"never\"", (12, 18), "viscosity-acts", "valid: approach, always");
    soil("gradient-correction = true", (12, 23), "gradient-correction", "one of \"none\", \"variational\" is needed");
    soil("damping-in-flow = \"yes\"", (12, 19), "damping-in-flow", "valid: refused, forced");
    soil("precision = \"f32\"", (12, 13), "precision", "valid: f64, mixed");
    soil("precision = 64", (12, 13), "precision", "one of \"f64\", \"mixed\" is needed");
    let mixed = "precision = \"mixed\"\ncourant";
    let message = "\"mixed\" with a period: the bits of the answer would depend on where a run was stopped; set \"f64\", or take \
                   walls instead of the period";
    bad(GRAINS, "courant", mixed, (17, 13), "numerics.precision", message);
    let along_y = FLUID.replace("[material", "periodic.y = { from = 0, to = 0.1 }\n[material");
    bad(&along_y, "courant", mixed, (14, 13), "numerics.precision", message);
    soil(
        "viscous-courant = 0.1",
        (12, 19),
        "viscous-courant",
        "is used only with a viscosity, that of visco-plastic or",
    );
    bad(FLUID, "courant", "viscous-courant = 0.3\ncourant", (13, 19), "numerics.viscous-courant", "in (0, 0.25]");

    let gate = "the pressure of this law follows from the density, so that lost volume comes back without a gate";
    bad(FLUID, "courant", "density-gate = 0.9\ncourant", (13, 16), "numerics.density-gate", gate);
    bad(GRAINS, "courant", "density-gate = 0.9\ncourant", (17, 16), "numerics.density-gate", gate);
    let tied = SOIL.replace("cohesion", "mean-stress = \"density\"\ncohesion");
    bad(&tied, "courant", "density-gate = 0.9\ncourant", (13, 16), "numerics.density-gate", gate);
    let diffusion = "the stress of a fluid follows from density and strain rate";
    bad(FLUID, "courant", "stress-diffusion = 0.1\ncourant", (13, 20), "numerics.stress-diffusion", diffusion);
    bad(GRAINS, "courant", "stress-diffusion = 0.1\ncourant", (17, 20), "numerics.stress-diffusion", diffusion);

    // A period takes f64, and mixed precision goes with all laws.
    good(GRAINS, "courant", "precision = \"f64\"\ncourant");
    good(&GRAINS.replace("periodic.x = { from = 0, to = \"0.2 m\" }\n", ""), "courant", mixed);
    good(FLUID, "courant", mixed);
    // Off is off, and what carries its stress along may diffuse it.
    good(FLUID, "courant", "density-gate = 0\nstress-diffusion = 0\ncourant");
    let elastic = GRAINS.replace("[body.layer]", "unyielded = \"elastic\"\n[body.layer]");
    assert_eq!(good(&elastic, "courant", "stress-diffusion = 0.1\ncourant").numerics.stress_diffusion, 0.1);
    let message = "is used only with a viscosity";
    bad(&elastic, "courant", "viscous-courant = 0.1\ncourant", (18, 19), "numerics.viscous-courant", message);
}

#[test]
fn starts_that_do_not_fit() {
    let start = |scene: &str, keys: &str, place, name: &str, phrase: &str| {
        bad(scene, "jitter = 0", &format!("{keys}\njitter = 0"), place, &format!("initial.{name}"), phrase);
    };
    start(
        SOIL,
        "lattice = \"body-centred\"",
        (14, 11),
        "lattice",
        "needs three dimensions; in a plane use \"hexagonal\"",
    );
    start(SOIL, "lattice = \"square\"", (14, 11), "lattice", "valid: cubic, hexagonal, body-centred");
    start(SOIL, "pressure = 5", (14, 12), "pressure", "is used only with stress = \"pressure\"");
    start(SOIL, "stress = \"zero\"\npressure = 5", (15, 12), "pressure", "is used only with stress = \"pressure\"");
    start(SOIL, "stress = \"pressure\"", (13, 2), "pressure", "missing; a stress such as \"600 Pa\" is needed");
    start(SOIL, "stress = \"pressure\"\npressure = -5", (15, 12), "pressure", "0 or greater");
    let several = "stress = \"pressure\"\npressure = 5\nk0 = 0.5";
    start(SOIL, several, (16, 6), "k0", "is used only with stress = \"k0\"");
    let message = "needs a law with a shear stress at rest, and this one is a fluid; use \"hydrostatic\"";
    start(FLUID, "stress = \"k0\"\nk0 = 0.5", (15, 10), "stress", message);
    start(GRAINS, "stress = \"k0\"", (19, 10), "stress", message);
}

/// The integral of p/rho^2 from the density without pressure, by Simpson's rule.
fn work(pressure: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    const PARTS: usize = 1000;
    let step = (to - from) / PARTS as f64;
    let f = |i: usize| {
        let density = from + step * i as f64;
        let weight = if i == 0 || i == PARTS { 1.0 } else { [2.0, 4.0][i % 2] };
        weight * pressure(density) / (density * density)
    };
    (0..=PARTS).map(f).sum::<f64>() * step / 3.0
}

#[test]
fn densities_are_those_of_the_equation_of_state() {
    // Tait (Szewc 2017, Eq 11), p = c^2 (rho - rho0) (Yang et al. 2020, Eq 4), and Hooke's p = K (rho/rho0 - 1).
    let c2 = 100.0;
    let tait = |density: f64| c2 * 2600.0 / 7.0 * ((density / 2600.0).powi(7) - 1.0);
    let linear = |density: f64| 400.0 * (density - 1500.0);
    let bulk = 2e6 / (3.0 * 0.5);
    let hooke = |density: f64| bulk * (density / 1800.0 - 1.0);
    type Case<'a> = (Material, &'a dyn Fn(f64) -> f64);
    let cases: [Case; 3] = [
        (Material::ViscoPlastic(fluid()), &tait),
        (Material::MuI(grains()), &linear),
        (Material::DruckerPrager(soil(MeanStress::Density)), &hooke),
    ];
    for (material, pressure) in cases {
        for p in [0.0, 10.0, 1e3, 5e4] {
            let density = material.density_at(p);
            // Rounding of the density times the stiffness.
            assert!((pressure(density) - p).abs() < 1e-8, "{material:?}: {p} Pa, {density} kg/m3");
        }
        assert_eq!(material.density_at(0.0), material.density());
    }
    assert_eq!(Material::DruckerPrager(soil(MeanStress::Rate)).density_at(1e4), 1800.0);
}

#[test]
fn energy_stored_in_pressure_is_its_work() {
    let isotropic = |p: f64| [-p, -p, -p, 0.0, 0.0, 0.0];
    let tait = |density: f64| 100.0 * 2600.0 / 7.0 * ((density / 2600.0_f64).powi(7) - 1.0);
    let linear = |density: f64| 400.0 * (density - 1500.0);
    for strain in [1e-3, 0.05, 0.3] {
        let density = 2600.0 * (1.0 + strain);
        let energy = Material::ViscoPlastic(fluid()).stored_energy(isotropic(tait(density)), density);
        let expected = work(tait, 2600.0, density);
        // What cancels in the closed form leaves 1e-16/strain^2.
        assert!((energy / expected - 1.0).abs() < 1e-9, "{strain}: {energy} {expected}");
        let density = 1500.0 * (1.0 + strain);
        let energy = Material::MuI(grains()).stored_energy(isotropic(linear(density)), density);
        let expected = work(linear, 1500.0, density);
        assert!((energy / expected - 1.0).abs() < 1e-9, "{strain}: {energy} {expected}");
    }
    // Opened, grains carry nothing and store nothing, unless tension is kept.
    let density = 1400.0;
    assert_eq!(Material::MuI(grains()).stored_energy([0.0; 6], density), 0.0);
    let kept = Material::MuI(MuI { tension: true, ..grains() });
    let expected = work(linear, 1500.0, density);
    assert!(expected > 0.0 && (kept.stored_energy(isotropic(linear(density)), density) / expected - 1.0).abs() < 1e-9);
    // Hooke's law is linear in small strains: the error of its quadratic form is a third of the strain.
    let (strain, bulk) = (1e-3, 2e6 / (3.0 * 0.5));
    let density = 1800.0 * (1.0 + strain);
    for (mean_stress, pressure) in [
        (MeanStress::Rate, (&|density: f64| bulk * (density / 1800.0).ln()) as &dyn Fn(f64) -> f64),
        (MeanStress::Density, &|density: f64| bulk * (density / 1800.0 - 1.0)),
    ] {
        let energy = Material::DruckerPrager(soil(mean_stress)).stored_energy(isotropic(pressure(density)), density);
        let expected = work(pressure, 1800.0, density);
        assert!((energy / expected - 1.0).abs() < 0.5 * strain, "{mean_stress:?}: {energy} {expected}");
    }
}

#[test]
fn energy_stored_in_shear_is_that_of_hookes_law() {
    // tau^2/(2 G rho) in simple shear; the same of s = (2, -1, -1) tau/sqrt(3), which has the same J2.
    let (tau, t) = (500.0, 500.0 / 3f64.sqrt());
    let shears = [
        [0.0, 0.0, 0.0, tau, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, tau, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, tau],
        [2.0 * t, -t, -t, 0.0, 0.0, 0.0],
    ];
    let shear = 2e6 / (2.0 * 1.25);
    let elastic = |shear| Material::MuI(MuI { unyielded: Unyielded::Elastic(shear), ..grains() });
    for stress in shears {
        let expected = tau * tau / (2.0 * shear * 1800.0);
        let energy = Material::DruckerPrager(soil(MeanStress::Rate)).stored_energy(stress, 1800.0);
        assert!((energy / expected - 1.0).abs() < 1e-12, "{stress:?}: {energy} {expected}");
        let expected = tau * tau / (2.0 * 3e5 * 1500.0);
        let energy = elastic(3e5).stored_energy(stress, 1500.0);
        assert!((energy / expected - 1.0).abs() < 1e-12, "{stress:?}: {energy} {expected}");
        // What viscosity holds up is not had back.
        assert_eq!(Material::MuI(grains()).stored_energy(stress, 1500.0), 0.0);
        assert_eq!(Material::ViscoPlastic(fluid()).stored_energy(stress, 2600.0), 0.0);
    }
}

#[test]
fn sound_speeds_and_kinds() {
    let near = |material: &Material, c: f64| assert!((material.sound_speed() / c - 1.0).abs() < 1e-12, "{material:?}");
    let soil = Material::DruckerPrager(soil(MeanStress::Rate));
    // E (1 - nu)/((1 + nu)(1 - 2 nu)/rho, another form of K + 4/3 G.
    near(&soil, (2e6 * 0.75 / (1.25 * 0.5) / 1800.0_f64).sqrt());
    let elastic = Material::MuI(MuI { unyielded: Unyielded::Elastic(2e5), ..grains() });
    near(&elastic, (400.0 + 4.0 / 3.0 * 2e5 / 1500.0_f64).sqrt());
    near(&Material::MuI(grains()), 20.0);
    near(&Material::ViscoPlastic(fluid()), 10.0);
    let fluids = [&soil, &elastic, &Material::MuI(grains()), &Material::ViscoPlastic(fluid())].map(Material::is_fluid);
    assert_eq!(fluids, [false, false, true, true]);
}

#[test]
fn no_text_makes_the_reader_panic() {
    for text in [GRAINS, FLUID] {
        for (at, _) in text.char_indices() {
            for piece in ["", "\"", "[", "=", "\n", "9", "-"] {
                let text = format!("{}{piece}{}", &text[..at], &text[at + 1..]);
                if let Err(error) = Scene::read("scene.toml", &text) {
                    let places: Vec<_> = error.faults.iter().map(|fault| (fault.line, fault.column)).collect();
                    assert!(!places.is_empty() && places.is_sorted(), "{error}");
                }
            }
        }
    }
}
