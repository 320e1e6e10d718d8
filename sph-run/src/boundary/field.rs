//! Quantities that copies and images of a particle have too, and how they change on the way.

use crate::algebra::{Matrix, Sym, Vector};
use crate::boundary::mirror::reflect_stress;
use crate::space::Space;

/// A quantity of a particle: it can be sent to another rank, and reflected through planes of symmetry.
pub trait Field<const D: usize, const N: usize>: Copy {
    /// u64 words it takes in a message.
    const WORDS: usize;
    /// What a wall particle has of it.
    fn zero() -> Self;
    /// Appends it to a message.
    fn pack(self, message: &mut Vec<u64>);
    /// From the words of a message.
    fn unpack(words: &[u64]) -> Self;
    /// Its value at the image through planes normal to some axes of the disk.
    fn reflected<S: Space<D, N>>(self, through: [bool; 3]) -> Self;
}

fn through_own<const D: usize, const N: usize, S: Space<D, N>>(through: [bool; 3]) -> [bool; D] {
    let mut own = [false; D];
    for disk in 0..3 {
        if let (true, Some(axis)) = (through[disk], S::axis(disk)) {
            own[axis] = true;
        }
    }
    own
}

impl<const D: usize, const N: usize> Field<D, N> for f64 {
    const WORDS: usize = 1;
    fn zero() -> Self {
        0.0
    }
    fn pack(self, message: &mut Vec<u64>) {
        message.push(self.to_bits());
    }
    fn unpack(words: &[u64]) -> Self {
        f64::from_bits(words[0])
    }
    fn reflected<S: Space<D, N>>(self, _: [bool; 3]) -> Self {
        self
    }
}

impl<const D: usize, const N: usize> Field<D, N> for Vector<D> {
    const WORDS: usize = D;
    fn zero() -> Self {
        Self::default()
    }
    fn pack(self, message: &mut Vec<u64>) {
        message.extend(self.0.iter().map(|f| f.to_bits()));
    }
    fn unpack(words: &[u64]) -> Self {
        Self(std::array::from_fn(|a| f64::from_bits(words[a])))
    }
    fn reflected<S: Space<D, N>>(self, through: [bool; 3]) -> Self {
        let flip = through_own::<D, N, S>(through);
        Self(std::array::from_fn(|a| if flip[a] { -self.0[a] } else { self.0[a] }))
    }
}

impl<const D: usize, const N: usize> Field<D, N> for Sym<N> {
    const WORDS: usize = N;
    fn zero() -> Self {
        Self::default()
    }
    fn pack(self, message: &mut Vec<u64>) {
        message.extend(self.0.iter().map(|f| f.to_bits()));
    }
    fn unpack(words: &[u64]) -> Self {
        Self(std::array::from_fn(|a| f64::from_bits(words[a])))
    }
    fn reflected<S: Space<D, N>>(self, through: [bool; 3]) -> Self {
        S::stress_from_disk(reflect_stress(S::stress_to_disk(self), through))
    }
}

impl<const D: usize, const N: usize> Field<D, N> for Matrix<D> {
    const WORDS: usize = D * D;
    fn zero() -> Self {
        Self::default()
    }
    fn pack(self, message: &mut Vec<u64>) {
        message.extend(self.0.iter().flatten().map(|f| f.to_bits()));
    }
    fn unpack(words: &[u64]) -> Self {
        Self(std::array::from_fn(|a| std::array::from_fn(|b| f64::from_bits(words[a * D + b]))))
    }
    fn reflected<S: Space<D, N>>(self, through: [bool; 3]) -> Self {
        let flip = through_own::<D, N, S>(through);
        Self(std::array::from_fn(|a| {
            std::array::from_fn(|b| if flip[a] != flip[b] { -self.0[a][b] } else { self.0[a][b] })
        }))
    }
}

/// A gradient: one value for each direction.
impl<const D: usize, const N: usize, T: Field<D, N> + std::ops::Mul<f64, Output = T>> Field<D, N> for [T; D] {
    const WORDS: usize = D * T::WORDS;
    fn zero() -> Self {
        [T::zero(); D]
    }
    fn pack(self, message: &mut Vec<u64>) {
        self.into_iter().for_each(|value| value.pack(message));
    }
    fn unpack(words: &[u64]) -> Self {
        std::array::from_fn(|a| T::unpack(&words[a * T::WORDS..]))
    }
    fn reflected<S: Space<D, N>>(self, through: [bool; 3]) -> Self {
        let flip = through_own::<D, N, S>(through);
        std::array::from_fn(|a| {
            let value = self[a].reflected::<S>(through);
            if flip[a] { value * -1.0 } else { value }
        })
    }
}
