//! When space is cut anew, and by which weights: work decides, not how many particles a rank has.
//!
//! ```text
//! lists: candidates of each owned particle ─┐
//! processor time of this rank over 50 steps,├─▶ weights: what each particle takes in a step, ns
//! without waiting, over its candidates     ─┘        │ sum of a rank: its work
//!                                                    ▼
//! at every build of the lists: largest work over the mean ──▶ cut now, or not
//! ```
//!
//! So the pairs tell apart what is dense from what flies alone, and the time brings in all else a rank has to do: walls,
//! images, copies, laws, and how fast its processor is. Times differ from launch to launch, so the boxes do; results do not
//! depend on them.

use super::comm::Reduce;
use clap::ValueEnum;
use std::time::Duration;

/// Steps over which time is measured, at least.
const WINDOW: u64 = 50;
/// What a new measurement counts beside those before it.
const NEW: f64 = 0.3;
/// Work of a particle beside its pairs, in candidates.
pub const BESIDE_PAIRS: u64 = 60;
/// No particle counts as more than so many times the mean, or less than one part in so many of it: a rank's memory is filled by
/// particles, not by work.
const SPREAD: f64 = 2.0;
/// Weights are whole numbers: so many a nanosecond.
const PER_NS: f64 = 16.0;
/// Imbalance that is worth a migration (Yang et al. 2020 take 5 %, of numbers of particles).
const ENOUGH: f64 = 0.05;

/// What is shared out evenly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum By {
    /// Measured work
    #[default]
    Work,
    /// Numbers of particles
    Particles,
}

/// Watches how evenly the ranks work.
#[derive(Clone, Debug, Default)]
pub struct Balance {
    pub by: By,
    /// Work of each of this rank's particles, in candidates, since the lists were built.
    work: Vec<u32>,
    /// Particles of this rank when they had gone home to the boxes; none until then.
    planned: Option<u64>,
    window: Window,
    /// What a candidate takes on this rank, ns; none until it is measured.
    cost: Option<f64>,
    /// What a particle takes, a mean over all ranks, ns.
    mean: f64,
    /// The largest processor time of a rank over the mean, in the last window.
    measured: Option<f64>,
    patience: Patience,
}

/// The steps since time was last taken.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    begun: u64,
    /// Processor time of this rank then.
    computed: Duration,
    /// The step up to which work is counted.
    counted: u64,
    /// Work since then, in candidates, over all steps.
    work: f64,
}

impl Balance {
    /// Of a launch that begins with this step.
    pub fn from_step(step: u64) -> Self {
        Self { window: Window { begun: step, counted: step, ..Window::default() }, ..Self::default() }
    }

    /// Particles have gone home, and each of this rank's has a list of so many candidates.
    pub fn settled(&mut self, candidates: impl Iterator<Item = usize>) {
        self.work.clear();
        self.work.extend(candidates.map(|n| (n as u64 + BESIDE_PAIRS) as u32));
        self.planned.get_or_insert(self.work.len() as u64);
    }

    /// Says, before the next build, whether space is to be cut anew. `count`: number of all particles; `computed`: processor time
    /// of this rank so far, without waiting. Collective; one rank alone has no use for it.
    pub fn is_off(&mut self, count: u64, step: u64, computed: Duration, comm: &impl Reduce) -> bool {
        self.measure(count, step, computed, comm);
        let off = match self.by {
            By::Work => self.patience.ends(largest_over_mean(self.weights().sum(), comm)),
            By::Particles => {
                let mut off = [u64::from(self.planned.is_none_or(|then| changed(then, self.work.len() as u64)))];
                comm.sum(&mut off);
                off[0] > 0
            }
        };
        if off {
            self.planned = None;
        }
        off
    }

    /// Counts what was done since the last build; at the end of a window takes the time.
    fn measure(&mut self, count: u64, step: u64, computed: Duration, comm: &impl Reduce) {
        let work: u64 = self.work.iter().map(|&w| u64::from(w)).sum();
        let window = &mut self.window;
        window.work += work as f64 * step.saturating_sub(window.counted) as f64;
        window.counted = step;
        let steps = step.saturating_sub(window.begun);
        if steps < WINDOW {
            return;
        }
        let spent = computed.saturating_sub(window.computed).as_nanos() as u64;
        let done = std::mem::replace(window, Window { begun: step, computed, counted: step, work: 0.0 }).work;
        let mut all = [spent];
        comm.sum(&mut all);
        self.measured = Some(largest_over_mean(spent, comm));
        self.mean = all[0] as f64 / (count.max(1) * steps) as f64;
        let now = spent as f64 / done.max(1.0);
        self.cost = Some(self.cost.map_or(now, |before| (1.0 - NEW) * before + NEW * now));
    }

    /// Weights of this rank's particles: what each takes in a step; its candidates where no time has been taken yet.
    pub fn weights(&self) -> impl Iterator<Item = u64> + '_ {
        let ns = move |work: u32, cost: f64| (f64::from(work) * cost).clamp(self.mean / SPREAD, self.mean * SPREAD);
        let weight = move |work: u32| match (self.by, self.cost) {
            (By::Particles, _) => 1,
            (By::Work, None) => u64::from(work),
            (By::Work, Some(cost)) => ((PER_NS * ns(work, cost)) as u64).max(1),
        };
        self.work.iter().map(move |&work| weight(work))
    }

    /// The largest processor time of a rank over the mean, as last measured.
    pub fn measured(&self) -> Option<f64> {
        self.measured
    }
}

/// 1 where nobody has anything. Collective.
fn largest_over_mean(mine: u64, comm: &impl Reduce) -> f64 {
    let (mut all, mut largest) = ([mine], [mine as f64]);
    comm.sum(&mut all);
    comm.max(&mut largest);
    if all[0] == 0 { 1.0 } else { largest[0] * comm.size() as f64 / all[0] as f64 }
}

/// Has the number of particles of a rank changed by more than 5 % since the boxes were cut (Yang et al. 2020, section 3)?
/// An exact comparison of integers, to be joined over the ranks by a logical or.
pub fn changed(reference: u64, now: u64) -> bool {
    20 * now.abs_diff(reference) > reference
}

/// Hysteresis. Where a cut did not take away at least half of the imbalance, because what could be divided is, the next one waits
/// for twice as much, and comes back to the usual slowly.
#[derive(Clone, Copy, Debug)]
struct Patience {
    limit: f64,
    /// The imbalance before a cut at the last build.
    tried: Option<f64>,
}

impl Default for Patience {
    fn default() -> Self {
        Self { limit: ENOUGH, tried: None }
    }
}

impl Patience {
    fn ends(&mut self, imbalance: f64) -> bool {
        let excess = imbalance - 1.0;
        self.limit = match self.tried.take() {
            Some(before) if excess > 0.5 * before && excess > ENOUGH => 2.0 * excess,
            _ => ENOUGH + 0.98 * (self.limit - ENOUGH),
        };
        let ends = excess > self.limit;
        self.tried = ends.then_some(excess);
        ends
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many of the builds begin with a cut, if the imbalance is that after each number of cuts.
    fn cuts(builds: usize, imbalance: impl Fn(usize, usize) -> f64) -> usize {
        let mut patience = Patience::default();
        (0..builds).fold(0, |cuts, build| cuts + usize::from(patience.ends(imbalance(build, cuts))))
    }

    #[test]
    fn noise_moves_nothing_and_a_cut_that_helps_is_made_once() {
        assert_eq!(cuts(100, |build, _| if build % 2 == 0 { 1.01 } else { 1.045 }), 0);
        assert_eq!(cuts(100, |_, cuts| if cuts == 0 { 1.3 } else { 1.02 }), 1);
        // Load that goes on shifting is followed: 1 % a build, and each cut sets it back.
        assert_eq!(cuts(60, |build, cuts| 1.0 + 0.01 * build as f64 - 0.06 * cuts as f64), 9);
    }

    #[test]
    fn what_cannot_be_divided_is_not_tried_again_and_again() {
        let tried = cuts(1000, |_, _| 1.2);
        assert!((10..30).contains(&tried), "{tried}");
    }

    /// Two ranks, of which the other has so much.
    struct Beside(u64);

    impl Reduce for Beside {
        fn size(&self) -> usize {
            2
        }
        fn rank(&self) -> usize {
            0
        }
        fn sum(&self, values: &mut [u64]) {
            values[0] += self.0;
        }
        fn min(&self, _: &mut [f64]) {}
        fn max(&self, values: &mut [f64]) {
            values[0] = values[0].max(self.0 as f64);
        }
    }

    #[test]
    fn weights_are_candidates_and_then_the_time_they_took() {
        let mut balance = Balance::default();
        let us = Duration::from_micros;
        balance.settled([0, 60, 120].into_iter());
        // 60, 120 and 180 candidates; the other rank's are as many.
        assert!(!balance.is_off(6, 10, us(10), &Beside(360)) && balance.measured().is_none());
        assert!(balance.weights().eq([60, 120, 180]));
        // 360 candidates in each of 50 steps, 90 us: 5 ns each. The others took 30 us in all, so the mean is 400 ns a particle, and
        // none counts less than half of it, or more than twice.
        balance.is_off(6, 50, us(90), &Beside(30_000));
        assert_eq!(balance.measured(), Some(1.5));
        assert!(balance.weights().eq([300, 600, 800].map(|ns| 16 * ns)));
        // What is measured anew counts for a part: 3 ns make 4.4.
        balance.settled([0, 60, 120].into_iter());
        balance.is_off(6, 100, us(144), &Beside(54_000));
        assert_eq!(balance.measured(), Some(1.0));
        assert_eq!(balance.weights().nth(1), Some((16.0_f64 * 120.0 * 4.4) as u64));
    }

    /// Steps of earlier launches took no time in this one.
    #[test]
    fn a_launch_that_goes_on_measures_its_own_steps() {
        let measured = |first: u64| {
            let mut balance = Balance::from_step(first);
            balance.settled([0, 60, 120].into_iter());
            balance.is_off(6, first + 49, Duration::from_micros(89), &Beside(30_000));
            assert!(balance.measured().is_none());
            balance.is_off(6, first + 50, Duration::from_micros(90), &Beside(30_000));
            balance.weights().collect::<Vec<_>>()
        };
        assert_eq!(measured(0), measured(1_000_000));
    }

    #[test]
    fn by_particles_5_percent_more_or_less_count() {
        let mut balance = Balance { by: By::Particles, ..Balance::default() };
        let mut off = |owned: usize| {
            balance.settled(vec![0; owned].into_iter());
            assert!(balance.weights().all(|weight| weight == 1));
            balance.is_off(200, 0, Duration::ZERO, &Beside(0))
        };
        assert!(!off(100) && !off(105) && !off(95) && off(106));
        // Since the last cut.
        assert!(!off(90) && !off(94) && off(95));
    }
}
