//! The status of a run in plain text, at most 15 lines.

use super::{State, Status, seconds_between};
use crate::paths;
use std::fmt::Write;
use std::time::SystemTime;

/// What is reached, in one line: `43 %, t = 0.1505 of 0.35 s, step 5120`.
pub fn reached(status: &Status) -> String {
    let percent = status.fraction().map_or(String::new(), |fraction| format!("{:.1} %, ", 100.0 * fraction));
    let end = status.end.map_or(String::new(), |end| format!(" of {end}"));
    format!("{percent}t = {:.6}{end} s, step {}", status.time, status.step)
}

/// The whole status; `now`: the time of day.
pub fn long(status: &Status, now: SystemTime) -> String {
    let mut text = format!("{}\n", paths::short(&status.run).display());
    let mut line = |name: &str, what: String| {
        let _ = writeln!(text, "  {name:<12}{what}");
    };
    line("state", state(status));
    if !matches!(status.state, State::NotPrepared) {
        let step = status.time_step.map_or(String::new(), |dt| format!(" (dt = {dt:.3e} s)"));
        line("reached", reached(status) + &step);
    }
    if let Some(particles) = status.particles {
        line("particles", particles.to_string());
    }
    if let Some(holder) = &status.holder {
        line("process", format!("{} on {} since {}", holder.pid, holder.host, holder.since));
    }
    if let (Some(progress), false) = (&status.progress, status.state == State::Done) {
        let news = status.silent.map_or(String::new(), |age| format!(", told {} ago", duration(age)));
        let plural = if progress.ranks == 1 { "" } else { "s" };
        line("rate", format!("{:.3e} particle-steps/s on {} rank{plural}{news}", progress.rate, progress.ranks));
    }
    if let (Some(left), false) = (status.left, status.state == State::Done) {
        let ends = status.ends.as_ref().map_or(String::new(), |at| format!(", ends about {at}"));
        line("left", format!("{}{ends}", duration(left)));
    }
    if let (Some(job), false) = (job(status, now), status.state == State::Done) {
        line("job", job);
    }
    line("snapshots", status.snapshots.to_string());
    line("checkpoints", checkpoints(status));
    for (number, event) in status.events.iter().enumerate() {
        let name = if number == 0 { "last events" } else { "" };
        let what = if event.what.is_empty() { String::new() } else { format!("  {}", event.what) };
        line(name, format!("{}  {:<10} t = {:.6} s{what}", event.at, event.event, event.time));
    }
    text
}

fn state(status: &Status) -> String {
    match status.state {
        State::NotPrepared => "not prepared: its job has not begun".to_owned(),
        State::NotStarted => "prepared, not started".to_owned(),
        State::Running => "running".to_owned(),
        State::Silent => "locked, but silent: look whether it still runs; a new launch finds out, too".to_owned(),
        State::Stopped => {
            let reason = match status.stop.as_ref().map_or("", |stop| &stop.reason) {
                "signal" => "by a signal",
                "stop-file" => "by the file STOP",
                "wall-limit" => "before the end of its wall time",
                "steps" => "after the number of steps asked for",
                other => other,
            };
            format!("stopped {reason}, with a checkpoint: the same command goes on")
        }
        State::BrokenOff => match status.checkpoint {
            Some(_) => "broken off without a word: the same command goes on from the newest checkpoint".to_owned(),
            None => "broken off before the first checkpoint: the same command starts it again".to_owned(),
        },
        State::Failed => "failed: out/fault.hdf has the particles at that moment".to_owned(),
        State::Done => "done".to_owned(),
    }
}

fn checkpoints(status: &Status) -> String {
    let Some(newest) = &status.checkpoint else { return status.generations.to_string() };
    let age = newest.age.map_or(String::new(), |age| format!(", {} old", duration(age)));
    format!(
        "{}; newest gen-{:06}: t = {:.6} s, step {}{age}",
        status.generations, newest.generation, newest.time, newest.step
    )
}

/// The job, its deadline and what comes after it.
fn job(status: &Status, now: SystemTime) -> Option<String> {
    let progress = status.progress.as_ref()?;
    let mut words = Vec::new();
    words.extend(progress.job.clone());
    if let (Some(deadline), State::Running | State::Silent) = (&progress.deadline, status.state) {
        let left = super::parse(Some(deadline)).map_or(0.0, |at| seconds_between(now, at));
        words.push(format!("has to end at {deadline} (in {})", duration(left)));
    }
    let more = |n: u64| match (status.state, n) {
        (State::Running | State::Silent, 0) => "that is enough".to_owned(),
        (State::Running | State::Silent, n) => format!("{n} more slice{} after it", if n == 1 { "" } else { "s" }),
        (_, n) => format!("{n} more slice{} like the last", if n == 1 { "" } else { "s" }),
    };
    words.extend(status.more_slices.map(more));
    (!words.is_empty()).then(|| words.join(", "))
}

/// `45 s`, `12 min 5 s`, `3 h 20 min`, `2 d 4 h`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    let two = |large: u64, name: &str, small: u64, other: &str| match small {
        0 => format!("{large} {name}"),
        small => format!("{large} {name} {small} {other}"),
    };
    match whole {
        s if s < 60 => format!("{s} s"),
        s if s < 3600 => two(s / 60, "min", s % 60, "s"),
        s if s < 86400 => two(s / 3600, "h", s % 3600 / 60, "min"),
        s => two(s / 86400, "d", s % 86400 / 3600, "h"),
    }
}
