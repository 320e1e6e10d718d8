//! The lattice of a body: which cells of size dx hold a particle, and where they are.
//!
//! Every shape stands on a flat foot, so its cells form columns along z that are filled from the bottom. A body is
//! thus known by the number of cells of each column, which takes a few operations and no memory.

use formats::{
    scene::{Scene, Shape},
    space::Space,
};
use std::f64::consts::PI;

/// Points closer than this to a border, in spacings, lie on it: they don't count as inside.
const ON_THE_BORDER: f64 = 1e-9;

/// The lattice of one body. Columns are counted with y fastest, then x; cells of a column upwards.
#[derive(Clone, Debug)]
pub struct Lattice {
    shape: Shape,
    space: Space,
    spacing: f64,
    /// The border of cell (0, 0, 0), m.
    origin: [f64; 3],
    /// Index of the first column along x and y.
    first: [i64; 2],
    /// Number of columns along x and y.
    columns: [u64; 2],
    /// Is only the positive side of x = 0, y = 0 filled?
    symmetry: [bool; 2],
}

/// A column of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Its middle, m.
    pub x: f64,
    /// Its middle, m; zero in the plane spaces.
    pub y: f64,
    /// Cells that hold a particle, from the bottom.
    pub cells: u64,
}

impl Lattice {
    /// The lattice of body number `body` of a scene.
    pub fn new(scene: &Scene, body: usize) -> Self {
        let shape = scene.bodies[body].shape.clone();
        let (dx, space) = (scene.spacing, scene.space);
        let cells = |size: f64| (size / dx).round() as u64;
        let (origin, first, mut columns) = match shape {
            Shape::Cylinder { base, radius, .. } => {
                let n = (radius / dx).ceil() as i64;
                match space {
                    Space::Axisymmetric => ([0.0, 0.0, base[2]], [0, 0], [n as u64, 1]),
                    _ => (base, [-n, -n], [2 * n as u64; 2]),
                }
            }
            Shape::Box { min, max } => (min, [0, 0], [cells(max[0] - min[0]), cells(max[1] - min[1])]),
            Shape::Wedge { corner, size, falls_left } => {
                let n = cells(size[0]);
                (corner, [if falls_left { -(n as i64) } else { 0 }, 0], [n, cells(size[1])])
            }
        };
        if space != Space::ThreeD {
            columns[1] = 1;
        }
        Self { shape, space, spacing: dx, origin, first, columns, symmetry: scene.symmetry }
    }

    /// Number of columns, empty ones included.
    pub fn columns(&self) -> u64 {
        self.columns[0] * self.columns[1]
    }

    /// The largest number of cells along an axis.
    pub fn extent(&self) -> u64 {
        self.columns[0].max(self.columns[1]).max(self.whole(self.height()))
    }

    /// A column, counted from 0.
    pub fn column(&self, index: u64) -> Column {
        let [i, j] = [index / self.columns[1], index % self.columns[1]];
        // In spacings from the origin, so that cells inside don't depend on where the body stands.
        let u = (self.first[0] + i as i64) as f64 + 0.5;
        let v = (self.first[1] + j as i64) as f64 + 0.5;
        let x = self.origin[0] + u * self.spacing;
        let y = if self.space == Space::ThreeD { self.origin[1] + v * self.spacing } else { 0.0 };
        let mirrored = |side: bool, x: f64| side && x <= ON_THE_BORDER * self.spacing;
        if mirrored(self.symmetry[0], x) || (self.space == Space::ThreeD && mirrored(self.symmetry[1], y)) {
            return Column { x, y, cells: 0 };
        }
        let cells = match self.shape {
            Shape::Cylinder { radius, height, .. } => {
                let distance = if self.space == Space::ThreeD { u.hypot(v) } else { u };
                let inside = distance < radius / self.spacing - ON_THE_BORDER;
                if inside { self.whole(height) } else { 0 }
            }
            Shape::Box { min, max } => self.whole(max[2] - min[2]),
            Shape::Wedge { size, .. } => {
                let top = size[2] / self.spacing * (1.0 - u.abs() * self.spacing / size[0]);
                (top - 0.5 - ON_THE_BORDER).ceil().max(0.0) as u64
            }
        };
        Column { x, y, cells }
    }

    /// The middle of a cell of a column, m above z = 0.
    pub fn z(&self, cell: u64) -> f64 {
        self.origin[2] + (cell as f64 + 0.5) * self.spacing
    }

    /// The body's surface at a place, m above z = 0.
    pub fn top(&self, x: f64) -> f64 {
        match self.shape {
            Shape::Wedge { size, .. } => {
                self.origin[2] + size[2] * (1.0 - (x - self.origin[0]).abs() / size[0]).max(0.0)
            }
            _ => self.origin[2] + self.height(),
        }
    }

    /// Lower and upper surface of the body above a place of its foot, m above z = 0; none where it does not stand.
    pub fn vertical_extent(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let three = self.space == Space::ThreeD;
        let across = |low: f64, high: f64| !three || (low..high).contains(&y);
        let stands = match self.shape {
            Shape::Cylinder { base, radius, .. } if three => (x - base[0]).hypot(y - base[1]) < radius,
            Shape::Cylinder { radius, .. } => x < radius,
            Shape::Box { min, max } => (min[0]..max[0]).contains(&x) && across(min[1], max[1]),
            Shape::Wedge { corner, size, falls_left } => {
                let along = if falls_left { corner[0] - x } else { x - corner[0] };
                (0.0..size[0]).contains(&along) && across(corner[1], corner[1] + size[1])
            }
        };
        stands.then(|| (self.origin[2], self.top(x)))
    }

    /// Lower and upper corner of the box around the shape, the part on the positive side of the planes of symmetry, m.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let (mut low, mut high) = match self.shape {
            Shape::Cylinder { base: [x, y, z], radius, height } => {
                ([x - radius, y - radius, z], [x + radius, y + radius, z + height])
            }
            Shape::Box { min, max } => (min, max),
            Shape::Wedge { corner: [x, y, z], size, falls_left } => {
                let start = if falls_left { x - size[0] } else { x };
                ([start, y, z], [start + size[0], y + size[1], z + size[2]])
            }
        };
        let axis = self.space == Space::Axisymmetric;
        for side in 0..2 {
            if self.symmetry[side] || (axis && side == 0) {
                low[side] = low[side].max(0.0);
                high[side] = high[side].max(0.0);
            }
        }
        (low, high)
    }

    /// About how many particles the body holds, without counting: its volume over that of a cell.
    pub fn estimate(&self) -> u64 {
        let cells = match self.space {
            Space::ThreeD => self.ideal_volume() / self.spacing.powi(3),
            Space::PlaneStrain => self.ideal_volume() / self.spacing.powi(2),
            // Of rings the section counts, and there are rectangles only.
            Space::Axisymmetric => (self.columns() * self.whole(self.height())) as f64,
        };
        cells.round() as u64
    }

    /// Volume of a particle of this column: m3, m2 in plane strain (per metre of depth), of the whole ring in the
    /// axisymmetric space.
    pub fn volume(&self, column: Column) -> f64 {
        match self.space {
            Space::ThreeD => self.spacing.powi(3),
            Space::PlaneStrain => self.spacing.powi(2),
            Space::Axisymmetric => 2.0 * PI * column.x * self.spacing.powi(2),
        }
    }

    /// Volume of the shape itself, the part on the positive side of the planes of symmetry; same units as
    /// [`Lattice::volume`].
    pub fn ideal_volume(&self) -> f64 {
        let clip = |axis: usize, low: f64, high: f64| {
            let low = if self.symmetry[axis] { low.max(0.0) } else { low };
            (low, high.max(low))
        };
        let width = |low: f64, high: f64| match self.space {
            Space::ThreeD => clip(1, low, high).1 - clip(1, low, high).0,
            _ => 1.0,
        };
        match self.shape {
            Shape::Cylinder { radius, height, .. } if self.space == Space::Axisymmetric => PI * radius.powi(2) * height,
            Shape::Cylinder { base, radius, height } => {
                // Chord by chord, at angles t from the x axis: the clipped disc has no simple closed form.
                const CHORDS: u32 = 100_000;
                let dt = PI / f64::from(CHORDS);
                let area: f64 = (0..CHORDS)
                    .map(|n| {
                        let (sin, cos) = ((f64::from(n) + 0.5) * dt).sin_cos();
                        let outside = self.symmetry[0] && base[0] + radius * cos <= 0.0;
                        let chord = width(base[1] - radius * sin, base[1] + radius * sin);
                        if outside { 0.0 } else { chord * radius * sin * dt }
                    })
                    .sum();
                area * height
            }
            Shape::Box { min, max } => {
                let (low, high) = clip(0, min[0], max[0]);
                let area = match self.space {
                    Space::Axisymmetric => PI * (high * high - low * low),
                    _ => (high - low) * width(min[1], max[1]),
                };
                area * (max[2] - min[2])
            }
            Shape::Wedge { corner, size, falls_left } => {
                let far = if falls_left { corner[0] - size[0] } else { corner[0] + size[0] };
                let (low, high) = clip(0, corner[0].min(far), corner[0].max(far));
                let mean = 0.5 * (self.top(low) + self.top(high)) - corner[2];
                (high - low) * mean * width(corner[1], corner[1] + size[1])
            }
        }
    }

    /// Height of the shape where it is highest, m.
    fn height(&self) -> f64 {
        match self.shape {
            Shape::Cylinder { height, .. } => height,
            Shape::Box { min, max } => max[2] - min[2],
            Shape::Wedge { size, .. } => size[2],
        }
    }

    fn whole(&self, size: f64) -> u64 {
        (size / self.spacing).round() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scene;

    fn count(lattice: &Lattice) -> u64 {
        (0..lattice.columns()).map(|c| lattice.column(c).cells).sum()
    }

    fn cylinder(base: [f64; 3]) -> Shape {
        Shape::Cylinder { base, radius: 0.1, height: 0.2 }
    }

    #[test]
    fn an_axisymmetric_cylinder_is_a_rectangle_of_rings() {
        let lattice = Lattice::new(&scene(Space::Axisymmetric, 0.004, cylinder([0.0; 3])), 0);
        assert_eq!(count(&lattice), 25 * 50);
        assert_eq!(lattice.column(0).x, 0.002);
        assert!((lattice.z(0) - 0.002).abs() < 1e-15);
        let volume: f64 = (0..25).map(|c| lattice.column(c)).map(|c| c.cells as f64 * lattice.volume(c)).sum();
        assert!((volume / lattice.ideal_volume() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_quarter_cylinder_is_a_quarter_of_the_whole() {
        let mut scene = scene(Space::ThreeD, 0.004, cylinder([0.0; 3]));
        let whole = Lattice::new(&scene, 0);
        scene.symmetry = [true; 2];
        let quarter = Lattice::new(&scene, 0);
        // Lattice points (i+1/2, j+1/2) in a quarter disc of radius 25, counted row by row with integers.
        let points = (0..25u64).flat_map(|i| (0..25u64).map(move |j| (2 * i + 1).pow(2) + (2 * j + 1).pow(2)));
        let disc = points.filter(|&d| d < 4 * 625).count() as u64;
        assert_eq!(count(&quarter), disc * 50);
        assert_eq!(count(&whole), 4 * disc * 50);
        let ideal = PI * 0.01 * 0.2;
        assert!((whole.ideal_volume() / ideal - 1.0).abs() < 1e-8);
        assert!((quarter.ideal_volume() / ideal - 0.25).abs() < 1e-8);
        let deviation = disc as f64 * 50.0 * 0.004f64.powi(3) / quarter.ideal_volume() - 1.0;
        assert!(deviation.abs() < 0.01, "{deviation}");
    }

    #[test]
    fn where_a_cylinder_stands_does_not_change_its_cells() {
        let here = Lattice::new(&scene(Space::ThreeD, 0.01, cylinder([0.0; 3])), 0);
        let there = Lattice::new(&scene(Space::ThreeD, 0.01, cylinder([0.123, -7.7, 3.3])), 0);
        for c in 0..here.columns() {
            assert_eq!(here.column(c).cells, there.column(c).cells);
        }
        assert!((there.z(0) - 3.305).abs() < 1e-12);
    }

    #[test]
    fn a_box_has_round_cells_along_each_axis() {
        let shape = Shape::Box { min: [0.1, 0.0, 0.5], max: [0.304, 0.1, 0.6] };
        let lattice = Lattice::new(&scene(Space::ThreeD, 0.01, shape.clone()), 0);
        assert_eq!(count(&lattice), 20 * 10 * 10);
        assert!((lattice.column(0).x - 0.105).abs() < 1e-15);
        assert!((lattice.column(1).y - 0.015).abs() < 1e-15, "y is faster than x");
        let plane = Lattice::new(&scene(Space::PlaneStrain, 0.01, shape.clone()), 0);
        assert_eq!(count(&plane), 20 * 10);
        assert_eq!(plane.column(3).y, 0.0);
        let rings = Lattice::new(&scene(Space::Axisymmetric, 0.01, shape), 0);
        assert!((rings.ideal_volume() / (PI * (0.304f64.powi(2) - 0.01) * 0.1) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn every_column_stands_on_the_foot() {
        let shapes = [
            cylinder([0.3, -0.2, 1.0]),
            Shape::Box { min: [0.1, -0.1, 0.5], max: [0.304, 0.106, 0.6] },
            Shape::Wedge { corner: [0.5, 0.0, 0.1], size: [0.4, 0.1, 0.2], falls_left: true },
            Shape::Wedge { corner: [0.5, 0.0, 0.1], size: [0.4, 0.1, 0.2], falls_left: false },
        ];
        for shape in shapes {
            let lattice = Lattice::new(&scene(Space::ThreeD, 0.01, shape.clone()), 0);
            let (low, high) = lattice.bounds();
            for column in (0..lattice.columns()).map(|c| lattice.column(c)).filter(|c| c.cells > 0) {
                let (bottom, top) = lattice.vertical_extent(column.x, column.y).unwrap();
                assert!(bottom < lattice.z(0) && lattice.z(column.cells - 1) < top, "{shape:?}");
                assert!(low[0] < column.x && column.x < high[0] && low[1] < column.y && column.y < high[1]);
            }
            assert_eq!(lattice.vertical_extent(low[0] - 0.01, 0.5 * (low[1] + high[1])), None);
            assert_eq!(lattice.vertical_extent(0.5 * (low[0] + high[0]), high[1] + 0.01), None);
            assert!((lattice.estimate() as f64 / count(&lattice) as f64 - 1.0).abs() < 0.06, "{shape:?}");
        }
    }

    #[test]
    fn a_wedge_falls_to_either_side() {
        let wedge = |falls_left| Shape::Wedge { corner: [0.5, 0.0, 0.1], size: [0.4, 0.0, 0.2], falls_left };
        let right = Lattice::new(&scene(Space::PlaneStrain, 0.01, wedge(false)), 0);
        let left = Lattice::new(&scene(Space::PlaneStrain, 0.01, wedge(true)), 0);
        let heights = |l: &Lattice| (0..l.columns()).map(|c| l.column(c).cells).collect::<Vec<_>>();
        assert_eq!(heights(&right)[0], 20);
        assert_eq!(heights(&right)[39], 0);
        assert_eq!(heights(&right), heights(&left).into_iter().rev().collect::<Vec<_>>());
        assert!((left.column(0).x - 0.105).abs() < 1e-12);
        assert!((right.column(0).x - 0.505).abs() < 1e-12);
        for lattice in [&right, &left] {
            let ideal = lattice.ideal_volume();
            assert!((ideal - 0.04).abs() < 1e-12);
            assert!((count(lattice) as f64 * 1e-4 / ideal - 1.0).abs() < 0.02);
            for c in (0..40).map(|c| lattice.column(c)).filter(|c| c.cells > 0) {
                assert!(lattice.z(c.cells - 1) < lattice.top(c.x));
                assert!(lattice.z(c.cells) >= lattice.top(c.x) - 1e-10);
            }
        }
    }
}
