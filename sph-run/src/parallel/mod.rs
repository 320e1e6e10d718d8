//! Who owns which particle, and how particles get there.

pub mod agree;
pub mod balance;
pub mod comm;
pub mod exchange;
pub mod gather;
pub mod halo;
pub mod migrate;
pub mod orb;
pub mod processor;
pub mod route;

pub use comm::{Reduce, Serial};
pub use orb::{Bounds, Tree};
