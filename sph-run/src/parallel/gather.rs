//! Owned particles as rows of a file: rank r holds the r-th share of the ids, in ascending order. Rows of a file lie
//! in the order of the ids, so its bytes do not depend on the number of ranks. This is the one exchange among all
//! ranks, and it happens only when a file is written.

use crate::particles::{Particles, packed_len};
use crate::space::Space;
use formats::h5::Communicator;
use formats::snapshot::{Rows, share};
use mpi::datatype::{Partition, PartitionMut};
use mpi::traits::{Communicator as _, *};

/// The rows of this rank's share of all `count` particles.
pub fn rows<const D: usize, const N: usize, S: Space<D, N>>(
    comm: &Communicator,
    particles: &Particles<D, N>,
    count: u64,
) -> Rows {
    let size = comm.size() as u64;
    let mut order: Vec<u32> = (0..particles.owned as u32).collect();
    order.sort_unstable_by_key(|&i| particles.key[i as usize]);

    let mut outgoing = Vec::with_capacity(particles.owned * packed_len(D, N));
    let mut lengths = vec![0i32; size as usize];
    let mut rank = 0;
    for i in order {
        let id = crate::particles::id(particles.key[i as usize]);
        while !share(count, rank, size).contains(&id) {
            rank += 1;
        }
        particles.pack(i as usize, &mut outgoing);
        lengths[rank as usize] += packed_len(D, N) as i32;
    }
    let mut incoming_lengths = vec![0i32; size as usize];
    comm.all_to_all_into(&lengths[..], &mut incoming_lengths[..]);
    let mut incoming = vec![0u64; incoming_lengths.iter().map(|&n| n as usize).sum()];
    comm.all_to_all_varcount_into(
        &Partition::new(&outgoing[..], &lengths[..], starts(&lengths)),
        &mut PartitionMut::new(&mut incoming[..], &incoming_lengths[..], starts(&incoming_lengths)),
    );

    let mut mine = Particles::<D, N>::default();
    mine.unpack(&incoming);
    let mut order: Vec<u32> = (0..mine.owned as u32).collect();
    order.sort_unstable_by_key(|&i| mine.key[i as usize]);
    mine.arrange(&order);
    let mut rows = mine.to_rows::<S>();
    rows.first = share(count, comm.rank() as u64, size).start;
    rows
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
