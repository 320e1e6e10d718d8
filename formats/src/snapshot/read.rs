//! Reading a particle file, alone or by all ranks together, and naming its contents.
//!
//! HDF5 says what is where; the rows are read past it, by each rank on its own. HDF5 over MPI-IO takes no notice of a
//! read that fails, and hands out what was in memory before.

use super::digest::Sums;
use super::{ColumnMut, Digests, FORMAT_VERSION, FileError, Header, Rows, content_name, fields_of, share};
use crate::h5::{self, Communicator, text};
use crate::schema::{Field, Kept, Rank};
use crate::{kernel::Kernel, space::Space};
use hdf5::{Dataset, Group};
use mpi::traits::Communicator as _;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use std::{fs, ops::Range, path::Path};

/// How every HDF5 file begins.
const SIGNATURE: [u8; 8] = *b"\x89HDF\r\n\x1a\n";

/// Rows read at a time where a file is only passed through.
const PASS: u64 = 1 << 16;

/// What a particle file says of itself, checked.
#[derive(Serialize, Deserialize)]
struct Layout {
    header: Header,
    kept: Kept,
    /// Where the datasets begin, in the order of the fields.
    places: Vec<u64>,
}

/// Reads what a particle file says of itself, and checks that its datasets have the shapes it says. Serial.
///
/// # Errors
/// `NotFound`, `CannotRead`; `WrongKind` for what is no particle file; `Newer`, `Older`; `Damaged` for one that is cut off or
/// changed.
pub fn read_header(path: &Path) -> Result<Header, FileError> {
    examine(path).map(|layout| layout.header)
}

/// Reads a whole particle file. Serial. Fields the file does not hold stay empty.
///
/// # Errors
/// As [`read_header`]; also `Damaged` where ids are not 0, 1, 2 .. or a number is not finite.
pub fn read(path: &Path) -> Result<(Header, Rows), FileError> {
    let layout = examine(path)?;
    let rows = layout.rows(path, 0..layout.header.count)?;
    check(path, &rows, layout.kept)?;
    Ok((layout.header, rows))
}

/// Collective: reads the rows of `range`, which may be another on every rank, overlap, or be empty.
///
/// # Errors
/// As [`read`], the same on all ranks; `Damaged` if a range reaches past the last row.
pub fn read_rows(path: &Path, range: Range<u64>, comm: &Communicator) -> Result<(Header, Rows), FileError> {
    let layout = h5::from_root(comm, || examine(path))?;
    let count = layout.header.count;
    let read = || {
        if range.start > range.end || range.end > count {
            return Err(FileError::damaged(path, format!("rows {range:?} were asked for, it has {count}")));
        }
        let rows = layout.rows(path, range.clone())?;
        check(path, &rows, layout.kept)?;
        Ok(rows)
    };
    let rows = h5::agree(comm, read())?;
    let header = layout.header;
    Ok((header, rows))
}

/// The header and the digest of each field. Serial.
///
/// # Errors
/// As [`read_header`]. Values are not judged.
pub fn digests(path: &Path) -> Result<(Header, Digests), FileError> {
    let layout = examine(path)?;
    let mut sums = Sums::new(layout.kept);
    let mut first = 0;
    while first < layout.header.count {
        let end = layout.header.count.min(first + PASS);
        sums.add(&layout.rows(path, first..end)?);
        first = end;
    }
    Ok((layout.header, sums.finish()))
}

/// One digest for a whole particle file: its header and its numbers. Serial.
/// Independent of the number of ranks that wrote it, of HDF5's version, and of the VTK view.
///
/// # Errors
/// As [`digests`].
pub fn digest(path: &Path) -> Result<String, FileError> {
    let (header, digests) = digests(path)?;
    Ok(digests.of_file(&header))
}

/// Collective: the header and the digests of a whole file, of which every rank reads the share of the rank after it,
/// so that nobody is asked for what it wrote itself.
///
/// # Errors
/// As [`read_rows`].
pub fn digests_of_shares(path: &Path, count: u64, comm: &Communicator) -> Result<(Header, Digests), FileError> {
    let (rank, size) = (comm.rank() as u64, comm.size() as u64);
    let (header, rows) = read_rows(path, share(count, (rank + 1) % size, size), comm)?;
    let mut sums = Sums::new(Kept::Checkpoint);
    sums.add(&rows);
    Ok((header, sums.finish_together(comm)))
}

fn check(path: &Path, rows: &Rows, kept: Kept) -> Result<(), FileError> {
    rows.fault(kept).map_or(Ok(()), |what| Err(FileError::damaged(path, what)))
}

/// Reads the header and finds the datasets.
fn examine(path: &Path) -> Result<Layout, FileError> {
    let reading = |error| FileError::reading(path, &error);
    let metadata = fs::metadata(path).map_err(reading)?;
    if metadata.is_dir() {
        return Err(FileError::wrong_kind(path, "it is a folder"));
    }
    if metadata.len() == 0 {
        return Err(FileError::damaged(path, "it is empty"));
    }
    let mut start = Vec::new();
    fs::File::open(path).map_err(reading)?.take(8).read_to_end(&mut start).map_err(reading)?;
    if start != SIGNATURE {
        return Err(FileError::wrong_kind(path, "it is not HDF5; a particle file of talus is needed"));
    }
    let file = hdf5::File::open(path).map_err(|error| {
        let what = error.to_string();
        // HDF5 locks what it reads; some network file systems know no locks.
        if what.contains("lock file") {
            let what = format!("{what}; set HDF5_USE_FILE_LOCKING=FALSE and start the same command again");
            return FileError::CannotRead { path: path.display().to_string(), what };
        }
        FileError::damaged(path, what)
    })?;
    let foreign = |what: &str| FileError::wrong_kind(path, format!("it is HDF5, but {what}"));
    let sph = file.group("sph").map_err(|_| foreign("has no group /sph; a particle file of talus is needed"))?;
    let version: u64 = sph
        .attr("format_version")
        .and_then(|attribute| attribute.read_scalar())
        .map_err(|_| foreign("/sph has no format_version; a particle file of talus is needed"))?;
    let (name, known) = (|| path.display().to_string(), FORMAT_VERSION);
    match version.cmp(&known) {
        Ordering::Greater => return Err(FileError::Newer { path: name(), found: version, known }),
        Ordering::Less => return Err(FileError::Older { path: name(), found: version, known }),
        Ordering::Equal => {}
    }
    let damaged = |what: hdf5::Error| FileError::damaged(path, what);
    let (header, kept) = header(&sph).map_err(damaged)?;
    let mut places = Vec::new();
    for field in fields_of(kept) {
        let dataset = file.dataset(&format!("particles/{}", field.name)).map_err(damaged)?;
        let place = check_dataset(field, &dataset, header.count, metadata.len());
        places.push(place.map_err(|what| FileError::damaged(path, what))?);
    }
    Ok(Layout { header, kept, places })
}

fn header(sph: &Group) -> hdf5::Result<(Header, Kept)> {
    let real = |name: &str| -> hdf5::Result<f64> {
        let value: f64 = sph.attr(name)?.read_scalar()?;
        if value.is_finite() { Ok(value) } else { Err(format!("/sph: {name} is not a finite number").into()) }
    };
    let whole = |name: &str| -> hdf5::Result<u64> { sph.attr(name)?.read_scalar() };
    let unknown = |name: &str, value: &str| hdf5::Error::from(format!("/sph: unknown {name} `{value}`"));

    let content = text::read(sph, "content")?;
    let kept = [Kept::Everywhere, Kept::Checkpoint].into_iter().find(|&kept| content_name(kept) == content);
    let kept = kept.ok_or_else(|| unknown("content", &content))?;
    let name = text::read(sph, "space")?;
    let space = Space::ALL.into_iter().find(|space| space.name() == name).ok_or_else(|| unknown("space", &name))?;
    let name = text::read(sph, "kernel")?;
    let kernel =
        Kernel::ALL.into_iter().find(|kernel| kernel.name() == name).ok_or_else(|| unknown("kernel", &name))?;
    let gravity = sph.attr("gravity")?.read_raw::<f64>()?;
    let gravity: [f64; 3] = gravity.try_into().map_err(|_| hdf5::Error::from("/sph: gravity has not 3 components"))?;
    if gravity.iter().any(|value| !value.is_finite()) {
        return Err("/sph: gravity is not finite".into());
    }
    let header = Header {
        title: text::read(sph, "title")?,
        scene_hash: text::read(sph, "scene_hash")?,
        space,
        kernel,
        spacing: real("spacing")?,
        h: real("h")?,
        gravity,
        time: real("time")?,
        step: whole("step")?,
        count: whole("count")?,
    };
    Ok((header, kept))
}

/// Where a dataset begins; it must have the type and shape of its field, and lie within the file in one piece.
fn check_dataset(field: &Field, dataset: &Dataset, count: u64, length: u64) -> Result<u64, String> {
    let name = field.name;
    let components = field.rank.components();
    let shape = dataset.shape();
    let right = match components {
        1 => vec![count as usize],
        components => vec![count as usize, components],
    };
    if shape != right {
        return Err(format!("/particles/{name} has shape {shape:?}, {right:?} is needed"));
    }
    let kind = dataset.dtype().map_err(|error| error.to_string())?;
    let sound = match field.rank {
        Rank::Whole => kind.is::<u64>(),
        _ => kind.is::<f64>(),
    };
    if !sound {
        return Err(format!("/particles/{name} has another type of number"));
    }
    let bytes = 8 * components as u64 * count;
    let within = |offset: &u64| offset.checked_add(bytes).is_some_and(|end| end <= length);
    match dataset.offset().filter(within) {
        Some(offset) => Ok(offset),
        None => Err(format!("/particles/{name} reaches past the end of the file")),
    }
}

impl Layout {
    /// The rows of `range`, all columns.
    fn rows(&self, path: &Path, range: Range<u64>) -> Result<Rows, FileError> {
        let mut rows = Rows { first: range.start, ..Rows::default() };
        let read = || {
            let file = fs::File::open(path)?;
            for (field, place) in fields_of(self.kept).zip(&self.places) {
                let width = field.rank.components() as u64;
                let numbers = read_numbers(&file, place + 8 * width * range.start, width * (range.end - range.start))?;
                fill(rows.column_mut(field), &numbers);
            }
            Ok(rows)
        };
        read().map_err(|error: io::Error| match error.kind() {
            io::ErrorKind::UnexpectedEof => FileError::damaged(path, "it ends within its rows"),
            _ => FileError::reading(path, &error),
        })
    }
}

/// So many numbers from a place on, as bytes.
fn read_numbers(file: &fs::File, place: u64, count: u64) -> io::Result<Vec<[u8; 8]>> {
    let mut numbers = vec![[0; 8]; count as usize];
    file.read_exact_at(numbers.as_flattened_mut(), place)?;
    Ok(numbers)
}

fn fill(column: ColumnMut<'_>, numbers: &[[u8; 8]]) {
    fn tuples<const N: usize>(numbers: &[[u8; 8]]) -> Vec<[f64; N]> {
        numbers.chunks_exact(N).map(|row| std::array::from_fn(|i| f64::from_ne_bytes(row[i]))).collect()
    }
    match column {
        ColumnMut::Whole(values) => *values = numbers.iter().map(|&bytes| u64::from_ne_bytes(bytes)).collect(),
        ColumnMut::Scalar(values) => *values = numbers.iter().map(|&bytes| f64::from_ne_bytes(bytes)).collect(),
        ColumnMut::Vector(values) => *values = tuples(numbers),
        ColumnMut::Symmetric(values) => *values = tuples(numbers),
    }
}
