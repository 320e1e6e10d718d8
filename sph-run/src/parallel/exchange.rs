//! Messages between neighbouring ranks: counts first, then payloads, none of them blocking.

use super::processor::waiting;
use formats::h5::Communicator;
use mpi::request::{self, Request, Scope};
use mpi::traits::{Communicator as _, *};

/// Sends `outgoing[k]` to rank `peers[k]` and returns what each of them sent. Every peer must name this rank too.
pub fn exchange(comm: &Communicator, peers: &[usize], outgoing: &[Vec<u64>]) -> Vec<Vec<u64>> {
    let counts: Vec<u64> = outgoing.iter().map(|m| m.len() as u64).collect();
    let mut incoming_counts = vec![0u64; peers.len()];
    request::scope(|scope| {
        let mut requests = Vec::with_capacity(2 * peers.len());
        for (&peer, count) in peers.iter().zip(incoming_counts.iter_mut()) {
            requests.push(comm.process_at_rank(peer as i32).immediate_receive_into(scope, count));
        }
        let sends: Vec<_> = peers
            .iter()
            .zip(&counts)
            .map(|(&p, count)| comm.process_at_rank(p as i32).immediate_send(scope, count))
            .collect();
        waiting(|| {
            wait_all(requests);
            wait_all(sends);
        });
    });
    let mut incoming: Vec<Vec<u64>> = incoming_counts.iter().map(|&count| vec![0; count as usize]).collect();
    let (outgoing, incoming_parts): (Vec<&[u64]>, Vec<&mut [u64]>) =
        (outgoing.iter().map(Vec::as_slice).collect(), incoming.iter_mut().map(Vec::as_mut_slice).collect());
    payloads(comm, peers, &outgoing, incoming_parts, || {});
    incoming
}

/// Sends and receives messages whose lengths both sides know, and does something else `meanwhile`. Empty ones are not sent.
pub fn payloads(
    comm: &Communicator,
    peers: &[usize],
    outgoing: &[&[u64]],
    incoming: Vec<&mut [u64]>,
    meanwhile: impl FnOnce(),
) {
    request::scope(|scope| {
        let mut receives = Vec::with_capacity(peers.len());
        for (&peer, message) in peers.iter().zip(incoming).filter(|(_, m)| !m.is_empty()) {
            receives.push(comm.process_at_rank(peer as i32).immediate_receive_into(scope, message));
        }
        let mut sends = Vec::with_capacity(peers.len());
        for (&peer, message) in peers.iter().zip(outgoing).filter(|(_, m)| !m.is_empty()) {
            sends.push(comm.process_at_rank(peer as i32).immediate_send(scope, *message));
        }
        meanwhile();
        waiting(|| {
            wait_all(receives);
            wait_all(sends);
        });
    });
}

/// Lets the library look after messages under way: many move them on only inside a call.
pub fn look_after(comm: &Communicator) {
    if comm.size() > 1 {
        let _ = comm.any_process().immediate_probe();
    }
}

fn wait_all<'a, D: ?Sized, S: Scope<'a>>(requests: Vec<Request<'a, D, S>>) {
    for request in requests {
        request.wait_without_status();
    }
}
