//! Particle files: snapshots for people and the particles of a checkpoint.
//!
//! One file is both our layout (`/particles/<field>`, rows in ascending id) and a valid VTKHDF file. Rows are sorted
//! by id whatever the number of ranks, so that the bytes of every dataset are the same on any number of them.
//!
//! | place | what |
//! |---|---|
//! | `/sph` | attributes: `format_version`, `content` (`snapshot` or `checkpoint`), `title`, `scene_hash`, `space`, `kernel`, `spacing` (m), `h` (m), `gravity` (m/s2), `time` (s), `step`, `count` |
//! | `/particles/<field>` | one contiguous dataset a row of [`schema::FIELDS`], `count` rows; attributes `units`, `description` |
//! | `/VTKHDF` | an unstructured grid of one vertex a particle; `Points` and `PointData/*` are links to `/particles/*` |

mod digest;
mod error;
mod read;
mod write;

pub use digest::Digests;
pub use error::FileError;
pub use read::{digest, digests, digests_of_shares, read, read_header, read_rows};
pub use write::write;

use crate::{kernel::Kernel, schema, schema::Field, schema::Kept, space::Space};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Version of the layout; newer and older ones are refused.
pub const FORMAT_VERSION: u64 = 2;

/// What a particle file says of itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The scene's title.
    pub title: String,
    /// Of what of the scene may not change while a run goes on: [`crate::scene::Scene::hash`].
    pub scene_hash: String,
    /// Space.
    pub space: Space,
    /// Kernel.
    pub kernel: Kernel,
    /// Lattice spacing dx, m.
    pub spacing: f64,
    /// Smoothing length h, m.
    pub h: f64,
    /// Gravity, m/s2.
    pub gravity: [f64; 3],
    /// Time, s.
    pub time: f64,
    /// Steps done.
    pub step: u64,
    /// Particles in the whole file.
    pub count: u64,
}

/// Consecutive rows of a particle file: all of them, or one rank's share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Number of the first row in the whole file.
    pub first: u64,
    /// See [`schema::ID`], and so on.
    pub id: Vec<u64>,
    pub body: Vec<u64>,
    pub position: Vec<[f64; 3]>,
    pub velocity: Vec<[f64; 3]>,
    /// Empty where the file does not hold it.
    pub acceleration: Vec<[f64; 3]>,
    pub mass: Vec<f64>,
    pub density: Vec<f64>,
    pub stress: Vec<[f64; 6]>,
    pub stress_work: Vec<f64>,
    pub viscous_work: Vec<f64>,
    pub plastic_strain: Vec<f64>,
}

/// A column of [`Rows`], borrowed.
#[derive(Clone, Copy, Debug)]
pub enum Column<'a> {
    /// u64.
    Whole(&'a [u64]),
    /// f64, row by row, `rank.components()` numbers a row.
    Real(&'a [f64]),
}

/// A column of [`Rows`] to fill.
#[derive(Debug)]
pub enum ColumnMut<'a> {
    Whole(&'a mut Vec<u64>),
    Scalar(&'a mut Vec<f64>),
    Vector(&'a mut Vec<[f64; 3]>),
    Symmetric(&'a mut Vec<[f64; 6]>),
}

/// The rows of one rank: consecutive, as equal as can be, from 0 to `count` over all ranks.
///
/// # Panics
/// If `rank` is not below `size`.
pub fn share(count: u64, rank: u64, size: u64) -> Range<u64> {
    assert!(rank < size, "rank {rank} of {size}");
    // In 128 bits, so that the product cannot overflow.
    let border = |r: u64| (u128::from(count) * u128::from(r) / u128::from(size)) as u64;
    border(rank)..border(rank + 1)
}

/// The fields a file holds, in table order.
pub(crate) fn fields_of(kept: Kept) -> impl Iterator<Item = &'static Field> {
    schema::FIELDS.iter().copied().filter(move |f| kept == Kept::Checkpoint || f.kept == Kept::Everywhere)
}

/// The name of what a file holds, in its `content` attribute.
fn content_name(kept: Kept) -> &'static str {
    match kept {
        Kept::Everywhere => "snapshot",
        Kept::Checkpoint => "checkpoint",
    }
}

impl Header {
    /// The header as bytes: floats by their bit patterns, all numbers little-endian, texts after their length.
    /// What the digest of a file begins with, and what must be equal on all ranks.
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = FORMAT_VERSION.to_le_bytes().to_vec();
        for text in [&self.title, &self.scene_hash, self.space.name(), self.kernel.name()] {
            bytes.extend((text.len() as u64).to_le_bytes());
            bytes.extend(text.as_bytes());
        }
        let [x, y, z] = self.gravity;
        for number in [self.spacing, self.h, x, y, z, self.time] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(self.step.to_le_bytes());
        bytes.extend(self.count.to_le_bytes());
        bytes
    }
}

impl Rows {
    /// The same rows with the same bits? Unlike `==`, tells 0 from -0.
    pub fn same_bits(&self, other: &Self) -> bool {
        let same = |field: &&Field| match (self.column(field), other.column(field)) {
            (Column::Whole(a), Column::Whole(b)) => a == b,
            (Column::Real(a), Column::Real(b)) => {
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
            }
            _ => false,
        };
        self.first == other.first && schema::FIELDS.iter().all(same)
    }

    /// What makes these rows unfit for a file that holds `kept`: columns of unequal length, ids that are not the row
    /// numbers, numbers that are not finite. In words.
    fn fault(&self, kept: Kept) -> Option<String> {
        for field in fields_of(kept) {
            let name = field.name;
            let width = field.rank.components();
            let (length, bad) = match self.column(field) {
                Column::Whole(values) => (values.len(), None),
                Column::Real(values) => (values.len(), values.iter().position(|value| !value.is_finite())),
            };
            if length != self.len() * width {
                return Some(format!("{name} has {} rows, id has {}", length / width, self.len()));
            }
            if let Some(place) = bad {
                return Some(format!(
                    "{name} of particle {} is not a finite number",
                    self.first + (place / width) as u64
                ));
            }
        }
        let row = self.id.iter().zip(self.first..).position(|(&id, row)| id != row)?;
        let number = self.first + row as u64;
        Some(format!("row {number} holds particle {}, not {number}", self.id[row]))
    }

    /// None yet, with room for so many.
    pub fn with_room(first: u64, count: usize) -> Self {
        Self {
            first,
            id: Vec::with_capacity(count),
            body: Vec::with_capacity(count),
            position: Vec::with_capacity(count),
            velocity: Vec::with_capacity(count),
            acceleration: Vec::with_capacity(count),
            mass: Vec::with_capacity(count),
            density: Vec::with_capacity(count),
            stress: Vec::with_capacity(count),
            stress_work: Vec::with_capacity(count),
            viscous_work: Vec::with_capacity(count),
            plastic_strain: Vec::with_capacity(count),
        }
    }

    /// Appends the rows that follow.
    pub fn append(&mut self, mut next: Self) {
        self.id.append(&mut next.id);
        self.body.append(&mut next.body);
        self.position.append(&mut next.position);
        self.velocity.append(&mut next.velocity);
        self.acceleration.append(&mut next.acceleration);
        self.mass.append(&mut next.mass);
        self.density.append(&mut next.density);
        self.stress.append(&mut next.stress);
        self.stress_work.append(&mut next.stress_work);
        self.viscous_work.append(&mut next.viscous_work);
        self.plastic_strain.append(&mut next.plastic_strain);
    }

    /// Number of rows here.
    pub fn len(&self) -> usize {
        self.id.len()
    }
    /// No rows?
    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }
    /// The column of a field.
    pub fn column(&self, field: &Field) -> Column<'_> {
        match field.name {
            n if n == schema::ID.name => Column::Whole(&self.id),
            n if n == schema::BODY.name => Column::Whole(&self.body),
            n if n == schema::POSITION.name => Column::Real(self.position.as_flattened()),
            n if n == schema::VELOCITY.name => Column::Real(self.velocity.as_flattened()),
            n if n == schema::ACCELERATION.name => Column::Real(self.acceleration.as_flattened()),
            n if n == schema::MASS.name => Column::Real(&self.mass),
            n if n == schema::DENSITY.name => Column::Real(&self.density),
            n if n == schema::STRESS.name => Column::Real(self.stress.as_flattened()),
            n if n == schema::STRESS_WORK.name => Column::Real(&self.stress_work),
            n if n == schema::VISCOUS_WORK.name => Column::Real(&self.viscous_work),
            n if n == schema::PLASTIC_STRAIN.name => Column::Real(&self.plastic_strain),
            other => unreachable!("field {other} has no column"),
        }
    }
    /// The column of a field, to fill.
    pub fn column_mut(&mut self, field: &Field) -> ColumnMut<'_> {
        match field.name {
            n if n == schema::ID.name => ColumnMut::Whole(&mut self.id),
            n if n == schema::BODY.name => ColumnMut::Whole(&mut self.body),
            n if n == schema::POSITION.name => ColumnMut::Vector(&mut self.position),
            n if n == schema::VELOCITY.name => ColumnMut::Vector(&mut self.velocity),
            n if n == schema::ACCELERATION.name => ColumnMut::Vector(&mut self.acceleration),
            n if n == schema::MASS.name => ColumnMut::Scalar(&mut self.mass),
            n if n == schema::DENSITY.name => ColumnMut::Scalar(&mut self.density),
            n if n == schema::STRESS.name => ColumnMut::Symmetric(&mut self.stress),
            n if n == schema::STRESS_WORK.name => ColumnMut::Scalar(&mut self.stress_work),
            n if n == schema::VISCOUS_WORK.name => ColumnMut::Scalar(&mut self.viscous_work),
            n if n == schema::PLASTIC_STRAIN.name => ColumnMut::Scalar(&mut self.plastic_strain),
            other => unreachable!("field {other} has no column"),
        }
    }
}
