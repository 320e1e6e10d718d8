//! A partition as all ranks of a run would find it, made on one: boxes by [`Tree`], copies by [`copies_for`], images and wall
//! sites by the functions of the boundaries. Nothing here decides anything; it counts.

use crate::algebra::Vector;
use crate::boundary::field::Field;
use crate::boundary::mirror::Mirrors;
use crate::boundary::periodic::Periods;
use crate::boundary::wall::Walls;
use crate::neighbors::bounds;
use crate::parallel::halo::{Fields, copies_for};
use crate::parallel::{Reduce, Tree};
use crate::particles::Particles;
use crate::simulation::SKIN;
use crate::space::{Axisymmetric, PlaneStrain, Space, ThreeD};
use formats::scene::{Material, Scene, ViscousOperator, WallLattice};
use formats::space::Space as Kind;

/// A group of ranks of which the first holds everything: what it has is the result of every reduction.
#[derive(Clone, Copy, Debug)]
pub struct AllOnOne(pub usize);

impl Reduce for AllOnOne {
    fn size(&self) -> usize {
        self.0
    }
    fn rank(&self) -> usize {
        0
    }
    fn sum(&self, _: &mut [u64]) {}
    fn min(&self, _: &mut [f64]) {}
    fn max(&self, _: &mut [f64]) {}
}

/// What one rank has, and what it exchanges in one refresh of its halo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Load {
    /// Particles of its own.
    pub owned: u64,
    /// Copies of others' (across periodic borders of its own, too).
    pub copies: u64,
    /// Copies it sends.
    pub sent: u64,
    /// Images of its own particles.
    pub images: u64,
    /// Wall particles.
    pub walls: u64,
    /// Ranks it exchanges with.
    pub peers: u64,
    /// Messages it sends, those without a particle left out.
    pub messages: u64,
}

/// All ranks of a partition.
#[derive(Clone, Debug)]
pub struct Partition {
    pub loads: Vec<Load>,
    /// Levels of the tree below its root.
    pub levels: usize,
    /// Wall particles, each counted once.
    pub walls: u64,
    /// u64 words of a particle in each exchange of a step, in the order of the step.
    pub exchanges: Vec<usize>,
    /// Memory of the scheme on the rank with most peers, beyond particles and copies, bytes.
    pub scheme_bytes: u64,
    /// Memory on every rank of Yang et al.'s particle-in-cell matrix for the same particles: cells of one smoothing length over
    /// the box around all of them, four bytes each.
    pub matrix_bytes: u64,
    /// What of the invariants does not hold; empty.
    pub faults: Vec<String>,
}

impl Partition {
    /// Of particles of a scene on that many ranks.
    pub fn of(scene: &Scene, points: &[[f64; 3]], ranks: usize) -> Self {
        match scene.space {
            Kind::PlaneStrain => counted::<2, 4, PlaneStrain>(scene, points, ranks),
            Kind::Axisymmetric => counted::<2, 4, Axisymmetric>(scene, points, ranks),
            Kind::ThreeD => counted::<3, 6, ThreeD>(scene, points, ranks),
        }
    }

    /// Where each particle stood for `weight`. Wall sites are where they are, and messages as many.
    pub fn weighed(mut self, weight: f64) -> Self {
        for load in &mut self.loads {
            for count in [&mut load.owned, &mut load.copies, &mut load.sent, &mut load.images] {
                *count = (*count as f64 * weight).round() as u64;
            }
        }
        self
    }

    /// Sum of something over the ranks.
    pub fn sum(&self, of: impl Fn(&Load) -> u64) -> u64 {
        self.loads.iter().map(of).sum()
    }

    /// Its largest value.
    pub fn most(&self, of: impl Fn(&Load) -> u64) -> u64 {
        self.loads.iter().map(of).max().unwrap_or(0)
    }

    /// Its mean.
    pub fn mean(&self, of: impl Fn(&Load) -> u64) -> f64 {
        self.sum(of) as f64 / self.loads.len() as f64
    }

    /// Largest number of owned particles over the mean.
    pub fn imbalance(&self) -> f64 {
        self.most(|load| load.owned) as f64 / self.mean(|load| load.owned)
    }

    /// Copies over owned particles, of all ranks together.
    pub fn halo_share(&self) -> f64 {
        self.sum(|load| load.copies) as f64 / self.sum(|load| load.owned) as f64
    }

    /// Bytes of a copied particle in a step.
    pub fn bytes_per_copy(&self) -> u64 {
        8 * self.exchanges.iter().sum::<usize>() as u64
    }
}

/// u64 words of a particle in each exchange of a step.
fn exchanges<const D: usize, const N: usize>(scene: &Scene) -> Vec<usize> {
    let words = |fields: Fields| {
        let mut words = 0;
        fields.visit(&mut Particles::<D, N>::default(), |field| {
            words += match field {
                Field::Scalar(_) => 1,
                Field::Place(_) | Field::Velocity(_) => D,
                Field::Stress(_) => N,
            }
        });
        words
    };
    let numerics = &scene.numerics;
    let between_particles = matches!(&scene.material, Material::ViscoPlastic(law)
        if matches!(law.operator, ViscousOperator::Arithmetic | ViscousOperator::Harmonic));
    // In the order of `step`.
    let asked = [
        (true, vec![words(Fields::Motion)]),
        (numerics.stress_diffusion > 0.0, vec![words(Fields::Stress)]),
        (numerics.gradient_correction, vec![D * D]),
        (numerics.density_diffusion > 0.0, vec![1, D]),
        (numerics.stress_diffusion > 0.0, vec![N * D]),
        (true, vec![words(Fields::Stress)]),
        (between_particles, vec![1]),
        (numerics.shifting > 0.0, vec![1]),
    ];
    asked.into_iter().filter(|(asked, _)| *asked).flat_map(|(_, words)| words).collect()
}

fn counted<const D: usize, const N: usize, S: Space<D, N>>(
    scene: &Scene,
    points: &[[f64; 3]],
    ranks: usize,
) -> Partition {
    let axes = scene.space.axes();
    let periodic = scene.periodic.map(|ends| ends.is_some());
    let tree = Tree::build(points.iter().copied(), None, axes, &AllOnOne(ranks)).with_periods(periodic);

    // Particles by their owners.
    let owners: Vec<u32> = points.iter().map(|&x| tree.owner(x) as u32).collect();
    let mut starts = vec![0usize; ranks + 1];
    owners.iter().for_each(|&owner| starts[owner as usize + 1] += 1);
    (0..ranks).for_each(|rank| starts[rank + 1] += starts[rank]);
    let (mut next, mut order) = (starts.clone(), vec![0u32; points.len()]);
    for (i, &owner) in owners.iter().enumerate() {
        order[next[owner as usize]] = i as u32;
        next[owner as usize] += 1;
    }
    drop(owners);
    let members = |rank: usize| order[starts[rank]..starts[rank + 1]].iter().map(|&i| points[i as usize]);
    let places = |rank: usize| members(rank).map(|x| S::from_disk(x)).collect::<Vec<Vector<D>>>();
    let boxes: Vec<_> = (0..ranks)
        .map(|rank| {
            let x = places(rank);
            (!x.is_empty()).then(|| bounds(&x))
        })
        .collect();

    let reach = (2.0 + SKIN) * scene.h();
    let mut walls = Walls::new(WallLattice::new(scene), scene.spacing.powi(D as i32));
    let (reach_of, widest) = walls.reaches::<D, N, S>(reach);
    let shifts = Periods::<D>::new::<N, S>(scene).shifts();
    let mut mirrors = Mirrors::<D, N>::new::<S>(scene);
    let mut loads = vec![Load::default(); ranks];
    let mut sites: Vec<u64> = Vec::new();
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    for me in 0..ranks {
        let mut p = Particles::<D, N> { x: places(me), ..Particles::default() };
        let by_reach: Vec<f64> = p.x.iter().map(|&x| reach_of(x)).collect();
        for (peer, copies) in copies_for(me, &boxes, &p.x, &by_reach, &shifts, widest) {
            loads[me].peers += 1;
            loads[me].sent += copies.len() as u64;
            loads[me].messages += u64::from(!copies.is_empty());
            loads[peer].copies += copies.len() as u64;
            pairs.push((me as u32, peer as u32));
        }
        let owned = p.x.len();
        p.key = vec![0; owned];
        p.own(owned);
        mirrors.create(&mut p, &reach_of);
        walls.create::<D, N, S>(&mut p, reach);
        sites.extend(&p.key[p.mirror..]);
        loads[me].owned = owned as u64;
        loads[me].images = (p.mirror - owned) as u64;
        loads[me].walls = (p.len() - p.mirror) as u64;
    }
    sites.sort_unstable();
    sites.dedup();

    let mut faults = faults(&tree, points.len() as u64, &loads);
    let strays = (0..ranks).map(|rank| {
        let bounds = tree.leaf(rank);
        members(rank).filter(|&x| !bounds.contains(x)).count()
    });
    let strays: usize = strays.sum();
    if strays > 0 {
        faults.push(format!("{strays} particles lie outside their owner's box"));
    }
    // Sorted as they were found.
    if pairs.iter().any(|&(a, b)| pairs.binary_search(&(b, a)).is_err()) {
        faults.push("a peer does not name the rank that names it".into());
    }
    let all: Vec<Vector<D>> = boxes.iter().flatten().flat_map(|(low, high)| [*low, *high]).collect();
    let (low, high) = bounds(&all);
    let cells: f64 = (0..D).map(|a| ((high.0[a] - low.0[a]) / scene.h()).ceil().max(1.0)).product();
    let most_peers = loads.iter().map(|load| load.peers).max().unwrap_or(0);
    Partition {
        loads,
        levels: tree.levels(),
        walls: sites.len() as u64,
        exchanges: exchanges::<D, N>(scene),
        scheme_bytes: scheme_bytes::<D>(&tree, most_peers as usize) as u64,
        matrix_bytes: 4 * cells as u64,
        faults,
    }
}

/// Section H of the list of verification tests, rows 1 and 3.
fn faults(tree: &Tree, count: u64, loads: &[Load]) -> Vec<String> {
    let (nodes, ranks) = (tree.nodes(), tree.size());
    let mut faults = Vec::new();
    if nodes.len() != 2 * ranks - 1 {
        faults.push(format!("{} nodes", nodes.len()));
    }
    let deepest = ranks.next_power_of_two().trailing_zeros() as usize;
    let (mut open, mut seen) = (vec![(0, 0)], vec![0; ranks]);
    while let Some((k, depth)) = open.pop() {
        match nodes[k].cut {
            Some(cut) => {
                let (left, right) = (&nodes[cut.left], &nodes[cut.left + 1]);
                if (left.ranks, right.ranks) != (nodes[k].left_ranks(), nodes[k].ranks / 2) {
                    faults.push(format!("node {k} shares {} ranks out as {}", nodes[k].ranks, left.ranks));
                }
                if (left.bounds.high[cut.axis], right.bounds.low[cut.axis]) != (cut.at, cut.at) {
                    faults.push(format!("the boxes below node {k} do not meet"));
                }
                open.extend([(cut.left, depth + 1), (cut.left + 1, depth + 1)]);
            }
            None => {
                seen[nodes[k].first] += 1;
                if depth != deepest && depth + 1 != deepest {
                    faults.push(format!("a leaf on level {depth} of {deepest}"));
                }
            }
        }
    }
    if seen.iter().any(|&leaves| leaves != 1) || tree.levels() != deepest {
        faults.push("not one leaf for each rank".into());
    }
    let owned: u64 = loads.iter().map(|load| load.owned).sum();
    if owned != count {
        faults.push(format!("{owned} of {count} particles are owned"));
    }
    let (sent, received) = loads.iter().fold((0, 0), |(s, r), load| (s + load.sent, r + load.copies));
    if sent != received {
        faults.push(format!("{sent} copies are sent and {received} received"));
    }
    faults
}

/// Memory of the scheme on one rank that does not grow with its particles, bytes: the most of what is there at once when
/// boxes are cut, when particles go home, and when the halo is planned; and of the halo what its peers take.
fn scheme_bytes<const D: usize>(tree: &Tree, peers: usize) -> usize {
    let ranks = tree.size();
    // A rank's way home, and the queue and the lists of its search; the way from a rank to its peer.
    let going_home = ranks * (size_of::<u32>() + size_of::<usize>() * 2) + 64 * peers;
    // The boxes around the particles of all ranks, as numbers and as boxes.
    let boxes = ranks * ((1 + 2 * D) * size_of::<f64>() + size_of::<Option<crate::parallel::halo::Box<D>>>());
    // Number and list of what goes to a peer, number of what comes, their two requests, twice for growing lists.
    let halo = 2 * peers * 160;
    tree.bytes() + Tree::bytes_to_build(ranks).max(going_home).max(boxes) + halo
}
