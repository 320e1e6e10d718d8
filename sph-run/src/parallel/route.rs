//! Ways through the graph of neighbouring ranks.

use super::Tree;
use std::collections::VecDeque;

/// For every rank the neighbour of `me` to send to, so that what is addressed there arrives by the fewest hops;
/// `me` for itself. Every rank sends on by its own table, and each hop brings a particle one closer: redistribution
/// needs as many rounds as the furthest way has hops, at most the diameter of the graph, and no global exchange.
pub fn next_hop(tree: &Tree, me: usize) -> Vec<u32> {
    next_hop_among(tree.size(), me, |rank| tree.neighbours(rank))
}

/// [`next_hop`] in any graph of so many ranks.
pub fn next_hop_among<I: IntoIterator<Item = usize>>(
    size: usize,
    me: usize,
    neighbours: impl Fn(usize) -> I,
) -> Vec<u32> {
    const UNKNOWN: u32 = u32::MAX;
    let mut hop = vec![UNKNOWN; size];
    hop[me] = me as u32;
    let mut open = VecDeque::from([me]);
    while let Some(rank) = open.pop_front() {
        for other in neighbours(rank) {
            if hop[other] == UNKNOWN {
                hop[other] = if rank == me { other as u32 } else { hop[rank] };
                open.push_back(other);
            }
        }
    }
    // The boxes cover space, so their graph is connected.
    debug_assert!(hop.iter().all(|&h| h != UNKNOWN));
    hop
}

/// Hops from `me` to the furthest rank.
pub fn eccentricity(tree: &Tree, me: usize) -> usize {
    let mut distance = vec![usize::MAX; tree.size()];
    distance[me] = 0;
    let mut open = VecDeque::from([me]);
    let mut furthest = 0;
    while let Some(rank) = open.pop_front() {
        furthest = distance[rank];
        for other in tree.neighbours(rank) {
            if distance[other] == usize::MAX {
                distance[other] = furthest + 1;
                open.push_back(other);
            }
        }
    }
    furthest
}
