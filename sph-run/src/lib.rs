//! Granular flow by smoothed particle hydrodynamics, distributed over MPI ranks.
pub mod algebra;
pub mod space;
