//! Bodies and walls of a scene: reads them, and checks that they fit the space, the lattice, the planes of symmetry
//! and each other.

use super::{
    Body, Shape, Slip, Wall, WallKind,
    check::{AXES, Setting},
    raw::{Faults, Found, POSITIVE, Table, values},
};
use crate::{space::Space, units::Dimension};

/// Lengths that differ by less than this fraction of the spacing are equal.
const TOLERANCE: f64 = 1e-6;
/// Points closer than this to a border, in spacings, lie on it and hold no particle.
const ON_THE_BORDER: f64 = 1e-9;
/// Lattice coordinates are kept in 21 bits with sign.
const MOST_CELLS_PER_AXIS: f64 = (1u64 << 20) as f64;
/// Largest number of lattice cells of all bodies together.
const MOST_CELLS: f64 = (1u64 << 40) as f64;

/// A body and the place of its shape in the file.
struct PlacedBody {
    body: Body,
    offset: usize,
    key: String,
}

/// A wall and what was read for it.
struct PlacedWall {
    name: String,
    axis: Found<usize>,
    at: Found<f64>,
    side: Found<f64>,
    slip: Found<Slip>,
    kind: WallKind,
    velocity: [f64; 3],
}

/// All bodies and all walls; None where one has a fault.
pub(super) fn read(root: &Table<'_>, setting: &Setting) -> (Option<Vec<Body>>, Option<Vec<Wall>>) {
    let faults = root.faults;
    let tables = root.named("body");
    if tables.is_empty() && !root.has("body") {
        faults.structure(0, "body", "missing; at least one body is needed, e.g. [body.column]");
    } else if tables.is_empty() {
        faults.structure(root.child("body").offset, "body", "at least one body is needed, e.g. [body.column]");
    }
    let bodies: Vec<_> = tables.into_iter().map(|(name, table)| body(name, table, setting)).collect();
    let walls: Vec<_> = root.named("wall").into_iter().map(|(name, table)| wall(name, table, setting)).collect();

    let known_bodies: Vec<_> = bodies.iter().flatten().collect();
    let known_walls: Vec<_> = walls.iter().flatten().collect();
    // With the space or the spacing unknown, or lines lost, nothing certain can be said about places.
    if let (Some(space), Some(spacing), false) = (setting.space, setting.spacing, faults.broken()) {
        let fit = Fit { faults, space, spacing, symmetry: setting.symmetry };
        let right_walls = fit.walls(&known_walls);
        fit.bodies(&known_bodies, &right_walls);
    }
    let walls = walls.iter().map(|wall| {
        let PlacedWall { axis, at, side, slip, kind, velocity, .. } = wall.as_ref()?;
        let (kind, velocity) = (*kind, *velocity);
        Some(Wall { axis: axis.value, at: at.value, side: side.value, slip: slip.value, kind, velocity })
    });
    let walls = walls.collect();
    (bodies.into_iter().map(|placed| placed.map(|placed| placed.body)).collect(), walls)
}

fn body(name: String, table: Table<'_>, setting: &Setting) -> Option<PlacedBody> {
    let faults = table.faults;
    let given: Vec<_> = ["cylinder", "box", "wedge"].into_iter().filter(|key| table.has(key)).collect();
    match given.as_slice() {
        [] => {
            let message = "has no shape; one of cylinder, box, wedge is needed";
            faults.structure(table.offset, &table.path, message);
        }
        [_] => {}
        [_, second, ..] => {
            let message = format!("has several shapes ({}); exactly one is needed", given.join(", "));
            faults.structure(table.child_offset(second), &table.path, message);
        }
    }
    let (cylinder, block, wedge) = (table.child("cylinder"), table.child("box"), table.child("wedge"));
    let offset = cylinder.offset.max(block.offset).max(wedge.offset);
    let key = given.first().map_or(table.path.clone(), |key| table.path_of(key));
    let shapes = [cylinder_shape(cylinder, setting), box_shape(block, setting), wedge_shape(wedge, setting)];

    let velocity = table.vector("velocity", Dimension::Velocity);
    if let (Some([_, y, _]), Some(space @ (Space::PlaneStrain | Space::Axisymmetric))) = (&velocity, setting.space)
        && y.value != 0.0
    {
        faults.at(y, format!("velocity along y must be 0 in the space \"{}\"", space.name()));
    }
    table.finish();
    let shape = shapes.into_iter().flatten().next()?;
    let velocity = velocity.as_ref().map_or([0.0; 3], values);
    Some(PlacedBody { body: Body { name, shape, velocity }, offset, key })
}

fn cylinder_shape(table: Table<'_>, setting: &Setting) -> Option<Shape> {
    if !table.is_there() {
        return None;
    }
    let radius = table.needed("radius", Dimension::Length, &POSITIVE);
    let height = table.needed("height", Dimension::Length, &POSITIVE);
    let base = table.vector("base", Dimension::Length);
    let mut right = true;
    match (setting.space, &base) {
        (Some(Space::PlaneStrain), _) => {
            let message = "there are no cylinders in the space \"plane-strain\"; use a box or a wedge";
            table.faults.add(table.offset, &table.path, message);
            right = false;
        }
        (Some(Space::Axisymmetric), Some([x, y, _])) => {
            if let Some(off) = [x, y].into_iter().find(|component| component.value != 0.0) {
                let message = "must lie on the axis in the space \"axisymmetric\": x and y of the base must be 0";
                table.faults.at(off, message);
                right = false;
            }
        }
        _ => {}
    }
    table.finish();
    let base = base.as_ref().map_or([0.0; 3], values);
    let shape = Shape::Cylinder { base, radius: radius?.value, height: height?.value };
    right.then_some(shape)
}

fn box_shape(table: Table<'_>, setting: &Setting) -> Option<Shape> {
    if !table.is_there() {
        return None;
    }
    let min = table.needed_vector("min", Dimension::Length);
    let max = table.needed_vector("max", Dimension::Length);
    let mut right = true;
    if let (Some(min), Some(max), Some(space)) = (&min, &max, setting.space) {
        for &axis in space.axes() {
            if max[axis].value <= min[axis].value {
                let (name, low) = (AXES[axis], min[axis].value);
                table.faults.at(&max[axis], format!("the upper corner's {name} must be greater than min's, {low} m"));
                right = false;
            }
        }
        if space == Space::Axisymmetric && min[0].value < 0.0 {
            let message = "x is the radius in the space \"axisymmetric\": it must be 0 or greater";
            table.faults.at(&min[0], message);
            right = false;
        }
    }
    table.finish();
    let flat = |corner: [f64; 3]| if is_3d(setting) { corner } else { [corner[0], 0.0, corner[2]] };
    let shape = Shape::Box { min: flat(values(&min?)), max: flat(values(&max?)) };
    right.then_some(shape)
}

fn wedge_shape(table: Table<'_>, setting: &Setting) -> Option<Shape> {
    if !table.is_there() {
        return None;
    }
    let corner = table.needed_vector("corner", Dimension::Length);
    let size = table.needed_vector("size", Dimension::Length);
    let falls = table.needed_choice("falls", &[("right", false), ("left", true)]);
    let mut right = true;
    if setting.space == Some(Space::Axisymmetric) {
        let message = "there are no wedges in the space \"axisymmetric\"; use a cylinder or a box";
        table.faults.add(table.offset, &table.path, message);
        right = false;
    } else if let (Some(size), Some(space)) = (&size, setting.space) {
        for &axis in space.axes() {
            if size[axis].value <= 0.0 {
                table.faults.at(&size[axis], format!("the size along {} must be greater than 0", AXES[axis]));
                right = false;
            }
        }
    }
    table.finish();
    let flat = |v: [f64; 3]| if is_3d(setting) { v } else { [v[0], 0.0, v[2]] };
    let shape = Shape::Wedge { corner: flat(values(&corner?)), size: flat(values(&size?)), falls_left: falls?.value };
    right.then_some(shape)
}

fn is_3d(setting: &Setting) -> bool {
    setting.space == Some(Space::ThreeD)
}

fn wall(name: String, table: Table<'_>, setting: &Setting) -> Option<PlacedWall> {
    let axis = table.needed_choice("axis", &[("x", 0), ("y", 1), ("z", 2)]);
    let at = table.needed("at", Dimension::Length, &super::raw::ANY);
    let side = table.needed_choice("side", &[("above", 1.0), ("below", -1.0)]);
    let slip = table.needed_choice("slip", &[("no-slip", Slip::NoSlip), ("free-slip", Slip::FreeSlip)]);
    let mut right = true;
    if let (Some(axis), Some(space)) = (&axis, setting.space)
        && !space.axes().contains(&axis.value)
    {
        let message = format!("there are no walls normal to y in the space \"{}\"; valid: \"x\", \"z\"", space.name());
        table.faults.at(axis, message);
        right = false;
    }
    let kind = table.choice("kind", &[("virtual", WallKind::Virtual), ("mirror", WallKind::Mirror)]);
    let velocity = table.vector("velocity", Dimension::Velocity);
    if let (Some(velocity), Some(axis)) = (&velocity, &axis) {
        let still = |a: usize| match setting.space {
            Some(Space::Axisymmetric) => a != 2,
            Some(Space::PlaneStrain) => a == 1,
            _ => false,
        };
        for a in (0..3).filter(|&a| (a == axis.value || still(a)) && velocity[a].value != 0.0) {
            faults_of_motion(&table, &velocity[a], a, axis.value);
            right = false;
        }
        if slip.as_ref().is_some_and(|slip| slip.value == Slip::FreeSlip) && velocity.iter().any(|v| v.value != 0.0) {
            table
                .faults
                .at(&velocity[0], "a free-slip wall moves nothing; set slip = \"no-slip\", or drop the velocity");
            right = false;
        }
    }
    table.finish();
    let velocity = velocity.as_ref().map_or([0.0; 3], values);
    let kind = kind.map_or(WallKind::Virtual, |found| found.value);
    let wall = PlacedWall { name, axis: axis?, at: at?, side: side?, slip: slip?, kind, velocity };
    right.then_some(wall)
}

fn faults_of_motion(table: &Table<'_>, component: &Found<f64>, along: usize, normal: usize) {
    let name = AXES[along];
    let message = match along == normal {
        true => format!("a wall normal to {name} slides along itself: its velocity along {name} must be 0"),
        false => format!("the velocity of this wall along {name} must be 0 in this space"),
    };
    table.faults.at(component, message);
}

/// Is the material held on every side: by a wall, a plane of symmetry, the axis, or a period, at most a spacing away?
pub(super) fn held(bodies: &Option<Vec<Body>>, walls: &Option<Vec<Wall>>, setting: &Setting) -> bool {
    let (Some(bodies), Some(walls), Some(space), Some(dx)) = (bodies, walls, setting.space, setting.spacing) else {
        // Other faults come first.
        return true;
    };
    space.axes().iter().filter(|&&axis| axis != 2).all(|&axis| {
        let low = bodies.iter().map(|body| bounds(&body.shape, space).0[axis]).fold(f64::INFINITY, f64::min);
        let high = bodies.iter().map(|body| bounds(&body.shape, space).1[axis]).fold(f64::NEG_INFINITY, f64::max);
        let wall = |side: f64, end: f64| {
            walls.iter().any(|wall| wall.axis == axis && wall.side == side && side * (end - wall.at) <= dx)
        };
        let mirrored = (axis == 0 && space == Space::Axisymmetric) || (axis < 2 && setting.symmetry[axis]);
        let period = setting.periodic[axis].is_some();
        period || ((wall(1.0, low) || (mirrored && low <= dx)) && wall(-1.0, high))
    })
}

/// What bodies and walls must fit.
struct Fit<'a> {
    faults: &'a Faults<'a>,
    space: Space,
    spacing: f64,
    symmetry: [bool; 2],
}

impl Fit<'_> {
    fn is_symmetric(&self, axis: usize) -> bool {
        axis < 2 && self.symmetry[axis]
    }

    fn is_whole(&self, length: f64) -> bool {
        let cells = length / self.spacing;
        // Of a far place, the last bits of a float are larger than the tolerance.
        (cells - cells.round()).abs() <= TOLERANCE.max(4.0 * f64::EPSILON * cells.abs())
    }

    /// Checks the walls, and returns those without fault.
    fn walls<'w>(&self, walls: &[&'w PlacedWall]) -> Vec<&'w PlacedWall> {
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
        let message = "must be a whole number of spacings from the plane of symmetry";
        (self.is_symmetric(axis) && !self.is_whole(at))
            .then(|| format!("{message} {} = 0; it is {} of {dx} m", AXES[axis], at / dx))
    }

    fn wall_facing(&self, wall: &PlacedWall, other: &PlacedWall) -> Option<String> {
        let (name, dx) = (&other.name, self.spacing);
        let room = wall.side.value * (other.at.value - wall.at.value);
        if room <= 0.0 {
            let message = format!("leaves no room between this wall and wall `{name}`, which faces it");
            return Some(format!("{message}; the wall with side = \"above\" must be the lower one"));
        }
        let message = format!("must be a whole number of spacings from wall `{name}`, which faces it");
        (!self.is_whole(room)).then(|| format!("{message}; it is {} of {dx} m", room / dx))
    }

    fn bodies(&self, bodies: &[&PlacedBody], walls: &[&PlacedWall]) {
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
            total += self.extent(low, high, walls, &fault);
            self.behind_walls(low, high, walls, &fault);
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

    /// Why a shape holds no particle, if it holds none.
    fn emptiness(&self, shape: &Shape) -> Option<String> {
        let dx = self.spacing;
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
            Shape::Wedge { corner, size, falls_left } => {
                let column = if falls_left { 0.5 } else { first(0, corner[0]) };
                let kept = !falls_left || !self.is_symmetric(0) || corner[0] / dx - 0.5 > ON_THE_BORDER;
                let under_slope = size[2] / dx * (1.0 - column * dx / size[0]) - 0.5 > ON_THE_BORDER;
                (kept && under_slope && last_is_kept(1), format!("size {} m x {} m", size[0], size[2]))
            }
        };
        let kept = if self.symmetry.contains(&true) { " on the positive side of the planes of symmetry" } else { "" };
        (!holds).then(|| format!("holds no particle{kept}: {size} is too small for the spacing of {dx} m"))
    }

    /// Do two shapes share a volume? Exact, because no shape grows with height: they do where they share a span of
    /// heights and, at its foot, their horizontal sections share an area.
    fn overlap(&self, a: &Shape, b: &Shape) -> bool {
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
        Shape::Cylinder { .. } | Shape::Box { .. } => {}
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

/// Lower and upper corner of the box around a shape, m.
pub(super) fn bounds(shape: &Shape, space: Space) -> ([f64; 3], [f64; 3]) {
    match *shape {
        Shape::Cylinder { base: [x, y, z], radius, height } => match space {
            Space::Axisymmetric => ([0.0, 0.0, z], [radius, 0.0, z + height]),
            _ => ([x - radius, y - radius, z], [x + radius, y + radius, z + height]),
        },
        Shape::Box { min, max } => (min, max),
        Shape::Wedge { corner: [x, y, z], size: [length, width, height], falls_left } => {
            let (left, right) = if falls_left { (x - length, x) } else { (x, x + length) };
            ([left, y, z], [right, y + width, z + height])
        }
    }
}
