//! Energies of a snapshot.

use crate::geometry::Geometry;
use formats::snapshot::Rows;

/// Sums over the particles, J: per metre of depth in plane strain, of the modelled part in symmetric scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Sum of m v2 / 2.
    pub kinetic: f64,
    /// Sum of -m g . x: zero at the origin.
    pub potential: f64,
    /// Sum of what the material stores: m times [`formats::scene::Material::stored_energy`].
    pub elastic: f64,
    /// Sum of m, kg.
    pub mass: f64,
}

impl Energy {
    /// Of all particles.
    pub fn new(g: &Geometry, rows: &Rows) -> Self {
        let mut sum = Self::default();
        for row in 0..rows.len() {
            let (m, x, v, s) = (rows.mass[row], rows.position[row], rows.velocity[row], rows.stress[row]);
            sum.mass += m;
            sum.kinetic += 0.5 * m * v.iter().map(|v| v * v).sum::<f64>();
            sum.potential -= m * (0..3).map(|a| g.gravity[a] * x[a]).sum::<f64>();
            sum.elastic += m * g.material.stored_energy(s, rows.density[row]);
        }
        sum
    }

    /// What a potential energy of these particles is when it is measured from the floor instead of the origin, J.
    pub fn above_floor(&self, g: &Geometry, potential: f64) -> f64 {
        potential + self.mass * g.gravity[2] * g.datum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{block, geometry};
    use formats::{kernel::Kernel, space::Space};

    #[test]
    fn energies_of_a_uniform_block() {
        let g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.1);
        let mut rows = block(&g, [10, 1, 10]);
        rows.velocity.fill([3.0, 0.0, 4.0]);
        // Uniaxial stress: sigma2 / 2E. Simple shear: tau2 / 2G.
        rows.stress.fill([0.0, 0.0, -500.0, 0.0, 0.0, 0.0]);
        let e = Energy::new(&g, &rows);
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
        close(e.kinetic, 0.5 * 2000.0 * 25.0);
        close(e.potential, 2000.0 * 9.81 * 0.5);
        close(e.mass, 2000.0);
        close(e.elastic, 500.0 * 500.0 / (2.0 * 1e6));
        rows.stress.fill([0.0, 0.0, 0.0, 0.0, 0.0, 500.0]);
        let shear = 1e6 / 2.6;
        close(Energy::new(&g, &rows).elastic, 500.0 * 500.0 / (2.0 * shear));
    }

    #[test]
    fn potential_energy_above_the_floor_does_not_depend_on_where_the_floor_is() {
        for floor in [0.0, -3.0, 7.0] {
            let g = Geometry { floor, datum: floor, ..geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.1) };
            let e = Energy::new(&g, &block(&g, [10, 1, 10]));
            let above = e.above_floor(&g, e.potential);
            assert!((above / (2000.0 * 9.81 * 0.5) - 1.0).abs() < 1e-12, "{floor}: {above}");
        }
    }
}
