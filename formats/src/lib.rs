//! What is on disk, and the vocabulary to read it; besides, what all programs have in common: [`exit`] codes and what they
//! answer [`about`] themselves.
//!
//! The stages `sph-prep`, `sph-run` and `sph-post` never depend on each other: they meet in the files this crate
//! reads and writes. It knows no time stepping and no neighbours. Files of particles are written, and can be read, by all
//! ranks together: [`h5`], [`snapshot`] and [`checkpoint`] use MPI, and [`provenance`] asks for its version. All else is
//! serial.

pub mod about;
pub mod checkpoint;
pub mod disk;
pub mod exit;
pub mod folder;
pub mod h5;
pub mod journal;
pub mod kernel;
pub mod laws;
pub mod lock;
pub mod memory;
pub mod news;
pub mod outputs;
pub mod provenance;
pub mod raster;
pub mod results;
pub mod scene;
pub mod schema;
pub mod snapshot;
pub mod space;
pub mod stl;
pub mod units;
