//! The time of a step, predicted from what each rank has: a cost a particle, and latency and bandwidth of messages.
//!
//! A step lasts as long as its slowest rank:
//!
//! ```text
//! t = max over ranks of (c w + (1 - overlap) (m latency + b / bandwidth))
//!     + 2 ceil(log2 p) latency + (3 m latency + b' / bandwidth) / n
//! ```
//!
//! - w: the rank's particles, with copies, images and wall particles at their share of a particle's cost c;
//! - m: its messages in a step, one to each peer for every exchange; b: the bytes it receives or sends, whichever is more;
//! - then the one reduction of the step, and what building the lists every n steps exchanges: counts and keys with
//!   the peers, and the box of every rank with all others (b').
//!
//! Efficiency is c W / (p t), where W is the work of one rank alone: all particles, images and walls, no copies.

use super::measured::Log;
use super::partition::{Load, Partition};
use formats::space::Space;

/// Cost of a copy over that of an owned particle: it is sent, received, laid out for the sweeps and sorted into lists, but
/// has no sum of its own. Measured, as the two below, with 64 000 particles in three dimensions: 0 while lists serve, 0.1 with
/// two ranks of 900 in motion.
const COPY: f64 = 0.08;
/// The same of an image.
const IMAGE: f64 = 0.14;
/// The same of a wall particle, whose velocity and stress are sums over the material.
const WALL: f64 = 0.6;
/// Steps between two builds of the lists, about.
const STEPS_PER_LIST: f64 = 10.0;

/// What a particle costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Costs {
    /// Time of an owned particle in a step, s.
    pub particle: f64,
    /// Where that is from, for people.
    pub origin: String,
}

impl Costs {
    /// One that the user gave, in microseconds.
    pub fn given(microseconds: f64) -> Self {
        Self { particle: 1e-6 * microseconds, origin: "--cost".into() }
    }

    /// The defaults: measured on one core with AVX-512 (see docs/scaling.md).
    pub fn of_space(space: Space) -> Self {
        let microseconds = match space {
            Space::PlaneStrain | Space::Axisymmetric => 0.2,
            Space::ThreeD => 0.7,
        };
        Self { particle: 1e-6 * microseconds, origin: format!("default of {}", space.name()) }
    }

    /// Of a launch of the run itself, whose partition was about `then`. Exchange is left out.
    pub fn measured(log: &Log, then: &Partition) -> Self {
        let work: f64 = then.loads.iter().map(work).sum();
        Self { particle: log.seconds_per_step * log.ranks as f64 / work, origin: log.origin.clone() }
    }
}

/// The network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    /// Of a message, s.
    pub latency: f64,
    /// Of a rank, bytes/s.
    pub bandwidth: f64,
    /// Share of the exchange that goes on behind computation.
    pub overlap: f64,
}

/// A step on some number of ranks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predicted {
    /// Time of a step, s.
    pub step: f64,
    /// Of it, computation of the slowest rank.
    pub computing: f64,
    /// Of all ranks' time the share that one rank would need as well.
    pub efficiency: f64,
    /// Processor time of all ranks over that of one rank, waiting left out: what copies and doubled walls add.
    pub overhead: f64,
}

/// A rank's work in owned particles.
pub fn work(load: &Load) -> f64 {
    load.owned as f64 + COPY * load.copies as f64 + IMAGE * load.images as f64 + WALL * load.walls as f64
}

/// See the module.
pub fn predict(partition: &Partition, costs: &Costs, machine: &Machine) -> Predicted {
    let ranks = partition.loads.len() as f64;
    let bytes = |load: &Load, per_copy: u64| (per_copy * load.copies.max(load.sent)) as f64;
    let exchanges = partition.exchanges.len() as f64;
    let rank = |load: &Load| {
        let messages = exchanges * load.messages as f64;
        let exchange = messages * machine.latency + bytes(load, partition.bytes_per_copy()) / machine.bandwidth;
        costs.particle * work(load) + (1.0 - machine.overlap) * exchange
    };
    let slowest = partition.loads.iter().map(rank).fold(0.0, f64::max);
    let computing = costs.particle * partition.loads.iter().map(work).fold(0.0, f64::max);
    let hops = ranks.log2().ceil();
    let list =
        |load: &Load| 3.0 * load.peers as f64 * machine.latency + (bytes(load, 8) + 64.0 * ranks) / machine.bandwidth;
    let lists = if ranks > 1.0 { partition.loads.iter().map(list).fold(0.0, f64::max) } else { 0.0 };
    let step = slowest + 2.0 * hops * machine.latency + (lists + hops * machine.latency) / STEPS_PER_LIST;
    let alone = partition.sum(|load| load.owned) as f64
        + IMAGE * partition.sum(|load| load.images) as f64
        + WALL * partition.walls as f64;
    let all: f64 = partition.loads.iter().map(work).sum();
    Predicted { step, computing, efficiency: costs.particle * alone / (ranks * step), overhead: all / alone }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn partition(loads: Vec<Load>, walls: u64) -> Partition {
        let exchanges = vec![7, 7];
        let (levels, scheme_bytes, matrix_bytes, faults) = (1, 0, 0, Vec::new());
        Partition { loads, levels, walls, exchanges, scheme_bytes, matrix_bytes, faults }
    }

    const COSTS: fn() -> Costs = || Costs::given(1.0);

    #[test]
    fn one_rank_is_efficient_and_waits_for_nobody() {
        let one = partition(vec![Load { owned: 1000, images: 100, walls: 200, ..Load::default() }], 200);
        let machine = Machine { latency: 1.0, bandwidth: 1.0, overlap: 0.0 };
        let predicted = predict(&one, &COSTS(), &machine);
        assert!((predicted.step / 1.134e-3 - 1.0).abs() < 1e-12, "{predicted:?}");
        assert!((predicted.efficiency - 1.0).abs() < 1e-12 && (predicted.overhead - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_slowest_rank_its_messages_and_its_bytes_count() {
        let load = Load { owned: 1000, copies: 100, sent: 300, peers: 1, messages: 1, ..Load::default() };
        let two = partition(vec![load, Load { owned: 600, ..load }], 0);
        let network = |latency: f64, bandwidth: f64, overlap: f64| {
            predict(&two, &COSTS(), &Machine { latency, bandwidth, overlap }).step
        };
        let free = network(1e-300, 1e300, 0.0);
        assert!((free / 1.008e-3 - 1.0).abs() < 1e-9, "{free}");
        // Two messages, two hops of the reduction; three messages and one hop every tenth step.
        let slow = network(1e-3, 1e300, 0.0) - free;
        assert!((slow / 4.4e-3 - 1.0).abs() < 1e-9, "{slow}");
        // 112 bytes of each of 300 copies; every tenth step their keys, and two boxes.
        let narrow = network(1e-300, 1e6, 0.0) - free;
        assert!((narrow / (0.0336 + 0.1 * (0.0024 + 128e-6)) - 1.0).abs() < 1e-9, "{narrow}");
        assert!((network(1e-300, 1e6, 1.0) - free - 0.1 * (0.0024 + 128e-6)).abs() < 1e-12);
        let efficiency = predict(&two, &COSTS(), &Machine { latency: 1e-300, bandwidth: 1e300, overlap: 0.0 });
        assert!(
            (efficiency.efficiency - 1600.0 / 2016.0).abs() < 1e-9
                && (efficiency.overhead - 1616.0 / 1600.0).abs() < 1e-9
        );
    }

    #[test]
    fn the_cost_of_a_run_is_what_its_log_says() {
        let loads = vec![Load { owned: 1000, copies: 1000, ..Load::default() }; 2];
        let log = Log { ranks: 2, seconds_per_step: 2.16e-3, origin: "log".into() };
        let costs = Costs::measured(&log, &partition(loads, 0));
        assert!((costs.particle / 2e-6 - 1.0).abs() < 1e-12, "{costs:?}");
    }
}
