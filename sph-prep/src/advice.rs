//! Warnings: what a scene may hold, but is known to lead to poor results.

use crate::{
    initial::Stress,
    lattice::Lattice,
    summary::{Body, short},
};
use formats::{
    kernel::Kernel,
    scene::{InitialStress, Material, Scene, Slip, Thin, WallLattice},
    space::Space,
};

/// A body's volume may differ from its lattice's by so much, per cent, before a warning.
pub const TOLERATED_DEVIATION: f64 = 2.0;

/// The largest h/dx at which columns rest on a no-slip wall. Measured: the kinetic energy of a resting column grows
/// without end at 1.5 with the cubic spline and from 1.8 on with Wendland's kernel, at any time step.
pub fn steady_h_over_dx(kernel: Kernel) -> f64 {
    match kernel {
        Kernel::CubicSpline => 1.4,
        Kernel::WendlandC2 => 1.7,
    }
}

/// All warnings of a scene, one a line.
pub fn warnings(scene: &Scene, lattices: &[Lattice], bodies: &[Body]) -> String {
    let mut all: Vec<String> = bodies.iter().filter_map(coarse).collect();
    all.extend(thin(scene, lattices));
    all.extend(wide_kernel(scene));
    all.extend(beyond_yield(scene, lattices));
    all.extend(undamped_rings(scene));
    all.extend(thin_obstacles(scene));
    all.iter().map(|text| format!("warning: {text}\n")).collect()
}

fn coarse(body: &Body) -> Option<String> {
    let (name, deviation) = (&body.name, body.deviation());
    let advice = "choose a spacing that divides its sizes, or a finer one";
    // What lies in obstacles is told beside the volume.
    (deviation.abs() > TOLERATED_DEVIATION && body.left_out == 0)
        .then(|| format!("body {name}: the volume of its particles is off by {deviation:+.1} %; {advice}"))
}

fn thin(scene: &Scene, lattices: &[Lattice]) -> Vec<String> {
    let bodies = lattices.iter().zip(&scene.bodies);
    let off = bodies.map(|(lattice, body)| (&body.name, 100.0 * (lattice.scale - 1.0)));
    let words = |(name, off): (&String, f64)| {
        let message = format!("body {name}: where it is thinner than half a spacing it has no particles");
        format!(
            "{message}; what lies there, and rounding, raises all thicknesses by {off:+.1} %; choose a finer spacing"
        )
    };
    off.filter(|(_, off)| off.abs() > TOLERATED_DEVIATION).map(words).collect()
}

fn wide_kernel(scene: &Scene) -> Option<String> {
    let (ratio, limit, name) = (scene.h_over_dx, steady_h_over_dx(scene.kernel), scene.kernel.name());
    let sticks = scene.walls.iter().any(|wall| wall.slip == Slip::NoSlip)
        || scene.terrain.as_ref().is_some_and(|terrain| terrain.slip == Slip::NoSlip)
        || scene.obstacles.iter().any(|obstacle| obstacle.slip == Slip::NoSlip);
    (sticks && ratio > limit).then(|| {
        format!(
            "kernel.h-over-dx = {ratio}: above {limit} the kernel {name} is unstable at no-slip walls (kinetic energy \
             grows at rest); choose a smaller h-over-dx, or free-slip walls"
        )
    })
}

/// The initial stress outside of the yield cone: the first step would return it to the cone with a jolt.
fn beyond_yield(scene: &Scene, lattices: &[Lattice]) -> Option<String> {
    let InitialStress::K0 { coefficient } = scene.initial.stress else { return None };
    let Material::DruckerPrager(law) = &scene.material else { return None };
    let (alpha, k) = law.cone.constants(law.friction_deg, law.cohesion);
    let stress = Stress::new(scene).largest(lattices);
    let f = yield_function(alpha, k, stress);
    // A state on the cone is one by intention; rounding may put it a hair outside.
    if f <= 1e-9 * stress[2].abs() {
        return None;
    }
    let root3 = 3f64.sqrt();
    let least = ((1.0 - root3 * alpha) / (1.0 + 2.0 * root3 * alpha)).max(0.0);
    let most = (1.0 + root3 * alpha) / (1.0 - 2.0 * root3 * alpha);
    let range = if most > 0.0 { format!("{least:.3} to {most:.3}") } else { format!("{least:.3} or more") };
    Some(format!(
        "initial.k0 = {coefficient}: the stress lies outside of the yield cone (f = {f:.3e} Pa under a vertical stress \
         of {:.3e} Pa) and will fall back at once; without cohesion, k0 must be {range}",
        stress[2]
    ))
}

fn undamped_rings(scene: &Scene) -> Option<String> {
    // Images across the axis are weighed with signed radii, which feeds a slow growth: measured 22 1/s.
    let viscous = matches!(scene.material, Material::ViscoPlastic(_));
    (scene.space == Space::Axisymmetric && scene.numerics.viscosity == 0.0 && !viscous).then(|| {
        "numerics.viscosity = 0: without it the kinetic energy grows slowly in the axisymmetric space; leave it at the \
         default of the law"
            .to_owned()
    })
}

/// Wall particles take the mean state of the material within 2h of them, on whichever side it lies.
fn thin_obstacles(scene: &Scene) -> Vec<String> {
    if scene.obstacles.is_empty() {
        return Vec::new();
    }
    let thickness = 2.0 * scene.h();
    let words = |thin: Thin| {
        format!(
            "obstacle {}: {:.0} % of its surface has another side less than 2 h = {} m behind it, as near as {} m: material on \
             one side feels that on the other there; choose a finer spacing, or make it thicker",
            thin.name,
            100.0 * thin.share,
            short(thickness),
            short(thin.least)
        )
    };
    WallLattice::new(scene).thin_obstacles(thickness).into_iter().map(words).collect()
}

/// f = alpha I1 + sqrt(J2) - k, Pa, of a stress in the order XX YY ZZ XY YZ XZ: positive outside of the cone.
fn yield_function(alpha: f64, k: f64, s: [f64; 6]) -> f64 {
    let trace = s[0] + s[1] + s[2];
    let normal: f64 = s[..3].iter().map(|s| (s - trace / 3.0).powi(2)).sum();
    let shear: f64 = s[3..].iter().map(|s| s * s).sum();
    alpha * trace + (0.5 * normal + shear).sqrt() - k
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fill, testing::scene};
    use formats::scene::{Shape, Wall, WallKind};

    fn block(space: Space) -> Scene {
        scene(space, 0.01, Shape::Box { min: [0.0; 3], max: [0.1, 0.0, 0.1] })
    }

    fn told(scene: &Scene) -> String {
        warnings(scene, &fill::lattices(scene), &[])
    }

    #[test]
    fn a_coarse_body_is_warned_of() {
        let body = |discrete| Body { name: "heap".into(), particles: 1, ideal: 1.0, discrete, left_out: 0 };
        let scene = block(Space::PlaneStrain);
        assert_eq!(warnings(&scene, &[], &[body(1.019), body(0.981)]), "");
        let warned = warnings(&scene, &[], &[body(0.97)]);
        assert!(warned.contains("heap") && warned.contains("-3.0 %"), "{warned}");
    }

    #[test]
    fn wide_kernels_are_warned_of_at_walls_that_stick() {
        let mut scene = block(Space::PlaneStrain);
        scene.h_over_dx = 1.5;
        assert_eq!(told(&scene), "", "no walls");
        scene.walls.push(Wall {
            axis: 2,
            at: 0.0,
            side: 1.0,
            slip: Slip::FreeSlip,
            kind: WallKind::Virtual,
            velocity: [0.0; 3],
        });
        assert_eq!(told(&scene), "");
        scene.walls[0].slip = Slip::NoSlip;
        assert!(told(&scene).starts_with("warning: kernel.h-over-dx = 1.5: above 1.4"), "{}", told(&scene));
        scene.kernel = Kernel::WendlandC2;
        assert_eq!(told(&scene), "");
        scene.h_over_dx = 1.8;
        assert_eq!(told(&scene).lines().count(), 1);
        for kernel in Kernel::ALL {
            assert!(kernel.default_h_over_dx() <= steady_h_over_dx(kernel));
        }
    }

    #[test]
    fn k0_states_outside_of_the_cone_are_warned_of() {
        let mut scene = block(Space::PlaneStrain);
        let with = |scene: &mut Scene, coefficient| {
            scene.initial.stress = InitialStress::K0 { coefficient };
            told(scene)
        };
        // Through the compression corners the cone meets Rankine's active and passive states: 1/3 and 3 at 30 deg.
        let active = with(&mut scene, 0.33);
        assert!(active.contains("0.333 to ") && active.contains("outside"), "{active}");
        assert_eq!(with(&mut scene, 0.334), "");
        assert_eq!(with(&mut scene, 1.0 / 3.0), "");
        let Material::DruckerPrager(law) = &mut scene.material else { unreachable!() };
        law.cohesion = 1e4;
        assert_eq!(with(&mut scene, 0.1), "", "cohesion holds 0.1 m of it");
        scene.initial.stress = InitialStress::Hydrostatic;
        assert_eq!(told(&scene), "");
    }

    #[test]
    fn rings_without_viscosity_are_warned_of() {
        let mut scene = block(Space::Axisymmetric);
        assert_eq!(told(&scene), "");
        scene.numerics.viscosity = 0.0;
        assert!(told(&scene).contains("viscosity"));
        scene.space = Space::PlaneStrain;
        assert_eq!(told(&scene), "");
    }
}
