//! The three spaces a scene can live in, and how their vectors and tensors are laid out.

use serde::{Deserialize, Serialize};

/// The space a scene is solved in. On disk every vector has three components `x y z` with z up:
/// the plane spaces use x and z, and leave y at zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Space {
    /// x-z plane, no strain along y; the out-of-plane stress `sigma_yy` is kept.
    #[serde(rename = "plane-strain")]
    PlaneStrain,
    /// r-z half plane: x is the radius r, y the azimuth; `sigma_yy` is the hoop stress.
    #[serde(rename = "axisymmetric")]
    Axisymmetric,
    /// Three dimensions.
    #[serde(rename = "3d")]
    ThreeD,
}

impl Space {
    /// Every space, in the order they are documented.
    pub const ALL: [Self; 3] = [Self::PlaneStrain, Self::Axisymmetric, Self::ThreeD];

    /// Its name in scenes and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::PlaneStrain => "plane-strain",
            Self::Axisymmetric => "axisymmetric",
            Self::ThreeD => "3d",
        }
    }

    /// Number of coordinates that are solved for: the dimension of the kernel.
    pub fn dimension(self) -> usize {
        match self {
            Self::PlaneStrain | Self::Axisymmetric => 2,
            Self::ThreeD => 3,
        }
    }

    /// The axes (0 x, 1 y, 2 z) that are solved for.
    pub fn axes(self) -> &'static [usize] {
        match self {
            Self::PlaneStrain | Self::Axisymmetric => &[0, 2],
            Self::ThreeD => &[0, 1, 2],
        }
    }
}
