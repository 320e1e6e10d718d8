//! What happened to a run, and how far it is: for people and for scripts that watch it. Nothing is decided by these files,
//! which depend on the machine, so they may be deleted at any time.

use crate::disk;
use crate::folder::RunFolder;
use crate::provenance::now;
use crate::snapshot::FileError;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::Write;

/// One line of `log/events.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// UTC, RFC 3339.
    pub at: String,
    /// `start`, `resume`, `scene-changed`, `checkpoint`, `stop`, `done`, `failed`.
    pub event: String,
    /// Steps done.
    pub step: u64,
    /// Time, s.
    pub time: f64,
    pub ranks: u64,
    /// The job of a scheduler, such as `slurm 1234`.
    pub job: Option<String>,
    /// More, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub what: String,
}

/// `log/progress.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Time, s.
    pub time: f64,
    /// End time of the scene, s.
    pub end: f64,
    /// Steps done.
    pub step: u64,
    /// Length of the last step, s.
    pub time_step: f64,
    pub particles: u64,
    pub ranks: u64,
    /// Particle-steps per second of this launch.
    pub rate: f64,
    /// Seconds since this launch began to compute.
    pub elapsed: f64,
    /// Seconds to the end time, estimated.
    pub left: Option<f64>,
    /// When this was written: UTC, RFC 3339.
    pub updated: String,
    /// The job of a scheduler.
    pub job: Option<String>,
    /// When this launch has to end: UTC, RFC 3339.
    pub deadline: Option<String>,
}

impl Event {
    /// What happens now.
    pub fn now(event: &str, step: u64, time: f64, ranks: u64) -> Self {
        Self { at: now(), event: event.into(), step, time, ranks, job: None, what: String::new() }
    }

    /// Appends it to the folder's journal.
    ///
    /// # Errors
    /// `CannotWrite`, `DiskFull`.
    pub fn append(&self, folder: &RunFolder) -> Result<(), FileError> {
        let path = folder.events();
        let mut line = serde_json::to_vec(self).map_err(|error| FileError::cannot_write(&path, error))?;
        line.push(b'\n');
        let file = fs::File::options().create(true).append(true).open(&path);
        let written = file.and_then(|mut file| file.write_all(&line));
        written.map_err(|error| FileError::writing(&path, line.len() as u64, &error))
    }

    /// The events of a folder, oldest first; lines that can't be understood are left out.
    pub fn all(folder: &RunFolder) -> Vec<Self> {
        let text = fs::read_to_string(folder.events()).unwrap_or_default();
        text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    }
}

impl Progress {
    /// Replaces the folder's file.
    ///
    /// # Errors
    /// `CannotWrite`, `DiskFull`.
    pub fn write(&self, folder: &RunFolder) -> Result<(), FileError> {
        let path = folder.progress();
        let text = serde_json::to_vec_pretty(self).map_err(|error| FileError::cannot_write(&path, error))?;
        disk::replace(&path, &text)
    }

    /// The folder's file; `None` where there is none that can be understood.
    pub fn read(folder: &RunFolder) -> Option<Self> {
        serde_json::from_slice(&fs::read(folder.progress()).ok()?).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_torn_lines_are_passed_over() {
        let place = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(place.path());
        fs::create_dir(folder.log()).unwrap();
        assert!(Event::all(&folder).is_empty() && Progress::read(&folder).is_none());
        let first = Event::now("start", 0, 0.0, 2);
        let second = Event { what: "end.time".into(), ..Event::now("scene-changed", 7, 0.1 + 0.2, 2) };
        first.append(&folder).unwrap();
        fs::File::options().append(true).open(folder.events()).unwrap().write_all(b"{\"at\": \"20\n").unwrap();
        second.append(&folder).unwrap();
        assert_eq!(Event::all(&folder), [first, second]);
        let progress = Progress {
            time: 0.1,
            end: 1.0,
            step: 3,
            time_step: 1e-5,
            particles: 10,
            ranks: 1,
            rate: 1e6,
            elapsed: 2.0,
            left: None,
            updated: now(),
            job: Some("slurm 12".into()),
            deadline: None,
        };
        progress.write(&folder).unwrap();
        assert_eq!(Progress::read(&folder), Some(progress));
    }
}
