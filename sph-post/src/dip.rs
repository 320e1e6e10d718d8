//! The dip of the basal stress below the top of a heap (Yang et al. 2020, section 3.12 and Fig 20).

use crate::{basal::Stresses, deposit::Profile, geometry::Geometry};

/// How far the centre reaches, in smoothing lengths: also what is left out of it to keep clear of the scheme's error at
/// the axis.
pub const CENTRE: f64 = 2.0;

/// The pressure -sigma_zz at the centre against the largest one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dip {
    /// Mean pressure over the centre, over the largest: below 1 by more than noise where there is a dip.
    pub ratio: f64,
    /// Distance of the largest pressure from the centre, m.
    pub radius: f64,
    /// Largest pressure, Pa.
    pub largest: f64,
}

/// What there is where no centre is known, or nothing is measured.
const NONE: Dip = Dip { ratio: f64::NAN, radius: f64::NAN, largest: f64::NAN };

impl Default for Dip {
    fn default() -> Self {
        NONE
    }
}

impl Dip {
    /// Of a profile of stresses. The centre is what lies within 2h of it, or, `off_axis`, between 2h and 4h; the largest pressure
    /// is then looked for beyond 2h too. NaN where [`centre`] is unknown.
    pub fn new(g: &Geometry, profile: &Profile, stresses: &Stresses, off_axis: bool) -> Self {
        let Some(centre) = centre(g) else { return NONE };
        let begin = if off_axis { CENTRE * g.h } else { 0.0 };
        let end = begin + CENTRE * g.h;
        let (mut sum, mut count, mut found) = (0.0, 0.0, NONE);
        for (s, k) in profile.bins(g) {
            let (distance, pressure) = (s - centre, -stresses.normal[k]);
            if distance < begin || pressure.is_nan() {
                continue;
            }
            if distance < end {
                sum += pressure;
                count += 1.0;
            }
            if found.largest.is_nan() || pressure > found.largest {
                found = Self { largest: pressure, radius: distance, ..found };
            }
        }
        // Without a pressure anywhere there is nothing to compare.
        if found.largest > 0.0 { Self { ratio: sum / count / found.largest, ..found } } else { NONE }
    }
}

/// The middle of the heap along the profile, m: the axis, the plane of symmetry, or the wall it leans on. `None` where the
/// heap can spread both ways.
pub fn centre(g: &Geometry) -> Option<f64> {
    if g.radial || g.mirrored[0] { Some(0.0) } else { g.extent.filter(|_| g.runs_outward).map(|e| e[0]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::geometry;
    use formats::{kernel::Kernel, space::Space};

    fn dips(g: &Geometry, pressure: impl Fn(f64) -> f64) -> [Dip; 2] {
        let profile = Profile { first: 0, height: vec![0.1; 50], thickness: vec![0.1; 50] };
        let normal = profile.bins(g).map(|(s, _)| -pressure(s)).collect();
        let stresses = Stresses { normal, ..Stresses::default() };
        [false, true].map(|off| Dip::new(g, &profile, &stresses, off))
    }

    #[test]
    fn a_heap_with_a_dip_and_one_without() {
        let g = geometry(Space::Axisymmetric, Kernel::CubicSpline, 0.01);
        // 2h is 0.024 m: the centre is the bins at 5 and 15 mm, and off the axis those at 25, 35 and 45 mm.
        let [on, off] = dips(&g, |s| 100.0 - 400.0 * (s - 0.205).abs());
        for (dip, centre) in [(on, 0.010), (off, 0.035)] {
            assert!((dip.ratio - (1.0 - 4.0 * (0.205 - centre))).abs() < 1e-12, "{dip:?}");
            assert!((dip.radius - 0.205).abs() < 1e-12 && (dip.largest - 100.0).abs() < 1e-9, "{dip:?}");
        }
        let [on, off] = dips(&g, |s| 100.0 * (1.0 - s));
        assert!((on.ratio - 99.0 / 99.5).abs() < 1e-12 && on.radius == 0.005, "{on:?}");
        assert!((off.ratio - 96.5 / 97.5).abs() < 1e-12 && off.radius == 0.025, "{off:?}");
        // An error at the axis alone is not a dip off it.
        let [on, off] = dips(&g, |s| if s < 0.02 { 50.0 } else { 100.0 });
        assert!((on.ratio - 0.5).abs() < 1e-12 && (off.ratio - 1.0).abs() < 1e-12, "{on:?} {off:?}");
    }

    #[test]
    fn there_is_none_without_a_centre_or_without_pressure() {
        let mut g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01);
        assert!(dips(&g, |_| f64::NAN).iter().all(|d| d.ratio.is_nan()));
        assert!(dips(&g, |_| 1.0)[0].ratio == 1.0);
        g.mirrored = [false; 2];
        assert!(dips(&g, |_| 1.0).iter().all(|d| d.ratio.is_nan()));
    }
}
