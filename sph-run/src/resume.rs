//! Where a run starts: at the particles `sph-prep` made, or at the newest valid checkpoint. Rank 0 looks and decides,
//! all ranks learn the same.

use crate::error::RunError;
use crate::output::{self, Growing};
use crate::simulation::Clock;
use formats::folder::RunFolder;
use formats::space::Space;
use formats::{checkpoint, snapshot};
use std::path::PathBuf;

/// Where and when a run starts.
#[derive(Clone, Debug)]
pub struct Start {
    /// Particle file to read.
    pub particles: PathBuf,
    pub clock: Clock,
    /// Length of the history that belongs to the checkpoint, bytes.
    pub history_length: u64,
    /// Had the run reached its end? Then it was killed before it was marked as done.
    pub over: bool,
}

impl Start {
    /// Looks for the newest valid checkpoint; rank 0 only. Warnings about damaged ones go to standard error.
    pub fn find(folder: &RunFolder, quiet: bool) -> Result<Self, RunError> {
        let Some(checkpoint::Found { manifest, state, warnings }) = checkpoint::latest(folder)? else {
            let particles = folder.initial();
            return Ok(Self { particles, clock: Clock::default(), history_length: 0, over: false });
        };
        for warning in warnings {
            eprintln!("sph-run: warning: {warning}; an older checkpoint is used");
        }
        let clock = clock_from_json(&manifest.clock, manifest.step)
            .ok_or_else(|| RunError::Input { path: state.clone(), message: "its manifest lacks the clock".into() })?;
        if !quiet {
            eprintln!("sph-run: resuming at t = {:.4} s, step {}", clock.time, clock.step);
        }
        let history_length = manifest.outputs.get("out/history.csv").copied().unwrap_or(0);
        let over = manifest.clock["over"].as_bool().unwrap_or(false);
        Ok(Self { particles: state, clock, history_length, over })
    }

    /// Does the run start at its beginning?
    pub fn fresh(&self) -> bool {
        self.clock.step == 0 && self.clock.lines == 0
    }

    /// As text, for the other ranks.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::json!({
            "particles": self.particles,
            "step": self.clock.step,
            "clock": clock_to_json(&self.clock, self.over),
            "history_length": self.history_length,
        })
    }

    /// The inverse of [`Start::to_json`].
    pub fn from_json(value: &serde_json::Value) -> Option<Self> {
        Some(Self {
            particles: PathBuf::from(value["particles"].as_str()?),
            clock: clock_from_json(&value["clock"], value["step"].as_u64()?)?,
            history_length: value["history_length"].as_u64()?,
            over: value["clock"]["over"].as_bool()?,
        })
    }
}

/// The clock in a manifest, and whether the run is over. Floats are stored as their bits: decimal text would be a
/// second truth.
pub fn clock_to_json(clock: &Clock, over: bool) -> serde_json::Value {
    serde_json::json!({
        "time_bits": clock.time.to_bits(),
        "time_step_bits": clock.time_step.to_bits(),
        "peak_kinetic_bits": clock.peak_kinetic.to_bits(),
        "snapshots": clock.snapshots,
        "lines": clock.lines,
        "over": over,
    })
}

fn clock_from_json(value: &serde_json::Value, step: u64) -> Option<Clock> {
    let real = |key: &str| value[key].as_u64().map(f64::from_bits);
    Some(Clock {
        time: real("time_bits")?,
        step,
        time_step: real("time_step_bits")?,
        peak_kinetic: real("peak_kinetic_bits")?,
        snapshots: value["snapshots"].as_u64()?,
        lines: value["lines"].as_u64()?,
    })
}

/// Files rank 0 keeps open.
#[derive(Debug)]
pub struct Files {
    pub history: Growing,
    pub performance: Growing,
    /// Number and time of every snapshot that is there.
    pub snapshot_times: Vec<(u64, f64)>,
}

impl Files {
    /// Opens them, cut back to what belongs to the start.
    pub fn open(folder: &RunFolder, start: &Start, space: Space) -> Result<Self, RunError> {
        for path in [folder.out(), folder.log()] {
            std::fs::create_dir_all(&path)
                .map_err(|e| RunError::CannotWrite { path: path.clone(), message: e.to_string() })?;
        }
        let history = Growing::open(&folder.history(), start.history_length, &output::history_head(space))?;
        let log = folder.log().join("performance.csv");
        let logged = if start.fresh() { 0 } else { std::fs::metadata(&log).map_or(0, |m| m.len()) };
        let performance = Growing::open(&log, logged, output::PERFORMANCE_HEAD)?;
        // A user may have moved earlier snapshots away to save space: the index lists what is there.
        let times = (0..start.clock.snapshots)
            .filter(|&k| folder.snapshot(k).exists())
            .map(|k| snapshot::read_header(&folder.snapshot(k)).map(|header| (k, header.time)));
        Ok(Self { history, performance, snapshot_times: times.collect::<Result<_, _>>()? })
    }
}
