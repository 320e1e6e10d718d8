//! Writing a particle file, by all ranks together.
//!
//! ```text
//! rank 0      makes the file alone, in memory: groups, attributes, and contiguous datasets, empty, whose places are fixed
//! rank 0      has the system allocate every byte of it (a full disk is found out here), and copies what is not empty
//! every rank  writes its rows at their places, and waits until they are on the disk
//! rank 0      renames the file
//! ```
//!
//! No call into HDF5 is collective. HDF5 over MPI-IO reports success on a full or failing disk and hangs in closing the
//! file, because one rank gives up while the others wait inside the library; here each rank's error is its own, and
//! `agree` tells it to all.

use super::digest::Sums;
use super::{Column, Digests, FORMAT_VERSION, FileError, Header, Rows, content_name, fields_of};
use crate::disk;
use crate::h5::{self, Communicator, text};
use crate::schema::{self, Kept};
use hdf5::plist::dataset_create::{AllocTime, FillTime};
use hdf5::{Dataset, Group, H5Type};
use mpi::traits::{Communicator as _, CommunicatorCollectives};
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Room for everything in the file that is not numbers of particles.
const METADATA_BYTES: u64 = 64 << 10;

/// Bytes handed to the system at once.
const PIECE: usize = 4 << 20;

/// Collective: writes a particle file, each rank its rows; together they must be the rows 0 to `header.count`, in any
/// order over the ranks, and some ranks may have none. The header must be the same on all ranks. Returns the digests
/// of what was to be written, the same on all ranks.
///
/// The file is written beside its place and renamed once it is whole and on the disk, so a failure leaves an older
/// file at `path` as it was. `kept` says which fields go in: `Everywhere` for a snapshot, `Checkpoint` for all.
/// The bytes of the file do not depend on the number of ranks.
///
/// # Errors
/// The same on all ranks. `CannotWrite` if the rows or headers don't fit together, a number is not finite, or the
/// system refuses; `DiskFull`, found out before the first number is written where the file system can tell.
pub fn write(path: &Path, header: &Header, rows: &Rows, kept: Kept, comm: &Communicator) -> Result<Digests, FileError> {
    let refuse = |what: String| FileError::cannot_write(path, what);
    h5::agree(comm, rows.fault(kept).map_or(Ok(()), |what| Err(refuse(what))))?;
    check_tiling(header, rows, comm).map_err(refuse)?;
    check_same(path, header, kept, comm).map_err(refuse)?;

    let root = comm.rank() == 0;
    let temporary = disk::temporary(path);
    let outcome = h5::from_root(comm, || make(&temporary, header, kept))
        .and_then(|places| h5::agree(comm, write_rows(&temporary, header, &places, rows, kept)))
        .and_then(|()| h5::agree(comm, if root { disk::publish(&temporary, path) } else { Ok(()) }));
    if outcome.is_err() && root {
        let _ = fs::remove_file(&temporary);
    }
    outcome?;
    let mut sums = Sums::new(kept);
    sums.add(rows);
    Ok(sums.finish_together(comm))
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

/// Where the datasets begin in the file.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Places {
    /// In the order of the fields.
    fields: Vec<u64>,
    connectivity: u64,
    offsets: u64,
    types: u64,
}

/// Rank 0: makes the file with everything in it but the rows, and has room made for those. HDF5 does so in memory: on a
/// disk that fails it would leave a file it cannot close, and crash at the end of the program.
fn make(temporary: &Path, header: &Header, kept: Kept) -> Result<Places, FileError> {
    disk::reserve(temporary, bytes_needed(header.count, kept))?;
    let refused = |error: hdf5::Error| FileError::cannot_write(temporary, error);
    let (memory, file) = disk::in_memory(h5::create).map_err(|error| FileError::cannot_write(temporary, error))?;
    let file = file.map_err(refused)?;
    let places = lay_out(&file, header, kept).map_err(refused)?;
    file.close().map_err(refused)?;
    disk::copy_sparse(&memory, temporary)?;
    Ok(places)
}

fn lay_out(file: &hdf5::File, header: &Header, kept: Kept) -> hdf5::Result<Places> {
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
        fields.push(place(&dataset)?);
    }

    // What VTK asks for: 1-D counts, signed offsets, one vertex cell (type 1) a particle, one piece.
    let vtk = group("VTKHDF")?;
    vtk.new_attr_builder().with_data(&[1i64, 0]).create("Version")?;
    text::write(&vtk, "Type", "UnstructuredGrid")?;
    for name in ["NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"] {
        contiguous::<i64>(&vtk, name, vec![1])?.write_raw(&[count as i64])?;
    }
    let connectivity = place(&contiguous::<i64>(&vtk, "Connectivity", vec![count])?)?;
    let offsets = place(&contiguous::<i64>(&vtk, "Offsets", vec![count + 1])?)?;
    let types = place(&contiguous::<u8>(&vtk, "Types", vec![count])?)?;
    file.link_hard("/particles/position", "/VTKHDF/Points")?;
    let _point_data = group("VTKHDF/PointData")?;
    for field in fields_of(Kept::Everywhere).filter(|field| field.name != schema::POSITION.name) {
        file.link_hard(&format!("/particles/{}", field.name), &format!("/VTKHDF/PointData/{}", field.name))?;
    }
    Ok(Places { fields, connectivity, offsets, types })
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

fn place(dataset: &Dataset) -> hdf5::Result<u64> {
    dataset.offset().ok_or_else(|| format!("{} has no place in the file", dataset.name()).into())
}

/// This rank's rows of all datasets, to the disk.
fn write_rows(temporary: &Path, header: &Header, places: &Places, rows: &Rows, kept: Kept) -> Result<(), FileError> {
    let fault = |error: io::Error| FileError::writing(temporary, bytes_needed(header.count, kept), &error);
    let file = File::options().write(true).open(temporary).map_err(fault)?;
    let write = || {
        let first = rows.first;
        for (field, place) in fields_of(kept).zip(&places.fields) {
            let place = place + 8 * field.rank.components() as u64 * first;
            match rows.column(field) {
                Column::Whole(values) => write_at(&file, place, values.iter().map(|value| value.to_ne_bytes()))?,
                Column::Real(values) => write_at(&file, place, values.iter().map(|value| value.to_ne_bytes()))?,
            }
        }
        let end = first + rows.len() as u64;
        write_at(&file, places.connectivity + 8 * first, (first as i64..end as i64).map(i64::to_ne_bytes))?;
        // Offsets has one entry more: whoever has row i writes entry i + 1, and the first also entry 0.
        let start = if first == 0 { 0 } else { first + 1 };
        let after = if rows.is_empty() { start } else { end + 1 };
        write_at(&file, places.offsets + 8 * start, (start as i64..after as i64).map(i64::to_ne_bytes))?;
        write_at(&file, places.types + first, (first..end).map(|_| [1u8]))?;
        file.sync_all()
    };
    write().map_err(fault)
}

/// Writes small groups of bytes one after the other from `place` on.
fn write_at<const N: usize>(file: &File, mut place: u64, values: impl Iterator<Item = [u8; N]>) -> io::Result<()> {
    let mut piece = Vec::with_capacity(PIECE.min(values.size_hint().0 * N));
    for value in values {
        piece.extend(value);
        if piece.len() >= PIECE {
            file.write_all_at(&piece, place)?;
            place += piece.len() as u64;
            piece.clear();
        }
    }
    file.write_all_at(&piece, place)
}
