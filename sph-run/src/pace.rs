//! How fast a launch goes, measured as it goes: when the next checkpoint is due, and when to stop before a limit.
//!
//! All times are durations since the start of the launch by a monotonic clock: the time of day may jump.

use formats::checkpoint;
use std::time::Duration;

/// The first checkpoint of a run comes after this, so that the cost of one is known early.
pub const FIRST_CHECKPOINT: Duration = Duration::from_secs(60);
/// What a stop takes besides steps and writes: agreeing, closing files, leaving MPI.
const LEAVING: f64 = 2.0;
/// The longest step is forgotten by this factor a step, the longest write a write.
const STEP_FADES: f64 = 0.999;
const WRITE_FADES: f64 = 0.9;
/// One step counts at most this many times the longest before it (or 1 s): a process that is stopped for an hour has
/// one step of an hour, which says nothing about the next. Steps that did become slower are believed in a few steps.
const LEAP: f64 = 8.0;

/// What was measured of a launch; durations in seconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    longest_step: f64,
    longest_write: f64,
    /// Mean cost of a checkpoint, recent ones first.
    cost: Option<f64>,
    /// What an earlier launch measured.
    stated_cost: Option<f64>,
}

impl Pace {
    /// At the start of a launch; `stated_cost`: what the last checkpoint of an earlier launch took, if there is one.
    pub fn new(stated_cost: Option<Duration>) -> Self {
        let stated_cost = stated_cost.map(|cost| cost.as_secs_f64());
        Self { longest_write: stated_cost.unwrap_or(0.0), stated_cost, ..Self::default() }
    }

    /// A step took this long, without outputs.
    pub fn stepped(&mut self, took: Duration) {
        let took = took.as_secs_f64().min(LEAP * self.longest_step.max(1.0));
        self.longest_step = took.max(STEP_FADES * self.longest_step);
    }

    /// A snapshot took this long.
    pub fn wrote_snapshot(&mut self, took: Duration) {
        self.longest_write = took.as_secs_f64().max(WRITE_FADES * self.longest_write);
    }

    /// A checkpoint took this long.
    pub fn wrote_checkpoint(&mut self, took: Duration) {
        self.wrote_snapshot(took);
        let took = took.as_secs_f64();
        self.cost = Some(self.cost.map_or(took, |cost| 0.5 * (cost + took)));
    }

    /// Computing time between two checkpoints on a machine that fails every `mtbf` on average, by [`checkpoint::interval`].
    pub fn checkpoint_interval(&self, mtbf: Duration) -> Duration {
        let Some(cost) = self.cost.or(self.stated_cost) else { return FIRST_CHECKPOINT };
        Duration::from_secs_f64(checkpoint::interval(cost, mtbf.as_secs_f64()))
    }

    /// How long before a limit a run must begin to stop: a step, a snapshot that falls due in it, the checkpoint.
    pub fn margin(&self) -> Duration {
        Duration::from_secs_f64(self.longest_step + 2.0 * self.longest_write + LEAVING)
    }

    /// Can a launch begin with this much time?
    ///
    /// # Errors
    /// What is wrong and what would be right, where the limit is shorter than the margin.
    pub fn check_limit(&self, left: Duration) -> Result<(), String> {
        let margin = self.margin();
        if left > margin {
            return Ok(());
        }
        Err(format!(
            "{:.1} s are left of the wall limit, too little to compute: stopping with a checkpoint takes up to {:.1} s; \
             give more time",
            left.as_secs_f64(),
            margin.as_secs_f64()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::checkpoint::optimum;

    fn seconds(s: f64) -> Duration {
        Duration::from_secs_f64(s)
    }

    /// The captions of figures 3, 4 and 5 of the paper: minutes.
    #[test]
    fn interval_has_the_values_of_the_paper() {
        assert!((optimum(5.0, 24.0 * 60.0) - 117.0).abs() < 0.5);
        assert!((optimum(5.0, 6.0 * 60.0) - 57.0).abs() < 0.5);
        assert!((optimum(5.0, 15.0) - 9.1).abs() < 0.05);
        // Where a checkpoint takes as long as the machine lives.
        assert_eq!(optimum(30.0, 15.0), 15.0);
        assert_eq!(optimum(100.0, 15.0), 15.0);
    }

    /// The interval makes the expected time of Daly's complete model least: M exp(R/M) (exp((tau + delta)/M) - 1) T/tau.
    #[test]
    fn interval_is_the_best() {
        let time = |tau: f64, delta: f64, m: f64| ((tau + delta) / m).exp_m1() / tau;
        for (delta, m) in [(1.0, 1e5), (10.0, 1e4), (60.0, 3600.0), (300.0, 3600.0)] {
            let best = optimum(delta, m);
            let there = time(best, delta, m);
            for factor in [0.5, 0.8, 1.25, 2.0] {
                assert!(time(factor * best, delta, m) > there, "{delta} s, {m} s, {factor}");
            }
        }
    }

    #[test]
    fn writing_takes_five_percent_at_most() {
        for m in [1.0, 60.0, 3600.0, 86_400.0, 1e9] {
            for delta in [1e-6, 1e-3, 0.1, 1.0, 10.0, 100.0, 1e4, 1e6] {
                let mut pace = Pace::new(None);
                pace.wrote_checkpoint(seconds(delta));
                let interval = pace.checkpoint_interval(seconds(m)).as_secs_f64();
                assert!(delta / (interval + delta) <= 0.05 + 1e-9, "{delta} s, {m} s: every {interval} s");
            }
        }
        // Also where each write differs from the one before.
        let (mut pace, mut writing, mut all) = (Pace::new(None), 0.0, 0.0);
        for i in 0..1000 {
            let delta = [0.2, 3.0, 0.5, 11.0, 0.1][i % 5];
            pace.wrote_checkpoint(seconds(delta));
            writing += delta;
            all += delta + pace.checkpoint_interval(seconds(60.0)).as_secs_f64();
        }
        assert!(writing / all < 0.0501, "{}", writing / all);
    }

    #[test]
    fn first_checkpoint_comes_early_unless_its_cost_is_stated() {
        let day = seconds(86_400.0);
        assert_eq!(Pace::new(None).checkpoint_interval(day), FIRST_CHECKPOINT);
        let mut pace = Pace::new(Some(seconds(2.0)));
        assert!((pace.checkpoint_interval(day).as_secs_f64() - optimum(2.0, 86_400.0)).abs() < 1e-6);
        // What is measured counts more: another machine, other ranks.
        pace.wrote_checkpoint(seconds(8.0));
        assert!((pace.checkpoint_interval(day).as_secs_f64() - optimum(8.0, 86_400.0)).abs() < 1e-6);
    }

    #[test]
    fn slow_steps_and_slow_writes_stop_earlier() {
        let stop = |step: f64, snapshot: f64, checkpoint: f64| {
            let mut pace = Pace::new(None);
            for _ in 0..10 {
                pace.stepped(seconds(step));
            }
            pace.wrote_snapshot(seconds(snapshot));
            pace.wrote_checkpoint(seconds(checkpoint));
            let deadline = seconds(1000.0);
            let first = (0..10_000).map(|i| seconds(0.1 * f64::from(i))).find(|now| *now + pace.margin() >= deadline);
            first.unwrap().as_secs_f64()
        };
        assert!((stop(0.5, 0.1, 3.0) - (1000.0 - 0.5 - 6.0 - 2.0)).abs() < 0.11);
        assert!((stop(20.0, 0.1, 3.0) - (1000.0 - 20.0 - 6.0 - 2.0)).abs() < 0.11);
        assert!((stop(0.5, 0.1, 50.0) - (1000.0 - 0.5 - 100.0 - 2.0)).abs() < 0.11);
        // A slow snapshot too, though the checkpoint after it was quick: by then it is a tenth forgotten.
        assert!((stop(0.5, 50.0, 3.0) - (1000.0 - 0.5 - 90.0 - 2.0)).abs() < 0.11);
    }

    #[test]
    fn one_hour_asleep_is_no_reason_to_stop() {
        let mut pace = Pace::new(None);
        for _ in 0..100 {
            pace.stepped(seconds(0.1));
        }
        pace.stepped(seconds(3600.0));
        assert!(pace.margin() <= seconds(LEAP + LEAVING), "{:?}", pace.margin());
        for _ in 0..5000 {
            pace.stepped(seconds(0.1));
        }
        assert!(pace.margin() < seconds(0.2 + LEAVING), "{:?}", pace.margin());
    }

    #[test]
    fn steps_that_became_slow_are_believed() {
        let mut pace = Pace::new(None);
        for step in [0.1, 0.1, 100.0, 100.0, 100.0] {
            pace.stepped(seconds(step));
        }
        assert!((pace.margin().as_secs_f64() - 100.0 - LEAVING).abs() < 1e-9);
    }

    #[test]
    fn a_slow_write_is_forgotten_slowly() {
        let mut pace = Pace::new(None);
        pace.wrote_snapshot(seconds(100.0));
        pace.wrote_snapshot(seconds(1.0));
        assert!(pace.margin() > seconds(180.0));
        for _ in 0..50 {
            pace.wrote_snapshot(seconds(1.0));
        }
        assert!((pace.margin().as_secs_f64() - 2.0 - LEAVING).abs() < 1e-9);
    }

    #[test]
    fn a_limit_shorter_than_the_margin_is_refused() {
        assert!(Pace::new(None).check_limit(seconds(3.0)).is_ok());
        let error = Pace::new(None).check_limit(seconds(1.0)).unwrap_err();
        assert!(error.contains("1.0 s") && error.contains("2.0 s"), "{error}");
        assert!(Pace::new(Some(seconds(30.0))).check_limit(seconds(50.0)).is_err());
        assert!(Pace::new(Some(seconds(30.0))).check_limit(seconds(70.0)).is_ok());
    }
}
