//! The only loops over pairs of particles: blocks of particles i, one in each lane, against the list of their candidates j.
//!
//! Each j is taken by all lanes at once, in ascending key; outside the support the kernel is an exact zero, and with it
//! what j adds. So each sum runs over the neighbours of its particle in ascending key, and its bits depend neither on
//! blocks nor on lists, ranks or restarts. What is summed is in [`crate::rates`].

use crate::algebra::Vector;
use crate::lanes::{Element, Instructions, Lanes, Parts};
use crate::neighbors::{Lists, Neighbors};
use crate::physics::Kernel;
use pulp::{Simd, WithSimd};
use std::marker::PhantomData;

/// What rates need to know beside the particles.
#[derive(Clone, Copy, Debug)]
pub struct Pairs {
    /// Smoothing length h, m.
    pub h: f64,
    /// Lattice spacing dx, m.
    pub spacing: f64,
    /// What computes the pairs.
    pub instructions: Instructions,
}

/// Pairs closer than this, over h, count as that far apart where the distance divides.
const NEAREST: f64 = 1e-3;

/// What turns distances into W and grad W.
#[derive(Clone, Copy)]
pub struct Scales<T> {
    /// h
    pub h: T,
    support: T,
    support2: T,
    nearest2: T,
    /// Factors of [`Kernel::value`] and [`Kernel::slope`].
    value: T,
    slope: T,
    zero: T,
    pub minus_four: T,
}

impl<T: Element> Scales<T> {
    fn new<const D: usize, K: Kernel>(h: f64) -> Self {
        let norm = K::KIND.norm(D) / h.powi(D as i32);
        Self {
            h: T::of(h),
            support: T::of(2.0 * h),
            support2: T::of(4.0 * h * h),
            nearest2: T::of((NEAREST * h).powi(2)),
            value: T::of(norm * K::VALUE / h.powi(K::VALUE_POWER)),
            slope: T::of(norm * K::SLOPE / h.powi(K::SLOPE_POWER)),
            zero: T::of(0.0),
            minus_four: T::of(-4.0),
        }
    }

    #[inline(always)]
    fn lanes<L: Lanes<Element = T>>(self, token: L::Token) -> Scales<L> {
        let Self { h, support, support2, nearest2, value, slope, zero, minus_four } = self;
        let all = |x| L::all(token, x);
        Scales {
            h: all(h),
            support: all(support),
            support2: all(support2),
            nearest2: all(nearest2),
            value: all(value),
            slope: all(slope),
            zero: all(zero),
            minus_four: all(minus_four),
        }
    }
}

impl<L: Lanes> Scales<L> {
    /// (2h - r)+
    #[inline(always)]
    pub fn outer(&self, r: L) -> L {
        (self.support - r).largest(self.zero)
    }
    /// (h - r)+
    #[inline(always)]
    pub fn inner(&self, r: L) -> L {
        (self.h - r).largest(self.zero)
    }
}

/// A place, from which a difference can be taken.
pub trait Place<const D: usize, T: Element>: Parts<Number = T> {
    /// x_i - x_j
    fn difference<L: Lanes<Element = T>>(own: Self::With<L>, other: Self::With<L>) -> Vector<D, L>;
}

impl<const D: usize> Place<D, f64> for Vector<D> {
    #[inline(always)]
    fn difference<L: Lanes<Element = f64>>(own: Vector<D, L>, other: Vector<D, L>) -> Vector<D, L> {
        own - other
    }
}

/// Sums over pairs for the particles of one block.
pub trait Sums<const D: usize, T: Element> {
    /// What they need of each pair.
    const NEEDS: Needs;
    /// Sums over all pairs of a block, in ascending key of the other particle, and keeps what comes out. Pairs outside the
    /// support in a lane have slope and value 0 there.
    fn block<L: Lanes<Element = T>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<D, L>>);
}

/// What is computed of a pair beside its difference.
#[derive(Clone, Copy, Debug)]
pub struct Needs {
    pub slope: bool,
    pub value: bool,
}

impl Needs {
    /// The gradient of the kernel.
    pub const SLOPE: Self = Self { slope: true, value: false };
    /// The kernel.
    pub const VALUE: Self = Self { slope: false, value: true };
}

/// A block of particles.
#[derive(Clone, Copy)]
pub struct Block<L: Lanes> {
    token: L::Token,
    /// Index of the particle in the first lane, and of the last particle there is.
    first: usize,
    last: usize,
}

/// The particles of a block and another one.
#[derive(Clone, Copy, Debug)]
pub struct Pair<const D: usize, L> {
    /// Index of the other.
    pub j: usize,
    /// x_i - x_j.
    pub d: Vector<D, L>,
    /// grad_i W = slope d.
    pub slope: L,
    /// 1/r, at most 1000/h.
    pub inverse: L,
    /// W.
    pub value: L,
}

impl<L: Lanes> Block<L> {
    /// A number in all lanes.
    #[inline(always)]
    pub fn number(&self, x: f64) -> L {
        L::all(self.token, L::Element::of(x))
    }

    /// The number of a particle in all lanes.
    #[inline(always)]
    pub fn same(&self, x: L::Element) -> L {
        L::all(self.token, x)
    }

    /// The value of a particle in all lanes.
    #[inline(always)]
    pub fn all<F: Parts<Number = L::Element>>(&self, value: &F) -> F::With<L> {
        all(self.token, value)
    }

    /// Zero.
    #[inline(always)]
    pub fn zero<F: Parts<Number = L>>(&self) -> F {
        F::from_parts(|_| self.number(0.0))
    }

    /// A number for each lane.
    #[inline(always)]
    pub fn lanes(&self, of: impl Fn(usize) -> L::Element) -> L {
        L::each(self.token, of)
    }

    /// A field's values of the particles of the block.
    #[inline(always)]
    pub fn own<F: Parts<Number = L::Element>>(&self, field: &[F]) -> F::With<L> {
        own(self.token, field, self.first, self.last)
    }

    /// A field's numbers of the particles of the block.
    #[inline(always)]
    pub fn own_numbers(&self, field: &[L::Element]) -> L {
        self.lanes(|lane| field[(self.first + lane).min(self.last)])
    }

    /// Does it hold for a particle of the block?
    #[inline(always)]
    pub fn any_lane<F>(&self, field: &[F], holds: impl Fn(&F) -> bool) -> bool {
        field[self.first..=self.last].iter().take(L::LANES).any(holds)
    }

    /// Keeps a value of each particle of the block.
    #[inline(always)]
    pub fn put<F: Parts<Number = f64>>(&self, field: &mut [F], value: F::With<L>) {
        self.put_from(0, field, value);
    }

    /// As [`Block::put`], into a field that starts with particle `start`.
    #[inline(always)]
    pub fn put_from<F: Parts<Number = f64>>(&self, start: usize, field: &mut [F], value: F::With<L>) {
        for (lane, kept) in field[self.first - start..=self.last - start].iter_mut().take(L::LANES).enumerate() {
            *kept = F::from_parts(|k| value.part(k).lane(lane).wide());
        }
    }
}

/// Pairs of a block that are found, weighed and summed together. Each of the three loops has a short chain of operations
/// for a pair; one loop would have a long one, of which a processor overlaps too few. What is found of more candidates would
/// push the particles out of the nearest cache.
const TOGETHER: usize = 64;

/// What is near a block, some candidates at a time.
struct Near<'a, const D: usize, L: Lanes, X: Place<D, L::Element>, K> {
    token: L::Token,
    x: X::With<L>,
    places: &'a [X],
    candidates: std::slice::Iter<'a, u32>,
    scales: &'a Scales<L>,
    needs: Needs,
    kernel: PhantomData<K>,
    next: usize,
    count: usize,
    found: &'a mut Found<L>,
}

/// Found, and not yet summed.
struct Found<L> {
    j: [u32; TOGETHER],
    /// Squared distance.
    r2: [Line<L>; TOGETHER],
    /// 1/r
    inverse: [Line<L>; TOGETHER],
    slope: [Line<L>; TOGETHER],
    value: [Line<L>; TOGETHER],
}

/// On a cache line of its own: a register that lies across two takes twice as long.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Line<L>(L);

impl<L: Lanes> Found<L> {
    fn new(zero: L) -> Self {
        let room = [Line(zero); TOGETHER];
        Self { j: [0; TOGETHER], r2: room, inverse: room, slope: room, value: room }
    }
}

impl<const D: usize, L: Lanes, X: Place<D, L::Element>, K: Kernel> Near<'_, D, L, X, K> {
    /// The next candidates within the support of any particle of the block.
    #[inline(always)]
    fn find(&mut self) {
        let mut count = 0;
        while count < TOGETHER {
            let Some(&j) = self.candidates.next() else { break };
            let r2 = self.difference(j).norm2();
            // What is too far is written over by the next one: no branch.
            (self.found.j[count], self.found.r2[count]) = (j, Line(r2));
            count += usize::from(r2.any_below(self.scales.support2));
        }
        self.count = count;
    }

    /// The kernel of all that was found.
    #[inline(always)]
    fn weigh(&mut self) {
        let (found, scales, needs) = (&mut *self.found, self.scales, self.needs);
        let Found { r2, inverse, slope, value, .. } = found;
        let count = self.count.min(TOGETHER);
        for n in 0..count {
            r2[n].0 = r2[n].0.largest(scales.nearest2);
            inverse[n].0 = r2[n].0.closer_inverse_root(r2[n].0.rough_inverse_root());
        }
        for _ in 1..L::REFINEMENTS {
            for n in 0..count {
                inverse[n].0 = r2[n].0.closer_inverse_root(inverse[n].0);
            }
        }
        for n in 0..count {
            let r = r2[n].0 * inverse[n].0;
            if needs.slope {
                slope[n].0 = K::slope(r, inverse[n].0, scales) * scales.slope;
            }
            if needs.value {
                value[n].0 = K::value(r, scales) * scales.value;
            }
        }
    }

    #[inline(always)]
    fn difference(&self, j: u32) -> Vector<D, L> {
        X::difference::<L>(self.x, all(self.token, &self.places[j as usize]))
    }
}

impl<const D: usize, L: Lanes, X: Place<D, L::Element>, K: Kernel> Iterator for Near<'_, D, L, X, K> {
    type Item = Pair<D, L>;

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        if self.next == self.count {
            self.find();
            self.weigh();
            self.next = 0;
            if self.count == 0 {
                return None;
            }
        }
        let n = self.next % TOGETHER;
        self.next += 1;
        let Found { j, inverse, slope, value, .. } = &*self.found;
        let j = j[n];
        Some(Pair { j: j as usize, d: self.difference(j), inverse: inverse[n].0, slope: slope[n].0, value: value[n].0 })
    }
}

#[inline(always)]
fn all<F: Parts<Number = L::Element>, L: Lanes>(token: L::Token, value: &F) -> F::With<L> {
    F::With::<L>::from_parts(|k| L::all(token, value.part(k)))
}

#[inline(always)]
fn own<F: Parts<Number = L::Element>, L: Lanes>(token: L::Token, field: &[F], first: usize, last: usize) -> F::With<L> {
    F::With::<L>::from_parts(|k| L::each(token, |lane| field[(first + lane).min(last)].part(k)))
}

/// Which particles to sum for, over which others.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a, X> {
    /// Places of all particles.
    pub places: &'a [X],
    /// Candidates of the blocks.
    pub lists: &'a Lists,
    /// Index of the first particle of the first block.
    pub first: usize,
}

impl<'a, X> Sweep<'a, X> {
    /// For the owned particles.
    pub fn owned(places: &'a [X], neighbors: &'a Neighbors) -> Self {
        Self { places, lists: &neighbors.of_owned, first: 0 }
    }

    /// Calls [`Sums::block`] for every block.
    pub fn run<const D: usize, T: Element, K: Kernel>(self, pairs: Pairs, sums: &mut impl Sums<D, T>)
    where
        X: Place<D, T>,
    {
        let scales = Scales::new::<D, K>(pairs.h);
        pairs.instructions.run(Run::<'_, D, T, X, K, _> { sweep: self, scales, sums, kernel: PhantomData });
    }
}

struct Run<'a, const D: usize, T, X, K, Q> {
    sweep: Sweep<'a, X>,
    scales: Scales<T>,
    sums: &'a mut Q,
    kernel: PhantomData<K>,
}

impl<const D: usize, T: Element, X: Place<D, T>, K: Kernel, Q: Sums<D, T>> WithSimd for Run<'_, D, T, X, K, Q> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, token: S) {
        let Sweep { places, lists, first: start } = self.sweep;
        let scales = self.scales.lanes::<T::Lanes<S>>(token);
        let found = &mut Found::new(scales.zero);
        for (block, candidates) in lists.blocks() {
            let end = start + block.end;
            for first in (start + block.start..end).step_by(T::Lanes::<S>::LANES) {
                let last = end - 1;
                let near = Near::<'_, D, T::Lanes<S>, X, K> {
                    token,
                    x: own(token, places, first, last),
                    places,
                    candidates: candidates.iter(),
                    scales: &scales,
                    needs: Q::NEEDS,
                    kernel: PhantomData,
                    next: 0,
                    count: 0,
                    found,
                };
                self.sums.block(Block { token, first, last }, near);
            }
        }
    }
}
