//! Stress of the particles at the start.

use crate::lattice::Lattice;
use formats::scene::{InitialStress, Scene, normal};

/// The rule for the stress at the start.
#[derive(Clone, Copy, Debug)]
pub struct Stress {
    /// Horizontal over vertical stress of the weight; none where it does not count.
    sideways: Option<f64>,
    /// The same everywhere, Pa.
    pressure: f64,
    /// Weight of a unit of volume, N/m3: zero where gravity does not point down.
    weight: f64,
}

impl Stress {
    /// The rule of a scene.
    pub fn new(scene: &Scene) -> Self {
        let sideways = match scene.initial.stress {
            InitialStress::Zero | InitialStress::Pressure(_) => None,
            InitialStress::Hydrostatic => Some(1.0),
            InitialStress::K0 { coefficient } => Some(coefficient),
        };
        let pressure = match scene.initial.stress {
            InitialStress::Pressure(pressure) => pressure,
            _ => 0.0,
        };
        Self { sideways, pressure, weight: scene.material.density() * (-scene.gravity[2]).max(0.0) }
    }

    /// Stress at the height `z` of the column at (x, y), Pa, tension positive, in the order XX YY ZZ XY YZ XZ. The
    /// vertical stress carries all that lies straight above, of whatever body; `sideways` times that acts along x and
    /// y, which are the radial and the hoop direction in the axisymmetric space. On a terrain the part of the weight
    /// that acts across the ground counts, and `sideways` times that acts along the ground.
    pub fn at(&self, lattices: &[Lattice], [x, y]: [f64; 2], z: f64) -> [f64; 6] {
        let Some(sideways) = self.sideways else {
            let p = -self.pressure + 0.0;
            return [p, p, p, 0.0, 0.0, 0.0];
        };
        let above = |(bottom, top): (f64, f64)| (top - bottom.max(z)).max(0.0);
        // Disorder may lift a particle of the top layer above the surface: nothing weighs on it.
        let depth: f64 = lattices.iter().filter_map(|lattice| lattice.solid.vertical_extent(x, y)).map(above).sum();
        let vertical = -self.weight * depth;
        let ground = lattices.iter().find_map(|lattice| {
            lattice.solid.vertical_extent(x, y)?;
            Some(normal(lattice.solid.ground()?, lattice.solid.space, x, y))
        });
        let Some(n) = ground else { return [sideways * vertical, sideways * vertical, vertical, 0.0, 0.0, 0.0] };
        // A layer of depth d along z lies d n_z deep across the ground, and of its weight the part n_z acts across.
        let across = vertical * n[2] * n[2];
        let part = |a: usize, b: usize| {
            let along = if a == b { sideways } else { 0.0 };
            across * (along + (1.0 - sideways) * n[a] * n[b])
        };
        [part(0, 0), part(1, 1), part(2, 2), part(0, 1), part(1, 2), part(0, 2)]
    }

    /// The stress at the foot of the column that carries most, of some thousand columns of each body.
    pub fn largest(&self, lattices: &[Lattice]) -> [f64; 6] {
        const TRIED: u64 = 1000;
        let mut largest = [0.0; 6];
        for lattice in lattices {
            let stride = lattice.columns().div_ceil(TRIED).max(1);
            for column in (0..lattice.columns()).step_by(stride as usize).map(|c| lattice.column(c)) {
                if column.cells == 0 {
                    continue;
                }
                let stress = self.at(lattices, [column.x, column.y], lattice.z(column, 0));
                if stress[2] < largest[2] {
                    largest = stress;
                }
            }
        }
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scene;
    use formats::{
        scene::{Body, Shape},
        space::Space,
    };

    #[test]
    fn the_weight_above_acts_downwards_and_its_share_sideways() {
        let cylinder = Shape::Cylinder { base: [0.0, 0.0, 1.0], radius: 0.1, height: 0.2 };
        let mut scene = scene(Space::Axisymmetric, 0.01, cylinder);
        let body = [Lattice::new(&scene, 0)];
        let foot = [0.05, 0.0];
        assert_eq!(Stress::new(&scene).at(&body, foot, 1.0), [0.0; 6]);
        scene.initial.stress = InitialStress::K0 { coefficient: 0.5 };
        let s = Stress::new(&scene).at(&body, foot, 1.0);
        let weight = 2600.0 * 9.81 * 0.2;
        assert!((s[2] + weight).abs() < 1e-6 * weight, "{s:?}");
        assert_eq!([s[0], s[1]], [0.5 * s[2]; 2]);
        assert_eq!(s[3..], [0.0; 3]);
        scene.initial.stress = InitialStress::Hydrostatic;
        let s = Stress::new(&scene).at(&body, foot, 1.0);
        assert_eq!([s[0], s[1]], [s[2]; 2]);
        let above = Stress::new(&scene).at(&body, foot, 1.3);
        assert!(above.iter().all(|s| *s == 0.0));
    }

    #[test]
    fn a_wedge_weighs_less_where_it_is_lower() {
        let wedge = Shape::Wedge { corner: [0.0; 3], size: [0.4, 0.0, 0.2], falls_left: false };
        let mut scene = scene(Space::PlaneStrain, 0.01, wedge);
        scene.initial.stress = InitialStress::Hydrostatic;
        let body = [Lattice::new(&scene, 0)];
        let at = |x: f64| Stress::new(&scene).at(&body, [x, 0.0], 0.0)[2];
        assert!((at(0.2) / at(0.0) - 0.5).abs() < 1e-12);
        assert!(at(0.4).abs() < 1e-9);
    }

    #[test]
    fn bodies_on_top_weigh_on_those_below() {
        for space in [Space::PlaneStrain, Space::ThreeD] {
            let lower = Shape::Box { min: [0.0; 3], max: [0.1, 0.1, 0.1] };
            let mut scene = scene(space, 0.01, lower);
            // It covers half of the lower one.
            let upper = Shape::Box { min: [0.05, 0.0, 0.1], max: [0.1, 0.1, 0.25] };
            scene.bodies.push(Body { name: "upper".into(), shape: upper, velocity: [0.0; 3] });
            scene.initial.stress = InitialStress::K0 { coefficient: 0.4 };
            let rows = crate::fill::serial(&scene);
            for (x, s) in rows.position.iter().zip(&rows.stress) {
                let height = if x[0] > 0.05 { 0.25 } else { 0.1 };
                let vertical = -2600.0 * 9.81 * (height - x[2]);
                assert!((s[2] - vertical).abs() < 1e-9 * vertical.abs(), "{x:?}: {s:?}");
                assert!((s[0] - 0.4 * vertical).abs() < 1e-9 * vertical.abs());
            }
            let lowest = rows.stress.iter().map(|s| s[2]).fold(0.0, f64::min);
            assert!((lowest + 2600.0 * 9.81 * 0.245).abs() < 1e-6);
            assert_eq!(Stress::new(&scene).largest(&crate::fill::lattices(&scene))[2], lowest);
        }
    }
}
