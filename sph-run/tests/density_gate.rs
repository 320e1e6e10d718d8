//! The cure of the volume ratchet: row F12 of the list of scenes where methods fail.

use formats::scene::{Cone, DruckerPrager as Sand, Rotation};
use sph_run::algebra::Sym;
use sph_run::material::{DruckerPrager, History, Increment, Material};

/// F12: expanded by a fifth without stress, then compressed back. The law alone ends under the pressure K ln(1/0.8), as if
/// nothing had opened; with the gate the stress comes back with the density only.
#[test]
fn the_density_gate_gives_volume_back() {
    let law = DruckerPrager::new(&Sand {
        density: 2600.0,
        young: 5.98e6,
        poisson: 0.3,
        friction_deg: 30.0,
        dilation_deg: 0.0,
        cohesion: 0.0,
        cone: Cone::Compression,
        rotation: Rotation::Jaumann,
        mean_stress: formats::scene::MeanStress::Rate,
    });
    let cycle = |gate: f64| {
        let (mut stress, mut density, mut history) = (Sym::<6>::default(), 2600.0, History::default());
        let (steps, mut highest_open) = (2000, 0.0_f64);
        for k in 0..2 * steps {
            let rate = if k < steps { 0.2 } else { -0.2 } / f64::from(steps);
            density *= (1.0 - 0.5 * rate) / (1.0 + 0.5 * rate);
            stress =
                law.stress(stress, &Increment { strain: Sym::isotropic(rate / 3.0), density, dt: 1.0 }, &mut history);
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
