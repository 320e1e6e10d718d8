//! How long each part of the steps takes: a stopwatch that is always in one phase, and a line in `log/phases.csv` for every
//! launch that took a step. It costs a look at the clock whenever the phase changes, and nothing per particle.

use crate::algebra::Vector;
use crate::parallel::{Reduce, processor};
use crate::physics::Physics;
use crate::simulation::Simulation;
use formats::folder::RunFolder;
use std::io::Write;
use std::time::{Duration, Instant};

/// The parts of a step, and what goes on between steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Finding what is within the support, and laying it out for the sweeps.
    Support,
    /// The velocity gradient.
    Gradient,
    /// Density, rotation and constitutive law.
    Material,
    /// The acceleration by stress and by the linear artificial viscosity, and the work of both.
    Acceleration,
    /// Images, and the extrapolation to wall particles.
    Walls,
    /// Exchange with other ranks, with waiting for them.
    Halo,
    /// All that building the lists takes: sharing out, migration, halo plan, images, wall sites, the lists.
    Lists,
    /// What a law or a scene asks for beyond the plain scheme (see [`crate::stabilize`]).
    Stabilisers,
    /// Kick and drift; the plan of the step, with its reduction and waiting for it.
    Motion,
    /// History, snapshots, checkpoints, news for the user.
    Output,
}

impl Phase {
    /// All of them, in the order of the file's columns.
    pub const ALL: [Self; 10] = [
        Self::Support,
        Self::Gradient,
        Self::Material,
        Self::Acceleration,
        Self::Walls,
        Self::Halo,
        Self::Lists,
        Self::Stabilisers,
        Self::Motion,
        Self::Output,
    ];

    /// Its column.
    pub fn name(self) -> &'static str {
        match self {
            Self::Support => "support",
            Self::Gradient => "gradient",
            Self::Material => "material",
            Self::Acceleration => "acceleration",
            Self::Walls => "walls",
            Self::Halo => "halo",
            Self::Lists => "lists",
            Self::Stabilisers => "stabilisers",
            Self::Motion => "motion",
            Self::Output => "output",
        }
    }
}

/// Sums up the time spent in each phase.
#[derive(Clone, Debug)]
pub struct Stopwatch {
    spent: [Duration; Phase::ALL.len()],
    phase: Phase,
    /// When the phase began.
    since: Instant,
    begun: Instant,
    /// Processor time, but for what calls of MPI take, before the phase began; of output nothing counts.
    computed: Duration,
    /// The same up to where output last ended.
    counted_from: Duration,
}

/// Processor time of this rank in which it did not wait for others.
fn computing() -> Duration {
    processor::time().saturating_sub(processor::waited())
}

impl Stopwatch {
    /// Starts now, between two steps.
    pub fn start() -> Self {
        let now = Instant::now();
        Self {
            spent: [Duration::ZERO; Phase::ALL.len()],
            phase: Phase::Output,
            since: now,
            begun: now,
            computed: Duration::ZERO,
            counted_from: Duration::ZERO,
        }
    }

    /// What follows belongs to `phase`. Returns the one that ends, for who goes back to it.
    pub fn enter(&mut self, phase: Phase) -> Phase {
        let now = Instant::now();
        self.spent[self.phase as usize] += now - self.since;
        self.since = now;
        match (self.phase, phase) {
            (Phase::Output, Phase::Output) => {}
            (Phase::Output, _) => self.counted_from = computing(),
            (_, Phase::Output) => self.computed += computing().saturating_sub(self.counted_from),
            _ => {}
        }
        std::mem::replace(&mut self.phase, phase)
    }

    /// Processor time spent between outputs on anything but calls of MPI.
    pub fn computed(&self) -> Duration {
        match self.phase {
            Phase::Output => self.computed,
            _ => self.computed + computing().saturating_sub(self.counted_from),
        }
    }

    /// Time since the start, and what each phase had of it, in the order of [`Phase::ALL`].
    pub fn read(&mut self) -> (Duration, [Duration; Phase::ALL.len()]) {
        self.enter(self.phase);
        (self.since - self.begun, self.spent)
    }
}

/// Columns of the file, with units.
pub fn columns() -> String {
    let before = ["step [1]", "steps [1]", "particle_steps [1]", "ranks [1]", "loop [s]"].map(str::to_owned);
    let phases = Phase::ALL.map(|phase| format!("{} [s]", phase.name()));
    let after = ["memory_largest [B]", "memory_sum [B]", "neighbours [1]", "computed [s]"].map(str::to_owned);
    [&before[..], &phases, &after].concat().join(",")
}

/// Adds a line to the file, below its columns where it is new. Nothing depends on it, so a failure is none of the run's.
pub fn log(folder: &RunFolder, line: &str) {
    let path = folder.log().join("phases.csv");
    if let Ok(mut file) = std::fs::File::options().create(true).append(true).open(path) {
        let is_new = file.metadata().is_ok_and(|facts| facts.len() == 0);
        let text = if is_new { columns() + "\n" + line } else { line.to_owned() };
        let _ = file.write_all((text + "\n").as_bytes());
    }
}

/// Distances a rank looks at to estimate the number of neighbours: some hundredths of a second.
const LOOKS: usize = 1 << 25;

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// The line of a launch that began at step `first`. Times are means over the ranks, so that the phases add up to the
    /// loop; waiting for slower ranks counts as exchange or as reduction. Memory is the peak of what was resident, the
    /// largest of a rank and the sum over all; neighbours are those within the support, of all kinds, at the end, a
    /// mean over some of the particles. Collective.
    pub fn phases_line(&mut self, first: u64) -> String {
        let (whole, spent) = self.watch.read();
        let memory = peak_memory();
        let mut sums: Vec<u64> = std::iter::once(whole).chain(spent).map(|time| time.as_nanos() as u64).collect();
        let (found, looked) = self.sampled_neighbours();
        sums.extend([memory, found, looked, self.watch.computed().as_nanos() as u64]);
        self.comm.sum(&mut sums);
        let mut largest = [memory as f64];
        self.comm.max(&mut largest);

        let (times, others) = sums.split_at(1 + Phase::ALL.len());
        let &[memory, found, looked, computed] = others else { unreachable!("four were added") };
        let ranks = self.comm.size() as u64;
        let seconds = times.iter().map(|&time| format!("{:.6}", time as f64 * 1e-9 / ranks as f64));
        let (step, steps) = (self.clock.step, self.clock.step - first);
        let mut cells = [step, steps, steps * self.parameters.count, ranks].map(|count| count.to_string()).to_vec();
        cells.extend(seconds);
        cells.extend([largest[0] as u64, memory].map(|bytes| bytes.to_string()));
        cells.push(format!("{:.2}", found as f64 / looked.max(1) as f64));
        cells.push(format!("{:.6}", computed as f64 * 1e-9));
        cells.join(",")
    }

    /// Neighbours of some owned particles spread evenly, found without the lists, and the number of those particles.
    fn sampled_neighbours(&self) -> (u64, u64) {
        let p = &self.particles;
        let looked = (LOOKS / p.x.len().max(1)).clamp(32, 4096).min(p.owned);
        let support = 2.0 * self.parameters.h;
        let near = |x: Vector<D>| p.x.iter().filter(|&&other| (x - other).norm2() < support * support).count() as u64;
        // Each finds itself.
        let found = (0..looked).map(|k| near(p.x[k * p.owned / looked]) - 1).sum();
        (found, looked as u64)
    }
}

/// Peak of this process's resident memory, bytes; 0 where the system does not tell.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    kilobytes.unwrap_or(0) * 1024
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_add_up_and_are_gone_back_to() {
        let begun = Instant::now();
        let mut watch = Stopwatch::start();
        let sleep = || std::thread::sleep(Duration::from_millis(3));
        watch.enter(Phase::Material);
        sleep();
        let before = watch.enter(Phase::Halo);
        assert_eq!(before, Phase::Material);
        sleep();
        watch.enter(before);
        sleep();
        let (whole, spent) = watch.read();
        assert!(whole <= begun.elapsed() && whole == spent.iter().sum());
        let of = |phase: Phase| spent[phase as usize];
        assert!(of(Phase::Material) >= Duration::from_millis(6) && of(Phase::Halo) >= Duration::from_millis(3));
        assert!(of(Phase::Lists).is_zero());
        assert!(Phase::ALL.iter().enumerate().all(|(place, &phase)| phase as usize == place));
    }

    #[test]
    fn memory_is_told_on_linux() {
        assert!(!cfg!(target_os = "linux") || peak_memory() > 1 << 20);
    }
}
