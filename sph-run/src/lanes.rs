//! Numbers of several particles at once: one lane of a vector register for each.
//!
//! A lane never meets another, and every operation is the IEEE one (multiply_add with one rounding), so what comes out does
//! not depend on how many lanes the processor has: the bits are the same with AVX-512, with AVX2, and without either, where
//! a fused multiply-add is a function of the mathematical library, correct and slow.

use crate::algebra::{Matrix, Number, Sym, Vector};
use crate::neighbors::Neighbors;
use crate::sweep::Mover;
use pulp::{Arch, Simd, WithSimd};
use std::fmt::{self, Debug};
use std::ops::{Add, Mul, Neg, Sub};

/// Instructions for lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Instructions {
    /// 8 lanes of f64 or f32 (the level x86-64-v4). Blocks of 16 would look at more candidates for each particle, and gain
    /// nothing in f32 where registers are computed by halves.
    Avx512,
    /// 4 lanes of f64, 8 of f32 (x86-64-v3).
    Avx2,
    /// One lane, on any processor.
    Portable,
}

impl Instructions {
    /// The most that this processor has.
    pub fn best() -> Self {
        [Self::Avx512, Self::Avx2].into_iter().find(|it| it.arch().is_some()).unwrap_or(Self::Portable)
    }

    /// Does this processor have them?
    pub fn are_there(self) -> bool {
        self.arch().is_some()
    }

    fn arch(self) -> Option<Arch> {
        #[cfg(target_arch = "x86_64")]
        match self {
            Self::Avx512 => return pulp::x86::V4::try_new().map(Arch::V4),
            Self::Avx2 => return pulp::x86::V3::try_new().map(Arch::V3),
            Self::Portable => {}
        }
        (self == Self::Portable).then_some(Arch::Scalar)
    }

    /// Particles of a block: lanes of numbers of `size` bytes.
    pub fn block(self, size: usize) -> usize {
        match self {
            Self::Avx512 => 8,
            Self::Avx2 | Self::Portable => 32 / size,
        }
    }

    /// Runs a job compiled for these instructions.
    #[inline(always)]
    pub fn run<J: WithSimd>(self, job: J) -> J::Output {
        self.arch().expect(CHECKED).dispatch(job)
    }

    /// As [`Instructions::run`], in registers of 256 bits at most.
    #[inline(always)]
    fn run_narrow<J: WithSimd>(self, job: J) -> J::Output {
        #[cfg(target_arch = "x86_64")]
        if self == Self::Avx512 {
            // AVX-512 has twice as many registers as AVX2, also narrow ones.
            let all = pulp::x86::V4::try_new().expect(CHECKED);
            return all.vectorize(Narrow { token: *all, job });
        }
        self.run(job)
    }
}

const CHECKED: &str = "instructions were checked when they were chosen";

#[cfg(target_arch = "x86_64")]
struct Narrow<J> {
    token: pulp::x86::V3,
    job: J,
}

#[cfg(target_arch = "x86_64")]
impl<J: WithSimd> pulp::NullaryFnOnce for Narrow<J> {
    type Output = J::Output;

    #[inline(always)]
    fn call(self) -> J::Output {
        self.job.with_simd(self.token)
    }
}

impl fmt::Display for Instructions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2",
            Self::Portable => "portable",
        })
    }
}

/// What lanes can be made of: f64 or f32.
pub trait Element: Part + Debug + Default + Send + Sync + 'static {
    /// As many of them as the instructions S take at once.
    type Lanes<S: Simd>: Lanes<Element = Self, Token = S>;
    /// A place, as precise as a difference of two of them needs it.
    type Place<const D: usize>: Place<D, Self>;
    /// A place x, over a unit of length.
    fn place<const D: usize>(x: Vector<D>, unit: f64) -> Self::Place<D>;
    /// The unit of length of places for a smoothing length h: powers of lengths must not leave the range of f32.
    fn unit(h: f64) -> f64;
    /// The particles in such numbers.
    fn movers<const D: usize>(neighbors: &Neighbors<D>) -> &[Mover<D, Self>];
    /// Runs a job with blocks of [`Instructions::block`].
    fn run<J: WithSimd>(instructions: Instructions, job: J) -> J::Output;
    fn of(x: f64) -> Self;
    fn wide(self) -> f64;
}

/// A place, from which a difference can be taken.
pub trait Place<const D: usize, T: Element>: Parts<Number = T> + Debug + Default + Send + Sync + 'static {
    /// x_i - x_j
    fn difference<L: Lanes<Element = T>>(own: Self::With<L>, other: Self::With<L>) -> Vector<D, L>;
}

impl<const D: usize> Place<D, f64> for Vector<D> {
    #[inline(always)]
    fn difference<L: Lanes<Element = f64>>(own: Vector<D, L>, other: Vector<D, L>) -> Vector<D, L> {
        own - other
    }
}

/// A place in f32 as a point of a fixed grid and the rest: differences are as good as f32 can hold them, wherever in space
/// they are taken.
impl<const D: usize> Place<D, f32> for [Vector<D, f32>; 2] {
    #[inline(always)]
    fn difference<L: Lanes<Element = f32>>(own: [Vector<D, L>; 2], other: [Vector<D, L>; 2]) -> Vector<D, L> {
        (own[0] - other[0]) + (own[1] - other[1])
    }
}

/// Points of the grid of places in f32, to a unit of length. Differences between points are exact up to 2^20 units.
const GRID: f64 = 16.0;

/// Added and taken away again it leaves the nearest whole number: `round` is a function that is called.
const TO_WHOLE: f64 = 1.5 * (1_u64 << 52) as f64;

/// One number for each particle of a block.
pub trait Lanes: Part + Debug {
    type Element: Element;
    /// Proof that the processor has the instructions.
    type Token: Simd;
    /// How many.
    const LANES: usize;
    /// The same number in all lanes.
    fn all(token: Self::Token, x: Self::Element) -> Self;
    /// The numbers `of(0), of(1), ..`.
    fn each(token: Self::Token, of: impl FnMut(usize) -> Self::Element) -> Self;
    /// The number in a lane.
    fn lane(&self, k: usize) -> Self::Element;
    fn over(self, divisor: Self) -> Self;
    /// 1/sqrt(x) by f32, for x within its range and not zero.
    fn rough_inverse_root(self) -> Self;
    /// 1/sqrt(x) to within two units in the last place, from what f32 gives. Root and division in f64 take as long as thirty
    /// multiplications, and the estimates that processors offer beside differ between makers.
    fn closer_inverse_root(self, estimate: Self) -> Self;
    fn least(self, other: Self) -> Self;
    fn largest(self, other: Self) -> Self;
    /// Is the number below the other's in any lane?
    fn any_below(self, other: Self) -> bool;
}

/// 1/sqrt(x) in f32.
#[inline(always)]
fn estimate(x: f32) -> f32 {
    1.0 / x.sqrt()
}

macro_rules! lanes {
    ($name:ident, $element:ty, $lanes:ident, $count:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident, $neg:ident,
     $fma:ident, $div:ident, $min:ident, $max:ident, $less:ident, $first:ident, $refined:literal, $place:ty, $at:expr, $unit:expr, $movers:ident, $run:ident) => {
        /// Lanes of the instructions S.
        #[derive(Clone, Copy, Debug)]
        pub struct $name<S: Simd>(S, S::$lanes);

        impl<S: Simd> Add for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self(self.0, self.0.$add(self.1, other.1))
            }
        }
        impl<S: Simd> Sub for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self(self.0, self.0.$sub(self.1, other.1))
            }
        }
        impl<S: Simd> Mul for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self(self.0, self.0.$mul(self.1, other.1))
            }
        }
        impl<S: Simd> Neg for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(self.0, self.0.$neg(self.1))
            }
        }
        impl<S: Simd> Number for $name<S> {
            #[inline(always)]
            fn multiply_add(self, factor: Self, addend: Self) -> Self {
                Self(self.0, self.0.$fma(self.1, factor.1, addend.1))
            }
        }
        impl<S: Simd> Lanes for $name<S> {
            type Element = $element;
            type Token = S;
            const LANES: usize = S::$count;
            #[inline(always)]
            fn all(token: S, x: $element) -> Self {
                Self(token, token.$splat(x))
            }
            #[inline(always)]
            fn each(token: S, mut of: impl FnMut(usize) -> $element) -> Self {
                let mut lanes = token.$splat(0.0);
                for (k, x) in pulp::bytemuck::cast_slice_mut(std::slice::from_mut(&mut lanes)).iter_mut().enumerate() {
                    *x = of(k);
                }
                Self(token, lanes)
            }
            #[inline(always)]
            fn lane(&self, k: usize) -> $element {
                pulp::bytemuck::cast_slice(std::slice::from_ref(&self.1))[k]
            }
            #[inline(always)]
            fn over(self, divisor: Self) -> Self {
                Self(self.0, self.0.$div(self.1, divisor.1))
            }
            #[inline(always)]
            fn rough_inverse_root(self) -> Self {
                let mut lanes = self.1;
                for x in pulp::bytemuck::cast_slice_mut::<_, $element>(std::slice::from_mut(&mut lanes)) {
                    *x = <$element>::of(estimate(f32::of(x.wide())).wide());
                }
                Self(self.0, lanes)
            }
            #[inline(always)]
            fn closer_inverse_root(self, y: Self) -> Self {
                if !$refined {
                    return y;
                }
                // y (1 + e/2 + 3/8 e^2 + ..) with e = 1 - x y^2.
                let number = |x: f64| Self(self.0, self.0.$splat(x as $element));
                let e = (-(self * y)).multiply_add(y, number(1.0));
                (y * e).multiply_add(number(0.375).multiply_add(e, number(0.5)), y)
            }
            #[inline(always)]
            fn least(self, other: Self) -> Self {
                Self(self.0, self.0.$min(self.1, other.1))
            }
            #[inline(always)]
            fn largest(self, other: Self) -> Self {
                Self(self.0, self.0.$max(self.1, other.1))
            }
            #[inline(always)]
            fn any_below(self, other: Self) -> bool {
                self.0.$first(self.0.$less(self.1, other.1)) < Self::LANES
            }
        }
        impl<S: Simd> Parts for $name<S> {
            const COUNT: usize = 1;
            type Number = Self;
            type With<T: Part> = T;
            #[inline(always)]
            fn from_parts(mut part: impl FnMut(usize) -> Self) -> Self {
                part(0)
            }
            #[inline(always)]
            fn part(&self, _: usize) -> Self {
                *self
            }
        }
        impl Element for $element {
            type Lanes<S: Simd> = $name<S>;
            type Place<const D: usize> = $place;
            #[inline(always)]
            fn place<const D: usize>(x: Vector<D>, unit: f64) -> $place {
                $at(x, unit)
            }
            #[inline(always)]
            fn unit(h: f64) -> f64 {
                $unit(h)
            }
            #[inline(always)]
            fn movers<const D: usize>(neighbors: &Neighbors<D>) -> &[Mover<D, Self>] {
                &neighbors.$movers
            }
            #[inline(always)]
            fn run<J: WithSimd>(instructions: Instructions, job: J) -> J::Output {
                instructions.$run(job)
            }
            #[inline(always)]
            fn of(x: f64) -> Self {
                x as Self
            }
            #[inline(always)]
            fn wide(self) -> f64 {
                f64::from(self)
            }
        }
        impl Parts for $element {
            const COUNT: usize = 1;
            type Number = Self;
            type With<T: Part> = T;
            #[inline(always)]
            fn from_parts(mut part: impl FnMut(usize) -> Self) -> Self {
                part(0)
            }
            #[inline(always)]
            fn part(&self, _: usize) -> Self {
                *self
            }
        }
    };
}
lanes!(
    Doubles,
    f64,
    f64s,
    F64_LANES,
    splat_f64s,
    add_f64s,
    sub_f64s,
    mul_f64s,
    neg_f64s,
    mul_add_f64s,
    div_f64s,
    min_f64s,
    max_f64s,
    less_than_f64s,
    first_true_m64s,
    true,
    Vector<D>,
    |x: Vector<D>, _| x,
    |_| 1.0,
    movers,
    run
);
lanes!(
    Singles,
    f32,
    f32s,
    F32_LANES,
    splat_f32s,
    add_f32s,
    sub_f32s,
    mul_f32s,
    neg_f32s,
    mul_add_f32s,
    div_f32s,
    min_f32s,
    max_f32s,
    less_than_f32s,
    first_true_m32s,
    false,
    [Vector<D, f32>; 2],
    |x: Vector<D>, unit: f64| {
        let parts = x.0.map(|x| {
            let (x, point) = (x / unit, (x / unit * GRID + TO_WHOLE) - TO_WHOLE);
            (point / GRID, x - point / GRID)
        });
        [Vector(parts.map(|(point, _)| point as f32)), Vector(parts.map(|(_, rest)| rest as f32))]
    },
    |h| h,
    singles,
    run_narrow
);

/// A field's value, number by number: so it can be had of one particle in all lanes, or of one particle in each.
pub trait Parts: Copy {
    /// How many numbers.
    const COUNT: usize;
    type Number: Number;
    /// The same kind of value of other numbers.
    type With<T: Part>: Parts<Number = T>;
    fn from_parts(part: impl FnMut(usize) -> Self::Number) -> Self;
    fn part(&self, k: usize) -> Self::Number;
}

/// A number as the only part of itself.
pub trait Part: Number + Parts<Number = Self> {}
impl<T: Number + Parts<Number = T>> Part for T {}

macro_rules! parts {
    ($name:ident) => {
        impl<const N: usize, T: Part> Parts for $name<N, T> {
            const COUNT: usize = N;
            type Number = T;
            type With<U: Part> = $name<N, U>;
            #[inline(always)]
            fn from_parts(mut part: impl FnMut(usize) -> T) -> Self {
                let mut parts = [part(0); N];
                for k in 1..N {
                    parts[k] = part(k);
                }
                Self(parts)
            }
            #[inline(always)]
            fn part(&self, k: usize) -> T {
                self.0[k]
            }
        }
    };
}
parts!(Vector);
parts!(Sym);

impl<const D: usize, T: Part> Parts for Matrix<D, T> {
    const COUNT: usize = D * D;
    type Number = T;
    type With<U: Part> = Matrix<D, U>;
    #[inline(always)]
    fn from_parts(mut part: impl FnMut(usize) -> T) -> Self {
        let mut parts = [[part(0); D]; D];
        for k in 1..Self::COUNT {
            parts[k / D][k % D] = part(k);
        }
        Self(parts)
    }
    #[inline(always)]
    fn part(&self, k: usize) -> T {
        self.0[k / D][k % D]
    }
}

/// Several values, part by part of each.
impl<const M: usize, F: Parts> Parts for [F; M] {
    const COUNT: usize = M * F::COUNT;
    type Number = F::Number;
    type With<U: Part> = [F::With<U>; M];
    #[inline(always)]
    fn from_parts(mut part: impl FnMut(usize) -> F::Number) -> Self {
        let mut values = [F::from_parts(&mut part); M];
        for m in 1..M {
            values[m] = F::from_parts(|k| part(m * F::COUNT + k));
        }
        values
    }
    #[inline(always)]
    fn part(&self, k: usize) -> F::Number {
        self[k / F::COUNT].part(k % F::COUNT)
    }
}

/// Asks for a value to be brought into the nearest cache.
#[inline(always)]
pub fn prefetch<T>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a prefetch reads nothing.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(value).cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}
