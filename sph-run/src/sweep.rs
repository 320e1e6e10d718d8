//! The only loops over pairs of particles: one finds those within the support, one goes through them, one takes the
//! kernel's values around a wall particle. Sums gather
//! into one particle, over its neighbours in ascending key: they, and so the bits of the answer, do not depend on ranks,
//! on lists, or on restarts. What is summed is in [`crate::rates`].

use crate::algebra::Vector;
use crate::neighbors::Lists;
use crate::particles::Particles;
use crate::physics::Kernel;

/// What rates need to know beside the particles.
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

/// The pairs within the support of the kernel, found once a step: every sum of the step runs over them.
#[derive(Clone, Debug, Default)]
pub struct Support {
    starts: Vec<u32>,
    found: Vec<Found>,
}

/// A neighbour within the support, and W'/r there.
#[derive(Clone, Copy, Debug)]
struct Found {
    j: u32,
    slope: f64,
}

impl Support {
    /// Finds the particles of the lists that are within the support now, in the order of the lists.
    pub fn find<const D: usize, const N: usize, K: Kernel>(
        &mut self,
        particles: &Particles<D, N>,
        lists: &Lists,
        h: f64,
    ) {
        let scales = Scales::new::<D, K>(h);
        self.starts.clear();
        self.found.clear();
        self.starts.push(0);
        for i in 0..particles.owned {
            let x = particles.x[i];
            for &j in lists.of(i) {
                let r2 = (x - particles.x[j as usize]).norm2();
                if r2 < scales.support2 {
                    let slope = scales.slope * K::KIND.slope_over_q(r2.sqrt() * scales.per_h);
                    self.found.push(Found { j, slope });
                }
            }
            self.starts.push(self.found.len() as u32);
        }
    }
}

/// A neighbour within the support of the kernel.
#[derive(Clone, Copy, Debug)]
pub struct Pair<const D: usize> {
    /// Its index.
    pub j: usize,
    /// x_i - x_j.
    pub d: Vector<D>,
    /// grad_i W = slope d.
    pub slope: f64,
}

impl<const D: usize> Pair<D> {
    /// |d|^2.
    #[inline(always)]
    pub fn r2(&self) -> f64 {
        self.d.norm2()
    }
}

/// Calls `visit` with every particle within the support around the owned particle `i`, in ascending key.
#[inline(always)]
pub fn around<const D: usize, const N: usize>(
    particles: &Particles<D, N>,
    support: &Support,
    i: usize,
    mut visit: impl FnMut(Pair<D>),
) {
    let x = particles.x[i];
    for &Found { j, slope } in &support.found[support.starts[i] as usize..support.starts[i + 1] as usize] {
        let j = j as usize;
        visit(Pair { j, d: x - particles.x[j], slope });
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
