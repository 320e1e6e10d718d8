//! Times of the exchanges of a step: `cargo bench -p sph-run --bench exchange`, which starts itself under mpirun, on 2 ranks or on
//! as many as the number after `--` says.
//!
//! Each rank exchanges with the ones before and after it, as with the peers of a halo: by messages that do not block, begun anew
//! each time, which is what runs do; by persistent requests, set up once; and by a collective among neighbours. Beside that the one
//! reduction of a step. Medians of rounds, the slowest rank's.

use formats::h5::Communicator;
use mpi::ffi;
use mpi::raw::AsRaw;
use sph_run::parallel::Reduce;
use sph_run::parallel::exchange::payloads;
use std::ffi::c_int;
use std::time::Instant;

/// Words of a message: 146 copies a peer, 2300, and 37 000, of 7 numbers.
const WORDS: [usize; 3] = [1 << 10, 1 << 14, 1 << 18];
const ROUNDS: usize = 25;
/// Numbers in the reduction.
const PLAN: usize = 6;
const MARK: &str = "TALUS_BENCH_UNDER_MPI";

fn main() {
    if std::env::var_os(MARK).is_none() {
        let ranks = std::env::args().skip(1).find(|word| word.parse::<u32>().is_ok()).unwrap_or_else(|| "2".into());
        let mut mpirun = std::process::Command::new("mpirun");
        mpirun.args(["-n", &ranks]).arg(std::env::current_exe().expect("a path")).env(MARK, "1");
        let status = mpirun.status().expect("mpirun starts");
        std::process::exit(status.code().unwrap_or(1));
    }
    let universe = mpi::initialize().expect("MPI starts");
    let comm = universe.world();
    let (me, size) = (Reduce::rank(&comm), Reduce::size(&comm));
    let mut peers = vec![(me + size - 1) % size, (me + 1) % size];
    peers.sort_unstable();
    peers.dedup();
    peers.retain(|&peer| peer != me);
    let say = |text: String| {
        if me == 0 {
            println!("{text}");
        }
    };
    say(format!("{size} ranks, {} peers; microseconds an exchange", peers.len()));
    say(format!("{:>12} {:>12} {:>12} {:>12}", "bytes a peer", "messages", "persistent", "collective"));
    for words in WORDS {
        let outgoing = vec![me as u64; words * peers.len()];
        let mut incoming = vec![0_u64; words * peers.len()];
        let parts: Vec<&[u64]> = outgoing.chunks(words).collect();
        let messages = measure(&comm, || {
            payloads(&comm, &peers, &parts, incoming.chunks_mut(words).collect(), || {});
        });
        let mut requests = Requests::new(&comm, &peers, words, &outgoing, &mut incoming);
        let persistent = measure(&comm, || requests.exchange());
        drop(requests);
        let graph = Graph::new(&comm, &peers);
        let collective = measure(&comm, || graph.exchange(words, &outgoing, &mut incoming));
        drop(graph);
        assert!(incoming.chunks(words).zip(&peers).all(|(part, &peer)| part.iter().all(|&word| word == peer as u64)));
        say(format!("{:>12} {messages:>12.1} {persistent:>12.1} {collective:>12.1}", 8 * words));
    }
    let mut plan = [1.0; PLAN];
    let reduction = measure(&comm, || comm.max(&mut plan));
    say(format!("reduction of {PLAN} numbers: {reduction:.1}"));
}

/// Microseconds that `work` takes on the slowest rank: the median of rounds of some milliseconds.
fn measure(comm: &Communicator, mut work: impl FnMut()) -> f64 {
    let mut rounds = |count: usize| {
        let begun = Instant::now();
        (0..count).for_each(|_| work());
        let mut taken = [begun.elapsed().as_secs_f64() / count as f64];
        comm.max(&mut taken);
        1e6 * taken[0]
    };
    let count = (5e3 / rounds(20)).clamp(5.0, 5e4) as usize;
    let mut all: Vec<f64> = (0..ROUNDS).map(|_| rounds(count)).collect();
    all.sort_by(f64::total_cmp);
    all[ROUNDS / 2]
}

/// Persistent requests for one message to and from each peer.
struct Requests(Vec<ffi::MPI_Request>);

impl Requests {
    /// The messages must stay where they are as long as the requests live.
    fn new(comm: &Communicator, peers: &[usize], words: usize, outgoing: &[u64], incoming: &mut [u64]) -> Self {
        let mut requests = Vec::new();
        for ((&peer, from), to) in peers.iter().zip(outgoing.chunks(words)).zip(incoming.chunks_mut(words)) {
            let (peer, count, comm) = (peer as c_int, words as c_int, comm.as_raw());
            // SAFETY: both messages have so many words, and outlive the requests, which are waited for before they are freed.
            unsafe {
                let (mut send, mut receive) = (ffi::RSMPI_REQUEST_NULL, ffi::RSMPI_REQUEST_NULL);
                ffi::MPI_Recv_init(to.as_mut_ptr().cast(), count, ffi::RSMPI_UINT64_T, peer, 1, comm, &mut receive);
                ffi::MPI_Send_init(from.as_ptr().cast(), count, ffi::RSMPI_UINT64_T, peer, 1, comm, &mut send);
                requests.extend([receive, send]);
            }
        }
        Self(requests)
    }

    fn exchange(&mut self) {
        let count = self.0.len() as c_int;
        // SAFETY: all are persistent requests that are not under way; an ignored status is allowed.
        unsafe {
            ffi::MPI_Startall(count, self.0.as_mut_ptr());
            ffi::MPI_Waitall(count, self.0.as_mut_ptr(), ffi::RSMPI_STATUSES_IGNORE);
        }
    }
}

impl Drop for Requests {
    fn drop(&mut self) {
        for request in &mut self.0 {
            // SAFETY: none is under way.
            unsafe { ffi::MPI_Request_free(request) };
        }
    }
}

/// A communicator that knows who exchanges with whom.
struct Graph {
    comm: ffi::MPI_Comm,
    peers: usize,
}

impl Graph {
    fn new(comm: &Communicator, peers: &[usize]) -> Self {
        let (ranks, count): (Vec<c_int>, _) = (peers.iter().map(|&peer| peer as c_int).collect(), peers.len() as c_int);
        let weights = vec![1; peers.len()];
        // SAFETY: all lists have so many numbers; no hints.
        unsafe {
            let mut graph = ffi::RSMPI_COMM_NULL;
            ffi::MPI_Dist_graph_create_adjacent(
                comm.as_raw(),
                count,
                ranks.as_ptr(),
                weights.as_ptr(),
                count,
                ranks.as_ptr(),
                weights.as_ptr(),
                ffi::RSMPI_INFO_NULL,
                0,
                &mut graph,
            );
            Self { comm: graph, peers: peers.len() }
        }
    }

    fn exchange(&self, words: usize, outgoing: &[u64], incoming: &mut [u64]) {
        assert!(outgoing.len() == words * self.peers && incoming.len() == outgoing.len());
        // SAFETY: both have room for so many words from each peer.
        unsafe {
            ffi::MPI_Neighbor_alltoall(
                outgoing.as_ptr().cast(),
                words as c_int,
                ffi::RSMPI_UINT64_T,
                incoming.as_mut_ptr().cast(),
                words as c_int,
                ffi::RSMPI_UINT64_T,
                self.comm,
            );
        }
    }
}

impl Drop for Graph {
    fn drop(&mut self) {
        // SAFETY: nothing is under way on it.
        unsafe { ffi::MPI_Comm_free(&mut self.comm) };
    }
}
