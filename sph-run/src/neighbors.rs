//! Lists of what can be near blocks of particles: of the owned ones, and of the wall's.
//!
//! A list holds every particle that can come within the support of one of the block before the next build, in ascending
//! key. Longer lists than needed do no harm: outside the support the kernel is zero, so sums do not depend on when lists are
//! built, nor on the blocks.

use crate::algebra::Vector;
use crate::lanes::{Doubles, Element, Lanes, Parts, prefetch};
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{AHEAD, Mover, Pairs, Precision, Sums, Sweep, weight};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Blocks of consecutive particles, and a list of candidates for each.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    count: usize,
    block: usize,
    starts: Vec<u32>,
    candidates: Vec<u32>,
}

impl Lists {
    /// Each block, counted from the first particle that has a list, and its candidates.
    pub fn blocks(&self) -> impl Iterator<Item = (Range<usize>, &[u32])> {
        self.blocks_of(0..self.count)
    }

    /// The blocks of some particles, which begin one.
    pub fn blocks_of(&self, part: Range<usize>) -> impl Iterator<Item = (Range<usize>, &[u32])> {
        debug_assert!(part.start.is_multiple_of(self.block.max(1)));
        part.clone()
            .step_by(self.block.max(1))
            .map(move |start| (start..(start + self.block).min(part.end), self.of(start)))
    }

    /// The candidates of a particle, itself among them if it is one of the range the lists are made from.
    pub fn of(&self, i: usize) -> &[u32] {
        let b = i / self.block;
        &self.candidates[self.starts[b] as usize..self.starts[b + 1] as usize]
    }

    /// Number of particles that have a list.
    pub fn len(&self) -> usize {
        self.count
    }

    fn clear(&mut self, count: usize, block: usize) {
        (self.count, self.block) = (count, block);
        self.starts.clear();
        self.starts.push(0);
        self.candidates.clear();
    }

    fn close(&mut self) {
        self.starts.push(u32::try_from(self.candidates.len()).expect("a rank holds fewer than 2^32 candidates"));
    }

    /// No lists?
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

/// What is found beyond the support, over h. Finding takes as long as a fifth of the two sweeps of a step; each hundredth
/// of h makes those 1 % longer.
const MARGIN: f64 = 0.04;

/// Neighbour lists of one rank.
#[derive(Clone, Debug, Default)]
pub struct Neighbors<const D: usize> {
    /// All particles, as sweeps need them: see [`Neighbors::refresh`].
    pub movers: Vec<Mover<D, f64>>,
    /// The same in f32, where the scene asks for mixed precision.
    pub singles: Vec<Mover<D, f32>>,
    /// For the owned particles: particles of all ranges.
    pub of_owned: Lists,
    /// Of the candidates of owned particles those within the support, and a little more.
    near: Lists,
    /// How many of the particles have it.
    found: usize,
    /// How far particles may have gone since, m.
    moved: f64,
    /// The first so many of the owned particles have no candidates but owned ones.
    alone: usize,
    /// For the wall particles: material particles of all ranges but the walls.
    pub of_wall: Lists,
}

impl<const D: usize> Neighbors<D> {
    /// Takes over places, velocities and volumes.
    pub fn refresh<const N: usize, K: Kernel>(&mut self, particles: &Particles<D, N>, pairs: Pairs) {
        self.refresh_from::<N, K>(0, particles, pairs);
    }

    /// As [`Neighbors::refresh`], of the particles from index `first` on.
    pub fn refresh_from<const N: usize, K: Kernel>(&mut self, first: usize, particles: &Particles<D, N>, pairs: Pairs) {
        self.refresh_part::<N, K>(first..particles.len(), particles, pairs);
    }

    /// As [`Neighbors::refresh`], of the particles of a part; later ones are forgotten.
    pub fn refresh_part<const N: usize, K: Kernel>(
        &mut self,
        part: Range<usize>,
        particles: &Particles<D, N>,
        pairs: Pairs,
    ) {
        movers::<D, N, K, f64>(part.clone(), particles, pairs.h, &mut self.movers);
        if pairs.precision == Precision::Mixed {
            movers::<D, N, K, f32>(part, particles, pairs.h, &mut self.singles);
        }
    }

    /// How many of the owned particles, from the first on and in whole blocks, need no others until the next build.
    pub fn alone(&self) -> usize {
        self.alone
    }

    /// Says that particles have moved, none further than `farthest`.
    pub fn moved(&mut self, farthest: f64) {
        self.moved += farthest;
    }

    /// Finds what is within the support, if what was found before no longer holds: sweeps go over it.
    pub fn find(&mut self, x: &[Vector<D>], pairs: Pairs) {
        self.find_first(self.of_owned.len(), x, pairs);
    }

    /// As [`Neighbors::find`], at least for the first `end` owned particles, in whole blocks; [`Neighbors::find`] finds the rest.
    pub fn find_first(&mut self, end: usize, x: &[Vector<D>], pairs: Pairs) {
        let margin = MARGIN * pairs.h;
        if self.moved > 0.5 * margin {
            self.near.clear(self.of_owned.count, self.of_owned.block);
            (self.found, self.moved) = (0, 0.0);
        }
        if self.found < end {
            let (lists, near, part) = (&self.of_owned, &mut self.near, self.found..end);
            pairs.instructions.run(Find { lists, near, part, x, support: 2.0 * pairs.h + margin });
            self.found = end;
        }
    }

    /// Sums over the pairs of the owned particles.
    pub fn sweep<K: Kernel, T: Element>(&self, pairs: Pairs, sums: &mut impl Sums<D, T>) {
        self.sweep_part::<K, T>(pairs, 0..self.near.len(), sums);
    }

    /// Sums over the pairs of some owned particles, in whole blocks.
    pub fn sweep_part<K: Kernel, T: Element>(&self, pairs: Pairs, part: Range<usize>, sums: &mut impl Sums<D, T>) {
        let sweep = Sweep { movers: T::movers(self), lists: &self.near, part, first: 0 };
        sweep.run::<K>(pairs.h / T::unit(pairs.h), pairs.instructions, sums);
    }

    /// Lists of all pairs closer than `reach`.
    pub fn build<const N: usize>(&mut self, particles: &Particles<D, N>, reach: f64, pairs: Pairs) {
        self.moved = f64::INFINITY;
        let instructions = pairs.instructions;
        let block = instructions.block(match pairs.precision {
            Precision::Double => size_of::<f64>(),
            Precision::Mixed => size_of::<f32>(),
        });
        // Number the particles in ascending key. Cells hold these numbers, so that a list is sorted as plain integers.
        let mut keyed: Vec<_> = particles.key.iter().copied().zip(0_u32..).collect();
        keyed.sort_unstable();
        let by_key: Vec<u32> = keyed.into_iter().map(|(_, i)| i).collect();
        let mut cells = Cells::new(&particles.x, &by_key, 0.5 * reach);
        let (x, by_key) = (&particles.x, &by_key[..]);
        let lists = &mut self.of_owned;
        instructions.run(Build { lists, cells: &cells, x: &x[..particles.owned], by_key, reach, block });
        let owned = |list: &[u32]| list.iter().all(|&j| (j as usize) < particles.owned);
        self.alone = lists.blocks().take_while(|(_, list)| owned(list)).last().map_or(0, |(block, _)| block.end);
        cells.forget(particles.mirror, by_key);
        let lists = &mut self.of_wall;
        instructions.run(Build { lists, cells: &cells, x: &x[particles.mirror..], by_key, reach, block });
    }
}

/// Those candidates that are within the support of a particle of their block.
struct Find<'a, const D: usize> {
    lists: &'a Lists,
    near: &'a mut Lists,
    /// Which of the particles; the lists of those before are there.
    part: Range<usize>,
    x: &'a [Vector<D>],
    support: f64,
}

impl<const D: usize> WithSimd for Find<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, token: S) {
        let Self { lists, near, part, x, support } = self;
        // A little more, lest the f32 of mixed precision miss any: there the kernel is zero all the same.
        let support2 = Doubles::all(token, support * support * (1.0 + 1e-5));
        match lists.block / Doubles::<S>::LANES {
            1 => find::<D, S, 1>(token, lists, near, part, x, support2),
            2 => find::<D, S, 2>(token, lists, near, part, x, support2),
            4 => find::<D, S, 4>(token, lists, near, part, x, support2),
            8 => find::<D, S, 8>(token, lists, near, part, x, support2),
            registers => unreachable!("blocks of {registers} registers"),
        }
    }
}

/// With blocks of R registers.
#[inline(always)]
fn find<const D: usize, S: Simd, const R: usize>(
    token: S,
    lists: &Lists,
    near: &mut Lists,
    part: Range<usize>,
    x: &[Vector<D>],
    support2: Doubles<S>,
) {
    for (block, candidates) in lists.blocks_of(part) {
        let last = block.end - 1;
        let mut own: [Vector<D, Doubles<S>>; R] = [Vector::from_parts(|_| support2); R];
        for (r, own) in own.iter_mut().enumerate() {
            let first = block.start + r * Doubles::<S>::LANES;
            *own = Vector::from_parts(|a| Doubles::each(token, |k| x[(first + k).min(last)].0[a]));
        }
        // Room for all: what is too far is written over by the next one, without a branch.
        let mut end = near.candidates.len();
        near.candidates.resize(end + candidates.len(), 0);
        let found = &mut near.candidates[..];
        for (n, &j) in candidates.iter().enumerate() {
            if let Some(&ahead) = candidates.get(n + AHEAD) {
                prefetch(&x[ahead as usize]);
            }
            found[end] = j;
            end += usize::from(is_near(token, &own, &x[j as usize], support2));
        }
        near.candidates.truncate(end);
        near.close();
    }
}

/// Is a place within a distance of any particle of a block?
#[inline(always)]
fn is_near<const D: usize, S: Simd>(
    token: S,
    own: &[Vector<D, Doubles<S>>],
    place: &Vector<D>,
    distance2: Doubles<S>,
) -> bool {
    let place = Vector::from_parts(|a| Doubles::all(token, place.0[a]));
    let mut near = false;
    for &own in own {
        near |= (own - place).norm2().any_below(distance2);
    }
    near
}

fn movers<const D: usize, const N: usize, K: Kernel, T: Element>(
    part: Range<usize>,
    p: &Particles<D, N>,
    h: f64,
    movers: &mut Vec<Mover<D, T>>,
) {
    let unit = T::unit(h);
    let per_volume = weight::<D, K>(h, unit);
    movers.truncate(part.start);
    movers.extend(part.map(|i| Mover::new(p.x[i], p.v[i], p.volume[i] * per_volume, unit)));
}

/// Lists for blocks of the particles at `x`.
struct Build<'a, const D: usize> {
    lists: &'a mut Lists,
    cells: &'a Cells<D>,
    x: &'a [Vector<D>],
    by_key: &'a [u32],
    reach: f64,
    block: usize,
}

impl<const D: usize> WithSimd for Build<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, token: S) {
        let Self { lists, cells, x, by_key, reach, block } = self;
        lists.clear(x.len(), block);
        let reach2 = Doubles::all(token, reach * reach);
        let mut found: Vec<u32> = Vec::new();
        let mut runs = Vec::new();
        let mut lanes: Vec<Vector<D, Doubles<S>>> = Vec::new();
        for own in x.chunks(block) {
            let (low, high) = bounds(own);
            lanes.clear();
            lanes.extend(
                own.chunks(Doubles::<S>::LANES)
                    .map(|some| Vector::from_parts(|a| Doubles::each(token, |k| some[k.min(some.len() - 1)].0[a]))),
            );
            cells.near(low, high, reach, &mut runs);
            found.clear();
            for run in &runs {
                // Room for all, so that what is no candidate is written over and needs no branch.
                let mut end = found.len();
                found.resize(end + run.len(), 0);
                for (&number, place) in cells.numbers[run.clone()].iter().zip(&cells.places[run.clone()]) {
                    found[end] = number;
                    end += usize::from(is_near(token, &lanes, place, reach2));
                }
                found.truncate(end);
            }
            found.sort_unstable();
            lists.candidates.extend(found.iter().map(|&number| by_key[number as usize]));
            lists.close();
        }
        lists.candidates.shrink_to(lists.candidates.len() + lists.candidates.len() / 8);
    }
}

/// A grid of cells at least `width` wide. Its outermost cells reach to infinity.
struct Cells<const D: usize> {
    low: Vector<D>,
    width: f64,
    count: [usize; D],
    starts: Vec<u32>,
    /// Number and place of each particle, cell by cell.
    numbers: Vec<u32>,
    places: Vec<Vector<D>>,
}

impl<const D: usize> Cells<D> {
    fn new(x: &[Vector<D>], by_key: &[u32], width: f64) -> Self {
        // A few particles far out must not make millions of empty cells: the grid covers where nearly all are, and its
        // outermost cells take in the rest. Should that not do, the cells are widened.
        let (low, high) = bulk(x);
        let mut width = width;
        let shape = |width: f64| -> [usize; D] {
            std::array::from_fn(|a| (((high.0[a] - low.0[a]) / width).max(0.0) as usize).saturating_add(1))
        };
        while shape(width).iter().fold(1usize, |n, &c| n.saturating_mul(c)) > 4 * x.len() + 64 {
            width *= 2.0;
        }
        let count = shape(width);
        let mut cells = Self {
            low,
            width,
            count,
            starts: vec![0; count.iter().product::<usize>() + 1],
            numbers: vec![0; by_key.len()],
            places: vec![Vector::default(); by_key.len()],
        };
        let cell: Vec<u32> = by_key.iter().map(|&i| cells.index(cells.coordinates(x[i as usize])) as u32).collect();
        for &c in &cell {
            cells.starts[c as usize + 1] += 1;
        }
        for c in 1..cells.starts.len() {
            cells.starts[c] += cells.starts[c - 1];
        }
        let mut next = cells.starts.clone();
        for (number, &c) in cell.iter().enumerate() {
            let at = next[c as usize] as usize;
            cells.numbers[at] = number as u32;
            cells.places[at] = x[by_key[number] as usize];
            next[c as usize] += 1;
        }
        cells
    }

    /// Takes out all particles whose index is `end` or more.
    fn forget(&mut self, end: usize, by_key: &[u32]) {
        let (mut kept, mut start) = (0, 0);
        for c in 1..self.starts.len() {
            for k in std::mem::replace(&mut start, self.starts[c] as usize)..self.starts[c] as usize {
                if (by_key[self.numbers[k] as usize] as usize) < end {
                    (self.numbers[kept], self.places[kept]) = (self.numbers[k], self.places[k]);
                    kept += 1;
                }
            }
            self.starts[c] = kept as u32;
        }
    }

    fn coordinates(&self, x: Vector<D>) -> [usize; D] {
        std::array::from_fn(|a| (((x.0[a] - self.low.0[a]) / self.width).max(0.0) as usize).min(self.count[a] - 1))
    }

    fn index(&self, c: [usize; D]) -> usize {
        (0..D).rev().fold(0, |index, a| index * self.count[a] + c[a])
    }

    /// Runs of cells that hold all particles within `reach` of a box, and some more.
    fn near(&self, low: Vector<D>, high: Vector<D>, reach: f64, runs: &mut Vec<Range<usize>>) {
        runs.clear();
        let all = Vector([reach; D]);
        let (low, high) = (self.coordinates(low - all), self.coordinates(high + all));
        let mut at = low;
        loop {
            // Cells that follow each other along the first axis are one run of particles.
            let first = self.index(at);
            runs.push(self.starts[first] as usize..self.starts[first + high[0] - low[0] + 1] as usize);
            let Some(axis) = (1..D).find(|&a| at[a] < high[a]) else { return };
            at[axis] += 1;
            at[1..axis].copy_from_slice(&low[1..axis]);
        }
    }
}

/// Lower and upper corner of a box that holds all but a thousandth of some points on each side of each axis.
fn bulk<const D: usize>(x: &[Vector<D>]) -> (Vector<D>, Vector<D>) {
    let few = x.len() / 1000;
    let (mut low, mut high) = bounds(x);
    if few > 0 {
        let mut along: Vec<f64> = Vec::with_capacity(x.len());
        for a in 0..D {
            along.clear();
            along.extend(x.iter().map(|p| p.0[a]));
            low.0[a] = *along.select_nth_unstable_by(few, f64::total_cmp).1;
            high.0[a] = *along.select_nth_unstable_by(x.len() - 1 - few, f64::total_cmp).1;
        }
    }
    (low, high)
}

/// Lower and upper corner of the box around some points; zeros where there are none.
pub fn bounds<const D: usize>(x: &[Vector<D>]) -> (Vector<D>, Vector<D>) {
    bounds_of(x.iter().copied())
}

fn bounds_of<const D: usize>(mut x: impl Iterator<Item = Vector<D>>) -> (Vector<D>, Vector<D>) {
    let Some(first) = x.next() else { return (Vector::default(), Vector::default()) };
    x.fold((first, first), |(low, high), p| {
        (Vector(std::array::from_fn(|a| low.0[a].min(p.0[a]))), Vector(std::array::from_fn(|a| high.0[a].max(p.0[a]))))
    })
}

/// An order in which consecutive particles are close to each other in blocks of every power of two up to [`LARGEST_BLOCK`]:
/// halves along the longest side of the box around them, again and again.
pub fn blocks_order<const D: usize>(x: &[Vector<D>]) -> Vec<u32> {
    let mut places: Vec<(Vector<D>, u32)> = x.iter().copied().zip(0..).collect();
    halve(&mut places);
    places.into_iter().map(|(_, i)| i).collect()
}

/// An order of particles in which whole blocks that need nothing of others are first; the blocks stay as they are.
pub fn needing_last(needs: &[bool]) -> Vec<u32> {
    let blocks = || needs.chunks(LARGEST_BLOCK).enumerate();
    // One that is not full can only be the last.
    let alone = |block: &[bool]| block.len() == LARGEST_BLOCK && !block.contains(&true);
    let first = blocks().filter(|(_, block)| alone(block));
    let last = blocks().filter(|(_, block)| !alone(block));
    let start = |k: usize| (k * LARGEST_BLOCK) as u32;
    first.chain(last).flat_map(|(k, block)| start(k)..start(k) + block.len() as u32).collect()
}

/// See [`Instructions::block`].
const LARGEST_BLOCK: usize = 8;

fn halve<const D: usize>(places: &mut [(Vector<D>, u32)]) {
    if places.len() < 2 {
        return;
    }
    let (low, high) = bounds_of(places.iter().map(|(x, _)| *x));
    let side = high - low;
    let axis = (1..D).fold(0, |longest, a| if side.0[a] > side.0[longest] { a } else { longest });
    // Whole blocks on the left.
    let mut block = LARGEST_BLOCK;
    while block >= places.len() {
        block /= 2;
    }
    let half = places.len().div_ceil(2 * block) * block;
    places.select_nth_unstable_by(half, |(a, i), (b, j)| a.0[axis].total_cmp(&b.0[axis]).then(i.cmp(j)));
    let (left, right) = places.split_at_mut(half);
    halve(left);
    halve(right);
}
