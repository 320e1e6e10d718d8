//! Is a scene the same around an axis, along y, or on both sides of a plane? Numbers are the same or they are not: the
//! tolerance is that of a few roundings, for "10 cm" against 0.1 and sums of corner and size, never a length that
//! matters.

use super::edit::Edit;
use crate::{
    scene::{Body, Lattice, Scene, Shape, Slip, Wall},
    space::Space,
};

/// A smaller scene that does.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Reduction {
    /// In words, for refusals.
    pub name: &'static str,
    /// Of fewer dimensions; else cut at a plane.
    pub flat: Option<Flat>,
    /// What changes in the document.
    pub edits: Vec<Edit>,
}

/// Fewer dimensions.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Flat {
    pub space: Space,
    /// Why they do, in words.
    pub why: String,
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Everything around one vertical axis, which becomes r = 0; or why not.
pub(super) fn axisymmetric(scene: &Scene) -> Result<Reduction, String> {
    let mut axis: Option<[f64; 2]> = None;
    for body in &scene.bodies {
        let Shape::Cylinder { base: [x, y, _], .. } = body.shape else {
            return Err(format!("body `{}` is no upright cylinder", body.name));
        };
        match axis {
            Some([u, v]) if !(same(x, u, 0.0) && same(y, v, 0.0)) => {
                return Err(format!(
                    "body `{}` stands at x = {x} m, y = {y} m, the first at x = {u} m, y = {v} m",
                    body.name
                ));
            }
            _ => axis = axis.or(Some([x, y])),
        }
    }
    let axis = axis.unwrap_or_default();
    no_ground_nor_sideways_pull(scene, &[0, 1])?;
    for a in 0..2 {
        if scene.periodic[a].is_some() {
            return Err(format!("it repeats itself along {}", AXES[a]));
        }
        if scene.symmetry[a] && axis[a] != 0.0 {
            return Err(format!("the plane of symmetry {} = 0 does not go through its axis", AXES[a]));
        }
    }
    if let Some(wall) = scene.walls.iter().find(|wall| wall.axis < 2) {
        return Err(format!("the wall {} is not round", plane(wall)));
    }
    let at = |body: usize, key, a: usize| Edit::Component { body, shape: "cylinder", key, axis: a, value: 0.0 };
    let moved = (0..scene.bodies.len()).filter(|_| axis != [0.0; 2]).flat_map(|b| [at(b, "base", 0), at(b, "base", 1)]);
    let mut edits = vec![Edit::Space(Space::Axisymmetric), Edit::DropPlane(0), Edit::DropPlane(1)];
    edits.extend(moved);
    let origin = if axis == [0.0; 2] { "" } else { ", which is r = 0 now: x is measured from it" };
    let [x, y] = axis;
    let why = format!(
        "all bodies are upright cylinders around the axis x = {x} m, y = {y} m{origin}; no wall stands beside them, and nothing pulls \
         or moves sideways"
    );
    Ok(Reduction { name: "axisymmetric", flat: Some(Flat { space: Space::Axisymmetric, why }), edits })
}

/// Nothing changes along y; or why something does.
pub(super) fn plane_strain(scene: &Scene) -> Result<Reduction, String> {
    if let Some(body) = scene.bodies.iter().find(|b| !matches!(b.shape, Shape::Box { .. } | Shape::Wedge { .. })) {
        return Err(format!("body `{}` is neither a box nor a wedge along y", body.name));
    }
    no_ground_nor_sideways_pull(scene, &[1])?;
    let side = |side: f64, name: &str| -> Result<f64, String> {
        match scene.walls.iter().find(|wall| wall.axis == 1 && wall.side == side) {
            Some(wall) if wall.slip == Slip::NoSlip => Err(format!("the material sticks to the wall {}", plane(wall))),
            Some(wall) => Ok(wall.at),
            None if side > 0.0 && scene.symmetry[1] => Ok(0.0),
            None => Err(format!("nothing holds the material at its {name} end along y: it can spread")),
        }
    };
    let (from, to, ends) = match scene.periodic[1] {
        Some([from, to]) => (from, to, "over the whole period"),
        None => (side(1.0, "lower")?, side(-1.0, "upper")?, "between smooth walls or planes of symmetry"),
    };
    for body in &scene.bodies {
        let (low, high) = body.shape.bounds(scene.space);
        let low = if scene.symmetry[1] { low[1].max(0.0) } else { low[1] };
        let scale = extent(&body.shape);
        if !(same(low, from, scale) && same(high[1], to, scale)) {
            let high = high[1];
            return Err(format!(
                "body `{}` lies from y = {low} m to {high} m, and there is room from {from} m to {to} m",
                body.name
            ));
        }
    }
    let mut edits = vec![Edit::Space(Space::PlaneStrain), Edit::DropPlane(1), Edit::DropPeriod(1)];
    edits.extend((0..scene.walls.len()).filter(|&wall| scene.walls[wall].axis == 1).map(Edit::DropWall));
    let width = to - from;
    let why = format!(
        "all bodies fill the width of {width} m along y, {ends}, and nothing pulls or moves along y; masses, forces and energies are \
         for a metre of depth: {width} times that is the scene's"
    );
    Ok(Reduction { name: "plane strain", flat: Some(Flat { space: Space::PlaneStrain, why }), edits })
}

/// The plane at 0 across an axis mirrors the scene onto itself; or why not.
pub(super) fn mirrored(scene: &Scene, axis: usize) -> Result<Reduction, String> {
    let name = AXES[axis];
    if scene.periodic[axis].is_some() {
        return Err(format!("it repeats itself along {name}"));
    }
    no_ground_nor_obstacles(scene)?;
    if scene.gravity[axis] != 0.0 {
        return Err(format!("gravity has a component along {name}"));
    }
    let lonely = |wall: &&Wall| !scene.walls.iter().any(|other| are_images_of_walls(wall, other, axis));
    if let Some(wall) = scene.walls.iter().find(lonely) {
        let along = wall.axis != axis && wall.velocity[axis] != 0.0;
        let what = if along { format!("slides along {name}") } else { "has no mirror image".into() };
        return Err(format!("the wall {} {what}", plane(wall)));
    }
    let mut edits = vec![Edit::AddPlane(axis)];
    let behind = |wall: &Wall| wall.axis == axis && wall.at <= 0.0;
    edits.extend((0..scene.walls.len()).filter(|&wall| behind(&scene.walls[wall])).map(Edit::DropWall));
    for (number, body) in scene.bodies.iter().enumerate() {
        let image = |other: &&Body| are_images(body, other, axis);
        let Some(image) = scene.bodies.iter().find(image) else {
            return Err(format!("body `{}` has no mirror image{}", body.name, moves(body, axis)));
        };
        if std::ptr::eq(image, body) {
            edits.extend(cut(scene, number, axis)?);
        } else if body.shape.bounds(scene.space).1[axis] <= 4.0 * f64::EPSILON * extent(&body.shape) {
            edits.push(Edit::DropBody(number));
        }
    }
    Ok(Reduction { name: super::PLANES[axis], flat: None, edits })
}

/// Of neither is it known here what is symmetric about it.
fn no_ground_nor_obstacles(scene: &Scene) -> Result<(), String> {
    if scene.terrain.is_some() {
        return Err("there is a terrain".into());
    }
    match scene.obstacles.first() {
        Some(obstacle) => Err(format!("there is an obstacle, `{}`", obstacle.name)),
        None => Ok(()),
    }
}

fn no_ground_nor_sideways_pull(scene: &Scene, axes: &[usize]) -> Result<(), String> {
    no_ground_nor_obstacles(scene)?;
    for &a in axes {
        let name = AXES[a];
        if scene.gravity[a] != 0.0 {
            return Err(format!("gravity has a component along {name}"));
        }
        if let Some(body) = scene.bodies.iter().find(|body| body.velocity[a] != 0.0) {
            return Err(format!("body `{}` moves along {name}", body.name));
        }
        if let Some(wall) = scene.walls.iter().find(|wall| wall.velocity[a] != 0.0) {
            return Err(format!("the wall {} slides along {name}", plane(wall)));
        }
    }
    Ok(())
}

fn plane(wall: &Wall) -> String {
    format!("{} = {} m", AXES[wall.axis], wall.at)
}

/// A moving body may lack its image for its velocity alone.
fn moves(body: &Body, axis: usize) -> String {
    if body.velocity[axis] == 0.0 { String::new() } else { format!(" that moves along {} the other way", AXES[axis]) }
}

/// What leaves the positive half of a body that is its own mirror image.
fn cut(scene: &Scene, number: usize, axis: usize) -> Result<Vec<Edit>, String> {
    let body = &scene.bodies[number];
    let (low, high) = body.shape.bounds(scene.space);
    let component = |shape, key, value| Edit::Component { body: number, shape, key, axis, value };
    // Sizes are rounded to whole spacings: with an odd number of rows one lies on the plane, where there are no
    // particles.
    let rows = ((high[axis] - low[axis]) / scene.spacing).round();
    if !matches!(body.shape, Shape::Cylinder { .. }) && scene.initial.lattice == Lattice::Cubic && rows % 2.0 != 0.0 {
        let message = "spacings wide, an odd number: a row of its particles would lie on the plane";
        return Err(format!("body `{}` is {rows} {message}", body.name));
    }
    Ok(match body.shape {
        Shape::Box { .. } => vec![component("box", "min", 0.0)],
        // Across y: along x a wedge is not its own image.
        Shape::Wedge { size, .. } => {
            vec![component("wedge", "corner", 0.0), component("wedge", "size", 0.5 * size[axis])]
        }
        // The lattice keeps the positive half by itself.
        Shape::Cylinder { .. } | Shape::Release(_) => Vec::new(),
    })
}

fn are_images_of_walls(a: &Wall, b: &Wall, axis: usize) -> bool {
    let (at, side) = if a.axis == axis { (-a.at, -a.side) } else { (a.at, a.side) };
    let mut velocity = a.velocity;
    velocity[axis] = -velocity[axis];
    let stays = a.axis == b.axis && same(at, b.at, 0.0) && side == b.side;
    stays && a.slip == b.slip && a.kind == b.kind && velocity == b.velocity
}

fn are_images(a: &Body, b: &Body, axis: usize) -> bool {
    let mut velocity = a.velocity;
    velocity[axis] = -velocity[axis];
    velocity == b.velocity && image(&a.shape, axis).is_some_and(|image| same_shape(&image, &b.shape))
}

/// The mirror image of a shape in the plane at 0 across an axis.
fn image(shape: &Shape, axis: usize) -> Option<Shape> {
    Some(match *shape {
        Shape::Cylinder { mut base, radius, height } => {
            base[axis] = -base[axis];
            Shape::Cylinder { base, radius, height }
        }
        Shape::Box { mut min, mut max } => {
            (min[axis], max[axis]) = (-max[axis], -min[axis]);
            Shape::Box { min, max }
        }
        Shape::Wedge { mut corner, size, falls_left } => {
            let turned = axis == 0;
            corner[axis] = if turned { -corner[0] } else { -(corner[axis] + size[axis]) };
            Shape::Wedge { corner, size, falls_left: falls_left != turned }
        }
        Shape::Release(_) => return None,
    })
}

fn same_shape(a: &Shape, b: &Shape) -> bool {
    let scale = extent(a).max(extent(b));
    let alike = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|axis| same(a[axis], b[axis], scale));
    match (a, b) {
        (Shape::Cylinder { base: p, radius: r, height: h }, Shape::Cylinder { base: q, radius: s, height: k }) => {
            alike(p, q) && same(*r, *s, 0.0) && same(*h, *k, 0.0)
        }
        (Shape::Box { min: l, max: h }, Shape::Box { min: m, max: n }) => alike(l, m) && alike(h, n),
        (
            Shape::Wedge { corner: p, size: s, falls_left: left },
            Shape::Wedge { corner: q, size: t, falls_left: other },
        ) => alike(p, q) && alike(s, t) && left == other,
        _ => false,
    }
}

/// The largest number that a shape is given by, m: sums of them round by so many of its last bits.
fn extent(shape: &Shape) -> f64 {
    let largest = |numbers: &[&[f64]]| numbers.iter().copied().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    match shape {
        Shape::Cylinder { base, radius, height } => largest(&[base, &[*radius, *height]]),
        Shape::Box { min, max } => largest(&[min, max]),
        Shape::Wedge { corner, size, .. } => largest(&[corner, size]),
        Shape::Release(_) => 0.0,
    }
}

/// Are two numbers the same but for a few roundings of numbers as large as they are, or as `scale`?
fn same(a: f64, b: f64, scale: f64) -> bool {
    (a - b).abs() <= 4.0 * f64::EPSILON * a.abs().max(b.abs()).max(scale)
}
