//! Files written while the run goes on: snapshots with their index, the history, and the log of the machine's doings.

use crate::error::RunError;
use crate::parallel::gather;
use crate::physics::Physics;
use crate::report;
use crate::simulation::Simulation;
use crate::space::Space as _;
use formats::folder::RunFolder;
use formats::scene::Scene;
use formats::schema::Kept;
use formats::snapshot::{self, Header, Rows};
use formats::space::Space;
use std::fs::{self, File, OpenOptions};
use std::io::{Seek, Write};
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
    pub fn rows(&self) -> Rows {
        let mut rows = gather::rows::<D, N, P::Space>(self.comm, &self.particles, self.parameters.count);
        // Between builds of the lists particles may lie beyond a periodic border; when that is must not show.
        for x in &mut rows.position {
            *x = P::Space::to_disk(self.periods.wrapped(P::Space::from_disk(*x)));
        }
        rows
    }

    /// Writes a particle file. Collective.
    pub fn write_snapshot(&self, path: &Path, header: &Header, kept: Kept) -> Result<(), RunError> {
        Ok(snapshot::write(path, header, &self.rows(), kept, self.comm)?)
    }
}

/// A text file that grows by lines; rank 0 only.
#[derive(Debug)]
pub struct Growing {
    file: File,
    path: std::path::PathBuf,
}

impl Growing {
    /// Opens the file and cuts it to `length` bytes; length 0 starts it anew with `head`.
    pub fn open(path: &Path, length: u64, head: &str) -> Result<Self, RunError> {
        let fail = |e: std::io::Error| RunError::CannotWrite { path: path.into(), message: e.to_string() };
        let mut file = OpenOptions::new().create(true).write(true).truncate(false).open(path).map_err(fail)?;
        if file.metadata().map_err(fail)?.len() < length {
            let message = format!("shorter than the {length} bytes the checkpoint counts on");
            return Err(RunError::Input { path: path.into(), message });
        }
        file.set_len(length).map_err(fail)?;
        file.seek(std::io::SeekFrom::End(0)).map_err(fail)?;
        let mut growing = Self { file, path: path.into() };
        if length == 0 {
            growing.append(head)?;
        }
        Ok(growing)
    }

    /// Appends a line.
    pub fn append(&mut self, line: &str) -> Result<(), RunError> {
        self.file.write_all(line.as_bytes()).map_err(|e| self.error(&e))
    }

    /// Makes everything written so far durable; returns the length in bytes.
    pub fn commit(&mut self) -> Result<u64, RunError> {
        self.file.sync_all().map_err(|e| self.error(&e))?;
        Ok(self.file.metadata().map_err(|e| self.error(&e))?.len())
    }

    fn error(&self, e: &std::io::Error) -> RunError {
        RunError::CannotWrite { path: self.path.clone(), message: e.to_string() }
    }
}

/// First line of the history.
pub fn history_head(space: Space) -> String {
    report::columns(space).join(",") + "\n"
}

/// First line of the log of rates.
pub const PERFORMANCE_HEAD: &str =
    "time [s],step [1],wall [s],particle_steps_per_second [1/s],imbalance [1],ranks [1]\n";

/// Writes the index of the snapshots, which ParaView opens as a series in time.
pub fn write_series(folder: &RunFolder, times: &[(u64, f64)]) -> Result<(), RunError> {
    let name = |k: u64| folder.snapshot(k).file_name().map(|n| n.to_string_lossy().into_owned());
    let files: Vec<_> = times.iter().map(|&(k, time)| serde_json::json!({ "name": name(k), "time": time })).collect();
    let series = serde_json::json!({ "file-series-version": "1.0", "files": files });
    replace(&folder.series(), &format!("{series:#}\n"))
}

/// Replaces a small text file as a whole.
pub fn replace(path: &Path, text: &str) -> Result<(), RunError> {
    let fail = |e: std::io::Error| RunError::CannotWrite { path: path.into(), message: e.to_string() };
    let new = path.with_extension("tmp");
    let mut file = File::create(&new).map_err(fail)?;
    file.write_all(text.as_bytes()).map_err(fail)?;
    file.sync_all().map_err(fail)?;
    fs::rename(&new, path).map_err(fail)
}
