//! When a launch has to end, by a user's limit or its job's.

use crate::cli::WallLimit;
use crate::scheduler;
use formats::news::{Level, tell};
use std::time::{Duration, Instant, SystemTime};

/// What a job needs after this program has ended: mpirun waits a while for ranks that end with a code, and the script has
/// something to say.
const AFTERWARDS: Duration = Duration::from_secs(5);

/// The end of a launch, as rank 0 knows it; on other ranks there is none.
#[derive(Clone, Debug, Default)]
pub struct Deadline {
    /// By a monotonic clock: the time of day may jump.
    at: Option<Instant>,
    /// By the time of day, for people.
    shown: Option<SystemTime>,
    /// The scheduler's job.
    pub job: Option<String>,
}

impl Deadline {
    /// Of a launch that began at `start`. Asks the scheduler where the limit is `auto`; news go to standard error.
    pub fn find(limit: WallLimit, start: Instant, quiet: bool) -> Self {
        let environment = |name: &str| std::env::var(name).ok();
        let job = scheduler::job_id(environment);
        let (from, left) = match limit {
            WallLimit::None => (start, None),
            WallLimit::Of(time) => (start, Some(time)),
            WallLimit::Auto => {
                let found = scheduler::time_left(environment, scheduler::ask, SystemTime::now());
                if let Some(warning) = found.warning {
                    tell(Level::Warning, &warning);
                }
                if let (Some(allowance), false) = (&found.allowance, quiet) {
                    let left = humantime::format_duration(Duration::from_secs(allowance.left.as_secs()));
                    tell(Level::Note, &format!("the job has {left} left ({})", allowance.source));
                }
                (Instant::now(), found.allowance.map(|allowance| allowance.left.saturating_sub(AFTERWARDS)))
            }
        };
        let at = left.and_then(|left| from.checked_add(left));
        let shown = at.and_then(|at| SystemTime::now().checked_add(at.saturating_duration_since(Instant::now())));
        Self { at, shown, job }
    }

    /// The time left; none where there is no limit.
    pub fn left(&self) -> Option<Duration> {
        Some(self.at?.saturating_duration_since(Instant::now()))
    }

    /// When that is: UTC, RFC 3339.
    pub fn text(&self) -> Option<String> {
        Some(humantime::format_rfc3339_seconds(self.shown?).to_string())
    }
}
