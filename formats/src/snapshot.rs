//! Particle files: snapshots for people and the particles of a checkpoint.
//!
//! One file is both our layout (`/particles/<field>`, rows in ascending id) and a valid VTKHDF file. Rows are sorted
//! by id whatever the number of ranks, so that the bytes of every dataset are the same on any number of them.

use crate::{kernel::Kernel, schema, schema::Field, space::Space};

/// Version of the layout; a newer one is refused.
pub const FORMAT_VERSION: u64 = 1;

/// What a particle file says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The scene's title.
    pub title: String,
    /// SHA-256 of the scene's text.
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

impl Rows {
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
            n if n == schema::PLASTIC_STRAIN.name => ColumnMut::Scalar(&mut self.plastic_strain),
            other => unreachable!("field {other} has no column"),
        }
    }
}
