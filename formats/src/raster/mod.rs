//! Rasters: heights and thicknesses on a regular grid, from ESRI ASCII grids ([`ascii`]) and GeoTIFF ([`geotiff`]).
//!
//! Values belong to the middles of cells. Rows are kept from south to north, whatever the file does, so that x and y
//! ascend with the numbers of columns and rows.

pub mod ascii;
pub mod geotiff;

/// A raster.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Numbers of cells along x and y, at least 2 each.
    pub size: [usize; 2],
    /// Middle of the south-western cell, m.
    pub first: [f64; 2],
    /// Sides of a cell, m.
    pub cell: [f64; 2],
    /// Row by row along x, from south to north; finite.
    pub values: Vec<f64>,
    /// Which cells have no data. Their value is that of the nearest cell that has.
    pub missing: Vec<bool>,
    /// The coordinate reference system, if the file names one: `EPSG:32632`, or WKT.
    pub crs: Option<String>,
}

/// Most cells of a raster.
const MOST_CELLS: usize = 1 << 28;

impl Grid {
    /// Reads a file of either format.
    ///
    /// # Errors
    /// What is wrong, and where in the file.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        match bytes {
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => geotiff::read(bytes),
            _ => ascii::read(bytes),
        }
    }

    /// From what a file holds, rows from north to south; `None` and what is not finite is no data.
    fn from_rows(
        size: [usize; 2],
        first: [f64; 2],
        cell: [f64; 2],
        rows: Vec<f64>,
        no_data: Option<f64>,
    ) -> Result<Self, String> {
        if size[0] < 2 || size[1] < 2 {
            return Err(format!("it has {} x {} cells; at least 2 x 2 are needed", size[0], size[1]));
        }
        let is_missing = |v: f64| !v.is_finite() || no_data == Some(v);
        let values: Vec<f64> = rows.chunks_exact(size[0]).rev().flatten().copied().collect();
        let missing: Vec<bool> = values.iter().map(|&v| is_missing(v)).collect();
        let mut grid = Self { size, first, cell, values, missing, crs: None };
        grid.fill()?;
        Ok(grid)
    }

    /// Cells without data get the value of a nearest one with data, step by step across sides.
    fn fill(&mut self) -> Result<(), String> {
        let [nx, ny] = self.size;
        let mut known: Vec<bool> = self.missing.iter().map(|m| !m).collect();
        let mut border: Vec<usize> = (0..known.len()).filter(|&c| known[c]).collect();
        if border.is_empty() {
            return Err("no cell has data".into());
        }
        while !border.is_empty() {
            let mut next = Vec::new();
            for c in border {
                let (i, j) = (c % nx, c / nx);
                let beside = [(i > 0, c.wrapping_sub(1)), (i + 1 < nx, c + 1)];
                let above = [(j > 0, c.wrapping_sub(nx)), (j + 1 < ny, c + nx)];
                for (there, other) in beside.into_iter().chain(above) {
                    if there && !known[other] {
                        known[other] = true;
                        self.values[other] = self.values[c];
                        next.push(other);
                    }
                }
            }
            border = next;
        }
        Ok(())
    }

    /// The same raster with the coordinates and, by `heights`, the values of a scene whose origin lies at `origin`.
    pub fn shifted(mut self, origin: [f64; 3], heights: bool) -> Self {
        for axis in 0..2 {
            self.first[axis] -= origin[axis];
        }
        if heights {
            self.values.iter_mut().for_each(|v| *v -= origin[2]);
        }
        self
    }

    /// How the grid of another raster differs from this one's, in words; none where it does not.
    pub fn difference(&self, other: &Self) -> Option<String> {
        if self.size != other.size {
            let [a, b] = [self.size, other.size].map(|[x, y]| format!("{x} x {y}"));
            return Some(format!("it has {b} cells, that of the terrain {a}"));
        }
        let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-6 * scale;
        for axis in 0..2 {
            let (a, b, cell) = (self.cell[axis], other.cell[axis], self.cell[axis]);
            if !near(a * self.size[axis] as f64, b * self.size[axis] as f64, cell) {
                return Some(format!("its cells have sides of {b} m, those of the terrain {a} m"));
            }
            let (a, b, name) = (self.first[axis], other.first[axis], ["x", "y"][axis]);
            if !near(a, b, cell) {
                return Some(format!("its first cell lies at {name} = {b} m, that of the terrain at {a} m"));
            }
        }
        None
    }

    /// Middles of the outermost cells, lower and upper, m: between them values are interpolated.
    pub fn extent(&self) -> ([f64; 2], [f64; 2]) {
        (self.first, [0, 1].map(|a| self.first[a] + (self.size[a] - 1) as f64 * self.cell[a]))
    }

    /// The four cells around a point, and where it lies between them; beyond the middles of the outermost cells it is
    /// moved to the nearest of these.
    fn around(&self, x: f64, y: f64) -> ([usize; 4], [f64; 2]) {
        let (mut at, mut part) = ([0; 2], [0.0; 2]);
        for (a, x) in [x, y].into_iter().enumerate() {
            let u = ((x - self.first[a]) / self.cell[a]).clamp(0.0, (self.size[a] - 1) as f64);
            at[a] = (u as usize).min(self.size[a] - 2);
            part[a] = u - at[a] as f64;
        }
        let c = at[1] * self.size[0] + at[0];
        ([c, c + 1, c + self.size[0], c + self.size[0] + 1], part)
    }

    /// The value at a point: bilinear between the middles of cells, and constant beyond the outermost ones.
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let (cells, part) = self.around(x, y);
        bilinear(cells.map(|c| self.values[c]), part)
    }

    /// The slope at a point: central differences at the cells, bilinear between them, so that it has no jumps.
    pub fn gradient(&self, x: f64, y: f64) -> [f64; 2] {
        let (cells, part) = self.around(x, y);
        let [nx, ny] = self.size;
        let slopes = cells.map(|c| {
            let (i, j) = (c % nx, c / nx);
            let (left, right) = (i.saturating_sub(1), (i + 1).min(nx - 1));
            let (low, high) = (j.saturating_sub(1), (j + 1).min(ny - 1));
            let along =
                (self.values[j * nx + right] - self.values[j * nx + left]) / ((right - left) as f64 * self.cell[0]);
            let across =
                (self.values[high * nx + i] - self.values[low * nx + i]) / ((high - low) as f64 * self.cell[1]);
            [along, across]
        });
        [0, 1].map(|a| bilinear(slopes.map(|s| s[a]), part))
    }

    /// Does the value at a point depend on a cell without data?
    pub fn is_missing(&self, x: f64, y: f64) -> bool {
        let (cells, part) = self.around(x, y);
        let weights = [(1.0 - part[0]) * (1.0 - part[1]), part[0] * (1.0 - part[1]), (1.0 - part[0]) * part[1]];
        let weights = [weights[0], weights[1], weights[2], part[0] * part[1]];
        cells.iter().zip(weights).any(|(&c, weight)| weight > 0.0 && self.missing[c])
    }

    /// Smallest and largest value that is no filling.
    pub fn range(&self) -> [f64; 2] {
        let known = self.values.iter().zip(&self.missing).filter(|(_, missing)| !**missing).map(|(v, _)| *v);
        known.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
    }

    /// The steepest slope |grad z| within `reach` of each cell's middle or nearer to it than to others, as the surface
    /// between the cells has it.
    pub fn steepest(&self, reach: f64) -> Vec<f64> {
        let [nx, ny] = self.size;
        // Of the patch whose south-western corner is the cell's middle: its sides bound the slopes inside.
        let mut patch = vec![0.0_f64; nx * ny];
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                let c = j * nx + i;
                let z = [c, c + 1, c + nx, c + nx + 1].map(|c| self.values[c]);
                let along = (z[1] - z[0]).abs().max((z[3] - z[2]).abs()) / self.cell[0];
                let across = (z[2] - z[0]).abs().max((z[3] - z[1]).abs()) / self.cell[1];
                patch[c] = along.hypot(across);
            }
        }
        let window = [0, 1].map(|a| (reach / self.cell[a]).ceil() as usize + 1);
        let rows = widened(&patch, [nx, ny], window[0], 0);
        widened(&rows, [nx, ny], window[1], 1)
    }

    /// The number of the cell that a point lies in, or is nearest to.
    pub fn cell_of(&self, x: f64, y: f64) -> usize {
        let [i, j] = [(0, x), (1, y)]
            .map(|(a, x)| ((x - self.first[a]) / self.cell[a]).round().clamp(0.0, (self.size[a] - 1) as f64) as usize);
        j * self.size[0] + i
    }
}

fn bilinear(z: [f64; 4], part: [f64; 2]) -> f64 {
    let (low, high) = (z[0] + part[0] * (z[1] - z[0]), z[2] + part[0] * (z[3] - z[2]));
    low + part[1] * (high - low)
}

/// The largest value up to `window` cells away along an axis.
fn widened(values: &[f64], size: [usize; 2], window: usize, axis: usize) -> Vec<f64> {
    let (stride, count) = if axis == 0 { (1, size[0]) } else { (size[0], size[1]) };
    let window = window.min(count);
    let place = |c: usize| if axis == 0 { c % size[0] } else { c / size[0] };
    let largest = |c: usize| {
        let n = place(c);
        let (from, to) = (n.saturating_sub(window), (n + window).min(count - 1));
        (from..=to).map(|m| values[c + m * stride - n * stride]).fold(0.0, f64::max)
    };
    (0..values.len()).map(largest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// z = 1 + x/2 - y/4 on 5 x 4 cells of 2 m x 1 m.
    fn plane() -> Grid {
        let rows = (0..4).rev().flat_map(|j| (0..5).map(move |i| 1.0 + f64::from(i) - 0.25 * f64::from(j))).collect();
        Grid::from_rows([5, 4], [0.0, 0.0], [2.0, 1.0], rows, Some(-9999.0)).unwrap()
    }

    #[test]
    fn a_plane_is_a_plane_between_the_cells_and_level_beyond_them() {
        let grid = plane();
        for (x, y) in [(0.0, 0.0), (3.1, 0.7), (8.0, 3.0), (7.9, 2.9)] {
            assert!((grid.at(x, y) - (1.0 + 0.5 * x - 0.25 * y)).abs() < 1e-14);
            let [a, b] = grid.gradient(x, y);
            assert!((a - 0.5).abs() < 1e-14 && (b + 0.25).abs() < 1e-14);
        }
        assert_eq!((grid.at(100.0, 0.0), grid.at(-7.0, 50.0)), (5.0, 0.25));
        assert_eq!(grid.range(), [0.25, 5.0]);
        assert_eq!(grid.extent(), ([0.0; 2], [8.0, 3.0]));
        assert_eq!(grid.steepest(1.0)[0], 0.5f64.hypot(0.25));
        let moved = grid.clone().shifted([2.0, 1.0, 1.0], true);
        assert_eq!(moved.at(0.0, 0.0), grid.at(2.0, 1.0) - 1.0);
        assert_eq!((grid.cell_of(2.9, 1.4), grid.cell_of(-9.0, 99.0)), (6, 15));
    }

    #[test]
    fn cells_without_data_have_the_value_of_the_nearest_and_are_known() {
        let mut rows = vec![3.0; 16];
        (rows[5], rows[6], rows[0]) = (-9999.0, f64::NAN, 7.0);
        let grid = Grid::from_rows([4, 4], [0.0; 2], [1.0; 2], rows.clone(), Some(-9999.0)).unwrap();
        assert!(grid.values.iter().all(|v| v.is_finite() && *v > 0.0));
        // The second row of the file is the third from the south.
        assert!(grid.is_missing(1.0, 2.0) && grid.is_missing(0.5, 1.5) && grid.is_missing(2.4, 2.0));
        assert!(!grid.is_missing(0.0, 2.0) && !grid.is_missing(1.0, 1.0));
        assert_eq!(grid.range(), [3.0, 7.0]);
        assert!(
            Grid::from_rows([4, 4], [0.0; 2], [1.0; 2], vec![-1.0; 16], Some(-1.0)).unwrap_err().contains("no cell")
        );
        assert!(Grid::from_rows([16, 1], [0.0; 2], [1.0; 2], rows, None).unwrap_err().contains("2 x 2"));
    }

    #[test]
    fn the_steepest_slope_nearby_is_found_and_no_other() {
        let mut rows = vec![0.0; 100];
        rows[55] = 4.0;
        let grid = Grid::from_rows([10, 10], [0.0; 2], [1.0; 2], rows, None).unwrap();
        let steep = grid.steepest(1.0);
        assert!((steep[grid.cell_of(5.0, 4.0)] - 32f64.sqrt()).abs() < 1e-14);
        assert!(steep[grid.cell_of(3.0, 4.0)] > 5.0);
        assert_eq!(steep[grid.cell_of(1.0, 4.0)], 0.0);
    }

    #[test]
    fn other_grids_are_told_apart() {
        let grid = plane();
        assert_eq!(grid.difference(&grid), None);
        let mut other = grid.clone();
        other.first[1] += 0.5;
        assert!(grid.difference(&other).unwrap().contains("y = 0.5 m"));
        other = grid.clone();
        other.cell[0] = 2.5;
        assert!(grid.difference(&other).unwrap().contains("sides of 2.5 m"));
    }
}
