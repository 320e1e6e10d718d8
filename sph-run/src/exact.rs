//! Sums that do not depend on the order of their terms: fixed-point numbers in 128-bit integers.

use crate::parallel::comm::Reduce;

/// Bits a sum may use above its unit; what is left of 127 is headroom.
const BITS: i32 = 96;

/// A sum of terms whose total stays well below some bound.
#[derive(Clone, Copy, Debug)]
pub struct Sum {
    unit: f64,
    total: i128,
}

impl Sum {
    /// An empty sum. Terms are rounded to about `bound` times 2^-96; a total up to 2^30 `bound` is safe.
    pub fn new(bound: f64) -> Self {
        let exponent = if bound > 0.0 && bound.is_finite() { bound.log2().ceil() as i32 } else { 0 };
        Self { unit: (f64::from(exponent - BITS)).exp2(), total: 0 }
    }

    /// Adds a term.
    pub fn add(&mut self, term: f64) {
        self.total = self.total.saturating_add((term / self.unit) as i128);
    }

    /// The total.
    pub fn value(&self) -> f64 {
        self.total as f64 * self.unit
    }
}

/// Adds up each of some sums over all ranks. Collective.
pub fn reduce(comm: &impl Reduce, sums: &mut [Sum]) {
    // Limbs of 32 bits in words of 64: no overflow below 2^32 ranks; two's complement wraps as it should.
    let limb = |total: i128, k: usize| (total >> (32 * k)) as u64 & 0xffff_ffff;
    let mut limbs: Vec<u64> = sums.iter().flat_map(|s| (0..4).map(|k| limb(s.total, k))).collect();
    comm.sum(&mut limbs);
    for (sum, limbs) in sums.iter_mut().zip(limbs.chunks_exact(4)) {
        let shifted = limbs.iter().enumerate().map(|(k, &l)| i128::from(l) << (32 * k));
        sum.total = shifted.fold(0, i128::wrapping_add);
    }
}

#[cfg(test)]
mod tests {
    use super::Sum;

    #[test]
    fn the_order_of_terms_does_not_matter() {
        let terms: Vec<f64> = (1..1000).map(|k| (f64::from(k) * 0.7).sin() / f64::from(k)).collect();
        let sum = |terms: &mut dyn Iterator<Item = &f64>| {
            let mut sum = Sum::new(10.0);
            terms.for_each(|&t| sum.add(t));
            sum.value()
        };
        let forward = sum(&mut terms.iter());
        let backward = sum(&mut terms.iter().rev());
        assert_eq!(forward.to_bits(), backward.to_bits());
        let plain: f64 = terms.iter().sum();
        assert!((forward - plain).abs() < 1e-13, "{forward} {plain}");
    }
}
