//! Writing a particle file, by all ranks together.

use super::{Column, FORMAT_VERSION, FileError, Header, Rows, content_name, fields_of};
use crate::disk;
use crate::h5::collective::{Transfer, write_rows};
use crate::h5::{self, Communicator, text};
use crate::schema::{self, Field, Kept};
use hdf5::plist::dataset_create::{AllocTime, FillTime};
use hdf5::{Dataset, Group, H5Type};
use mpi::traits::{Communicator as _, CommunicatorCollectives};
use std::{fs, path::Path};

/// Room for everything in the file that is not numbers of particles.
const METADATA_BYTES: u64 = 64 << 10;

/// Collective: writes a particle file, each rank its rows; together they must be the rows 0 to `header.count`, in any
/// order over the ranks, and some ranks may have none. The header must be the same on all ranks.
///
/// The file is written beside its place and renamed once it is whole and on the disk, so a failure leaves an older
/// file at `path` as it was. `kept` says which fields go in: `Everywhere` for a snapshot, `Checkpoint` for all.
/// The bytes of the file do not depend on the number of ranks.
///
/// # Errors
/// The same on all ranks. `CannotWrite` if the rows or headers don't fit together, a number is not finite, or the
/// system refuses; `DiskFull`, found out before the first number is written.
pub fn write(path: &Path, header: &Header, rows: &Rows, kept: Kept, comm: &Communicator) -> Result<(), FileError> {
    let refuse = |what: String| FileError::cannot_write(path, what);
    h5::agree(comm, rows.fault(kept).map_or(Ok(()), |what| Err(refuse(what))))?;
    check_tiling(header, rows, comm).map_err(refuse)?;
    check_same(path, header, kept, comm).map_err(refuse)?;

    let root = comm.rank() == 0;
    let needed = bytes_needed(header.count, kept);
    let temporary = disk::temporary(path);
    h5::agree(comm, if root { disk::reserve(&temporary, needed) } else { Ok(()) })?;
    let outcome = write_all(&temporary, header, rows, kept, comm).and_then(|()| {
        let publish = || disk::sync_file(&temporary).and_then(|()| disk::publish(&temporary, path));
        h5::agree(comm, if root { publish() } else { Ok(()) })
    });
    if outcome.is_err() && root {
        let _ = fs::remove_file(&temporary);
    }
    outcome
}

/// Bytes of a file with `count` particles, at most.
fn bytes_needed(count: u64, kept: Kept) -> u64 {
    let numbers: usize = fields_of(kept).map(|field| field.rank.components()).sum();
    // The VTK view adds Connectivity and Offsets of 8 bytes, and Types of 1.
    count * (8 * numbers as u64 + 17) + METADATA_BYTES
}

/// Collective: do the ranks' rows cover 0 to count, each once?
fn check_tiling(header: &Header, rows: &Rows, comm: &Communicator) -> Result<(), String> {
    if header.count == 0 {
        return Err("there are no particles to write".into());
    }
    let mut shares = vec![0u64; 2 * comm.size() as usize];
    comm.all_gather_into(&[rows.first, rows.len() as u64][..], &mut shares[..]);
    let mut shares: Vec<_> = shares.chunks_exact(2).map(|s| (s[0], s[1])).filter(|s| s.1 > 0).collect();
    shares.sort_unstable();
    let mut next = 0;
    for (first, length) in shares {
        if first != next {
            return Err(format!("the ranks' rows do not join: row {next} should come next, row {first} does"));
        }
        next += length;
    }
    if next != header.count {
        return Err(format!("the header says {} particles, the ranks have {next}", header.count));
    }
    Ok(())
}

/// Collective: do all ranks want to write the same file? Else HDF5 would hang or write nonsense.
fn check_same(path: &Path, header: &Header, kept: Kept, comm: &Communicator) -> Result<(), String> {
    let mut mine = header.bytes();
    mine.extend(content_name(kept).bytes());
    mine.extend(path.as_os_str().as_encoded_bytes());
    let same = h5::broadcast(comm, 0, mine.clone()) == mine;
    let mut all = false;
    comm.all_reduce_into(&same, &mut all, mpi::collective::SystemOperation::logical_and());
    if all { Ok(()) } else { Err("the ranks disagree on the header or the path".into()) }
}

/// Collective: makes the file at `temporary` with all its contents, and closes it.
fn write_all(temporary: &Path, header: &Header, rows: &Rows, kept: Kept, comm: &Communicator) -> Result<(), FileError> {
    let root = comm.rank() == 0;
    let needed = bytes_needed(header.count, kept);
    let step = |result: hdf5::Result<()>| h5::agree(comm, result.map_err(|error| refused(temporary, needed, &error)));

    let file = h5::create(temporary, comm).map_err(|error| refused(temporary, needed, &error));
    let file = h5::agree(comm, file)?;
    let layout = Layout::make(&file, header, kept).map_err(|error| refused(temporary, needed, &error));
    let layout = h5::agree(comm, layout)?;
    // The guard against a full disk: HDF5 would report success, and hang in closing. Contiguous datasets have their
    // place once they are made, so after a flush the file has its final length.
    step(file.flush())?;
    h5::agree(comm, if root { disk::allocate(temporary) } else { Ok(()) })?;

    for (field, dataset) in &layout.fields {
        step(match rows.column(field) {
            Column::Whole(values) => write_rows(dataset, rows.first, values, Transfer::Together),
            Column::Real(values) => write_rows(dataset, rows.first, values, Transfer::Together),
        })?;
    }
    layout.write_vtk(header.count, rows, root, step)?;
    // A flush under MPI is an fsync on every rank's machine.
    step(file.flush())?;
    drop(layout);
    step(file.close())
}

fn refused(path: &Path, needed: u64, error: &hdf5::Error) -> FileError {
    let what = error.to_string();
    if what.contains("No space left") || what.contains("quota") {
        FileError::DiskFull { path: path.display().to_string(), needed }
    } else {
        FileError::cannot_write(path, what)
    }
}

/// The datasets of a new file.
struct Layout {
    fields: Vec<(&'static Field, Dataset)>,
    /// `NumberOfPoints`, `NumberOfCells`, `NumberOfConnectivityIds`, one number each.
    numbers: Vec<Dataset>,
    connectivity: Dataset,
    offsets: Dataset,
    types: Dataset,
}

impl Layout {
    /// Collective, the same calls with the same values on all ranks.
    fn make(file: &hdf5::File, header: &Header, kept: Kept) -> hdf5::Result<Self> {
        let count = header.count as usize;
        let group = |name: &str| file.create_group_builder().obj_track_times(false).create(name);

        let sph = group("sph")?;
        sph.new_attr::<u64>().create("format_version")?.write_scalar(&FORMAT_VERSION)?;
        text::write(&sph, "content", content_name(kept))?;
        text::write(&sph, "title", &header.title)?;
        text::write(&sph, "scene_hash", &header.scene_hash)?;
        text::write(&sph, "space", header.space.name())?;
        text::write(&sph, "kernel", header.kernel.name())?;
        for (name, value) in [("spacing", header.spacing), ("h", header.h), ("time", header.time)] {
            sph.new_attr::<f64>().create(name)?.write_scalar(&value)?;
        }
        sph.new_attr_builder().with_data(&header.gravity).create("gravity")?;
        for (name, value) in [("step", header.step), ("count", header.count)] {
            sph.new_attr::<u64>().create(name)?.write_scalar(&value)?;
        }

        let particles = group("particles")?;
        let mut fields = Vec::new();
        for field in fields_of(kept) {
            let shape = match field.rank.components() {
                1 => vec![count],
                components => vec![count, components],
            };
            let dataset = match field.rank {
                schema::Rank::Whole => contiguous::<u64>(&particles, field.name, shape)?,
                _ => contiguous::<f64>(&particles, field.name, shape)?,
            };
            text::write(&dataset, "units", field.unit)?;
            text::write(&dataset, "description", field.description)?;
            fields.push((field, dataset));
        }

        // What VTK asks for: 1-D counts, signed offsets, one vertex cell (type 1) a particle, one piece.
        let vtk = group("VTKHDF")?;
        vtk.new_attr_builder().with_data(&[1i64, 0]).create("Version")?;
        text::write(&vtk, "Type", "UnstructuredGrid")?;
        let mut numbers = Vec::new();
        for name in ["NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"] {
            numbers.push(contiguous::<i64>(&vtk, name, vec![1])?);
        }
        let connectivity = contiguous::<i64>(&vtk, "Connectivity", vec![count])?;
        let offsets = contiguous::<i64>(&vtk, "Offsets", vec![count + 1])?;
        let types = contiguous::<u8>(&vtk, "Types", vec![count])?;
        file.link_hard("/particles/position", "/VTKHDF/Points")?;
        let _point_data = group("VTKHDF/PointData")?;
        for field in fields_of(Kept::Everywhere).filter(|field| field.name != schema::POSITION.name) {
            file.link_hard(&format!("/particles/{}", field.name), &format!("/VTKHDF/PointData/{}", field.name))?;
        }
        Ok(Self { fields, numbers, connectivity, offsets, types })
    }

    /// Collective: fills the VTK view's own datasets. `step` agrees on the outcome of each transfer.
    fn write_vtk<F>(&self, count: u64, rows: &Rows, root: bool, step: F) -> Result<(), FileError>
    where
        F: Fn(hdf5::Result<()>) -> Result<(), FileError>,
    {
        let number = if root { vec![count as i64] } else { Vec::new() };
        for dataset in &self.numbers {
            step(write_rows(dataset, 0, &number, Transfer::Together))?;
        }
        let first = rows.first as i64;
        let end = first + rows.len() as i64;
        let vertices: Vec<i64> = (first..end).collect();
        step(write_rows(&self.connectivity, rows.first, &vertices, Transfer::Together))?;
        // Offsets has one entry more: whoever has row i writes entry i + 1, and the first also entry 0.
        let (start, offsets): (i64, Vec<i64>) = match (rows.is_empty(), first) {
            (true, _) => (0, Vec::new()),
            (false, 0) => (0, (0..=end).collect()),
            (false, _) => (first + 1, (first + 1..=end).collect()),
        };
        step(write_rows(&self.offsets, start as u64, &offsets, Transfer::Together))?;
        step(write_rows(&self.types, rows.first, &vec![1u8; rows.len()], Transfer::Together))
    }
}

/// A contiguous dataset whose place is reserved at once, not filled, and without times.
fn contiguous<T: H5Type>(group: &Group, name: &str, shape: Vec<usize>) -> hdf5::Result<Dataset> {
    group
        .new_dataset::<T>()
        .no_chunk()
        .alloc_time(Some(AllocTime::Early))
        .fill_time(FillTime::Never)
        .obj_track_times(false)
        .shape(shape)
        .create(name)
}
