//! Types chosen once: a space, a kernel and a material bundled, so that signatures stay short.

use crate::{material::Material, space::Space};
use formats::kernel::Kernel as Kind;
use std::marker::PhantomData;

/// A smoothing kernel as a type: shape and slope are resolved at compile time.
pub trait Kernel: Copy + Send + Sync + 'static {
    /// Its name, shape and normalisation.
    const KIND: Kind;
}

/// See [`Kind::CubicSpline`].
#[derive(Clone, Copy, Debug)]
pub struct CubicSpline;
impl Kernel for CubicSpline {
    const KIND: Kind = Kind::CubicSpline;
}

/// See [`Kind::WendlandC2`].
#[derive(Clone, Copy, Debug)]
pub struct WendlandC2;
impl Kernel for WendlandC2 {
    const KIND: Kind = Kind::WendlandC2;
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
