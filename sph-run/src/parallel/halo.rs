//! Copies of other ranks' particles within reach of this rank's, and of its own across periodic borders: planned when
//! neighbour lists are built, refreshed twice a step, and by
//! what stabilisers spread.

use crate::algebra::Vector;
use crate::boundary::field::{Field, Spread, Words};
use crate::neighbors::bounds;
use crate::parallel::exchange::{exchange, payloads};
use crate::parallel::processor::waiting;
use crate::particles::Particles;
use formats::h5::Communicator;
use mpi::traits::{Communicator as _, *};

/// Who gets copies of which owned particles, and where the copies of others go.
#[derive(Debug, Default)]
pub struct Halo<const D: usize> {
    peers: Vec<usize>,
    /// Copies to send to each peer.
    send: Vec<Vec<Copied>>,
    /// What copies differ by from their originals; the first is nothing.
    shifts: Vec<Vector<D>>,
    /// Number of particles from each peer.
    receive: Vec<usize>,
    /// Words a particle has in the messages at hand.
    words: usize,
    outgoing: Vec<u64>,
    incoming: Vec<u64>,
}

/// A copy of an owned particle.
#[derive(Clone, Copy, Debug)]
pub struct Copied {
    source: u32,
    /// Which of the shifts it is moved by.
    shift: u32,
}

/// What is filled around the owned particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fields {
    /// Positions, velocities, volumes.
    Motion,
    /// Stresses, volumes.
    Stress,
}

impl Fields {
    /// Calls `visit` with each field, always in the same order: what copies and images get of a particle.
    pub fn visit<const D: usize, const N: usize>(
        self,
        p: &mut Particles<D, N>,
        mut visit: impl FnMut(Field<'_, D, N>),
    ) {
        visit(Field::Scalar(&mut p.volume));
        match self {
            Self::Motion => {
                visit(Field::Place(&mut p.x));
                visit(Field::Velocity(&mut p.v));
            }
            Self::Stress => visit(Field::Stress(&mut p.stress)),
        }
    }
}

impl<const D: usize> Halo<D> {
    /// Finds which of the particles at `x` each rank needs, and this one, shifted by one of `shifts`: those within
    /// `reach(x)` of the box around its own. `shifts` starts with 0 and holds with every shift its opposite; `reach` is the
    /// same for a particle and its shifted copies, `widest` its largest value. Collective.
    pub fn plan(
        comm: &Communicator,
        x: &[Vector<D>],
        shifts: Vec<Vector<D>>,
        reach: impl Fn(Vector<D>) -> f64,
        widest: f64,
    ) -> Self {
        let boxes = gather_boxes(comm, x);
        let me = comm.rank() as usize;
        let mut halo = Self { shifts, ..Self::default() };
        if boxes[me].is_none() {
            return halo;
        }
        let by_reach: Vec<f64> = x.iter().map(|&x| reach(x)).collect();
        for (rank, copies) in copies_for(me, &boxes, x, &by_reach, &halo.shifts, widest) {
            halo.peers.push(rank);
            halo.send.push(copies);
        }
        halo
    }

    /// Is there anyone to exchange with?
    pub fn has_peers(&self) -> bool {
        !self.peers.is_empty()
    }

    /// Calls `visit` with each particle that someone needs, once for each copy.
    pub fn needed(&self, mut visit: impl FnMut(usize)) {
        self.send.iter().flatten().for_each(|copied| visit(copied.source as usize));
    }

    /// Says that particle `order[k]` is now particle k.
    pub fn renumber(&mut self, order: &[u32]) {
        let mut now = vec![0; order.len()];
        for (k, &before) in order.iter().enumerate() {
            now[before as usize] = k as u32;
        }
        for copied in self.send.iter_mut().flatten() {
            copied.source = now[copied.source as usize];
        }
    }

    /// Tells the others the keys of their copies, and appends those of this rank's to `particles`. Collective.
    pub fn create<const N: usize>(&mut self, comm: &Communicator, particles: &mut Particles<D, N>) {
        debug_assert_eq!(particles.owned, particles.len());
        let key = |copied: &Copied| particles.key[copied.source as usize];
        let keys: Vec<Vec<u64>> = self.send.iter().map(|list| list.iter().map(key).collect()).collect();
        let incoming = exchange(comm, &self.peers, &keys);
        self.receive = incoming.iter().map(Vec::len).collect();
        particles.key.extend(incoming.iter().flatten());
        particles.halo = particles.key.len();
        particles.mirror = particles.halo;
        particles.resize(particles.halo);
    }

    /// Refreshes the copies.
    pub fn fill<const N: usize>(&mut self, comm: &Communicator, p: &mut Particles<D, N>, fields: Fields) {
        self.pack_all(p, fields);
        self.send(comm, || {});
        self.unpack_all(p, fields);
    }

    /// Writes the messages that refresh the copies.
    pub fn pack_all<const N: usize>(&mut self, p: &mut Particles<D, N>, fields: Fields) {
        // A message has all of one field, then all of the next.
        let mut words = 0;
        fields.visit(p, |field| words += count(&field));
        self.make_room(words);
        let mut before = 0;
        fields.visit(p, |field| {
            let here = before;
            before += count(&field);
            match field {
                Field::Scalar(field) => self.pack(words, here, field, |scalar, _| scalar),
                Field::Place(field) => self.pack(words, here, field, |x, shift| x + shift),
                Field::Velocity(field) => self.pack(words, here, field, |v, _| v),
                Field::Stress(field) => self.pack(words, here, field, |stress, _| stress),
            }
        });
    }

    /// Reads them.
    pub fn unpack_all<const N: usize>(&self, p: &mut Particles<D, N>, fields: Fields) {
        let words = self.words;
        let copies = p.owned..p.halo;
        let mut before = 0;
        fields.visit(p, |field| {
            let here = before;
            before += count(&field);
            match field {
                Field::Scalar(field) => self.unpack(words, here, &mut field[copies.clone()]),
                Field::Place(field) | Field::Velocity(field) => {
                    self.unpack(words, here, &mut field[copies.clone()]);
                }
                Field::Stress(field) => self.unpack(words, here, &mut field[copies.clone()]),
            }
        });
    }

    /// Gives a field that only owned particles have to the copies of them.
    pub fn spread<const N: usize, T: Spread<D, N>>(
        &mut self,
        comm: &Communicator,
        p: &Particles<D, N>,
        field: &mut Vec<T>,
    ) {
        self.make_room(T::COUNT);
        self.pack(T::COUNT, 0, field, |value, _| value);
        self.send(comm, || {});
        field.resize(p.halo, T::zero());
        self.unpack(T::COUNT, 0, &mut field[p.owned..]);
    }

    /// Room for messages of `words` a particle.
    fn make_room(&mut self, words: usize) {
        self.words = words;
        self.outgoing.resize(self.send.iter().map(Vec::len).sum::<usize>() * words, 0);
        self.incoming.resize(self.receive.iter().sum::<usize>() * words, 0);
    }

    /// Sends what was packed and receives as much, and does something else `meanwhile`. Collective among the peers.
    pub fn send(&mut self, comm: &Communicator, meanwhile: impl FnOnce()) {
        let words = self.words;
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
        payloads(comm, &self.peers, &outgoing, incoming, meanwhile);
    }

    /// Writes a field into all messages, behind `before` of the `words` that a particle has there.
    fn pack<T: Words>(&mut self, words: usize, before: usize, field: &[T], copy: impl Fn(T, Vector<D>) -> T) {
        let mut start = 0;
        for list in &self.send {
            let part = &mut self.outgoing[start + before * list.len()..][..T::COUNT * list.len()];
            for (to, copied) in part.chunks_exact_mut(T::COUNT).zip(list) {
                copy(field[copied.source as usize], self.shifts[copied.shift as usize]).put(to);
            }
            start += words * list.len();
        }
    }

    /// The inverse.
    fn unpack<T: Words>(&self, words: usize, before: usize, copies: &mut [T]) {
        let (mut start, mut rest) = (0, copies);
        for &count in &self.receive {
            let (copies, others) = rest.split_at_mut(count);
            let part = &self.incoming[start + before * count..][..T::COUNT * count];
            for (copy, from) in copies.iter_mut().zip(part.chunks_exact(T::COUNT)) {
                *copy = T::get(from);
            }
            (start, rest) = (start + words * count, others);
        }
    }
}

/// The peers of rank `me`, ascending, and what each gets of its particles `x`: those within `by_reach` of the box around
/// the peer's own. `boxes`: of all ranks; the others as for [`Halo::plan`].
pub fn copies_for<'a, const D: usize>(
    me: usize,
    boxes: &'a [Option<Box<D>>],
    x: &'a [Vector<D>],
    by_reach: &'a [f64],
    shifts: &'a [Vector<D>],
    widest: f64,
) -> impl Iterator<Item = (usize, Vec<Copied>)> + 'a {
    boxes.iter().enumerate().filter_map(move |(rank, bounds)| {
        let (mine, theirs) = (boxes[me]?, (*bounds)?);
        // Asked both ways round, so that two ranks agree on being peers to the last bit.
        let (to, from) =
            (|&s: &Vector<D>| gap2(&shifted(&mine, s), &theirs), |&s: &Vector<D>| gap2(&shifted(&theirs, s), &mine));
        let others = usize::from(rank == me);
        if !shifts[others..].iter().any(|s| to(s).min(from(s)) < widest * widest) {
            return None;
        }
        let mut copies = Vec::new();
        for (number, &shift) in shifts.iter().enumerate().skip(others) {
            let near = |&i: &u32| {
                let (x, reach) = (x[i as usize] + shift, by_reach[i as usize]);
                gap2(&(x, x), &theirs) < reach * reach
            };
            let near = (0..x.len() as u32).filter(near);
            copies.extend(near.map(|source| Copied { source, shift: number as u32 }));
        }
        Some((rank, copies))
    })
}

/// Words a particle has of a field.
fn count<const D: usize, const N: usize>(field: &Field<'_, D, N>) -> usize {
    match field {
        Field::Scalar(_) => 1,
        Field::Place(_) | Field::Velocity(_) => D,
        Field::Stress(_) => N,
    }
}

/// Lower and upper corner.
pub type Box<const D: usize> = (Vector<D>, Vector<D>);

/// The box around every rank's owned particles; none for a rank without particles.
fn gather_boxes<const D: usize>(comm: &Communicator, x: &[Vector<D>]) -> Vec<Option<Box<D>>> {
    let (low, high) = bounds(x);
    let mut mine = vec![if x.is_empty() { 0.0 } else { 1.0 }];
    mine.extend(low.0.iter().chain(&high.0));
    let mut all = vec![0.0; mine.len() * comm.size() as usize];
    waiting(|| comm.all_gather_into(&mine[..], &mut all[..]));
    let corner = |part: &[f64]| Vector(std::array::from_fn(|a| part[a]));
    all.chunks_exact(1 + 2 * D).map(|b| (b[0] > 0.0).then(|| (corner(&b[1..]), corner(&b[1 + D..])))).collect()
}

fn shifted<const D: usize>(a: &Box<D>, shift: Vector<D>) -> Box<D> {
    (a.0 + shift, a.1 + shift)
}

/// Squared distance between two boxes.
fn gap2<const D: usize>(a: &Box<D>, b: &Box<D>) -> f64 {
    (0..D).map(|k| (b.0.0[k] - a.1.0[k]).max(a.0.0[k] - b.1.0[k]).max(0.0).powi(2)).sum()
}
