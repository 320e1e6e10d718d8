//! Where a run starts: at the particles `sph-prep` made, or at the newest valid checkpoint. Rank 0 looks and decides,
//! all ranks learn the same.

use crate::cli::Cli;
use crate::error::RunError;
use crate::limits::clear_stale_stop_file;
use crate::simulation::Clock;
use formats::folder::RunFolder;
use formats::journal::Event;
use formats::news::{Level, tell};
use formats::scene::{Change, Output, Scene};
use formats::{checkpoint, disk, snapshot::FileError};
use std::fs;
use std::path::{Path, PathBuf};

/// Where and when a run starts: the same on all ranks.
#[derive(Clone, Debug)]
pub struct Start {
    /// Text of the scene.
    pub scene: String,
    /// Particle file to read.
    pub particles: PathBuf,
    pub clock: Clock,
    /// Had the run reached its end? Then it was killed before it was marked as done.
    pub over: bool,
}

/// What only rank 0 needs of it.
#[derive(Clone, Debug, Default)]
pub struct Past {
    pub outputs: checkpoint::Outputs,
    /// What writing the checkpoint took, s; none at the beginning.
    pub write_seconds: Option<f64>,
}

impl Start {
    /// Applies a changed scene, and looks for the newest valid checkpoint; rank 0 only, in a folder that is locked.
    /// `None` where the run is done. Warnings and news go to standard error.
    pub fn find(folder: &RunFolder, cli: &Cli, ranks: u64) -> Result<Option<(Self, Past)>, RunError> {
        let begun = folder.done().exists() || folder.checkpoints().exists() || folder.history().exists();
        if cli.new && begun {
            return Err(RunError::HasBegun { path: folder.path().into() });
        }
        let prepared = read_scene(&folder.scene())?;
        let scene = match &cli.scene {
            None => prepared,
            Some(path) => changed_scene(folder, prepared, path)?,
        };
        if folder.done().exists() {
            let then = checkpoint::newest_manifest(folder)?;
            let extended = match &then {
                Some(manifest) => !compare(folder, &manifest.scene, &scene)?.is_empty(),
                None => false,
            };
            if !extended && cli.resume.is_none() {
                if !cli.quiet {
                    tell(Level::Note, "nothing to do, the run is done");
                }
                return Ok(None);
            }
        }
        let found = match cli.resume {
            Some(step) => Some(checkpoint::go_back(folder, step)?),
            None => checkpoint::latest(folder)?,
        };
        match fs::remove_file(folder.done()) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(FileError::writing(&folder.done(), 0, &error).into());
            }
            _ => {}
        }
        let (mut start, past, then) = match found {
            None => {
                let start = Self { scene, particles: folder.initial(), clock: Clock::default(), over: false };
                (start, Past::default(), None)
            }
            Some(checkpoint::Found { manifest, state, warnings }) => {
                for warning in warnings {
                    tell(Level::Warning, &format!("{warning}; an older checkpoint is used"));
                }
                let message = String::from("its manifest lacks the clock");
                let clock = clock_from_json(&manifest.clock, manifest.step)
                    .ok_or_else(|| RunError::Input { path: state.clone(), message })?;
                let over = is_over(&manifest);
                let past = Past { outputs: manifest.outputs, write_seconds: Some(manifest.write_seconds) };
                (Self { scene, particles: state, clock, over }, past, Some(manifest.scene))
            }
        };
        if let Some(then) = then {
            start.adapt(folder, &then, cli.quiet, ranks)?;
        }
        if clear_stale_stop_file(folder) {
            tell(Level::Warning, "a STOP file from before this launch is removed; make it anew to stop the run");
        }
        if !start.fresh() && !cli.quiet {
            tell(Level::Note, &format!("resuming at t = {:.4} s, step {}", start.clock.time, start.clock.step));
        }
        Ok(Some((start, past)))
    }

    /// Takes up what changed in the scene since the checkpoint was written under `then`.
    fn adapt(&mut self, folder: &RunFolder, then: &str, quiet: bool, ranks: u64) -> Result<(), RunError> {
        let changes = compare(folder, then, &self.scene)?;
        if changes.is_empty() {
            return Ok(());
        }
        for change in &changes {
            if !quiet {
                tell(Level::Note, &format!("changed in the scene: {change}"));
            }
            let event = Event::now("scene-changed", self.clock.step, self.clock.time, ranks);
            let _ = fs::create_dir_all(folder.log());
            let _ = Event { what: change.to_string(), ..event }.append(folder);
        }
        let scene = Scene::read(&folder.scene().display().to_string(), &self.scene)?;
        self.over &= scene.end.time <= self.clock.time;
        if !self.fresh() {
            self.clock.line_event = Output::first_after(scene.output.history, self.clock.time);
            self.clock.snapshot_event = Output::first_after(scene.output.snapshots, self.clock.time);
        }
        Ok(())
    }

    /// Does the run start at its beginning?
    pub fn fresh(&self) -> bool {
        self.clock.step == 0 && self.clock.lines == 0
    }

    /// As text, for the other ranks.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::json!({
            "scene": self.scene,
            "particles": self.particles,
            "step": self.clock.step,
            "clock": clock_to_json(&self.clock, self.over),
        })
    }

    /// The inverse of [`Start::to_json`].
    pub fn from_json(value: &serde_json::Value) -> Option<Self> {
        Some(Self {
            scene: value["scene"].as_str()?.to_owned(),
            particles: PathBuf::from(value["particles"].as_str()?),
            clock: clock_from_json(&value["clock"], value["step"].as_u64()?)?,
            over: value["clock"]["over"].as_bool()?,
        })
    }
}

/// The scene of a run folder, or one that a user gives.
pub fn read_scene(path: &Path) -> Result<String, RunError> {
    fs::read_to_string(path).map_err(|error| {
        let help = "make a run folder with: sph-prep scene.toml -o RUN";
        RunError::Input { path: path.into(), message: format!("{error}\nhelp: {help}") }
    })
}

/// The text of a scene that shall replace the prepared one, after it has: refused where it asks for other particles
/// or other physics.
fn changed_scene(folder: &RunFolder, prepared: String, path: &Path) -> Result<String, RunError> {
    let text = read_scene(path)?;
    let name = path.display().to_string();
    let scene = Scene::read(&name, &text)?;
    if Scene::changes_in(folder, &prepared, path, &name, &text)?.is_empty() {
        return Ok(prepared);
    }
    if let Some(manifest) = checkpoint::newest_manifest(folder)?
        && (manifest.time > scene.end.time || manifest.time == scene.end.time && !is_over(&manifest))
    {
        let (end, time) = (scene.end.time, manifest.time);
        return Err(RunError::EndHasPassed { path: path.into(), end, time });
    }
    disk::write_atomic(&folder.scene(), text.as_bytes())?;
    Ok(text)
}

fn compare(folder: &RunFolder, then: &str, now: &str) -> Result<Vec<Change>, RunError> {
    match then == now {
        true => Ok(Vec::new()),
        false => Ok(Scene::changes(&folder.scene().display().to_string(), then, now)?),
    }
}

/// Was it written at the end of a run?
fn is_over(manifest: &checkpoint::Manifest) -> bool {
    manifest.clock["over"].as_bool().unwrap_or(false)
}

/// The clock in a manifest, and whether the run is over. Floats are stored as their bits: decimal text would be a
/// second truth.
pub fn clock_to_json(clock: &Clock, over: bool) -> serde_json::Value {
    serde_json::json!({
        "time_bits": clock.time.to_bits(),
        "time_step_bits": clock.time_step.to_bits(),
        "peak_kinetic_bits": clock.peak_kinetic.to_bits(),
        "snapshots": clock.snapshots,
        "snapshot_event": clock.snapshot_event,
        "lines": clock.lines,
        "line_event": clock.line_event,
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
        snapshot_event: value["snapshot_event"].as_u64()?,
        lines: value["lines"].as_u64()?,
        line_event: value["line_event"].as_u64()?,
    })
}
