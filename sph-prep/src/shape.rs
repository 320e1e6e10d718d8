//! The shape of a body in its space: borders, surface, volume.

use formats::{
    raster::Grid,
    scene::{Scene, Shape},
    space::Space,
};
use std::f64::consts::PI;

/// The shape of one body, and what of it is modelled.
#[derive(Clone, Debug)]
pub struct Solid {
    /// The shape.
    pub shape: Shape,
    /// The space it lies in.
    pub space: Space,
    /// Is only the positive side of x = 0, y = 0 filled?
    pub symmetry: [bool; 2],
    /// Lattice spacing, m.
    pub spacing: f64,
}

impl Solid {
    /// Body number `body` of a scene.
    pub fn new(scene: &Scene, body: usize) -> Self {
        let shape = scene.bodies[body].shape.clone();
        Self { shape, space: scene.space, symmetry: scene.symmetry, spacing: scene.spacing }
    }

    /// A point of the foot, m, that the shape is described from: the centre of a cylinder, the corner of the others.
    pub fn anchor(&self) -> [f64; 3] {
        match self.shape {
            Shape::Cylinder { base: [_, _, z], .. } if self.space == Space::Axisymmetric => [0.0, 0.0, z],
            Shape::Cylinder { base, .. } => base,
            Shape::Box { min, .. } => min,
            Shape::Wedge { corner, .. } => corner,
            Shape::Release(ref release) => release.bounds(self.space).0,
        }
    }

    /// The body's surface at a place, m above z = 0.
    pub fn top(&self, x: f64) -> f64 {
        match self.shape {
            Shape::Wedge { size, .. } => {
                self.anchor()[2] + size[2] * (1.0 - (x - self.anchor()[0]).abs() / size[0]).max(0.0)
            }
            _ => self.anchor()[2] + self.height(),
        }
    }

    /// Lower and upper surface of the body above a place of its foot, m above z = 0; none where it does not stand.
    pub fn vertical_extent(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let three = self.space == Space::ThreeD;
        let across = |low: f64, high: f64| !three || (low..high).contains(&y);
        if let Shape::Release(release) = &self.shape {
            let (ground, depth) = (release.ground.at(x, y), release.thickness(x, y));
            return (depth > 0.0).then_some((ground, ground + depth));
        }
        let stands = match self.shape {
            Shape::Cylinder { base, radius, .. } if three => (x - base[0]).hypot(y - base[1]) < radius,
            Shape::Cylinder { radius, .. } => x < radius,
            Shape::Release(_) => false,
            Shape::Box { min, max } => (min[0]..max[0]).contains(&x) && across(min[1], max[1]),
            Shape::Wedge { corner, size, falls_left } => {
                let along = if falls_left { corner[0] - x } else { x - corner[0] };
                (0.0..size[0]).contains(&along) && across(corner[1], corner[1] + size[1])
            }
        };
        stands.then(|| (self.anchor()[2], self.top(x)))
    }

    /// Lower and upper corner of the box around the shape, the part on the positive side of the planes of symmetry, m.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let (mut low, mut high) = match self.shape {
            Shape::Cylinder { base: [x, y, z], radius, height } => {
                ([x - radius, y - radius, z], [x + radius, y + radius, z + height])
            }
            Shape::Box { min, max } => (min, max),
            Shape::Release(ref release) => release.bounds(self.space),
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

    /// The ground, of what lies on a terrain.
    pub fn ground(&self) -> Option<&Grid> {
        match &self.shape {
            Shape::Release(release) => Some(&release.ground),
            _ => None,
        }
    }

    /// Faces, planes of symmetry and the axis included: those across x (the round face too), across y, across z (the
    /// slope of a wedge too).
    pub fn faces(&self) -> Vec<Vec<Face>> {
        let (low, high) = self.bounds();
        let plane = |axis: usize, inward: f64| {
            let mut normal = [0.0; 3];
            normal[axis] = inward;
            Face::Plane { point: if inward > 0.0 { low } else { high }, normal }
        };
        let mut faces = vec![Vec::new(); 3];
        for &axis in self.space.axes() {
            faces[axis] = vec![plane(axis, 1.0), plane(axis, -1.0)];
        }
        match self.shape {
            Shape::Cylinder { base, radius, .. } if self.space == Space::ThreeD => {
                for axis in 0..2 {
                    let cut = self.symmetry[axis] && low[axis] <= 0.0;
                    faces[axis] = if cut { vec![plane(axis, 1.0)] } else { Vec::new() };
                }
                faces[0].push(Face::Round { axis: [base[0], base[1]], radius });
            }
            Shape::Wedge { corner, size, falls_left } => {
                let along = if falls_left { 1.0 } else { -1.0 };
                let length = size[0].hypot(size[2]);
                let normal = [along * size[2] / length, 0.0, -size[0] / length];
                let crest = [corner[0], corner[1], corner[2] + size[2]];
                faces[2] = vec![plane(2, 1.0), Face::Plane { point: crest, normal }];
                let cut = self.symmetry[0] && low[0] <= 0.0;
                // The tip is no face.
                faces[0].retain(|face| {
                    let Face::Plane { normal, .. } = face else { return true };
                    normal[0] == -along || (cut && normal[0] > 0.0)
                });
            }
            _ => {}
        }
        faces
    }

    /// Volume of the shape itself, the part on the positive side of the planes of symmetry; same units as
    /// [`Lattice::volume`](crate::lattice::Lattice::volume).
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
            Shape::Release(ref release) => release.volume(self.space, self.symmetry, self.spacing),
            Shape::Wedge { corner, size, falls_left } => {
                let far = if falls_left { corner[0] - size[0] } else { corner[0] + size[0] };
                let (low, high) = clip(0, corner[0].min(far), corner[0].max(far));
                let mean = 0.5 * (self.top(low) + self.top(high)) - corner[2];
                (high - low) * mean * width(corner[1], corner[1] + size[1])
            }
        }
    }

    /// Height of the shape where it is highest, m.
    pub fn height(&self) -> f64 {
        match self.shape {
            Shape::Cylinder { height, .. } => height,
            Shape::Release(_) => {
                let (low, high) = self.bounds();
                high[2] - low[2]
            }
            Shape::Box { min, max } => max[2] - min[2],
            Shape::Wedge { size, .. } => size[2],
        }
    }
}

/// A face of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Face {
    /// A plane.
    Plane {
        /// A point of it, m.
        point: [f64; 3],
        /// Unit normal into the solid.
        normal: [f64; 3],
    },
    /// The side of an upright cylinder.
    Round {
        /// Where its axis stands, m.
        axis: [f64; 2],
        /// Its radius, m.
        radius: f64,
    },
}

impl Face {
    /// How far inside of this face a point lies, m.
    pub fn depth(&self, x: [f64; 3]) -> f64 {
        match self {
            Self::Plane { point, normal } => (0..3).map(|axis| (x[axis] - point[axis]) * normal[axis]).sum(),
            Self::Round { axis, radius } => radius - (x[0] - axis[0]).hypot(x[1] - axis[1]),
        }
    }

    /// The mirror image of a point, and the volume there over that at the point: images in a round face spread out.
    pub fn image(&self, x: [f64; 3]) -> ([f64; 3], f64) {
        let weight = match self {
            Self::Plane { .. } => 1.0,
            // On the axis itself there is no direction; its image is far away.
            Self::Round { radius, .. } => {
                let from_axis = radius - self.depth(x);
                if from_axis > 0.0 { (radius + self.depth(x)) / from_axis } else { 0.0 }
            }
        };
        (self.moved(x, -2.0 * self.depth(x)), weight)
    }

    /// The point, moved inwards where it is closer to the face than `least`.
    pub fn pushed_to(&self, x: [f64; 3], least: f64) -> [f64; 3] {
        let depth = self.depth(x);
        if depth < least { self.moved(x, least - depth) } else { x }
    }

    /// The point, moved inwards along the normal.
    fn moved(&self, x: [f64; 3], way: f64) -> [f64; 3] {
        match self {
            Self::Plane { normal, .. } => [0, 1, 2].map(|axis| x[axis] + way * normal[axis]),
            Self::Round { axis, .. } => {
                let (u, v) = (x[0] - axis[0], x[1] - axis[1]);
                let scale = 1.0 - way / u.hypot(v).max(f64::MIN_POSITIVE);
                [axis[0] + scale * u, axis[1] + scale * v, x[2]]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scene;

    fn faces(space: Space, symmetry: [bool; 2], shape: Shape) -> Vec<Face> {
        let mut scene = scene(space, 0.01, shape);
        scene.symmetry = symmetry;
        Solid::new(&scene, 0).faces().concat()
    }

    #[test]
    fn faces_bound_their_solid() {
        let block = Shape::Box { min: [-0.1; 3], max: [0.2, 0.3, 0.4] };
        let cylinder = Shape::Cylinder { base: [0.1, 0.2, 0.3], radius: 0.5, height: 0.6 };
        let wedge = |falls_left| Shape::Wedge { corner: [0.1, 0.2, 0.3], size: [0.8, 0.5, 0.6], falls_left };
        // Number of faces, a point, and how far it lies inside of the nearest.
        let cases = [
            (Space::ThreeD, [false; 2], block.clone(), 6, [0.0, 0.0, 0.35], 0.05),
            (Space::ThreeD, [true; 2], block.clone(), 6, [0.03, 0.1, 0.1], 0.03),
            (Space::PlaneStrain, [false; 2], block, 4, [0.0, 0.0, 0.35], 0.05),
            (Space::ThreeD, [false; 2], cylinder.clone(), 3, [0.4, 0.6, 0.6], 0.0),
            (Space::ThreeD, [true, false], cylinder.clone(), 4, [0.02, 0.2, 0.6], 0.02),
            (Space::Axisymmetric, [false; 2], cylinder, 4, [0.03, 0.0, 0.6], 0.03),
            // Half-way down the slope of 3 in 4, below it by 0.1.
            (Space::ThreeD, [false; 2], wedge(false), 5, [0.5, 0.45, 0.5], 0.08),
            (Space::ThreeD, [false; 2], wedge(true), 5, [-0.3, 0.45, 0.5], 0.08),
            (Space::PlaneStrain, [true, false], wedge(true), 4, [0.01, 0.0, 0.5], 0.01),
        ];
        for (space, symmetry, shape, count, x, depth) in cases {
            let faces = faces(space, symmetry, shape.clone());
            assert_eq!(faces.len(), count, "{shape:?}");
            let nearest = faces.iter().map(|face| face.depth(x)).fold(f64::INFINITY, f64::min);
            assert!((nearest - depth).abs() < 1e-12, "{shape:?} {nearest}");
        }
    }

    #[test]
    fn images_lie_as_far_behind_as_their_particles_before() {
        let round = Face::Round { axis: [1.0, 2.0], radius: 0.5 };
        let slope = Face::Plane { point: [0.0, 0.0, 1.0], normal: [-0.6, 0.0, -0.8] };
        for face in [round, slope] {
            let x = [1.12, 2.16, -2.0];
            let depth = face.depth(x);
            let (image, weight) = face.image(x);
            assert!(depth > 0.0 && (face.depth(image) + depth).abs() < 1e-12, "{image:?}");
            assert!((face.image(image).0[0] - x[0]).abs() < 1e-12);
            // At 0.2 from the axis: the image is at 0.8, where rings are four times as long.
            assert!((weight - if face == round { 4.0 } else { 1.0 }).abs() < 1e-12);
            assert_eq!(face.pushed_to(x, 0.5 * depth), x);
            assert!((face.depth(face.pushed_to(x, 1.5 * depth)) - 1.5 * depth).abs() < 1e-12);
        }
        assert_eq!(round.image([1.0, 2.0, 0.0]).1, 0.0);
    }
}
