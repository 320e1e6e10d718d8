//! A real Slurm, started by the test itself.

mod cluster;
mod slices;
