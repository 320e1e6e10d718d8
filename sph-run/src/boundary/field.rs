//! How a field of the particles changes on its way to a periodic copy or to a mirror image.

use crate::algebra::{Matrix, Sym, Vector};
use std::ops::Mul;

/// One field over all ranges of particles; its kind says what a shift and a reflection do to it.
#[derive(Debug)]
pub enum Field<'a, const D: usize, const N: usize> {
    /// The same for a particle, its copies and its images.
    Scalar(&'a mut [f64]),
    /// A position: shifted and reflected.
    Place(&'a mut [Vector<D>]),
    /// Reflected; by a no-slip wall all of it, relative to the wall.
    Velocity(&'a mut [Vector<D>]),
    /// Reflected, but kept as it is by a no-slip wall.
    Stress(&'a mut [Sym<N>]),
}

/// x' = sign x + offset, component by component.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Affine<const D: usize> {
    sign: [f64; D],
    /// Where there is nothing to add, -0: that changes no bit, not even the sign of a zero.
    offset: [f64; D],
}

impl<const D: usize> Affine<D> {
    const IDENTITY: Self = Self { sign: [1.0; D], offset: [-0.0; D] };

    fn apply(&self, x: Vector<D>) -> Vector<D> {
        Vector(std::array::from_fn(|a| self.sign[a] * x.0[a] + self.offset[a]))
    }

    fn then(&self, next: &Self) -> Self {
        let offset = |a: usize| some(next.sign[a] * self.offset[a] + next.offset[a]);
        Self { sign: std::array::from_fn(|a| next.sign[a] * self.sign[a]), offset: std::array::from_fn(offset) }
    }
}

/// The same number, but -0 for 0.
fn some(x: f64) -> f64 {
    if x == 0.0 { -0.0 } else { x }
}

/// How a particle becomes its image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection<const D: usize, const N: usize> {
    place: Affine<D>,
    velocity: Affine<D>,
    /// Factor of each component.
    stress: Sym<N>,
}

impl<const D: usize, const N: usize> Reflection<D, N> {
    /// No reflection at all.
    pub const IDENTITY: Self = Self { place: Affine::IDENTITY, velocity: Affine::IDENTITY, stress: Sym([1.0; N]) };

    /// Through the plane at `at` along coordinate `axis`, without friction: the motion along the plane is kept. `shears`
    /// has -1 for the shear stresses with exactly one index of that axis, else 1.
    pub fn slip(axis: usize, at: f64, shears: Sym<N>) -> Self {
        let mut reflection = Self { stress: shears, ..Self::IDENTITY };
        (reflection.place.sign[axis], reflection.place.offset[axis]) = (-1.0, some(2.0 * at));
        reflection.velocity.sign[axis] = -1.0;
        reflection
    }

    /// Through a plane that the material sticks to and that moves with `motion`: v' = 2 V - v, the stress is kept
    /// (Yang et al. 2020, Eqs 29, 30, for images).
    pub fn stick(axis: usize, at: f64, motion: Vector<D>) -> Self {
        let mut reflection = Self::IDENTITY;
        (reflection.place.sign[axis], reflection.place.offset[axis]) = (-1.0, some(2.0 * at));
        reflection.velocity = Affine { sign: [-1.0; D], offset: motion.0.map(|v| some(2.0 * v)) };
        reflection
    }

    /// This reflection, then another.
    pub fn then(&self, next: &Self) -> Self {
        let (place, velocity) = (self.place.then(&next.place), self.velocity.then(&next.velocity));
        Self { place, velocity, stress: next.stress(self.stress) }
    }

    /// A [`Field::Place`] of the image.
    pub fn place(&self, x: Vector<D>) -> Vector<D> {
        self.place.apply(x)
    }
    /// A [`Field::Velocity`] of the image.
    pub fn velocity(&self, v: Vector<D>) -> Vector<D> {
        self.velocity.apply(v)
    }
    /// A [`Field::Stress`] of the image.
    pub fn stress(&self, s: Sym<N>) -> Sym<N> {
        Sym(std::array::from_fn(|a| self.stress.0[a] * s.0[a]))
    }
    /// A tensor that follows from places alone, at the image.
    pub fn matrix(&self, m: Matrix<D>) -> Matrix<D> {
        let sign = &self.place.sign;
        Matrix(std::array::from_fn(|a| std::array::from_fn(|b| sign[a] * sign[b] * m.0[a][b])))
    }
}

/// A value as the words of a message.
pub trait Words: Copy {
    /// How many.
    const COUNT: usize;
    /// Writes them.
    fn put(self, words: &mut [u64]);
    /// Reads them.
    fn get(words: &[u64]) -> Self;
}

impl Words for f64 {
    const COUNT: usize = 1;
    fn put(self, words: &mut [u64]) {
        words[0] = self.to_bits();
    }
    fn get(words: &[u64]) -> Self {
        f64::from_bits(words[0])
    }
}

impl<const D: usize> Words for Vector<D> {
    const COUNT: usize = D;
    fn put(self, words: &mut [u64]) {
        words.copy_from_slice(&self.0.map(f64::to_bits));
    }
    fn get(words: &[u64]) -> Self {
        Self(std::array::from_fn(|a| f64::from_bits(words[a])))
    }
}

impl<const N: usize> Words for Sym<N> {
    const COUNT: usize = N;
    fn put(self, words: &mut [u64]) {
        words.copy_from_slice(&self.0.map(f64::to_bits));
    }
    fn get(words: &[u64]) -> Self {
        Self(std::array::from_fn(|a| f64::from_bits(words[a])))
    }
}

impl<const D: usize> Words for Matrix<D> {
    const COUNT: usize = D * D;
    fn put(self, words: &mut [u64]) {
        for (word, value) in words.iter_mut().zip(self.0.as_flattened()) {
            *word = value.to_bits();
        }
    }
    fn get(words: &[u64]) -> Self {
        Self(std::array::from_fn(|a| std::array::from_fn(|b| f64::from_bits(words[a * D + b]))))
    }
}

/// A field within a step that only owned particles have at first: copies and images get it from them.
pub trait Spread<const D: usize, const N: usize>: Words {
    /// What a wall particle has of it.
    fn zero() -> Self;
    /// Its value at an image.
    fn reflected(self, reflection: &Reflection<D, N>) -> Self;
}

impl<const D: usize, const N: usize> Spread<D, N> for f64 {
    fn zero() -> Self {
        0.0
    }
    fn reflected(self, _: &Reflection<D, N>) -> Self {
        self
    }
}

impl<const D: usize, const N: usize> Spread<D, N> for Sym<N> {
    fn zero() -> Self {
        Self::default()
    }
    fn reflected(self, reflection: &Reflection<D, N>) -> Self {
        reflection.stress(self)
    }
}

impl<const D: usize, const N: usize> Spread<D, N> for Matrix<D> {
    fn zero() -> Self {
        Self::default()
    }
    fn reflected(self, reflection: &Reflection<D, N>) -> Self {
        reflection.matrix(self)
    }
}

impl<T: Words, const D: usize> Words for [T; D] {
    const COUNT: usize = D * T::COUNT;
    fn put(self, words: &mut [u64]) {
        for (part, value) in words.chunks_exact_mut(T::COUNT).zip(self) {
            value.put(part);
        }
    }
    fn get(words: &[u64]) -> Self {
        std::array::from_fn(|a| T::get(&words[a * T::COUNT..][..T::COUNT]))
    }
}

/// A gradient: one value for each direction.
impl<const D: usize, const N: usize, T: Spread<D, N> + Mul<f64, Output = T>> Spread<D, N> for [T; D] {
    fn zero() -> Self {
        [T::zero(); D]
    }
    fn reflected(self, reflection: &Reflection<D, N>) -> Self {
        std::array::from_fn(|a| self[a].reflected(reflection) * reflection.place.sign[a])
    }
}
