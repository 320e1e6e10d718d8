//! How many virtual wall particles the run starts with.

use crate::lattice::Lattice;
use formats::{
    scene::{Scene, Shape, WallLattice},
    space::Space,
};
use std::f64::consts::FRAC_PI_4;

/// About how many wall sites lie within the kernel's reach of a body, those across planes of symmetry left out. It
/// follows from the bounds of the bodies, so that it is known before any particle is made: exact for a box on one
/// wall, too many where bodies stand side by side or walls meet.
pub fn within_reach(scene: &Scene, lattices: &[Lattice]) -> u64 {
    let (dx, reach) = (scene.spacing, 2.0 * scene.h());
    // The axis of the axisymmetric space is one more border that nothing lies across.
    let axis = scene.space == Space::Axisymmetric;
    let border = [scene.symmetry[0] || axis, scene.symmetry[1], false];
    let mut sites = 0.0;
    for (lattice, body) in lattices.iter().zip(&scene.bodies) {
        let (low, high) = lattice.solid.bounds();
        for wall in &scene.walls {
            let gap = if wall.side > 0.0 { low[wall.axis] - wall.at } else { wall.at - high[wall.axis] };
            // Every cell counts: the nearest particles are half a spacing inside the body.
            for layer in 0.. {
                let away = gap + f64::from(layer + 1) * dx;
                if away >= reach {
                    break;
                }
                let margin = ((reach * reach - away * away).sqrt() / dx).floor();
                let along = scene.space.axes().iter().filter(|a| **a != wall.axis).map(|&a| {
                    let ends = if border[a] && low[a] <= 0.0 { 1.0 } else { 2.0 };
                    ((high[a] - low[a]) / dx).round() + ends * margin
                });
                let round = matches!(body.shape, Shape::Cylinder { .. }) && scene.space == Space::ThreeD;
                sites += along.product::<f64>() * if round && wall.axis == 2 { FRAC_PI_4 } else { 1.0 };
            }
        }
    }
    if scene.terrain.is_some() {
        let walls = WallLattice::new(scene);
        for lattice in lattices {
            for column in (0..lattice.columns()).map(|c| lattice.column(c)).filter(|c| c.cells > 0) {
                let foot = [column.x, column.y, lattice.z(column, 0)];
                let gap = walls.ground(foot).map_or(f64::INFINITY, |ground| foot[2] - ground);
                sites += ((reach - gap) / dx + 0.5).floor().max(0.0);
            }
        }
    }
    if !scene.obstacles.is_empty() {
        let layers = ((reach - 0.5 * dx) / dx + 0.5).floor();
        let bounds: Vec<_> = lattices.iter().map(|lattice| lattice.solid.bounds()).collect();
        let is_near = |x: [f64; 3]| {
            bounds.iter().any(|(low, high)| (0..3).all(|a| low[a] - reach < x[a] && x[a] < high[a] + reach))
        };
        let surface = WallLattice::new(scene).surface_of_obstacles();
        let area: f64 = surface.into_iter().filter(|(x, ..)| is_near(*x)).map(|(.., area)| area).sum();
        sites += area / (dx * dx) * layers;
    }
    sites.round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fill, testing::scene};
    use formats::scene::{Slip, Wall, WallKind};
    use std::collections::HashSet;

    fn floor() -> Wall {
        Wall { axis: 2, at: 0.0, side: 1.0, slip: Slip::NoSlip, kind: WallKind::Virtual, velocity: [0.0; 3] }
    }

    /// The sites near the particles, one by one.
    fn counted(scene: &Scene) -> usize {
        let lattice = WallLattice::new(scene);
        let mut found = HashSet::new();
        for &x in &fill::serial(scene).position {
            lattice.near(x, 2.0 * scene.h(), |site| {
                found.insert(site);
            });
        }
        let kept = |x: [f64; 3]| (0..2).all(|axis| !scene.symmetry[axis] || x[axis] > 0.0);
        found.into_iter().filter(|site| kept(lattice.position(*site))).count()
    }

    #[test]
    fn a_floor_has_its_layers_under_the_body_and_a_margin() {
        let shape = Shape::Box { min: [0.0; 3], max: [0.1, 0.0, 0.05] };
        let mut scene = scene(Space::PlaneStrain, 0.01, shape);
        scene.walls.push(floor());
        let estimated = |scene: &Scene| within_reach(scene, &fill::lattices(scene)) as usize;
        // Reach 2.4 dx: under the bottom row lie sites 1 and 2 layers down (1 dx and 2 dx away), two more to each side
        // in the first layer (sqrt 5 dx), one in the second.
        assert_eq!(estimated(&scene), 10 + 10 + 2 * 2 + 2);
        assert_eq!(estimated(&scene), counted(&scene));
        scene.symmetry[0] = true;
        assert_eq!(estimated(&scene), 10 + 10 + 2 + 1);
        assert_eq!(estimated(&scene), counted(&scene));
        scene.walls.clear();
        assert_eq!(estimated(&scene), 0);
    }

    #[test]
    fn under_a_cylinder_the_estimate_is_close() {
        let mut scene = scene(Space::ThreeD, 0.01, Shape::Cylinder { base: [0.0; 3], radius: 0.1, height: 0.05 });
        scene.walls.push(floor());
        for symmetry in [[false; 2], [true; 2]] {
            scene.symmetry = symmetry;
            let (counted, estimated) = (counted(&scene) as f64, within_reach(&scene, &fill::lattices(&scene)) as f64);
            assert!((estimated / counted - 1.0).abs() < 0.1, "{estimated}, counted {counted}");
        }
    }
}
