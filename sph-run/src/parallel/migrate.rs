//! Particles that left their rank's box go home by diffusion: from neighbour to neighbour, never by a global exchange.

use crate::parallel::comm::Reduce;
use crate::parallel::exchange::exchange;
use crate::parallel::orb::Tree;
use crate::parallel::route::next_hop;
use crate::particles::Particles;
use crate::space::Space;
use formats::h5::Communicator;

/// What a migration took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moved {
    /// Rounds of exchanges with neighbours.
    pub rounds: usize,
    /// Particles this rank sent on, over all rounds.
    pub sent: usize,
}

/// Moves every owned particle to the rank in whose leaf it lies. Halo, images and walls are forgotten.
pub fn owners<const D: usize, const N: usize, S: Space<D, N>>(
    comm: &Communicator,
    tree: &Tree,
    particles: &mut Particles<D, N>,
) -> Moved {
    particles.own(particles.owned);
    let me = comm.rank();
    let peers = tree.neighbours(me);
    let mut peer_of_rank = vec![usize::MAX; comm.size()];
    for (k, &peer) in peers.iter().enumerate() {
        peer_of_rank[peer] = k;
    }
    let mut hops = None;
    let mut moved = Moved::default();
    loop {
        let mut outgoing = vec![Vec::new(); peers.len()];
        let mut stay: Vec<u32> = Vec::with_capacity(particles.owned);
        for i in 0..particles.owned {
            let owner = tree.owner(S::to_disk(particles.x[i]));
            if owner == me {
                stay.push(i as u32);
            } else {
                let hops: &Vec<u32> = hops.get_or_insert_with(|| next_hop(tree, me));
                particles.pack(i, &mut outgoing[peer_of_rank[hops[owner] as usize]]);
            }
        }
        let strays = particles.owned - stay.len();
        let mut anywhere = [strays as u64];
        comm.sum(&mut anywhere);
        if anywhere[0] == 0 {
            return moved;
        }
        moved.rounds += 1;
        moved.sent += strays;
        if strays > 0 {
            particles.arrange(&stay);
        }
        for message in exchange(comm, &peers, &outgoing) {
            particles.unpack(&message);
        }
    }
}
