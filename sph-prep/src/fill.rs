//! Particles from the lattice of every body, each rank its share.
//!
//! Numbers are dense and in lattice order: body by body, then x, y, z with z fastest. They are found by counting each
//! rank's share of the columns and summing over the shares before, so that they don't depend on the number of ranks.
//! Then each rank makes the particles whose numbers fall to it; it never holds others.

use crate::{
    initial::Stress,
    lattice::{Column, Lattice},
    relax,
};
use formats::{
    scene::{Scene, WallLattice},
    snapshot::{Rows, share},
};
use mpi::{collective::SystemOperation, traits::*};
use std::ops::Range;

/// How many particles each share of each body's columns holds.
#[derive(Clone, Debug)]
pub struct Plan {
    /// One a body.
    pub lattices: Vec<Lattice>,
    /// Number of shares the columns of each body are divided into.
    shares: u64,
    /// Number of the first particle of each share, body by body, and the total at the end.
    first: Vec<u64>,
    /// Particles of each body that would lie in obstacles, and are left out.
    left_out: Vec<u64>,
    clearing: Clearing,
}

/// Room that obstacles leave: particles whose places in the lattice lie inside are left out.
#[derive(Clone, Debug)]
struct Clearing(Option<WallLattice>);

impl Clearing {
    fn new(scene: &Scene) -> Self {
        Self((!scene.obstacles.is_empty()).then(|| WallLattice::new(scene)))
    }

    fn is_free(&self, x: [f64; 3]) -> bool {
        self.0.as_ref().is_none_or(|lattice| lattice.inside_obstacle(x).is_none())
    }

    /// The cells of a column that have particles.
    fn cells(&self, lattice: &Lattice, column: Column) -> impl Iterator<Item = u64> {
        (0..column.cells).filter(move |&cell| self.is_free([column.x, column.y, lattice.z(column, cell)]))
    }

    fn count(&self, lattice: &Lattice, column: Column) -> u64 {
        if self.0.is_none() { column.cells } else { self.cells(lattice, column).count() as u64 }
    }
}

impl Plan {
    /// Counts in parallel. Collective.
    pub fn new(scene: &Scene, comm: &impl Communicator) -> Self {
        let lattices = lattices(scene);
        let (rank, size) = (comm.rank() as u64, comm.size() as u64);
        let clearing = Clearing::new(scene);
        let kept = |l: &Lattice| count(l, share(l.columns(), rank, size), &clearing);
        let mine: Vec<u64> = lattices.iter().map(kept).collect();
        let mut all = vec![0; mine.len() * size as usize];
        comm.all_gather_into(&mine[..], &mut all[..]);
        let mut plan = Self::from_counts(lattices, size, clearing, |body, rank| all[rank * mine.len() + body]);
        if plan.clearing.0.is_some() {
            let full = |l: &Lattice| count(l, share(l.columns(), rank, size), &Clearing(None));
            let lost: Vec<u64> = plan.lattices.iter().zip(&mine).map(|(l, kept)| full(l) - kept).collect();
            comm.all_reduce_into(&lost[..], &mut plan.left_out[..], SystemOperation::sum());
        }
        plan
    }

    fn from_counts(
        lattices: Vec<Lattice>,
        shares: u64,
        clearing: Clearing,
        counted: impl Fn(usize, usize) -> u64,
    ) -> Self {
        let mut first = vec![0];
        for body in 0..lattices.len() {
            for rank in 0..shares as usize {
                first.push(first[first.len() - 1] + counted(body, rank));
            }
        }
        let left_out = vec![0; lattices.len()];
        Self { lattices, shares, first, left_out, clearing }
    }

    /// Number of particles.
    pub fn total(&self) -> u64 {
        self.first[self.first.len() - 1]
    }

    /// Numbers of the particles of a body.
    pub fn body(&self, body: usize) -> Range<u64> {
        let shares = self.shares as usize;
        self.first[body * shares]..self.first[(body + 1) * shares]
    }

    /// Particles of a body that would lie in obstacles, and are left out.
    pub fn left_out(&self, body: usize) -> u64 {
        self.left_out[body]
    }

    /// Makes the particles with these numbers.
    pub fn particles(&self, scene: &Scene, ids: Range<u64>) -> Rows {
        let mut rows = empty(ids.start, (ids.end - ids.start) as usize);
        let stress = Stress::new(scene);
        for (body, lattice) in self.lattices.iter().enumerate() {
            let numbers = self.body(body);
            if numbers.end <= ids.start || numbers.start >= ids.end {
                continue;
            }
            let jitter = Jitter::new(scene, lattice);
            let relaxed = (scene.initial.relax > 0).then(|| {
                let mut all = displaced(lattice, &jitter, numbers.start);
                relax::relax(scene, lattice, &mut all);
                all
            });
            for part in 0..self.shares {
                let at = body * self.shares as usize + part as usize;
                let mut next = self.first[at];
                if self.first[at + 1] <= ids.start || next >= ids.end {
                    continue;
                }
                for column in share(lattice.columns(), part, self.shares).map(|c| lattice.column(c)) {
                    if next + column.cells <= ids.start && self.clearing.0.is_none() {
                        next += column.cells;
                        continue;
                    }
                    for cell in self.clearing.cells(lattice, column) {
                        let id = next;
                        next += 1;
                        if !ids.contains(&id) {
                            continue;
                        }
                        let placed = [column.x, column.y, lattice.z(column, cell)];
                        let mut position = jitter.displace(id, placed);
                        if let Some(ground) = lattice.solid.ground() {
                            // The lattice leans with the ground, and so do its displacements.
                            position[2] += ground.at(position[0], position[1]) - ground.at(column.x, column.y);
                        }
                        if !self.clearing.is_free(position) {
                            position = placed;
                        }
                        // What jitter does to rings leaves them their mass; relaxed, they have the same section again.
                        let mut place = [column.x, column.y];
                        if lattice.solid.ground().is_some() {
                            place = [position[0], position[1]];
                        }
                        if let Some(all) = &relaxed {
                            position = all[(id - self.first[body * self.shares as usize]) as usize];
                            place = [position[0], position[1]];
                        }
                        let stress = stress.at(&self.lattices, place, position[2]);
                        let density = scene.material.density_at(-(stress[0] + stress[1] + stress[2]) / 3.0);
                        rows.id.push(id);
                        rows.body.push(body as u64);
                        rows.position.push(position);
                        rows.velocity.push(scene.bodies[body].velocity);
                        let volume =
                            if relaxed.is_some() { lattice.volume(place[0]) } else { lattice.bulk_volume(&column) };
                        rows.mass.push(density * volume);
                        rows.density.push(density);
                        rows.stress.push(stress);
                        rows.stress_work.push(0.0);
                        rows.viscous_work.push(0.0);
                        rows.plastic_strain.push(0.0);
                    }
                }
            }
        }
        rows
    }

    /// Volume of the particles of a body whose columns fall to `rank`; units as [`Lattice::volume`].
    pub fn volume(&self, body: usize, rank: u64) -> f64 {
        let lattice = &self.lattices[body];
        let columns = share(lattice.columns(), rank, self.shares).map(|c| lattice.column(c));
        columns.map(|c| self.clearing.count(lattice, c) as f64 * lattice.bulk_volume(&c)).sum()
    }
}

/// Places of all particles of a body, whose first has this number.
fn displaced(lattice: &Lattice, jitter: &Jitter, first: u64) -> Vec<[f64; 3]> {
    let columns = (0..lattice.columns()).map(|c| lattice.column(c));
    let places = columns.flat_map(|c| (0..c.cells).map(move |cell| [c.x, c.y, lattice.z(c, cell)]));
    places.zip(first..).map(|(x, id)| jitter.displace(id, x)).collect()
}

/// The lattices of all bodies.
pub fn lattices(scene: &Scene) -> Vec<Lattice> {
    (0..scene.bodies.len()).map(|body| Lattice::new(scene, body)).collect()
}

fn count(lattice: &Lattice, columns: Range<u64>, clearing: &Clearing) -> u64 {
    columns.map(|c| clearing.count(lattice, lattice.column(c))).sum()
}

fn empty(first: u64, capacity: usize) -> Rows {
    Rows {
        first,
        id: Vec::with_capacity(capacity),
        body: Vec::with_capacity(capacity),
        position: Vec::with_capacity(capacity),
        velocity: Vec::with_capacity(capacity),
        acceleration: Vec::new(),
        mass: Vec::with_capacity(capacity),
        density: Vec::with_capacity(capacity),
        stress: Vec::with_capacity(capacity),
        stress_work: Vec::with_capacity(capacity),
        viscous_work: Vec::with_capacity(capacity),
        plastic_strain: Vec::with_capacity(capacity),
    }
}

/// Random displacements, uniform in plus or minus `amplitude` along each axis that is solved for. They follow from
/// the seed and the particle's number alone.
struct Jitter {
    axes: &'static [usize],
    amplitude: [f64; 3],
    key: u64,
}

impl Jitter {
    fn new(scene: &Scene, lattice: &Lattice) -> Self {
        // Planes closer than a spacing have their first particles closer to the faces: none may leave the body.
        let most = |axis: usize| scene.spacing.min(2.0 * lattice.margin(axis));
        let mut amplitude = [0, 1, 2].map(|axis| scene.initial.jitter * most(axis));
        if lattice.solid.ground().is_some() {
            // Layers may be nearer to each other than a spacing, and to the ground.
            amplitude[2] *= 2.0 / 3.0;
        }
        Self { axes: scene.space.axes(), amplitude, key: splitmix64(scene.initial.seed) }
    }

    fn displace(&self, id: u64, mut x: [f64; 3]) -> [f64; 3] {
        if self.amplitude[0] > 0.0 {
            for &axis in self.axes {
                let bits = splitmix64(self.key ^ (3 * id + axis as u64));
                // The top 53 bits fill a mantissa: uniform in [0, 1).
                let uniform = (bits >> 11) as f64 / (1u64 << 53) as f64;
                x[axis] += self.amplitude[axis] * (2.0 * uniform - 1.0);
            }
        }
        x
    }
}

/// A step of the SplitMix64 generator from the state `x` (Steele, Lea & Flood 2014): a good 64-bit hash.
fn splitmix64(x: u64) -> u64 {
    let mut z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// All particles of a scene, made at once.
#[cfg(test)]
pub(crate) fn serial(scene: &Scene) -> Rows {
    let lattices = lattices(scene);
    let clearing = Clearing::new(scene);
    let counts: Vec<u64> = lattices.iter().map(|l| count(l, 0..l.columns(), &clearing)).collect();
    let plan = Plan::from_counts(lattices, 1, clearing, |body, _| counts[body]);
    plan.particles(scene, 0..plan.total())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scene;
    use formats::{
        scene::{self, Body, Shape},
        space::Space,
    };

    /// What all ranks together would make.
    fn made_by(scene: &Scene, size: u64) -> (Plan, Vec<Rows>) {
        let lattices = lattices(scene);
        let columns = lattices.clone();
        let clearing = Clearing::new(scene);
        let plan = Plan::from_counts(lattices, size, clearing.clone(), |body, rank| {
            count(&columns[body], share(columns[body].columns(), rank as u64, size), &clearing)
        });
        let rows = (0..size).map(|r| plan.particles(scene, share(plan.total(), r, size))).collect();
        (plan, rows)
    }

    fn two_bodies() -> Scene {
        let cylinder = Shape::Cylinder { base: [0.0; 3], radius: 0.1, height: 0.05 };
        let mut scene = scene(Space::ThreeD, 0.01, cylinder);
        let shape = Shape::Wedge { corner: [0.2, -0.1, 0.0], size: [0.2, 0.07, 0.1], falls_left: false };
        scene.bodies.push(Body { name: "heap".into(), shape, velocity: [1.0, 0.0, -2.0] });
        scene.initial.jitter = 0.3;
        scene
    }

    #[test]
    fn any_number_of_ranks_makes_the_same_particles() {
        for lattice in [scene::Lattice::Cubic, scene::Lattice::Hexagonal, scene::Lattice::BodyCentred] {
            let mut scene = two_bodies();
            scene.initial.lattice = lattice;
            same_on_any_number_of_ranks(&scene);
            scene.initial.relax = 2;
            same_on_any_number_of_ranks(&scene);
        }
    }

    fn same_on_any_number_of_ranks(scene: &Scene) {
        let (plan, one) = made_by(scene, 1);
        assert_eq!(one[0].len() as u64, plan.total());
        assert!(one[0].id.iter().enumerate().all(|(n, &id)| n as u64 == id), "dense and in order");
        assert_eq!(plan.body(0).end, plan.body(1).start);
        for size in [2, 3, 5, 64] {
            let mut all = Rows::default();
            for (rank, rows) in made_by(scene, size).1.into_iter().enumerate() {
                assert_eq!(rows.first, share(plan.total(), rank as u64, size).start);
                all.id.extend(rows.id);
                all.body.extend(rows.body);
                all.position.extend(rows.position);
                all.velocity.extend(rows.velocity);
                all.mass.extend(rows.mass);
                all.density.extend(rows.density);
                all.stress.extend(rows.stress);
                all.stress_work.extend(rows.stress_work);
                all.viscous_work.extend(rows.viscous_work);
                all.plastic_strain.extend(rows.plastic_strain);
            }
            assert_eq!(all, one[0], "{size} ranks");
        }
    }

    #[test]
    fn z_is_fastest_then_y_then_x() {
        let shape = Shape::Box { min: [0.0; 3], max: [0.02, 0.03, 0.02] };
        let (_, rows) = made_by(&scene(Space::ThreeD, 0.01, shape), 1);
        let keys: Vec<_> = rows[0].position.iter().map(|p| p.map(|x| (x * 1e6).round() as i64)).collect();
        assert_eq!(keys.len(), 12);
        assert!(keys.is_sorted());
    }

    #[test]
    fn the_mass_is_the_volume_times_the_density() {
        let scene = two_bodies();
        let (plan, rows) = made_by(&scene, 3);
        let mass: f64 = rows.iter().flat_map(|r| &r.mass).sum();
        let volume: f64 = (0..2).flat_map(|b| (0..3).map(move |r| (b, r))).map(|(b, r)| plan.volume(b, r)).sum();
        assert!((mass / (volume * 2600.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn jitter_stays_within_its_amplitude_and_is_centred() {
        let mut scene = scene(Space::PlaneStrain, 0.01, Shape::Box { min: [0.0; 3], max: [1.0, 0.0, 1.0] });
        let (_, ordered) = made_by(&scene, 1);
        scene.initial.jitter = 0.2;
        let (_, disordered) = made_by(&scene, 1);
        scene.initial.seed = 2;
        let (_, otherwise) = made_by(&scene, 1);
        assert_ne!(disordered[0].position, otherwise[0].position);
        let shifts: Vec<f64> =
            ordered[0].position.iter().zip(&disordered[0].position).map(|(a, b)| (b[0] - a[0]) / 0.01).collect();
        assert!(disordered[0].position.iter().all(|p| p[1] == 0.0));
        assert!(shifts.iter().all(|s| s.abs() <= 0.2 + 1e-9));
        let mean = shifts.iter().sum::<f64>() / shifts.len() as f64;
        let variance = shifts.iter().map(|s| s * s).sum::<f64>() / shifts.len() as f64;
        assert!(mean.abs() < 0.005, "{mean}");
        assert!((variance / (0.04 / 3.0) - 1.0).abs() < 0.05, "{variance}");
        assert_eq!(ordered[0].mass, disordered[0].mass);
    }
}
