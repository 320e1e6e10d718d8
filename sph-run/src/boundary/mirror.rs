//! Mirror images behind the planes of symmetry x = 0 and y = 0; the axis of the axisymmetric space is one such plane.

use crate::algebra::Vector;
use crate::boundary::field::Field;
use crate::particles::{Particles, id, key};
use crate::space::Space;

/// One mirror image: which particle, through which planes.
#[derive(Clone, Copy, Debug)]
pub struct Image {
    source: u32,
    /// Bit 0: through x = 0; bit 1: through y = 0.
    planes: u8,
}

/// The planes of symmetry of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Mirrors {
    /// Is x = 0, y = 0 a plane of symmetry?
    pub planes: [bool; 2],
}

impl Mirrors {
    /// Appends the images of owned and halo particles that lie within `reach(x)` of a plane.
    pub fn create<const D: usize, const N: usize, S: Space<D, N>>(
        self,
        particles: &mut Particles<D, N>,
        reach: impl Fn(Vector<D>) -> f64,
    ) -> Vec<Image> {
        debug_assert_eq!(particles.halo, particles.len());
        let mut images = Vec::new();
        for i in 0..particles.halo {
            let x = particles.x[i];
            let reach = reach(x);
            let close = |plane: usize| self.planes[plane] && S::axis(plane).is_some_and(|axis| x.0[axis] < reach);
            let near = u8::from(close(0)) | u8::from(close(1)) << 1;
            for planes in 1..=near {
                if planes & near == planes {
                    images.push(Image { source: i as u32, planes });
                    particles.key.push(key(id(particles.key[i]), planes));
                }
            }
        }
        let len = particles.key.len();
        particles.resize(len);
        particles.mirror = len;
        images
    }

    /// Refreshes positions, velocities and volumes of the images.
    pub fn fill_motion<const D: usize, const N: usize, S: Space<D, N>>(p: &mut Particles<D, N>, images: &[Image]) {
        for (k, image) in images.iter().enumerate() {
            let (i, j) = (p.halo + k, image.source as usize);
            p.x[i] = reflect::<D, N, S>(p.x[j], image.planes);
            p.v[i] = reflect::<D, N, S>(p.v[j], image.planes);
            p.volume[i] = p.volume[j];
        }
    }

    /// Refreshes stresses and volumes of the images.
    pub fn fill_stress<const D: usize, const N: usize, S: Space<D, N>>(p: &mut Particles<D, N>, images: &[Image]) {
        for (k, image) in images.iter().enumerate() {
            let (i, j) = (p.halo + k, image.source as usize);
            let through = [image.planes & 1 != 0, image.planes & 2 != 0, false];
            p.stress[i] = S::stress_from_disk(reflect_stress(S::stress_to_disk(p.stress[j]), through));
            p.volume[i] = p.volume[j];
        }
    }

    /// Gives a field that owned particles and their copies have to their images too, and zero to wall particles.
    pub fn spread<const D: usize, const N: usize, S: Space<D, N>, T: Field<D, N>>(
        p: &Particles<D, N>,
        images: &[Image],
        field: &mut Vec<T>,
    ) {
        field.truncate(p.halo);
        for image in images {
            let through = [image.planes & 1 != 0, image.planes & 2 != 0, false];
            field.push(field[image.source as usize].reflected::<S>(through));
        }
        field.resize(p.len(), T::zero());
    }

    /// Puts an owned particle that crossed a plane back, as its own image.
    pub fn keep_inside<const D: usize, const N: usize, S: Space<D, N>>(self, p: &mut Particles<D, N>) {
        for (plane, _) in self.planes.iter().enumerate().filter(|(_, on)| **on) {
            let Some(axis) = S::axis(plane) else { continue };
            for i in 0..p.owned {
                if p.x[i].0[axis] < 0.0 {
                    let planes = 1 << plane;
                    p.x[i] = reflect::<D, N, S>(p.x[i], planes);
                    p.v[i] = reflect::<D, N, S>(p.v[i], planes);
                    let through = [plane == 0, plane == 1, false];
                    p.stress[i] = S::stress_from_disk(reflect_stress(S::stress_to_disk(p.stress[i]), through));
                }
            }
        }
    }
}

fn reflect<const D: usize, const N: usize, S: Space<D, N>>(mut x: Vector<D>, planes: u8) -> Vector<D> {
    for plane in 0..2 {
        if let (true, Some(axis)) = (planes & (1 << plane) != 0, S::axis(plane)) {
            x.0[axis] = -x.0[axis];
        }
    }
    x
}

/// M sigma M for a reflection M of some axes: exactly the shears with one reflected index change sign.
pub fn reflect_stress(mut s: [f64; 6], through: [bool; 3]) -> [f64; 6] {
    for (component, (a, b)) in [(3, (0, 1)), (4, (1, 2)), (5, (0, 2))] {
        if through[a] != through[b] {
            s[component] = -s[component];
        }
    }
    s
}
