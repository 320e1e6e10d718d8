//! HDF5 and MPI: what collective work on files has in common. `snapshot` and `checkpoint` build on it.
//!
//! A collective call that fails on one rank only would leave the others waiting for ever. [`agree`] ends every
//! collective step: all ranks learn whether all succeeded, and all return the same error.

pub(crate) mod text;

use crate::snapshot::FileError;
use mpi::collective::SystemOperation;
use mpi::traits::{Communicator as _, CommunicatorCollectives, Root};
use serde::{Serialize, de::DeserializeOwned};
use std::path::Path;

/// A group of ranks that open, write and read a file together.
pub use mpi::topology::SimpleCommunicator as Communicator;

/// Collective: `Ok` where every rank brings `Ok`, else the error of the lowest rank that failed, the same on all.
pub fn agree<T>(comm: &Communicator, mine: Result<T, FileError>) -> Result<T, FileError> {
    let none = comm.size();
    let failed = if mine.is_err() { comm.rank() } else { none };
    let mut first = none;
    comm.all_reduce_into(&failed, &mut first, SystemOperation::min());
    if first == none {
        return mine;
    }
    let message = match &mine {
        Err(error) if comm.rank() == first => serde_json::to_vec(error).unwrap_or_default(),
        _ => Vec::new(),
    };
    let message = broadcast(comm, first, message);
    match serde_json::from_slice(&message) {
        Ok(error) => Err(error),
        Err(_) => match mine {
            Err(error) => Err(error),
            Ok(_) => Err(FileError::CannotWrite {
                path: String::new(),
                what: format!("rank {first} failed; see its message"),
            }),
        },
    }
}

/// Collective: rank 0 does `work`, all ranks get its result.
pub fn from_root<T, F>(comm: &Communicator, work: F) -> Result<T, FileError>
where
    T: Serialize + DeserializeOwned,
    F: FnOnce() -> Result<T, FileError>,
{
    // The value travels as JSON, whose floats are written and read back exactly (serde_json's `float_roundtrip`).
    let mut message = Vec::new();
    if comm.rank() == 0 {
        message = serde_json::to_vec(&work()).unwrap_or_default();
    }
    let message = broadcast(comm, 0, message);
    serde_json::from_slice::<Result<T, FileError>>(&message).unwrap_or_else(|error| {
        let what = format!("rank 0's answer could not be passed on: {error}");
        Err(FileError::CannotRead { path: String::new(), what })
    })
}

/// Collective: the bytes of rank `root`, on every rank.
pub(crate) fn broadcast(comm: &Communicator, root: i32, mut bytes: Vec<u8>) -> Vec<u8> {
    let process = comm.process_at_rank(root);
    let mut length = bytes.len() as u64;
    process.broadcast_into(&mut length);
    bytes.resize(length as usize, 0);
    process.broadcast_into(&mut bytes[..]);
    bytes
}

/// Makes (and empties) the file at `path`, for this process alone.
pub(crate) fn create(path: &Path) -> hdf5::Result<hdf5::File> {
    hdf5::File::with_options()
        // From 1.8 on, metadata carry checksums: HDF5 itself notices a flipped bit in them.
        .with_fapl(|access| access.libver_v18())
        // No times in the file: equal contents give equal bytes.
        .with_fcpl(|creation| creation.obj_track_times(false))
        .create(path)
}
