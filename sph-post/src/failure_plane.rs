//! The failure plane of a column that begins to fall (Szewc 2017, section 5.5 and Fig 8; Yang et al. 2020, section 3.9).

use crate::{deposit::Deposit, geometry::Geometry, section::Section};
use formats::{snapshot::Rows, space::Space, units};

/// The failure surface is where the speed is this part of the largest one (Szewc 2017, section 5.5).
pub const PART: f64 = 0.1;

/// Particles within this of [`PART`] are marked in pictures (the same place).
const MARKED: f64 = 0.005;

/// The line is fitted to this part of the surface's height: near the floor the wall holds the material, and at the
/// upper end the surface bends.
const MIDDLE: [f64; 2] = [0.2, 0.8];

/// Furthest step from one row of cells to the next that still is the same surface, in spacings: 14 degrees.
const STEP: f64 = 4.0;

/// Fewest points of a line.
const FEWEST: usize = 5;

/// When the failure plane is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FailureTime {
    /// In T = sqrt(H0/g).
    Scaled(f64),
    /// In s.
    Time(f64),
}

impl FailureTime {
    /// From `"0.54 T"` or a time as in scenes, `"40 ms"`.
    ///
    /// # Errors
    /// A sentence that says what would be right.
    pub fn parse(text: &str) -> Result<Self, String> {
        let time = match text.trim().strip_suffix('T') {
            Some(number) => number.trim().parse().ok().map(Self::Scaled),
            None => Some(Self::Time(units::parse(text, units::Dimension::Time)?)),
        };
        match time {
            Some(Self::Scaled(t) | Self::Time(t)) if !(t.is_finite() && t >= 0.0) => None,
            other => other,
        }
        .ok_or_else(|| {
            format!("`{text}` is no time: give multiples of sqrt(H0/g) as \"0.54 T\", or a time as \"40 ms\"")
        })
    }

    /// s; NaN for a multiple of T where there is none.
    pub fn value(self, g: &Geometry) -> f64 {
        match self {
            Self::Scaled(t) => g.time_scale().map_or(f64::NAN, |scale| t * scale),
            Self::Time(t) => t,
        }
    }
}

/// The failure surface in one snapshot.
#[derive(Clone, Debug, PartialEq)]
pub struct FailurePlane {
    /// Largest speed of the material, m/s: of particles neither beyond the effective front nor above the surface.
    pub top_speed: f64,
    /// Where the speed falls to [`PART`] of that, seen from the axis outward, in every row of the section: along the
    /// profile, m. NaN where it does not.
    pub surface: Vec<f64>,
    /// The straight line through it.
    pub line: Option<Line>,
    /// Particles of the section at 9.5 to 10.5 % of the top speed: along the profile and above the floor, m.
    pub marked: Vec<[f64; 2]>,
}

/// A straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Inclination to the horizontal, degrees: from the way inward, so that a line which rises to the axis has one below 90.
    pub angle_deg: f64,
    /// Root mean square of the distances from it, m.
    pub scatter: f64,
    /// The two ends of the part it was fitted to: along the profile and above the floor, m.
    pub ends: [[f64; 2]; 2],
}

impl Default for FailurePlane {
    fn default() -> Self {
        Self { top_speed: f64::NAN, surface: Vec::new(), line: None, marked: Vec::new() }
    }
}

impl FailurePlane {
    /// Of the particles in `rows`. Without line and surface where the body does not run outward
    /// ([`Geometry::runs_outward`]): then there may be several, or none that rises from a toe.
    pub fn new(g: &Geometry, rows: &Rows, deposit: &Deposit, section: &Section, y: f64) -> Self {
        let speed = |row: usize| rows.velocity[row].iter().map(|v| v * v).sum::<f64>().sqrt();
        let inside = |row: &usize| {
            let s = g.along(rows.position[*row]);
            let bin = (s / g.dx).floor() as i64 - section.first;
            let height = usize::try_from(bin).ok().and_then(|k| section.height.get(k)).copied().unwrap_or(0.0);
            s <= deposit.fronts.thickness && rows.position[*row][2] - g.floor <= height + 0.5 * g.dx
        };
        let top_speed = (0..rows.len()).filter(inside).map(speed).fold(0.0, f64::max);
        let surface = vec![f64::NAN; section.rows];
        let mut out = Self { top_speed, surface, line: None, marked: Vec::new() };
        if !g.runs_outward || top_speed <= 0.0 {
            return out;
        }
        out.surface = (0..section.rows).map(|j| crossing(g, section, j, PART * top_speed)).collect();
        out.line = line(g, &out.surface);
        let in_section = |row: &usize| g.space != Space::ThreeD || (rows.position[*row][1] - y).abs() < g.dx;
        let marked = |row: &usize| (speed(*row) / top_speed - PART).abs() <= MARKED;
        let rows_marked = (0..rows.len()).filter(inside).filter(in_section).filter(marked);
        out.marked = rows_marked.map(|row| [g.along(rows.position[row]), rows.position[row][2] - g.floor]).collect();
        out
    }
}

/// The innermost place in a row where the speed rises through `wanted`, linear between the cells.
fn crossing(g: &Geometry, section: &Section, j: usize, wanted: f64) -> f64 {
    let row = &section.speed[j * section.bins..(j + 1) * section.bins];
    for k in 1..row.len() {
        if row[k - 1] < wanted && row[k] >= wanted {
            return section.along(g, k - 1) + g.dx * (wanted - row[k - 1]) / (row[k] - row[k - 1]);
        }
    }
    f64::NAN
}

/// The straight line through the middle part of the longest piece without a jump; it must come down to the lowest fifth
/// of the surface's height, or it is not the one that begins at the toe.
fn line(g: &Geometry, surface: &[f64]) -> Option<Line> {
    let (mut best, mut begin) = (0..0, 0);
    for j in 0..surface.len() {
        if surface[j].is_nan() {
            begin = j + 1;
            continue;
        }
        if j > begin && (surface[j] - surface[j - 1]).abs() > STEP * g.dx {
            begin = j;
        }
        if j + 1 - begin > best.len() {
            best = begin..j + 1;
        }
    }
    let (low, length) = (best.start as f64, best.len() as f64);
    if low > MIDDLE[0] * best.end as f64 {
        return None;
    }
    let middle = |j: &usize| (MIDDLE[0]..=MIDDLE[1]).contains(&((*j as f64 + 0.5 - low) / length));
    let points: Vec<[f64; 2]> = best.filter(middle).map(|j| [surface[j], Section::above(g, j)]).collect();
    fit(&points)
}

/// The line of least squared orthogonal distances.
fn fit(points: &[[f64; 2]]) -> Option<Line> {
    let n = points.len() as f64;
    if points.len() < FEWEST {
        return None;
    }
    let mean = [0, 1].map(|a| points.iter().map(|p| p[a]).sum::<f64>() / n);
    let moment = |a: usize, b: usize| points.iter().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum::<f64>() / n;
    let (xx, xz, zz) = (moment(0, 0), moment(0, 1), moment(1, 1));
    // Direction of the larger principal moment, upward.
    let turn = 0.5 * (2.0 * xz).atan2(xx - zz);
    let up = if turn.sin() < 0.0 { -1.0 } else { 1.0 };
    let direction = [up * turn.cos(), up * turn.sin()];
    let least = 0.5 * (xx + zz) - (0.25 * (xx - zz).powi(2) + xz * xz).sqrt();
    let along = |p: &[f64; 2]| (p[0] - mean[0]) * direction[0] + (p[1] - mean[1]) * direction[1];
    let range = points.iter().map(along).fold([0.0_f64; 2], |r, t| [r[0].min(t), r[1].max(t)]);
    Some(Line {
        angle_deg: direction[1].atan2(-direction[0]).to_degrees(),
        scatter: least.max(0.0).sqrt(),
        ends: range.map(|t| [mean[0] + t * direction[0], mean[1] + t * direction[1]]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        sample::Sampler,
        testing::{block, geometry, push},
    };
    use formats::kernel::Kernel;

    fn plane_of(g: &Geometry, rows: &Rows) -> FailurePlane {
        let sampler = Sampler::new(g, rows);
        let deposit = Deposit::new(g, rows, &sampler);
        let section = Section::new(g, rows, &sampler, &deposit.profile);
        FailurePlane::new(g, rows, &deposit, &section, 0.0)
    }

    /// A block of 0.4 m by 0.3 m whose outer part slides down a plane that rises from the toe at `angle`; the speed grows
    /// over eight spacings from rest to 1 m/s.
    fn sliding(g: &Geometry, angle: f64) -> Rows {
        let mut rows = block(g, [40, if g.space == Space::ThreeD { 40 } else { 1 }, 30]);
        let (sin, cos) = angle.to_radians().sin_cos();
        for (v, x) in rows.velocity.iter_mut().zip(&rows.position) {
            let outside = (g.along(*x) - 0.4) * sin + x[2] * cos;
            let speed = (0.5 + outside / (8.0 * g.dx)).clamp(0.0, 1.0);
            *v = [speed * cos, 0.0, -speed * sin];
        }
        rows
    }

    #[test]
    fn a_block_that_slides_on_a_plane_has_its_inclination() {
        for space in [Space::PlaneStrain, Space::Axisymmetric, Space::ThreeD] {
            for angle in [45.0, 60.0, 65.0] {
                let mut g = geometry(space, Kernel::WendlandC2, 0.01);
                g.runs_outward = true;
                let mut rows = sliding(&g, angle);
                // A stray grain and one that falls, both fast, are no part of it.
                push(&mut rows, [0.8, 0.0, 0.005], 1e-3, g.density);
                push(&mut rows, [0.2, 0.0, 0.6], 1e-3, g.density);
                let n = rows.len();
                rows.velocity[n - 2] = [30.0, 0.0, 0.0];
                rows.velocity[n - 1] = [0.0, 0.0, -30.0];
                let plane = plane_of(&g, &rows);
                assert!((plane.top_speed - 1.0).abs() < 1e-12, "{}", plane.top_speed);
                let line = plane.line.unwrap();
                let what = format!("{space:?}, {angle}: {line:?}");
                assert!((line.angle_deg - angle).abs() < 1.0, "{what}");
                assert!(line.scatter < 0.2 * g.dx, "{what}");
                assert!(line.ends[0][1] < 0.08 && line.ends[1][1] > 0.2, "{what}");
                // At 45 degrees rows of the lattice lie along the plane, and none of them need be marked.
                assert!(angle == 45.0 || !plane.marked.is_empty(), "{what}");
                let distance = |p: &[f64; 2]| (p[0] - 0.4) * angle.to_radians().sin() + p[1] * angle.to_radians().cos();
                assert!(plane.marked.iter().all(|p| (distance(p) + 3.2 * g.dx).abs() < 0.05 * g.dx), "{what}");
            }
        }
    }

    #[test]
    fn there_is_no_plane_at_rest_nor_where_all_falls_nor_where_it_begins_high_up() {
        let mut g = geometry(Space::PlaneStrain, Kernel::WendlandC2, 0.01);
        g.runs_outward = true;
        let mut rows = block(&g, [40, 1, 30]);
        assert_eq!(plane_of(&g, &rows).line, None);
        rows.velocity.fill([0.0, 0.0, -1.0]);
        assert_eq!(plane_of(&g, &rows).line, None);
        let mut rows = sliding(&g, 60.0);
        for (v, x) in rows.velocity.iter_mut().zip(&rows.position) {
            if x[2] < 0.15 {
                *v = [0.0; 3];
            }
        }
        assert_eq!(plane_of(&g, &rows).line, None);
        g.runs_outward = false;
        assert_eq!(plane_of(&g, &sliding(&g, 60.0)).line, None);
    }

    #[test]
    fn lines_lean_inward_below_a_right_angle_and_outward_above() {
        let points = |slope: f64| -> Vec<[f64; 2]> { (0..9).map(|k| [slope * f64::from(k), f64::from(k)]).collect() };
        for (slope, angle) in [(-1.0, 45.0), (0.0, 90.0), (1.0, 135.0)] {
            let line = fit(&points(slope)).unwrap();
            assert!((line.angle_deg - angle).abs() < 1e-9 && line.scatter < 1e-9, "{line:?}");
        }
        let mut bent = points(0.0);
        bent.iter_mut().enumerate().for_each(|(k, p)| p[0] = if k % 2 == 0 { 0.01 } else { -0.01 });
        assert!((fit(&bent).unwrap().scatter - 0.01).abs() < 1e-3);
    }

    #[test]
    fn times_are_read_with_their_unit() {
        assert_eq!(FailureTime::parse("0.54 T"), Ok(FailureTime::Scaled(0.54)));
        assert_eq!(FailureTime::parse("40 ms"), Ok(FailureTime::Time(0.04)));
        for wrong in ["", "T", "-1 T", "4", "3 kg", "-2 ms"] {
            assert!(FailureTime::parse(wrong).is_err(), "{wrong}");
        }
    }
}
