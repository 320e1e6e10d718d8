//! From where a scene's lengths are measured: the axis or x = 0 for fronts, the floor for heights.

use super::{Body, Scene, Shape, geometry};
use crate::space::Space;

impl Scene {
    /// Are fronts radii (else places along +x, from x = 0)? In the axisymmetric space, and in 3-D around a cylinder whose
    /// axis is x = y = 0. Planes of symmetry alone make nothing round: a quarter of a cube is not radial.
    pub fn is_radial(&self) -> bool {
        match self.space {
            Space::PlaneStrain => false,
            Space::Axisymmetric => true,
            Space::ThreeD => self.bodies.iter().any(Body::is_cylinder_on_axis),
        }
    }

    /// Height from which heights and potential energies are measured, m: the lowest wall with the material above it, or
    /// where there is none the lowest point of the bodies; the lowest point of a terrain.
    pub fn floor(&self) -> f64 {
        if let Some(terrain) = &self.terrain {
            return terrain.ground.range()[0];
        }
        let walls = self.walls.iter().filter(|w| w.axis == 2 && w.side > 0.0).map(|w| w.at);
        let bodies = self.bodies.iter().map(|b| b.shape.bounds(self.space).0[2]);
        // A checked scene has a body.
        walls.reduce(f64::min).or_else(|| bodies.reduce(f64::min)).unwrap_or(0.0)
    }
}

impl Body {
    /// Is it a cylinder around x = y = 0?
    pub fn is_cylinder_on_axis(&self) -> bool {
        matches!(self.shape, Shape::Cylinder { base, .. } if base[0] == 0.0 && base[1] == 0.0)
    }
}

impl Shape {
    /// Lower and upper corner of the box around it, m; planes of symmetry cut nothing off. In the axisymmetric space x
    /// is the radius and y is zero.
    pub fn bounds(&self, space: Space) -> ([f64; 3], [f64; 3]) {
        geometry::bounds(self, space)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(space: &str, symmetry: &str, body: &str, wall: &str) -> Scene {
        let text = format!(
            "space = \"{space}\"\nspacing = 0.01\nsymmetry = {symmetry}\n[material.drucker-prager]\ndensity = 2600\n\
             young = \"5 MPa\"\npoisson = 0.3\nfriction = 30\ncohesion = 0\n[body.a]\n{body}\n{wall}[end]\ntime = 1\n"
        );
        Scene::read("scene", &text).unwrap()
    }

    #[test]
    fn what_is_round() {
        let radial = |space, symmetry, body| scene(space, symmetry, body, "").is_radial();
        let (cylinder, cube) =
            ("cylinder = { radius = 0.1, height = 0.1 }", "box = { min = [0, 0, 0], max = [1, 1, 1] }");
        assert!(radial("axisymmetric", "[]", cylinder));
        assert!(radial("3d", "[]", cylinder));
        assert!(radial("3d", "['x', 'y']", cylinder));
        assert!(!radial("3d", "['x', 'y']", cube));
        assert!(!radial("3d", "[]", "cylinder = { radius = 0.1, height = 0.1, base = [0.5, 0, 0] }"));
        assert!(!radial("plane-strain", "['x']", "box = { min = [0, 0, 0], max = [1, 0, 1] }"));
    }

    #[test]
    fn the_floor_is_the_lowest_wall_below_or_the_foot_of_the_bodies() {
        let body = "box = { min = [0, 0, 0.5], max = [1, 0, 1] }";
        let wall =
            |name, at, side| format!("[wall.{name}]\naxis = \"z\"\nat = {at}\nside = \"{side}\"\nslip = \"no-slip\"\n");
        assert_eq!(scene("plane-strain", "[]", body, "").floor(), 0.5);
        assert_eq!(scene("plane-strain", "[]", body, &wall("floor", 0.2, "above")).floor(), 0.2);
        assert_eq!(scene("plane-strain", "[]", body, &wall("lid", 1.2, "below")).floor(), 0.5);
    }
}
