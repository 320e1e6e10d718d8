//! Published scaling laws of collapsing columns; a = height over radius of the column.

use serde::Deserialize;

/// A law of the aspect ratio.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// Run-out (r_inf - r0)/r0 of an axisymmetric column (Lube et al. 2004): 1.24 a below a = 1.7, 1.6 sqrt(a) above.
    LubeRunout,
    /// Height h_inf/r0 (Lube et al. 2004): the column's own height while its middle stands, 0.88 a^(1/6) for
    /// 1.7 < a < 10. As printed the two do not meet at 1.7; the lower of both is taken, they cross at a = 0.858.
    LubeHeight,
}

impl Law {
    /// The law's number at an aspect ratio.
    pub fn at(self, a: f64) -> f64 {
        match self {
            Self::LubeRunout if a < 1.7 => 1.24 * a,
            Self::LubeRunout => 1.6 * a.sqrt(),
            Self::LubeHeight => a.min(0.88 * a.powf(1.0 / 6.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lube() {
        let near = |value: f64, expected: f64| assert!((value - expected).abs() < 5e-4, "{value} {expected}");
        near(Law::LubeRunout.at(0.5), 0.62);
        near(Law::LubeRunout.at(1.0), 1.24);
        near(Law::LubeRunout.at(2.0), 2.2627);
        near(Law::LubeRunout.at(4.0), 3.2);
        near(Law::LubeHeight.at(0.5), 0.5);
        near(Law::LubeHeight.at(1.0), 0.88);
        near(Law::LubeHeight.at(2.0), 0.9878);
        near(Law::LubeHeight.at(4.0), 1.1087);
        near(Law::LubeHeight.at(0.858), 0.858);
    }
}
