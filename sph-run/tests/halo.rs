//! What surrounds the particles of a rank, against a search through everything: rows H3, H4 and H5 of the list of
//! verification tests, on 1, 2, 3 and 5 ranks; with walls, planes of symmetry, mirror walls and periodic axes, and all of
//! these across the borders of ranks. The test starts itself again under mpirun.

use crate::support::under_mpi;
use formats::h5::Communicator;
use formats::scene::{Scene, WallKind, WallLattice};
use formats::space::Space as Kind;
use sph_run::algebra::Vector;
use sph_run::dispatch::{Job, resolve};
use sph_run::neighbors::bounds;
use sph_run::parallel::Reduce;
use sph_run::parallel::halo::Fields;
use sph_run::particles::{Particles, id, key};
use sph_run::physics::Physics;
use sph_run::simulation::{Clock, Simulation};
use sph_run::space::Space;
use std::collections::BTreeSet;

const DX: f64 = 0.01;

const REST: &str = r#"
spacing = "10 mm"
[material.drucker-prager]
density = "2600 kg/m3"
young = "0.6 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.block]
box = { min = [0, 0, 0], max = ["0.1 m", "0.1 m", "0.1 m"] }
[end]
time = "1 s"
"#;

const FLOOR: (&str, &str) = ("z", "side = \"above\"\nat = 0\nslip = \"no-slip\"");
const SIDE: (&str, &str) = ("x", "side = \"below\"\nat = 0.13\nslip = \"free-slip\"");
const MIRROR_FLOOR: (&str, &str) = ("z", "side = \"above\"\nat = 0\nslip = \"no-slip\"\nkind = \"mirror\"");
const MIRROR_LEFT: (&str, &str) = ("x", "side = \"above\"\nat = 0\nslip = \"no-slip\"\nkind = \"mirror\"");
const MIRROR_SIDE: (&str, &str) = ("x", "side = \"below\"\nat = 0.13\nslip = \"free-slip\"\nkind = \"mirror\"");
/// Three spacings from a plane of symmetry, less than twice the reach: there are images of images.
const MIRROR_NEAR: (&str, &str) = ("y", "side = \"below\"\nat = 0.03\nslip = \"free-slip\"\nkind = \"mirror\"");

/// Space with planes of symmetry and periods; the cells of the block along x, y, z; the walls by their axes.
type Trial = (&'static str, [usize; 3], &'static [(&'static str, &'static str)]);
const SCENES: [Trial; 9] = [
    ("space = \"3d\"\nsymmetry = [\"x\", \"y\"]", [13, 8, 6], &[FLOOR, SIDE]),
    ("space = \"axisymmetric\"", [13, 1, 24], &[FLOOR, SIDE]),
    ("space = \"plane-strain\"\nsymmetry = [\"x\"]", [13, 1, 24], &[FLOOR, SIDE]),
    ("space = \"3d\"\nperiodic = { x = { from = 0, to = 0.13 }, y = { from = 0.02, to = 0.1 } }", [13, 8, 6], &[FLOOR]),
    (
        "space = \"3d\"\nsymmetry = [\"x\"]\nperiodic = { y = { from = 0, to = 0.08 } }",
        [13, 8, 6],
        &[MIRROR_FLOOR, SIDE],
    ),
    ("space = \"plane-strain\"\nperiodic = { x = { from = 0, to = 0.13 } }", [13, 1, 24], &[FLOOR]),
    ("space = \"plane-strain\"", [13, 1, 24], &[MIRROR_FLOOR, MIRROR_LEFT, MIRROR_SIDE]),
    ("space = \"axisymmetric\"", [13, 1, 24], &[MIRROR_FLOOR, MIRROR_SIDE]),
    ("space = \"3d\"\nsymmetry = [\"y\"]", [16, 3, 8], &[FLOOR, MIRROR_NEAR]),
];

fn scene((head, _, walls): Trial) -> Scene {
    // A box has no y in the plane spaces, and a body of rings must be a cylinder.
    let box_3d = r#"box = { min = [0, 0, 0], max = ["0.1 m", "0.1 m", "0.1 m"] }"#;
    let mut text = format!("{head}{REST}");
    if head.contains("axi") {
        text = text.replace(box_3d, r#"cylinder = { radius = "0.1 m", height = "0.1 m" }"#);
    } else if head.contains("plane") {
        text = text.replace(box_3d, r#"box = { min = [0, 0, 0], max = ["0.1 m", 0, "0.1 m"] }"#);
    } else if walls.contains(&MIRROR_NEAR) || head.contains("y = ") {
        text = text.replace(box_3d, r#"box = { min = [0, 0.02, 0], max = ["0.1 m", "0.03 m", "0.1 m"] }"#);
    }
    for (number, (axis, wall)) in walls.iter().enumerate() {
        text += &format!("[wall.number-{number}]\naxis = \"{axis}\"\n{wall}\n");
    }
    Scene::read("scene.toml", &text).expect("a sound scene")
}

#[test]
fn h4_everything_within_reach_is_there() {
    let Some(universe) = under_mpi("halo::h4_everything_within_reach_is_there", &[1, 2, 3, 5]) else { return };
    let comm = universe.world();
    for (number, trial) in SCENES.into_iter().enumerate() {
        let scene = scene(trial);
        let starts = [Shares::InTurn, Shares::AllOnTheFirst];
        for start in starts.into_iter().take(if number < 3 { 2 } else { 1 }) {
            resolve(&scene, Check { comm: &comm, scene: &scene, cells: trial.1, start });
        }
    }
}

/// Who has which particles at the start.
#[derive(Clone, Copy, Debug)]
enum Shares {
    AllOnTheFirst,
    InTurn,
}

struct Check<'a> {
    comm: &'a Communicator,
    scene: &'a Scene,
    cells: [usize; 3],
    start: Shares,
}

/// Number in [-1, 1) from a place in a sequence.
fn random(n: u64) -> f64 {
    let mut z = n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A shift of particle `n`, each component within `size`.
fn shift(round: u64, n: usize, size: f64) -> [f64; 3] {
    [0, 1, 2].map(|a| size * random((round << 32) + 3 * n as u64 + a))
}

impl Job for Check<'_> {
    type Output = ();
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) {
        let (rank, size) = (Reduce::rank(self.comm), Reduce::size(self.comm));
        let [nx, ny, nz] = self.cells;
        // The whole truth, on every rank.
        let mut x: Vec<Vector<D>> = Vec::new();
        for n in 0..nx * ny * nz {
            let cell = [n / (ny * nz), n / nz % ny, n % nz];
            let jitter = shift(0, n, 0.2 * DX);
            x.push(P::Space::from_disk([0, 1, 2].map(|a| (cell[a] as f64 + 0.5) * DX + jitter[a])));
        }
        let mut mine = Particles::<D, N>::default();
        for (n, &place) in x.iter().enumerate() {
            let here = match self.start {
                Shares::AllOnTheFirst => rank == 0,
                Shares::InTurn => n % size == rank,
            };
            if here {
                mine.key.push(key(n as u64, 0));
                mine.x.push(place);
                mine.v.push(Vector::default());
                mine.a.push(Vector::default());
                mine.stress.push(Default::default());
                mine.mass.push(1.0 + n as f64);
                mine.density.push(2600.0);
                mine.history.push(Default::default());
                mine.work.push(Default::default());
                mine.body.push(0);
            }
        }
        mine.volume = vec![0.0; mine.key.len()];
        mine.own(mine.key.len());

        let count = x.len() as u64;
        let mut simulation = Simulation::<D, N, P>::new(self.comm, self.scene, material, mine, count, Clock::default());
        simulation.periods.wrap(&mut x);
        let name = |what: &str| format!("{:?}, {size} ranks, rank {rank}, {:?}: {what}", self.scene.space, self.start);
        compare(&simulation, self.scene, &x, Age::New, &name("at the start"));

        // Far, over several ranks' boxes; then as far as particles may go before lists are built again, each rank's
        // towards those of the next.
        let furthest = 0.4999 * simulation.parameters.skin;
        for round in 1..4 {
            let before = x.clone();
            shift_all(&mut simulation, self.scene, &mut x, &before, |n| shift(round, n, 3.0 * DX));
            simulation.always_rebalance = round == 2;
            simulation.rebuild();
            simulation.periods.wrap(&mut x);
            compare(&simulation, self.scene, &x, Age::New, &name("after a migration"));

            let (built, owners) = (x.clone(), owners(&simulation, x.len()));
            for axis in (0..3).filter(|&axis| P::Space::axis(axis).is_some()) {
                let go = |n: usize| {
                    let mut by = [0.0; 3];
                    by[axis] = if (owners[n] + round) % 2 == 0 { furthest } else { -furthest };
                    by
                };
                shift_all(&mut simulation, self.scene, &mut x, &built, go);
                simulation.fill(Fields::Motion);
                compare(&simulation, self.scene, &x, Age::Old, &name("with lists about to go stale"));
            }
        }
        let before = x.clone();
        let centre = shift(7, 0, 0.05);
        shift_all(&mut simulation, self.scene, &mut x, &before, |n| {
            let place = P::Space::to_disk(before[n]);
            [0, 1, 2].map(|a| 0.3 * (centre[a].abs() - place[a]))
        });
        simulation.rebuild();
        simulation.periods.wrap(&mut x);
        compare(&simulation, self.scene, &x, Age::New, &name("pressed together"));
    }
}

/// A plane of the scene that mirrors: its axis, place and side.
type Mirror = (usize, f64, f64);

fn mirrors(scene: &Scene) -> Vec<Mirror> {
    let symmetric = [scene.symmetry[0] || scene.space == Kind::Axisymmetric, scene.symmetry[1]];
    let planes = (0..2).filter(|&axis| symmetric[axis]).map(|axis| (axis, 0.0, 1.0));
    let walls = scene.walls.iter().filter(|wall| wall.kind == WallKind::Mirror);
    planes.chain(walls.map(|wall| (wall.axis, wall.at, wall.side))).collect()
}

/// Moves all particles from where they were, the same ones the same way on all ranks; none through a mirror and none
/// deep into a wall.
fn shift_all<const D: usize, const N: usize, P: Physics<D, N>>(
    simulation: &mut Simulation<D, N, P>,
    scene: &Scene,
    x: &mut [Vector<D>],
    from: &[Vector<D>],
    shift: impl Fn(usize) -> [f64; 3],
) {
    for (n, x) in x.iter_mut().enumerate() {
        let (old, by) = (P::Space::to_disk(from[n]), shift(n));
        let mut new = [0, 1, 2].map(|a| old[a] + by[a]);
        for (axis, at, side) in mirrors(scene) {
            if side * (new[axis] - at) < 0.0 {
                new[axis] = 2.0 * at - new[axis];
            }
        }
        new[2] = new[2].max(-0.2 * DX);
        *x = simulation.periods.rounded(P::Space::from_disk(new));
    }
    let p = &mut simulation.particles;
    for i in 0..p.owned {
        p.x[i] = x[id(p.key[i]) as usize];
    }
}

/// The rank that owns each particle. Collective.
fn owners<const D: usize, const N: usize, P: Physics<D, N>>(
    simulation: &Simulation<D, N, P>,
    count: usize,
) -> Vec<u64> {
    let mut owners = vec![0u64; count];
    for &key in &simulation.particles.key[..simulation.particles.owned] {
        owners[id(key) as usize] = Reduce::rank(simulation.comm) as u64;
    }
    simulation.comm.sum(&mut owners);
    owners
}

/// Keys of all material, of its copies one period away and of all images, with their places.
fn everything<const D: usize, const N: usize, P: Physics<D, N>>(
    scene: &Scene,
    x: &[Vector<D>],
) -> Vec<(u64, Vector<D>)> {
    let mirrors = mirrors(scene);
    let mut all = Vec::new();
    for (n, &place) in x.iter().enumerate() {
        let mut open = vec![(0u16, P::Space::to_disk(place))];
        for axis in (0..3).filter(|&axis| P::Space::axis(axis).is_some()) {
            let at = |side: f64| mirrors.iter().find(|m| m.0 == axis && m.2 == side).map(|m| m.1);
            for (image, place) in open.clone() {
                let mut more = |code: u16, coordinate: f64| {
                    let mut other = place;
                    other[axis] = coordinate;
                    open.push((image | code << (3 * axis), other));
                };
                if let Some(period) = scene.periodic_axis(axis) {
                    for shift in [-period.length, period.length] {
                        more(0, place[axis] + shift);
                    }
                }
                let (low, high) = (at(1.0), at(-1.0));
                for (code, plane) in [(1, low), (2, high)] {
                    if let Some(plane) = plane {
                        more(code, 2.0 * plane - place[axis]);
                    }
                }
                if let (Some(low), Some(high)) = (low, high) {
                    more(3, place[axis] + (2.0 * low - 2.0 * high));
                    more(4, place[axis] + (2.0 * high - 2.0 * low));
                }
            }
        }
        all.extend(open.into_iter().map(|(image, place)| (key(n as u64, image), P::Space::from_disk(place))));
    }
    all
}

/// All sites behind the walls that can be near any of the material.
fn all_sites<const D: usize, const N: usize, P: Physics<D, N>>(
    scene: &Scene,
    material: &[(u64, Vector<D>)],
) -> Vec<(u64, Vector<D>)> {
    let lattice = WallLattice::new(scene);
    let along = |axis: usize| {
        let Some(a) = P::Space::axis(axis) else { return 0..1 };
        // The middle of site 0 lies half a spacing from the origin: four sites on either side are more than 2h.
        let origin = lattice.position([0; 3])[axis];
        let sites = material.iter().map(|(_, x)| ((x.0[a] - origin) / DX).floor() as i32);
        let (low, high) = sites.fold((i32::MAX, i32::MIN), |(low, high), s| (low.min(s), high.max(s)));
        low - 4..high + 5
    };
    let mut sites = Vec::new();
    for i in along(0) {
        for j in along(1) {
            for k in along(2) {
                let place = lattice.position([i, j, k]);
                if lattice.distance_of_sites(place) < 0.0 {
                    sites.push((WallLattice::id([i, j, k]), P::Space::from_disk(place)));
                }
            }
        }
    }
    sites
}

fn within<const D: usize>(all: &[(u64, Vector<D>)], x: Vector<D>, support: f64) -> BTreeSet<u64> {
    all.iter().filter(|(_, other)| (x - *other).norm2() < support * support).map(|(key, _)| *key).collect()
}

/// Of the lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Age {
    /// Particles are where they were when lists were built: lists hold all within reach, the support and the skin.
    New,
    /// Particles have moved by as much as they may, half the skin: lists hold all within the support.
    Old,
}

/// Compares what a rank has with what it should have. Collective.
fn compare<const D: usize, const N: usize, P: Physics<D, N>>(
    simulation: &Simulation<D, N, P>,
    scene: &Scene,
    x: &[Vector<D>],
    age: Age,
    name: &str,
) {
    let p = &simulation.particles;
    let (support, skin) = (2.0 * simulation.parameters.h, simulation.parameters.skin);
    let reach = if age == Age::New { support + skin } else { support };
    let material = everything::<D, N, P>(scene, x);
    let walls = all_sites::<D, N, P>(scene, &material);

    // Each particle has one owner; nothing of it was lost on the way.
    let mut owners = vec![0u64; x.len()];
    for i in 0..p.owned {
        let n = id(p.key[i]) as usize;
        owners[n] += 1;
        assert_eq!(p.mass[i], 1.0 + n as f64, "{name}");
    }
    simulation.comm.sum(&mut owners);
    let wrong = owners.iter().position(|&n| n != 1).map(|n| (n, owners[n]));
    assert_eq!(wrong, None, "{name}: a particle and the number of its owners");
    assert_eq!(p.x.len(), p.len());

    // Copies are where the particles are, each place is taken once.
    let bits = |&(key, x): &(u64, Vector<D>)| (key, x.0.map(f64::to_bits));
    let places: BTreeSet<_> = material.iter().chain(&walls).map(bits).collect();
    let mut taken = BTreeSet::new();
    for (&key, &place) in p.key.iter().zip(&p.x) {
        let place = bits(&(key, place));
        assert!(places.contains(&place), "{name}: place of {key:x}");
        assert!(taken.insert(place), "{name}: {key:x} is there twice");
    }

    // To search among: what is in reach of anything this rank sees.
    let (low, high) = bounds(&p.x[..p.owned]);
    let in_reach =
        |(_, x): &&(u64, Vector<D>)| (0..D).all(|a| (low.0[a] - x.0[a]).max(x.0[a] - high.0[a]) < 2.5 * support);
    let material: Vec<_> = material.iter().filter(in_reach).copied().collect();
    let walls: Vec<_> = walls.iter().filter(in_reach).copied().collect();

    let found = |x: Vector<D>, list: &[u32]| -> BTreeSet<u64> {
        let near = |&&j: &&u32| (x - p.x[j as usize]).norm2() < reach * reach;
        list.iter().filter(near).map(|&j| p.key[j as usize]).collect()
    };
    let (mut pairs_with_walls, mut needed_walls) = (0, BTreeSet::new());
    assert_eq!(simulation.neighbors.of_owned.len(), p.owned);
    for i in 0..p.owned {
        // Itself among them.
        let mut wanted = within(&material, p.x[i], reach);
        assert!(wanted.contains(&p.key[i]));
        let near_walls = within(&walls, p.x[i], support);
        pairs_with_walls += near_walls.len();
        wanted.extend(within(&walls, p.x[i], reach));
        needed_walls.extend(near_walls);
        let list = found(p.x[i], simulation.neighbors.of_owned.of(i));
        assert_eq!(list, wanted, "{name}: neighbours of particle {}", id(p.key[i]));
    }
    // What the wall particles that count see.
    assert_eq!(simulation.neighbors.of_wall.len(), p.len() - p.mirror);
    for wall in 0..simulation.neighbors.of_wall.len() {
        let i = p.mirror + wall;
        if needed_walls.contains(&p.key[i]) {
            let list = found(p.x[i], simulation.neighbors.of_wall.of(wall));
            assert_eq!(list, within(&material, p.x[i], reach), "{name}: material around wall site {:x}", p.key[i]);
        }
    }
    // Lists are shared by blocks: in the order of sums, each particle of the block has the list, and what is in it was near
    // one of them. From there each of the two may have moved by half the skin.
    let furthest = (support + skin + if age == Age::New { 0.0 } else { skin }) * (1.0 + 1e-12);
    for (lists, first, end) in
        [(&simulation.neighbors.of_owned, 0, p.len()), (&simulation.neighbors.of_wall, p.mirror, p.mirror)]
    {
        let mut next = 0;
        for (block, list) in lists.blocks() {
            assert_eq!(block.start, next, "{name}: blocks follow each other");
            next = block.end;
            assert!(block.clone().all(|i| std::ptr::eq(lists.of(i), list)), "{name}: the list of {block:?}");
            assert!(list.is_sorted_by_key(|&j| p.key[j as usize]), "{name}: a list is not in ascending order");
            let others: BTreeSet<u32> = list.iter().copied().collect();
            assert_eq!(others.len(), list.len(), "{name}: a particle is in a list twice");
            for &j in list {
                assert!((j as usize) < end, "{name}: a wall particle sees another");
                let distance2 = |i: usize| (p.x[first + i] - p.x[j as usize]).norm2();
                let nearest = block.clone().map(distance2).fold(f64::INFINITY, f64::min);
                assert!(nearest < furthest * furthest, "{name}: {} from {block:?} is {j}", nearest.sqrt());
            }
        }
        assert_eq!(next, lists.len(), "{name}: each particle has a list");
    }
    // Who is computed while copies are on their way needs none of them, nor anything made of them.
    let ahead = simulation.ahead();
    let needs_none = |i: usize| simulation.neighbors.of_owned.of(i).iter().all(|&j| (j as usize) < p.owned);
    assert!((0..ahead).all(needs_none), "{name}: one of the first {ahead} needs others");
    assert!(ahead == p.owned || ahead.is_multiple_of(4), "{name}: {ahead} are no whole blocks");

    let mut seen = [pairs_with_walls as u64, (p.halo - p.owned) as u64, (p.mirror - p.halo) as u64];
    simulation.comm.sum(&mut seen);
    let alone = simulation.comm.size() == 1 && scene.periodic == [None; 3];
    let wanted = [WallLattice::new(scene).has_sites(), !alone, !mirrors(scene).is_empty()];
    for (seen, wanted) in seen.into_iter().zip(wanted) {
        assert_eq!(seen > 0, wanted, "{name}: {seen:?}");
    }
}
