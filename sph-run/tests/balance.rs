//! What ranks share evenly: work. The test starts itself again under mpirun.

use crate::support::{in_turn, under_mpi};
use formats::h5::Communicator;
use formats::scene::{Material as Law, Scene};
use sph_run::material::DruckerPrager;
use sph_run::parallel::Reduce;
use sph_run::parallel::balance::{BESIDE_PAIRS, By};
use sph_run::physics::{CubicSpline, Model};
use sph_run::simulation::{Clock, Simulation};
use sph_run::space::PlaneStrain;

const DX: f64 = 0.01;
const SCENE: &str = r#"
space = "plane-strain"
spacing = "1 cm"
[material.drucker-prager]
density = "2600 kg/m3"
young = "6 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.block]
box = { min = [0, 0, 0], max = [1, 0, 1] }
[end]
time = "1 s"
"#;

/// A block, and beside it as many particles that fly alone.
fn places() -> Vec<[f64; 3]> {
    let lattice = |first: f64, step: f64| {
        (0..1600).map(move |n| [first + f64::from(n % 40) * step, 0.0, f64::from(n / 40) * step])
    };
    lattice(0.0, DX).chain(lattice(0.7, 4.0 * DX)).collect()
}

fn run<'a>(
    comm: &'a Communicator,
    scene: &Scene,
) -> Simulation<'a, 2, 4, Model<PlaneStrain, CubicSpline, DruckerPrager>> {
    let all = places();
    let mine = in_turn::<2, 4, PlaneStrain>(comm, &all, 0.26);
    let Law::DruckerPrager(law) = &scene.material else { panic!("the law of the scene") };
    Simulation::new(comm, scene, DruckerPrager::new(law), mine, all.len() as u64, Clock::default())
}

/// The largest work of a rank over the mean, in candidates.
fn uneven(run: &Simulation<'_, 2, 4, Model<PlaneStrain, CubicSpline, DruckerPrager>>) -> f64 {
    let lists = &run.neighbors.of_owned;
    let mine: u64 = (0..lists.len()).map(|i| lists.of(i).len() as u64 + BESIDE_PAIRS).sum();
    let (mut all, mut largest) = ([mine], [mine as f64]);
    run.comm.sum(&mut all);
    run.comm.max(&mut largest);
    largest[0] * Reduce::size(run.comm) as f64 / all[0] as f64
}

/// Of four ranks with as many particles each two have a fifth more to do than the mean: 40 candidates a particle beside 60, where
/// those that fly alone have the 8 of their block. By work all have the same, to the whole columns that cuts leave.
#[test]
fn ranks_share_work_and_not_numbers() {
    let Some(universe) = under_mpi("balance::ranks_share_work_and_not_numbers", &[4]) else { return };
    let comm = universe.world();
    let scene = Scene::read("scene.toml", SCENE).expect("a sound scene");
    for (by, between) in [(By::Particles, [1.15, 1.3]), (By::Work, [1.0, 1.06])] {
        let mut run = run(&comm, &scene);
        let at_first = uneven(&run);
        assert!(at_first > 1.15, "{at_first}");
        run.share_by(by);
        run.rebuild();
        let now = uneven(&run);
        assert!((between[0]..between[1]).contains(&now), "{by:?}: {now}");
        // Nothing is to be gained by another cut.
        let before = run.partition.tree.clone();
        run.rebuild();
        assert_eq!(run.partition.tree, before);
    }
}
