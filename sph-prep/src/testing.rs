//! Scenes for the unit tests.

use formats::{kernel::Kernel, scene::*, space::Space};

/// A scene with one body and no walls.
pub fn scene(space: Space, spacing: f64, shape: Shape) -> Scene {
    Scene {
        title: "test".into(),
        space,
        spacing,
        gravity: [0.0, 0.0, -9.81],
        symmetry: [false; 2],
        periodic: [None; 3],
        kernel: Kernel::CubicSpline,
        h_over_dx: 1.2,
        material: Material::DruckerPrager(DruckerPrager {
            density: 2600.0,
            young: 5.98e6,
            poisson: 0.3,
            friction_deg: 30.0,
            dilation_deg: 0.0,
            cohesion: 0.0,
            cone: Cone::Compression,
            rotation: Rotation::Jaumann,
            mean_stress: MeanStress::Rate,
        }),
        bodies: vec![Body { name: "body".into(), shape, velocity: [0.0; 3] }],
        walls: Vec::new(),
        terrain: None,
        obstacles: Vec::new(),
        files: Vec::new(),
        initial: Initial { stress: InitialStress::Zero, lattice: Lattice::Cubic, jitter: 0.0, seed: 1, relax: 0 },
        numerics: Numerics {
            courant: 0.6,
            viscous_courant: 0.125,
            viscosity: 0.1,
            viscosity_on_approach: true,
            quadratic_viscosity: 0.0,
            damping: 0.0,
            density_gate: 0.0,
            density_diffusion: 0.0,
            stress_diffusion: 0.0,
            artificial_stress: 0.0,
            gradient_correction: false,
            shifting: 0.0,
            precision: Precision::Double,
        },
        end: End { time: 1.0, at_rest: None },
        output: Output { snapshots: 0.05, history: 0.01 },
        chosen: None,
    }
}
