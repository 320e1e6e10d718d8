//! Published scaling laws of collapsing columns of dry grains on a plane; a = height over radius of the column.
//!
//! Lube, Huppert, Sparks & Hallworth (2004), J. Fluid Mech. 508, 175-199, through Yang et al. (2020), Eqs 45 and 46; in
//! channels Lube, Huppert, Sparks & Freundt (2005), Phys. Rev. E 72, 041301, through Szewc (2017), Eq 24, with the limits of
//! other sources (tests/validation/columns-plane/reference.csv).

/// Largest a for which the height is known.
const HIGHEST_KNOWN: f64 = 10.0;

/// Final run-out (r_inf - r0)/r0 of a cylinder of aspect ratio `a` (Eq 45): 1.24 a below a = 1.7, 1.6 sqrt(a) above.
pub fn lube_runout(a: f64) -> f64 {
    if a < 1.7 { 1.24 * a } else { 1.6 * a.sqrt() }
}

/// Final height h_inf/r0 in the middle of a cylinder of aspect ratio `a`: the lower of both branches of Eq 46,
/// min(a, 0.88 a^(1/6)). `None` above a = 10, where the law ends.
///
/// As printed, Eq 46 jumps at a = 1.7 from the column's own height, 1.7, to 0.961. No deposit is higher than its
/// column, and none that has given way in the middle stands higher than the second branch: they meet at a = 0.858.
pub fn lube_height(a: f64) -> Option<f64> {
    (a <= HIGHEST_KNOWN).then(|| a.min(0.88 * a.powf(1.0 / 6.0)))
}

/// Final run-out (x_inf - L0)/L0 of a rectangle of aspect ratio `a` = H0/L0 in a channel: 1.2 a up to 1.8, 1.9 a^(2/3) from
/// 2.8 on. `None` between, where the law has a gap, and above a = 20.
pub fn lube_plane_runout(a: f64) -> Option<f64> {
    match a {
        _ if a <= 1.8 => Some(1.2 * a),
        _ if (2.8..=20.0).contains(&a) => Some(1.9 * a.powf(2.0 / 3.0)),
        _ => None,
    }
}

/// Final height h_inf/L0 at the wall of such a rectangle: a up to 1.15, a^0.4 above. `None` above a = 20.
pub fn lube_plane_height(a: f64) -> Option<f64> {
    (a <= 20.0).then(|| if a <= 1.15 { a } else { a.powf(0.4) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_both_branches() {
        let near = |value: f64, expected: f64| assert!((value - expected).abs() < 5e-4, "{value} {expected}");
        near(lube_runout(0.5), 0.62);
        near(lube_runout(1.0), 1.24);
        near(lube_runout(2.0), 2.2627);
        near(lube_runout(4.0), 3.2);
        for (a, height) in [(0.5, 0.5), (0.858, 0.858), (1.0, 0.88), (2.0, 0.9878), (4.0, 1.1087)] {
            near(lube_height(a).unwrap(), height);
        }
        assert_eq!(lube_height(10.5), None);
    }

    #[test]
    fn numbers_in_a_channel() {
        let near = |value: Option<f64>, expected: f64| assert!((value.unwrap() - expected).abs() < 5e-4, "{value:?}");
        near(lube_plane_runout(0.5), 0.6);
        near(lube_plane_runout(8.0), 7.6);
        near(lube_plane_height(0.5), 0.5);
        near(lube_plane_height(4.0), 1.7411);
        assert_eq!([2.3, 21.0].map(lube_plane_runout), [None; 2]);
        assert_eq!(lube_plane_height(20.5), None);
    }
}
