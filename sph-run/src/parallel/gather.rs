//! Owned particles as rows of a file: rank r holds the r-th share of the ids, in ascending order. Rows of a file lie
//! in the order of the ids, so its bytes do not depend on the number of ranks. This is the one exchange among all
//! ranks, and it happens only when a file is written.

use crate::particles::{Particles, packed_len};
use crate::space::Space;
use formats::h5::Communicator;
use formats::snapshot::{Rows, share};
use mpi::datatype::{Partition, PartitionMut};
use mpi::traits::{Communicator as _, *};
use std::ops::Range;

/// Rows a rank gets at a time: with more, the copies under way would take more memory than the particles.
const PASS: u64 = 1 << 17;

/// The rows of this rank's share of all `count` particles. Collective.
pub fn rows<const D: usize, const N: usize, S: Space<D, N>>(
    comm: &Communicator,
    particles: &Particles<D, N>,
    count: u64,
) -> Rows {
    let (rank, size) = (comm.rank() as u64, comm.size() as u64);
    let mut order: Vec<u32> = (0..particles.owned as u32).collect();
    order.sort_unstable_by_key(|&i| particles.key[i as usize]);
    let mine = share(count, rank, size);
    let mut rows = Rows::with_room(mine.start, (mine.end - mine.start) as usize);
    for pass in 0..count.div_ceil(size).div_ceil(PASS) {
        let wanted = |rank: u64| {
            let Range { start, end } = share(count, rank, size);
            (start + pass * PASS).min(end)..(start + (pass + 1) * PASS).min(end)
        };
        rows.append(some_rows::<D, N, S>(comm, particles, &order, wanted));
    }
    rows
}

/// The rows of the ids `wanted(rank)` for every rank. `order`: the particles in ascending key. Collective.
fn some_rows<const D: usize, const N: usize, S: Space<D, N>>(
    comm: &Communicator,
    particles: &Particles<D, N>,
    order: &[u32],
    wanted: impl Fn(u64) -> Range<u64>,
) -> Rows {
    let id = |&i: &u32| crate::particles::id(particles.key[i as usize]);
    let mut outgoing = Vec::new();
    let mut lengths = Vec::new();
    for rank in 0..comm.size() as u64 {
        let Range { start, end } = wanted(rank);
        let from = order.partition_point(|i| id(i) < start);
        let to = order.partition_point(|i| id(i) < end);
        for &i in &order[from..to] {
            particles.pack(i as usize, &mut outgoing);
        }
        lengths.push(((to - from) * packed_len(D, N)) as i32);
    }
    let mut incoming_lengths = vec![0i32; lengths.len()];
    comm.all_to_all_into(&lengths[..], &mut incoming_lengths[..]);
    let mut incoming = vec![0u64; incoming_lengths.iter().map(|&n| n as usize).sum()];
    comm.all_to_all_varcount_into(
        &Partition::new(&outgoing[..], &lengths[..], starts(&lengths)),
        &mut PartitionMut::new(&mut incoming[..], &incoming_lengths[..], starts(&incoming_lengths)),
    );
    drop(outgoing);

    let mut mine = Particles::<D, N>::default();
    mine.unpack(&incoming);
    drop(incoming);
    let mut order: Vec<u32> = (0..mine.owned as u32).collect();
    order.sort_unstable_by_key(|&i| mine.key[i as usize]);
    mine.arrange(&order);
    mine.to_rows::<S>()
}

fn starts(lengths: &[i32]) -> Vec<i32> {
    lengths
        .iter()
        .scan(0, |next, &n| {
            let start = *next;
            *next += n;
            Some(start)
        })
        .collect()
}
