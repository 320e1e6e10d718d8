//! Which trials there are. Each name says all about a trial; the seed decides what is left open.

use super::Options;
use super::ground::{Ground, MOST_RANKS};
use std::time::Duration;
use tests::shim::{Call, Fault};

/// One trial.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Group, scene, and the rest: `kill plane 3 ranks, rank 1 call 17`.
    pub name: String,
    /// Index of its scene.
    pub ground: usize,
    /// Ranks of the launch that something is done to, and of the one that goes on.
    pub ranks: usize,
    pub ranks_after: usize,
    pub what: What,
}

/// What is done.
#[derive(Clone, Debug)]
pub enum What {
    /// A fault at a call, and the exit codes that are right; none: any but success. In a run that goes on, or one that
    /// begins.
    Call { fault: Fault, codes: Vec<i32>, goes_on: bool },
    /// SIGKILL from outside, after this part of a run's time, to this rank or, where it is none, to all and mpirun.
    Moment { part: f64, rank: Option<usize> },
    /// The newest generation's file is cut off.
    Cut { file: &'static str, length: u64 },
    /// One bit of it changes.
    Flip { file: &'static str, byte: u64, bit: u32 },
    /// A disk of so many KiB.
    Disk { size: u64 },
}

/// How often each group is done comes from the options.
pub fn all(options: &Options, grounds: &[Ground]) -> Vec<Trial> {
    let mut trials = kills(options, grounds);
    let mut others = Vec::new();
    others.extend(failing(grounds));
    for (number, ground) in grounds.iter().enumerate() {
        others.extend(damage(options.seed, number, ground));
    }
    others.extend((60..=400).step_by(4).map(|size| Trial {
        name: format!("disk plane {size} KiB, {} ranks", 1 + size / 4 % 2),
        ground: 0,
        ranks: 1 + (size as usize / 4) % 2,
        ranks_after: 1 + (size as usize / 8) % 2,
        what: What::Disk { size },
    }));
    trials.extend(others.into_iter().step_by(options.every as usize));
    trials
}

/// A number that depends on the seed and a place.
pub fn draw(seed: u64, place: u64) -> u64 {
    // splitmix64
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(place.wrapping_mul(0xd1b5_4a32_d192_ed03));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A third at random moments; the others first at every call of one rank in the first scene, then spread evenly over
/// the calls of all ranks of all launches.
fn kills(options: &Options, grounds: &[Ground]) -> Vec<Trial> {
    let moments = options.kills / 3;
    let mut trials: Vec<Trial> = (0..moments as u64)
        .map(|number| {
            let drawn = draw(options.seed, number);
            let (ground, ranks) = (number as usize % grounds.len(), 1 + (drawn % MOST_RANKS as u64) as usize);
            let rank = (!number.is_multiple_of(3)).then_some((drawn >> 8) as usize % ranks);
            let part = (drawn >> 16) as f64 / (u64::MAX >> 16) as f64;
            let whom = rank.map_or("all".into(), |rank| format!("rank {rank}"));
            Trial {
                name: format!("kill {} {ranks} ranks, moment {number}, {whom}", grounds[ground].name),
                ground,
                ranks,
                ranks_after: after(number),
                what: What::Moment { part, rank },
            }
        })
        .collect();
    let point = |ground: usize, ranks: usize, call: &Call| {
        // A write is also torn: by every second call's own number.
        let deed = if call.kind == "write" && draw(options.seed, call.number) % 2 == 0 { "torn" } else { "kill" };
        Trial {
            name: format!("kill {} {ranks} ranks, rank {} call {}", grounds[ground].name, call.rank, call.number),
            ground,
            ranks,
            ranks_after: after(call.number),
            what: What::Call { fault: Fault::new(deed, call.number).on(call.rank), codes: Vec::new(), goes_on: false },
        }
    };
    let points = options.kills - moments;
    let first: Vec<Trial> = grounds[0].calls[0].iter().map(|call| point(0, 1, call)).collect();
    let mut rest = Vec::new();
    for (number, ground) in grounds.iter().enumerate() {
        for (ranks, calls) in (1..).zip(&ground.calls) {
            if (number, ranks) != (0, 1) {
                rest.extend(calls.iter().map(|call| point(number, ranks, call)));
            }
        }
    }
    let of_first = first.len().min(points.div_ceil(2).max(points.saturating_sub(rest.len())));
    trials.extend(spread(first, of_first));
    trials.extend(spread(rest, points - of_first));
    trials
}

/// So many of a list, evenly.
fn spread(list: Vec<Trial>, wanted: usize) -> Vec<Trial> {
    let total = list.len();
    let chosen = |number: &usize| total > 0 && (number * wanted) / total != ((number + 1) * wanted) / total;
    list.into_iter().enumerate().filter(|(number, _)| chosen(number)).map(|(_, trial)| trial).collect()
}

/// Ranks to go on with.
fn after(number: u64) -> usize {
    [1, 2, 1, 3, 1, 5][number as usize % 6]
}

/// A full disk at every write and allocation, an I/O error at every call: of one rank; on three ranks at every tenth.
fn failing(grounds: &[Ground]) -> Vec<Trial> {
    use formats::exit::{CANNOT_WRITE, DONE, NO_INPUT};
    let mut trials = Vec::new();
    let ground = &grounds[0];
    let mut put = |group: &str, ranks: usize, number: u64, fault: Fault, codes: &[i32]| {
        let goes_on = group == "resume";
        trials.push(Trial {
            name: format!("{group} plane {ranks} ranks, rank {} call {number}", fault.rank.unwrap_or(0)),
            ground: 0,
            ranks,
            ranks_after: after(number),
            what: What::Call { fault, codes: codes.to_vec(), goes_on },
        });
    };
    for (ranks, every) in [(1, 1), (3, 10)] {
        for rank in 0..ranks {
            let calls = ground.calls[ranks - 1].iter().filter(|call| call.rank == rank);
            // Calls are numbered among those the fault is about.
            let writes = calls.clone().filter(|call| ["write", "allocate"].contains(&&*call.kind)).count();
            for number in (1..=writes as u64).step_by(every) {
                let full = Fault::new(format!("full:{ENOSPC}"), number).of("write,allocate", "*").on(rank);
                put("full", ranks, number, full, &[DONE, CANNOT_WRITE]);
            }
            for call in calls.step_by(every) {
                let fails = Fault::new(format!("fail:{EIO}"), call.number).on(rank);
                put("io", ranks, call.number, fails, &[DONE, CANNOT_WRITE]);
            }
        }
    }
    let read = |call: &&Call| ["open", "read"].contains(&&*call.kind);
    let fails = |number, rank| Fault::new(format!("fail:{EIO}"), number).of("open,read", "*").on(rank);
    for number in 1..=ground.all_calls.iter().filter(read).count() as u64 {
        put("read", 1, number, fails(number, 0), &[DONE, CANNOT_WRITE, NO_INPUT]);
    }
    // Reads before the first step are those of what the run goes on from.
    for (ranks, calls) in [1, 3].into_iter().zip(&ground.calls_after) {
        for rank in 0..ranks {
            let own = calls.iter().filter(|call| call.rank == rank).filter(read);
            let before = own.take_while(|call| !call.path.contains(".tmp")).count();
            for number in 1..=before as u64 {
                // Folders are opened to be put on the disk.
                put("resume", ranks, number, fails(number, rank), &[DONE, CANNOT_WRITE, NO_INPUT]);
            }
        }
    }
    trials
}

const ENOSPC: i32 = 28;
const EIO: i32 = 5;

/// Cuts at every block border, a bit in every dataset and attribute, and all over the manifest.
fn damage(seed: u64, number: usize, ground: &Ground) -> Vec<Trial> {
    let name = ground.name;
    let newest = formats::folder::RunFolder::new(&ground.stopped).generation(3);
    let mut trials = Vec::new();
    let mut put = |name: String, what: What| {
        trials.push(Trial { name, ground: number, ranks: 1, ranks_after: 1, what });
    };
    for file in ["state.hdf", "MANIFEST.json"] {
        let length = std::fs::metadata(newest.join(file)).map_or(0, |facts| facts.len());
        for length in (0..length).step_by(4096).chain([length.saturating_sub(1)]) {
            put(format!("cut {name} {file} to {length}"), What::Cut { file, length });
        }
    }
    for (count, place) in tests::damage::places(&newest.join("state.hdf")).unwrap_or_default().iter().enumerate() {
        let drawn = draw(seed, count as u64);
        let byte = place.bytes.start + drawn % (place.bytes.end - place.bytes.start).max(1);
        let flip = What::Flip { file: "state.hdf", byte, bit: (drawn >> 32) as u32 % 8 };
        put(format!("flip {name} state.hdf, {}", place.what), flip);
    }
    let length = std::fs::metadata(newest.join("MANIFEST.json")).map_or(0, |facts| facts.len());
    for byte in (0..length.saturating_sub(1)).step_by(16) {
        let flip = What::Flip { file: "MANIFEST.json", byte, bit: draw(seed, byte) as u32 % 8 };
        put(format!("flip {name} MANIFEST.json, byte {byte}"), flip);
    }
    trials
}

/// When a kill at this part of a run's time is due.
pub fn moment(part: f64, took: Duration) -> Duration {
    took.mul_f64(0.2 + 0.75 * part)
}
