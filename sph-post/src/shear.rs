//! How fast the material shears, and its inertial number, on the section.

use crate::{
    field::pressure,
    geometry::Geometry,
    sample::Sampler,
    section::{Section, places, plane},
};
use formats::{scene::Material, snapshot::Rows, space::Space};

/// The grains that the inertial number is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grains {
    /// Diameter d, m.
    pub diameter: f64,
    /// Density of a grain, kg/m3.
    pub density: f64,
}

impl Grains {
    /// Of the law, where it knows them; else of `diameter` and the density of the bulk at the start.
    pub fn of(g: &Geometry, diameter: Option<f64>) -> Option<Self> {
        let law = match &g.material {
            Material::MuI(law) if law.grain_diameter > 0.0 && law.grain_density > 0.0 => {
                Some(Self { diameter: law.grain_diameter, density: law.grain_density })
            }
            _ => None,
        };
        let density = law.map_or(g.density, |l| l.density);
        diameter.map(|diameter| Self { diameter, density }).or(law)
    }
}

/// Shear rate and inertial number in the cells of a [`Section`], in its order; NaN outside the material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shear {
    /// |gamma'| = sqrt(2 D':D') with the deviator D' of the rate of deformation (Jop, Forterre & Pouliquen 2006, Eq 1), 1/s.
    pub rate: Vec<f64>,
    /// I = |gamma'| d / sqrt(p/rho_s) (the same, below Eq 1); NaN where nothing is pressed. None without grains.
    pub inertial: Option<Vec<f64>>,
}

impl Shear {
    /// Of the particles in `rows`, in the cells of `section`.
    pub fn new(g: &Geometry, rows: &Rows, sampler: &Sampler, section: &Section, grains: Option<Grains>) -> Self {
        let y = plane(g, rows);
        let cells = section.bins * section.rows;
        let mut out = Self { rate: vec![f64::NAN; cells], inertial: grains.map(|_| vec![f64::NAN; cells]) };
        for k in 0..section.bins {
            let at = places(g, section.along(g, k), y);
            for j in (0..section.rows).filter(|j| section.speed[j * section.bins + k].is_finite()) {
                let z = g.floor + Section::above(g, j);
                let mut sum = [0.0; 3];
                for x in &at {
                    let x = [x[0], x[1], z];
                    let (Some(stencil), Some(gradient)) = (sampler.stencil(x), sampler.gradient(x, &rows.velocity))
                    else {
                        continue;
                    };
                    let hoop = match g.space {
                        Space::Axisymmetric => stencil.vector(&rows.velocity)[0] / x[0],
                        _ => 0.0,
                    };
                    let found = [shear_rate(gradient, hoop), pressure(stencil.symmetric(&rows.stress)), 1.0];
                    (0..3).for_each(|i| sum[i] += found[i]);
                }
                if sum[2] > 0.0 {
                    let cell = j * section.bins + k;
                    let (rate, p) = (sum[0] / sum[2], sum[1] / sum[2]);
                    out.rate[cell] = rate;
                    if let (Some(inertial), Some(grains), true) = (&mut out.inertial, grains, p > 0.0) {
                        inertial[cell] = rate * grains.diameter / (p / grains.density).sqrt();
                    }
                }
            }
        }
        out
    }
}

/// sqrt(2 D':D') of a velocity gradient `l[a][b]` = dv_a/dx_b, 1/s; `hoop` is v_r/r in the axisymmetric space, else 0.
fn shear_rate(l: [[f64; 3]; 3], hoop: f64) -> f64 {
    let mut d = [[0.0; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            d[a][b] = 0.5 * (l[a][b] + l[b][a]);
        }
    }
    d[1][1] += hoop;
    let mean = (d[0][0] + d[1][1] + d[2][2]) / 3.0;
    (0..3).for_each(|a| d[a][a] -= mean);
    (2.0 * d.iter().flatten().map(|d| d * d).sum::<f64>()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        deposit::Deposit,
        testing::{block, geometry, jitter},
    };
    use formats::kernel::Kernel;

    /// Simple shear v_x = 5 z, plus in r-z the radial growth that mirror images allow: v_r = 2 r has the rates (2, 2, 0).
    #[test]
    fn linear_flows_have_their_exact_shear_rate_and_inertial_number() {
        for space in Space::ALL {
            let mut g = geometry(space, Kernel::WendlandC2, 0.01);
            if space == Space::ThreeD {
                g.mirrored = [false, false];
            }
            let mut rows = block(&g, [14, if space == Space::ThreeD { 14 } else { 1 }, 12]);
            jitter(&mut rows, &g, 0.1);
            let grows = space == Space::Axisymmetric;
            for row in 0..rows.len() {
                let x = rows.position[row];
                rows.velocity[row] = if grows { [2.0 * x[0], 0.0, 0.0] } else { [5.0 * x[2], 0.0, 0.0] };
                rows.stress[row] = [-400.0, -400.0, -400.0, 0.0, 0.0, 0.0];
            }
            let sampler = Sampler::new(&g, &rows);
            let deposit = Deposit::new(&g, &rows, &sampler);
            let section = Section::new(&g, &rows, &sampler, &deposit.profile);
            let grains = Grains { diameter: 0.002, density: 2500.0 };
            let shear = Shear::new(&g, &rows, &sampler, &section, Some(grains));
            // D = diag(2, 2, 0) has the deviator diag(2, 2, -4)/3: sqrt(2 (4 + 4 + 16)/9) = 4/sqrt(3).
            let rate = if grows { 4.0 / 3_f64.sqrt() } else { 5.0 };
            let number = rate * 0.002 / (400.0_f64 / 2500.0).sqrt();
            for j in 1..11 {
                for k in 3..10 {
                    let c = j * section.bins + k;
                    assert!((shear.rate[c] / rate - 1.0).abs() < 1e-8, "{space:?} {j} {k}: {}", shear.rate[c]);
                    let found = shear.inertial.as_ref().unwrap()[c];
                    assert!((found / number - 1.0).abs() < 1e-8, "{space:?} {j} {k}: {found}");
                }
            }
            assert_eq!(Shear::new(&g, &rows, &sampler, &section, None).inertial, None);
        }
    }

    #[test]
    fn rigid_turning_and_swelling_are_no_shear() {
        let turning = [[0.0, 0.0, 3.0], [0.0, 0.0, 0.0], [-3.0, 0.0, 0.0]];
        assert_eq!(shear_rate(turning, 0.0), 0.0);
        let swelling = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
        assert_eq!(shear_rate(swelling, 0.0), 0.0);
    }
}
