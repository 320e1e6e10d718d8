//! Small vectors and tensors of fixed size.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A vector of D components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector<const D: usize>(pub [f64; D]);

/// A symmetric tensor: the three normal components xx yy zz first, then the shears.
/// N = 4 in the plane spaces (xx yy zz xz), N = 6 in three dimensions (xx yy zz xy yz xz, the order on disk).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sym<const N: usize>(pub [f64; N]);

/// A general D x D tensor, `m[a][b]` = d v_a / d x_b for a velocity gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix<const D: usize>(pub [[f64; D]; D]);

macro_rules! componentwise {
    ($name:ident) => {
        impl<const N: usize> Default for $name<N> {
            fn default() -> Self {
                Self([0.0; N])
            }
        }
        impl<const N: usize> Add for $name<N> {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(std::array::from_fn(|a| self.0[a] + other.0[a]))
            }
        }
        impl<const N: usize> AddAssign for $name<N> {
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl<const N: usize> Sub for $name<N> {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(std::array::from_fn(|a| self.0[a] - other.0[a]))
            }
        }
        impl<const N: usize> Mul<f64> for $name<N> {
            type Output = Self;
            fn mul(self, factor: f64) -> Self {
                Self(std::array::from_fn(|a| self.0[a] * factor))
            }
        }
        impl<const N: usize> Neg for $name<N> {
            type Output = Self;
            fn neg(self) -> Self {
                Self(std::array::from_fn(|a| -self.0[a]))
            }
        }
    };
}
componentwise!(Vector);
componentwise!(Sym);

impl<const D: usize> Vector<D> {
    /// Inner product, summed from the first component on.
    pub fn dot(self, other: Self) -> f64 {
        let mut sum = self.0[0] * other.0[0];
        for a in 1..D {
            sum += self.0[a] * other.0[a];
        }
        sum
    }
    /// Squared length.
    pub fn norm2(self) -> f64 {
        self.dot(self)
    }
    /// Length.
    pub fn norm(self) -> f64 {
        self.norm2().sqrt()
    }
}

impl<const N: usize> Sym<N> {
    /// The isotropic tensor with `value` on the diagonal.
    pub fn isotropic(value: f64) -> Self {
        let mut s = Self::default();
        s.0[..3].fill(value);
        s
    }
    /// First invariant I1.
    pub fn trace(self) -> f64 {
        self.0[0] + self.0[1] + self.0[2]
    }
    /// Deviator.
    pub fn deviator(self) -> Self {
        self - Self::isotropic(self.trace() / 3.0)
    }
    /// Double contraction a:b; a shear counts twice.
    pub fn contract(self, other: Self) -> f64 {
        let (mut normal, mut shear) = (0.0, 0.0);
        for a in 0..3 {
            normal += self.0[a] * other.0[a];
        }
        for a in 3..N {
            shear += self.0[a] * other.0[a];
        }
        normal + 2.0 * shear
    }
}

impl<const D: usize> Default for Matrix<D> {
    fn default() -> Self {
        Self([[0.0; D]; D])
    }
}

impl<const D: usize> Matrix<D> {
    /// Adds `factor a (x) b`.
    #[inline(always)]
    pub fn add_outer(&mut self, factor: f64, a: Vector<D>, b: Vector<D>) {
        for i in 0..D {
            let f = factor * a.0[i];
            for j in 0..D {
                self.0[i][j] += f * b.0[j];
            }
        }
    }
}
