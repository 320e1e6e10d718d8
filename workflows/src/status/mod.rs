//! `status`: how far runs are, from what they leave in their folders: while they run, stopped, done, failed, or not begun.

mod text;

use crate::{failure::Failure, paths};
use formats::folder::RunFolder;
use formats::journal::{Event, Progress};
use formats::lock::{self, Holder};
use formats::{checkpoint, outputs::Index, scene::Scene, snapshot};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Silence after which the holder of a lock counts as perhaps no longer there, s: a launch waits for less.
const SILENCE: f64 = 120.0;

/// What a run is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// A job is to prepare it.
    NotPrepared,
    /// It is prepared; nothing is computed.
    NotStarted,
    /// A process works on it.
    Running,
    /// A process of another machine holds it, but has been silent for long.
    Silent,
    /// It stopped with a checkpoint.
    Stopped,
    /// It ended without a word: killed, or the machine failed.
    BrokenOff,
    /// The computation failed.
    Failed,
    /// It reached its end.
    Done,
}

/// The file CONTINUE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// `signal`, `stop-file`, `wall-limit`, `steps`.
    pub reason: String,
    /// Steps done.
    pub step: Option<u64>,
    /// Time, s.
    pub time: Option<f64>,
}

/// The newest checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Newest {
    pub generation: u64,
    pub step: u64,
    /// Time, s.
    pub time: f64,
    /// Seconds since it was written.
    pub age: Option<f64>,
}

/// How far a run is. Times are in seconds, moments UTC as RFC 3339.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Status {
    /// The run folder.
    pub run: PathBuf,
    pub state: State,
    /// Time reached: by the process that runs, else that of the state it goes on from.
    pub time: f64,
    /// End time of the scene.
    pub end: Option<f64>,
    /// Steps done by then.
    pub step: u64,
    /// Length of the last step known.
    pub time_step: Option<f64>,
    pub particles: Option<u64>,
    /// Snapshots that are committed.
    pub snapshots: u64,
    /// Generations of checkpoints.
    pub generations: u64,
    pub checkpoint: Option<Newest>,
    /// Who works on it, by its file LOCK.
    pub holder: Option<Holder>,
    /// Why it stopped.
    pub stop: Option<Stop>,
    /// What the last launch said last.
    pub progress: Option<Progress>,
    /// Seconds since then.
    pub silent: Option<f64>,
    /// Computing time that is left.
    pub left: Option<f64>,
    /// When it ends if it goes on as it does.
    pub ends: Option<String>,
    /// Slices that are needed after the present one, each as long as it.
    pub more_slices: Option<u64>,
    /// The last events.
    pub events: Vec<Event>,
}

/// Prints how far runs are. Every folder is looked at.
///
/// # Errors
/// Where one of them is not a run folder, or cannot be read (65).
pub fn tell(runs: &[PathBuf], json: bool) -> Result<(), Failure> {
    let looks: Vec<_> = runs.iter().map(|run| Status::of(&RunFolder::new(paths::from_caller(run)))).collect();
    let (found, failed): (Vec<_>, Vec<_>) = looks.into_iter().partition(Result::is_ok);
    let found: Vec<Status> = found.into_iter().flatten().collect();
    let text = match json {
        true => serde_json::to_string_pretty(&found).map_err(|e| Failure::cannot_write(e.to_string()))? + "\n",
        false => {
            let shown: Vec<_> = found.iter().map(|status| text::long(status, SystemTime::now())).collect();
            shown.join("\n")
        }
    };
    // Nobody to tell where the reader has gone.
    let _ = std::io::stdout().write_all(text.as_bytes());
    let messages: Vec<_> = failed.into_iter().filter_map(Result::err).map(|failure| failure.message).collect();
    match messages.is_empty() {
        true => Ok(()),
        false => Err(Failure::no_input(messages.join("\ntalus: "))),
    }
}

/// What the file CONTINUE says; none where there is no such file.
pub fn stop_of(folder: &RunFolder) -> Option<Stop> {
    serde_json::from_slice(&fs::read(folder.to_continue()).ok()?).ok()
}

impl Status {
    /// Looks at a run folder; takes no lock and needs none.
    ///
    /// # Errors
    /// Where it is not a run folder, or cannot be read.
    pub fn of(folder: &RunFolder) -> Result<Self, Failure> {
        let waiting = folder.path().join("scene.toml");
        let Some(scene) = [folder.scene(), waiting].into_iter().find(|path| path.is_file()) else {
            let name = paths::short(folder.path()).display();
            return Err(Failure::no_input(format!("{name} is not a run folder (it has no scene.lock.toml)")));
        };
        let read = |e: formats::snapshot::FileError| Failure { code: e.exit_code(), message: e.to_string() };
        let text = fs::read_to_string(&scene).unwrap_or_default();
        let end = Scene::read(&scene.display().to_string(), &text).ok().map(|scene| scene.end.time);
        let holder = lock::holder(&folder.lock()).filter(|holder| holder.runs() != Some(false));
        // Where the process can't be asked, the lock's file tells: its holder renews it all the time.
        let asked = holder.as_ref().is_some_and(|holder| holder.runs() == Some(true));
        let alive = asked || age(&folder.lock()).is_some_and(|age| age < SILENCE);
        let progress = Progress::read(folder);
        let index = Index::read(folder).map_err(read)?.unwrap_or_default();
        let checkpoint = checkpoint::newest_manifest(folder).map_err(read)?.map(|manifest| Newest {
            generation: manifest.generation,
            step: manifest.step,
            time: manifest.time,
            age: age(&folder.generation(manifest.generation)),
        });
        let events = Event::all(folder);
        let mut status = Self {
            run: folder.path().to_owned(),
            state: State::NotStarted,
            time: 0.0,
            end,
            step: 0,
            time_step: progress.as_ref().map(|progress| progress.time_step),
            particles: match &progress {
                Some(progress) => Some(progress.particles),
                None => snapshot::read_header(&folder.initial()).ok().map(|header| header.count),
            },
            snapshots: index.snapshots().count() as u64,
            generations: checkpoint::generations(folder).map_err(read)?.len() as u64,
            stop: stop_of(folder),
            silent: progress.as_ref().and_then(|progress| since(&progress.updated)),
            progress,
            checkpoint,
            holder,
            left: None,
            ends: None,
            more_slices: None,
            events: Vec::new(),
        };
        status.state = status.judge(folder, &events, alive);
        status.reach(&index);
        status.foresee(SystemTime::now());
        status.events = events[events.len().saturating_sub(4)..].to_vec();
        Ok(status)
    }

    /// Share of the time to compute that is done.
    pub fn fraction(&self) -> Option<f64> {
        match self.state {
            State::Done => Some(1.0),
            _ => self.end.map(|end| (self.time / end).clamp(0.0, 1.0)),
        }
    }

    /// One line.
    pub fn brief(&self) -> String {
        text::reached(self)
    }

    fn judge(&self, folder: &RunFolder, events: &[Event], alive: bool) -> State {
        let failed = || events.last().is_some_and(|event| event.event == "failed") || fault_is_news(folder, events);
        match () {
            () if self.holder.is_some() && alive => State::Running,
            () if self.holder.is_some() => State::Silent,
            () if folder.done().is_file() => State::Done,
            () if self.stop.is_some() => State::Stopped,
            () if failed() => State::Failed,
            () if self.checkpoint.is_some() || self.progress.is_some() || !events.is_empty() => State::BrokenOff,
            () if folder.scene().is_file() => State::NotStarted,
            () => State::NotPrepared,
        }
    }

    /// Time and steps: of the process that runs, else of the state that the next one goes on from.
    fn reach(&mut self, index: &Index) {
        let checkpoint = self.checkpoint.as_ref().map_or((0.0, 0), |newest| (newest.time, newest.step));
        let progress = self.progress.as_ref().map(|progress| (progress.time, progress.step));
        let last = index.segments.last().map(|segment| (segment.time, segment.step));
        (self.time, self.step) = match self.state {
            // What an earlier launch said last may be older than the checkpoint that this one started from.
            State::Running | State::Silent => progress.filter(|p| p.1 > checkpoint.1).unwrap_or(checkpoint),
            State::Done => last.unwrap_or(checkpoint),
            _ => checkpoint,
        };
    }

    /// What is left, by the rate of the last launch.
    fn foresee(&mut self, now: SystemTime) {
        let (Some(progress), false) = (&self.progress, self.state == State::Done) else { return };
        let Some(left) = progress.left else { return };
        let to_go = progress.end - progress.time;
        let end = self.end.unwrap_or(progress.end);
        let left = if to_go > 0.0 { left * (end - self.time).max(0.0) / to_go } else { left };
        self.left = Some(left);
        let runs = self.state == State::Running;
        if runs {
            self.ends = moment(now, left);
        }
        // A slice lasts from the start of the launch, which `elapsed` was counted from, to its deadline.
        let (Some(deadline), Some(updated)) = (parse(progress.deadline.as_deref()), parse(Some(&progress.updated)))
        else {
            return;
        };
        let length = seconds_between(updated, deadline) + progress.elapsed;
        let here = if runs { seconds_between(now, deadline) } else { 0.0 };
        if length > 0.0 {
            self.more_slices = Some(((left - here).max(0.0) / length).ceil() as u64);
        }
    }
}

/// Was a faulty state written after the last event?
fn fault_is_news(folder: &RunFolder, events: &[Event]) -> bool {
    let written = fs::metadata(folder.out().join("fault.hdf")).and_then(|facts| facts.modified());
    let last = events.last().and_then(|event| parse(Some(&event.at)));
    // Events are told to the second.
    written.is_ok_and(|at| last.is_none_or(|last| at >= last))
}

fn age(path: &Path) -> Option<f64> {
    let at = fs::metadata(path).and_then(|facts| facts.modified()).ok()?;
    Some(seconds_between(at, SystemTime::now()))
}

fn since(moment: &str) -> Option<f64> {
    Some(seconds_between(parse(Some(moment))?, SystemTime::now()))
}

fn parse(moment: Option<&str>) -> Option<SystemTime> {
    humantime::parse_rfc3339(moment?).ok()
}

/// From one moment to another; below 0 where the second comes first.
fn seconds_between(from: SystemTime, to: SystemTime) -> f64 {
    match to.duration_since(from) {
        Ok(time) => time.as_secs_f64(),
        Err(error) => -error.duration().as_secs_f64(),
    }
}

fn moment(now: SystemTime, seconds: f64) -> Option<String> {
    let at = now.checked_add(Duration::try_from_secs_f64(seconds).ok()?)?;
    Some(humantime::format_rfc3339_seconds(at).to_string())
}

#[cfg(test)]
mod tests;
