//! What stands and what flows: the height up to which the material is at rest, and its share of the volume.

use crate::{geometry::Geometry, section::Section};
use formats::{snapshot::Rows, units};

/// The speed below which material counts as static.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StaticSpeed {
    /// As a part of sqrt(g H0).
    Part(f64),
    /// In m/s.
    Speed(f64),
}

impl StaticSpeed {
    /// From `"1 %"`, which is of sqrt(g H0), or a velocity as in scenes, `"2 cm/s"`.
    ///
    /// # Errors
    /// A sentence that says what would be right.
    pub fn parse(text: &str) -> Result<Self, String> {
        let speed = match text.trim().strip_suffix('%') {
            Some(number) => number.trim().parse().ok().map(|p: f64| Self::Part(p / 100.0)),
            None => Some(Self::Speed(units::parse(text, units::Dimension::Velocity)?)),
        };
        match speed {
            Some(Self::Part(v) | Self::Speed(v)) if !(v.is_finite() && v > 0.0) => None,
            other => other,
        }
        .ok_or_else(|| {
            format!("`{text}` is no speed: give a part of sqrt(g H0) as \"1 %\", or a velocity as \"2 cm/s\"")
        })
    }

    /// m/s; NaN for a part of sqrt(g H0) where there is no gravity or no height.
    pub fn value(self, g: &Geometry) -> f64 {
        match self {
            // sqrt(g H0) = H0/T.
            Self::Part(part) => g.time_scale().map_or(f64::NAN, |t| part * g.height / t),
            Self::Speed(speed) => speed,
        }
    }
}

/// What stands in one snapshot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flow {
    /// Height above the floor, m, below which everything in a bin of the profile is slower than the threshold: that of
    /// the surface where nothing is faster, 0 where there is no material.
    pub height: Vec<f64>,
    /// Volume of the particles slower than the threshold over that of all.
    pub share: f64,
}

impl Flow {
    /// Of the particles in `rows`; `threshold` in m/s. NaN where that is.
    ///
    /// The speed of the section is linear between the middles of its cells; below the lowest one nothing is looked for,
    /// since a floor that holds the material and one that lets it slide differ there.
    pub fn new(g: &Geometry, rows: &Rows, section: &Section, threshold: f64) -> Self {
        if threshold.is_nan() {
            return Self { height: vec![f64::NAN; section.bins], share: f64::NAN };
        }
        let height = (0..section.bins).map(|k| {
            let mut before = None;
            for j in 0..section.rows {
                let (z, v) = (Section::above(g, j), section.speed[j * section.bins + k]);
                match before {
                    _ if v.is_nan() => continue,
                    None if v >= threshold => return 0.0,
                    Some((low, slow)) if v >= threshold => return low + (z - low) * (threshold - slow) / (v - slow),
                    _ => before = Some((z, v)),
                }
            }
            section.height[k]
        });
        let (mut all, mut slow) = (0.0, 0.0);
        for row in 0..rows.len() {
            let volume = rows.mass[row] / rows.density[row];
            let speed2: f64 = rows.velocity[row].iter().map(|v| v * v).sum();
            all += volume;
            slow += if speed2 < threshold * threshold { volume } else { 0.0 };
        }
        Self { height: height.collect(), share: slow / all }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        deposit::Deposit,
        sample::Sampler,
        testing::{block, geometry},
    };
    use formats::{kernel::Kernel, space::Space};

    fn flow(g: &Geometry, rows: &Rows, threshold: f64) -> Flow {
        let sampler = Sampler::new(g, rows);
        let deposit = Deposit::new(g, rows, &sampler);
        Flow::new(g, rows, &Section::new(g, rows, &sampler, &deposit.profile), threshold)
    }

    /// |v| = 2 z: slower than 0.1 m/s up to 0.05 m, a quarter of a block 0.2 m high.
    #[test]
    fn a_block_in_simple_shear_stands_up_to_a_known_height() {
        for space in Space::ALL {
            let mut g = geometry(space, Kernel::CubicSpline, 0.01);
            g.height = 0.2;
            let mut rows = block(&g, [10, if space == Space::ThreeD { 10 } else { 1 }, 20]);
            for (v, x) in rows.velocity.iter_mut().zip(&rows.position) {
                *v = [2.0 * x[2], 0.0, 0.0];
            }
            let f = flow(&g, &rows, 0.1);
            f.height[..8].iter().for_each(|h| assert!((h - 0.05).abs() < 1e-9, "{space:?}: {h}"));
            assert!((f.share - 0.25).abs() < 1e-12, "{space:?}: {}", f.share);
            let f = flow(&g, &rows, 10.0);
            f.height[..8].iter().for_each(|h| assert!((h - 0.2).abs() < 0.05 * g.dx, "{space:?}: {h}"));
            assert_eq!(f.share, 1.0);
            let f = flow(&g, &rows, 1e-3);
            assert!(f.height.iter().all(|h| *h == 0.0) && f.share == 0.0);
            assert!(flow(&g, &rows, f64::NAN).share.is_nan());
        }
    }

    #[test]
    fn thresholds_are_read_with_their_unit() {
        let g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01);
        assert_eq!(StaticSpeed::parse("1 %"), Ok(StaticSpeed::Part(0.01)));
        assert!((StaticSpeed::Part(0.01).value(&g) - 0.01 * (9.81 * g.height).sqrt()).abs() < 1e-15);
        assert_eq!(StaticSpeed::parse("2 cm/s").unwrap().value(&g), 0.02);
        let falls_nowhere = Geometry { gravity: [0.0; 3], ..g };
        assert!(StaticSpeed::Part(0.01).value(&falls_nowhere).is_nan());
        for wrong in ["", "1", "0 %", "-1 cm/s", "3 kg", "nan %"] {
            assert!(StaticSpeed::parse(wrong).is_err(), "{wrong}");
        }
    }
}
