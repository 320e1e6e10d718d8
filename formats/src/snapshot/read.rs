//! Reading a particle file, alone or by all ranks together, and naming its contents.

use super::digest::Sums;
use super::{ColumnMut, Digests, FORMAT_VERSION, FileError, Header, Rows, content_name, fields_of, share};
use crate::h5::collective::{self, Transfer};
use crate::h5::{self, Communicator, text};
use crate::schema::{Field, Kept, Rank};
use crate::{kernel::Kernel, space::Space};
use hdf5::{Dataset, Group};
use mpi::traits::Communicator as _;
use std::cmp::Ordering;
use std::io::Read;
use std::{fs, ops::Range, path::Path};

/// How every HDF5 file begins.
const SIGNATURE: [u8; 8] = *b"\x89HDF\r\n\x1a\n";

/// Rows read at a time where a file is only passed through.
const PASS: u64 = 1 << 16;

/// A particle file, open and with a layout that was checked.
struct Open {
    header: Header,
    kept: Kept,
    fields: Vec<(&'static Field, Dataset)>,
}

/// Reads what a particle file says of itself, and checks that its datasets have the shapes it says. Serial.
///
/// # Errors
/// `NotFound`, `CannotRead`; `WrongKind` for what is no particle file; `Newer`, `Older`; `Damaged` for one that is cut off or
/// changed.
pub fn read_header(path: &Path) -> Result<Header, FileError> {
    open(path).map(|open| open.header)
}

/// Reads a whole particle file. Serial. Fields the file does not hold stay empty.
///
/// # Errors
/// As [`read_header`]; also `Damaged` where ids are not 0, 1, 2 .. or a number is not finite.
pub fn read(path: &Path) -> Result<(Header, Rows), FileError> {
    let open = open(path)?;
    let rows = open.rows(path, 0..open.header.count, Transfer::Alone)?;
    check(path, &rows, open.kept)?;
    Ok((open.header, rows))
}

/// Collective: reads the rows of `range`, which may be another on every rank, overlap, or be empty.
///
/// # Errors
/// As [`read`], the same on all ranks; `Damaged` if a range reaches past the last row.
pub fn read_rows(path: &Path, range: Range<u64>, comm: &Communicator) -> Result<(Header, Rows), FileError> {
    // Rank 0 looks alone first: a damaged file must not meet a collective call.
    let header = h5::from_root(comm, || read_header(path))?;
    let inside = range.start <= range.end && range.end <= header.count;
    let past = || FileError::damaged(path, format!("rows {range:?} were asked for, it has {}", header.count));
    h5::agree(comm, if inside { Ok(()) } else { Err(past()) })?;

    let file = h5::agree(comm, h5::open(path, comm).map_err(|error| FileError::damaged(path, error)))?;
    let open = h5::agree(comm, examine(path, &file))?;
    let rows = h5::agree(comm, open.rows(path, range, Transfer::Together));
    let Open { header, kept, fields } = open;
    drop(fields);
    h5::agree(comm, file.close().map_err(|error| FileError::damaged(path, error)))?;
    let rows = rows?;
    h5::agree(comm, check(path, &rows, kept))?;
    Ok((header, rows))
}

/// The header and the digest of each field. Serial.
///
/// # Errors
/// As [`read_header`]. Values are not judged.
pub fn digests(path: &Path) -> Result<(Header, Digests), FileError> {
    let open = open(path)?;
    let mut sums = Sums::new(open.kept);
    let mut first = 0;
    while first < open.header.count {
        let end = open.header.count.min(first + PASS);
        sums.add(&open.rows(path, first..end, Transfer::Alone)?);
        first = end;
    }
    Ok((open.header, sums.finish()))
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

/// Opens a file for this process alone.
fn open(path: &Path) -> Result<Open, FileError> {
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
    examine(path, &file)
}

/// Reads the header and finds the datasets. Under MPI all ranks do the same.
fn examine(path: &Path, file: &hdf5::File) -> Result<Open, FileError> {
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
    let length = fs::metadata(path).map_err(|error| FileError::reading(path, &error))?.len();
    let mut fields = Vec::new();
    for field in fields_of(kept) {
        let dataset = file.dataset(&format!("particles/{}", field.name)).map_err(damaged)?;
        check_dataset(field, &dataset, header.count, length).map_err(|what| FileError::damaged(path, what))?;
        fields.push((field, dataset));
    }
    Ok(Open { header, kept, fields })
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

/// Has a dataset the type and shape of its field, and does it lie within the file?
fn check_dataset(field: &Field, dataset: &Dataset, count: u64, length: u64) -> Result<(), String> {
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
    let end = dataset.offset().and_then(|offset| offset.checked_add(bytes));
    match end {
        Some(end) if end <= length => Ok(()),
        _ => Err(format!("/particles/{name} reaches past the end of the file")),
    }
}

impl Open {
    /// The rows of `range`, all columns.
    fn rows(&self, path: &Path, range: Range<u64>, transfer: Transfer) -> Result<Rows, FileError> {
        let mut rows = Rows { first: range.start, ..Rows::default() };
        // A rank goes on after a failure, so that the others do not wait for it in the next transfer.
        let mut outcome = Ok(());
        for (field, dataset) in &self.fields {
            let read = read_column(&mut rows, field, dataset, range.clone(), transfer);
            outcome = outcome.and(read.map_err(|error| FileError::damaged(path, error)));
        }
        outcome.map(|()| rows)
    }
}

fn read_column(
    rows: &mut Rows,
    field: &Field,
    dataset: &Dataset,
    range: Range<u64>,
    transfer: Transfer,
) -> hdf5::Result<()> {
    let first = range.start;
    let count = (range.end - range.start) as usize;
    match rows.column_mut(field) {
        ColumnMut::Whole(values) => {
            values.resize(count, 0);
            collective::read_rows(dataset, first, values, transfer)
        }
        ColumnMut::Scalar(values) => {
            values.resize(count, 0.0);
            collective::read_rows(dataset, first, values, transfer)
        }
        ColumnMut::Vector(values) => {
            values.resize(count, [0.0; 3]);
            collective::read_rows(dataset, first, values.as_flattened_mut(), transfer)
        }
        ColumnMut::Symmetric(values) => {
            values.resize(count, [0.0; 6]);
            collective::read_rows(dataset, first, values.as_flattened_mut(), transfer)
        }
    }
}
