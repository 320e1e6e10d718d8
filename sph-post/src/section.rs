//! Fields on a vertical section: on a grid of one spacing over the distance and the height.

use crate::{
    deposit::{Profile, surface},
    geometry::Geometry,
    sample::Sampler,
};
use formats::{snapshot::Rows, space::Space};
use std::f64::consts::TAU;

/// Directions over which fields are averaged where a body in 3-D stands on its axis.
const DIRECTIONS: usize = 8;

/// Most rows of cells above each other; what lies higher is left out.
const MOST_ROWS: usize = 20_000;

/// Speed and vertical stress in square cells of one spacing, in the bins of the deposit's profile; row by row from the
/// floor up, `field[j * bins + k]`. NaN outside the material.
///
/// In the plane spaces it is the only section there is. In 3-D it is the mean over the angle where profiles are radial,
/// and else the section that [`plane`] says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Number of the first bin along the profile.
    pub first: i64,
    /// Bins along the profile.
    pub bins: usize,
    /// Rows of cells above the floor.
    pub rows: usize,
    /// |v|, m/s.
    pub speed: Vec<f64>,
    /// sigma_zz, Pa, tension positive.
    pub stress_zz: Vec<f64>,
    /// Height of the surface above the floor in each bin, m; 0 where there is no material.
    pub height: Vec<f64>,
}

impl Section {
    /// Of the particles in `rows`, over the bins of `profile`.
    pub fn new(g: &Geometry, rows: &Rows, sampler: &Sampler, profile: &Profile) -> Self {
        let speed: Vec<f64> = rows.velocity.iter().map(|v| v.iter().map(|v| v * v).sum::<f64>().sqrt()).collect();
        let y = plane(g, rows);
        let columns: Vec<Vec<([f64; 2], f64)>> = profile
            .bins(g)
            .map(|(s, _)| places(g, s, y).into_iter().map(|at| (at, surface(g, sampler, at))).collect())
            .collect();
        let highest = columns.iter().flatten().map(|c| c.1).fold(0.0, f64::max);
        let (bins, count) = (columns.len(), ((highest / g.dx - 0.5).ceil() as usize).clamp(1, MOST_ROWS));
        let mut out = Self {
            first: profile.first,
            bins,
            rows: count,
            speed: vec![f64::NAN; bins * count],
            stress_zz: vec![f64::NAN; bins * count],
            height: columns.iter().map(|c| c.iter().map(|c| c.1).sum::<f64>() / c.len() as f64).collect(),
        };
        for (k, column) in columns.iter().enumerate() {
            for j in 0..count {
                let z = (j as f64 + 0.5) * g.dx;
                let mut sum = [0.0; 3];
                for (at, _) in column.iter().filter(|c| c.1 > z) {
                    if let Some(stencil) = sampler.stencil([at[0], at[1], g.floor + z]) {
                        let found = [stencil.even(&speed), stencil.symmetric(&rows.stress)[2], 1.0];
                        (0..3).for_each(|i| sum[i] += found[i]);
                    }
                }
                if sum[2] > 0.0 {
                    // A linear fit to speeds can come out below zero where they vanish.
                    out.speed[j * bins + k] = (sum[0] / sum[2]).max(0.0);
                    out.stress_zz[j * bins + k] = sum[1] / sum[2];
                }
            }
        }
        out
    }

    /// Middle of bin `k` along the profile, m.
    pub fn along(&self, g: &Geometry, k: usize) -> f64 {
        ((self.first + k as i64) as f64 + 0.5) * g.dx
    }

    /// Middle of row `j` above the floor, m.
    pub fn above(g: &Geometry, j: usize) -> f64 {
        (j as f64 + 0.5) * g.dx
    }
}

/// The y of the section: 0 on an axis, on a plane of symmetry and in the plane spaces, else the middle of the material.
pub fn plane(g: &Geometry, rows: &Rows) -> f64 {
    if g.space != Space::ThreeD || g.radial || g.mirrored[1] {
        return 0.0;
    }
    let y = || rows.position.iter().map(|x| x[1]);
    0.5 * (y().fold(f64::INFINITY, f64::min) + y().fold(f64::NEG_INFINITY, f64::max))
}

/// Where the section at distance `s` is looked at: evenly spread over the modelled angle, or one place.
pub(crate) fn places(g: &Geometry, s: f64, y: f64) -> Vec<[f64; 2]> {
    if !(g.radial && g.space == Space::ThreeD) {
        return vec![[s, y]];
    }
    let whole = TAU * g.modelled();
    // A half that is cut at x = 0 lies on both sides of +x.
    let begin = if g.mirrored[0] && !g.mirrored[1] { -0.25 * TAU } else { 0.0 };
    let angle = |k: usize| begin + whole * (k as f64 + 0.5) / DIRECTIONS as f64;
    (0..DIRECTIONS).map(|k| [s * angle(k).cos(), s * angle(k).sin()]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        deposit::Deposit,
        testing::{block, geometry, jitter},
    };
    use formats::kernel::Kernel;

    /// A linear stress field comes out exactly, and so does a speed that grows with the height.
    #[test]
    fn linear_fields_give_their_exact_section() {
        for space in Space::ALL {
            let g = geometry(space, Kernel::WendlandC2, 0.01);
            let mut rows = block(&g, [14, if space == Space::ThreeD { 14 } else { 1 }, 12]);
            jitter(&mut rows, &g, 0.1);
            let stress = |z: f64| -2000.0 * 9.81 * (0.12 - z);
            for row in 0..rows.len() {
                let z = rows.position[row][2];
                rows.stress[row] = [0.4 * stress(z), 0.4 * stress(z), stress(z), 0.0, 0.0, 0.0];
                rows.velocity[row] = [0.0, 0.0, -3.0 * z];
            }
            let sampler = Sampler::new(&g, &rows);
            let deposit = Deposit::new(&g, &rows, &sampler);
            let section = Section::new(&g, &rows, &sampler, &deposit.profile);
            assert_eq!((section.first, section.rows), (0, 12), "{space:?}");
            for j in 0..12 {
                for k in 0..10 {
                    let (z, c) = (Section::above(&g, j), j * section.bins + k);
                    let what = format!("{space:?} {j} {k}");
                    assert!((section.stress_zz[c] / stress(z) - 1.0).abs() < 1e-9, "{what}: {}", section.stress_zz[c]);
                    assert!((section.speed[c] - 3.0 * z).abs() < 1e-9, "{what}: {}", section.speed[c]);
                }
            }
            assert!((section.along(&g, 3) - 0.035).abs() < 1e-15);
        }
    }

    #[test]
    fn places_lie_within_what_is_modelled() {
        let mut g = geometry(Space::ThreeD, Kernel::CubicSpline, 0.01);
        g.radial = true;
        for mirrored in [[true, true], [true, false], [false, true], [false, false]] {
            g.mirrored = mirrored;
            let at = places(&g, 0.3, 0.0);
            assert_eq!(at.len(), DIRECTIONS);
            for x in at {
                assert!((x[0].hypot(x[1]) - 0.3).abs() < 1e-12);
                assert!((0..2).all(|a| !mirrored[a] || x[a] > 0.0), "{mirrored:?} {x:?}");
            }
        }
        g.radial = false;
        assert_eq!(places(&g, 0.3, 0.1), [[0.3, 0.1]]);
    }
}
