//! The little that cutting the domain needs of a group of ranks.

use super::processor::waiting;
use mpi::collective::SystemOperation;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives, Equivalence};

/// Reductions over all ranks, element by element; every rank gets the result. All are exact, so the order in which
/// a library combines the ranks does not show. Collective: all ranks call the same ones, with slices of one length.
pub trait Reduce {
    /// Number of ranks.
    fn size(&self) -> usize;
    /// This rank.
    fn rank(&self) -> usize;
    /// Sums.
    fn sum(&self, values: &mut [u64]);
    /// Minima.
    fn min(&self, values: &mut [f64]);
    /// Maxima.
    fn max(&self, values: &mut [f64]);
}

/// One rank alone, without MPI.
#[derive(Clone, Copy, Debug, Default)]
pub struct Serial;

impl Reduce for Serial {
    fn size(&self) -> usize {
        1
    }
    fn rank(&self) -> usize {
        0
    }
    fn sum(&self, _: &mut [u64]) {}
    fn min(&self, _: &mut [f64]) {}
    fn max(&self, _: &mut [f64]) {}
}

impl Reduce for SimpleCommunicator {
    fn size(&self) -> usize {
        Communicator::size(self) as usize
    }
    fn rank(&self) -> usize {
        Communicator::rank(self) as usize
    }
    fn sum(&self, values: &mut [u64]) {
        in_place(self, values, SystemOperation::sum());
    }
    fn min(&self, values: &mut [f64]) {
        in_place(self, values, SystemOperation::min());
    }
    fn max(&self, values: &mut [f64]) {
        in_place(self, values, SystemOperation::max());
    }
}

fn in_place<T: Copy + Equivalence>(comm: &SimpleCommunicator, values: &mut [T], operation: SystemOperation) {
    if Communicator::size(comm) > 1 {
        waiting(|| comm.all_reduce_into(&values.to_vec()[..], values, operation));
    }
}
