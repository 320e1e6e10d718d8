//! Yang et al.'s stress case of the migration (2020, section 3.2): particles of a prism of 0.2 x 0.05 x 0.1 m on a cubic
//! lattice lie on the ranks in slices, one after the other, and go to the boxes of the bisection: from neighbour to
//! neighbour as in a run, and by one exchange among all ranks, which a run never makes.

use super::partition::AllOnOne;
use crate::algebra::Vector;
use crate::parallel::agree::agree;
use crate::parallel::route::next_hop_among;
use crate::parallel::{Reduce, Tree, migrate};
use crate::particles::{Particles, key, packed_len};
use crate::space::ThreeD;
use formats::exit;
use formats::h5::Communicator;
use formats::snapshot::share;
use mpi::datatype::{Partition, PartitionMut};
use mpi::traits::*;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Instant;

/// Bytes of a particle on its way.
const PARTICLE: u64 = 8 * packed_len(3, 6) as u64;

/// The prism with about `count` particles: the particles numbered so, x slowest.
fn prism(count: u64) -> (u64, impl Fn(u64) -> [f64; 3]) {
    let side = [0.2, 0.05, 0.1];
    let spacing = (side.iter().product::<f64>() / count as f64).cbrt();
    let cells = side.map(|length: f64| (length / spacing).round().max(1.0) as u64);
    let place = move |n: u64| {
        let cell = [n / (cells[1] * cells[2]), n / cells[2] % cells[1], n % cells[2]];
        [0, 1, 2].map(|a| (cell[a] as f64 + 0.5) * side[a] / cells[a] as f64)
    };
    (cells.iter().product(), place)
}

/// What sending particles home takes, over all ranks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Taken {
    /// Rounds of exchanges with neighbours.
    pub rounds: u64,
    /// Particles that are not on their own rank at first.
    pub strays: u64,
    /// Particles sent, those sent on included.
    pub sent: u64,
    /// Of the busiest rank, by rounds.
    pub busiest: Vec<u64>,
    /// Most particles a rank has at a time.
    pub held: u64,
    /// Messages: a count to each neighbour every round, and what there is to send.
    pub messages: u64,
}

/// Counts for any number of ranks, by the tables by which particles are sent on. `held[a]`: the owners of what rank a has,
/// and how many particles of each.
pub fn virtually(tree: &Tree, mut held: Vec<BTreeMap<usize, u64>>) -> Taken {
    let adjacency = tree.adjacency();
    let tables: Vec<Vec<u32>> =
        (0..tree.size()).map(|me| next_hop_among(tree.size(), me, |rank| adjacency[rank].iter().copied())).collect();
    let strays = |held: &[BTreeMap<usize, u64>]| -> u64 {
        let away = |(me, owners): (usize, &BTreeMap<usize, u64>)| -> u64 {
            owners.iter().filter(|&(&owner, _)| owner != me).map(|(_, count)| count).sum()
        };
        held.iter().enumerate().map(away).sum()
    };
    let most = |held: &[BTreeMap<usize, u64>]| held.iter().map(|owners| owners.values().sum()).max().unwrap_or(0);
    let mut taken = Taken { strays: strays(&held), held: most(&held), ..Taken::default() };
    let neighbours: u64 = adjacency.iter().map(|list| list.len() as u64).sum();
    while strays(&held) > 0 {
        let mut arrived = vec![BTreeMap::new(); held.len()];
        let mut busiest = 0;
        for (me, owners) in held.iter().enumerate() {
            let (mut sent, mut to) = (0, Vec::new());
            for (&owner, &count) in owners {
                let next = tables[me][owner] as usize;
                if next != me {
                    sent += count;
                    to.push(next);
                }
                *arrived[next].entry(owner).or_insert(0) += count;
            }
            to.sort_unstable();
            to.dedup();
            taken.messages += to.len() as u64;
            taken.sent += sent;
            busiest = busiest.max(sent);
        }
        held = arrived;
        taken.rounds += 1;
        taken.messages += neighbours;
        taken.busiest.push(busiest);
        taken.held = taken.held.max(most(&held));
    }
    taken
}

/// The stress case with about `count` particles on so many ranks, counted; the number of particles with it.
pub fn counted(count: u64, ranks: usize) -> (u64, Taken) {
    let (count, place) = prism(count);
    let tree = Tree::build((0..count).map(&place), None, &[0, 1, 2], &AllOnOne(ranks));
    let mut held = vec![BTreeMap::new(); ranks];
    for (rank, held) in held.iter_mut().enumerate() {
        for n in share(count, rank as u64, ranks as u64) {
            *held.entry(tree.owner(place(n))).or_insert(0) += 1;
        }
    }
    (count, virtually(&tree, held))
}

/// [`counted`] as JSON.
pub fn counted_json(count: u64, ranks: usize) -> Value {
    let (count, taken) = counted(count, ranks);
    json!({
        "ranks": ranks,
        "particles": count,
        "rounds": taken.rounds,
        "strays": taken.strays,
        "sent": taken.sent,
        "bytes": PARTICLE * taken.sent,
        "bytes-busiest": PARTICLE * taken.busiest.iter().sum::<u64>(),
        "messages": taken.messages,
        "held-most": taken.held,
        "all-bytes": PARTICLE * taken.strays,
        "all-messages": ranks * (ranks - 1),
    })
}

/// Runs the stress case on the ranks there are, both ways, and prints what it took. Collective. The exit code.
pub fn report(comm: &Communicator, count: u64) -> i32 {
    let measured = really(comm, count);
    let printed = agree(comm, || {
        println!("{measured}");
        Ok(())
    });
    printed.map_or_else(|error| error.exit_code(), |_| exit::DONE)
}

/// The stress case on the ranks there are. Collective.
///
/// # Panics
/// Where the two ways do not lead to the same particles on every rank.
pub fn really(comm: &Communicator, count: u64) -> Value {
    let (me, size) = (Reduce::rank(comm) as u64, Reduce::size(comm) as u64);
    let (count, place) = prism(count);
    let slice = share(count, me, size);
    let tree = Tree::build(slice.clone().map(&place), None, &[0, 1, 2], comm);

    let mut mine = made(slice.clone(), &place);
    comm.barrier();
    let begun = Instant::now();
    let moved = migrate::owners::<3, 6, ThreeD>(comm, &tree, &mut mine);
    let mut times = [begun.elapsed().as_secs_f64(), 0.0];

    let all = made(slice, &place);
    comm.barrier();
    let begun = Instant::now();
    let (others, strays) = at_once(comm, &tree, &all);
    times[1] = begun.elapsed().as_secs_f64();
    comm.max(&mut times);

    let sorted = |p: &Particles<3, 6>| {
        let mut keys = p.key[..p.owned].to_vec();
        keys.sort_unstable();
        keys
    };
    assert_eq!(sorted(&mine), sorted(&others), "rank {me}: both ways lead to the same particles");
    let at_home = mine.x.iter().all(|x| tree.owner(x.0) == me as usize);
    let mut sums = [mine.owned as u64, moved.sent as u64, strays, u64::from(!at_home)];
    comm.sum(&mut sums);
    let [owned, sent, strays, astray] = sums;
    assert!(owned == count && astray == 0, "{owned} of {count} particles arrived");
    let mut busiest = [moved.sent as f64];
    comm.max(&mut busiest);
    json!({
        "ranks": size,
        "particles": count,
        "rounds": moved.rounds,
        "strays": strays,
        "sent": sent,
        "bytes": PARTICLE * sent,
        "bytes-busiest": PARTICLE * busiest[0] as u64,
        "seconds": times[0],
        "all-bytes": PARTICLE * strays,
        "all-messages": size * (size - 1),
        "all-seconds": times[1],
    })
}

/// Particles with these numbers.
fn made(numbers: Range<u64>, place: &impl Fn(u64) -> [f64; 3]) -> Particles<3, 6> {
    let count = (numbers.end - numbers.start) as usize;
    let mut p = Particles {
        key: numbers.clone().map(|n| key(n, 0)).collect(),
        x: numbers.map(|n| Vector(place(n))).collect(),
        a: vec![Vector::default(); count],
        mass: vec![1.0; count],
        density: vec![1.0; count],
        history: vec![Default::default(); count],
        work: vec![Default::default(); count],
        body: vec![0; count],
        ..Particles::default()
    };
    p.own(count);
    p
}

/// By one exchange among all ranks: this rank's particles, and how many it sent to others.
fn at_once(comm: &Communicator, tree: &Tree, p: &Particles<3, 6>) -> (Particles<3, 6>, u64) {
    let size = Reduce::size(comm);
    let mut outgoing = vec![Vec::new(); size];
    for i in 0..p.owned {
        p.pack(i, &mut outgoing[tree.owner(p.x[i].0)]);
    }
    let strays: usize =
        outgoing.iter().enumerate().filter(|&(rank, _)| rank != Reduce::rank(comm)).map(|(_, words)| words.len()).sum();
    let lengths: Vec<i32> = outgoing.iter().map(|words| words.len() as i32).collect();
    let outgoing = outgoing.concat();
    let mut incoming_lengths = vec![0i32; size];
    comm.all_to_all_into(&lengths[..], &mut incoming_lengths[..]);
    let mut incoming = vec![0u64; incoming_lengths.iter().map(|&n| n as usize).sum()];
    comm.all_to_all_varcount_into(
        &Partition::new(&outgoing[..], &lengths[..], starts(&lengths)),
        &mut PartitionMut::new(&mut incoming[..], &incoming_lengths[..], starts(&incoming_lengths)),
    );
    let mut arrived = Particles::default();
    arrived.unpack(&incoming);
    (arrived, (strays / packed_len(3, 6)) as u64)
}

fn starts(lengths: &[i32]) -> Vec<i32> {
    let before = |sum: &mut i32, &length: &i32| {
        let start = *sum;
        *sum += length;
        Some(start)
    };
    lengths.iter().scan(0, before).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::route::eccentricity;

    #[test]
    fn slices_reach_their_boxes_in_few_rounds() {
        let (count, taken) = counted(8192, 64);
        assert!(count.abs_diff(8192) < 1000 && taken.strays > count / 2, "{taken:?}");
        assert!(taken.sent >= taken.strays && taken.sent <= taken.rounds * taken.strays, "{taken:?}");
        let (count, place) = prism(8192);
        let tree = Tree::build((0..count).map(&place), None, &[0, 1, 2], &AllOnOne(64));
        let diameter = (0..64).map(|me| eccentricity(&tree, me)).max().unwrap();
        assert!(taken.rounds > 1 && taken.rounds <= diameter as u64, "{taken:?} {diameter}");
    }

    #[test]
    fn nothing_moves_that_is_at_home() {
        let (count, place) = prism(1000);
        let tree = Tree::build((0..count).map(&place), None, &[0, 1, 2], &AllOnOne(7));
        let held = (0..7).map(|rank| BTreeMap::from([(rank, 10)])).collect();
        assert_eq!(virtually(&tree, held), Taken { held: 10, ..Taken::default() });
        let mut held = vec![BTreeMap::new(); 7];
        let neighbour = tree.neighbours(0)[0];
        held[0].insert(neighbour, 5);
        let taken = virtually(&tree, held);
        assert_eq!((taken.rounds, taken.strays, taken.sent, taken.busiest), (1, 5, 5, vec![5]));
    }
}
