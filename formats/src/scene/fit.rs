//! Do bodies and walls fit the lattice, the planes of symmetry, the periods, and each other?

use super::{
    Shape, WallKind,
    check::{AXES, Setting},
    geometry::{PlacedBody, PlacedWall, bounds},
    raw::Faults,
    release,
};
use crate::space::Space;

/// Lengths that differ by less than this fraction of the spacing are equal.
pub(super) const TOLERANCE: f64 = 1e-6;
/// Reach of the kernel in smoothing lengths: its support of 2h, and the skin of the lists of neighbours.
pub(super) const REACH: f64 = 2.2;
/// Points closer than this to a border, in spacings, lie on it and hold no particle.
const ON_THE_BORDER: f64 = 1e-9;
/// Lattice coordinates are kept in 21 bits with sign.
const MOST_CELLS_PER_AXIS: f64 = (1u64 << 20) as f64;
/// Largest number of lattice cells of all bodies together.
const MOST_CELLS: f64 = (1u64 << 40) as f64;

/// Is a length a whole number of spacings?
pub(super) fn is_whole(length: f64, spacing: f64) -> bool {
    let cells = length / spacing;
    // Of a far place, the last bits of a float are larger than the tolerance.
    (cells - cells.round()).abs() <= TOLERANCE.max(4.0 * f64::EPSILON * cells.abs())
}

/// What bodies and walls must fit.
pub(super) struct Fit<'a> {
    pub faults: &'a Faults<'a>,
    pub space: Space,
    pub spacing: f64,
    pub setting: &'a Setting<'a>,
}

impl Fit<'_> {
    fn is_symmetric(&self, axis: usize) -> bool {
        axis < 2 && self.setting.symmetry[axis]
    }

    fn is_whole(&self, length: f64) -> bool {
        is_whole(length, self.spacing)
    }

    /// What mirrors the material at 0 along an axis, in words.
    fn mirror_at_zero(&self, axis: usize) -> Option<String> {
        let axis_of_rings = axis == 0 && self.space == Space::Axisymmetric;
        let plane = || format!("the plane of symmetry {} = 0", AXES[axis]);
        if axis_of_rings { Some("the axis".into()) } else { self.is_symmetric(axis).then(plane) }
    }

    /// Checks the walls, and returns those without fault.
    pub fn walls<'w>(&self, walls: &[&'w PlacedWall]) -> Vec<&'w PlacedWall> {
        let alone = |wall: &PlacedWall| match self.wall_alone(wall) {
            Some(message) => {
                self.faults.at(&wall.at, message);
                false
            }
            None => true,
        };
        let mut right: Vec<&PlacedWall> = Vec::new();
        for &wall in walls {
            let mut fits = alone(wall);
            for other in right.iter().filter(|other| other.axis.value == wall.axis.value) {
                if other.side.value == wall.side.value {
                    let message = "is on the same axis and side as that of wall";
                    let advice = "only one of them can hold material";
                    self.faults.at(&wall.side, format!("{message} `{}`; {advice}", other.name));
                    fits = false;
                } else if let Some(message) = self.wall_facing(wall, other) {
                    self.faults.at(&wall.at, message);
                    fits = false;
                }
            }
            if fits {
                right.push(wall);
            }
        }
        right
    }

    fn wall_alone(&self, wall: &PlacedWall) -> Option<String> {
        let (axis, at, dx) = (wall.axis.value, wall.at.value, self.spacing);
        if axis == 0 && self.space == Space::Axisymmetric && at <= 0.0 {
            let message = "a wall normal to x is a cylinder in the space \"axisymmetric\"";
            return Some(format!("{message}: its radius must be greater than 0"));
        }
        if self.is_symmetric(axis) && at <= 0.0 {
            let message = "must be greater than 0: the material lies on the positive side of the plane of symmetry";
            return Some(format!("{message} {} = 0", AXES[axis]));
        }
        if self.is_symmetric(axis) && !self.is_whole(at) {
            let message = "must be a whole number of spacings from the plane of symmetry";
            return Some(format!("{message} {} = 0; it is {} of {dx} m", AXES[axis], at / dx));
        }
        if wall.kind == WallKind::Mirror
            && let Some(other) = self.mirror_at_zero(axis)
        {
            return self.too_near(at, &other);
        }
        None
    }

    /// A mirror must be out of reach of what else mirrors or holds the material: no particle may lie near both.
    fn too_near(&self, distance: f64, other: &str) -> Option<String> {
        let least = REACH * self.setting.h_over_dx * self.spacing;
        let message = format!("is {distance} m from {other}; a mirror wall must be at least 2.2 h = {least} m away");
        (distance < least - TOLERANCE * self.spacing).then_some(message)
    }

    fn wall_facing(&self, wall: &PlacedWall, other: &PlacedWall) -> Option<String> {
        let (name, dx) = (&other.name, self.spacing);
        let room = wall.side.value * (other.at.value - wall.at.value);
        if room <= 0.0 {
            let message = format!("leaves no room between this wall and wall `{name}`, which faces it");
            return Some(format!("{message}; the wall with side = \"above\" must be the lower one"));
        }
        if !self.is_whole(room) {
            let message = format!("must be a whole number of spacings from wall `{name}`, which faces it");
            return Some(format!("{message}; it is {} of {dx} m", room / dx));
        }
        if [wall.kind, other.kind].contains(&WallKind::Mirror) {
            return self.too_near(room, &format!("wall `{name}`, which faces it"));
        }
        None
    }

    pub fn bodies(&self, bodies: &[&PlacedBody], walls: &[&PlacedWall]) {
        let mut total = 0.0;
        for (i, placed) in bodies.iter().enumerate() {
            let fault = |message: String| self.faults.add(placed.offset, &placed.key, message);
            let shape = &placed.body.shape;
            let (mut low, high) = bounds(shape, self.space);
            let mut outside = false;
            for axis in (0..2).filter(|&axis| self.is_symmetric(axis)) {
                if high[axis] <= TOLERANCE * self.spacing {
                    let name = AXES[axis];
                    fault(format!(
                        "lies on the negative side of the plane of symmetry {name} = 0; nothing of it is kept"
                    ));
                    outside = true;
                }
                low[axis] = low[axis].max(0.0);
            }
            if outside {
                continue;
            }
            if let Some(reason) = self.emptiness(shape) {
                fault(reason);
                continue;
            }
            if let Some(terrain) = &self.setting.terrain
                && let Some(reason) = release::misfit(&placed.body, terrain, self.space, self.spacing, self.setting)
            {
                fault(reason);
                continue;
            }
            total += self.extent(low, high, walls, &fault);
            self.behind_walls(low, high, walls, &fault);
            self.out_of_periods(low, high, &fault);
            for other in bodies[..i].iter().filter(|other| self.overlap(shape, &other.body.shape)) {
                fault(format!("overlaps body `{}`; bodies may touch, but not overlap", other.body.name));
            }
        }
        if let (true, Some(last)) = (total >= MOST_CELLS, bodies.last()) {
            let message = format!("the bodies have {total:.3e} lattice cells, with spacing {} m", self.spacing);
            self.faults.add(last.offset, &last.key, format!("{message}; there must be fewer than 2^40"));
        }
    }

    /// Number of lattice cells within bounds; a fault where they are too far from the origin of the lattice.
    fn extent(&self, low: [f64; 3], high: [f64; 3], walls: &[&PlacedWall], fault: &dyn Fn(String)) -> f64 {
        let mut cells = 1.0;
        for &axis in self.space.axes() {
            let wall = walls.iter().find(|wall| wall.axis.value == axis && !self.is_symmetric(axis));
            let origin = wall.map_or(0.0, |wall| wall.at.value);
            let furthest = (low[axis] - origin).abs().max((high[axis] - origin).abs()) / self.spacing;
            if furthest >= MOST_CELLS_PER_AXIS {
                let message =
                    format!("reaches {furthest:.3e} spacings from the origin of the lattice along {}", AXES[axis]);
                fault(format!("{message}; it must be fewer than 2^20"));
            }
            cells *= ((high[axis] - low[axis]) / self.spacing).round().max(1.0);
        }
        cells
    }

    fn behind_walls(&self, low: [f64; 3], high: [f64; 3], walls: &[&PlacedWall], fault: &dyn Fn(String)) {
        for wall in walls {
            let (axis, at) = (wall.axis.value, wall.at.value);
            let nearest = if wall.side.value > 0.0 { low[axis] } else { high[axis] };
            let depth = wall.side.value * (at - nearest);
            if depth > TOLERANCE * self.spacing {
                let (name, plane) = (&wall.name, format!("{} = {at} m", AXES[axis]));
                fault(format!("reaches {depth} m behind wall `{name}`, the plane {plane}; it must end there"));
            }
        }
    }

    fn out_of_periods(&self, low: [f64; 3], high: [f64; 3], fault: &dyn Fn(String)) {
        for (axis, period) in self.setting.periodic.iter().enumerate() {
            let Some([from, to]) = *period else { continue };
            let slack = TOLERANCE * self.spacing;
            if low[axis] < from - slack || high[axis] > to + slack {
                let (name, low, high) = (AXES[axis], low[axis], high[axis]);
                let message = format!("reaches from {low} m to {high} m along {name}, out of the period");
                fault(format!("{message}; it must lie within {from} m and {to} m"));
            }
        }
    }

    /// Why a shape holds no particle, if it holds none.
    fn emptiness(&self, shape: &Shape) -> Option<String> {
        let dx = self.spacing;
        if let Shape::Release(release) = shape {
            return release.emptiness(self.space, dx);
        }
        let (low, high) = bounds(shape, self.space);
        let is_round = |axis: usize| axis < 2 && matches!(shape, Shape::Cylinder { .. });
        for &axis in self.space.axes().iter().filter(|&&axis| !is_round(axis)) {
            let size = high[axis] - low[axis];
            if (size / dx).round() < 1.0 {
                let name = AXES[axis];
                let message =
                    format!("holds no particle: its size along {name} is {size} m, less than half the spacing");
                return Some(format!("{message} of {dx} m"));
            }
        }
        // The lattice point, counted in half cells from the shape's thick part, that lies deepest in the shape among
        // those on the positive side of the planes of symmetry.
        let first = |axis: usize, start: f64| {
            let cells = if self.is_symmetric(axis) { (ON_THE_BORDER - start / dx - 0.5).floor() + 1.0 } else { 0.0 };
            cells.max(0.0) + 0.5
        };
        let last_is_kept = |axis: usize| {
            let cells = ((high[axis] - low[axis]) / dx).round();
            !self.is_symmetric(axis) || low[axis] / dx + cells - 0.5 > ON_THE_BORDER
        };
        let (holds, size) = match *shape {
            Shape::Cylinder { radius, .. } if self.space == Space::Axisymmetric => {
                (0.5 < radius / dx - ON_THE_BORDER, format!("radius {radius} m"))
            }
            Shape::Cylinder { base, radius, .. } => {
                let distance = first(0, base[0]).hypot(first(1, base[1]));
                (distance < radius / dx - ON_THE_BORDER, format!("radius {radius} m"))
            }
            Shape::Box { .. } => {
                (last_is_kept(0) && last_is_kept(1), format!("size {} m x {} m", high[0] - low[0], high[2] - low[2]))
            }
            // Looked at above.
            Shape::Release(_) => (true, String::new()),
            Shape::Wedge { corner, size, falls_left } => {
                let column = if falls_left { 0.5 } else { first(0, corner[0]) };
                let kept = !falls_left || !self.is_symmetric(0) || corner[0] / dx - 0.5 > ON_THE_BORDER;
                let under_slope = size[2] / dx * (1.0 - column * dx / size[0]) - 0.5 > ON_THE_BORDER;
                (kept && under_slope && last_is_kept(1), format!("size {} m x {} m", size[0], size[2]))
            }
        };
        let kept =
            if self.setting.symmetry.contains(&true) { " on the positive side of the planes of symmetry" } else { "" };
        (!holds).then(|| format!("holds no particle{kept}: {size} is too small for the spacing of {dx} m"))
    }

    /// Do two shapes share a volume? Exact, because no shape grows with height: they do where they share a span of
    /// heights and, at its foot, their horizontal sections share an area.
    fn overlap(&self, a: &Shape, b: &Shape) -> bool {
        if [a, b].iter().any(|shape| matches!(shape, Shape::Release(_))) {
            return release::overlap(a, b, self.space, self.spacing);
        }
        let tolerance = TOLERANCE * self.spacing;
        let ((low_a, high_a), (low_b, high_b)) = (bounds(a, self.space), bounds(b, self.space));
        let foot = low_a[2].max(low_b[2]);
        if high_a[2].min(high_b[2]) - foot <= tolerance {
            return false;
        }
        match (section(a, self.space, foot), section(b, self.space, foot)) {
            (Section::Disc { centre: p, radius: r }, Section::Disc { centre: q, radius: s }) => {
                (p[0] - q[0]).hypot(p[1] - q[1]) < r + s - tolerance
            }
            (Section::Disc { centre, radius }, Section::Rectangle { low, high })
            | (Section::Rectangle { low, high }, Section::Disc { centre, radius }) => {
                let apart = |axis: usize| centre[axis] - centre[axis].clamp(low[axis], high[axis]);
                apart(0).hypot(apart(1)) < radius - tolerance
            }
            (Section::Rectangle { low: l, high: h }, Section::Rectangle { low: m, high: n }) => {
                let shared = |axis: usize| h[axis].min(n[axis]) - l[axis].max(m[axis]);
                shared(0) > tolerance && (self.space != Space::ThreeD || shared(1) > tolerance)
            }
        }
    }
}

/// A horizontal section of a shape.
enum Section {
    Disc { centre: [f64; 2], radius: f64 },
    Rectangle { low: [f64; 2], high: [f64; 2] },
}

fn section(shape: &Shape, space: Space, z: f64) -> Section {
    let (low, high) = bounds(shape, space);
    let (mut low, mut high) = ([low[0], low[1]], [high[0], high[1]]);
    match *shape {
        Shape::Cylinder { base, radius, .. } if space == Space::ThreeD => {
            return Section::Disc { centre: [base[0], base[1]], radius };
        }
        Shape::Cylinder { .. } | Shape::Box { .. } | Shape::Release(_) => {}
        Shape::Wedge { corner, size, falls_left } => {
            let length = size[0] * (1.0 - (z - corner[2]) / size[2]);
            if falls_left {
                low[0] = corner[0] - length;
            } else {
                high[0] = corner[0] + length;
            }
        }
    }
    Section::Rectangle { low, high }
}
