//! The cures of the volume ratchet: row F12 of the list of scenes where methods fail. A density below which nothing carries,
//! and a mean stress that follows from the density.

use crate::support::{Random, close, root_j2};
use formats::scene::{Cone, DruckerPrager as Sand, MeanStress, Rotation};
use sph_run::algebra::Sym;
use sph_run::material::{DruckerPrager, History, Increment, Material};

const DENSITY: f64 = 2600.0;

/// Table 1 of Yang et al. (2020).
fn sand(mean_stress: MeanStress) -> Sand {
    Sand {
        density: DENSITY,
        young: 5.98e6,
        poisson: 0.3,
        friction_deg: 30.0,
        dilation_deg: 0.0,
        cohesion: 0.0,
        cone: Cone::Compression,
        rotation: Rotation::Jaumann,
        mean_stress,
    }
}

/// The density after a strain, as a step of the solver has it.
fn strained<const N: usize>(density: f64, strain: Sym<N>) -> f64 {
    density * (1.0 - 0.5 * strain.trace()) / (1.0 + 0.5 * strain.trace())
}

/// F12: expanded by a fifth without stress, then compressed back. The law alone ends under the pressure K ln(1/0.8), as if
/// nothing had opened; with the gate the stress comes back with the density only.
#[test]
fn the_density_gate_gives_volume_back() {
    let law = DruckerPrager::new(&sand(MeanStress::Rate));
    let cycle = |gate: f64| {
        let (mut stress, mut density, mut history) = (Sym::<6>::default(), 2600.0, History::default());
        let (steps, mut highest_open) = (2000, 0.0_f64);
        for k in 0..2 * steps {
            let rate = if k < steps { 0.2 } else { -0.2 } / f64::from(steps);
            let strain = Sym::isotropic(rate / 3.0);
            density = strained(density, strain);
            stress = law.stress(stress, &Increment { strain, density, dt: 1.0 }, &mut history);
            stress = sph_run::material::gated(stress, density, gate);
            if density < 0.97 * 2600.0 {
                highest_open = highest_open.max(-stress.trace() / 3.0);
            }
        }
        (-stress.trace() / 3.0, highest_open)
    };
    let (law_alone, open) = cycle(0.0);
    assert!((law_alone / (0.2 * law.bulk) - 1.0).abs() < 1e-3 && open > 0.5 * law_alone, "{law_alone}");
    let (closed, open) = cycle(0.98 * 2600.0);
    assert_eq!(open, 0.0);
    // Between the gate and the initial density, 2 % of compression, it carries again.
    assert!((closed / (-(0.98_f64.ln()) * law.bulk) - 1.0).abs() < 0.02, "{closed}");
}

/// The same cycle with the mean stress of the density: nothing while open, nothing at the end, and K (rho/rho0 - 1) beyond.
#[test]
fn the_mean_stress_of_the_density_gives_volume_back() {
    let law = DruckerPrager::new(&sand(MeanStress::Density));
    let (mut stress, mut density, mut history) = (Sym::<6>::default(), DENSITY, History::default());
    let steps = 2000;
    for k in 0..2 * steps {
        let strain = Sym::isotropic(if k < steps { 0.2 } else { -0.2 } / f64::from(3 * steps));
        density = strained(density, strain);
        stress = law.stress(stress, &Increment { strain, density, dt: 1.0 }, &mut history);
        assert!(-stress.trace() / 3.0 < 1e-9 * law.bulk, "step {k}: {stress:?}");
        // The apex of cohesionless material.
        assert!(stress.trace() <= 0.0 && root_j2(stress) == 0.0, "step {k}: {stress:?}");
    }
    println!("F12, mean stress of the density: {:e} K at the end", -stress.trace() / 3.0 / law.bulk);
    close(density, DENSITY, 1e-12);
    let strain = Sym::isotropic(-1e-3);
    density = strained(density, strain);
    stress = law.stress(stress, &Increment { strain, density, dt: 1.0 }, &mut history);
    close(-stress.trace() / 3.0, law.bulk * (density / DENSITY - 1.0), 1e-12);
}

/// On the way into compression and shear, elastic and plastic, both mean stresses agree up to the square of the strain of
/// volume: halving it quarters the difference.
#[test]
fn both_mean_stresses_agree_in_monotone_loading() {
    let laws = [MeanStress::Rate, MeanStress::Density].map(|mean| DruckerPrager::new(&sand(mean)));
    let differ = |size: f64, shear: f64| {
        let steps = 4000;
        // Compression along z and shear; `shear` large enough yields.
        let strain = Sym([0.0, 0.0, -1.0, 0.0, 0.0, shear]) * (size / f64::from(steps));
        let ends = laws.map(|law| {
            let (mut stress, mut density, mut history) = (Sym::<6>::default(), DENSITY, History::default());
            for _ in 0..steps {
                density = strained(density, strain);
                stress = law.stress(stress, &Increment { strain, density, dt: 1.0 }, &mut history);
            }
            (stress, history.plastic_strain)
        });
        let [(rate, plastic), (density, _)] = ends;
        let difference = rate - density;
        (difference.contract(difference).sqrt() / laws[0].bulk, plastic)
    };
    for shear in [0.0, 0.3, 3.0] {
        let ((coarse, plastic), (fine, _)) = (differ(2e-3, shear), differ(1e-3, shear));
        let order = (coarse / fine).log2();
        println!("shear {shear}: {coarse:e} K and {fine:e} K, order {order:.4}, plastic strain {plastic:e}");
        assert!((1.95..2.05).contains(&order), "shear {shear}: {coarse:e} {fine:e}");
        // ln(rho/rho0) against rho/rho0 - 1 in each normal stress, and what friction makes of it.
        assert!(coarse < 3.0 * (2e-3_f64).powi(2), "{coarse}");
        assert_eq!(plastic > 0.0, shear == 3.0);
    }
}

/// With cohesion the material pulls up to the apex, I1 = k/alpha, and no further, however far it opens; the deviator fades
/// on the way there as the cone demands, and what was strained without volume stays what Hooke says.
#[test]
fn the_apex_of_cohesion() {
    let law = DruckerPrager::new(&Sand { cohesion: 2e3, ..sand(MeanStress::Density) });
    let apex = law.k / law.alpha;
    // 3 c cot(phi).
    close(apex, 3.0 * 2e3 / 30f64.to_radians().tan(), 1e-12);
    let mut random = Random(5);
    for k in 0..200 {
        let (old, strain) = (random.sym::<6>(5e3), random.sym::<6>(1e-3).deviator());
        let opened = 10f64.powf(-5.0 + 4.0 * f64::from(k) / 200.0);
        let step = Increment { strain, density: DENSITY * (1.0 - opened), dt: 1.0 };
        let s = law.stress(old, &step, &mut History::default());
        let trial = 3.0 * law.bulk * opened;
        let deviator = old.deviator() + strain * (2.0 * law.shear);
        if trial >= apex {
            close(s.trace(), apex, 1e-12);
            assert!(root_j2(s) < 1e-12 * apex, "{s:?}");
        } else {
            close(s.trace(), trial, 1e-9);
            close(root_j2(s), root_j2(deviator).min(law.k - law.alpha * trial), 1e-9);
        }
    }
}
