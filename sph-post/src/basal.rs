//! Stresses near the floor, and whether they carry what lies above.

use crate::{deposit::Deposit, dip::Dip, geometry::Geometry, sample::Sampler};
use formats::{snapshot::Rows, units};

/// Where the stresses are taken: a height above the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// In smoothing lengths.
    Smoothing(f64),
    /// In m.
    Length(f64),
}

impl Level {
    /// From `"3 h"` or a length as in scenes, `"12 mm"`.
    ///
    /// # Errors
    /// A sentence that says what would be right.
    pub fn parse(text: &str) -> Result<Self, String> {
        let level = match text.trim().strip_suffix('h') {
            Some(number) => number.trim().parse().ok().map(Self::Smoothing),
            None => Some(Self::Length(units::parse(text, units::Dimension::Length)?)),
        };
        match level {
            Some(Self::Smoothing(n) | Self::Length(n)) if !(n.is_finite() && n >= 0.0) => None,
            other => other,
        }
        .ok_or_else(|| format!("`{text}` is no height: give smoothing lengths as \"3 h\", or a length as \"12 mm\""))
    }

    /// Height above the floor, m.
    pub fn height(self, g: &Geometry) -> f64 {
        match self {
            Self::Smoothing(n) => n * g.h,
            Self::Length(length) => length,
        }
    }
}

/// Stresses on a horizontal surface, Pa, tension positive; NaN where the material does not reach so high.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stresses {
    /// sigma_zz.
    pub normal: Vec<f64>,
    /// sigma_rz in radial profiles, else sigma_xz.
    pub shear: Vec<f64>,
    /// What the column above weighs: -rho g (surface - level), with the density at the start.
    pub hydrostatic: Vec<f64>,
}

/// Stresses near the floor in one snapshot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Basal {
    /// In the bins of the deposit's profile; the mean over the other direction in 3-D.
    pub profile: Stresses,
    /// In the cells of the deposit's map, in 3-D.
    pub map: Option<Stresses>,
    /// Integral of sigma_zz over the surface, N (per metre of depth in plane strain): of the modelled part.
    pub force: f64,
    /// Weight of the material above the surface, N: of the modelled part.
    pub weight: f64,
    /// Pressure at the centre against the largest, with the axis and without.
    pub dips: [Dip; 2],
}

impl Basal {
    /// Stresses of `rows` at `level` metres above the floor.
    pub fn new(g: &Geometry, rows: &Rows, sampler: &Sampler, deposit: &Deposit, level: f64) -> Self {
        let p = &deposit.profile;
        let (profile, map, force) = match &deposit.map {
            None => {
                let places = p.bins(g).map(|(x, k)| ([x, 0.0], p.height[k]));
                let stresses = stresses(g, rows, sampler, places, level);
                let force = stresses.normal.iter().zip(p.first..).map(|(s, k)| nothing(*s) * g.bin_area(k)).sum();
                (stresses, None, force)
            }
            Some(map) => {
                let places = map.cells(g).map(|(x, c)| (x, map.height[c]));
                let cells = stresses(g, rows, sampler, places, level);
                let mean = |field: &[f64]| map.mean(g, p.first, p.height.len(), field, false);
                let profile = Stresses {
                    normal: mean(&cells.normal),
                    shear: mean(&cells.shear),
                    hydrostatic: mean(&cells.hydrostatic),
                };
                let force = cells.normal.iter().map(|s| nothing(*s) * g.dx * g.dx).sum();
                (profile, Some(cells), force)
            }
        };
        let above = |z: f64| ((z - g.floor - level) / g.dx + 0.5).clamp(0.0, 1.0);
        let weight = rows.position.iter().zip(&rows.mass).map(|(x, m)| m * above(x[2])).sum::<f64>() * -g.gravity[2];
        let dips = [false, true].map(|off_axis| Dip::new(g, p, &profile, off_axis));
        Self { profile, map, force, weight, dips }
    }

    /// Force over weight: 1 at rest, where walls beside the material carry nothing. NaN without material above.
    pub fn ratio(&self) -> f64 {
        if self.weight == 0.0 { f64::NAN } else { -self.force / self.weight }
    }
}

/// A missing stress carries nothing.
fn nothing(stress: f64) -> f64 {
    if stress.is_nan() { 0.0 } else { stress }
}

fn stresses(
    g: &Geometry,
    rows: &Rows,
    sampler: &Sampler,
    places: impl Iterator<Item = ([f64; 2], f64)>,
    level: f64,
) -> Stresses {
    let mut out = Stresses::default();
    for (x, height) in places {
        let at = [x[0], x[1], g.floor + level];
        let stress = if height > level { sampler.stencil(at).map(|s| s.symmetric(&rows.stress)) } else { None };
        let r = x[0].hypot(x[1]);
        let [normal, shear, hydrostatic] = match stress {
            Some(s) if g.radial && r > 0.0 => [s[2], (s[5] * x[0] + s[4] * x[1]) / r, 1.0],
            Some(s) => [s[2], s[5], 1.0],
            None => [f64::NAN; 3],
        };
        out.normal.push(normal);
        out.shear.push(shear);
        out.hydrostatic.push(hydrostatic * g.density * g.gravity[2] * (height - level));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{block, geometry, jitter};
    use formats::{kernel::Kernel, space::Space};

    #[test]
    fn a_linear_stress_is_found_exactly_and_carries_the_weight() {
        for space in Space::ALL {
            let g = geometry(space, Kernel::CubicSpline, 0.01);
            let mut rows = block(&g, [15, if space == Space::ThreeD { 15 } else { 1 }, 12]);
            let top = 0.12;
            let set = |rows: &mut Rows| {
                for (s, x) in rows.stress.iter_mut().zip(&rows.position) {
                    let v = -g.density * 9.81 * (top - x[2]);
                    *s = [0.43 * v, 0.43 * v, v, 0.0, 0.0, 0.0];
                }
            };
            set(&mut rows);
            let level = 3.0 * g.h;
            let evaluate = |rows: &Rows| {
                let sampler = Sampler::new(&g, rows);
                let deposit = Deposit::new(&g, rows, &sampler);
                Basal::new(&g, rows, &sampler, &deposit, level)
            };
            let exact = -g.density * 9.81 * (top - level);
            let basal = evaluate(&rows);
            for s in &basal.profile.normal {
                assert!((s / exact - 1.0).abs() < 1e-11, "{space:?}: {s} {exact}");
            }
            assert!((basal.ratio() - 1.0).abs() < 1e-9, "{space:?}: {}", basal.ratio());
            for s in &basal.profile.hydrostatic {
                assert!((s / exact - 1.0).abs() < 2e-3, "{space:?}: {s} {exact}");
            }
            jitter(&mut rows, &g, 0.1);
            set(&mut rows);
            let basal = evaluate(&rows);
            for s in &basal.profile.normal[..14] {
                assert!((s / exact - 1.0).abs() < 1e-11, "{space:?}, jittered: {s} {exact}");
            }
        }
    }

    #[test]
    fn levels_are_read_with_their_unit() {
        assert_eq!(Level::parse("3 h"), Ok(Level::Smoothing(3.0)));
        assert_eq!(Level::parse("2.5h"), Ok(Level::Smoothing(2.5)));
        assert_eq!(Level::parse("12 mm"), Ok(Level::Length(0.012)));
        for wrong in ["h", "-1 h", "nan h", "3 kg", "-2 mm", ""] {
            assert!(Level::parse(wrong).is_err(), "{wrong}");
        }
    }
}
