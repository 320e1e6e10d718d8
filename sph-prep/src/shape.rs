//! The shape of a body in its space: borders, surface, volume.

use formats::{
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
}

impl Solid {
    /// Body number `body` of a scene.
    pub fn new(scene: &Scene, body: usize) -> Self {
        Self { shape: scene.bodies[body].shape.clone(), space: scene.space, symmetry: scene.symmetry }
    }

    /// A point of the foot, m, that the shape is described from: the centre of a cylinder, the corner of the others.
    pub fn anchor(&self) -> [f64; 3] {
        match self.shape {
            Shape::Cylinder { base: [_, _, z], .. } if self.space == Space::Axisymmetric => [0.0, 0.0, z],
            Shape::Cylinder { base, .. } => base,
            Shape::Box { min, .. } => min,
            Shape::Wedge { corner, .. } => corner,
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
        let stands = match self.shape {
            Shape::Cylinder { base, radius, .. } if three => (x - base[0]).hypot(y - base[1]) < radius,
            Shape::Cylinder { radius, .. } => x < radius,
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
            Shape::Box { min, max } => max[2] - min[2],
            Shape::Wedge { size, .. } => size[2],
        }
    }
}
