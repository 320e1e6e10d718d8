//! What surrounds the owned particles: mirror images behind symmetry planes and virtual particles behind walls.
//! Both are made when neighbour lists are built and refilled every step.

pub mod field;
pub mod mirror;
pub mod wall;
