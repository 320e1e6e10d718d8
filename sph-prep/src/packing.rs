//! The ideal lattices: how far their planes are apart, and which way round they lie.
//!
//! All of them have their points at crossings (i, j, k) of planes across x, y and z. The cubic lattice takes every
//! crossing, the others those with i + j + k even: a column along z then holds every other layer, and its neighbours
//! the layers in between.
//!
//! Under pressure a cubic lattice buckles, the others don't. Measured on 20^3 particles of 2 mm between smooth walls, at
//! 10 kPa, without viscosity, from a jitter of 0.001: after 0.05 s particles in the middle have moved by 0.27 spacings
//! (root mean square) on the cubic lattice with the cubic spline, and 0.06, still growing, with Wendland's kernel; by
//! 0.006 on the hexagonal and the body-centred one and 0.015 from a relaxed start, all steady, with the cubic spline.

use formats::{
    scene::{Lattice, Scene},
    space::Space,
};

/// A lattice without borders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packing {
    /// Distance of planes along x, y, z at which each particle has the volume dx^D, m; dx along y in the plane spaces.
    pub pitch: [f64; 3],
    /// Are only the crossings with i + j + k even taken?
    pub staggered: bool,
    /// Hexagonal close packing.
    pub layers: Option<Layers>,
}

/// Close-packed layers of triangles, that lie in each other's hollows: alternate ones are displaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layers {
    /// The axis they are normal to.
    pub normal: usize,
    /// The horizontal axis, in the layers, along which they are displaced by [`DISPLACEMENT`].
    pub along: usize,
}

/// Layers lie by so much before or behind their mean place, in distances of planes: a third apart.
pub const DISPLACEMENT: f64 = 1.0 / 6.0;

impl Packing {
    /// The lattice of a scene.
    ///
    /// Triangles have the side s with sqrt(3)/2 s^2 = dx^2, hexagonal close packing s^3/sqrt(2) = dx^3, and the
    /// body-centred cube the side a with a^3/2 = dx^3. Close-packed rows or layers lie flat on the floor; with a plane
    /// of symmetry, or the axis, they stand parallel to it, for images would else come close to their particles.
    /// Body-centred cubes are turned by 45 degrees about z, so that planes across x and y are a/sqrt(2) apart instead
    /// of a/2.
    pub fn new(scene: &Scene) -> Self {
        let dx = scene.spacing;
        let mut pitch = [dx; 3];
        match (scene.initial.lattice, scene.space) {
            (Lattice::Cubic, _) => Self { pitch, staggered: false, layers: None },
            (Lattice::Hexagonal, Space::ThreeD) => {
                let s = dx * 2f64.powf(1.0 / 6.0);
                let (normal, along, rows) = match scene.symmetry {
                    [true, _] => (0, 1, 2),
                    [false, true] => (1, 0, 2),
                    [false, false] => (2, 1, 0),
                };
                pitch[normal] = (2f64 / 3.0).sqrt() * s;
                pitch[along] = 0.75f64.sqrt() * s;
                pitch[rows] = 0.5 * s;
                Self { pitch, staggered: true, layers: Some(Layers { normal, along }) }
            }
            (Lattice::Hexagonal, space) => {
                let s = dx * (4f64 / 3.0).powf(0.25);
                let upright = scene.symmetry[0] || space == Space::Axisymmetric;
                let (normal, rows) = if upright { (0, 2) } else { (2, 0) };
                pitch[normal] = 0.75f64.sqrt() * s;
                pitch[rows] = 0.5 * s;
                Self { pitch, staggered: true, layers: None }
            }
            (Lattice::BodyCentred, _) => {
                let a = dx * 2f64.cbrt();
                Self { pitch: [a * 0.5f64.sqrt(), a * 0.5f64.sqrt(), 0.5 * a], staggered: true, layers: None }
            }
        }
    }

    /// By how much a column is displaced along x and y, in distances of planes.
    pub fn displacement(&self, [i, j]: [i64; 2]) -> [f64; 2] {
        let mut displaced = [0.0; 2];
        if let Some(Layers { normal, along }) = self.layers {
            // The layers of a column along z are all even or all odd.
            let layer = [i, j, i + j][normal];
            displaced[along] = if layer.rem_euclid(2) == 0 { -DISPLACEMENT } else { DISPLACEMENT };
        }
        displaced
    }

    /// Distance of the first particles to a face across this axis, in distances of planes.
    pub fn margin(&self, axis: usize) -> f64 {
        if self.layers.is_some_and(|layers| layers.along == axis) { 0.5 - DISPLACEMENT } else { 0.5 }
    }

    /// The lowest layer of a column: 0 or 1.
    pub fn lowest(&self, [i, j]: [i64; 2]) -> u64 {
        if self.staggered { (i + j).rem_euclid(2) as u64 } else { 0 }
    }

    /// Layers from one particle of a column to the next.
    pub fn step(&self) -> u64 {
        if self.staggered { 2 } else { 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fill, testing};
    use formats::{scene::Shape, snapshot::Rows};

    /// Lattices, with the number of nearest neighbours and their distance in spacings.
    const KINDS: [(Space, Lattice, usize, f64); 4] = [
        (Space::PlaneStrain, Lattice::Hexagonal, 6, 1.074_57),
        (Space::Axisymmetric, Lattice::Hexagonal, 6, 1.074_57),
        (Space::ThreeD, Lattice::Hexagonal, 12, 1.122_46),
        (Space::ThreeD, Lattice::BodyCentred, 8, 1.091_12),
    ];
    /// A size in spacings, of which no lattice has a whole number of planes.
    const SIZE: f64 = 16.3;
    const SPACING: f64 = 0.01;

    fn scene(space: Space, lattice: Lattice, shape: Shape) -> Scene {
        let mut scene = testing::scene(space, SPACING, shape);
        scene.initial.lattice = lattice;
        scene
    }

    fn block(space: Space, lattice: Lattice) -> Scene {
        let size = SIZE * SPACING;
        let depth = if space == Space::ThreeD { size } else { 0.0 };
        scene(space, lattice, Shape::Box { min: [0.0; 3], max: [size, depth, size] })
    }

    /// Offsets from particle `i` to the others, in spacings; across the borders of periods to the nearest copy.
    fn offsets(scene: &Scene, rows: &Rows, i: usize) -> Vec<[f64; 3]> {
        let offset = |j: usize, axis: usize| {
            let d = rows.position[j][axis] - rows.position[i][axis];
            let period = scene.periodic[axis].map_or(0.0, |[from, to]| to - from);
            (if 2.0 * d.abs() > period && period > 0.0 { d - d.signum() * period } else { d }) / SPACING
        };
        (0..rows.len()).filter(|&j| j != i).map(|j| [0, 1, 2].map(|axis| offset(j, axis))).collect()
    }

    fn length(v: &[f64; 3]) -> f64 {
        v.iter().map(|c| c * c).sum::<f64>().sqrt()
    }

    /// Particles at least 2.5 spacings inside of every face that no period continues.
    fn inside(scene: &Scene, rows: &Rows) -> Vec<usize> {
        let deep = |x: f64| (2.5 * SPACING..(SIZE - 2.5) * SPACING).contains(&x);
        let kept = |x: [f64; 3]| scene.space.axes().iter().all(|&a| scene.periodic[a].is_some() || deep(x[a]));
        (0..rows.len()).filter(|&i| kept(rows.position[i])).collect()
    }

    fn check_neighbours(scene: &Scene, neighbours: usize, distance: f64) {
        let rows = fill::serial(scene);
        let deep = inside(scene, &rows);
        assert!(deep.len() > 50);
        for i in deep {
            let mut all: Vec<f64> = offsets(scene, &rows, i).iter().map(length).collect();
            all.sort_by(f64::total_cmp);
            // Fitting stretches a body of so many planes by up to 3 % along an axis; second neighbours of the
            // body-centred lattice are 15 % further away than the first.
            let near = all.iter().filter(|&&r| (r / distance - 1.0).abs() < 0.04).count();
            assert_eq!(near, neighbours, "{:?} {:?} {:?}", scene.space, scene.initial.lattice, &all[..14]);
            assert!(all[neighbours] > 1.08 * distance);
        }
    }

    #[test]
    fn particles_have_as_many_neighbours_as_the_lattice() {
        for (space, lattice, neighbours, distance) in KINDS {
            check_neighbours(&block(space, lattice), neighbours, distance);
        }
        for symmetry in [[true, false], [false, true]] {
            let mut scene = block(Space::ThreeD, Lattice::Hexagonal);
            scene.symmetry = symmetry;
            check_neighbours(&scene, 12, 1.122_46);
        }
    }

    #[test]
    fn across_the_border_of_a_period_the_lattice_goes_on() {
        for (space, lattice, neighbours, distance) in KINDS {
            if space == Space::Axisymmetric {
                continue;
            }
            let mut scene = block(space, lattice);
            let mut ends = [0.0, 0.0, SIZE * SPACING];
            // An odd number of spacings, along which an odd number of planes would fit better.
            for (axis, spacings) in [(0, 15.0), (1, 17.0)] {
                if scene.space.axes().contains(&axis) {
                    scene.periodic[axis] = Some([0.0, spacings * SPACING]);
                    ends[axis] = spacings * SPACING;
                }
            }
            scene.bodies[0].shape = Shape::Box { min: [0.0; 3], max: ends };
            // With an even number of planes the last column continues in the first. Fitted to an even number they are
            // stretched by up to a plane in 15.
            let rows = fill::serial(&scene);
            let count = |i: usize| {
                let near = offsets(&scene, &rows, i).iter().filter(|d| length(d) < 1.08 * distance).count();
                let off: f64 = offsets(&scene, &rows, i).iter().map(length).fold(f64::INFINITY, f64::min) / distance;
                (near, off)
            };
            for i in inside(&scene, &rows) {
                let (near, closest) = count(i);
                assert_eq!(near, neighbours, "{space:?} {lattice:?} {:?}", rows.position[i]);
                assert!(closest > 0.93, "{closest}");
            }
        }
    }

    #[test]
    fn particles_share_the_volume_of_their_body() {
        for (space, lattice, ..) in KINDS {
            let block = block(space, lattice);
            let volume = fill::lattices(&block)[0].solid.ideal_volume();
            let rows = fill::serial(&block);
            let mass: f64 = rows.mass.iter().sum();
            // Rings are a hair off where columns have different numbers of particles.
            let tolerance = if space == Space::Axisymmetric { 2e-3 } else { 1e-12 };
            assert!((mass / (2600.0 * volume) - 1.0).abs() < tolerance, "{space:?} {lattice:?}");
            let cells = SIZE.powi(space.dimension() as i32);
            // A volume of dx^D, off by what the planes are stretched.
            assert!((rows.len() as f64 / cells - 1.0).abs() < 0.05, "{space:?} {lattice:?} {}", rows.len());
            assert!((fill::lattices(&block)[0].estimate() as f64 / rows.len() as f64 - 1.0).abs() < 0.01);
        }
    }

    #[test]
    fn lattices_fill_round_and_sloping_bodies() {
        let cylinder = Shape::Cylinder { base: [0.0; 3], radius: 0.2, height: 0.103 };
        let wedge = Shape::Wedge { corner: [0.3, 0.0, 0.0], size: [0.4, 0.1, 0.3], falls_left: true };
        let cases = [
            (Space::PlaneStrain, Lattice::Hexagonal, &wedge),
            (Space::Axisymmetric, Lattice::Hexagonal, &cylinder),
            (Space::ThreeD, Lattice::Hexagonal, &cylinder),
            (Space::ThreeD, Lattice::Hexagonal, &wedge),
            (Space::ThreeD, Lattice::BodyCentred, &cylinder),
            (Space::ThreeD, Lattice::BodyCentred, &wedge),
        ];
        for (space, lattice, shape) in cases {
            for symmetry in [[false; 2], [space != Space::Axisymmetric, space == Space::ThreeD]] {
                let mut scene = scene(space, lattice, shape.clone());
                scene.symmetry = symmetry;
                let mass: f64 = fill::serial(&scene).mass.iter().sum();
                let off = mass / (2600.0 * fill::lattices(&scene)[0].solid.ideal_volume()) - 1.0;
                // As good as the cubic lattice: 0.8 % at 20 spacings a radius.
                assert!(off.abs() < 0.01, "{space:?} {lattice:?} {shape:?} {symmetry:?}: {off}");
            }
        }
    }

    #[test]
    fn kernels_add_up_to_one_inside() {
        for (space, lattice, ..) in KINDS {
            let mut scene = block(space, lattice);
            let rows = fill::serial(&scene);
            for kernel in formats::kernel::Kernel::ALL {
                (scene.kernel, scene.h_over_dx) = (kernel, kernel.default_h_over_dx());
                let (d, ratio) = (space.dimension(), scene.h_over_dx);
                let volume = SIZE.powi(d as i32) / rows.len() as f64;
                let reach = |x: f64| (2.0 * ratio * SPACING..(SIZE - 2.0 * ratio) * SPACING).contains(&x);
                let deep = |i: &usize| space.axes().iter().all(|&a| reach(rows.position[*i][a]));
                for i in (0..rows.len()).filter(deep) {
                    let others: f64 = offsets(&scene, &rows, i).iter().map(|d| kernel.shape(length(d) / ratio)).sum();
                    let sum = (others + kernel.shape(0.0)) * kernel.norm(d) * volume / ratio.powi(d as i32);
                    // Of the cubic lattice: 1.005 in three dimensions with the cubic spline.
                    assert!((sum - 1.0).abs() < 0.01, "{space:?} {lattice:?} {kernel:?} {sum}");
                }
            }
        }
    }

    #[test]
    fn particles_keep_off_faces_planes_of_symmetry_and_the_axis() {
        for (space, lattice, ..) in KINDS {
            for symmetry in [[false; 2], [true, false], [true; 2]] {
                let mut scene = block(space, lattice);
                if space != Space::Axisymmetric {
                    scene.symmetry = symmetry;
                }
                let nearest = |axis: usize| {
                    let places = fill::serial(&scene).position.into_iter().map(|x| x[axis] / SPACING);
                    places.fold([f64::INFINITY; 2], |[low, high], x| [low.min(x), high.min(SIZE - x)])
                };
                for &axis in space.axes() {
                    let pitch = Packing::new(&scene).pitch[axis] / SPACING;
                    let margin = Packing::new(&scene).margin(axis) * pitch;
                    for distance in nearest(axis) {
                        assert!((distance / margin - 1.0).abs() < 0.04, "{space:?} {lattice:?} {axis} {distance}");
                    }
                }
                if lattice == Lattice::BodyCentred || scene.symmetry[0] || space == Space::Axisymmetric {
                    assert!(nearest(0)[0] > 0.43, "half of the distance of close-packed planes");
                }
                // Nothing leaves the body or comes behind a wall, however disordered.
                scene.initial.jitter = 0.499;
                let least =
                    fill::serial(&scene).position.into_iter().flat_map(|x| space.axes().iter().map(move |&a| x[a]));
                assert!(least.fold(f64::INFINITY, f64::min) > 0.0);
            }
        }
    }
}
