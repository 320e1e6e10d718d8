//! Elastic waves in time: row D1 of the list of verification problems. (The limit of stability, C13, needs steps
//! longer than a scene may ask for: `sph-run/tests/stepping.rs`.)

use crate::{Scene, history, wall};
use tests::{WorkFolder, computed};

/// D1: gravity switched on over a laterally confined elastic column swings it with period 4 H/c about its settlement.
#[test]
fn d1_period_and_settlement_of_an_elastic_column() {
    let (height, c) = (0.2, 55.643);
    let period = 4.0 * height / c;
    let work = WorkFolder::new();
    // Cohesion: it must bear the tension of the rebound. No viscosity: it would take the swing away.
    let scene = Scene {
        body: "box = { min = [0, 0, 0], max = [0.05, 0, 0.2] }",
        walls: wall("floor", "z", 0.0, "above", "no-slip")
            + &wall("left", "x", 0.0, "above", "free-slip")
            + &wall("right", "x", 0.05, "below", "free-slip"),
        numerics: "viscosity = 0",
        cohesion: 1e6,
        end: 5.0 * period,
        history: period / 100.0,
        ..Scene::default()
    };
    let folder = computed(&work, "run", &scene.text(), 0);
    let (time, height_now, potential) =
        (history(&folder, "time"), history(&folder, "height"), history(&folder, "potential_energy"));
    // The potential energy is the mean settlement: the first mode and little of the others.
    let (low, high) = potential.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &e| (a.min(e), b.max(e)));
    let mid = 0.5 * (low + high);
    let falls: Vec<f64> = (1..time.len())
        .filter(|&k| potential[k - 1] > mid && potential[k] <= mid)
        .map(|k| {
            let part = (potential[k - 1] - mid) / (potential[k - 1] - potential[k]);
            time[k - 1] + part * (time[k] - time[k - 1])
        })
        .collect();
    let measured = (falls[falls.len() - 1] - falls[0]) / (falls.len() - 1) as f64;
    // Over whole periods, as measured.
    let whole = ((falls.len() - 1) as f64 * measured / (time[1] - time[0])).round() as usize;
    let settled: Vec<f64> = height_now[..whole].iter().map(|h| height - h).collect();
    let mean = settled.iter().sum::<f64>() / whole as f64;
    let largest = settled.iter().fold(0.0_f64, |a, &b| a.max(b));
    println!("{falls:?} period {measured:e} over {period:e}: {}; mean {mean:e} largest {largest:e}", measured / period);
}
