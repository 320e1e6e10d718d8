//! What rank 0 does for all, and how the others learn whether it went well.

use crate::error::RunError;
use formats::h5::Communicator;
use mpi::traits::{Communicator as _, *};

/// Does something on rank 0 only; all ranks learn whether it failed, and fail with it. Collective.
/// The value is there on rank 0 only.
pub fn agree<T>(comm: &Communicator, act: impl FnOnce() -> Result<T, RunError>) -> Result<Option<T>, RunError> {
    let root = comm.process_at_rank(0);
    let mine = (comm.rank() == 0).then(act);
    let mut code = match &mine {
        Some(Err(error)) => error.exit_code(),
        _ => 0,
    };
    root.broadcast_into(&mut code);
    match mine {
        Some(result) => result.map(Some),
        None if code == 0 => Ok(None),
        None => Err(RunError::Elsewhere { code }),
    }
}

/// A text that rank 0 finds and all ranks get. Collective.
pub fn share_text(comm: &Communicator, find: impl FnOnce() -> Result<String, RunError>) -> Result<String, RunError> {
    let bytes = share_bytes(comm, || find().map(String::into_bytes))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Bytes that rank 0 finds and all ranks get. Collective.
pub fn share_bytes(comm: &Communicator, find: impl FnOnce() -> Result<Vec<u8>, RunError>) -> Result<Vec<u8>, RunError> {
    let root = comm.process_at_rank(0);
    let mut bytes = agree(comm, find)?.unwrap_or_default();
    let mut length = bytes.len() as u64;
    root.broadcast_into(&mut length);
    bytes.resize(length as usize, 0);
    // MPI refuses the address of an empty buffer.
    if length > 0 {
        root.broadcast_into(&mut bytes[..]);
    }
    Ok(bytes)
}
