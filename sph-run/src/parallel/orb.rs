//! Orthogonal recursive bisection: space is cut into one box a rank, each with its share of the particles
//! (Yang et al. 2020, section 3).
//!
//! The authors bisect a global matrix of particle counts per cell, held by every rank. Here no rank sees more than
//! a histogram of the nodes on one level, summed over the ranks and refined inside the bin the cut falls into, until
//! particles that still share a bin lie within 2^-40 of the node's extent. The sums are integers, so every rank finds
//! the same tree, and the tree does not depend on which rank holds which particle.

use super::Reduce;

/// Bits of a histogram's bin number. Few: what travels through a build grows as 2^BITS/BITS, 5 MB at 4096 ranks.
const BITS: u32 = 4;
const BINS: usize = 1 << BITS;
/// Refinements of a histogram: positions are told apart to 2^-(BITS PASSES) of the node's extent.
const PASSES: u32 = 10;
/// Nodes treated at once: 64 KiB of histograms.
const CHUNK: usize = 512;
/// A node cut before is cut across the same axis again unless its points are so many times longer along another: what
/// turns its cuts sends nearly everything elsewhere.
const KEEP: f64 = 1.5;
const NOT_HERE: u32 = u32::MAX;

/// An axis-parallel box: `low <= x < high`. Its faces may lie at infinity; a box with `low == high` holds nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lower corner, m; belongs to the box.
    pub low: [f64; 3],
    /// Upper corner, m; does not.
    pub high: [f64; 3],
}

impl Bounds {
    /// All of space.
    pub const EVERYWHERE: Self = Self { low: [f64::NEG_INFINITY; 3], high: [f64::INFINITY; 3] };

    /// Is the point inside?
    pub fn contains(&self, x: [f64; 3]) -> bool {
        (0..3).all(|a| self.low[a] <= x[a] && x[a] < self.high[a])
    }

    /// Do the closed boxes have a point in common?
    pub fn touches(&self, other: &Self) -> bool {
        (0..3).all(|a| self.low[a] <= other.high[a] && other.low[a] <= self.high[a])
    }

    /// The box, `width` larger on every side, m.
    pub fn grown(&self, width: f64) -> Self {
        Self { low: self.low.map(|x| x - width), high: self.high.map(|x| x + width) }
    }
}

/// A plane that divides a node: `x[axis] < at` belongs to `nodes[left]`, the rest to `nodes[left + 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Axis the plane is normal to.
    pub axis: usize,
    /// Its place, m.
    pub at: f64,
    /// The left child.
    pub left: usize,
}

/// A node of the tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Its box.
    pub bounds: Bounds,
    /// The lowest of its ranks.
    pub first: usize,
    /// How many ranks share it.
    pub ranks: usize,
    /// How it is divided; none for a leaf.
    pub cut: Option<Cut>,
}

impl Node {
    /// Ranks that go to the left child: the lowest ceil(p/2).
    pub fn left_ranks(&self) -> usize {
        self.ranks.div_ceil(2)
    }
}

/// The 2p - 1 boxes of p ranks, the same on every rank. In 24 bytes a node: boxes follow from the cuts.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    /// Level by level.
    nodes: Vec<Stored>,
    /// Axes whose two ends at infinity are the same place.
    pub periodic: [bool; 3],
}

/// What is kept of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stored {
    first: u32,
    ranks: u32,
    /// The plane it is cut along; of a leaf these mean nothing.
    axis: u32,
    left: u32,
    at: f64,
}

impl Stored {
    fn leaf(first: u32, ranks: u32) -> Self {
        Self { first, ranks, axis: 0, left: 0, at: 0.0 }
    }

    fn cut(&self) -> Option<Cut> {
        (self.left > 0).then_some(Cut { axis: self.axis as usize, at: self.at, left: self.left as usize })
    }
}

impl Tree {
    /// Cuts space so that every rank has its share of the points' weight. Collective.
    ///
    /// - `points`: this rank's points, m; gone through several times a level;
    /// - `weights`: one a point; all the same where there are none;
    /// - `axes`: those of the space, in which cuts are made.
    ///
    /// A node is cut across the longest extent of its points (the first of equals), where the weight to the left comes
    /// closest to the left ranks' share. Points that share a coordinate are never separated by a cut across it. The
    /// plane lies midway between the points on its two sides.
    pub fn build<P>(points: P, weights: Option<&[u64]>, axes: &[usize], comm: &impl Reduce) -> Self
    where
        P: Iterator<Item = [f64; 3]> + Clone,
    {
        Self::build_after(None, points, weights, axes, comm)
    }

    /// [`Tree::build`] where the points have moved: a node keeps the axis it was cut across, as Yang et al. do, unless
    /// its points are now half as long again along another. Most points then stay where they are. Collective.
    pub fn rebuilt<P>(&self, points: P, weights: Option<&[u64]>, axes: &[usize], comm: &impl Reduce) -> Self
    where
        P: Iterator<Item = [f64; 3]> + Clone,
    {
        let before = (self.size() == comm.size()).then_some(self);
        Self { periodic: self.periodic, ..Self::build_after(before, points, weights, axes, comm) }
    }

    fn build_after<P>(
        before: Option<&Self>,
        points: P,
        weights: Option<&[u64]>,
        axes: &[usize],
        comm: &impl Reduce,
    ) -> Self
    where
        P: Iterator<Item = [f64; 3]> + Clone,
    {
        let mut tree = Self { nodes: Vec::with_capacity(2 * comm.size() - 1), periodic: [false; 3] };
        tree.nodes.push(Stored::leaf(0, comm.size() as u32));
        let mut place = vec![0u32; points.clone().count()];
        let weight = |i: usize| weights.map_or(1, |w| w[i]);
        let mut level = 0..1;
        while !level.is_empty() {
            let parents: Vec<usize> = level.clone().filter(|&k| tree.nodes[k].ranks > 1).collect();
            for chunk in parents.chunks(CHUNK) {
                // Position in the chunk of every node of the level.
                let mut slot = vec![NOT_HERE; level.len()];
                for (s, &k) in chunk.iter().enumerate() {
                    slot[k - level.start] = s as u32;
                }
                let members = points.clone().zip(&place).enumerate().filter_map(|(i, (x, &k))| {
                    let s = *slot.get((k as usize).wrapping_sub(level.start))?;
                    (s != NOT_HERE).then(|| Member { slot: s as usize, x, weight: weight(i) })
                });
                // The shape of a tree follows from the number of ranks: a node has the same number in both.
                let kept = |k: usize| before.and_then(|tree| tree.nodes[k].cut()).map(|cut| cut.axis);
                let planes = planes(&tree, chunk, members, axes, kept, comm);
                for (&k, (axis, at)) in chunk.iter().zip(planes) {
                    let left = tree.nodes.len() as u32;
                    let parent = &mut tree.nodes[k];
                    *parent = Stored { axis: axis as u32, left, at, ..*parent };
                    let (parent, share) = (*parent, parent.ranks.div_ceil(2));
                    tree.nodes.push(Stored::leaf(parent.first, share));
                    tree.nodes.push(Stored::leaf(parent.first + share, parent.ranks - share));
                }
            }
            for (x, k) in points.clone().zip(&mut place) {
                // Points on leaves stay where they are.
                if let Some(cut) = tree.nodes[*k as usize].cut() {
                    *k = child(&cut, x) as u32;
                }
            }
            level = level.end..tree.nodes.len();
        }
        tree
    }

    /// The same boxes where some axes are periodic: those at both ends are neighbours.
    pub fn with_periods(self, periodic: [bool; 3]) -> Self {
        Self { periodic, ..self }
    }

    /// Number of ranks.
    pub fn size(&self) -> usize {
        self.nodes[0].ranks as usize
    }

    /// All nodes, level by level.
    pub fn nodes(&self) -> Vec<Node> {
        let node = |stored: &Stored| Node {
            bounds: Bounds::EVERYWHERE,
            first: stored.first as usize,
            ranks: stored.ranks as usize,
            cut: stored.cut(),
        };
        let mut nodes: Vec<Node> = self.nodes.iter().map(node).collect();
        for k in 0..nodes.len() {
            let Node { bounds, cut: Some(Cut { axis, at, left }), .. } = nodes[k] else { continue };
            nodes[left].bounds = bounds;
            nodes[left + 1].bounds = bounds;
            nodes[left].bounds.high[axis] = at;
            nodes[left + 1].bounds.low[axis] = at;
        }
        nodes
    }

    /// Levels below the root.
    pub fn levels(&self) -> usize {
        let (mut levels, mut k) = (0, 0);
        // No way is longer than that to the lowest ranks.
        while let Some(cut) = self.nodes[k].cut() {
            (levels, k) = (levels + 1, cut.left);
        }
        levels
    }

    /// The memory it takes, bytes.
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.nodes.capacity() * size_of::<Stored>()
    }

    /// The most memory that [`Tree::build`] takes for so many ranks, the new tree included, bytes: beside what it keeps of each
    /// point, and beside what the reductions copy, which is at most 64 KiB.
    pub fn bytes_to_build(ranks: usize) -> usize {
        let chunk = CHUNK.min(ranks);
        let of_chunk = size_of::<Search>() + (BINS + 1) * size_of::<u64>() + 8 * size_of::<f64>() + 32;
        // Of a level: its parents and their positions in the chunk.
        let of_level = size_of::<usize>() + 2 * size_of::<u32>();
        2 * ranks * size_of::<Stored>() + chunk * of_chunk + ranks * of_level + 64 * 1024
    }

    /// The rank whose box holds the point; unique.
    pub fn owner(&self, x: [f64; 3]) -> usize {
        let mut node = &self.nodes[0];
        while let Some(cut) = node.cut() {
            node = &self.nodes[child(&cut, x)];
        }
        node.first as usize
    }

    /// The box of a rank.
    pub fn leaf(&self, rank: usize) -> Bounds {
        self.bounds(rank, 1)
    }

    /// The box of the node with these ranks.
    fn bounds(&self, first: usize, ranks: usize) -> Bounds {
        let (mut bounds, mut node) = (Bounds::EVERYWHERE, &self.nodes[0]);
        while node.ranks as usize > ranks {
            let Some(Cut { axis, at, left }) = node.cut() else { break };
            if first < self.nodes[left + 1].first as usize {
                bounds.high[axis] = at;
                node = &self.nodes[left];
            } else {
                bounds.low[axis] = at;
                node = &self.nodes[left + 1];
            }
        }
        bounds
    }

    /// The ranks whose closed boxes touch `bounds`, ascending.
    pub fn touching(&self, bounds: &Bounds) -> Vec<usize> {
        let (mut found, mut open) = (Vec::new(), vec![0]);
        while let Some(k) = open.pop() {
            let node = &self.nodes[k];
            let Some(Cut { axis, at, left }) = node.cut() else {
                found.push(node.first as usize);
                continue;
            };
            if at <= bounds.high[axis] {
                open.push(left + 1);
            }
            if bounds.low[axis] <= at {
                open.push(left);
            }
        }
        found
    }

    /// The ranks whose closed boxes touch that of `rank`, also across the ends of periodic axes, ascending, without
    /// itself.
    pub fn neighbours(&self, rank: usize) -> Vec<usize> {
        let mut places = vec![self.leaf(rank)];
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            for place in places.clone() {
                for (end, other) in [(place.low[axis], f64::INFINITY), (place.high[axis], f64::NEG_INFINITY)] {
                    if end == -other {
                        let mut beyond = place;
                        (beyond.low[axis], beyond.high[axis]) = (other, other);
                        places.push(beyond);
                    }
                }
            }
        }
        let mut found: Vec<usize> = places.iter().flat_map(|place| self.touching(place)).collect();
        found.sort_unstable();
        found.dedup();
        found.retain(|&other| other != rank);
        found
    }

    /// The ranks whose boxes come within `width` of that of `rank` along every axis, ascending, without itself:
    /// all that a halo of that width can reach, be the boxes between them ever so thin.
    pub fn within(&self, rank: usize, width: f64) -> Vec<usize> {
        let mut found = self.touching(&self.leaf(rank).grown(width));
        found.retain(|&other| other != rank);
        found
    }

    /// [`Tree::neighbours`] of every rank.
    pub fn adjacency(&self) -> Vec<Vec<usize>> {
        (0..self.size()).map(|rank| self.neighbours(rank)).collect()
    }
}

fn child(cut: &Cut, x: [f64; 3]) -> usize {
    if x[cut.axis] < cut.at { cut.left } else { cut.left + 1 }
}

/// A point of one of the nodes being cut.
struct Member {
    slot: usize,
    x: [f64; 3],
    weight: u64,
}

/// Search for one cut.
#[derive(Clone, Copy)]
struct Search {
    axis: usize,
    low: f64,
    /// Keys per metre; zero where all points coincide.
    scale: f64,
    /// Ranks to the left, ranks, and the weight they share.
    share: (u64, u64, u64),
    /// Leading bits of the key sought.
    prefix: u64,
    /// Weight of the smaller keys.
    below: u64,
    /// The first key to the right, once it is known.
    threshold: Option<u64>,
}

impl Search {
    /// Position along the axis as an integer of BITS PASSES bits; never falls where x rises.
    fn key(&self, x: [f64; 3]) -> u64 {
        let last = (1u64 << (BITS * PASSES)) - 1;
        (((x[self.axis] - self.low) * self.scale) as u64).min(last)
    }

    /// `weight` minus the left ranks' share of the weight, times the number of ranks.
    fn excess(&self, weight: u64) -> i128 {
        let (left, ranks, total) = self.share;
        i128::from(weight) * i128::from(ranks) - i128::from(total) * i128::from(left)
    }

    /// Goes into the bin that takes the weight to or over the share; `shift` bits are left to find.
    fn descend(&mut self, histogram: &[u64], shift: u32) {
        for (bin, &weight) in histogram.iter().enumerate() {
            let key = self.prefix << BITS | bin as u64;
            let (short, over) = (self.excess(self.below), self.excess(self.below + weight));
            if over < 0 {
                self.below += weight;
                continue;
            }
            if over == 0 {
                self.threshold = Some((key + 1) << shift);
            } else if shift == 0 {
                self.threshold = Some(if -short <= over { key } else { key + 1 });
            }
            self.prefix = key;
            return;
        }
    }
}

/// Axis and place of the cuts through `chunk`, in its order. `kept`: the axis a node was cut across before.
fn planes(
    tree: &Tree,
    chunk: &[usize],
    members: impl Iterator<Item = Member> + Clone,
    axes: &[usize],
    kept: impl Fn(usize) -> Option<usize>,
    comm: &impl Reduce,
) -> Vec<(usize, f64)> {
    // Weights and tight boxes; maxima travel as minima of the negative.
    let mut totals = vec![0u64; chunk.len()];
    let mut extents = vec![f64::INFINITY; 6 * chunk.len()];
    for m in members.clone() {
        totals[m.slot] += m.weight;
        let extent = &mut extents[6 * m.slot..][..6];
        for a in 0..3 {
            extent[a] = extent[a].min(m.x[a]);
            extent[3 + a] = extent[3 + a].min(-m.x[a]);
        }
    }
    comm.sum(&mut totals);
    comm.min(&mut extents);

    let mut searches: Vec<Search> = (0..chunk.len())
        .map(|s| {
            let extent = &extents[6 * s..][..6];
            let length = |a: usize| -extent[3 + a] - extent[a];
            let longest = |best: usize, &a: &usize| if length(a) > length(best) { a } else { best };
            let best = axes.iter().fold(axes[0], longest);
            let axis = kept(chunk[s]).filter(|&axis| KEEP * length(axis) >= length(best)).unwrap_or(best);
            let scale = (1u64 << (BITS * PASSES)) as f64 / length(axis);
            let ranks = u64::from(tree.nodes[chunk[s]].ranks);
            Search {
                axis,
                low: extent[axis],
                scale: if scale.is_finite() && scale > 0.0 { scale } else { 0.0 },
                share: (ranks.div_ceil(2), ranks, totals[s]),
                prefix: 0,
                below: 0,
                threshold: (totals[s] == 0).then_some(0),
            }
        })
        .collect();

    for pass in 0..PASSES {
        if searches.iter().all(|search| search.threshold.is_some()) {
            break; // the same on every rank
        }
        let shift = BITS * (PASSES - 1 - pass);
        let mut histograms = vec![0u64; BINS * chunk.len()];
        for m in members.clone() {
            let search = &searches[m.slot];
            let key = search.key(m.x) >> shift;
            if search.threshold.is_none() && key >> BITS == search.prefix {
                histograms[BINS * m.slot + (key as usize & (BINS - 1))] += m.weight;
            }
        }
        comm.sum(&mut histograms);
        for (search, histogram) in searches.iter_mut().zip(histograms.chunks(BINS)) {
            if search.threshold.is_none() {
                search.descend(histogram, shift);
            }
        }
    }

    // The points next to the cut: the largest on its left (negative), the smallest on its right.
    let mut gaps = vec![f64::INFINITY; 2 * chunk.len()];
    for m in members {
        let search = &searches[m.slot];
        let (right, x) = (search.key(m.x) >= search.threshold.unwrap_or(0), m.x[search.axis]);
        let side = &mut gaps[2 * m.slot + usize::from(right)];
        *side = side.min(if right { x } else { -x });
    }
    comm.min(&mut gaps);
    let places = searches.iter().zip(gaps.chunks(2)).zip(chunk);
    places
        .map(|((search, gap), &k)| {
            let bounds = || tree.bounds(tree.nodes[k].first as usize, tree.nodes[k].ranks as usize);
            (search.axis, place(-gap[0], gap[1], search.axis, bounds))
        })
        .collect()
}

/// Place of a cut with the nearest points at `left` and `right`, infinite where a side has none: left < at <= right,
/// and not outside `bounds`.
fn place(left: f64, right: f64, axis: usize, bounds: impl Fn() -> Bounds) -> f64 {
    match (left.is_finite(), right.is_finite()) {
        (true, true) => {
            let middle = left + 0.5 * (right - left);
            if middle > left { middle } else { right }
        }
        (true, false) => left.next_up(),
        (false, true) => right,
        // An empty node: all of it to one side, or both halves of space.
        (false, false) => {
            let bounds = bounds();
            [bounds.low[axis], bounds.high[axis]].into_iter().find(|face| face.is_finite()).unwrap_or(0.0)
        }
    }
}
