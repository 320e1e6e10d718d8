//! Shifting of particles towards an even arrangement, inside the body only.

use crate::algebra::Vector;
use crate::lanes::Lanes;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Block, Needs, Pair, Pairs, Sums};

/// Constant A of Skillen, Lind, Stansby & Rogers (2013) where the scene asks for shifting = 1.
const STRENGTH: f64 = 2.0;
/// Share of the full divergence of positions, sum_j V_j x_ji . grad W = D, below which a particle is at a free surface
/// (Lee et al. 2008 take 0.75). On a lattice it is 0.98 inside, 0.92 in the second layer, 0.7 in the first.
const INSIDE: f64 = 0.85;
/// Largest shift over spacing in one step.
pub const LARGEST: f64 = 0.05;

/// 1 for the owned particles at a free surface, 0 for all others.
pub fn surface<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    surface: &mut Vec<f64>,
) {
    surface.clear();
    surface.resize(particles.owned, 0.0);
    let mut sums = Divergence { divergence: surface };
    neighbors.sweep::<K, f64>(pairs, &mut sums);
    for divergence in surface {
        *divergence = if *divergence < INSIDE * D as f64 { 1.0 } else { 0.0 };
    }
}

/// sum_j V_j x_ji . grad_i W_ij
struct Divergence<'a> {
    divergence: &'a mut [f64],
}

impl<const D: usize> Sums<D, f64> for Divergence<'_> {
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let mut sum = block.number(0.0);
        for pair in pairs {
            let weight = block.same(-pair.other.weight) * pair.slope;
            sum = pair.d.norm2().multiply_add(weight, sum);
        }
        block.put(self.divergence, sum);
    }
}

/// What is shifted, and how far.
#[derive(Clone, Copy, Debug)]
pub struct Shifting<'a> {
    /// Strength, 1 for the constant of Skillen et al.
    pub strength: f64,
    /// Length of the step, s.
    pub dt: f64,
    /// [`surface`] of all particles; 0 behind walls.
    pub surface: &'a [f64],
}

/// The shift of every owned particle in a step, m: -A h |v| dt grad C with the concentration gradient
/// grad C = sum_j V_j grad_i W_ij (Lind et al. 2012; Skillen et al. 2013). 0 where the support reaches a free surface: there
/// the gradient points into the body whatever the arrangement, and would press layers against the outermost one.
pub fn shift<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    shifting: Shifting<'_>,
    shift: &mut Vec<Vector<D>>,
) {
    let Shifting { strength, dt, surface } = shifting;
    shift.clear();
    shift.resize(particles.owned, Vector::default());
    let mut open = vec![0.0; particles.owned];
    let mut sums = Concentration { surface, gradient: shift, open: &mut open };
    neighbors.sweep::<K, f64>(pairs, &mut sums);
    for (i, shift) in shift.iter_mut().enumerate() {
        let way = *shift * (-STRENGTH * strength * pairs.h * particles.v[i].norm() * dt);
        let scale = (LARGEST * pairs.spacing / way.norm().max(f64::MIN_POSITIVE)).min(1.0);
        *shift = if open[i] > 0.0 { Vector::default() } else { way * scale };
    }
}

/// grad C, and where the support reaches a free surface.
struct Concentration<'a, const D: usize> {
    surface: &'a [f64],
    gradient: &'a mut [Vector<D>],
    open: &'a mut [f64],
}

impl<const D: usize> Sums<D, f64> for Concentration<'_, D> {
    const NEEDS: Needs = Needs { value: true, ..Needs::SLOPE };

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let mut sum: Vector<D, L> = block.zero();
        let mut open = block.own_numbers(self.surface);
        for pair in pairs {
            let weight = block.same(pair.other.weight) * pair.slope;
            sum.add_scaled(weight, pair.d);
            // Of candidates outside the support none counts.
            open = pair.value.multiply_add(block.same(self.surface[pair.j]), open);
        }
        block.put(self.gradient, sum);
        block.put(self.open, open);
    }
}
