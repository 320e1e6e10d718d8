//! What a landslide did on its terrain: thickness and speed on the cells of the terrain's raster, their largest values, and
//! when the material came.
//!
//! Each particle is spread evenly over a square with the sides of the spacing, and its parts go to the cells they lie on: the
//! volume on the map is the mass over the density at the start. (Of particles that fly alone the density itself says little.)

use formats::{
    raster::Grid,
    scene::{Scene, Terrain},
    snapshot::Rows,
    space::Space,
};

/// Most values of a map over time; where a raster has more, the maps show the part that the material has reached.
const MOST_VALUES: usize = 1 << 24;

/// Maps on the raster or, where that is large, on the part of it that the material has reached, row by row along x from south to north.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// The terrain.
    pub terrain: Terrain,
    /// Numbers of the first cell along x and y, within the raster.
    pub first: [usize; 2],
    /// Numbers of cells along x and y.
    pub size: [usize; 2],
    /// Below this thickness a cell counts as not reached, and has no speed, m: half a spacing.
    pub least: f64,
    /// Times of the snapshots, s.
    pub times: Vec<f64>,
    /// Vertical thickness at each time, m: volume at the density of the start over area.
    pub thickness: Vec<Vec<f64>>,
    /// Speed at each time, m/s: that of the mean velocity of what lies on the cell. NaN where that is too thin.
    pub speed: Vec<Vec<f64>>,
    /// Share of the mass beyond the raster's edge at each time.
    pub beyond: Vec<f64>,
}

/// Thickness and speed of one snapshot on all cells of the raster.
#[derive(Debug)]
pub struct Layer {
    time: f64,
    volume: Vec<f64>,
    momentum: Vec<[f64; 3]>,
    beyond: f64,
}

/// Lays snapshots on the raster.
#[derive(Debug)]
pub struct Gatherer<'a> {
    terrain: &'a Terrain,
    dx: f64,
    /// At the start, kg/m3.
    density: f64,
}

impl<'a> Gatherer<'a> {
    /// For a scene in three dimensions with a terrain; none for others.
    pub fn new(scene: &'a Scene) -> Option<Self> {
        let terrain = scene.terrain.as_ref().filter(|_| scene.space == Space::ThreeD)?;
        Some(Self { terrain, dx: scene.spacing, density: scene.material.density() })
    }

    /// A snapshot on the raster.
    pub fn layer(&self, time: f64, rows: &Rows) -> Layer {
        let ground = &self.terrain.ground;
        let [nx, ny] = ground.size;
        let (mut volume, mut momentum) = (vec![0.0; nx * ny], vec![[0.0; 3]; nx * ny]);
        let (mut beyond, mut mass) = (0.0, 0.0);
        for row in 0..rows.len() {
            let (x, v, bulk) = (rows.position[row], rows.velocity[row], rows.mass[row] / self.density);
            mass += rows.mass[row];
            let mut kept = 0.0;
            for (j, part_y) in parts(ground, 1, x[1], self.dx) {
                for (i, part_x) in parts(ground, 0, x[0], self.dx) {
                    let (c, share) = (j * nx + i, part_x * part_y);
                    volume[c] += bulk * share;
                    (0..3).for_each(|a| momentum[c][a] += bulk * share * v[a]);
                    kept += share;
                }
            }
            beyond += rows.mass[row] * (1.0 - kept);
        }
        Layer { time, volume, momentum, beyond: (beyond / mass).max(0.0) }
    }

    /// The maps of snapshots whose times ascend.
    pub fn maps(&self, layers: Vec<Layer>) -> Maps {
        let ground = &self.terrain.ground;
        let [nx, _] = ground.size;
        let mut ends = [[usize::MAX, 0]; 2];
        for layer in &layers {
            for c in (0..layer.volume.len()).filter(|&c| layer.volume[c] > 0.0) {
                for (a, n) in [c % nx, c / nx].into_iter().enumerate() {
                    ends[a] = [ends[a][0].min(n), ends[a][1].max(n)];
                }
            }
        }
        // A margin, so that nothing ends at the border of the map.
        let whole = ground.values.len() * layers.len() <= MOST_VALUES;
        let range = |a: usize| {
            if whole {
                return (0, ground.size[a]);
            }
            let [low, high] = if ends[a][0] > ends[a][1] { [0, 0] } else { ends[a] };
            (low.saturating_sub(2), (high + 3).min(ground.size[a]))
        };
        let [(x0, x1), (y0, y1)] = [range(0), range(1)];
        let cells: Vec<usize> = (y0..y1).flat_map(|j| (x0..x1).map(move |i| j * nx + i)).collect();
        let (area, least) = (ground.cell[0] * ground.cell[1], 0.5 * self.dx);
        let thickness = |layer: &Layer| cells.iter().map(|&c| layer.volume[c] / area).collect();
        let speed = |layer: &Layer| {
            let of = |&c: &usize| {
                let length = layer.momentum[c].iter().map(|p| p * p).sum::<f64>().sqrt();
                if layer.volume[c] / area >= least { length / layer.volume[c] } else { f64::NAN }
            };
            cells.iter().map(of).collect()
        };
        Maps {
            terrain: self.terrain.clone(),
            first: [x0, y0],
            size: [x1 - x0, y1 - y0],
            least,
            times: layers.iter().map(|layer| layer.time).collect(),
            thickness: layers.iter().map(thickness).collect(),
            speed: layers.iter().map(speed).collect(),
            beyond: layers.iter().map(|layer| layer.beyond).collect(),
        }
    }
}

/// The cells along an axis that a square of side `dx` around `x` lies on, and the shares of it.
fn parts(ground: &Grid, axis: usize, x: f64, dx: f64) -> impl Iterator<Item = (usize, f64)> {
    let (cell, count) = (ground.cell[axis], ground.size[axis]);
    // In cells from the edge of the raster.
    let [low, high] = [-0.5, 0.5].map(|half| (x + half * dx - ground.first[axis]) / cell + 0.5);
    let (from, to) = (low.max(0.0), high.min(count as f64));
    let cells = if from < to { from as usize..(to.ceil() as usize).min(count) } else { 0..0 };
    cells.map(move |n| (n, ((n as f64 + 1.0).min(to) - (n as f64).max(from)).max(0.0) / (high - low)))
}

impl Maps {
    /// Middle of a cell in the coordinates of the raster, m.
    pub fn coordinate(&self, axis: usize, n: usize) -> f64 {
        let ground = &self.terrain.ground;
        ground.first[axis] + (self.first[axis] + n) as f64 * ground.cell[axis] + self.terrain.origin[axis]
    }

    /// Heights of the ground in the coordinates of the raster, m; NaN where it has no data.
    pub fn ground(&self) -> Vec<f64> {
        let ground = &self.terrain.ground;
        let cell = |c: usize| {
            let [i, j] = [self.first[0] + c % self.size[0], self.first[1] + c / self.size[0]];
            let c = j * ground.size[0] + i;
            if ground.missing[c] { f64::NAN } else { ground.values[c] + self.terrain.origin[2] }
        };
        (0..self.size[0] * self.size[1]).map(cell).collect()
    }

    /// The largest values over all times; NaN where nothing came.
    pub fn largest(&self, over: &[Vec<f64>]) -> Vec<f64> {
        let cell = |c: usize| over.iter().map(|field| field[c]).filter(|v| *v > 0.0).fold(f64::NAN, f64::max);
        (0..self.size[0] * self.size[1]).map(cell).collect()
    }

    /// When the thickness came up to [`Maps::least`], s: linear between snapshots, NaN where it never did.
    pub fn arrival(&self) -> Vec<f64> {
        let cell = |c: usize| {
            let Some(k) = self.thickness.iter().position(|field| field[c] >= self.least) else { return f64::NAN };
            let Some(before) = k.checked_sub(1) else { return self.times[0] };
            let (low, high) = (self.thickness[before][c], self.thickness[k][c]);
            self.times[before] + (self.times[k] - self.times[before]) * (self.least - low) / (high - low)
        };
        (0..self.size[0] * self.size[1]).map(cell).collect()
    }

    /// Thickness at the end, m; NaN where nothing lies.
    pub fn deposit(&self) -> Vec<f64> {
        let last = self.thickness.last().map_or(&[][..], |field| &field[..]);
        last.iter().map(|&depth| if depth > 0.0 { depth } else { f64::NAN }).collect()
    }
}

/// The same particles above level ground: what is evaluated along x, and as heights, is measured from the ground below.
pub fn levelled(scene: &Scene, mut rows: Rows) -> Rows {
    rows.position = places_levelled(scene, rows.position);
    rows
}

/// As [`levelled`].
pub fn places_levelled(scene: &Scene, mut places: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    if let Some(terrain) = &scene.terrain {
        places.iter_mut().for_each(|x| x[2] -= terrain.height(x[0], x[1]));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::scene::Slip;
    use std::sync::Arc;

    fn terrain() -> Terrain {
        let mut text = "ncols 6\nnrows 5\nxllcorner 0\nyllcorner 0\ncellsize 2\n".to_string();
        text.push_str(&"3 3 3 3 3 3\n".repeat(5));
        let ground = Grid::read(text.as_bytes()).unwrap().shifted([100.0, 0.0, 1.0], true);
        Terrain { file: "a".into(), origin: [100.0, 0.0, 1.0], slip: Slip::NoSlip, ground: Arc::new(ground) }
    }

    fn rows(places: &[[f64; 3]], speed: f64) -> Rows {
        let n = places.len();
        Rows {
            id: (0..n as u64).collect(),
            position: places.to_vec(),
            velocity: vec![[speed, 0.0, 0.0]; n],
            mass: vec![2000.0; n],
            density: vec![1000.0; n],
            ..Rows::default()
        }
    }

    #[test]
    fn volume_is_kept_and_times_are_interpolated() {
        let terrain = terrain();
        let gatherer = Gatherer { terrain: &terrain, dx: 1.0, density: 2000.0 };
        // One cubic metre half on each of two cells, then three of them on one cell, one half off the edge.
        let empty = [[-94.5 + 0.5, 5.0, 2.5]];
        let later = [[-91.0, 5.0, 2.5], [-91.0, 5.0, 3.5], [-91.0, 5.0, 4.5], [-88.0, 5.0, 2.5]];
        let maps =
            gatherer.maps(vec![gatherer.layer(0.0, &rows(&empty, 1.0)), gatherer.layer(2.0, &rows(&later, 3.0))]);
        assert_eq!((maps.first, maps.size), ([0, 0], [6, 5]));
        let sum = |field: &[f64]| field.iter().map(|d| 4.0 * d).sum::<f64>();
        let sums = [0, 1].map(|k| sum(&maps.thickness[k]));
        assert!((sums[0] - 1.0).abs() < 1e-14 && (sums[1] - 3.5).abs() < 1e-14, "{sums:?} {:?}", maps.thickness);
        assert!((maps.beyond[1] - 0.125).abs() < 1e-14);
        // x from 8 to 10 of the raster is cell 4; its middle row is 2.
        let cell = 2 * 6 + 4;
        assert_eq!(maps.coordinate(0, 4), 9.0);
        assert_eq!((maps.thickness[1][cell], maps.speed[1][cell]), (0.75, 3.0));
        assert!((maps.arrival()[cell] - 2.0 * 0.5 / 0.75).abs() < 1e-14);
        assert!(maps.speed[0][2 * 6 + 2].is_nan(), "too thin: an eighth of a metre");
        assert_eq!(maps.largest(&maps.thickness)[2 * 6 + 2], 0.125);
        assert!(maps.deposit()[2 * 6 + 2].is_nan() && maps.arrival()[0].is_nan());
        assert_eq!(maps.ground()[0], 3.0);
    }
}
