//! Markers: which layer of the body at the start a particle came from (Yang et al. 2020, Figs 13, 14, 15 and 18).

use crate::{
    deposit::{Profile, thickness_of},
    geometry::Geometry,
};
use formats::snapshot::Rows;

/// The layers of all particles, by row: files list the particles in ascending id, the same in each of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layers {
    /// How many there are.
    pub count: usize,
    /// Horizontal layer, counted from the lowest.
    pub horizontal: Vec<u8>,
    /// Vertical layer, counted from the axis, or from where the body begins along x.
    pub vertical: Vec<u8>,
    /// Lowest and highest place of the body at the start, above the floor, m.
    pub heights: [f64; 2],
    /// Where the body began and ended along the profile, m.
    pub distances: [f64; 2],
}

impl Layers {
    /// `count` layers of equal thickness each way, from the places of the particles at the start.
    pub fn new(g: &Geometry, start: &[[f64; 3]], count: usize) -> Self {
        let range = |of: &dyn Fn(&[f64; 3]) -> f64| {
            let ends = start.iter().map(of).fold([f64::INFINITY, f64::NEG_INFINITY], |r, v| [r[0].min(v), r[1].max(v)]);
            [ends[0] - 0.5 * g.dx, ends[1] + 0.5 * g.dx]
        };
        let along = |x: &[f64; 3]| g.along(*x);
        let above = |x: &[f64; 3]| x[2] - g.floor;
        let heights = range(&above);
        let distances = g.extent.unwrap_or_else(|| {
            let ends = range(&along);
            [if g.radial || g.mirrored[0] { 0.0 } else { ends[0] }, ends[1]]
        });
        let layer = |v: f64, [low, high]: [f64; 2]| {
            ((v - low) / (high - low) * count as f64).clamp(0.0, count as f64 - 1.0) as u8
        };
        Self {
            count,
            horizontal: start.iter().map(|x| layer(above(x), heights)).collect(),
            vertical: start.iter().map(|x| layer(along(x), distances)).collect(),
            heights,
            distances,
        }
    }

    /// Are these the layers of the particles in `rows`?
    pub fn are_of(&self, rows: &Rows) -> bool {
        self.horizontal.len() == rows.len()
    }

    /// Tops of the horizontal layers above the floor, m, in the bins of `profile`; layer by layer from the lowest, the
    /// last one the surface. Each is the height below which as much of the bin's volume lies as belongs to that layer and
    /// those below it: the interface where the layers lie on each other in order.
    pub fn tops(&self, g: &Geometry, rows: &Rows, profile: &Profile) -> Vec<Vec<f64>> {
        let height: Vec<f64> = profile.height.iter().map(|h| if h.is_nan() { 0.0 } else { *h }).collect();
        let share = |layer: usize| {
            let below = thickness_of(g, rows, |row| usize::from(self.horizontal[row]) <= layer);
            let skip = (profile.first - below.first) as usize;
            (0..height.len()).map(|k| below.values[skip + k] / profile.thickness[k]).collect::<Vec<f64>>()
        };
        let top = |layer| {
            let shares = share(layer);
            shares.iter().zip(&height).map(|(s, h)| if s.is_finite() { s.min(1.0) * h } else { 0.0 }).collect()
        };
        (0..self.count).map(top).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        deposit::Deposit,
        sample::Sampler,
        testing::{block, geometry},
    };
    use formats::{kernel::Kernel, space::Space};

    #[test]
    fn a_block_is_cut_into_layers_of_equal_thickness() {
        for space in Space::ALL {
            let g = geometry(space, Kernel::CubicSpline, 0.01);
            let mut rows = block(&g, [20, if space == Space::ThreeD { 20 } else { 1 }, 20]);
            let layers = Layers::new(&g, &rows.position, 4);
            assert!(layers.are_of(&rows) && (layers.heights[1] - 0.2).abs() < 1e-12);
            for (row, x) in rows.position.iter().enumerate() {
                assert_eq!(layers.horizontal[row], (x[2] / 0.05) as u8);
                assert_eq!(layers.vertical[row], (x[0] / 0.05) as u8);
            }
            // Whatever happens to the block later: stretched to twice its length, the layers are half as thick.
            let evaluate = |rows: &Rows| {
                let sampler = Sampler::new(&g, rows);
                let profile = Deposit::new(&g, rows, &sampler).profile;
                layers.tops(&g, rows, &profile)
            };
            for (n, top) in evaluate(&rows).iter().enumerate() {
                top.iter().for_each(|z| assert!((z - 0.05 * (n + 1) as f64).abs() < 0.06 * g.dx, "{space:?} {n}: {z}"));
            }
            if space == Space::PlaneStrain {
                for (x, m) in rows.position.iter_mut().zip(&mut rows.mass) {
                    *x = [x[0], x[1], 0.5 * x[2]];
                    *m *= 0.5;
                }
                for (n, top) in evaluate(&rows).iter().enumerate() {
                    top.iter().for_each(|z| assert!((z - 0.025 * (n + 1) as f64).abs() < 0.1 * g.dx, "{n}: {z}"));
                }
            }
        }
    }

    /// Rows of the file turned upside down in place: a particle keeps its marker wherever it goes.
    #[test]
    fn markers_belong_to_particles_not_to_places() {
        let g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01);
        let mut rows = block(&g, [10, 1, 10]);
        let layers = Layers::new(&g, &rows.position, 2);
        rows.position.iter_mut().for_each(|x| x[2] = 0.1 - x[2]);
        assert!(rows.position.iter().zip(&layers.horizontal).all(|(x, n)| (*n == 1) == (x[2] < 0.05)));
        assert!(!layers.are_of(&block(&g, [10, 1, 9])));
    }
}
