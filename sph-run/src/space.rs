//! The three spaces as types: sizes of vectors and tensors, and what differs between them.

use crate::algebra::{Matrix, Number, Sym, Vector};
use formats::space::Space as Kind;
use std::f64::consts::TAU;
use std::fmt::Debug;

/// What the pair sweep and the updates need to know of a space.
///
/// `D` coordinates, `N` stress components. A particle's `metric` w is 1, or the radius in the axisymmetric space:
/// with it one work-conjugate pair of operators serves all spaces (see [`crate::rates`]).
pub trait Space<const D: usize, const N: usize>: Copy + Debug + Default + Send + Sync + 'static {
    /// Its name on disk.
    const KIND: Kind;
    /// Is the metric anything but 1?
    const WEIGHTED: bool;

    /// Weight w of a place in volume integrals: dV = w dA up to a constant. 1, or the radius in the axisymmetric space:
    /// kept away from zero, and signed, so that images across the axis have negative ones.
    fn metric(x: Vector<D>, spacing: f64) -> f64;

    /// V = mass/(density w'), where w' is w times the constant (2 pi r in the axisymmetric space).
    fn volume(mass: f64, density: f64, x: Vector<D>, spacing: f64) -> f64;

    /// Rate of deformation from the velocity gradient; the out-of-plane rate comes from the place and the velocity.
    fn strain_rate(gradient: &Matrix<D>, x: Vector<D>, v: Vector<D>, spacing: f64) -> Sym<N>;

    /// stress . n
    fn traction<T: Number>(stress: &Sym<N, T>, n: Vector<D, T>) -> Vector<D, T>;

    /// The tensor as a matrix of the D coordinates.
    fn matrix(stress: &Sym<N>) -> Matrix<D>;

    /// The part of the acceleration that is not a pair sum: -sigma_theta/(rho r) e_r in the axisymmetric space.
    fn hoop(stress: &Sym<N>, density: f64, x: Vector<D>, spacing: f64) -> Vector<D>;

    /// Spin vector of the skew part W of the velocity gradient, W_ab = (d_b v_a - d_a v_b)/2:
    /// components (W_zy, W_xz, W_yx). The plane spaces have the middle one only.
    fn spin(gradient: &Matrix<D>) -> [f64; 3];

    /// Coordinates as on disk, and back.
    fn to_disk(x: Vector<D>) -> [f64; 3];
    fn from_disk(x: [f64; 3]) -> Vector<D>;
    fn stress_to_disk(s: Sym<N>) -> [f64; 6];
    fn stress_from_disk(s: [f64; 6]) -> Sym<N>;

    /// Index of a disk axis among the coordinates; none if the space lacks it.
    fn axis(disk: usize) -> Option<usize>;
}

/// See [`Kind::PlaneStrain`].
#[derive(Clone, Copy, Debug, Default)]
pub struct PlaneStrain;
/// See [`Kind::Axisymmetric`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Axisymmetric;
/// See [`Kind::ThreeD`].
#[derive(Clone, Copy, Debug, Default)]
pub struct ThreeD;

/// Layout of the two plane spaces: coordinates x z, tensor xx yy zz xz.
mod plane {
    use super::*;
    #[inline(always)]
    pub fn traction<T: Number>(s: &Sym<4, T>, n: Vector<2, T>) -> Vector<2, T> {
        let [xx, _, zz, xz] = s.0;
        Matrix([[xx, xz], [xz, zz]]).times(n)
    }
    pub fn matrix(s: &Sym<4>) -> Matrix<2> {
        let [xx, _, zz, xz] = s.0;
        Matrix([[xx, xz], [xz, zz]])
    }
    pub fn spin(g: &Matrix<2>) -> [f64; 3] {
        [0.0, 0.5 * (g.0[0][1] - g.0[1][0]), 0.0]
    }
    pub fn rate(g: &Matrix<2>, out_of_plane: f64) -> Sym<4> {
        Sym([g.0[0][0], out_of_plane, g.0[1][1], 0.5 * (g.0[0][1] + g.0[1][0])])
    }
    pub fn to_disk(x: Vector<2>) -> [f64; 3] {
        [x.0[0], 0.0, x.0[1]]
    }
    pub fn from_disk(x: [f64; 3]) -> Vector<2> {
        Vector([x[0], x[2]])
    }
    pub fn stress_to_disk(s: Sym<4>) -> [f64; 6] {
        [s.0[0], s.0[1], s.0[2], 0.0, 0.0, s.0[3]]
    }
    pub fn stress_from_disk(s: [f64; 6]) -> Sym<4> {
        Sym([s[0], s[1], s[2], s[5]])
    }
    pub fn axis(disk: usize) -> Option<usize> {
        [Some(0), None, Some(1)][disk]
    }
}

macro_rules! plane_layout {
    () => {
        #[inline(always)]
        fn traction<T: Number>(s: &Sym<4, T>, n: Vector<2, T>) -> Vector<2, T> {
            plane::traction(s, n)
        }
        fn matrix(s: &Sym<4>) -> Matrix<2> {
            plane::matrix(s)
        }
        fn spin(g: &Matrix<2>) -> [f64; 3] {
            plane::spin(g)
        }
        fn to_disk(x: Vector<2>) -> [f64; 3] {
            plane::to_disk(x)
        }
        fn from_disk(x: [f64; 3]) -> Vector<2> {
            plane::from_disk(x)
        }
        fn stress_to_disk(s: Sym<4>) -> [f64; 6] {
            plane::stress_to_disk(s)
        }
        fn stress_from_disk(s: [f64; 6]) -> Sym<4> {
            plane::stress_from_disk(s)
        }
        fn axis(disk: usize) -> Option<usize> {
            plane::axis(disk)
        }
    };
}

impl Space<2, 4> for PlaneStrain {
    const KIND: Kind = Kind::PlaneStrain;
    const WEIGHTED: bool = false;
    fn metric(_: Vector<2>, _: f64) -> f64 {
        1.0
    }
    fn volume(mass: f64, density: f64, _: Vector<2>, _: f64) -> f64 {
        mass / density
    }
    fn strain_rate(g: &Matrix<2>, _: Vector<2>, _: Vector<2>, _: f64) -> Sym<4> {
        plane::rate(g, 0.0)
    }
    fn hoop(_: &Sym<4>, _: f64, _: Vector<2>, _: f64) -> Vector<2> {
        Vector::default()
    }
    plane_layout!();
}

/// Radius kept away from zero where it divides: not below dx/2, where the first ring lies at the start. A ring at r
/// swings at c/r, and the largest stable time step falls with it.
fn radius(x: Vector<2>, spacing: f64) -> f64 {
    x.0[0].abs().max(0.5 * spacing)
}

impl Space<2, 4> for Axisymmetric {
    const KIND: Kind = Kind::Axisymmetric;
    const WEIGHTED: bool = true;
    fn metric(x: Vector<2>, spacing: f64) -> f64 {
        radius(x, spacing).copysign(x.0[0])
    }
    fn volume(mass: f64, density: f64, x: Vector<2>, spacing: f64) -> f64 {
        mass / (TAU * radius(x, spacing) * density)
    }
    fn strain_rate(g: &Matrix<2>, x: Vector<2>, v: Vector<2>, spacing: f64) -> Sym<4> {
        plane::rate(g, v.0[0] / radius(x, spacing))
    }
    fn hoop(s: &Sym<4>, density: f64, x: Vector<2>, spacing: f64) -> Vector<2> {
        Vector([-s.0[1] / (density * radius(x, spacing)), 0.0])
    }
    plane_layout!();
}

impl Space<3, 6> for ThreeD {
    const KIND: Kind = Kind::ThreeD;
    const WEIGHTED: bool = false;
    fn metric(_: Vector<3>, _: f64) -> f64 {
        1.0
    }
    fn volume(mass: f64, density: f64, _: Vector<3>, _: f64) -> f64 {
        mass / density
    }
    fn strain_rate(g: &Matrix<3>, _: Vector<3>, _: Vector<3>, _: f64) -> Sym<6> {
        let m = &g.0;
        let shear = |a: usize, b: usize| 0.5 * (m[a][b] + m[b][a]);
        Sym([m[0][0], m[1][1], m[2][2], shear(0, 1), shear(1, 2), shear(0, 2)])
    }
    #[inline(always)]
    fn traction<T: Number>(s: &Sym<6, T>, n: Vector<3, T>) -> Vector<3, T> {
        let [xx, yy, zz, xy, yz, xz] = s.0;
        Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).times(n)
    }
    fn matrix(s: &Sym<6>) -> Matrix<3> {
        let [xx, yy, zz, xy, yz, xz] = s.0;
        Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    }
    fn hoop(_: &Sym<6>, _: f64, _: Vector<3>, _: f64) -> Vector<3> {
        Vector::default()
    }
    fn spin(g: &Matrix<3>) -> [f64; 3] {
        let m = &g.0;
        [0.5 * (m[2][1] - m[1][2]), 0.5 * (m[0][2] - m[2][0]), 0.5 * (m[1][0] - m[0][1])]
    }
    fn to_disk(x: Vector<3>) -> [f64; 3] {
        x.0
    }
    fn from_disk(x: [f64; 3]) -> Vector<3> {
        Vector(x)
    }
    fn stress_to_disk(s: Sym<6>) -> [f64; 6] {
        s.0
    }
    fn stress_from_disk(s: [f64; 6]) -> Sym<6> {
        Sym(s)
    }
    fn axis(disk: usize) -> Option<usize> {
        Some(disk)
    }
}
