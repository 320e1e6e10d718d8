//! The only loop over pairs of particles. It gathers into one particle, over its neighbours in ascending key: the sums,
//! and so the bits of the answer, do not depend on ranks, on lists, or on restarts. What is summed is in [`crate::rates`].

use crate::algebra::Vector;
use crate::particles::Particles;
use crate::physics::Kernel;

/// What the sweeps need to know beside the particles.
#[derive(Clone, Copy, Debug)]
pub struct Pairs {
    /// Smoothing length h, m.
    pub h: f64,
    /// Lattice spacing dx, m.
    pub spacing: f64,
}

/// Scales that turn the kernel's pure numbers into W and grad W for one smoothing length.
#[derive(Clone, Copy)]
pub struct Scales {
    support2: f64,
    per_h: f64,
    value: f64,
    slope: f64,
}

impl Scales {
    /// For D dimensions and the smoothing length `h`.
    pub fn new<const D: usize, K: Kernel>(h: f64) -> Self {
        let value = K::KIND.norm(D) / h.powi(D as i32);
        Self { support2: 4.0 * h * h, per_h: 1.0 / h, value, slope: value / (h * h) }
    }

    /// W at a squared distance.
    #[inline(always)]
    pub fn value<K: Kernel>(&self, r2: f64) -> f64 {
        self.value * K::KIND.shape(r2.sqrt() * self.per_h)
    }
}

/// A neighbour within the support of the kernel.
#[derive(Clone, Copy, Debug)]
pub struct Pair<const D: usize> {
    /// Its index.
    pub j: usize,
    /// x_i - x_j.
    pub d: Vector<D>,
    /// |d|^2.
    pub r2: f64,
    /// grad_i W = slope d.
    pub slope: f64,
}

/// Calls `visit` with every particle of `list` within the support around particle `i`, in the order of the list.
#[inline(always)]
pub fn around<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    list: &[u32],
    scales: Scales,
    i: usize,
    mut visit: impl FnMut(Pair<D>),
) {
    let x = particles.x[i];
    for &j in list {
        let j = j as usize;
        let d = x - particles.x[j];
        let r2 = d.norm2();
        if r2 < scales.support2 {
            let slope = scales.slope * K::KIND.slope_over_q(r2.sqrt() * scales.per_h);
            visit(Pair { j, d, r2, slope });
        }
    }
}

/// Calls `visit` with the value of the kernel for every particle of `list` around particle `i`, 0 outside of the support.
#[inline(always)]
pub fn values<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    list: &[u32],
    scales: Scales,
    i: usize,
    mut visit: impl FnMut(usize, f64),
) {
    let x = particles.x[i];
    for &j in list {
        let r2 = (x - particles.x[j as usize]).norm2();
        visit(j as usize, if r2 < scales.support2 { scales.value::<K>(r2) } else { 0.0 });
    }
}
