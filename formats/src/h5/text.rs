//! Text attributes of fixed length. `hdf5-metno` knows the length at compile time only, and texts of variable length
//! would lie on HDF5's heap, outside its checksums.

use hdf5::Location;
use hdf5_sys::h5a::{H5Aclose, H5Acreate2, H5Aread, H5Awrite};
use hdf5_sys::h5p::H5P_DEFAULT;
use hdf5_sys::h5s::{H5S_class_t, H5Sclose, H5Screate};
use hdf5_sys::h5t::{
    H5T_class_t, H5T_cset_t, H5T_str_t, H5Tclose, H5Tcopy, H5Tget_class, H5Tget_size, H5Tis_variable_str, H5Tset_cset,
    H5Tset_size, H5Tset_strpad,
};
use std::ffi::CString;

/// HDF5's limit for an attribute in the object's header, less its own overhead.
pub(crate) const LONGEST: usize = 60_000;

/// Writes a text attribute: as many bytes as the text has, null-padded, ASCII where the text is.
pub(crate) fn write(place: &Location, name: &str, text: &str) -> hdf5::Result<()> {
    if text.len() > LONGEST || text.contains('\0') {
        return Err(format!("attribute {name}: a text of at most {LONGEST} bytes without NUL is needed").into());
    }
    let name = CString::new(name).map_err(|e| hdf5::Error::from(e.to_string()))?;
    // HDF5 knows no text of length zero: an empty one is a single NUL.
    let bytes = if text.is_empty() { b"\0" } else { text.as_bytes() };
    let set = if text.is_ascii() { H5T_cset_t::H5T_CSET_ASCII } else { H5T_cset_t::H5T_CSET_UTF8 };
    hdf5::sync::sync(|| {
        // SAFETY: ids are checked or refused by HDF5 with a status, closed once; `bytes` is as long as the type.
        unsafe {
            let kind = hdf5::h5check(H5Tcopy(*hdf5::globals::H5T_C_S1))?;
            H5Tset_size(kind, bytes.len());
            H5Tset_strpad(kind, H5T_str_t::H5T_STR_NULLPAD);
            H5Tset_cset(kind, set);
            let space = H5Screate(H5S_class_t::H5S_SCALAR);
            let attribute = H5Acreate2(place.id(), name.as_ptr(), kind, space, H5P_DEFAULT, H5P_DEFAULT);
            let status = hdf5::h5check(attribute)
                .and_then(|attribute| hdf5::h5check(H5Awrite(attribute, kind, bytes.as_ptr().cast())));
            if attribute >= 0 {
                H5Aclose(attribute);
            }
            H5Sclose(space);
            H5Tclose(kind);
            status.map(|_| ())
        }
    })
}

/// Reads a text attribute of fixed length.
pub(crate) fn read(place: &Location, name: &str) -> hdf5::Result<String> {
    let attribute = place.attr(name)?;
    let kind = attribute.dtype()?;
    let scalar = attribute.is_scalar();
    let bytes = hdf5::sync::sync(|| {
        // SAFETY: both ids are open; the buffer is as long as the type, which is a text of fixed length.
        unsafe {
            let id = kind.id();
            let size = H5Tget_size(id);
            let fixed = H5Tget_class(id) == H5T_class_t::H5T_STRING && H5Tis_variable_str(id) == 0;
            if !scalar || !fixed || size > 2 * LONGEST {
                return Err(hdf5::Error::from(format!("attribute {name} is not a text of fixed length")));
            }
            let mut bytes = vec![0u8; size];
            hdf5::h5check(H5Aread(attribute.id(), id, bytes.as_mut_ptr().cast()))?;
            Ok(bytes)
        }
    })?;
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8(bytes[..end].to_vec()).map_err(|_| format!("attribute {name} is not UTF-8").into())
}
