//! Who owns which particle, and how particles get there.

pub mod agree;
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

/// Has the number of particles of a rank changed by more than 5 % since the boxes were cut (Yang et al. 2020, section 3)?
/// An exact comparison of integers, to be joined over the ranks by a logical or.
pub fn changed(reference: u64, now: u64) -> bool {
    20 * now.abs_diff(reference) > reference
}

/// [`changed`] for any of the ranks.
pub fn any_changed(reference: &[u64], now: &[u64]) -> bool {
    reference.iter().zip(now).any(|(&reference, &now)| changed(reference, now))
}
