//! A rank that dies while ranks exchange ends the job with a message, and nothing is lost: in the reduction that plans a step, while
//! the domain is cut, in a migration, in the plan of the halo, while motion or stress is on its way.

use crate::generations::{OFTEN, nothing_lost};
use formats::exit;
use tests::shim::{Call, Fault};
use tests::trial::{Trial, calls, short, strike};

/// Calls of MPI that exchange.
const KINDS: &str = "send,reduce,gather";
/// The domain is cut anew at every build of the lists, so that particles migrate; by numbers, which are the same in every launch.
const OPTIONS: [&str; 5] = [OFTEN[0], OFTEN[1], "--always-rebalance", "--balance", "particles"];
/// Numbers in the reduction that plans a step.
const PLAN: u64 = 6;
/// The rank that dies, of three.
const VICTIM: usize = 1;

/// Whatever comes before, `wanted` of a call and the one before it.
fn places(calls: &[Call], wanted: impl Fn(&Call, &Call) -> bool) -> Vec<u64> {
    calls.windows(2).filter(|pair| wanted(&pair[0], &pair[1])).map(|pair| pair[1].number).collect()
}

#[test]
fn a_rank_dies_in_every_kind_of_exchange() {
    let trial = Trial::in_memory(short::SOLID);
    let counted = trial.fresh("counted");
    let all = calls(&counted, 3, &OPTIONS, KINDS, exit::DONE);
    let mine: Vec<Call> = all.into_iter().filter(|call| call.rank == VICTIM).collect();
    let is = |call: &Call, kind: &str| call.kind == kind;
    let longest = mine.iter().filter(|call| is(call, "reduce")).map(|call| call.bytes).max().unwrap();
    assert!(longest > PLAN, "{longest}");
    let exchanges = [
        ("the plan of a step", places(&mine, |_, call| is(call, "reduce") && call.bytes == PLAN)),
        ("the cuts", places(&mine, |_, call| is(call, "reduce") && call.bytes == longest)),
        // After the sum of the strays; how many to each neighbour, a number each.
        ("a migration", places(&mine, |before, call| is(before, "reduce") && is(call, "send") && call.bytes == 1)),
        // After the boxes of all ranks.
        ("the plan of the halo", places(&mine, |before, call| is(before, "gather") && is(call, "send"))),
        ("motion", places(&mine, |before, call| is(before, "reduce") && before.bytes == PLAN && is(call, "send"))),
        ("stress", places(&mine, |call, next| is(call, "send") && is(next, "reduce") && next.bytes == PLAN)),
    ];
    for (number, (exchange, places)) in exchanges.iter().enumerate() {
        assert!(places.len() > 2, "{exchange}: {places:?}");
        let folder = trial.fresh(&format!("killed-{number}"));
        // Of a message the last before the reduction.
        let at = places[places.len() / 2] - u64::from(*exchange == "stress");
        let fault = Fault::new("kill", at).of(KINDS, "messages").on(VICTIM);
        let (output, struck) = strike(&folder, 3, &OPTIONS, &fault);
        assert!(![exit::DONE, exit::RESUMABLE].contains(&output.code), "{exchange}, {struck:?}: {output}");
        assert!(output.stderr.contains("signal 9"), "{exchange}, {struck:?}: {output}");
        assert!(nothing_lost(&folder, 0, &struck[0]) > 0, "{exchange}: no checkpoint was written before");
        trial.go(&folder, 2, &[], exit::DONE);
        trial.same(&folder);
    }
}
