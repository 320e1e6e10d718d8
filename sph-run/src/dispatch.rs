//! From the scene's choices to types: the one place where space, kernel and material become type parameters.

use crate::material::{DruckerPrager, Material, MuI, ViscoPlastic};
use crate::physics::{CubicSpline, Kernel, Model, Physics, WendlandC2};
use crate::space::{Axisymmetric, PlaneStrain, ThreeD};
use formats::scene::{Material as Law, Scene};
use formats::{kernel, space};

/// What is to be done once the types are known.
pub trait Job {
    type Output;
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) -> Self::Output;
}

/// Runs the job with the types the scene asks for: one match an axis.
pub fn resolve<J: Job>(scene: &Scene, job: J) -> J::Output {
    match &scene.material {
        Law::DruckerPrager(law) => with_material(scene, DruckerPrager::new(law), job),
        Law::MuI(law) => with_material(scene, MuI::new(law, scene), job),
        Law::ViscoPlastic(law) => with_material(scene, ViscoPlastic::new(law), job),
    }
}

fn with_material<J: Job, M: Material + 'static>(scene: &Scene, material: M, job: J) -> J::Output {
    match scene.kernel {
        kernel::Kernel::CubicSpline => with_kernel::<J, CubicSpline, M>(scene, material, job),
        kernel::Kernel::WendlandC2 => with_kernel::<J, WendlandC2, M>(scene, material, job),
    }
}

fn with_kernel<J: Job, K: Kernel, M: Material + 'static>(scene: &Scene, material: M, job: J) -> J::Output {
    match scene.space {
        space::Space::PlaneStrain => job.run::<2, 4, Model<PlaneStrain, K, M>>(material),
        space::Space::Axisymmetric => job.run::<2, 4, Model<Axisymmetric, K, M>>(material),
        space::Space::ThreeD => job.run::<3, 6, Model<ThreeD, K, M>>(material),
    }
}
