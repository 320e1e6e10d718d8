//! Bodies and walls of a scene. Whether they fit the lattice and each other is checked in [`super::fit`].

use super::{
    Body, Shape, Slip, Wall, WallKind,
    check::{AXES, Setting},
    fit::Fit,
    raw::{ANY, Found, POSITIVE, Table, values},
    release,
};
use crate::{space::Space, units::Dimension};

/// A body and the place of its shape in the file.
pub(super) struct PlacedBody {
    pub body: Body,
    pub offset: usize,
    pub key: String,
}

/// A wall and the places of what was read for it.
pub(super) struct PlacedWall {
    pub name: String,
    pub axis: Found<usize>,
    pub at: Found<f64>,
    pub side: Found<f64>,
    pub slip: Slip,
    pub kind: WallKind,
    pub velocity: [f64; 3],
}

/// All bodies and all walls; None where one has a fault.
pub(super) fn read(root: &Table<'_>, setting: &Setting<'_>) -> (Option<Vec<Body>>, Option<Vec<Wall>>) {
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
        let fit = Fit { faults, space, spacing, setting };
        let right_walls = fit.walls(&known_walls);
        fit.bodies(&known_bodies, &right_walls);
    }
    let wall = |placed: PlacedWall| {
        let PlacedWall { axis, at, side, slip, kind, velocity, .. } = placed;
        Wall { axis: axis.value, at: at.value, side: side.value, slip, kind, velocity }
    };
    let walls = walls.into_iter().map(|placed| placed.map(wall)).collect();
    (bodies.into_iter().map(|placed| placed.map(|placed| placed.body)).collect(), walls)
}

fn body(name: String, table: Table<'_>, setting: &Setting<'_>) -> Option<PlacedBody> {
    let faults = table.faults;
    let given: Vec<_> = ["cylinder", "box", "wedge", "release"].into_iter().filter(|key| table.has(key)).collect();
    match given.as_slice() {
        [] => {
            let message = "has no shape; one of cylinder, box, wedge, release is needed";
            faults.structure(table.offset, &table.path, message);
        }
        [_] => {}
        [_, second, ..] => {
            let message = format!("has several shapes ({}); exactly one is needed", given.join(", "));
            faults.structure(table.child_offset(second), &table.path, message);
        }
    }
    let (cylinder, block, wedge) = (table.child("cylinder"), table.child("box"), table.child("wedge"));
    let released = table.child("release");
    let offset = cylinder.offset.max(block.offset).max(wedge.offset).max(released.offset);
    let key = given.first().map_or(table.path.clone(), |key| table.path_of(key));
    let shapes = [
        cylinder_shape(cylinder, setting),
        box_shape(block, setting),
        wedge_shape(wedge, setting),
        release::read(released, setting),
    ];

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

fn cylinder_shape(table: Table<'_>, setting: &Setting<'_>) -> Option<Shape> {
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

fn box_shape(table: Table<'_>, setting: &Setting<'_>) -> Option<Shape> {
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

fn wedge_shape(table: Table<'_>, setting: &Setting<'_>) -> Option<Shape> {
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

fn is_3d(setting: &Setting<'_>) -> bool {
    setting.space == Some(Space::ThreeD)
}

fn wall(name: String, table: Table<'_>, setting: &Setting<'_>) -> Option<PlacedWall> {
    let axis = table.needed_choice("axis", &[("x", 0), ("y", 1), ("z", 2)]);
    let at = table.needed("at", Dimension::Length, &ANY);
    let side = table.needed_choice("side", &[("above", 1.0), ("below", -1.0)]);
    let slip = table.needed_choice("slip", &[("no-slip", Slip::NoSlip), ("free-slip", Slip::FreeSlip)]);
    let kind = table.choice("kind", &[("virtual", WallKind::Virtual), ("mirror", WallKind::Mirror)]);
    let velocity = table.vector("velocity", Dimension::Velocity);
    let mut right = true;
    if let Some(axis) = &axis
        && let Some(message) = no_walls_along(axis.value, setting)
    {
        table.faults.at(axis, message);
        right = false;
    } else if let (Some(velocity), Some(axis), Some(slip)) = (&velocity, &axis, &slip)
        && let Some((component, message)) = motion_fault(velocity, axis.value, slip.value, setting)
    {
        table.faults.at(component, message);
        right = false;
    }
    table.finish();
    let kind = kind.map_or(WallKind::Virtual, |found| found.value);
    let velocity = velocity.as_ref().map_or([0.0; 3], values);
    let wall = PlacedWall { name, axis: axis?, at: at?, side: side?, slip: slip?.value, kind, velocity };
    right.then_some(wall)
}

/// Why no wall can be normal to an axis, where none can.
fn no_walls_along(axis: usize, setting: &Setting<'_>) -> Option<String> {
    let name = AXES[axis];
    match setting.space {
        Some(space) if !space.axes().contains(&axis) => {
            let valid = "valid: \"x\", \"z\"";
            Some(format!("there are no walls normal to {name} in the space \"{}\"; {valid}", space.name()))
        }
        _ if axis == 2 && setting.has_terrain => {
            Some("the terrain is the floor, and nothing may lie above it but air; drop this wall, or [terrain]".into())
        }
        _ if setting.periodic[axis].is_some() => {
            let message = format!("the scene repeats itself along {name}: no wall can be normal to it");
            Some(format!("{message}; drop this wall, or periodic.{name}"))
        }
        _ => None,
    }
}

/// The component of a wall's velocity that cannot be, and why: a wall slides along itself, and takes along what sticks
/// to it, the same everywhere on it.
fn motion_fault<'v>(
    velocity: &'v [Found<f64>; 3],
    normal: usize,
    slip: Slip,
    setting: &Setting<'_>,
) -> Option<(&'v Found<f64>, String)> {
    (0..3).filter(|&along| velocity[along].value != 0.0).find_map(|along| {
        let name = AXES[along];
        let is_out_of_plane = match setting.space {
            Some(Space::PlaneStrain) => along == 1,
            Some(Space::Axisymmetric) => along != 2,
            Some(Space::ThreeD) | None => false,
        };
        let message = if is_out_of_plane {
            let space = setting.space.map_or("", Space::name);
            format!("velocity of a wall along {name} must be 0 in the space \"{space}\"")
        } else if along == normal {
            format!("a wall normal to {name} slides along itself: its velocity along {name} must be 0")
        } else if along < 2 && setting.symmetry[along] {
            format!("this wall crosses the plane of symmetry {name} = 0: its velocity along {name} must be 0")
        } else if slip == Slip::FreeSlip {
            "a free-slip wall takes nothing along; set slip = \"no-slip\", or drop the velocity".to_string()
        } else {
            return None;
        };
        Some((&velocity[along], message))
    })
}

/// Lower and upper corner of the box around a shape, m.
pub(super) fn bounds(shape: &Shape, space: Space) -> ([f64; 3], [f64; 3]) {
    match *shape {
        Shape::Cylinder { base: [x, y, z], radius, height } => match space {
            Space::Axisymmetric => ([0.0, 0.0, z], [radius, 0.0, z + height]),
            _ => ([x - radius, y - radius, z], [x + radius, y + radius, z + height]),
        },
        Shape::Box { min, max } => (min, max),
        Shape::Release(ref release) => release.bounds(space),
        Shape::Wedge { corner: [x, y, z], size: [length, width, height], falls_left } => {
            let (left, right) = if falls_left { (x - length, x) } else { (x, x + length) };
            ([left, y, z], [right, y + width, z + height])
        }
    }
}
