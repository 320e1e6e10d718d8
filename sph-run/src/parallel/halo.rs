//! Copies of other ranks' particles within reach of this rank's: planned when neighbour lists are built, refreshed
//! twice a step.

use crate::algebra::Vector;
use crate::boundary::field::Field;
use crate::neighbors::bounds;
use crate::parallel::exchange::{exchange, payloads};
use crate::particles::Particles;
use formats::h5::Communicator;
use mpi::traits::{Communicator as _, *};

/// Who gets copies of which owned particles, and where the copies of others go.
#[derive(Debug, Default)]
pub struct Halo {
    peers: Vec<usize>,
    /// Owned particles to send to each peer.
    send: Vec<Vec<u32>>,
    /// Number of particles from each peer.
    receive: Vec<usize>,
    outgoing: Vec<u64>,
    incoming: Vec<u64>,
}

/// What is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fields {
    /// Positions, velocities, volumes.
    Motion,
    /// Stresses, volumes.
    Stress,
}

impl Fields {
    fn words(self, d: usize, n: usize) -> usize {
        match self {
            Self::Motion => 2 * d + 1,
            Self::Stress => n + 1,
        }
    }
}

impl Halo {
    /// Finds the particles each rank needs of the others: those within `reach(x)` of the box around its own.
    /// `widest` is the largest value `reach` takes. Appends the halo's keys to `particles`.
    pub fn plan<const D: usize, const N: usize>(
        comm: &Communicator,
        particles: &mut Particles<D, N>,
        reach: impl Fn(Vector<D>) -> f64,
        widest: f64,
    ) -> Self {
        debug_assert_eq!(particles.owned, particles.len());
        let boxes = gather_boxes(comm, &particles.x);
        let me = comm.rank() as usize;
        let mut halo = Self::default();
        let Some(mine) = boxes[me] else {
            return halo.finish(particles, &[]);
        };
        for (rank, bounds) in boxes.iter().enumerate() {
            let Some(theirs) = bounds.filter(|b| rank != me && gap2(&mine, b) < widest * widest) else { continue };
            let near = |&i: &u32| {
                let x = particles.x[i as usize];
                let reach = reach(x);
                gap2(&(x, x), &theirs) < reach * reach
            };
            halo.peers.push(rank);
            halo.send.push((0..particles.owned as u32).filter(near).collect());
        }
        let keys: Vec<Vec<u64>> =
            halo.send.iter().map(|list| list.iter().map(|&i| particles.key[i as usize]).collect()).collect();
        let incoming = exchange(comm, &halo.peers, &keys);
        halo.finish(particles, &incoming)
    }

    fn finish<const D: usize, const N: usize>(mut self, particles: &mut Particles<D, N>, keys: &[Vec<u64>]) -> Self {
        self.receive = keys.iter().map(Vec::len).collect();
        particles.key.extend(keys.iter().flatten());
        particles.halo = particles.key.len();
        particles.mirror = particles.halo;
        particles.resize(particles.halo);
        self
    }

    /// Refreshes the copies.
    pub fn fill<const D: usize, const N: usize>(
        &mut self,
        comm: &Communicator,
        p: &mut Particles<D, N>,
        fields: Fields,
    ) {
        let (owned, words) = (p.owned, fields.words(D, N));
        self.pack(|i, message| {
            message.push(p.volume[i].to_bits());
            match fields {
                Fields::Motion => message.extend(p.x[i].0.iter().chain(&p.v[i].0).map(|f| f.to_bits())),
                Fields::Stress => message.extend(p.stress[i].0.iter().map(|f| f.to_bits())),
            }
        });
        self.send(comm, words);
        for (i, copy) in (owned..).zip(self.incoming.chunks_exact(words)) {
            let real = |k: usize| f64::from_bits(copy[k]);
            p.volume[i] = real(0);
            match fields {
                Fields::Motion => {
                    p.x[i] = Vector(std::array::from_fn(|a| real(1 + a)));
                    p.v[i] = Vector(std::array::from_fn(|a| real(1 + D + a)));
                }
                Fields::Stress => p.stress[i].0 = std::array::from_fn(|a| real(1 + a)),
            }
        }
    }

    /// Gives a field of the owned particles to the copies on other ranks.
    pub fn spread<const D: usize, const N: usize, T: Field<D, N>>(
        &mut self,
        comm: &Communicator,
        owned: usize,
        field: &mut Vec<T>,
    ) {
        field.truncate(owned);
        self.pack(|i, message| field[i].pack(message));
        self.send(comm, T::WORDS);
        field.extend(self.incoming.chunks_exact(T::WORDS).map(T::unpack));
    }

    /// Packs what the peers get of the owned particles.
    fn pack(&mut self, pack: impl Fn(usize, &mut Vec<u64>)) {
        self.outgoing.clear();
        for &i in self.send.iter().flatten() {
            pack(i as usize, &mut self.outgoing);
        }
    }

    /// Exchanges what was packed, `words` a particle.
    fn send(&mut self, comm: &Communicator, words: usize) {
        self.incoming.resize(self.receive.iter().sum::<usize>() * words, 0);
        let mut outgoing: Vec<&[u64]> = Vec::with_capacity(self.peers.len());
        let mut rest: &[u64] = &self.outgoing;
        for list in &self.send {
            let (part, tail) = rest.split_at(list.len() * words);
            outgoing.push(part);
            rest = tail;
        }
        let mut incoming: Vec<&mut [u64]> = Vec::with_capacity(self.peers.len());
        let mut rest: &mut [u64] = &mut self.incoming;
        for count in &self.receive {
            let (part, tail) = rest.split_at_mut(count * words);
            incoming.push(part);
            rest = tail;
        }
        payloads(comm, &self.peers, &outgoing, incoming);
    }
}

type Box<const D: usize> = (Vector<D>, Vector<D>);

/// The box around every rank's owned particles; none for a rank without particles.
fn gather_boxes<const D: usize>(comm: &Communicator, x: &[Vector<D>]) -> Vec<Option<Box<D>>> {
    let (low, high) = bounds(x);
    let mut mine = vec![if x.is_empty() { 0.0 } else { 1.0 }];
    mine.extend(low.0.iter().chain(&high.0));
    let mut all = vec![0.0; mine.len() * comm.size() as usize];
    comm.all_gather_into(&mine[..], &mut all[..]);
    let corner = |part: &[f64]| Vector(std::array::from_fn(|a| part[a]));
    all.chunks_exact(1 + 2 * D).map(|b| (b[0] > 0.0).then(|| (corner(&b[1..]), corner(&b[1 + D..])))).collect()
}

/// Squared distance between two boxes.
fn gap2<const D: usize>(a: &Box<D>, b: &Box<D>) -> f64 {
    (0..D).map(|k| (b.0.0[k] - a.1.0[k]).max(a.0.0[k] - b.1.0[k]).max(0.0).powi(2)).sum()
}
