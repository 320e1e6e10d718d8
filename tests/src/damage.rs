//! Damage to files: where the parts of an HDF5 file lie, bits flipped, ends cut off.

use hdf5_sys::{h5a, h5t};
use std::fs::{self, File};
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Where a part of a file lies, in bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// `dataset /particles/density`, `attribute title of /sph`.
    pub what: String,
    pub bytes: Range<u64>,
}

/// The places of every dataset's numbers and every attribute's value in an HDF5 file, by HDF5's own account: it names
/// the offset of a contiguous dataset; an attribute is found by its name with its value behind it.
///
/// # Errors
/// If the file can't be read, or something in it has no place.
pub fn places(path: &Path) -> hdf5::Result<Vec<Place>> {
    let bytes = fs::read(path).map_err(|error| error.to_string())?;
    let file = hdf5::File::open(path)?;
    let mut found = Vec::new();
    let mut taken = Vec::new();
    let mut seen = Vec::new();
    let mut open = vec![file.as_group()?];
    while let Some(group) = open.pop() {
        for name in group.attr_names()? {
            found.push(attribute(&bytes, &group, &name, &mut taken)?);
        }
        for dataset in group.datasets()? {
            let start = dataset.offset().ok_or_else(|| format!("{} has no offset", dataset.name()))?;
            // Under two names.
            if seen.contains(&start) {
                continue;
            }
            seen.push(start);
            let length = (dataset.size() * dataset.dtype()?.size()) as u64;
            found.push(Place { what: format!("dataset {}", dataset.name()), bytes: start..start + length });
            for name in dataset.attr_names()? {
                found.push(attribute(&bytes, &dataset, &name, &mut taken)?);
            }
        }
        open.extend(group.groups()?);
    }
    Ok(found)
}

/// The place of an attribute's value. Objects with the same attribute of the same value take one place each.
fn attribute(file: &[u8], object: &hdf5::Location, name: &str, taken: &mut Vec<usize>) -> hdf5::Result<Place> {
    // Between its name and its value are the type and the shape.
    const BETWEEN: usize = 120;
    let value = value(&object.attr(name)?)?;
    let label = [name.as_bytes(), &[0]].concat();
    let labels = file.windows(label.len()).enumerate().filter(|(_, window)| *window == label).map(|(at, _)| at);
    for at in labels {
        let from = at + label.len();
        let within = &file[from..file.len().min(from + BETWEEN + value.len())];
        // The last fit: a small number may also be a part of the shape.
        let fit = within.windows(value.len()).rposition(|window| window == value).map(|fit| from + fit);
        if let Some(start) = fit.filter(|start| !taken.contains(start)) {
            taken.push(start);
            let bytes = start as u64..(start + value.len()) as u64;
            return Ok(Place { what: format!("attribute {name} of {}", object.name()), bytes });
        }
    }
    Err(format!("attribute {name} of {} is not found", object.name()).into())
}

/// An attribute's value as it is in the file.
fn value(attribute: &hdf5::Attribute) -> hdf5::Result<Vec<u8>> {
    hdf5::sync::sync(|| {
        // SAFETY: the type is the attribute's own, closed once; the buffer holds all its elements.
        unsafe {
            let kind = hdf5::h5check(h5a::H5Aget_type(attribute.id()))?;
            let mut value = vec![0u8; attribute.size() * h5t::H5Tget_size(kind)];
            let status = h5a::H5Aread(attribute.id(), kind, value.as_mut_ptr().cast());
            h5t::H5Tclose(kind);
            hdf5::h5check(status)?;
            Ok(value)
        }
    })
}

/// Flips one bit.
///
/// # Errors
/// If the file has no such byte, or can't be written.
pub fn flip(path: &Path, byte: u64, bit: u32) -> io::Result<()> {
    let file = File::options().read(true).write(true).open(path)?;
    let mut one = [0u8];
    file.read_exact_at(&mut one, byte)?;
    one[0] ^= 1 << (bit % 8);
    file.write_all_at(&one, byte)
}

/// Cuts a file off.
///
/// # Errors
/// If it can't be written.
pub fn cut(path: &Path, length: u64) -> io::Result<()> {
    File::options().write(true).open(path)?.set_len(length)
}
