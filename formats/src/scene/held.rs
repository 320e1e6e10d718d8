//! Can the material only settle, or can it flow? Damping is for settling alone.

use super::{
    Body, Shape, Wall,
    check::{AXES, Setting},
    fit::TOLERANCE,
    geometry::bounds,
};
use crate::space::Space;

/// What lets the material flow, in words; None where it is held on every side and nothing drives it along.
pub(super) fn what_flows(bodies: &[Body], walls: &[Wall], setting: &Setting<'_>) -> Option<String> {
    let (space, dx, gravity) = (setting.space?, setting.spacing?, setting.gravity?);
    if walls.iter().any(|wall| wall.velocity != [0.0; 3]) {
        return Some("a wall moves".into());
    }
    for axis in (0..3).filter(|&axis| setting.periodic[axis].is_some()) {
        let name = AXES[axis];
        if gravity[axis] != 0.0 {
            return Some(format!("gravity acts along {name}, where nothing stops it"));
        }
        if let Some(body) = bodies.iter().find(|body| body.velocity[axis] != 0.0) {
            return Some(format!("body `{}` moves along {name}, where nothing stops it", body.name));
        }
    }
    let room = Room { bodies, walls, setting, space, gap: dx * (1.0 + TOLERANCE) };
    bodies.iter().enumerate().find_map(|(number, body)| {
        if !has_flat_sides(&body.shape, space) {
            return Some(format!("body `{}` has a free side", body.name));
        }
        let mut sides: Vec<_> = space.axes().iter().filter(|&&a| a != 2).flat_map(|&a| [(a, -1.0), (a, 1.0)]).collect();
        if gravity[2] != 0.0 {
            sides.push((2, gravity[2].signum()));
        }
        let free = sides.into_iter().find(|&(axis, side)| !room.holds(number, axis, side))?;
        let which = if free.1 > 0.0 { "upper" } else { "lower" };
        Some(format!("nothing holds body `{}` at its {which} end along {}", body.name, AXES[free.0]))
    })
}

/// Has it no slope, and no round side? Those touch no plane wall.
fn has_flat_sides(shape: &Shape, space: Space) -> bool {
    match shape {
        Shape::Box { .. } => true,
        Shape::Cylinder { .. } => space == Space::Axisymmetric,
        Shape::Wedge { .. } | Shape::Release(_) => false,
    }
}

/// What can hold a body.
struct Room<'a> {
    bodies: &'a [Body],
    walls: &'a [Wall],
    setting: &'a Setting<'a>,
    space: Space,
    /// Widest gap between things that touch: sizes are rounded to spacings, so that a full container may lack one.
    gap: f64,
}

impl Room<'_> {
    /// Is the whole lower (`side` -1) or upper (+1) face of a body at a wall, a plane of symmetry, the axis, or other
    /// bodies?
    fn holds(&self, number: usize, axis: usize, side: f64) -> bool {
        let (low, high) = self.bounds(&self.bodies[number]);
        let face = if side > 0.0 { high[axis] } else { low[axis] };
        let by_wall = self.walls.iter().any(|w| w.axis == axis && w.side == -side && side * (w.at - face) <= self.gap);
        by_wall || (side < 0.0 && self.is_mirrored(axis) && face <= self.gap) || self.covered(number, axis, side) >= 1.0
    }

    /// The share of a face that other bodies touch, or the copies of all of them one period away.
    fn covered(&self, number: usize, axis: usize, side: f64) -> f64 {
        let (low, high) = self.bounds(&self.bodies[number]);
        let face = if side > 0.0 { high[axis] } else { low[axis] };
        let period = self.setting.periodic[axis].map_or(0.0, |[from, to]| to - from);
        let mut covered = 0.0;
        for (other, body) in self.bodies.iter().enumerate().filter(|(_, body)| has_flat_sides(&body.shape, self.space))
        {
            let (l, h) = self.bounds(body);
            let opposite = if side > 0.0 { l[axis] } else { h[axis] };
            let touches = |shift: f64| (opposite + side * shift - face).abs() <= self.gap;
            if !((other != number && touches(0.0)) || (period > 0.0 && touches(period))) {
                continue;
            }
            let share = |&a: &usize| {
                let shared = h[a].min(high[a]) - l[a].max(low[a]);
                if shared > 0.0 { ((shared + self.gap) / (high[a] - low[a])).min(1.0) } else { 0.0 }
            };
            covered += self.space.axes().iter().filter(|&&a| a != axis).map(share).product::<f64>();
        }
        covered
    }

    fn is_mirrored(&self, axis: usize) -> bool {
        axis < 2 && self.setting.symmetry[axis] || axis == 0 && self.space == Space::Axisymmetric
    }

    /// The box around the part of a body on the positive side of the planes of symmetry.
    fn bounds(&self, body: &Body) -> ([f64; 3], [f64; 3]) {
        let (mut low, high) = bounds(&body.shape, self.space);
        for axis in (0..2).filter(|&axis| self.setting.symmetry[axis]) {
            low[axis] = low[axis].max(0.0);
        }
        (low, high)
    }
}
