//! The one table of particle fields: what is stored, in which unit, and what it means.
//! Snapshots, checkpoints, VTK views and the documentation all read it; a field exists nowhere else.

/// Shape of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rank {
    /// One f64.
    Scalar,
    /// Three f64: x y z (see [`crate::space::Space`]).
    Vector,
    /// Six f64: XX YY ZZ XY YZ XZ.
    Symmetric,
    /// One u64.
    Whole,
}

impl Rank {
    /// Numbers per particle.
    pub fn components(self) -> usize {
        match self {
            Self::Scalar | Self::Whole => 1,
            Self::Vector => 3,
            Self::Symmetric => 6,
        }
    }
}

/// Which files hold a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Kept {
    /// Snapshots for people, and checkpoints.
    Everywhere,
    /// Checkpoints only: needed to go on with the same bits.
    Checkpoint,
}

/// One row of the table.
#[derive(Debug, PartialEq, Eq)]
pub struct Field {
    /// Name of the dataset.
    pub name: &'static str,
    /// SI unit, `1` for pure numbers.
    pub unit: &'static str,
    /// Shape.
    pub rank: Rank,
    /// Files that hold it.
    pub kept: Kept,
    /// One sentence.
    pub description: &'static str,
}

macro_rules! fields {
    ($($constant:ident $name:literal $unit:literal $rank:ident $kept:ident $description:literal)*) => {
        $(#[doc = $description] pub static $constant: Field =
            Field { name: $name, unit: $unit, rank: Rank::$rank, kept: Kept::$kept, description: $description };)*
        /// The whole table.
        pub static FIELDS: &[&Field] = &[$(&$constant),*];
    };
}

fields! {
    ID "id" "1" Whole Everywhere "Global particle number, counted from 0 in lattice order; the same on any number of ranks"
    BODY "body" "1" Whole Everywhere "Index of the scene's body the particle was made for"
    POSITION "position" "m" Vector Everywhere "Position; x is the radius in the axisymmetric space"
    VELOCITY "velocity" "m/s" Vector Everywhere "Velocity"
    ACCELERATION "acceleration" "m/s2" Vector Checkpoint "Acceleration at the same time, gravity included"
    MASS "mass" "kg" Scalar Everywhere "Mass; per metre of depth in plane strain, of the whole ring in the axisymmetric space"
    DENSITY "density" "kg/m3" Scalar Everywhere "Density"
    STRESS "stress" "Pa" Symmetric Everywhere "Cauchy stress, tension positive"
    STRESS_WORK "stress_work" "J/kg" Scalar Everywhere "Work the stress has done on the material's strain, per unit of mass"
    VISCOUS_WORK "viscous_work" "J/kg" Scalar Everywhere "Heat of the viscosity between particles, per unit of mass"
    PLASTIC_STRAIN "plastic_strain" "1" Scalar Everywhere "Accumulated deviatoric plastic strain"
}
