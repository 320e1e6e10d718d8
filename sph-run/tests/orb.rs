//! Orthogonal recursive bisection and the ways between ranks: section H of the list of verification tests.

use crate::support::{memory, under_mpi};
use sph_run::parallel::balance::changed;
use sph_run::parallel::{Bounds, Reduce, Tree, route};
use std::cell::Cell;
use std::sync::{Barrier, Mutex};

type Point = [f64; 3];
const SIZES: [usize; 8] = [1, 2, 3, 5, 7, 12, 13, 64];
const DX: f64 = 0.004;

/// Rank 0 of a group whose other ranks hold nothing, so that what it has is the result of every reduction.
struct AllOnOne {
    size: usize,
    largest_message: Cell<usize>,
}

impl AllOnOne {
    fn new(size: usize) -> Self {
        Self { size, largest_message: Cell::new(0) }
    }
    fn note<T>(&self, values: &[T]) {
        self.largest_message.set(self.largest_message.get().max(size_of_val(values)));
    }
}

impl Reduce for AllOnOne {
    fn size(&self) -> usize {
        self.size
    }
    fn rank(&self) -> usize {
        0
    }
    fn sum(&self, values: &mut [u64]) {
        self.note(values);
    }
    fn min(&self, values: &mut [f64]) {
        self.note(values);
    }
    fn max(&self, values: &mut [f64]) {
        self.note(values);
    }
}

/// One thread of a group.
struct Thread<'a> {
    rank: usize,
    barrier: &'a Barrier,
    table: &'a Mutex<Vec<Vec<u64>>>,
}

impl Thread<'_> {
    fn combine<T: Copy>(&self, values: &mut [T], bits: fn(T) -> u64, value: fn(u64) -> T, join: fn(T, T) -> T) {
        self.table.lock().unwrap()[self.rank] = values.iter().map(|&v| bits(v)).collect();
        self.barrier.wait();
        let table = self.table.lock().unwrap();
        for (i, v) in values.iter_mut().enumerate() {
            *v = table.iter().map(|row| value(row[i])).reduce(join).unwrap();
        }
        drop(table);
        self.barrier.wait();
    }
}

impl Reduce for Thread<'_> {
    fn size(&self) -> usize {
        self.table.lock().unwrap().len()
    }
    fn rank(&self) -> usize {
        self.rank
    }
    fn sum(&self, values: &mut [u64]) {
        self.combine(values, |v| v, |v| v, |a, b| a + b);
    }
    fn min(&self, values: &mut [f64]) {
        self.combine(values, f64::to_bits, f64::from_bits, f64::min);
    }
    fn max(&self, values: &mut [f64]) {
        self.combine(values, f64::to_bits, f64::from_bits, f64::max);
    }
}

/// Runs `work` on `size` threads that can reduce, and gives back their results.
fn together<T: Send>(size: usize, work: impl Fn(&Thread) -> T + Sync) -> Vec<T> {
    let (barrier, table) = (Barrier::new(size), Mutex::new(vec![Vec::new(); size]));
    std::thread::scope(|scope| {
        let (barrier, table, work) = (&barrier, &table, &work);
        let start = |rank| scope.spawn(move || work(&Thread { rank, barrier, table }));
        let threads: Vec<_> = (0..size).map(start).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}

/// Number in [0, 1) from a place in a sequence.
fn random(n: u64) -> f64 {
    let mut z = n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

fn random_point(n: u64, size: f64) -> Point {
    [0, 1, 2].map(|a| size * (2.0 * random(3 * n + a) - 1.0))
}

/// Lattice points within `radius` cells of the z axis, below `height(r)` cells.
fn heap(radius: i32, height: impl Fn(f64) -> f64) -> Vec<Point> {
    let mut points = Vec::new();
    for i in -radius..radius {
        for j in -radius..radius {
            let (x, y) = (f64::from(i) + 0.5, f64::from(j) + 0.5);
            let r = x.hypot(y);
            if r < f64::from(radius) {
                let top = height(r).round() as i32;
                points.extend((0..top).map(|k| [x * DX, y * DX, (f64::from(k) + 0.5) * DX]));
            }
        }
    }
    points
}

fn cylinder() -> Vec<Point> {
    heap(13, |_| 26.0)
}

fn deposit() -> Vec<Point> {
    heap(40, |r| 14.0 * (1.0 - r / 40.0).powf(1.5))
}

fn jittered(mut points: Vec<Point>) -> Vec<Point> {
    for (n, x) in points.iter_mut().enumerate() {
        let shift = random_point(n as u64, 0.2 * DX);
        (0..3).for_each(|a| x[a] += shift[a]);
    }
    points
}

/// Name, points, axes.
fn scenes() -> Vec<(&'static str, Vec<Point>, Vec<usize>)> {
    let (solid, plane) = (vec![0, 1, 2], vec![0, 2]);
    let uneven = (0..4000).map(|n| random_point(n, 1.0).map(|x| x * x * x * x.abs().sqrt()));
    vec![
        ("cylinder", cylinder(), solid.clone()),
        ("jittered cylinder", jittered(cylinder()), solid.clone()),
        ("deposit", deposit(), solid.clone()),
        ("jittered deposit", jittered(deposit()), solid.clone()),
        ("random", (0..5000).map(|n| random_point(n, 3.0)).collect(), solid.clone()),
        ("crowded around the origin", uneven.collect(), solid.clone()),
        ("equal x", (0..2000).map(|n| random_point(n, 1.0)).map(|[_, y, z]| [0.25, y, z]).collect(), solid.clone()),
        ("plane", (0..3000).map(|n| random_point(n, 1.0)).map(|[x, _, z]| [x, 0.0, z]).collect(), plane.clone()),
        ("line", (0..500).map(|n| [1.0, 2.0, f64::from(n)]).collect(), solid.clone()),
        ("one place", vec![[1.0, -2.0, 3.0]; 100], solid.clone()),
        ("nothing", Vec::new(), solid.clone()),
        ("three points", (0..3).map(|n| random_point(n, 1.0)).collect(), plane),
        ("two planes", (0..1000).map(|n| [random(n), random(n + 1000), f64::from(n % 10 == 0) * 5.0]).collect(), solid),
    ]
}

fn built(points: &[Point], axes: &[usize], size: usize) -> Tree {
    Tree::build(points.iter().copied(), None, axes, &AllOnOne::new(size))
}

fn counts(tree: &Tree, points: &[Point]) -> Vec<u64> {
    let mut counts = vec![0; tree.size()];
    points.iter().for_each(|&x| counts[tree.owner(x)] += 1);
    counts
}

/// For every node the points in it.
fn members(tree: &Tree, points: &[Point]) -> Vec<Vec<Point>> {
    let of = |bounds: &Bounds| points.iter().copied().filter(|&x| bounds.contains(x)).collect();
    tree.nodes().iter().map(|node| of(&node.bounds)).collect()
}

#[test]
fn h1_boxes_are_disjoint_and_cover_space() {
    for (name, points, axes) in scenes() {
        for size in SIZES {
            let tree = built(&points, &axes, size);
            let nodes = tree.nodes();
            assert_eq!((nodes.len(), tree.size()), (2 * size - 1, size), "{name}, {size} ranks");
            // Shape of the tree.
            let deepest = size.next_power_of_two().trailing_zeros() as usize;
            let mut seen = vec![0; size];
            let mut open = vec![(0, 0)];
            while let Some((k, depth)) = open.pop() {
                let node = &nodes[k];
                match node.cut {
                    Some(cut) => {
                        let [left, right] = [nodes[cut.left], nodes[cut.left + 1]];
                        assert_eq!((left.first, left.ranks), (node.first, node.ranks.div_ceil(2)));
                        assert_eq!((right.first, right.ranks), (node.first + left.ranks, node.ranks / 2));
                        assert!(axes.contains(&cut.axis));
                        assert_eq!((left.bounds.high[cut.axis], right.bounds.low[cut.axis]), (cut.at, cut.at));
                        open.extend([(cut.left, depth + 1), (cut.left + 1, depth + 1)]);
                    }
                    None => {
                        assert_eq!(node.ranks, 1);
                        assert!(depth == deepest || depth + 1 == deepest, "{name}: leaf at {depth} of {deepest}");
                        assert_eq!(tree.leaf(node.first), node.bounds);
                        seen[node.first] += 1;
                    }
                }
            }
            assert!(seen.iter().all(|&times| times == 1));
            // Boxes.
            for a in 0..size {
                let p = tree.leaf(a);
                for i in 0..3 {
                    assert!(p.low[i] <= p.high[i], "{name}: {p:?}");
                }
                for b in 0..a {
                    let q = tree.leaf(b);
                    let overlap = (0..3).all(|i| p.low[i].max(q.low[i]) < p.high[i].min(q.high[i]));
                    assert!(!overlap, "{name}: {p:?} {q:?}");
                }
            }
            let far = (0..200).map(|n| random_point(n, 10f64.powi(n as i32 % 9 - 4)));
            let corners = (0..size).flat_map(|a| [tree.leaf(a).low, tree.leaf(a).high]);
            let corners = corners.map(|x| x.map(|x| x.clamp(-1e300, 1e300)));
            for x in points.iter().copied().step_by(7).chain(far).chain(corners) {
                let holders: Vec<_> = (0..size).filter(|&a| tree.leaf(a).contains(x)).collect();
                assert_eq!(holders, [tree.owner(x)], "{name}: {x:?}");
            }
        }
    }
}

/// The best cut misses its target by at most half of the points that can't be separated.
#[test]
fn h2_cuts_meet_their_target() {
    for (name, points, axes) in scenes() {
        for size in SIZES {
            let tree = built(&points, &axes, size);
            let members = members(&tree, &points);
            for (node, here) in tree.nodes().iter().zip(&members) {
                let Some(cut) = node.cut else { continue };
                let target = here.len() as f64 * node.left_ranks() as f64 / node.ranks as f64;
                let mut along: Vec<f64> = here.iter().map(|x| x[cut.axis]).collect();
                along.sort_by(f64::total_cmp);
                // Positions are told apart to 2^-40 of the node's extent.
                let same = along.last().map_or(0.0, |last| (last - along[0]) * 0.5f64.powi(40));
                let plane = along.chunk_by(|a, b| b - a <= same).map(<[f64]>::len).max().unwrap_or(0);
                let misses = (members[cut.left].len() as f64 - target).abs();
                assert!(misses <= 0.5 * plane as f64 + 1e-9, "{name}, {size} ranks: misses {misses}, plane {plane}");
                if name.starts_with("jittered") {
                    assert!(misses <= 1.0, "{name}: {misses}");
                }
                // Across the longest extent.
                let extent = |a: usize| {
                    let ends = here.iter().fold((f64::MAX, f64::MIN), |e, x| (e.0.min(x[a]), e.1.max(x[a])));
                    ends.1 - ends.0
                };
                assert!(here.is_empty() || axes.iter().all(|&a| extent(a) <= extent(cut.axis)), "{name}");
            }
        }
    }
}

#[test]
fn h2_cuts_lie_between_lattice_planes() {
    let tree = built(&cylinder(), &[0, 1, 2], 13);
    for cut in tree.nodes().iter().filter_map(|node| node.cut) {
        let cells = cut.at / DX;
        assert!((cells - cells.round()).abs() < 1e-6, "cut at {cells} cells");
    }
}

#[test]
fn h2_weights_are_shared_out() {
    let points = jittered(cylinder());
    let weights: Vec<u64> = points.iter().map(|x| if x[2] > 13.0 * DX { 9 } else { 1 }).collect();
    for size in SIZES {
        let tree = Tree::build(points.iter().copied(), Some(&weights), &[0, 1, 2], &AllOnOne::new(size));
        let mut load = vec![0; size];
        points.iter().zip(&weights).for_each(|(&x, w)| load[tree.owner(x)] += w);
        let mean = weights.iter().sum::<u64>() as f64 / size as f64;
        assert!(load.iter().all(|&l| (l as f64 / mean - 1.0).abs() < 0.1), "{size}: {load:?}");
    }
    let light = Tree::build(points.iter().copied(), Some(&vec![0; points.len()]), &[0, 1, 2], &AllOnOne::new(5));
    assert_eq!(counts(&light, &points).iter().sum::<u64>(), points.len() as u64);
}

#[test]
fn the_tree_does_not_depend_on_who_holds_what() {
    for (name, points, axes) in scenes() {
        for size in [2, 3, 5, 13] {
            let alone = built(&points, &axes, size);
            let ways: [fn(usize, usize) -> usize; 3] =
                [|n, p| n % p, |n, p| (random(n as u64) * p as f64) as usize, |n, p| p - 1 - (n / 50) % p.min(2)];
            for way in ways {
                let trees = together(size, |comm| {
                    let mine = points.iter().enumerate().filter(|(n, _)| way(*n, size) == comm.rank());
                    Tree::build(mine.map(|(_, &x)| x), None, &axes, comm)
                });
                assert!(trees.iter().all(|tree| *tree == alone), "{name}, {size} ranks");
            }
        }
    }
    let points = deposit();
    let trees =
        together(64, |comm| Tree::build(points.iter().copied().skip(comm.rank()).step_by(64), None, &[0, 1, 2], comm));
    assert!(trees.iter().all(|tree| *tree == built(&points, &[0, 1, 2], 64)));
}

#[test]
fn messages_stay_small() {
    let (points, comm) = (jittered(deposit()), AllOnOne::new(3000));
    let tree = Tree::build(points.iter().copied(), None, &[0, 1, 2], &comm);
    assert!(comm.largest_message.get() < 256 * 1024, "{} bytes", comm.largest_message.get());
    let counts = counts(&tree, &points);
    let mean = points.len() as f64 / 3000.0;
    assert!(counts.iter().all(|&n| (n as f64 - mean).abs() < 2.5), "mean {mean}");
}

#[test]
fn neighbours_touch() {
    for (name, points, axes) in scenes() {
        for size in SIZES {
            let tree = built(&points, &axes, size);
            let adjacency = tree.adjacency();
            for a in 0..size {
                let touching = |w: f64| -> Vec<usize> {
                    (0..size).filter(|&b| b != a && tree.leaf(a).grown(w).touches(&tree.leaf(b))).collect()
                };
                assert_eq!(adjacency[a], touching(0.0), "{name}, {size} ranks");
                assert_eq!(tree.within(a, 2.4 * DX), touching(2.4 * DX));
                assert!(adjacency[a].iter().all(|&b| adjacency[b].contains(&a)));
            }
        }
    }
}

/// Both ends of a periodic axis are one place: the way around may be the shorter one.
#[test]
fn ends_of_periodic_axes_touch() {
    let line: Vec<Point> = (0..500).map(|n| [f64::from(n), 0.0, 0.0]).collect();
    let open = built(&line, &[0, 2], 8);
    assert_eq!(route::eccentricity(&open, 0), 7);
    let closed = open.with_periods([true, false, false]);
    assert_eq!(closed.neighbours(0), [1, 7]);
    assert_eq!(closed.neighbours(3), [2, 4]);
    assert_eq!(route::eccentricity(&closed, 0), 4);
    // Two axes: a corner box touches the other three corners.
    let square: Vec<Point> = (0..900).map(|n| [f64::from(n % 30), f64::from(n / 30), 0.0]).collect();
    let tree = built(&square, &[0, 1, 2], 16);
    let corner = |x: [f64; 2]| tree.owner([29.0 * x[0], 29.0 * x[1], 0.0]);
    let closed = tree.clone().with_periods([true, true, false]);
    let beside = closed.neighbours(corner([0.0, 0.0]));
    for other in [[0.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
        assert!(beside.contains(&corner(other)), "{other:?}: {beside:?}");
    }
    assert!(tree.neighbours(corner([0.0, 0.0])).len() < beside.len());
}

/// Everything starts on one rank and goes from neighbour to neighbour until it is home.
#[test]
fn h3_diffusion_brings_all_home() {
    for (name, points, axes) in scenes() {
        for size in SIZES {
            let tree = built(&points, &axes, size);
            let adjacency = tree.adjacency();
            let hops: Vec<_> = (0..size).map(|me| route::next_hop(&tree, me)).collect();
            let diameter = (0..size).map(|me| route::eccentricity(&tree, me)).max().unwrap();
            for start in [0, size - 1, size / 2] {
                let mut held = vec![Vec::new(); size];
                held[start] = (0..points.len()).collect();
                let mut rounds = 0;
                while held.iter().enumerate().any(|(me, ids)| ids.iter().any(|&id| tree.owner(points[id]) != me)) {
                    let mut arrived = vec![Vec::new(); size];
                    for (me, ids) in held.iter().enumerate() {
                        for &id in ids {
                            let next = hops[me][tree.owner(points[id])] as usize;
                            assert!(next == me || adjacency[me].contains(&next));
                            arrived[next].push(id);
                        }
                    }
                    held = arrived;
                    rounds += 1;
                    assert_eq!(held.iter().map(Vec::len).sum::<usize>(), points.len());
                    let ids: usize = held.iter().flatten().sum();
                    assert_eq!(ids, points.len() * points.len().saturating_sub(1) / 2);
                    assert!(rounds <= diameter, "{name}, {size} ranks: more than {diameter} rounds");
                }
                for (me, ids) in held.iter().enumerate() {
                    assert!(ids.iter().all(|&id| tree.leaf(me).contains(points[id])));
                }
            }
        }
    }
}

#[test]
fn h6_trigger_and_balance() {
    assert!(!changed(100, 105) && !changed(100, 95) && changed(100, 106) && changed(100, 94));
    assert!(!changed(0, 0) && changed(0, 1) && changed(1, 0));
    for size in SIZES {
        let (before, after) = (jittered(cylinder()), jittered(deposit()));
        let mut tree = built(&before, &[0, 1, 2], size);
        let ratio = |tree: &Tree, points: &[Point]| {
            *counts(tree, points).iter().max().unwrap() as f64 * size as f64 / points.len() as f64
        };
        assert!(ratio(&tree, &before) < 1.1, "cylinder, {size} ranks: {}", ratio(&tree, &before));
        let (then, now) = (counts(&tree, &before), counts(&tree, &after));
        assert!(size == 1 || then.iter().zip(now).any(|(&then, now)| changed(then, now)));
        tree = built(&after, &[0, 1, 2], size);
        assert!(ratio(&tree, &after) < 1.1, "deposit, {size} ranks: {}", ratio(&tree, &after));
    }
}

/// While a column spreads, its pieces stay where they are cut; only what has become half as long again the other way is
/// cut across another axis. (Anew each time, single columns more or less turn the cuts of whole regions.)
#[test]
fn axes_are_kept_while_the_material_moves() {
    let axes = |tree: &Tree| tree.nodes().iter().map(|node| node.cut.map(|cut| cut.axis)).collect::<Vec<_>>();
    let stretched =
        |by: f64| -> Vec<Point> { jittered(cylinder()).into_iter().map(|[x, y, z]| [x * by, y, z / by]).collect() };
    let moved = |before: &Tree, after: &Tree, points: &[Point]| {
        points.iter().filter(|&&x| before.owner(x) != after.owner(x)).count() as f64 / points.len() as f64
    };
    for size in [2, 5, 7, 13, 64] {
        let (mut kept, mut anew) = (built(&stretched(1.0), &[0, 1, 2], size), built(&stretched(1.0), &[0, 1, 2], size));
        let (mut sent, mut sent_anew, first) = (0.0, 0.0, axes(&kept));
        for step in 1..=6 {
            let points = stretched(1.0 + 0.03 * f64::from(step));
            let next = kept.rebuilt(points.iter().copied(), None, &[0, 1, 2], &AllOnOne::new(size));
            let next_anew = built(&points, &[0, 1, 2], size);
            assert_eq!(axes(&next), first, "{size} ranks, step {step}");
            let most = *counts(&next, &points).iter().max().unwrap() as f64 * size as f64 / points.len() as f64;
            assert!(most < 1.1, "{size} ranks, step {step}: {most}");
            sent += moved(&kept, &next, &points);
            sent_anew += moved(&anew, &next_anew, &points);
            (kept, anew) = (next, next_anew);
        }
        assert!(sent <= sent_anew, "{size} ranks: {sent} of the particles change owner, {sent_anew} with axes anew");
        // Flat as a pancake: no axis is kept that would cut it into needles.
        let flat: Vec<Point> = stretched(1.0).into_iter().map(|[x, y, z]| [x, y, 0.01 * z]).collect();
        let tall: Vec<Point> = flat.iter().map(|&[x, y, z]| [z, y, x]).collect();
        let turned =
            built(&flat, &[0, 1, 2], size).rebuilt(tall.iter().copied(), None, &[0, 1, 2], &AllOnOne::new(size));
        assert!(turned.nodes().iter().filter_map(|node| node.cut).all(|cut| cut.axis != 0), "{size} ranks");
        // Of another number of ranks nothing is kept.
        let other = kept.rebuilt(flat.iter().copied(), None, &[0, 1, 2], &AllOnOne::new(size + 1));
        assert_eq!(other, built(&flat, &[0, 1, 2], size + 1));
    }
}

/// The memory that a rank needs for the scheme itself, whatever it owns: what is stated is what is taken.
#[test]
fn the_scheme_takes_less_than_a_mebibyte_on_4096_ranks() {
    let points: Vec<Point> = (0..64).map(|n| random_point(n, 1.0)).collect();
    for ranks in [5, 700, 4096] {
        let comm = AllOnOne::new(ranks);
        let (taken, tree) = memory::most(|| Tree::build(points.iter().copied(), None, &[0, 1, 2], &comm));
        // What the reductions of MPI copy comes on top.
        let (copied, stated) = (comm.largest_message.get(), Tree::bytes_to_build(ranks));
        assert!(taken + copied <= stated, "{ranks} ranks: {taken} and {copied} of {stated}");
        assert!(
            2 * (taken + copied) + 100_000 > stated,
            "{ranks} ranks: {stated} is not what {taken} and {copied} are"
        );
        let (home, _) = memory::most(|| route::next_hop(&tree, ranks / 2));
        assert!(home < 300_000, "{ranks} ranks: {home}");
        // The tree before, the new one and all it takes meanwhile.
        assert!(tree.bytes() + stated < 1 << 20, "{ranks} ranks: {} and {stated}", tree.bytes());
    }
}

/// The same tree over MPI: the test starts itself again under mpirun.
#[test]
fn over_mpi() {
    let Some(universe) = under_mpi("orb::over_mpi", &[1, 2, 3, 5]) else { return };
    let points = jittered(cylinder());
    let comm = universe.world();
    let (rank, size) = (Reduce::rank(&comm), Reduce::size(&comm));
    let tree = Tree::build(points.iter().copied().skip(rank).step_by(size), None, &[0, 1, 2], &comm);
    assert_eq!(tree, built(&points, &[0, 1, 2], size));
    let mut values = [rank as f64, -(rank as f64)];
    Reduce::max(&comm, &mut values);
    assert_eq!(values, [size as f64 - 1.0, 0.0]);
}
