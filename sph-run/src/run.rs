//! A run from start or checkpoint to its end: what is due when.

use crate::cli::{Cadence, Cli};
use crate::dispatch::Job;
use crate::error::{Fault, RunError};
use crate::limits::Limits;
use crate::output;
use crate::parallel::Reduce;
use crate::parallel::agree::agree;
use crate::particles::Particles;
use crate::physics::Physics;
use crate::progress::Progress;
use crate::report::Scales;
use crate::resume::{Files, Start};
use crate::simulation::Simulation;
use formats::folder::RunFolder;
use formats::h5::{self, Communicator};
use formats::scene::Scene;
use formats::schema::Kept;
use formats::{checkpoint, snapshot};
use std::time::Instant;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// At its end time, or at rest.
    Done,
    /// On request; a checkpoint is written.
    Stopped,
}

/// Everything a run needs before its types are chosen.
pub struct Run<'a> {
    pub comm: &'a Communicator,
    pub cli: &'a Cli,
    pub folder: &'a RunFolder,
    pub scene: &'a Scene,
    pub scene_hash: String,
    pub start: Start,
    pub limits: Limits,
}

impl Job for Run<'_> {
    type Output = Result<Outcome, RunError>;

    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) -> Self::Output {
        // Every rank reads for itself; a file that only one of them can't read must still end them all.
        let header = h5::agree(self.comm, snapshot::read_header(&self.start.particles))?;
        if header.scene_hash != self.scene_hash {
            let message = format!(
                "belongs to another scene than {}\nhelp: prepare the changed scene into a new folder with sph-prep",
                self.folder.scene().display()
            );
            return Err(RunError::Input { path: self.start.particles, message });
        }
        let count = header.count;
        let (rank, size) = (self.comm.rank() as u64, self.comm.size() as u64);
        let (_, rows) = snapshot::read_rows(&self.start.particles, snapshot::share(count, rank, size), self.comm)?;
        let particles = Particles::from_rows::<P::Space>(&rows);
        drop(rows);
        let mut simulation =
            Simulation::<D, N, P>::new(self.comm, self.scene, material, particles, count, self.start.clock);
        simulation.always_rebalance = self.cli.always_rebalance;
        if self.start.fresh() {
            simulation.begin();
        }
        let files = agree(self.comm, || Files::open(self.folder, &self.start, self.scene.space))?;
        let progress = Progress::new(self.cli.quiet || rank != 0, &simulation.clock, self.scene.end.time, count);
        Course { scales: Scales::new(self.scene), job: self, simulation, files, progress, checkpointed: Instant::now() }
            .follow()
    }
}

/// A run under way.
struct Course<'a, const D: usize, const N: usize, P: Physics<D, N>> {
    job: Run<'a>,
    simulation: Simulation<'a, D, N, P>,
    scales: Scales,
    /// Rank 0 only.
    files: Option<Files>,
    progress: Progress,
    checkpointed: Instant,
}

impl<const D: usize, const N: usize, P: Physics<D, N>> Course<'_, D, N, P> {
    fn follow(mut self) -> Result<Outcome, RunError> {
        let first = self.simulation.clock.step;
        if self.job.start.over {
            return self.finish();
        }
        let mut over = self.outputs_due()?;
        while !over {
            if self.job.cli.stop_after_steps.is_some_and(|n| self.simulation.clock.step >= first + n) {
                return self.stop();
            }
            let requests = self.requests();
            let plan = match self.simulation.plan(self.next_event(), requests) {
                Ok(plan) => plan,
                Err(fault) => return Err(self.keep_for_diagnosis(fault)),
            };
            if plan.requests.stop {
                return self.stop();
            }
            if plan.requests.checkpoint {
                self.checkpoint(false)?;
            }
            self.simulation.step(&plan);
            over = self.outputs_due()?;
            self.progress.tell(&self.simulation.clock);
        }
        self.checkpoint(true)?;
        self.finish()
    }

    /// Marks the run as done.
    fn finish(&self) -> Result<Outcome, RunError> {
        self.progress.finish();
        let (folder, comm) = (self.job.folder, self.job.comm);
        agree(comm, || output::replace(&folder.done(), "the run reached its end\n"))?;
        Ok(Outcome::Done)
    }

    /// The next time at which a line, a snapshot or the end is due.
    fn next_event(&self) -> f64 {
        let (clock, output) = (&self.simulation.clock, &self.job.scene.output);
        let line = clock.lines as f64 * output.history;
        let snapshot = clock.snapshots as f64 * output.snapshots;
        line.min(snapshot).min(self.job.scene.end.time)
    }

    /// Writes what is due now. True once the run is over. Collective.
    fn outputs_due(&mut self) -> Result<bool, RunError> {
        let (clock, scene) = (self.simulation.clock, self.job.scene);
        // Two events that differ by rounding only are one.
        let due = |event: f64, interval: f64| clock.time + 1e-9 * interval >= event;
        let mut over = due(scene.end.time, scene.output.history);
        let line_due = over || due(clock.lines as f64 * scene.output.history, scene.output.history);
        let snapshot_due = over || due(clock.snapshots as f64 * scene.output.snapshots, scene.output.snapshots);
        if line_due || snapshot_due {
            self.check_finite()?;
        }
        let mut at_rest = false;
        if line_due {
            let line = self.simulation.totals(&self.scales);
            let peak = clock.peak_kinetic.max(line.kinetic);
            at_rest = scene.end.at_rest.is_some_and(|fraction| line.kinetic < fraction * peak);
            self.simulation.clock.peak_kinetic = peak;
            self.simulation.clock.lines += 1;
            let text = line.csv(&clock);
            let files = &mut self.files;
            agree(self.job.comm, || files.as_mut().map_or(Ok(()), |f| f.history.append(&text)))?;
        }
        over |= at_rest;
        if over || snapshot_due {
            self.snapshot()?;
        }
        Ok(over)
    }

    /// The planning of the next step would find a fault; but nothing faulty is written before that. Collective.
    fn check_finite(&mut self) -> Result<(), RunError> {
        let p = &self.simulation.particles;
        let finite = |i: usize| {
            let vectors = [p.x[i].0, p.v[i].0, p.a[i].0];
            p.density[i].is_finite() && vectors.iter().flatten().chain(&p.stress[i].0).all(|f| f.is_finite())
        };
        let mut faulty = [u64::from(!(0..p.owned).all(finite))];
        self.job.comm.sum(&mut faulty);
        if faulty[0] > 0 {
            return Err(self.keep_for_diagnosis(Fault::NotFinite { step: self.simulation.clock.step }));
        }
        Ok(())
    }

    fn snapshot(&mut self) -> Result<(), RunError> {
        let path = self.job.folder.snapshot(self.simulation.clock.snapshots);
        let header = self.simulation.header(self.job.scene, &self.job.scene_hash);
        self.simulation.write_snapshot(&path, &header, Kept::Everywhere)?;
        self.simulation.clock.snapshots += 1;
        let imbalance = self.simulation.imbalance();
        let (clock, folder, ranks) = (self.simulation.clock, self.job.folder, self.job.comm.size());
        let (rate, wall) = (self.progress.rate(&clock), self.progress.elapsed());
        let files = &mut self.files;
        agree(self.job.comm, || {
            let Some(files) = files else { return Ok(()) };
            files.snapshot_times.push((clock.snapshots - 1, clock.time));
            output::write_series(folder, &files.snapshot_times)?;
            let (time, step) = (clock.time, clock.step);
            files.performance.append(&format!("{time:e},{step},{wall:.3},{rate:.4e},{imbalance:.4},{ranks}\n"))
        })?;
        Ok(())
    }

    /// What this rank asks of all.
    fn requests(&mut self) -> crate::timestep::Requests {
        let root = self.job.comm.rank() == 0;
        let checkpoint = match self.job.cli.checkpoint_every {
            Cadence::Steps(n) => {
                self.simulation.clock.step > self.job.start.clock.step && self.simulation.clock.step.is_multiple_of(n)
            }
            Cadence::Wall(interval) => root && self.checkpointed.elapsed() >= interval,
        };
        crate::timestep::Requests { stop: self.job.limits.stop(root), checkpoint }
    }

    /// Writes a checkpoint; `over`: of a run that has reached its end. Collective.
    fn checkpoint(&mut self, over: bool) -> Result<(), RunError> {
        let folder = self.job.folder;
        let files = &mut self.files;
        let length = agree(self.job.comm, || files.as_mut().map_or(Ok(0), |f| f.history.commit()))?.unwrap_or(0);
        let header = self.simulation.header(self.job.scene, &self.job.scene_hash);
        let rows = self.simulation.rows();
        let outputs = std::collections::BTreeMap::from([("out/history.csv".to_owned(), length)]);
        checkpoint::commit(
            folder,
            &header,
            &rows,
            &crate::resume::clock_to_json(&self.simulation.clock, over),
            &outputs,
            self.job.cli.checkpoint_keep as usize,
            self.job.comm,
        )?;
        self.checkpointed = Instant::now();
        Ok(())
    }

    fn stop(mut self) -> Result<Outcome, RunError> {
        self.check_finite()?;
        self.checkpoint(false)?;
        self.progress.finish();
        let folder = self.job.folder;
        // The request is honoured once.
        agree(self.job.comm, || {
            let _ = std::fs::remove_file(folder.stop());
            Ok(())
        })?;
        Ok(Outcome::Stopped)
    }

    /// Writes the faulty state aside, not as a checkpoint: the last good one stays. Files hold finite numbers only; in
    /// this one the largest there is stands for the others. Collective.
    fn keep_for_diagnosis(&mut self, fault: Fault) -> RunError {
        self.progress.finish();
        let state = self.job.folder.out().join("fault.hdf");
        let header = self.simulation.header(self.job.scene, &self.job.scene_hash);
        let mut rows = self.simulation.rows();
        let reals = [&mut rows.position, &mut rows.velocity, &mut rows.acceleration].into_iter().flatten().flatten();
        for real in reals
            .chain(rows.stress.iter_mut().flatten())
            .chain(&mut rows.density)
            .chain(&mut rows.plastic_strain)
            .chain(&mut rows.stress_work)
            .chain(&mut rows.viscous_work)
        {
            if !real.is_finite() {
                *real = f64::MAX;
            }
        }
        let written = snapshot::write(&state, &header, &rows, Kept::Checkpoint, self.job.comm);
        if let (Err(error), 0) = (written, self.job.comm.rank()) {
            eprintln!("sph-run: warning: the faulty state could not be kept: {error}");
        }
        RunError::Numerical { fault, state }
    }
}
