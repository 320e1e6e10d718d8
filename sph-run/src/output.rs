//! Files written while the run goes on: segments of snapshots and history with their index, the views of them for
//! people, and the log of the machine's doings.

use crate::error::RunError;
use crate::neighbors::Neighbors;
use crate::parallel::gather;
use crate::physics::Physics;
use crate::simulation::{Clock, Simulation};
use crate::space::Space as _;
use crate::stabilize::Buffers;
use crate::{forces, report};
use formats::folder::RunFolder;
use formats::outputs::{Index, LONGEST, Segment};
use formats::scene::Scene;
use formats::schema::Kept;
use formats::snapshot::{self, Digests, FileError, Header, Rows};
use formats::{checkpoint, disk};
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// What a file written now says of itself.
    pub fn header(&self, scene: &Scene, scene_hash: &str) -> Header {
        Header {
            title: scene.title.clone(),
            scene_hash: scene_hash.to_owned(),
            space: scene.space,
            kernel: scene.kernel,
            spacing: scene.spacing,
            h: scene.h(),
            gravity: scene.gravity,
            time: self.clock.time,
            step: self.clock.step,
            count: self.parameters.count,
        }
    }

    /// This rank's share of all particles, in ascending id. Collective.
    pub fn rows(&mut self) -> Rows {
        // What lives within a step makes room for them, and so do the lists: the next step builds them anew.
        self.buffers = Buffers::default();
        self.neighbors = Neighbors::default();
        self.x_build = Vec::new();
        let mut rows = gather::rows::<D, N, P::Space>(self.comm, &self.particles, self.parameters.count);
        // Between builds of the lists particles may lie beyond a periodic border; when that is must not show.
        for x in &mut rows.position {
            *x = P::Space::to_disk(self.periods.wrapped(P::Space::from_disk(*x)));
        }
        rows
    }

    /// Writes a particle file. Collective.
    pub fn write_snapshot(&mut self, path: &Path, header: &Header, kept: Kept) -> Result<Digests, RunError> {
        Ok(snapshot::write(path, header, &self.rows(), kept, self.comm)?)
    }
}

/// The outputs of a run, as rank 0 keeps them.
#[derive(Debug)]
pub struct Outputs {
    folder: RunFolder,
    /// Names of the history's columns, a line.
    head: String,
    index: Index,
    /// Lines of the history since the last segment.
    pending: String,
    /// `history.csv`.
    view: File,
    performance: File,
}

impl Outputs {
    /// Opens them as they were at a checkpoint (`then`), or at the start of a run: what lies beyond is removed, and the
    /// views are made anew.
    pub fn open(folder: &RunFolder, then: checkpoint::Outputs, scene: &Scene) -> Result<Self, RunError> {
        for path in [folder.out(), folder.history_pieces(), folder.log()] {
            fs::create_dir_all(&path).map_err(|error| FileError::writing(&path, 0, &error))?;
        }
        let of_obstacles = forces::columns(scene);
        let columns = report::columns(scene.space).map(String::from);
        let head = [&columns[..], &of_obstacles[..]].concat().join(",") + "\n";
        let index = Index { segments: then.segments, ..Index::default() };
        let mut history = index.history(folder)?;
        if history.is_empty() {
            history.clone_from(&head);
        }
        history += &then.pending;
        remove_what_lies_beyond(folder, &index)?;
        index.write(folder)?;
        disk::replace(&folder.history(), history.as_bytes())?;
        let view = append(&folder.history())?;
        let log = folder.log().join("performance.csv");
        let mut performance = append(&log)?;
        let fault = |error: std::io::Error| FileError::writing(&log, 0, &error);
        if performance.metadata().map_err(fault)?.len() == 0 {
            performance.write_all(PERFORMANCE_HEAD.as_bytes()).map_err(fault)?;
        }
        let outputs = Self { folder: folder.clone(), head, index, pending: then.pending, view, performance };
        outputs.write_series()?;
        Ok(outputs)
    }

    /// Adds a line to the history.
    pub fn line(&mut self, line: &str) -> Result<(), RunError> {
        self.pending += line;
        let fault = |error| FileError::writing(&self.folder.history(), line.len() as u64, &error);
        Ok(self.view.write_all(line.as_bytes()).map_err(fault)?)
    }

    /// Ends the segment where no snapshot will for long.
    pub fn close_if_long(&mut self, clock: &Clock) -> Result<(), RunError> {
        match self.pending.lines().count() as u64 >= LONGEST {
            true => self.close(clock, None),
            false => Ok(()),
        }
    }

    /// Ends the segment: its lines get their file and the index its entry. `snapshot`: number and digest of the one
    /// that was just written.
    pub fn close(&mut self, clock: &Clock, snapshot: Option<(u64, String)>) -> Result<(), RunError> {
        let end = (self.index.segments.len() as u64, clock.step, clock.time);
        let segment = Segment::write(&self.folder, end, &self.head, &self.pending, snapshot)?;
        self.index.segments.push(segment);
        self.pending.clear();
        self.index.write(&self.folder)?;
        self.write_series()
    }

    /// What belongs to a checkpoint written now.
    pub fn now(&self) -> checkpoint::Outputs {
        checkpoint::Outputs { segments: self.index.segments.clone(), pending: self.pending.clone() }
    }

    /// Adds a line to the log of rates. Nothing depends on it, so a failure is none of the run's.
    pub fn log_performance(&mut self, line: &str) {
        let _ = self.performance.write_all(line.as_bytes());
    }

    /// The snapshots with their times, which ParaView opens as a series. Users move old snapshots away: it lists what
    /// is there.
    fn write_series(&self) -> Result<(), RunError> {
        let there = self.index.snapshots().filter(|&(number, _)| self.folder.snapshot(number).exists());
        let name = |k: u64| self.folder.snapshot(k).file_name().map(|n| n.to_string_lossy().into_owned());
        let files: Vec<_> = there.map(|(k, time)| serde_json::json!({ "name": name(k), "time": time })).collect();
        let series = serde_json::json!({ "file-series-version": "1.0", "files": files });
        Ok(disk::replace(&self.folder.series(), format!("{series:#}\n").as_bytes())?)
    }
}

fn append(path: &Path) -> Result<File, FileError> {
    File::options().create(true).append(true).open(path).map_err(|error| FileError::writing(path, 0, &error))
}

/// Removes snapshots and pieces of history that the index does not list, and what was being written.
fn remove_what_lies_beyond(folder: &RunFolder, index: &Index) -> Result<(), FileError> {
    let snapshots = index.snapshots().map(|(number, _)| folder.snapshot(number));
    let pieces = index.segments.iter().map(|segment| folder.history_piece(segment.number));
    let listed: std::collections::HashSet<_> = snapshots.chain(pieces).collect();
    for place in [folder.out(), folder.history_pieces()] {
        let reading = |error| FileError::reading(&place, &error);
        for entry in fs::read_dir(&place).map_err(reading)? {
            let path = entry.map_err(reading)?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let ours = name.starts_with("snapshot-") && name.ends_with(".hdf")
                || place == folder.history_pieces() && name.ends_with(".csv")
                || name.ends_with(".tmp");
            if ours && path.is_file() && !listed.contains(&path) {
                fs::remove_file(&path).map_err(|error| FileError::writing(&path, 0, &error))?;
            }
        }
    }
    Ok(())
}

/// First line of the log of rates.
const PERFORMANCE_HEAD: &str = "time [s],step [1],wall [s],particle_steps_per_second [1/s],imbalance [1],ranks [1]\n";
