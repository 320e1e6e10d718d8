//! Particles of one snapshot, thinned for a picture.

use crate::geometry::Geometry;
use formats::{snapshot::Rows, space::Space};
use std::collections::BTreeMap;

/// Most squares in one panel: what keeps an SVG small enough for a browser.
const MOST: usize = 4000;

/// Squares to draw in a vertical section.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scatter {
    /// Side of a square, m.
    pub size: f64,
    /// Centre (x or r, z), m, and speed, m/s.
    pub squares: Vec<([f64; 2], f64)>,
}

impl Scatter {
    /// All particles in the plane spaces; in 3-D those less than a spacing from the plane y = 0 (from the middle of
    /// the material, where no plane or axis of symmetry is there). Too many are joined in square cells, which
    /// show the mean speed.
    pub fn new(g: &Geometry, rows: &Rows) -> Self {
        let section = section(g, rows);
        let speed = |row: usize| rows.velocity[row].iter().map(|v| v * v).sum::<f64>().sqrt();
        let chosen: Vec<([f64; 2], f64)> = (0..rows.len())
            .filter(|&row| g.space != Space::ThreeD || (rows.position[row][1] - section).abs() < g.dx)
            .map(|row| ([rows.position[row][0], rows.position[row][2]], speed(row)))
            .collect();
        let mut size = g.dx;
        let mut squares = chosen.clone();
        while squares.len() > MOST {
            size *= 1.25;
            let mut cells: BTreeMap<[i64; 2], (f64, f64)> = BTreeMap::new();
            for (x, speed) in &chosen {
                let cell = cells.entry(x.map(|x| (x / size).floor() as i64)).or_default();
                *cell = (cell.0 + speed, cell.1 + 1.0);
            }
            let centre = |k: i64| (k as f64 + 0.5) * size;
            squares = cells.into_iter().map(|(k, (sum, n))| (k.map(centre), sum / n)).collect();
        }
        Self { size, squares }
    }
}

/// The y of the section through the material.
fn section(g: &Geometry, rows: &Rows) -> f64 {
    if g.space != Space::ThreeD || g.radial || g.mirrored[1] {
        return 0.0;
    }
    let y = || rows.position.iter().map(|x| x[1]);
    0.5 * (y().fold(f64::INFINITY, f64::min) + y().fold(f64::NEG_INFINITY, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{block, geometry};
    use formats::kernel::Kernel;

    #[test]
    fn few_particles_stay_and_many_are_joined() {
        let g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01);
        let mut rows = block(&g, [20, 1, 20]);
        rows.velocity.fill([3.0, 0.0, 4.0]);
        let s = Scatter::new(&g, &rows);
        assert_eq!((s.squares.len(), s.size), (400, 0.01));
        let mut rows = block(&g, [100, 1, 100]);
        rows.velocity.fill([3.0, 0.0, 4.0]);
        let s = Scatter::new(&g, &rows);
        assert!(s.squares.len() <= MOST && s.squares.len() > MOST / 3, "{}", s.squares.len());
        assert!(s.squares.iter().all(|q| (q.1 - 5.0).abs() < 1e-12));
    }

    #[test]
    fn a_section_is_taken_in_space() {
        let g = geometry(Space::ThreeD, Kernel::CubicSpline, 0.01);
        let rows = block(&g, [5, 5, 5]);
        assert_eq!(Scatter::new(&g, &rows).squares.len(), 25);
    }
}
