//! Small vectors and tensors of fixed size, of plain numbers or of lanes of them ([`crate::lanes`]).

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// What vectors and tensors are made of: f64, f32, or one of either for each particle of a block.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> {
    /// self factor + addend: in lanes with one rounding, in plain numbers with two.
    fn multiply_add(self, factor: Self, addend: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn multiply_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }
}

impl Number for f32 {
    #[inline(always)]
    fn multiply_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }
}

/// A vector of D components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector<const D: usize, T = f64>(pub [T; D]);

/// A symmetric tensor: the three normal components xx yy zz first, then the shears.
/// N = 4 in the plane spaces (xx yy zz xz), N = 6 in three dimensions (xx yy zz xy yz xz, the order on disk).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sym<const N: usize, T = f64>(pub [T; N]);

/// A general D x D tensor, `m[a][b]` = d v_a / d x_b for a velocity gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix<const D: usize, T = f64>(pub [[T; D]; D]);

macro_rules! componentwise {
    ($name:ident) => {
        impl<const N: usize, T: Number + Default> Default for $name<N, T> {
            fn default() -> Self {
                Self([T::default(); N])
            }
        }
        impl<const N: usize, T: Number> Add for $name<N, T> {
            type Output = Self;
            #[inline(always)]
            fn add(mut self, other: Self) -> Self {
                for a in 0..N {
                    self.0[a] = self.0[a] + other.0[a];
                }
                self
            }
        }
        impl<const N: usize, T: Number> AddAssign for $name<N, T> {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl<const N: usize, T: Number> Sub for $name<N, T> {
            type Output = Self;
            #[inline(always)]
            fn sub(mut self, other: Self) -> Self {
                for a in 0..N {
                    self.0[a] = self.0[a] - other.0[a];
                }
                self
            }
        }
        impl<const N: usize, T: Number> Mul<T> for $name<N, T> {
            type Output = Self;
            #[inline(always)]
            fn mul(mut self, factor: T) -> Self {
                for a in 0..N {
                    self.0[a] = self.0[a] * factor;
                }
                self
            }
        }
        impl<const N: usize, T: Number> Neg for $name<N, T> {
            type Output = Self;
            #[inline(always)]
            fn neg(mut self) -> Self {
                for a in 0..N {
                    self.0[a] = -self.0[a];
                }
                self
            }
        }
        impl<const N: usize, T: Number> $name<N, T> {
            /// Adds `factor other`.
            #[inline(always)]
            pub fn add_scaled(&mut self, factor: T, other: Self) {
                for a in 0..N {
                    self.0[a] = other.0[a].multiply_add(factor, self.0[a]);
                }
            }
        }
    };
}
componentwise!(Vector);
componentwise!(Sym);

impl<const D: usize, T: Number> Vector<D, T> {
    /// Inner product, summed from the first component on.
    #[inline(always)]
    pub fn dot(self, other: Self) -> T {
        let mut sum = self.0[0] * other.0[0];
        for a in 1..D {
            sum = self.0[a].multiply_add(other.0[a], sum);
        }
        sum
    }
    /// Squared length.
    #[inline(always)]
    pub fn norm2(self) -> T {
        self.dot(self)
    }
}

impl<const D: usize> Vector<D> {
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

impl<const D: usize, T: Number> Add for Matrix<D, T> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for a in 0..D {
            for b in 0..D {
                self.0[a][b] = self.0[a][b] + other.0[a][b];
            }
        }
        self
    }
}

impl<const D: usize> Default for Matrix<D> {
    fn default() -> Self {
        Self([[0.0; D]; D])
    }
}

impl<const D: usize, T: Number> Matrix<D, T> {
    /// Matrix times vector.
    #[inline(always)]
    pub fn times(&self, v: Vector<D, T>) -> Vector<D, T> {
        let mut product = v;
        for a in 0..D {
            product.0[a] = Vector(self.0[a]).dot(v);
        }
        product
    }
    /// Matrix times number.
    #[inline(always)]
    pub fn times_number(mut self, factor: T) -> Self {
        for a in 0..D {
            for b in 0..D {
                self.0[a][b] = self.0[a][b] * factor;
            }
        }
        self
    }
    /// Adds `a (x) b`.
    #[inline(always)]
    pub fn add_outer(&mut self, a: Vector<D, T>, b: Vector<D, T>) {
        for i in 0..D {
            for j in 0..D {
                self.0[i][j] = a.0[i].multiply_add(b.0[j], self.0[i][j]);
            }
        }
    }
}

impl<const D: usize> Matrix<D> {
    /// The unit tensor.
    pub fn unit() -> Self {
        Self(std::array::from_fn(|a| std::array::from_fn(|b| if a == b { 1.0 } else { 0.0 })))
    }
    /// Matrix product.
    pub fn product(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|a| {
            std::array::from_fn(|b| (0..D).fold(0.0, |sum, c| sum + self.0[a][c] * other.0[c][b]))
        }))
    }
    /// M + factor M M
    #[inline(always)]
    pub fn with_square(&self, factor: f64) -> Self {
        let square = self.product(self);
        Self(std::array::from_fn(|a| std::array::from_fn(|b| self.0[a][b] + factor * square.0[a][b])))
    }
    /// Determinant; D is 2 or 3.
    pub fn determinant(&self) -> f64 {
        (0..D).fold(0.0, |sum, b| sum + self.0[0][b] * self.cofactor(0, b))
    }
    /// Inverse, given the determinant.
    pub fn inverse(&self, determinant: f64) -> Self {
        Self(std::array::from_fn(|a| std::array::from_fn(|b| self.cofactor(b, a) / determinant)))
    }
    fn cofactor(&self, a: usize, b: usize) -> f64 {
        const { assert!(D == 2 || D == 3) };
        let m = &self.0;
        if D == 2 {
            let minor = m[1 - a][1 - b];
            return if a == b { minor } else { -minor };
        }
        // Cyclic indices carry the sign.
        let (r, s, u, v) = ((a + 1) % D, (a + 2) % D, (b + 1) % D, (b + 2) % D);
        m[r][u] * m[s][v] - m[r][v] * m[s][u]
    }
}

/// The part of a symmetric tensor (xx yy zz xy yz xz) with its positive principal values only, by Jacobi rotations.
pub fn tensile_part(s: [f64; 6]) -> [f64; 6] {
    let mut m = [[s[0], s[3], s[5]], [s[3], s[1], s[4]], [s[5], s[4], s[2]]];
    let mut axes = Matrix::<3>::unit().0;
    // Quadratic convergence: six sweeps reach rounding from any start.
    for _ in 0..6 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if m[p][q] == 0.0 {
                continue;
            }
            let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
            let t = 1.0_f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
            let cos = 1.0 / (t * t + 1.0).sqrt();
            let sin = t * cos;
            for row in &mut m {
                (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
            }
            for k in 0..3 {
                (m[p][k], m[q][k]) = (cos * m[p][k] - sin * m[q][k], sin * m[p][k] + cos * m[q][k]);
                (axes[k][p], axes[k][q]) = (cos * axes[k][p] - sin * axes[k][q], sin * axes[k][p] + cos * axes[k][q]);
            }
        }
    }
    let element = |a: usize, b: usize| (0..3).map(|k| m[k][k].max(0.0) * axes[a][k] * axes[b][k]).sum();
    [element(0, 0), element(1, 1), element(2, 2), element(0, 1), element(1, 2), element(0, 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_of_a_matrix() {
        let m = Matrix([[2.0, 0.3, -0.5], [0.1, 1.5, 0.7], [0.4, -0.2, 0.9]]);
        let one = m.product(&m.inverse(m.determinant()));
        for (row, unit) in one.0.iter().zip(Matrix::<3>::unit().0) {
            assert!(row.iter().zip(unit).all(|(a, b)| (a - b).abs() < 1e-14), "{one:?}");
        }
        let m = Matrix([[2.0, 0.3], [0.1, 1.5]]);
        assert!((m.determinant() - 2.97).abs() < 1e-15);
        assert!((m.product(&m.inverse(2.97)).0[1][0]).abs() < 1e-16);
    }

    /// Tensile and compressive part add up, share the principal axes, and have no product.
    #[test]
    fn a_tensor_splits_into_tension_and_compression() {
        let s = [3.0, -2.0, 0.5, 1.0, -0.7, 2.0];
        let (t, c) = (tensile_part(s), tensile_part(s.map(|x| -x)).map(|x| -x));
        assert!((0..6).all(|k| (t[k] + c[k] - s[k]).abs() < 1e-13), "{t:?} {c:?}");
        let matrix = |s: [f64; 6]| Matrix([[s[0], s[3], s[5]], [s[3], s[1], s[4]], [s[5], s[4], s[2]]]);
        let product = matrix(t).product(&matrix(c));
        assert!(product.0.iter().flatten().all(|x| x.abs() < 1e-13), "{product:?}");
        // In the plane: a pure shear pulls along the diagonal with its own size.
        let t = tensile_part([0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
        assert!((t[0] - 1.0).abs() < 1e-15 && (t[2] - 1.0).abs() < 1e-15 && (t[5] - 1.0).abs() < 1e-15, "{t:?}");
    }
}
