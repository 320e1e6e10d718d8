//! The particles of one rank, one `Vec` a field, in contiguous index ranges `owned | halo | mirror | wall`.

use crate::algebra::{Sym, Vector};
use crate::material::History;
use crate::space::Space;
use formats::snapshot::Rows;

/// Bits of a key that name the mirror image, for each of the axes x y z; 0 is the particle itself.
pub const IMAGE_BITS_PER_AXIS: u32 = 3;
const IMAGE_BITS: u32 = 3 * IMAGE_BITS_PER_AXIS;

/// Key of a material particle or of one of its mirror images: ascending keys are the order of every sum over
/// neighbours. A periodic copy has the key of its original, because no particle can reach both. Ids are below 2^54. Wall particles carry the keys of [`formats::scene::WallLattice::id`], above all of these.
pub fn key(id: u64, image: u16) -> u64 {
    id << IMAGE_BITS | u64::from(image)
}

/// The global particle number of a key.
pub fn id(key: u64) -> u64 {
    key >> IMAGE_BITS
}

/// Particles of one rank.
///
/// The first group of fields covers all ranges, the second only `0..owned`.
#[derive(Clone, Debug, Default)]
pub struct Particles<const D: usize, const N: usize> {
    /// End of the owned particles.
    pub owned: usize,
    /// End of the copies: of other ranks' particles, and of own ones across periodic borders.
    pub halo: usize,
    /// End of the mirror images; wall particles follow.
    pub mirror: usize,

    /// Order of sums, see [`key`].
    pub key: Vec<u64>,
    /// Position, m.
    pub x: Vec<Vector<D>>,
    /// Velocity, m/s; at the half step while rates are taken.
    pub v: Vec<Vector<D>>,
    /// Volume V = m/rho; area of the ring's section in the axisymmetric space.
    pub volume: Vec<f64>,
    /// Stress, Pa.
    pub stress: Vec<Sym<N>>,
    /// Viscosity between particles, Pa s; of laws without one it is never filled.
    pub viscosity: Vec<f64>,

    /// Acceleration, m/s2.
    pub a: Vec<Vector<D>>,
    /// Mass, kg.
    pub mass: Vec<f64>,
    /// Density, kg/m3.
    pub density: Vec<f64>,
    /// What the material remembers.
    pub history: Vec<History>,
    /// Work of the stress and heat of the viscosity between particles, J/kg.
    pub work: Vec<Work>,
    /// Index of the scene's body.
    pub body: Vec<u64>,
}

/// Energy that left the motion of a particle, J/kg.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Work the stress has done on the strain: stored or dissipated by the material.
    pub stress: f64,
    /// Heat of the viscosity between particles.
    pub viscous: f64,
}

/// u64 words that carry one particle between ranks, for D coordinates and N stress components.
pub const fn packed_len(d: usize, n: usize) -> usize {
    3 * d + n + 7
}

impl<const D: usize, const N: usize> Particles<D, N> {
    /// From rows of a particle file; accelerations are zero where the file has none.
    pub fn from_rows<S: Space<D, N>>(rows: &Rows) -> Self {
        let mut particles = Self::default();
        particles.add_rows::<S>(rows);
        particles
    }

    /// Makes room for so many particles.
    pub fn reserve(&mut self, count: usize) {
        self.key.reserve_exact(count);
        self.x.reserve_exact(count);
        self.v.reserve_exact(count);
        self.volume.reserve_exact(count);
        self.stress.reserve_exact(count);
        self.viscosity.reserve_exact(count);
        self.a.reserve_exact(count);
        self.mass.reserve_exact(count);
        self.density.reserve_exact(count);
        self.history.reserve_exact(count);
        self.work.reserve_exact(count);
        self.body.reserve_exact(count);
    }

    /// Takes in the particles of some rows as owned ones; there must be no other ranges.
    pub fn add_rows<S: Space<D, N>>(&mut self, rows: &Rows) {
        debug_assert_eq!(self.owned, self.len());
        for i in 0..rows.len() {
            self.key.push(key(rows.id[i], 0));
            self.x.push(S::from_disk(rows.position[i]));
            self.v.push(S::from_disk(rows.velocity[i]));
            self.stress.push(S::stress_from_disk(rows.stress[i]));
            self.a.push(rows.acceleration.get(i).map_or_else(Vector::default, |&a| S::from_disk(a)));
            self.mass.push(rows.mass[i]);
            self.density.push(rows.density[i]);
            self.history.push(History { plastic_strain: rows.plastic_strain[i] });
            self.work.push(Work { stress: rows.stress_work[i], viscous: rows.viscous_work[i] });
            self.body.push(rows.body[i]);
        }
        self.own(self.key.len());
    }

    /// The owned particles as rows of a file, in the order they have here.
    pub fn to_rows<S: Space<D, N>>(&self) -> Rows {
        let owned = 0..self.owned;
        Rows {
            first: 0,
            id: self.key[owned.clone()].iter().map(|&k| id(k)).collect(),
            body: self.body.clone(),
            position: self.x[owned.clone()].iter().map(|&x| S::to_disk(x)).collect(),
            velocity: self.v[owned.clone()].iter().map(|&v| S::to_disk(v)).collect(),
            acceleration: self.a.iter().map(|&a| S::to_disk(a)).collect(),
            mass: self.mass.clone(),
            density: self.density.clone(),
            stress: self.stress[owned].iter().map(|&s| S::stress_to_disk(s)).collect(),
            stress_work: self.work.iter().map(|w| w.stress).collect(),
            viscous_work: self.work.iter().map(|w| w.viscous).collect(),
            plastic_strain: self.history.iter().map(|h| h.plastic_strain).collect(),
        }
    }

    /// Declares the first `count` particles owned and forgets all others.
    pub fn own(&mut self, count: usize) {
        (self.owned, self.halo, self.mirror) = (count, count, count);
        self.resize(count);
    }

    /// Resizes the fields that cover all ranges.
    pub fn resize(&mut self, len: usize) {
        self.key.resize(len, 0);
        self.x.resize(len, Vector::default());
        self.v.resize(len, Vector::default());
        self.volume.resize(len, 0.0);
        self.stress.resize(len, Sym::default());
        self.viscosity.resize(len, 0.0);
    }

    /// Number of particles in all ranges.
    pub fn len(&self) -> usize {
        self.key.len()
    }

    /// No particles at all?
    pub fn is_empty(&self) -> bool {
        self.key.is_empty()
    }

    /// Appends owned particle `i` to a message.
    pub fn pack(&self, i: usize, message: &mut Vec<u64>) {
        let bits = |f: &f64| f.to_bits();
        message.extend([self.key[i], self.body[i]]);
        let Work { stress, viscous } = self.work[i];
        message
            .extend([self.mass[i], self.density[i], self.history[i].plastic_strain, stress, viscous].iter().map(bits));
        message.extend(self.x[i].0.iter().chain(&self.v[i].0).chain(&self.a[i].0).map(bits));
        message.extend(self.stress[i].0.iter().map(bits));
    }

    /// Takes in the particles of a message as owned ones; there must be no other ranges.
    pub fn unpack(&mut self, message: &[u64]) {
        debug_assert_eq!(self.owned, self.len());
        for words in message.chunks_exact(packed_len(D, N)) {
            let real = |k: usize| f64::from_bits(words[k]);
            let vector = |k: usize| Vector(std::array::from_fn(|a| real(k + a)));
            self.key.push(words[0]);
            self.body.push(words[1]);
            self.mass.push(real(2));
            self.density.push(real(3));
            self.history.push(History { plastic_strain: real(4) });
            self.work.push(Work { stress: real(5), viscous: real(6) });
            self.x.push(vector(7));
            self.v.push(vector(7 + D));
            self.a.push(vector(7 + 2 * D));
            self.stress.push(Sym(std::array::from_fn(|a| real(7 + 3 * D + a))));
            self.volume.push(0.0);
            self.viscosity.push(0.0);
        }
        self.own(self.key.len());
    }

    /// Keeps the owned particles `order[0], order[1], ..` in that order and forgets all others.
    pub fn arrange(&mut self, order: &[u32]) {
        fn pick<T: Copy>(field: &mut Vec<T>, order: &[u32]) {
            *field = order.iter().map(|&i| field[i as usize]).collect();
        }
        pick(&mut self.key, order);
        pick(&mut self.x, order);
        pick(&mut self.v, order);
        pick(&mut self.volume, order);
        pick(&mut self.stress, order);
        pick(&mut self.viscosity, order);
        pick(&mut self.a, order);
        pick(&mut self.mass, order);
        pick(&mut self.density, order);
        pick(&mut self.history, order);
        pick(&mut self.work, order);
        pick(&mut self.body, order);
        self.own(order.len());
    }
}
