//! Stress of the particles at the start.

use crate::shape::Lattice;
use formats::scene::{InitialStress, Scene};

/// The rule for the stress at the start.
#[derive(Clone, Copy, Debug)]
pub struct Stress {
    /// Horizontal over vertical stress; none where there is no stress.
    sideways: Option<f64>,
    /// Weight of a unit of volume, N/m3: zero where gravity does not point down.
    weight: f64,
}

impl Stress {
    /// The rule of a scene.
    pub fn new(scene: &Scene) -> Self {
        let sideways = match scene.initial.stress {
            InitialStress::Zero => None,
            InitialStress::Hydrostatic => Some(1.0),
            InitialStress::K0 { coefficient } => Some(coefficient),
        };
        Self { sideways, weight: scene.material.density() * (-scene.gravity[2]).max(0.0) }
    }

    /// Stress at a point of a body, Pa, tension positive, in the order XX YY ZZ XY YZ XZ. The vertical stress carries
    /// the body's own material straight above the point; `sideways` times that acts along x and y, which are the
    /// radial and the hoop direction in the axisymmetric space.
    pub fn at(&self, lattice: &Lattice, x: [f64; 3]) -> [f64; 6] {
        let Some(sideways) = self.sideways else { return [0.0; 6] };
        // Disorder may lift a particle of the top layer above the surface: nothing weighs on it.
        let depth = (lattice.top(x[0]) - x[2]).max(0.0);
        let vertical = -self.weight * depth;
        [sideways * vertical, sideways * vertical, vertical, 0.0, 0.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scene;
    use formats::{scene::Shape, space::Space};

    #[test]
    fn the_weight_above_acts_downwards_and_its_share_sideways() {
        let cylinder = Shape::Cylinder { base: [0.0, 0.0, 1.0], radius: 0.1, height: 0.2 };
        let mut scene = scene(Space::Axisymmetric, 0.01, cylinder);
        let lattice = Lattice::new(&scene, 0);
        let foot = [0.05, 0.0, 1.0];
        assert_eq!(Stress::new(&scene).at(&lattice, foot), [0.0; 6]);
        scene.initial.stress = InitialStress::K0 { coefficient: 0.5 };
        let s = Stress::new(&scene).at(&lattice, foot);
        let weight = 2600.0 * 9.81 * 0.2;
        assert!((s[2] + weight).abs() < 1e-6 * weight, "{s:?}");
        assert_eq!([s[0], s[1]], [0.5 * s[2]; 2]);
        assert_eq!(s[3..], [0.0; 3]);
        scene.initial.stress = InitialStress::Hydrostatic;
        let s = Stress::new(&scene).at(&lattice, foot);
        assert_eq!([s[0], s[1]], [s[2]; 2]);
        let above = Stress::new(&scene).at(&lattice, [0.05, 0.0, 1.3]);
        assert!(above.iter().all(|s| *s == 0.0));
    }

    #[test]
    fn a_wedge_weighs_less_where_it_is_lower() {
        let wedge = Shape::Wedge { corner: [0.0; 3], size: [0.4, 0.0, 0.2], falls_left: false };
        let mut scene = scene(Space::PlaneStrain, 0.01, wedge);
        scene.initial.stress = InitialStress::Hydrostatic;
        let lattice = Lattice::new(&scene, 0);
        let at = |x: f64| Stress::new(&scene).at(&lattice, [x, 0.0, 0.0])[2];
        assert!((at(0.2) / at(0.0) - 0.5).abs() < 1e-12);
        assert!(at(0.4).abs() < 1e-9);
    }
}
