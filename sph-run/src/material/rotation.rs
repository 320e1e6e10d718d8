//! How a stress turns with the material.
//!
//! The spin vector (W_zy, W_xz, W_yx) stands for the skew tensor W: W u = spin x u.

use crate::algebra::Sym;
use formats::scene::Rotation;

/// The stress after the spin of one step.
///
/// `stress` has N = 4 components (xx yy zz xz, which only `spin[1]` turns) or N = 6 (xx yy zz xy yz xz);
/// `spin` in 1/s, `dt` in s.
#[inline(always)]
pub fn rotate<const N: usize>(stress: Sym<N>, spin: [f64; 3], dt: f64, scheme: Rotation) -> Sym<N> {
    const { assert!(N == 4 || N == 6) };
    match scheme {
        Rotation::Jaumann => stress + jaumann(stress, spin) * dt,
        Rotation::HughesWinget => hughes_winget(stress, spin.map(|w| 0.5 * dt * w)),
    }
}

/// The part of the Jaumann rate that turns the stress: W sigma - sigma W (Yang et al. 2020, Eq 15).
#[inline(always)]
fn jaumann<const N: usize>(stress: Sym<N>, spin: [f64; 3]) -> Sym<N> {
    let s = &stress.0;
    let [a, b, c] = spin;
    let mut rate = Sym::default();
    let r = &mut rate.0;
    if N == 4 {
        r[0] = 2.0 * b * s[3];
        r[2] = -2.0 * b * s[3];
        r[3] = b * (s[2] - s[0]);
    } else {
        let (xx, yy, zz, xy, yz, xz) = (s[0], s[1], s[2], s[3], s[N - 2], s[N - 1]);
        r[0] = 2.0 * (b * xz - c * xy);
        r[1] = 2.0 * (c * xy - a * yz);
        r[2] = 2.0 * (a * yz - b * xz);
        r[3] = c * (xx - yy) + b * yz - a * xz;
        r[N - 2] = a * (yy - zz) + c * xz - b * xy;
        r[N - 1] = b * (zz - xx) + a * xy - c * yz;
    }
    rate
}

/// Q sigma Q^T with Q = (I - W dt/2)^-1 (I + W dt/2), orthogonal to round-off (Hughes & Winget 1980).
/// With the half angle vector h = spin dt/2, Q = ((1 - h.h) I + 2 h h^T + 2 [h]x)/(1 + h.h).
#[inline(always)]
fn hughes_winget<const N: usize>(stress: Sym<N>, half: [f64; 3]) -> Sym<N> {
    let s = &stress.0;
    let mut turned = stress;
    let t = &mut turned.0;
    if N == 4 {
        // In the plane Mohr's circle turns by twice the angle; its centre stays.
        let h = half[1];
        let inverse = 1.0 / (1.0 + h * h);
        let (cos, sin) = ((1.0 - h * h) * inverse, 2.0 * h * inverse);
        let (cos2, sin2) = (cos * cos - sin * sin, 2.0 * cos * sin);
        let (centre, difference) = (0.5 * (s[0] + s[2]), 0.5 * (s[0] - s[2]));
        let across = cos2 * difference + sin2 * s[3];
        t[0] = centre + across;
        t[2] = centre - across;
        t[3] = cos2 * s[3] - sin2 * difference;
        return turned;
    }
    let [a, b, c] = half;
    let square = a * a + b * b + c * c;
    let (inverse, diagonal) = (1.0 / (1.0 + square), 1.0 - square);
    let q = [
        [diagonal + 2.0 * a * a, 2.0 * (a * b - c), 2.0 * (a * c + b)],
        [2.0 * (a * b + c), diagonal + 2.0 * b * b, 2.0 * (b * c - a)],
        [2.0 * (a * c - b), 2.0 * (b * c + a), diagonal + 2.0 * c * c],
    ]
    .map(|row| row.map(|element| element * inverse));
    let (xx, yy, zz, xy, yz, xz) = (s[0], s[1], s[2], s[3], s[N - 2], s[N - 1]);
    let m = q.map(|r| {
        [r[0] * xx + r[1] * xy + r[2] * xz, r[0] * xy + r[1] * yy + r[2] * yz, r[0] * xz + r[1] * yz + r[2] * zz]
    });
    let element = |i: usize, j: usize| m[i][0] * q[j][0] + m[i][1] * q[j][1] + m[i][2] * q[j][2];
    t[0] = element(0, 0);
    t[1] = element(1, 1);
    t[2] = element(2, 2);
    t[3] = element(0, 1);
    t[N - 2] = element(1, 2);
    t[N - 1] = element(0, 2);
    turned
}
