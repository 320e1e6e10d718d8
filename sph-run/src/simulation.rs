//! Everything one rank knows: its particles, what surrounds them, and where the run stands.

use crate::algebra::{Matrix, Vector};
use crate::boundary::field::Spread;
use crate::boundary::mirror::Mirrors;
use crate::boundary::periodic::Periods;
use crate::boundary::wall::Walls;
use crate::lanes::Instructions;
use crate::material::Material as _;
use crate::neighbors::{Neighbors, blocks_order, needing_last};
use crate::parallel::Reduce;
use crate::parallel::balance::{Balance, By};
use crate::parallel::halo::{Fields, Halo};
use crate::parallel::migrate;
use crate::parallel::orb::Tree;
use crate::particles::Particles;
use crate::phases::{Phase, Stopwatch};
use crate::physics::Physics;
use crate::rates::momentum::Viscosity;
use crate::space::Space;
use crate::stabilize::{Buffers, Stabilisers};
use crate::sweep::Pairs;
use formats::h5::Communicator;
use formats::scene::{FARTHEST, Scene, WallLattice};

/// Skin of the neighbour lists over the smoothing length: lists serve until a particle moved half of it. Thicker lists take
/// longer to go through and more memory, so it grows only where the thin ones would not serve for [`SERVE`] steps.
pub const SKIN: f64 = 0.3;
const THICKEST: f64 = 0.6;
const SERVE: f64 = 16.0;
const _: () = assert!(2.0 + THICKEST < FARTHEST, "sites behind a terrain are found less far");

/// Numbers of a run; all but the skin are fixed.
#[derive(Clone, Copy, Debug)]
pub struct Parameters {
    pub spacing: f64,
    pub h: f64,
    pub sound_speed: f64,
    pub courant: f64,
    /// Longest step the viscosity allows, s.
    pub viscous_step: f64,
    pub damping: f64,
    /// Density below which the material carries no stress, kg/m3.
    pub gate: f64,
    /// Skin of the neighbour lists, m: see [`Simulation::choose_skin`].
    pub skin: f64,
    pub pairs: Pairs,
    pub viscosity: Viscosity,
    pub stabilisers: Stabilisers,
    /// Number of all particles on all ranks.
    pub count: u64,
}

/// Where the run stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    /// Time, s.
    pub time: f64,
    /// Steps done.
    pub step: u64,
    /// Length of the last step, s.
    pub time_step: f64,
    /// Largest kinetic energy so far, J.
    pub peak_kinetic: f64,
    /// Snapshots written.
    pub snapshots: u64,
    /// The next one is due after so many of its intervals.
    pub snapshot_event: u64,
    /// Lines of history written.
    pub lines: u64,
    /// The next one is due after so many of its intervals.
    pub line_event: u64,
}

/// How the particles are shared out.
#[derive(Debug)]
pub struct Partition<const D: usize> {
    pub tree: Tree,
    pub halo: Halo<D>,
    balance: Balance,
}

/// One rank's part of a run.
pub struct Simulation<'a, const D: usize, const N: usize, P: Physics<D, N>> {
    pub comm: &'a Communicator,
    pub material: P::Material,
    pub parameters: Parameters,
    pub gravity: Vector<D>,
    pub clock: Clock,
    pub particles: Particles<D, N>,
    pub neighbors: Neighbors<D>,
    pub partition: Partition<D>,
    pub periods: Periods<D>,
    pub mirrors: Mirrors<D, N>,
    pub walls: Walls,
    /// Positions when the neighbour lists were built.
    pub x_build: Vec<Vector<D>>,
    /// Velocity gradients of some of the particles; kept for its memory only.
    pub gradient: Vec<Matrix<D>>,
    pub buffers: Buffers<D, N>,
    pub watch: Stopwatch,
    /// Share the particles out anew at every build of the lists: for tests.
    pub always_rebalance: bool,
}

impl<'a, const D: usize, const N: usize, P: Physics<D, N>> Simulation<'a, D, N, P> {
    /// Takes any share of the particles on each rank, sends them home and builds the lists. Collective.
    pub fn new(
        comm: &'a Communicator,
        scene: &Scene,
        material: P::Material,
        particles: Particles<D, N>,
        count: u64,
        clock: Clock,
    ) -> Self {
        Self::with_instructions(Instructions::best(), comm, scene, material, particles, count, clock)
    }

    /// As [`Simulation::new`], computing pairs with these instructions.
    pub fn with_instructions(
        instructions: Instructions,
        comm: &'a Communicator,
        scene: &Scene,
        material: P::Material,
        mut particles: Particles<D, N>,
        count: u64,
        clock: Clock,
    ) -> Self {
        let (h, dx) = (scene.h(), scene.spacing);
        let sound_speed = scene.material.sound_speed();
        let numerics = &scene.numerics;
        let viscosity = Viscosity {
            strength: numerics.viscosity * h * sound_speed * scene.material.density(),
            below: if numerics.viscosity_on_approach { 0.0 } else { f64::INFINITY },
        };
        // Szewc 2017, Eq 12.
        let viscous_step = material
            .largest_viscosity()
            .map_or(f64::INFINITY, |largest| numerics.viscous_courant * scene.material.density() * h * h / largest);
        let periods = Periods::new::<N, P::Space>(scene);
        periods.wrap(&mut particles.x);
        let axes = scene.space.axes();
        let periodic = scene.periodic.map(|ends| ends.is_some());
        let tree =
            Tree::build(particles.x.iter().map(|&x| P::Space::to_disk(x)), None, axes, comm).with_periods(periodic);
        let mut simulation = Self {
            comm,
            material,
            parameters: Parameters {
                spacing: dx,
                h,
                sound_speed,
                courant: numerics.courant,
                viscous_step,
                damping: numerics.damping,
                gate: numerics.density_gate * scene.material.density(),
                skin: SKIN * h,
                pairs: Pairs { h, spacing: dx, instructions, precision: numerics.precision },
                viscosity,
                stabilisers: Stabilisers::new(scene),
                count,
            },
            gravity: P::Space::from_disk(scene.gravity),
            clock,
            particles,
            neighbors: Neighbors::default(),
            partition: Partition { tree, halo: Halo::default(), balance: Balance::from_step(clock.step) },
            periods,
            mirrors: Mirrors::new::<P::Space>(scene),
            walls: Walls::new(WallLattice::new(scene), dx.powi(D as i32)),
            x_build: Vec::new(),
            gradient: Vec::new(),
            buffers: Buffers::default(),
            watch: Stopwatch::start(),
            always_rebalance: false,
        };
        simulation.settle();
        simulation.fill(Fields::Stress);
        simulation
    }

    /// Chooses the skin of the next lists, when no particle goes further than `farthest` in a step.
    pub fn choose_skin(&mut self, farthest: f64) {
        let h = self.parameters.h;
        // Scenes with a period are only long enough for the thin one.
        let thickest = if self.periods.are_none() { THICKEST } else { SKIN };
        self.parameters.skin = (2.0 * SERVE * farthest).clamp(SKIN * h, thickest * h);
    }

    /// Shares the particles out anew if the load has shifted, sends them home, and builds halo, boundaries and lists.
    pub fn rebuild(&mut self) {
        self.periods.wrap(&mut self.particles.x[..self.particles.owned]);
        let (step, computed) = (self.clock.step, self.watch.computed());
        let partition = &mut self.partition;
        let is_shared = self.comm.size() > 1;
        if is_shared
            && (partition.balance.is_off(self.parameters.count, step, computed, self.comm) || self.always_rebalance)
        {
            let weights: Vec<u64> = partition.balance.weights().collect();
            let axes: Vec<usize> = (0..3).filter(|&a| P::Space::axis(a).is_some()).collect();
            let places = self.particles.x[..self.particles.owned].iter().map(|&x| P::Space::to_disk(x));
            partition.tree = partition.tree.rebuilt(places, Some(&weights), &axes, self.comm);
        }
        self.settle();
    }

    fn settle(&mut self) {
        migrate::owners::<D, N, P::Space>(self.comm, &self.partition.tree, &mut self.particles);
        let (h, skin) = (self.parameters.h, self.parameters.skin);
        let reach = 2.0 * h + skin;
        let (reach_of, widest) = self.walls.reaches::<D, N, P::Space>(reach);
        let order = blocks_order(&self.particles.x);
        let x: Vec<Vector<D>> = order.iter().map(|&i| self.particles.x[i as usize]).collect();
        let halo = &mut self.partition.halo;
        *halo = Halo::plan(self.comm, &x, self.periods.shifts(), &reach_of, widest);
        let mut needs = vec![false; x.len()];
        if halo.has_peers() {
            // Who may have neighbours among copies, images or walls goes last: the others need not wait for them.
            needs = x.iter().map(|&x| self.mirrors.are_near(x, reach) || reach_of(x) > reach).collect();
            halo.needed(|i| needs[i] = true);
        }
        let last = needing_last(&needs);
        halo.renumber(&last);
        self.particles.arrange(&last.iter().map(|&k| order[k as usize]).collect::<Vec<_>>());
        self.x_build.clone_from(&self.particles.x);
        self.refresh_volumes();
        let halo = &mut self.partition.halo;
        halo.create(self.comm, &mut self.particles);
        halo.fill(self.comm, &mut self.particles, Fields::Motion);
        self.mirrors.create(&mut self.particles, reach_of);
        self.mirrors.fill(&mut self.particles, Fields::Motion);
        self.walls.create::<D, N, P::Space>(&mut self.particles, reach);
        self.neighbors.build(&self.particles, reach, self.parameters.pairs);
        if self.comm.size() > 1 {
            let lists = &self.neighbors.of_owned;
            self.partition.balance.settled((0..lists.len()).map(|i| lists.of(i).len()));
        }
        self.reflect_motion(0);
    }

    /// How many of the owned particles, from the first on and in whole blocks, can be computed while others are on their
    /// way; none where nothing is under way.
    pub fn ahead(&self) -> usize {
        if self.partition.halo.has_peers() { self.neighbors.alone() } else { 0 }
    }

    /// Lays out the owned particles, and finds what is near the first `end`, which have no neighbours but owned ones.
    pub fn support_first(&mut self, end: usize) {
        let before = self.watch.enter(Phase::Support);
        let (p, pairs) = (&self.particles, self.parameters.pairs);
        self.neighbors.refresh_part::<N, P::Kernel>(0..p.owned, p, pairs);
        self.neighbors.find_first(end, &p.x, pairs);
        self.watch.enter(before);
    }

    /// Velocities of wall particles, from the material around them; then sweeps can begin. The first `known` particles are laid
    /// out already.
    fn reflect_motion(&mut self, known: usize) {
        let before = self.watch.enter(Phase::Support);
        let (p, pairs) = (&mut self.particles, self.parameters.pairs);
        self.neighbors.refresh_from::<N, P::Kernel>(known, p, pairs);
        if self.walls.has_sites() {
            self.watch.enter(Phase::Walls);
            self.walls.fill_motion::<D, N, P::Space, P::Kernel>(p, &self.neighbors, pairs);
            self.watch.enter(Phase::Support);
            self.neighbors.refresh_from::<N, P::Kernel>(p.mirror, p, pairs);
        }
        self.neighbors.find(&self.particles.x, pairs);
        self.watch.enter(before);
    }

    /// Brings everything around the owned particles up to date, in the one order that is right: halo, then images of
    /// owned and halo, then walls, which see all three.
    pub fn fill(&mut self, fields: Fields) {
        self.fill_while(fields, 0, |_| {});
    }

    /// As [`Simulation::fill`], and work on the first `ahead` owned particles while copies are on their way, of which they need
    /// none. The work on motion begins with [`Simulation::support_first`]; of no particles there is none.
    pub fn fill_while(&mut self, fields: Fields, ahead: usize, meanwhile: impl FnOnce(&mut Self)) {
        let before = self.watch.enter(Phase::Halo);
        let mut halo = std::mem::take(&mut self.partition.halo);
        halo.pack_all(&mut self.particles, fields);
        halo.send(self.comm, || {
            if ahead > 0 {
                meanwhile(self);
            }
        });
        self.watch.enter(Phase::Halo);
        halo.unpack_all(&mut self.particles, fields);
        self.partition.halo = halo;
        self.watch.enter(Phase::Walls);
        let p = &mut self.particles;
        self.mirrors.fill(p, fields);
        match fields {
            Fields::Motion => self.reflect_motion(if ahead > 0 { self.particles.owned } else { 0 }),
            Fields::Stress => {
                self.walls.fill_stress::<D, N, P::Space, P::Kernel>(p, &self.neighbors, self.parameters.pairs);
            }
        }
        self.watch.enter(before);
    }

    /// Gives a field that only owned particles have to all copies and images of them, and zero to wall particles.
    pub fn spread<T: Spread<D, N>>(&mut self, field: &mut Vec<T>) {
        let before = self.watch.enter(Phase::Halo);
        self.partition.halo.spread(self.comm, &self.particles, field);
        self.watch.enter(before);
        self.mirrors.spread(&self.particles, field);
    }

    /// Volumes of the owned particles from mass, density and place.
    pub fn refresh_volumes(&mut self) {
        let p = &mut self.particles;
        for i in 0..p.owned {
            p.volume[i] = P::Space::volume(p.mass[i], p.density[i], p.x[i], self.parameters.spacing);
        }
    }

    /// What is shared out evenly among the ranks, from now on.
    pub fn share_by(&mut self, by: By) {
        self.partition.balance.by = by;
    }

    /// Largest work of a rank over the mean: as last measured, or of owned particles where nothing was. Collective.
    pub fn imbalance(&self) -> f64 {
        self.partition.balance.measured().unwrap_or_else(|| {
            let mut largest = [self.particles.owned as f64];
            self.comm.max(&mut largest);
            largest[0] * self.comm.size() as f64 / self.parameters.count.max(1) as f64
        })
    }
}
