//! Granular flow by smoothed particle hydrodynamics, distributed over MPI ranks.
//!
//! A step reads as in [`step`]: kick, drift, refill what surrounds the particles, stress, acceleration, kick.
//! Types are chosen once in [`dispatch`]; the only loop over pairs is in [`sweep`], what it sums in [`rates`].

pub mod algebra;
pub mod boundary;
pub mod check;
pub mod cli;
pub mod deadline;
pub mod dispatch;
pub mod error;
pub mod exact;
pub mod forces;
pub mod huge_pages;
pub mod lanes;
pub mod limits;
pub mod material;
pub mod neighbors;
pub mod output;
pub mod pace;
pub mod parallel;
pub mod particles;
pub mod phases;
pub mod physics;
pub mod plan;
pub mod progress;
pub mod rates;
pub mod report;
pub mod resume;
pub mod run;
pub mod scheduler;
pub mod simulation;
pub mod space;
pub mod stabilize;
pub mod step;
pub mod sweep;
pub mod timestep;
