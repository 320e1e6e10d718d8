//! Reading of consecutive rows, by all ranks together or by one alone.
//!
//! `hdf5-metno` transfers with default properties only, which under MPI means each rank on its own. This asks for
//! collective transfers, in which MPI-IO reads few large pieces and hands each rank its rows.

use hdf5::{Dataset, Datatype, H5Type};
use hdf5_sys::h5d::H5Dread;
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5p::{H5FD_mpio_xfer_t, H5Pclose, H5Pcreate, H5Pset_dxpl_mpio};
use hdf5_sys::h5s::{
    H5S_SELECT_SET, H5Sclose, H5Screate_simple, H5Sget_simple_extent_ndims, H5Sselect_hyperslab, H5Sselect_none,
};

/// Who takes part in a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Transfer {
    /// This process alone.
    Alone,
    /// Every rank that opened the file: all must call, with as many rows as they have, none included.
    Together,
}

/// Fills `values` with the rows from `first` on. A rank with no values takes part with an empty selection, and so does
/// one whose values do not fit, which then returns the error.
pub(crate) fn read_rows<T: H5Type>(
    dataset: &Dataset,
    first: u64,
    values: &mut [T],
    transfer: Transfer,
) -> hdf5::Result<()> {
    let length = values.len();
    with_selection::<T>(dataset, first, length, transfer, |data, memory, file, kind, properties| {
        // SAFETY: the ids are open, and the memory space selects exactly `values.len()` numbers of the type that
        // `kind` was made from (none where the selection is empty); every bit pattern is a number.
        unsafe { H5Dread(data, kind, memory, file, properties, values.as_mut_ptr().cast()) }
    })
}

/// Makes the spaces and properties of one transfer, calls `transfer(dataset, memory, file, type, properties)`, closes.
fn with_selection<T: H5Type>(
    dataset: &Dataset,
    first: u64,
    length: usize,
    transfer: Transfer,
    call: impl FnOnce(hid_t, hid_t, hid_t, hid_t, hid_t) -> i32,
) -> hdf5::Result<()> {
    let shape = dataset.shape();
    let width: usize = shape.iter().skip(1).product();
    let rows = length.checked_div(width).unwrap_or(0);
    let total = shape.first().copied().unwrap_or(0) as u64;
    let fits = rows * width == length && first.checked_add(rows as u64).is_some_and(|end| end <= total);
    let selected = if fits { rows } else { 0 };

    let kind = Datatype::from_type::<T>()?;
    let file = dataset.space()?;
    let mut start = vec![0u64; shape.len()];
    let mut count: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    if let (Some(s), Some(c)) = (start.first_mut(), count.first_mut()) {
        (*s, *c) = (first, selected as u64);
    }
    let numbers = (selected * width) as u64;
    let status = hdf5::sync::sync(|| {
        // SAFETY: all ids are open while they are used and closed once; `start` and `count` have one entry for each
        // dimension of the file's space; HDF5 is not re-entrant, hence the lock of `sync`.
        unsafe {
            debug_assert_eq!(H5Sget_simple_extent_ndims(file.id()), shape.len() as i32);
            let memory = H5Screate_simple(1, &numbers, std::ptr::null());
            if selected == 0 {
                H5Sselect_none(memory);
                H5Sselect_none(file.id());
            } else {
                let none = std::ptr::null();
                H5Sselect_hyperslab(file.id(), H5S_SELECT_SET, start.as_ptr(), none, count.as_ptr(), none);
            }
            let properties = H5Pcreate(*hdf5::globals::H5P_DATASET_XFER);
            if transfer == Transfer::Together {
                H5Pset_dxpl_mpio(properties, H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE);
            }
            let status = call(dataset.id(), memory, file.id(), kind.id(), properties);
            // Read the error before the closing calls below clear it.
            let status = hdf5::h5check(status);
            H5Pclose(properties);
            H5Sclose(memory);
            status
        }
    });
    status?;
    if !fits {
        return Err(format!("{length} numbers from row {first} on do not fit {shape:?}").into());
    }
    Ok(())
}
