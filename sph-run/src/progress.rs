//! News for the user: a bar on a terminal, plain lines under mpirun, in a pipe or in a batch log. Rank 0 only.

use crate::simulation::Clock;
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
}

impl Progress {
    /// For a run from the clock's time to `end`. Silent on other ranks and when told to be.
    pub fn new(silent: bool, clock: &Clock, end: f64, particles: u64) -> Self {
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}  {eta} left");
        let sink = match style {
            _ if silent => Sink::Nowhere,
            Ok(style) if std::io::stderr().is_terminal() => Sink::Bar(ProgressBar::new(TICKS).with_style(style)),
            _ => Sink::Lines { next: 0.0, last: Instant::now() },
        };
        Self { sink, start: Instant::now(), start_time: clock.time, start_step: clock.step, end, particles }
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

    /// Tells the news, if it is time to.
    pub fn tell(&mut self, clock: &Clock) {
        let done = clock.time / self.end;
        let rate = self.rate(clock);
        match &mut self.sink {
            Sink::Bar(bar) => {
                if clock.step.is_multiple_of(16) {
                    bar.set_position((done * TICKS as f64) as u64);
                    bar.set_message(format!("t = {:.4} s, step {}", clock.time, clock.step));
                }
            }
            Sink::Lines { next, last } if done >= *next || last.elapsed() > SILENCE => {
                let progress = (clock.time - self.start_time) / (self.end - self.start_time).max(1e-300);
                let elapsed = self.start.elapsed().as_secs_f64();
                let left = if progress > 0.0 { elapsed / progress - elapsed } else { f64::NAN };
                *next = (done * 10.0).floor() / 10.0 + 0.1;
                *last = Instant::now();
                let left = if left.is_finite() { format!(", about {left:.0} s left") } else { String::new() };
                eprintln!(
                    "{:>3.0} %  t = {:.4} s, step {}, dt = {:.2e} s, {rate:.2e} particle-steps/s{left}",
                    100.0 * done,
                    clock.time,
                    clock.step,
                    clock.time_step
                );
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
