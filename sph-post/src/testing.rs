//! Blocks of particles for the tests of this crate.

use crate::geometry::Geometry;
use formats::{
    kernel::Kernel,
    scene::{Cone, DruckerPrager, Material, MeanStress, Rotation},
    snapshot::Rows,
    space::Space,
};
use std::f64::consts::PI;

/// A geometry of density 2000 kg/m3 on a floor at 0, symmetric about x = 0 (and y = 0 in 3-D).
pub fn geometry(space: Space, kernel: Kernel, dx: f64) -> Geometry {
    let h = dx * kernel.default_h_over_dx();
    Geometry {
        space,
        kernel,
        dx,
        h,
        gravity: [0.0, 0.0, -9.81],
        floor: 0.0,
        datum: 0.0,
        mirrored: [true, space == Space::ThreeD],
        walls: [f64::NEG_INFINITY, f64::INFINITY],
        radial: space == Space::Axisymmetric,
        width: 1.0,
        density: 2000.0,
        material: Material::DruckerPrager(DruckerPrager {
            density: 2000.0,
            young: 1e6,
            poisson: 0.3,
            friction_deg: 30.0,
            dilation_deg: 0.0,
            cohesion: 0.0,
            cone: Cone::Compression,
            rotation: Rotation::Jaumann,
            mean_stress: MeanStress::Rate,
        }),
        extent: None,
        runs_outward: false,
        height: 0.1,
        cylinder_aspect: None,
        plane_aspect: None,
    }
}

/// A lattice block of `cells` from the origin, at rest, without stress.
pub fn block(g: &Geometry, cells: [usize; 3]) -> Rows {
    let mut rows = Rows::default();
    let dx = g.dx;
    for i in 0..cells[0] {
        for j in 0..cells[1] {
            for k in 0..cells[2] {
                let y = if g.space == Space::ThreeD { (j as f64 + 0.5) * dx } else { 0.0 };
                let x = [(i as f64 + 0.5) * dx, y, g.floor + (k as f64 + 0.5) * dx];
                let volume = match g.space {
                    Space::PlaneStrain => dx * dx,
                    Space::Axisymmetric => 2.0 * PI * x[0] * dx * dx,
                    Space::ThreeD => dx * dx * dx,
                };
                push(&mut rows, x, g.density * volume, g.density);
            }
        }
    }
    rows
}

/// One more particle.
pub fn push(rows: &mut Rows, x: [f64; 3], mass: f64, density: f64) {
    rows.id.push(rows.id.len() as u64);
    rows.body.push(0);
    rows.position.push(x);
    rows.velocity.push([0.0; 3]);
    rows.mass.push(mass);
    rows.density.push(density);
    rows.stress.push([0.0; 6]);
    rows.stress_work.push(0.0);
    rows.viscous_work.push(0.0);
    rows.plastic_strain.push(0.0);
}

/// Moves every particle by up to `part` of the spacing, the same way on every run.
pub fn jitter(rows: &mut Rows, g: &Geometry, part: f64) {
    let mut state: u64 = 12345;
    for x in &mut rows.position {
        for &a in g.space.axes() {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            x[a] += part * g.dx * ((state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0);
        }
    }
}
