//! What surrounds the owned particles: periodic copies, mirror images behind planes of symmetry and mirror walls, and
//! virtual particles behind the other walls. All are made when neighbour lists are built and refilled every step.

pub mod field;
pub mod mirror;
pub mod periodic;
pub mod wall;
