//! Names of published scaling laws in `checks.toml`; the laws themselves are in [`formats::laws`].

use formats::laws;
use serde::Deserialize;

/// A law of the aspect ratio.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// [`laws::lube_runout`].
    LubeRunout,
    /// [`laws::lube_height`].
    LubeHeight,
}

impl Law {
    /// The law's number at an aspect ratio; not-a-number, which no measured number is close to, beyond its range.
    pub fn at(self, a: f64) -> f64 {
        match self {
            Self::LubeRunout => laws::lube_runout(a),
            Self::LubeHeight => laws::lube_height(a).unwrap_or(f64::NAN),
        }
    }
}
