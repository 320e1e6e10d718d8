//! The visco-plastic law of Szewc (2017) at a material point, against closed forms.

use crate::support::{Random, close, root_j2, stress};
use formats::scene::{self, ViscousOperator};
use sph_run::algebra::Sym;
use sph_run::material::{History, Increment, Material, Mean, ViscoPlastic};

const DENSITY: f64 = 1850.0;
const DT: f64 = 1e-5;

fn soil() -> scene::ViscoPlastic {
    scene::ViscoPlastic {
        density: DENSITY,
        sound_speed: 10.0,
        friction_deg: 30.0,
        cohesion: 0.0,
        viscosity: 0.0,
        viscosity_solid: 1e9,
        operator: ViscousOperator::Tensor,
    }
}

fn norm<const N: usize>(rate: Sym<N>) -> f64 {
    (2.0 * rate.deviator().contract(rate.deviator())).sqrt()
}

fn viscosity<const N: usize>(law: &scene::ViscoPlastic, rate: Sym<N>, density: f64) -> f64 {
    ViscoPlastic::new(law).viscosity(&Increment { strain: rate * DT, density, dt: DT })
}

/// Tait's equation of state (Eq 11): nothing at rho0, c^2 there as its slope, the seventh power elsewhere, and negative
/// below rho0. The density at a pressure is its inverse.
#[test]
fn the_pressure_of_tait() {
    let law = ViscoPlastic::new(&soil());
    let pressure = |ratio: f64| law.pressure(ratio * DENSITY);
    assert_eq!(pressure(1.0), 0.0);
    close((pressure(1.0 + 1e-6) - pressure(1.0 - 1e-6)) / (2e-6 * DENSITY), 100.0, 1e-9);
    for ratio in [0.7, 0.98, 1.01, 1.2] {
        close(pressure(ratio), 100.0 * DENSITY / 7.0 * (f64::powf(ratio, 7.0) - 1.0), 1e-13);
        let density = scene::Material::ViscoPlastic(soil()).density_at(pressure(ratio));
        close(density, ratio * DENSITY, 1e-13);
    }
    assert!(pressure(0.98) < 0.0);
    let s = stress(&law, Sym::<4>::default(), 1.01 * DENSITY, DT);
    assert_eq!(s, Sym::isotropic(-pressure(1.01)));
}

/// mu = mu_inf + (cohesion + p tan phi)/|gdot| up to mu_solid (Eq 20): mu_inf of the fastest flow, mu_solid of the slowest,
/// and where there is neither, sqrt(J2) = cohesion + p tan phi in any flow.
#[test]
fn the_viscosity_of_bingham() {
    let (dense, tan) = (1.01 * DENSITY, 30f64.to_radians().tan());
    let law = scene::ViscoPlastic { cohesion: 500.0, viscosity: 2.0, viscosity_solid: 3e4, ..soil() };
    let strength = 500.0 + ViscoPlastic::new(&law).pressure(dense) * tan;
    let mut random = Random(1);
    for _ in 0..100 {
        let unit = |rate: Sym<6>| rate * (1.0 / norm(rate));
        let rate = unit(random.sym(1.0));
        close(viscosity(&law, rate * 1e12, dense), 2.0, 1e-6);
        assert_eq!(viscosity(&law, rate * 1e-4, dense), 3e4);
        assert_eq!(viscosity(&law, Sym::<6>::default(), dense), 3e4);
        for speed in [0.5, 3.0, 100.0] {
            close(viscosity(&law, rate * speed, dense), 2.0 + strength / speed, 1e-12);
        }
        // A change of volume is no flow.
        let mixed = rate.deviator() + Sym::isotropic(7.0);
        close(viscosity(&law, mixed, dense), viscosity(&law, rate.deviator(), dense), 1e-12);
        for cohesion in [0.0, 500.0] {
            let law = scene::ViscoPlastic { cohesion, ..soil() };
            let s = stress(&ViscoPlastic::new(&law), rate * 5.0, dense, DT);
            close(root_j2(s), cohesion - s.trace() / 3.0 * tan, 1e-12);
            let plane = random.sym::<4>(1.0);
            let s = stress(&ViscoPlastic::new(&law), plane, dense, DT);
            close(root_j2(s), cohesion - s.trace() / 3.0 * tan, 1e-12);
        }
    }
    assert_eq!(ViscoPlastic::new(&law).largest_viscosity(), Some(3e4));
}

/// Below rho0 the pressure pulls, but friction does not turn negative: what is left is cohesion and mu_inf.
#[test]
fn no_friction_without_pressure() {
    let rate = Sym([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let law = scene::ViscoPlastic { viscosity: 2.0, ..soil() };
    close(viscosity(&law, rate, 0.95 * DENSITY), 2.0, 1e-14);
    let law = scene::ViscoPlastic { cohesion: 300.0, ..law };
    close(viscosity(&law, rate, 0.95 * DENSITY), 2.0 + 150.0, 1e-14);
    let s = stress(&ViscoPlastic::new(&law), rate, 0.95 * DENSITY, DT);
    assert!(s.trace() > 0.0 && s.contract(rate) > 0.0, "{s:?}");
}

/// As a tensor the viscous stress is 2 mu e, e deviatoric, and takes energy out; along pairs the law leaves only the
/// pressure, and names how two viscosities act.
#[test]
fn where_the_viscous_stress_acts() {
    let mut random = Random(2);
    let dense = 1.02 * DENSITY;
    for _ in 0..50 {
        let (old, rate) = (random.sym::<6>(1e4), random.sym::<6>(3.0));
        let step = Increment { strain: rate * DT, density: dense, dt: DT };
        let law = scene::ViscoPlastic { viscosity: 5.0, cohesion: 100.0, ..soil() };
        let pressure = ViscoPlastic::new(&law).pressure(dense);
        let mut history = History::default();
        let s = ViscoPlastic::new(&law).stress(old, &step, &mut history);
        let wanted = rate.deviator() * (2.0 * viscosity(&law, rate, dense)) + Sym::isotropic(-pressure);
        assert!(root_j2(s - wanted) < 1e-12 * root_j2(s), "{s:?} {wanted:?}");
        close(s.trace(), -3.0 * pressure, 1e-12);
        assert!(s.deviator().contract(rate) > 0.0);
        close(history.plastic_strain, norm(rate) * DT / 3f64.sqrt(), 1e-12);
        for (operator, mean) in
            [(ViscousOperator::Arithmetic, Mean::Arithmetic), (ViscousOperator::Harmonic, Mean::Harmonic)]
        {
            let law = ViscoPlastic::new(&scene::ViscoPlastic { operator, ..law });
            assert_eq!(law.stress(old, &step, &mut History::default()), Sym::isotropic(-pressure));
            assert_eq!(law.pair_viscosity(), Some(mean));
        }
        assert_eq!(ViscoPlastic::new(&law).pair_viscosity(), None);
    }
}
