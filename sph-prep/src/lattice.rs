//! The lattice of a body: its columns, and how many particles each holds.
//!
//! Every shape stands on a flat foot, so its particles form columns along z that are filled from the bottom. A body is
//! thus known by the number of particles of each column, which takes a few operations and no memory.

use crate::{packing::Packing, shape::Solid};
use formats::{
    scene::{Release, Scene, Shape, WallLattice},
    space::Space,
};
use std::f64::consts::PI;

/// Points closer than this to a border, in spacings, lie on it: they don't count as inside.
const ON_THE_BORDER: f64 = 1e-9;

/// The lattice of one body. Columns are counted with y fastest, then x; particles of a column upwards.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// What it fills.
    pub solid: Solid,
    spacing: f64,
    /// The lattice, its planes at the distances that fit the body.
    packing: Packing,
    /// Where counting starts: planes lie at this point and (n + 1/2) of their distances, m.
    origin: [f64; 3],
    /// Index of the first column along x and y.
    first: [i64; 2],
    /// Number of columns along x and y.
    columns: [u64; 2],
    /// Number of layers, where the body is highest.
    layers: u64,
    /// Volume of a particle, m3; its section in the plane spaces, m2. Of released material that of a whole cell.
    share: f64,
    /// What the thickness of released material is multiplied with, so that its volume is exact: see [`Lattice::released`].
    pub scale: f64,
}

/// A column of particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Its place, m.
    pub x: f64,
    /// Its place, m; zero in the plane spaces.
    pub y: f64,
    /// Particles from the bottom.
    pub cells: u64,
    /// The lowest layer that it has a particle in.
    lowest: u64,
    /// Where layers are counted from, m above z = 0, and how far they are apart, m.
    foot: f64,
    pitch: f64,
    /// Volume of its particles over that of others.
    bulk: f64,
}

impl Lattice {
    /// The lattice of body number `body` of a scene.
    pub fn new(scene: &Scene, body: usize) -> Self {
        let (solid, packing) = (Solid::new(scene, body), Packing::new(scene));
        if let Shape::Release(release) = &solid.shape {
            let release = release.clone();
            return Self::released(scene, solid, packing, &release);
        }
        if packing.staggered { Self::fitted(scene, solid, packing) } else { Self::cubic(scene, solid, packing) }
    }

    /// Cells of size dx, counted from the foot of the shape: sizes are rounded to whole ones.
    fn cubic(scene: &Scene, solid: Solid, packing: Packing) -> Self {
        let (dx, space) = (scene.spacing, scene.space);
        let cells = |size: f64| (size / dx).round() as u64;
        let (first, mut columns) = match solid.shape {
            Shape::Cylinder { radius, .. } => {
                let n = (radius / dx).ceil() as i64;
                if space == Space::Axisymmetric { ([0, 0], [n as u64, 1]) } else { ([-n, -n], [2 * n as u64; 2]) }
            }
            Shape::Box { min, max } => ([0, 0], [cells(max[0] - min[0]), cells(max[1] - min[1])]),
            // [`Lattice::released`]
            Shape::Release(_) => ([0, 0], [1, 1]),
            Shape::Wedge { size, falls_left, .. } => {
                let n = cells(size[0]);
                ([if falls_left { -(n as i64) } else { 0 }, 0], [n, cells(size[1])])
            }
        };
        if space != Space::ThreeD {
            columns[1] = 1;
        }
        let (origin, layers) = (solid.anchor(), cells(solid.height()));
        let share = dx.powi(space.dimension() as i32);
        Self { solid, spacing: dx, packing, origin, first, columns, layers, share, scale: 1.0 }
    }

    /// Columns of released material: those that wall sites lie below (see [`WallLattice`]), filled upwards from the ground. A
    /// column of thickness t has t/dx particles, rounded, of the volume dx^2 t/n: it is as thick as it should be. What lies
    /// where the thickness is less than dx/2 is spread over the rest, by a factor on all thicknesses, so that
    /// the volume is that of the shape.
    fn released(scene: &Scene, solid: Solid, packing: Packing, release: &Release) -> Self {
        let (dx, (low, high)) = (scene.spacing, solid.bounds());
        let origin = WallLattice::new(scene).origin();
        let range = |axis: usize| {
            let first = ((low[axis] - origin[axis]) / dx).floor();
            (first as i64, (((high[axis] - origin[axis]) / dx).ceil() - first).max(1.0) as u64)
        };
        let [(first_x, nx), (first_y, ny)] = [range(0), if scene.space == Space::ThreeD { range(1) } else { (0, 1) }];
        let share = dx.powi(scene.space.dimension() as i32);
        let (first, columns, layers) = ([first_x, first_y], [nx, ny], (solid.height() / dx).ceil().max(1.0) as u64);
        let mut lattice = Self { solid, spacing: dx, packing, origin, first, columns, layers, share, scale: 1.0 };
        let kept = (0..lattice.columns()).map(|c| lattice.column(c)).filter(|c| c.cells > 0);
        let kept: f64 = kept.map(|c| c.cells as f64 * lattice.bulk_volume(&c)).sum();
        if kept > 0.0 {
            lattice.scale = release.volume(scene.space, scene.symmetry, dx) / kept;
        }
        lattice
    }

    /// Planes at nearly their ideal distances, a whole number of them between opposite faces and half a distance from
    /// each. Along a period that the body fills the number is even, so that the lattice goes on across the border.
    fn fitted(scene: &Scene, solid: Solid, mut packing: Packing) -> Self {
        let (low, high) = solid.bounds();
        let fits = |axis: usize, pitch: f64| {
            let size = high[axis] - low[axis];
            let count = |pitch: f64| (size / pitch).round().max(1.0) as u64;
            if filled_period(scene, &solid, axis).is_some() { 2 * count(2.0 * pitch) } else { count(pitch) }
        };
        let (mut origin, mut first, mut columns) = (low, [0; 2], [1; 2]);
        let layers = fits(2, packing.pitch[2]);
        let height = high[2] - low[2];
        let stretch = height / (layers as f64 * packing.pitch[2]);
        packing.pitch[2] = height / layers as f64;
        let upright = matches!(solid.shape, Shape::Cylinder { .. }) && scene.space == Space::ThreeD;
        for &axis in scene.space.axes().iter().filter(|&&axis| axis < 2) {
            if upright {
                // Nothing to fit across: what the height has stretched is taken back.
                packing.pitch[axis] /= stretch.sqrt();
                let (pitch, centre) = (packing.pitch[axis], solid.anchor()[axis]);
                let cut = solid.symmetry[axis] && low[axis] <= 0.0;
                origin[axis] = if cut { 0.0 } else { centre };
                let below = if cut { 0 } else { ((centre - low[axis]) / pitch).ceil() as i64 };
                let above = ((high[axis] - origin[axis]) / pitch).ceil().max(0.0) as u64;
                first[axis] = -below;
                columns[axis] = below as u64 + above;
            } else {
                columns[axis] = fits(axis, packing.pitch[axis]);
                packing.pitch[axis] = (high[axis] - low[axis]) / columns[axis] as f64;
            }
        }
        let crossings = (columns[0] * columns[1] * layers) as f64;
        let cell: f64 = scene.space.axes().iter().map(|&axis| packing.pitch[axis]).product();
        let is_cuboid = !upright && !matches!(solid.shape, Shape::Wedge { .. });
        // Of an odd number of crossings more than half are even.
        let share = if is_cuboid { cell * crossings / (0.5 * crossings).ceil() } else { 2.0 * cell };
        Self { solid, spacing: scene.spacing, packing, origin, first, columns, layers, share, scale: 1.0 }
    }

    /// Number of columns, empty ones included.
    pub fn columns(&self) -> u64 {
        self.columns[0] * self.columns[1]
    }

    /// A column, counted from 0.
    pub fn column(&self, index: u64) -> Column {
        let [i, j] = [index / self.columns[1], index % self.columns[1]];
        let [i, j] = [self.first[0] + i as i64, self.first[1] + j as i64];
        // In distances of planes from the origin, so that cells inside don't depend on where the body stands.
        let displaced = self.packing.displacement([i, j]);
        let u = i as f64 + 0.5 + displaced[0];
        let v = j as f64 + 0.5 + displaced[1];
        let (three, pitch) = (self.solid.space == Space::ThreeD, self.packing.pitch);
        let x = self.origin[0] + u * pitch[0];
        let y = if three { self.origin[1] + v * pitch[1] } else { 0.0 };
        let lowest = self.packing.lowest([i, j]);
        let plain = Column { x, y, cells: 0, lowest, foot: self.origin[2], pitch: pitch[2], bulk: 1.0 };
        let mirrored = |side: bool, x: f64| side && x <= ON_THE_BORDER * self.spacing;
        if mirrored(self.solid.symmetry[0], x) || (three && mirrored(self.solid.symmetry[1], y)) {
            return plain;
        }
        if let Shape::Release(release) = &self.solid.shape {
            let spacings = release.thickness(x, y) / self.spacing;
            let cells = spacings.round();
            let bulk = if cells > 0.0 { spacings / cells * self.scale } else { 1.0 };
            let (foot, pitch) = (release.ground.at(x, y), bulk * self.spacing);
            return Column { cells: cells as u64, foot, pitch, bulk, ..plain };
        }
        let anchor = self.solid.anchor();
        let offset = |axis: usize| self.origin[axis] - anchor[axis];
        let top = match self.solid.shape {
            Shape::Cylinder { radius, .. } => {
                let spacings = |axis: usize, n: f64| n * (pitch[axis] / self.spacing) + offset(axis) / self.spacing;
                let distance = if three { spacings(0, u).hypot(spacings(1, v)) } else { spacings(0, u) };
                let inside = distance < radius / self.spacing - ON_THE_BORDER;
                if inside { self.layers as f64 } else { 0.0 }
            }
            Shape::Box { .. } | Shape::Release(_) => self.layers as f64,
            Shape::Wedge { size, .. } => size[2] / pitch[2] * (1.0 - (u * pitch[0] + offset(0)).abs() / size[0]),
        };
        // Layers whose middle lies below the surface.
        let cells = ((top - 0.5 - lowest as f64 - ON_THE_BORDER) / self.packing.step() as f64).ceil().max(0.0) as u64;
        Column { cells, ..plain }
    }

    /// The place of a particle of a column, m above z = 0.
    pub fn z(&self, column: Column, cell: u64) -> f64 {
        let layer = column.lowest + cell * self.packing.step();
        column.foot + (layer as f64 + 0.5) * column.pitch
    }

    /// The period along an axis, where the body fills it: lower and upper end, m.
    pub fn filled_period(&self, scene: &Scene, axis: usize) -> Option<[f64; 2]> {
        filled_period(scene, &self.solid, axis)
    }

    /// Volume of a particle, m3; its section in the plane spaces, m2.
    pub fn section(&self) -> f64 {
        self.share
    }

    /// How far a particle may be moved along an axis from its place before it leaves the body, m.
    pub fn margin(&self, axis: usize) -> f64 {
        self.packing.margin(axis) * self.packing.pitch[axis]
    }

    /// About how many particles the body holds, without counting: its volume over that of a particle.
    pub fn estimate(&self) -> u64 {
        match self.solid.space {
            // Of rings the section counts, and there are rectangles only.
            Space::Axisymmetric => (self.columns() * self.layers).div_ceil(self.packing.step()),
            _ => (self.solid.ideal_volume() / self.share).round() as u64,
        }
    }

    /// Volume of a particle of a column; units as [`Lattice::volume`].
    pub fn bulk_volume(&self, column: &Column) -> f64 {
        column.bulk * self.volume(column.x)
    }

    /// Volume of a particle at this distance from the axis: m3, m2 in plane strain (per metre of depth), of the whole
    /// ring in the axisymmetric space.
    pub fn volume(&self, x: f64) -> f64 {
        match self.solid.space {
            Space::ThreeD | Space::PlaneStrain => self.share,
            Space::Axisymmetric => 2.0 * PI * x * self.share,
        }
    }
}

fn filled_period(scene: &Scene, solid: &Solid, axis: usize) -> Option<[f64; 2]> {
    let (low, high) = solid.bounds();
    scene.periodic[axis].filter(|[from, to]| high[axis] - low[axis] > to - from - 1e-6 * scene.spacing)
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
        assert!((lattice.z(lattice.column(0), 0) - 0.002).abs() < 1e-15);
        let volume: f64 = (0..25).map(|c| lattice.column(c)).map(|c| c.cells as f64 * lattice.volume(c.x)).sum();
        assert!((volume / lattice.solid.ideal_volume() - 1.0).abs() < 1e-12);
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
        assert!((whole.solid.ideal_volume() / ideal - 1.0).abs() < 1e-8);
        assert!((quarter.solid.ideal_volume() / ideal - 0.25).abs() < 1e-8);
        let deviation = disc as f64 * 50.0 * 0.004f64.powi(3) / quarter.solid.ideal_volume() - 1.0;
        assert!(deviation.abs() < 0.01, "{deviation}");
    }

    #[test]
    fn where_a_cylinder_stands_does_not_change_its_cells() {
        let here = Lattice::new(&scene(Space::ThreeD, 0.01, cylinder([0.0; 3])), 0);
        let there = Lattice::new(&scene(Space::ThreeD, 0.01, cylinder([0.123, -7.7, 3.3])), 0);
        for c in 0..here.columns() {
            assert_eq!(here.column(c).cells, there.column(c).cells);
        }
        assert!((there.z(there.column(0), 0) - 3.305).abs() < 1e-12);
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
        assert!((rings.solid.ideal_volume() / (PI * (0.304f64.powi(2) - 0.01) * 0.1) - 1.0).abs() < 1e-12);
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
            let (low, high) = lattice.solid.bounds();
            for column in (0..lattice.columns()).map(|c| lattice.column(c)).filter(|c| c.cells > 0) {
                let (bottom, top) = lattice.solid.vertical_extent(column.x, column.y).unwrap();
                assert!(bottom < lattice.z(column, 0) && lattice.z(column, column.cells - 1) < top, "{shape:?}");
                assert!(low[0] < column.x && column.x < high[0] && low[1] < column.y && column.y < high[1]);
            }
            assert_eq!(lattice.solid.vertical_extent(low[0] - 0.01, 0.5 * (low[1] + high[1])), None);
            assert_eq!(lattice.solid.vertical_extent(0.5 * (low[0] + high[0]), high[1] + 0.01), None);
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
            let ideal = lattice.solid.ideal_volume();
            assert!((ideal - 0.04).abs() < 1e-12);
            assert!((count(lattice) as f64 * 1e-4 / ideal - 1.0).abs() < 0.02);
            for c in (0..40).map(|c| lattice.column(c)).filter(|c| c.cells > 0) {
                assert!(lattice.z(c, c.cells - 1) < lattice.solid.top(c.x));
                assert!(lattice.z(c, c.cells) >= lattice.solid.top(c.x) - 1e-10);
            }
        }
    }
}
