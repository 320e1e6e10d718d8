//! Types chosen once: a space, a kernel and a material bundled, so that signatures stay short.

use crate::lanes::Lanes;
use crate::sweep::Scales;
use crate::{material::Material, space::Space};
use formats::kernel::Kernel as Kind;
use std::marker::PhantomData;

/// A smoothing kernel as a type, in lanes.
///
/// Both kernels are powers of what is left of the support, (2h - r)+, and so exact zeros outside it.
pub trait Kernel: Copy + Send + Sync + 'static {
    /// Its name, shape and normalisation.
    const KIND: Kind;
    /// W = norm VALUE h^-VALUE_POWER value(r), with the norm of W in D dimensions.
    const VALUE: f64;
    const VALUE_POWER: i32;
    /// W'/r = norm SLOPE h^-SLOPE_POWER slope(r), with the norm of W in D dimensions.
    const SLOPE: f64;
    const SLOPE_POWER: i32;

    /// W up to a factor.
    fn value<L: Lanes>(r: L, scales: &Scales<L>) -> L;
    /// W'/r up to a factor; `inverse`: 1/r.
    fn slope<L: Lanes>(r: L, inverse: L, scales: &Scales<L>) -> L;
}

/// See [`Kind::CubicSpline`].
#[derive(Clone, Copy, Debug)]
pub struct CubicSpline;
impl Kernel for CubicSpline {
    const KIND: Kind = Kind::CubicSpline;
    // ((2-q)+^3 - 4 (1-q)+^3)/6
    const VALUE: f64 = 1.0 / 6.0;
    const VALUE_POWER: i32 = 3;
    const SLOPE: f64 = 0.5;
    const SLOPE_POWER: i32 = 3;

    #[inline(always)]
    fn value<L: Lanes>(r: L, scales: &Scales<L>) -> L {
        let (outer, inner) = (scales.outer(r), scales.inner(r));
        (-(inner * inner * inner)).multiply_add(scales.four, outer * outer * outer)
    }
    #[inline(always)]
    fn slope<L: Lanes>(r: L, inverse: L, scales: &Scales<L>) -> L {
        let (outer, inner) = (scales.outer(r), scales.inner(r));
        (inner * inner).multiply_add(scales.four, -(outer * outer)) * inverse
    }
}

/// See [`Kind::WendlandC2`].
#[derive(Clone, Copy, Debug)]
pub struct WendlandC2;
impl Kernel for WendlandC2 {
    const KIND: Kind = Kind::WendlandC2;
    const VALUE: f64 = 1.0 / 16.0;
    const VALUE_POWER: i32 = 5;
    // -5 (1 - q/2)+^3
    const SLOPE: f64 = 5.0 / 8.0;
    const SLOPE_POWER: i32 = 5;

    #[inline(always)]
    fn value<L: Lanes>(r: L, scales: &Scales<L>) -> L {
        let square = scales.outer(r) * scales.outer(r);
        square * square * (r + r + scales.h)
    }
    #[inline(always)]
    fn slope<L: Lanes>(r: L, _: L, scales: &Scales<L>) -> L {
        let outer = scales.outer(r);
        -(outer * outer * outer)
    }
}

/// The axes along which the solver is compiled: space (D coordinates, N stress components), kernel, material.
pub trait Physics<const D: usize, const N: usize>: 'static {
    type Space: Space<D, N>;
    type Kernel: Kernel;
    type Material: Material;
}

/// The only [`Physics`] there is: three types side by side.
pub struct Model<S, K, M>(PhantomData<(S, K, M)>);

impl<const D: usize, const N: usize, S: Space<D, N>, K: Kernel, M: Material + 'static> Physics<D, N>
    for Model<S, K, M>
{
    type Space = S;
    type Kernel = K;
    type Material = M;
}
