//! News for the user: a bar on a terminal, plain lines under mpirun, in a pipe or in a batch log. Rank 0 only.

use crate::simulation::Clock;
use formats::{journal, news};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Ticks of the bar.
const TICKS: u64 = 1000;
/// Longest silence on plain lines.
const SILENCE: Duration = Duration::from_secs(30);

/// Where the news goes.
#[derive(Debug)]
enum Sink {
    Bar(ProgressBar),
    Lines { next: f64, last: Instant },
    Nowhere,
}

/// Tells how far a run has come.
#[derive(Debug)]
pub struct Progress {
    sink: Sink,
    start: Instant,
    start_time: f64,
    start_step: u64,
    end: f64,
    particles: u64,
    /// When the last report for scripts was made.
    reported: Option<Instant>,
}

/// Time between reports for scripts.
const REPORT: Duration = Duration::from_secs(5);

impl Progress {
    /// For a run from the clock's time to `end`. Silent on other ranks and when told to be.
    pub fn new(silent: bool, clock: &Clock, end: f64, particles: u64) -> Self {
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}  {eta} left");
        let sink = match style {
            _ if silent => Sink::Nowhere,
            Ok(style) if std::io::stderr().is_terminal() && !news::is_json() => {
                Sink::Bar(ProgressBar::new(TICKS).with_style(style))
            }
            _ => Sink::Lines { next: 0.0, last: Instant::now() },
        };
        let (start, start_time, start_step) = (Instant::now(), clock.time, clock.step);
        Self { sink, start, start_time, start_step, end, particles, reported: None }
    }

    /// Particle-steps per second since the start.
    pub fn rate(&self, clock: &Clock) -> f64 {
        let steps = (clock.step - self.start_step) as f64;
        steps * self.particles as f64 / self.start.elapsed().as_secs_f64().max(1e-9)
    }

    /// Seconds since the start.
    pub fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Seconds to the end time, if it goes on as since the start.
    fn left(&self, clock: &Clock) -> Option<f64> {
        let done = clock.time - self.start_time;
        (done > 0.0).then(|| self.elapsed() * (self.end - clock.time) / done)
    }

    /// Is it time for a report for scripts? Then it counts as made.
    pub fn due(&mut self) -> bool {
        let due = self.reported.is_none_or(|at| at.elapsed() >= REPORT);
        if due {
            self.reported = Some(Instant::now());
        }
        due
    }

    /// The report for scripts, without what only the job knows.
    pub fn report(&self, clock: &Clock, ranks: u64) -> journal::Progress {
        journal::Progress {
            time: clock.time,
            end: self.end,
            step: clock.step,
            time_step: clock.time_step,
            particles: self.particles,
            ranks,
            rate: self.rate(clock),
            elapsed: self.elapsed(),
            left: self.left(clock),
            updated: formats::provenance::now(),
            job: None,
            deadline: None,
        }
    }

    /// Tells the news, if it is time to.
    pub fn tell(&mut self, clock: &Clock) {
        let done = clock.time / self.end;
        let (rate, left) = (self.rate(clock), self.left(clock));
        match &mut self.sink {
            Sink::Bar(bar) => {
                if clock.step.is_multiple_of(16) {
                    bar.set_position((done * TICKS as f64) as u64);
                    bar.set_message(format!("t = {:.4} s, step {}", clock.time, clock.step));
                }
            }
            Sink::Lines { next, last } if done >= *next || last.elapsed() > SILENCE => {
                *next = (done * 10.0).floor() / 10.0 + 0.1;
                *last = Instant::now();
                let keys = serde_json::json!({
                    "done": done, "time_s": clock.time, "end_s": self.end, "step": clock.step, "time_step_s": clock.time_step,
                    "particle_steps_per_second": rate, "left_s": left,
                });
                let left = left.map_or_else(String::new, |left| format!(", about {left:.0} s left"));
                let line = format!(
                    "{:>3.0} %  t = {:.4} s, step {}, dt = {:.2e} s, {rate:.2e} particle-steps/s{left}",
                    100.0 * done,
                    clock.time,
                    clock.step,
                    clock.time_step
                );
                news::progress(&line, keys);
            }
            Sink::Lines { .. } | Sink::Nowhere => {}
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        if let Sink::Bar(bar) = &self.sink {
            bar.finish_and_clear();
        }
    }
}
