//! Periodic axes. Places on them are whole multiples of a quantum, far below any length that matters, so that a shift by
//! the period is exact: the difference of two places has the same bits on whichever side of the border they are told.

use super::Scene;

/// A periodic axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodicAxis {
    /// Lower end, m; the upper one is the same place.
    pub from: f64,
    /// The period L, m.
    pub length: f64,
    quantum: f64,
}

impl PeriodicAxis {
    /// From the two ends, which are rounded to the quantum: 2^-51 of the largest coordinate two periods around, or less.
    pub fn new([from, to]: [f64; 2]) -> Self {
        let largest = from.abs().max(to.abs()) + 2.0 * (to - from);
        let quantum = 2f64.powi(largest.log2().ceil() as i32 - 52);
        let mut period = Self { from, length: to - from, quantum };
        (period.from, period.length) = (period.round(from), period.round(to) - period.round(from));
        period
    }

    /// The nearest multiple of the quantum.
    pub fn round(&self, x: f64) -> f64 {
        // Exact but for the rounding to a whole number: the quantum is a power of two.
        (x / self.quantum).round_ties_even() * self.quantum
    }

    /// The same place within the ends, the upper one excluded.
    pub fn wrap(&self, x: f64) -> f64 {
        let x = self.round(x);
        x - ((x - self.from) / self.length).floor() * self.length
    }
}

impl Scene {
    /// The axis, if it is periodic.
    pub fn periodic_axis(&self, axis: usize) -> Option<PeriodicAxis> {
        self.periodic[axis].map(PeriodicAxis::new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_are_exact_and_wrapping_forgets_them() {
        for ends in [[0.0, 0.3], [-0.1, 0.2], [1e3 + 0.1, 1e3 + 0.4], [-7.3, -6.9]] {
            let period = PeriodicAxis::new(ends);
            let l = period.length;
            assert!((l / (ends[1] - ends[0]) - 1.0).abs() < 1e-11);
            for k in 0..1000 {
                let x = period.round(ends[0] + l * f64::from(k) / 1000.0 + 1e-4);
                let y = period.round(x + 0.0371);
                assert!((x - ends[0] - l * f64::from(k) / 1000.0 - 1e-4).abs() < 1e-15 * ends[0].abs().max(1.0));
                for shift in [-l, l, 2.0 * l] {
                    assert_eq!((x + shift) - shift, x);
                    assert_eq!((y + shift) - (x + shift), y - x);
                    assert_eq!(period.wrap(x + shift), period.wrap(x));
                }
            }
        }
    }

    #[test]
    fn the_upper_end_is_the_lower_one() {
        let period = PeriodicAxis::new([-0.1, 0.2]);
        let upper = period.from + period.length;
        assert_eq!(period.wrap(upper), period.from);
        let below = upper - period.quantum;
        assert!(below < upper && period.wrap(below) == below);
        assert_eq!(period.wrap(period.from - period.quantum), below);
        assert_eq!(period.wrap(period.from + 5.0 * period.length), period.from);
    }
}
