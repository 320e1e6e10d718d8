//! Plans against runs: what is counted for all ranks on one is what each of several finds. The test starts itself again
//! under mpirun.

use crate::support::{in_turn, under_mpi};
use formats::scene::{Material as Law, Scene};
use sph_run::material::DruckerPrager;
use sph_run::parallel::Reduce;
use sph_run::physics::{CubicSpline, Model};
use sph_run::plan::partition::{Load, Partition};
use sph_run::plan::places::{State, points};
use sph_run::plan::{Options, migration, plan};
use sph_run::simulation::{Clock, Simulation};
use sph_run::space::{PlaneStrain, Space, ThreeD};

const REST: &str = r#"
[material.drucker-prager]
density = "2600 kg/m3"
young = "6 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[wall.floor]
axis = "z"
at = 0
side = "above"
slip = "no-slip"
[end]
time = "1 s"
"#;
const COLUMN: &str = "space = \"3d\"\nspacing = \"6 mm\"\nsymmetry = [\"x\"]\n\
    [body.column]\ncylinder = { radius = \"0.1 m\", height = \"0.1 m\" }\n";
const CHANNEL: &str = "space = \"3d\"\nspacing = \"5 mm\"\nperiodic = { y = { from = 0, to = 0.05 } }\n\
    [body.column]\nbox = { min = [0, 0, 0], max = [\"0.2 m\", \"0.05 m\", \"0.1 m\"] }\n";
const PLANE: &str = "space = \"plane-strain\"\nspacing = \"2 mm\"\n\
    [body.column]\nwedge = { corner = [0, 0, 0], size = [\"0.2 m\", 0, \"0.1 m\"], falls = \"right\" }\n";

fn scene(head: &str) -> Scene {
    Scene::read("scene.toml", &format!("{head}{REST}")).expect("a sound scene")
}

#[test]
fn a_plan_counts_what_ranks_have() {
    let Some(universe) = under_mpi("plan::a_plan_counts_what_ranks_have", &[1, 5]) else { return };
    let comm = universe.world();
    for (head, state) in [(COLUMN, State::Start), (COLUMN, State::Deposit), (CHANNEL, State::Start)] {
        compare::<3, 6, ThreeD>(&comm, &scene(head), state);
    }
    compare::<2, 4, PlaneStrain>(&comm, &scene(PLANE), State::Spreading);
    // Both ways of going home lead to the same particles, which it asserts itself.
    let measured = migration::really(&comm, 5000);
    let (count, taken) = migration::counted(5000, Reduce::size(&comm));
    let number = |name: &str| measured[name].as_u64().unwrap();
    assert_eq!(
        [number("particles"), number("rounds"), number("strays"), number("sent")],
        [count, taken.rounds, taken.strays, taken.sent],
        "{measured}"
    );
}

fn compare<const D: usize, const N: usize, S: Space<D, N>>(
    comm: &formats::h5::Communicator,
    scene: &Scene,
    state: State,
) {
    let (rank, size, points) = (Reduce::rank(comm), Reduce::size(comm), points(scene, state));
    let planned = Partition::of(scene, &points, size);
    assert_eq!(planned.faults, [""; 0], "{state:?}");
    let mine = in_turn::<D, N, S>(comm, &points, 1.0);
    let Law::DruckerPrager(law) = &scene.material else { panic!("the law of these scenes") };
    let (law, all) = (DruckerPrager::new(law), points.len() as u64);
    let simulation =
        Simulation::<D, N, Model<S, CubicSpline, DruckerPrager>>::new(comm, scene, law, mine, all, Clock::default());
    let (p, load) = (&simulation.particles, planned.loads[rank]);
    let found =
        Load { owned: p.owned as u64, copies: (p.halo - p.owned) as u64, walls: (p.len() - p.mirror) as u64, ..load };
    assert_eq!(found, load, "{state:?}, rank {rank} of {size}");
    // Images of copies come on top.
    let images = (p.mirror - p.halo) as u64;
    assert!(images == load.images || (images > load.images && p.halo > p.owned), "{state:?}: {images}, {load:?}");
    let mut sent = [p.halo as u64 - p.owned as u64];
    comm.sum(&mut sent);
    assert_eq!(sent[0], planned.sum(|load| load.sent));
}

fn options(ranks: &[u64]) -> Options {
    let ranks = ranks.to_vec();
    let (latency, bandwidth, overlap) = (3.0, 0.5, 0.0);
    Options {
        plan: true,
        ranks,
        state: State::Start,
        cost: None,
        latency,
        bandwidth,
        overlap,
        sample: 40_000_000,
        beside: None,
        json: true,
        migration: None,
    }
}

/// Rows of the list of verification tests, H1 to H3, and the bounds of imbalance, at sizes that tests can wait for.
#[test]
fn shares_are_even() {
    // Yang et al.'s prism on the ranks they used; a plane of the lattice cannot be cut.
    let channel = scene(&CHANNEL.replace("5 mm", "1.25 mm"));
    for (state, largest) in [(State::Start, 1.10), (State::Spreading, 1.01), (State::Deposit, 1.01)] {
        let points = points(&channel, state);
        let partition = Partition::of(&channel, &points, 64);
        assert!(points.len() > 500_000 && partition.faults.is_empty(), "{:?}", partition.faults);
        assert!(partition.imbalance() < largest, "{state:?}: {}", partition.imbalance());
        assert!(partition.scheme_bytes < 1 << 20 && partition.matrix_bytes > 1 << 20);
    }
}

#[test]
fn a_plan_says_what_is_asked_and_what_is_wrong() {
    let work = tempfile::tempdir().unwrap();
    let file = work.path().join("scene.toml");
    std::fs::write(&file, format!("{COLUMN}{REST}")).unwrap();
    let json =
        |options: &Options| -> serde_json::Value { serde_json::from_str(&plan(&file, options).unwrap()).unwrap() };
    let of = |plan: &serde_json::Value, row: usize, name: &str| plan["rows"][row][name].as_f64().unwrap();
    let plain = json(&options(&[64, 4, 4]));
    assert_eq!(plain["rows"].as_array().unwrap().len(), 2, "{plain}");
    assert!(of(&plain, 0, "ranks") == 4.0 && of(&plain, 0, "efficiency") > of(&plain, 1, "efficiency"));
    assert!(plain["advice"].as_str().unwrap().contains("fewer than 4"), "{}", plain["advice"]);
    assert!(json(&options(&[1, 64]))["advice"].as_str().unwrap().contains("about 1 cores"));
    // Costs and the network are what they are set to.
    let slower = json(&Options { cost: Some(10.0), ..options(&[4]) });
    assert!(of(&slower, 0, "seconds-per-step") > 5.0 * of(&plain, 0, "seconds-per-step"), "{slower}");
    assert!(of(&slower, 0, "efficiency") > of(&plain, 0, "efficiency"));
    let narrow = json(&Options { bandwidth: 0.001, ..options(&[4]) });
    let hidden = json(&Options { bandwidth: 0.001, overlap: 1.0, ..options(&[4]) });
    assert!(of(&narrow, 0, "seconds-per-step") > 2.0 * of(&hidden, 0, "seconds-per-step"), "{narrow}");

    // A sample of a scene stands for all of it. Its halo is as thick as the reach, 2.76 spacings; that of a lattice has only the
    // two or three planes that lie within: the share is 1.38 times as large at most.
    let sampled = json(&Options { sample: 4000, ..options(&[8]) });
    let whole = json(&options(&[8]));
    for (name, tolerance) in [("owned", 0.03), ("imbalance", 0.1), ("halo-share", 0.38), ("walls-unique", 0.1)] {
        let ratio = of(&sampled, 0, name) / of(&whole, 0, name);
        assert!((ratio - 1.0).abs() < tolerance, "{name}: {ratio}");
    }
    let refused = |path: &std::path::Path, options: &Options| plan(path, options).unwrap_err().to_string();
    assert!(refused(&file, &options(&[60_000])).contains("--ranks 60000: more than the"));
    assert!(refused(&work.path().join("no.toml"), &options(&[2])).contains("no.toml"));
    let fine = work.path().join("fine.toml");
    std::fs::write(&fine, format!("{}{REST}", COLUMN.replace("6 mm", "1 um"))).unwrap();
    assert!(refused(&fine, &options(&[2])).contains("must be fewer than 2^40"), "{}", refused(&fine, &options(&[2])));
    let run = Options { state: State::Deposit, ..options(&[2]) };
    std::fs::write(work.path().join("scene.lock.toml"), format!("{COLUMN}{REST}")).unwrap();
    assert!(refused(work.path(), &run).contains("--state is for scenes"), "{}", refused(work.path(), &run));
}
