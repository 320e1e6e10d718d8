//! Periodic axes: what leaves at one end comes in at the other.
//!
//! Particles go on beyond the border until lists are built; then they are wrapped. That must not show in the answer, so
//! places along a periodic axis are whole multiples of a quantum ([`PeriodicAxis`]): a shift by the period is exact, and
//! so is the distance between any two particles, on whichever side of the border each of them is told.

use crate::algebra::Vector;
use crate::space::Space;
use formats::scene::{PeriodicAxis, Scene};

/// The periodic axes of a scene, by coordinate.
#[derive(Clone, Debug, Default)]
pub struct Periods<const D: usize>(Vec<(usize, PeriodicAxis)>);

impl<const D: usize> Periods<D> {
    /// Those of a scene.
    pub fn new<const N: usize, S: Space<D, N>>(scene: &Scene) -> Self {
        Self((0..3).filter_map(|axis| Some((S::axis(axis)?, scene.periodic_axis(axis)?))).collect())
    }

    /// A displacement rounded to the quantum: whatever moves a particle adds one of these, which is exact. (A rounding
    /// after the addition would depend on the side of the border.)
    pub fn rounded(&self, mut x: Vector<D>) -> Vector<D> {
        for &(a, axis) in &self.0 {
            x.0[a] = axis.round(x.0[a]);
        }
        x
    }

    /// Brings places back between the ends.
    pub fn wrap(&self, x: &mut [Vector<D>]) {
        for x in x {
            *x = self.wrapped(*x);
        }
    }

    /// A place between the ends.
    pub fn wrapped(&self, mut x: Vector<D>) -> Vector<D> {
        for &(a, axis) in &self.0 {
            x.0[a] = axis.wrap(x.0[a]);
        }
        x
    }

    /// Does the scene repeat itself along no axis?
    pub fn are_none(&self) -> bool {
        self.0.is_empty()
    }

    /// Shifts from a particle to its copies, the particle itself first: three places along every periodic axis.
    pub fn shifts(&self) -> Vec<Vector<D>> {
        // -0 changes no bit of what it is added to.
        let mut shifts = vec![Vector([-0.0; D])];
        for &(a, axis) in &self.0 {
            for factor in [-1.0, 1.0] {
                for k in 0..shifts.len() {
                    if shifts[k].0[a] == 0.0 {
                        let mut shift = shifts[k];
                        shift.0[a] = factor * axis.length;
                        shifts.push(shift);
                    }
                }
            }
        }
        shifts
    }
}
