//! The only loops over pairs of particles: blocks of particles i, one in each lane, against the list of their candidates j.
//!
//! Each j is taken by all lanes at once, in ascending key; outside the support the kernel is an exact zero, and with it
//! what j adds. So each sum runs over the neighbours of its particle in ascending key, and its bits depend neither on
//! blocks nor on lists, ranks or restarts. What is summed is in [`crate::rates`].

use crate::algebra::Vector;
use crate::lanes::{Element, Instructions, Lanes, Parts, Place, prefetch};
use crate::neighbors::Lists;
use crate::physics::Kernel;
pub use formats::scene::Precision;
use pulp::{Simd, WithSimd};
use std::marker::PhantomData;
use std::ops::Range;

/// What rates need to know beside the particles.
#[derive(Clone, Copy, Debug)]
pub struct Pairs {
    /// Smoothing length h, m.
    pub h: f64,
    /// Lattice spacing dx, m.
    pub spacing: f64,
    /// What computes the pairs.
    pub instructions: Instructions,
    /// In which numbers.
    pub precision: Precision,
}

/// Pairs closer than this, over h, count as that far apart where the distance divides.
const NEAREST: f64 = 1e-3;

/// What turns distances into W and grad W.
#[derive(Clone, Copy)]
pub struct Scales<T> {
    /// h
    pub h: T,
    support: T,
    nearest2: T,
    zero: T,
    pub four: T,
}

impl<T: Element> Scales<T> {
    fn new(h: f64) -> Self {
        Self {
            h: T::of(h),
            support: T::of(2.0 * h),
            nearest2: T::of((NEAREST * h).powi(2)),
            zero: T::of(0.0),
            four: T::of(4.0),
        }
    }

    #[inline(always)]
    fn lanes<L: Lanes<Element = T>>(self, token: L::Token) -> Scales<L> {
        let Self { h, support, nearest2, zero, four } = self;
        let all = |x| L::all(token, x);
        Scales { h: all(h), support: all(support), nearest2: all(nearest2), zero: all(zero), four: all(four) }
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

/// What sweeps need of a particle, side by side in memory.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct Mover<const D: usize, T: Element> {
    pub(crate) place: T::Place<D>,
    /// Velocity, m/s.
    pub v: Vector<D, T>,
    /// Volume times the constant that the slopes of pairs lack: see [`weight`].
    pub weight: T,
}

impl<const D: usize, T: Element> Mover<D, T> {
    /// Of a place over a unit of length, a velocity, and a weight.
    pub fn new(x: Vector<D>, v: Vector<D>, weight: f64, unit: f64) -> Self {
        Self { place: T::place(x, unit), v: Vector(v.0.map(T::of)), weight: T::of(weight) }
    }
}

/// What a volume is multiplied by, so that weight times slope is V W'/r: V, W and r in a unit of length. Positive.
pub fn weight<const D: usize, K: Kernel>(h: f64, unit: f64) -> f64 {
    K::KIND.norm(D) / h.powi(D as i32) * K::SLOPE / (h / unit).powi(K::SLOPE_POWER)
}

/// Sums over pairs for the particles of one block.
pub trait Sums<const D: usize, T: Element> {
    /// What they need of each pair.
    const NEEDS: Needs;
    /// Asks for what they need of a particle that comes soon, beside the particle itself.
    #[inline(always)]
    fn fetch(&self) -> impl Fn(usize) + use<Self, D, T> {
        |_| {}
    }

    /// Sums over all pairs of a block, in ascending key of the other particle, and keeps what comes out. Pairs outside the
    /// support in a lane have slope and value 0 there.
    fn block<'a, L: Lanes<Element = T>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>);
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
pub struct Pair<'a, const D: usize, L: Lanes> {
    /// Index of the other.
    pub j: usize,
    /// The other.
    pub other: &'a Mover<D, L::Element>,
    /// x_i - x_j.
    pub d: Vector<D, L>,
    /// Times the other's weight it is V_j s with grad_i W = s d.
    pub slope: L,
    /// 1/r, at most 1000/h.
    pub inverse: L,
    /// W up to a constant factor.
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
        self.own_of(field, |value| value)
    }

    /// As [`Block::own`], of a part of each value of the field.
    #[inline(always)]
    pub fn own_of<R, F: Parts<Number = L::Element>>(&self, field: &[R], of: impl Fn(&R) -> &F) -> F::With<L> {
        F::With::<L>::from_parts(|k| self.lanes(|lane| of(&field[(self.first + lane).min(self.last)]).part(k)))
    }

    /// A number of each value of a field, of the particles of the block.
    #[inline(always)]
    pub fn own_number_of<R>(&self, field: &[R], of: impl Fn(&R) -> L::Element) -> L {
        self.lanes(|lane| of(&field[(self.first + lane).min(self.last)]))
    }

    /// A field's numbers of the particles of the block.
    #[inline(always)]
    pub fn own_numbers(&self, field: &[L::Element]) -> L {
        self.own_number_of(field, |&number| number)
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

/// Pairs of a block that are weighed and summed together. Each of the loops has a short chain of operations for a pair; one
/// loop would have a long one, of which a processor overlaps too few. More at a time would push the particles out of the
/// nearest cache.
const TOGETHER: usize = 32;

/// Candidates from the one at hand to the one that is fetched.
pub(crate) const AHEAD: usize = 24;

/// Pairs of a block with all that is near, some at a time.
struct Near<'a, 'f, const D: usize, L: Lanes, K, H> {
    token: L::Token,
    place: LanesOfPlaces<D, L>,
    movers: &'a [Mover<D, L::Element>],
    /// Not yet weighed.
    rest: &'a [u32],
    /// Weighed, and the next of them.
    some: &'a [u32],
    next: usize,
    weighed: &'f mut Weighed<L>,
    scales: &'f Scales<L>,
    needs: Needs,
    fetch: H,
    kernel: PhantomData<K>,
}

type LanesOfPlaces<const D: usize, L> = <<<L as Lanes>::Element as Element>::Place<D> as Parts>::With<L>;

/// The kernel of some pairs.
struct Weighed<L> {
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

impl<L: Lanes> Weighed<L> {
    fn new(zero: L) -> Self {
        let room = [Line(zero); TOGETHER];
        Self { r2: room, inverse: room, slope: room, value: room }
    }
}

impl<'a, const D: usize, L: Lanes, K: Kernel, H: Fn(usize)> Near<'a, '_, D, L, K, H> {
    /// The kernel of some more pairs.
    #[inline(always)]
    fn weigh(&mut self) {
        let (some, rest) = self.rest.split_at(self.rest.len().min(TOGETHER));
        for (n, &j) in some.iter().enumerate() {
            if let Some(&ahead) = self.rest.get(n + AHEAD) {
                prefetch(&self.movers[ahead as usize]);
                (self.fetch)(ahead as usize);
            }
            let r2 = self.difference(&self.movers[j as usize]).norm2().largest(self.scales.nearest2);
            let weighed = &mut *self.weighed;
            weighed.r2[n].0 = r2;
            weighed.inverse[n].0 = r2.rough_inverse_root();
        }
        let Weighed { r2, inverse, slope, value } = &mut *self.weighed;
        let (scales, needs) = (self.scales, self.needs);
        for n in 0..some.len() {
            let closer = r2[n].0.closer_inverse_root(inverse[n].0);
            inverse[n].0 = closer;
            let r = r2[n].0 * closer;
            if needs.slope {
                slope[n].0 = K::slope(r, closer, scales);
            }
            if needs.value {
                value[n].0 = K::value(r, scales);
            }
        }
        (self.some, self.rest, self.next) = (some, rest, 0);
    }

    #[inline(always)]
    fn difference(&self, other: &Mover<D, L::Element>) -> Vector<D, L> {
        <L::Element as Element>::Place::<D>::difference::<L>(self.place, all(self.token, &other.place))
    }
}

impl<'a, const D: usize, L: Lanes, K: Kernel, H: Fn(usize)> Iterator for Near<'a, '_, D, L, K, H> {
    type Item = Pair<'a, D, L>;

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        if self.next == self.some.len() {
            if self.rest.is_empty() {
                return None;
            }
            self.weigh();
        }
        let n = self.next;
        self.next += 1;
        let j = self.some[n] as usize;
        let other = &self.movers[j];
        let Weighed { inverse, slope, value, .. } = &*self.weighed;
        let d = self.difference(other);
        let n = n % TOGETHER;
        Some(Pair { j, other, d, inverse: inverse[n].0, slope: slope[n].0, value: value[n].0 })
    }
}

#[inline(always)]
fn all<F: Parts<Number = L::Element>, L: Lanes>(token: L::Token, value: &F) -> F::With<L> {
    F::With::<L>::from_parts(|k| L::all(token, value.part(k)))
}

/// Which particles to sum for, over which others.
#[derive(Clone, Debug)]
pub struct Sweep<'a, const D: usize, T: Element> {
    /// All particles.
    pub movers: &'a [Mover<D, T>],
    /// Candidates of the blocks.
    pub lists: &'a Lists,
    /// Which of the particles that have lists.
    pub part: Range<usize>,
    /// Index of the first particle of the first block.
    pub first: usize,
}

impl<const D: usize, T: Element> Sweep<'_, D, T> {
    /// Calls [`Sums::block`] for every block. `h`: smoothing length in the movers' unit.
    pub fn run<K: Kernel>(self, h: f64, instructions: Instructions, sums: &mut impl Sums<D, T>) {
        let scales = Scales::new(h);
        T::run(instructions, Run::<'_, D, T, K, _> { sweep: self, scales, sums, kernel: PhantomData });
    }
}

struct Run<'a, const D: usize, T: Element, K, Q> {
    sweep: Sweep<'a, D, T>,
    scales: Scales<T>,
    sums: &'a mut Q,
    kernel: PhantomData<K>,
}

impl<const D: usize, T: Element, K: Kernel, Q: Sums<D, T>> WithSimd for Run<'_, D, T, K, Q> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, token: S) {
        let Sweep { movers, lists, part, first: start } = self.sweep;
        let scales = &self.scales.lanes::<T::Lanes<S>>(token);
        let weighed = &mut Weighed::new(scales.zero);
        for (block, near) in lists.blocks_of(part) {
            let end = start + block.end;
            for first in (start + block.start..end).step_by(T::Lanes::<S>::LANES) {
                let block = Block::<T::Lanes<S>> { token, first, last: end - 1 };
                let near = Near::<'_, '_, D, T::Lanes<S>, K, _> {
                    token,
                    place: block.own_of(movers, |mover| &mover.place),
                    movers,
                    rest: near,
                    some: &[],
                    next: 0,
                    weighed,
                    scales,
                    needs: Q::NEEDS,
                    fetch: self.sums.fetch(),
                    kernel: PhantomData,
                };
                self.sums.block(block, near);
            }
        }
    }
}
