//! Where things lie in a run folder. Every stage asks here; no path is spelled twice.

use std::path::{Path, PathBuf};

/// A run folder: `sph-prep` makes it, `sph-run` works in it, `sph-post` reads it and adds `post/`.
#[derive(Clone, Debug)]
pub struct RunFolder(PathBuf);

impl RunFolder {
    /// The folder at `path`, which need not exist.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self(path.into())
    }
    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.0
    }
    /// The scene as it was prepared, byte for byte.
    pub fn scene(&self) -> PathBuf {
        self.0.join("scene.lock.toml")
    }
    /// Who made what, with which versions.
    pub fn provenance(&self) -> PathBuf {
        self.0.join("provenance.json")
    }
    /// The particles `sph-prep` made.
    pub fn initial(&self) -> PathBuf {
        self.0.join("initial.hdf")
    }
    /// Snapshots and history: see [`crate::outputs`].
    pub fn out(&self) -> PathBuf {
        self.0.join("out")
    }
    /// Snapshot number `index`, counted from 0.
    pub fn snapshot(&self, index: u64) -> PathBuf {
        self.out().join(format!("snapshot-{index:06}.hdf"))
    }
    /// The times of the snapshots, for ParaView: a `.hdf.series` file.
    pub fn series(&self) -> PathBuf {
        self.out().join("snapshot.hdf.series")
    }
    /// Energies, front and height over time: CSV, the same bits on any number of ranks.
    pub fn history(&self) -> PathBuf {
        self.out().join("history.csv")
    }
    /// The lines of history of segment number `segment`.
    pub fn history_piece(&self, segment: u64) -> PathBuf {
        self.history_pieces().join(format!("{segment:06}.csv"))
    }
    /// The folder of the pieces of history.
    pub fn history_pieces(&self) -> PathBuf {
        self.out().join("history")
    }
    /// What of `out/` counts: see [`crate::outputs`].
    pub fn index(&self) -> PathBuf {
        self.out().join("index.json")
    }
    /// Logs that depend on the machine: rates, imbalance.
    pub fn log(&self) -> PathBuf {
        self.0.join("log")
    }
    /// What happened to the run: see [`crate::journal`].
    pub fn events(&self) -> PathBuf {
        self.log().join("events.jsonl")
    }
    /// How far the run is: see [`crate::journal`].
    pub fn progress(&self) -> PathBuf {
        self.log().join("progress.json")
    }
    /// Checkpoint generations.
    pub fn checkpoints(&self) -> PathBuf {
        self.0.join("ckpt")
    }
    /// Checkpoint generation number `generation`.
    pub fn generation(&self, generation: u64) -> PathBuf {
        self.checkpoints().join(format!("gen-{generation:06}"))
    }
    /// What `sph-post` writes.
    pub fn post(&self) -> PathBuf {
        self.0.join("post")
    }
    /// Present once the run reached its end.
    pub fn done(&self) -> PathBuf {
        self.0.join("DONE")
    }
    /// Present while the run waits to be gone on with: it stopped early, with a checkpoint.
    pub fn to_continue(&self) -> PathBuf {
        self.0.join("CONTINUE")
    }
    /// A user's request to stop at the next step.
    pub fn stop(&self) -> PathBuf {
        self.0.join("STOP")
    }
    /// Present while a process works in the folder.
    pub fn lock(&self) -> PathBuf {
        self.0.join("LOCK")
    }
}
