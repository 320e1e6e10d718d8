//! A run from start or checkpoint to its end: what is due when.

use crate::cli::{Cadence, Cli};
use crate::deadline::Deadline;
use crate::dispatch::Job;
use crate::error::{Fault, RunError};
use crate::lanes::Instructions;
use crate::limits::{Limits, Reason};
use crate::output::Outputs;
use crate::pace::Pace;
use crate::parallel::Reduce;
use crate::parallel::agree::agree;
use crate::particles::Particles;
use crate::phases::{self, Phase, Stopwatch};
use crate::physics::Physics;
use crate::progress::Progress;
use crate::report::Scales;
use crate::resume::{Past, Start};
use crate::simulation::Simulation;
use crate::space::Space;
use crate::timestep::Requests;
use formats::folder::RunFolder;
use formats::h5::{self, Communicator};
use formats::journal::{self, Event};
use formats::lock::{LockError, RunLock};
use formats::news::{Level, tell};
use formats::provenance::{self, Entry};
use formats::scene::Scene;
use formats::schema::Kept;
use formats::snapshot::FileError;
use formats::{checkpoint, disk, snapshot};
use std::ops::Range;
use std::time::{Duration, Instant};

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
    /// Of this rank's processor.
    pub instructions: Instructions,
    /// What follows counts on rank 0 only.
    pub past: Past,
    pub deadline: Deadline,
    /// On no other rank there is one.
    pub lock: Option<&'a RunLock>,
}

impl Job for Run<'_> {
    type Output = Result<Outcome, RunError>;

    fn run<const D: usize, const N: usize, P: Physics<D, N>>(mut self, material: P::Material) -> Self::Output {
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
        let particles = self.read::<D, N, P::Space>(count, snapshot::share(count, rank, size))?;
        let (comm, scene, clock) = (self.comm, self.scene, self.start.clock);
        let instructions = self.instructions;
        let mut simulation =
            Simulation::<D, N, P>::with_instructions(instructions, comm, scene, material, particles, count, clock);
        simulation.always_rebalance = self.cli.always_rebalance;
        simulation.share_by(self.cli.balance);
        if self.start.fresh() {
            simulation.begin();
        }
        let then = std::mem::take(&mut self.past.outputs);
        let outputs = agree(self.comm, || {
            self.lock.map_or(Ok(()), RunLock::still_ours)?;
            Outputs::open(self.folder, then, self.scene)
        })?;
        if rank == 0 && !self.cli.quiet && !self.start.over {
            tell(Level::Note, &format!("pairs in {}", self.numbers()));
        }
        let progress = Progress::new(self.cli.quiet || rank != 0, &simulation.clock, self.scene.end.time, count);
        let pace = Pace::new(self.past.write_seconds.map(Duration::from_secs_f64));
        let scales = Scales::new(self.scene);
        let (checkpointed, checkpoint_step) = (Instant::now(), simulation.clock.step);
        let course = Course { scales, job: self, simulation, outputs, progress, pace, checkpointed, checkpoint_step };
        course.follow()
    }
}

/// Rows a rank reads at a time.
const PASS: u64 = 1 << 18;

impl Run<'_> {
    /// This rank's share of the particles. Collective.
    fn read<const D: usize, const N: usize, S: Space<D, N>>(
        &self,
        count: u64,
        mine: Range<u64>,
    ) -> Result<Particles<D, N>, RunError> {
        let mut particles = Particles::default();
        particles.reserve((mine.end - mine.start) as usize);
        for pass in 0..count.div_ceil(self.comm.size() as u64).div_ceil(PASS) {
            let some = (mine.start + pass * PASS).min(mine.end)..(mine.start + (pass + 1) * PASS).min(mine.end);
            let (_, rows) = snapshot::read_rows(&self.start.particles, some, self.comm)?;
            particles.add_rows::<S>(&rows);
        }
        Ok(particles)
    }

    /// What pairs are computed in, for people.
    fn numbers(&self) -> String {
        format!("{}, {} instructions", self.scene.numerics.precision, self.instructions)
    }
}

/// A run under way.
struct Course<'a, const D: usize, const N: usize, P: Physics<D, N>> {
    job: Run<'a>,
    simulation: Simulation<'a, D, N, P>,
    scales: Scales,
    /// Rank 0 only.
    outputs: Option<Outputs>,
    progress: Progress,
    pace: Pace,
    /// When and at which step the last checkpoint was written, or the launch began.
    checkpointed: Instant,
    checkpoint_step: u64,
}

impl<const D: usize, const N: usize, P: Physics<D, N>> Course<'_, D, N, P> {
    fn follow(mut self) -> Result<Outcome, RunError> {
        let first = self.simulation.clock.step;
        if self.job.start.over {
            return self.finish();
        }
        self.note(if self.job.start.fresh() { "start" } else { "resume" }, &format!("pairs in {}", self.job.numbers()));
        self.simulation.watch = Stopwatch::start();
        let mut over = self.outputs_due()?;
        agree(self.job.comm, || {
            self.check_wall_limit()?;
            // From here on the run is under way. Who computes is for people: not to be able to note it is no fault.
            let folder = self.job.folder;
            let _ = std::fs::remove_file(folder.to_continue());
            let ranks = self.job.comm.size();
            let _ = provenance::append(&folder.provenance(), Entry::this("sph-run", ranks));
            Ok(())
        })?;
        while !over {
            let begun = Instant::now();
            self.simulation.watch.enter(Phase::Motion);
            if self.job.cli.stop_after_steps.is_some_and(|n| self.simulation.clock.step >= first + n) {
                return self.stop(Reason::Steps);
            }
            let requests = self.requests();
            let plan = match self.simulation.plan(self.next_event(), requests) {
                Ok(plan) => plan,
                Err(fault) => return Err(self.keep_for_diagnosis(fault)),
            };
            if let Some(reason) = plan.requests.stop {
                return self.stop(reason);
            }
            if plan.requests.checkpoint {
                self.checkpoint(false)?;
                continue;
            }
            self.simulation.step(&plan);
            self.pace.stepped(begun.elapsed());
            self.simulation.watch.enter(Phase::Output);
            over = self.outputs_due()?;
            self.progress.tell(&self.simulation.clock);
            self.report_progress(false);
        }
        self.checkpoint(true)?;
        self.finish()
    }

    /// Marks the run as done.
    fn finish(&mut self) -> Result<Outcome, RunError> {
        self.progress.finish();
        self.report_progress(true);
        self.log_phases();
        let (folder, comm) = (self.job.folder, self.job.comm);
        agree(comm, || Ok(disk::write_atomic(&folder.done(), b"the run reached its end\n")?))?;
        self.note("done", "");
        Ok(Outcome::Done)
    }

    /// Notes in the journal what happens; rank 0 only. Nothing depends on it, so a failure is none of the run's.
    fn note(&self, event: &str, what: &str) {
        if self.job.lock.is_some() {
            if self.job.cli.verbose {
                tell(Level::Note, &format!("step {}, {event}: {what}", self.simulation.clock.step));
            }
            let (clock, ranks) = (&self.simulation.clock, self.job.comm.size() as u64);
            let now = Event::now(event, clock.step, clock.time, ranks);
            let _ = Event { job: self.job.deadline.job.clone(), what: what.into(), ..now }.append(self.job.folder);
        }
    }

    /// Tells scripts and people how far the run is, `now` or if it is time to; rank 0 only.
    fn report_progress(&mut self, now: bool) {
        let job = &self.job;
        if job.lock.is_some() && (now || self.progress.due()) {
            let ranks = job.comm.size() as u64;
            let report = self.progress.report(&self.simulation.clock, ranks);
            let (job_id, deadline) = (job.deadline.job.clone(), job.deadline.text());
            let _ = journal::Progress { job: job_id, deadline, ..report }.write(job.folder);
        }
    }

    /// Notes what the parts of the steps took, where there were any. Collective.
    fn log_phases(&mut self) {
        let first = self.job.start.clock.step;
        if self.simulation.clock.step > first {
            let line = self.simulation.phases_line(first);
            if self.job.lock.is_some() {
                phases::log(self.job.folder, &line);
            }
        }
    }

    /// A limit that leaves no time for a step and for ending would be reached again and again.
    fn check_wall_limit(&self) -> Result<(), RunError> {
        match self.job.deadline.left() {
            Some(left) => self.pace.check_limit(left).map_err(RunError::LimitTooShort),
            None => Ok(()),
        }
    }

    /// The next time at which a line, a snapshot or the end is due.
    fn next_event(&self) -> f64 {
        let (clock, output) = (&self.simulation.clock, &self.job.scene.output);
        let line = clock.line_event as f64 * output.history;
        let snapshot = clock.snapshot_event as f64 * output.snapshots;
        line.min(snapshot).min(self.job.scene.end.time)
    }

    /// Writes what is due now. True once the run is over. Collective.
    fn outputs_due(&mut self) -> Result<bool, RunError> {
        let (clock, scene) = (self.simulation.clock, self.job.scene);
        // Two events that differ by rounding only are one.
        let due = |event: f64, interval: f64| clock.time + 1e-9 * interval >= event;
        let mut over = due(scene.end.time, scene.output.history);
        let line_event = due(clock.line_event as f64 * scene.output.history, scene.output.history);
        let snapshot_event = due(clock.snapshot_event as f64 * scene.output.snapshots, scene.output.snapshots);
        self.simulation.clock.line_event += u64::from(line_event);
        self.simulation.clock.snapshot_event += u64::from(snapshot_event);
        if over || line_event || snapshot_event {
            self.check_finite()?;
        }
        if over || line_event {
            let line = self.simulation.totals(&self.scales);
            let peak = clock.peak_kinetic.max(line.kinetic);
            over |= scene.end.at_rest.is_some_and(|fraction| line.kinetic < fraction * peak);
            self.simulation.clock.peak_kinetic = peak;
            self.simulation.clock.lines += 1;
            let forces = self.simulation.obstacle_forces();
            let text = line.csv(&clock, &forces);
            let outputs = &mut self.outputs;
            agree(self.job.comm, || {
                let Some(outputs) = outputs else { return Ok(()) };
                outputs.line(&text)?;
                if over || snapshot_event { Ok(()) } else { outputs.close_if_long(&clock) }
            })?;
        }
        if over || snapshot_event {
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

    /// Writes a snapshot, which ends a segment of the outputs. Collective.
    fn snapshot(&mut self) -> Result<(), RunError> {
        let begun = Instant::now();
        let (comm, folder) = (self.job.comm, self.job.folder);
        agree(comm, || Ok(self.still_ours()?))?;
        let number = self.simulation.clock.snapshots;
        let header = self.simulation.header(self.job.scene, &self.job.scene_hash);
        let digests = self.simulation.write_snapshot(&folder.snapshot(number), &header, Kept::Everywhere)?;
        self.simulation.clock.snapshots += 1;
        let imbalance = self.simulation.imbalance();
        let clock = self.simulation.clock;
        let (rate, wall) = (self.progress.rate(&clock), self.progress.elapsed());
        let outputs = &mut self.outputs;
        agree(comm, || {
            let Some(outputs) = outputs else { return Ok(()) };
            outputs.close(&clock, Some((number, digests.of_file(&header))))?;
            let (time, step, ranks) = (clock.time, clock.step, comm.size());
            outputs.log_performance(&format!("{time:e},{step},{wall:.3},{rate:.4e},{imbalance:.4},{ranks}\n"));
            Ok(())
        })?;
        self.pace.wrote_snapshot(begun.elapsed());
        Ok(())
    }

    /// Does the folder still belong to this launch? A process that was stopped for long may have lost it to another.
    fn still_ours(&self) -> Result<(), LockError> {
        self.job.lock.map_or(Ok(()), RunLock::still_ours)
    }

    /// What this rank asks of all.
    fn requests(&mut self) -> Requests {
        let root = self.job.comm.rank() == 0;
        let since = self.checkpointed.elapsed();
        let checkpoint = match self.job.cli.checkpoint_every {
            Cadence::Steps(n) => {
                let step = self.simulation.clock.step;
                step > self.checkpoint_step && step.is_multiple_of(n)
            }
            Cadence::Wall(interval) => root && since >= interval,
            Cadence::Auto => root && since >= self.pace.checkpoint_interval(self.job.cli.mtbf),
        };
        // Each launch takes one step at least: a job that is submitted until the run is done must come to an end.
        let moved = self.simulation.clock.step > self.job.start.clock.step;
        let out_of_time = moved && self.job.deadline.left().is_some_and(|left| left <= self.pace.margin());
        let stop = match self.job.limits.reason(root) {
            None if out_of_time => Some(Reason::WallLimit),
            asked => asked,
        };
        Requests { stop, checkpoint }
    }

    /// Writes a checkpoint; `over`: of a run that has reached its end. Collective.
    fn checkpoint(&mut self, over: bool) -> Result<(), RunError> {
        let begun = Instant::now();
        self.simulation.watch.enter(Phase::Output);
        let rows = self.simulation.rows();
        let job = &self.job;
        let outputs = self.outputs.as_ref().map(Outputs::now);
        let still_ours = || {
            let lost = |error: LockError| FileError::CannotWrite { path: "LOCK".into(), what: error.to_string() };
            self.still_ours().map_err(lost)
        };
        let new = checkpoint::Generation {
            folder: job.folder,
            header: &self.simulation.header(job.scene, &job.scene_hash),
            rows: &rows,
            clock: &crate::resume::clock_to_json(&self.simulation.clock, over),
            outputs: outputs.as_ref(),
            scene: &job.start.scene,
            job: job.deadline.job.as_deref(),
            keep: checkpoint::Keep { newest: job.cli.checkpoint_keep as usize, archive: job.cli.checkpoint_archive },
            still_ours: &still_ours,
        };
        let generation = checkpoint::commit(&new, job.comm)?;
        self.note("checkpoint", &format!("gen-{generation:06} in {:.3} s", begun.elapsed().as_secs_f64()));
        self.pace.wrote_checkpoint(begun.elapsed());
        self.checkpointed = Instant::now();
        self.checkpoint_step = self.simulation.clock.step;
        Ok(())
    }

    /// Ends early, with a checkpoint.
    fn stop(mut self, reason: Reason) -> Result<Outcome, RunError> {
        self.check_finite()?;
        self.checkpoint(false)?;
        self.progress.finish();
        self.report_progress(true);
        self.log_phases();
        let (folder, clock) = (self.job.folder, self.simulation.clock);
        agree(self.job.comm, || {
            // The request is honoured once.
            let _ = std::fs::remove_file(folder.stop());
            let text = serde_json::json!({ "reason": reason.name(), "step": clock.step, "time": clock.time });
            Ok(disk::write_atomic(&folder.to_continue(), format!("{text}\n").as_bytes())?)
        })?;
        self.note("stop", reason.name());
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
            tell(Level::Warning, &format!("the faulty state could not be kept: {error}"));
        }
        self.note("failed", &fault.to_string());
        RunError::Numerical { fault, state }
    }
}
