//! Checkpoints: generations of the particles' whole state, of which one valid one is always on the disk.
//!
//! ```text
//! ckpt/gen-000012.tmp/   being written; ignored, and removed by the next commit
//! ckpt/gen-000012/       state.hdf   the particles, all fields
//!                        MANIFEST.json   written last: what belongs to this generation, with digests
//! ckpt/LATEST            the newest generation's name, for people: the scan of the folders decides
//! ```

use crate::disk;
use crate::folder::RunFolder;
use crate::h5::{self, Communicator};
use crate::provenance::{Build, sha256, sha256_file};
use crate::schema::Kept;
use crate::snapshot::{self, FileError, Header, Rows};
use mpi::traits::Communicator as _;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::{fs, process};

/// Version of the manifest; a newer one is refused.
pub const FORMAT_VERSION: u64 = 1;

/// What belongs to one generation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`FORMAT_VERSION`].
    pub format_version: u64,
    /// Number of the generation; rises, is never used twice while an older one is kept.
    pub generation: u64,
    /// Steps done.
    pub step: u64,
    /// Time, s.
    pub time: f64,
    /// SHA-256 of the scene's text.
    pub scene_hash: String,
    /// [`snapshot::digest`] of the state: the same on any number of ranks.
    pub digest: String,
    /// SHA-256 of the bytes of `state.hdf`: checked before HDF5 is let near the file.
    pub state_sha256: String,
    /// Length of `state.hdf` in bytes.
    pub state_bytes: u64,
    /// The run's own state (next output times, sums over time). Finite floats keep their bits; JSON knows no others.
    pub clock: serde_json::Value,
    /// Outputs that go on growing: path within the run folder, and the length in bytes that belongs to this
    /// generation. What lies beyond is dropped on resume.
    pub outputs: BTreeMap<String, u64>,
    /// What wrote it.
    pub build: Build,
}

/// The manifest with its own checksum, as it is on disk.
#[derive(Serialize, Deserialize)]
struct Sealed {
    manifest: serde_json::Value,
    sha256: String,
}

/// The generation to go on from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Its manifest.
    pub manifest: Manifest,
    /// Its `state.hdf`.
    pub state: PathBuf,
    /// Newer generations that were passed over because they are damaged; to be logged.
    pub warnings: Vec<FileError>,
}

/// Collective: writes, reads back and publishes a new generation, then removes older ones, keeping `keep` (at least
/// one) sound ones. `rows` are as in [`snapshot::write`], with all fields. `outputs` are put on the disk (fsync)
/// before the generation is published. `clock` and `outputs` count on rank 0 only. Returns the generation's number.
///
/// # Errors
/// The same on all ranks: `CannotWrite`, `DiskFull`; `Damaged` if what was read back is not what was written. The
/// generations that were there before are then untouched.
pub fn commit(
    folder: &RunFolder,
    header: &Header,
    rows: &Rows,
    clock: &serde_json::Value,
    outputs: &BTreeMap<String, u64>,
    keep: usize,
    comm: &Communicator,
) -> Result<u64, FileError> {
    let generation = h5::from_root(comm, || begin(folder))?;
    let unfinished = unfinished(folder, generation);
    let state = unfinished.join(STATE);
    let outcome = write_verified(&state, header, rows, comm)
        .and_then(|()| h5::from_root(comm, || seal(folder, generation, header, clock, outputs)));
    if outcome.is_err() && comm.rank() == 0 {
        let _ = fs::remove_dir_all(&unfinished);
    }
    outcome?;
    // The new generation is safe; only now may older ones go. That one can't be removed is no reason to stop a run.
    if comm.rank() == 0 {
        let _ = disk::write_atomic(&folder.checkpoints().join("LATEST"), format!("gen-{generation:06}\n").as_bytes());
        let _ = prune(folder, keep.max(1));
    }
    Ok(generation)
}

/// The newest sound generation, or `None` if there is none at all. Serial.
///
/// # Errors
/// `Damaged` if there are generations but no sound one; `Newer` or `Older` if the newest sound one was written by
/// another version; `CannotRead`.
pub fn latest(folder: &RunFolder) -> Result<Option<Found>, FileError> {
    let mut warnings = Vec::new();
    for generation in generations(folder)?.into_iter().rev() {
        match verify(folder, generation) {
            Ok(manifest) => {
                let state = folder.generation(generation).join(STATE);
                return Ok(Some(Found { manifest, state, warnings }));
            }
            // To fall back to an older state because this program is too old would lose work; and what an older one
            // wrote is not damaged.
            Err(error @ (FileError::Newer { .. } | FileError::Older { .. })) => return Err(error),
            Err(error) => warnings.push(error),
        }
    }
    if warnings.is_empty() {
        return Ok(None);
    }
    let all: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    let what = format!("none of its {} generations is sound ({})", all.len(), all.join("; "));
    Err(FileError::damaged(&folder.checkpoints(), what))
}

/// Collective: [`latest`], looked up by rank 0.
///
/// # Errors
/// As [`latest`], the same on all ranks.
pub fn latest_on_all(folder: &RunFolder, comm: &Communicator) -> Result<Option<Found>, FileError> {
    h5::from_root(comm, || latest(folder))
}

/// The numbers of the generations there, sound or not, rising. Serial.
///
/// # Errors
/// `CannotRead`.
pub fn generations(folder: &RunFolder) -> Result<Vec<u64>, FileError> {
    let path = folder.checkpoints();
    let entries = match fs::read_dir(&path) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(FileError::reading(&path, &error)),
    };
    let mut found = Vec::new();
    for entry in entries {
        let entry = entry.map_err(|error| FileError::reading(&path, &error))?;
        let number = entry.file_name().to_str().and_then(|text| text.strip_prefix("gen-")?.parse::<u64>().ok());
        found.extend(number.filter(|&number| entry.path() == folder.generation(number) && entry.path().is_dir()));
    }
    found.sort_unstable();
    Ok(found)
}

/// Verifies one generation: the manifest's checksum, the state's checksum and length, and that both belong
/// together. Serial.
///
/// # Errors
/// `Damaged`, `Newer`, `Older`, `CannotRead`.
pub fn verify(folder: &RunFolder, generation: u64) -> Result<Manifest, FileError> {
    let place = folder.generation(generation);
    let manifest = read_manifest(&place, generation)?;
    let state = place.join(STATE);
    if sha256_file(&state)? != manifest.state_sha256 {
        return Err(FileError::damaged(&state, "its bytes do not match the checksum in MANIFEST.json"));
    }
    let header = snapshot::read_header(&state)?;
    let same = header.step == manifest.step
        && header.time.to_bits() == manifest.time.to_bits()
        && header.scene_hash == manifest.scene_hash;
    if !same || snapshot::digest(&state)? != manifest.digest {
        return Err(FileError::damaged(&state, "it belongs to another MANIFEST.json"));
    }
    Ok(manifest)
}

const STATE: &str = "state.hdf";
const MANIFEST: &str = "MANIFEST.json";

fn unfinished(folder: &RunFolder, generation: u64) -> PathBuf {
    disk::temporary(&folder.generation(generation))
}

/// Removes what earlier commits left unfinished, and makes the folder of the next generation. Returns its number.
fn begin(folder: &RunFolder) -> Result<u64, FileError> {
    let path = folder.checkpoints();
    let writing = |error| FileError::writing(&path, 0, &error);
    fs::create_dir_all(&path).map_err(writing)?;
    for entry in fs::read_dir(&path).map_err(writing)? {
        let entry = entry.map_err(writing)?.path();
        let stale = entry.is_dir() && entry.extension().is_some_and(|extension| extension == "tmp");
        if stale {
            fs::remove_dir_all(&entry).map_err(writing)?;
        }
    }
    let generation = generations(folder)?.last().map_or(1, |newest| newest + 1);
    fs::create_dir(unfinished(folder, generation)).map_err(writing)?;
    Ok(generation)
}

/// Collective: writes the state, and has every rank read its rows back and compare them with its memory.
fn write_verified(state: &Path, header: &Header, rows: &Rows, comm: &Communicator) -> Result<(), FileError> {
    snapshot::write(state, header, rows, Kept::Checkpoint, comm)?;
    let range = rows.first..rows.first + rows.len() as u64;
    let (header_read, rows_read) = snapshot::read_rows(state, range, comm)?;
    let same = header_read == *header && rows_read.same_bits(rows);
    h5::agree(comm, if same { Ok(()) } else { Err(FileError::damaged(state, "read back, it differs from memory")) })
}

/// Rank 0: outputs to the disk, the manifest last, then the name.
fn seal(
    folder: &RunFolder,
    generation: u64,
    header: &Header,
    clock: &serde_json::Value,
    outputs: &BTreeMap<String, u64>,
) -> Result<(), FileError> {
    for (output, &length) in outputs {
        let path = folder.path().join(output);
        disk::sync_file(&path)?;
        let there = fs::metadata(&path).map_err(|error| FileError::reading(&path, &error))?.len();
        if there < length {
            let what = format!("it has {there} bytes, {length} were committed");
            return Err(FileError::cannot_write(&path, what));
        }
    }
    let unfinished = unfinished(folder, generation);
    let state = unfinished.join(STATE);
    let manifest = Manifest {
        format_version: FORMAT_VERSION,
        generation,
        step: header.step,
        time: header.time,
        scene_hash: header.scene_hash.clone(),
        digest: snapshot::digest(&state)?,
        state_sha256: sha256_file(&state)?,
        state_bytes: fs::metadata(&state).map_err(|error| FileError::reading(&state, &error))?.len(),
        clock: clock.clone(),
        outputs: outputs.clone(),
        build: Build::this(),
    };
    let path = unfinished.join(MANIFEST);
    let text = serde_json::to_value(&manifest)
        .and_then(|manifest| {
            let sha256 = sha256(manifest.to_string().as_bytes());
            serde_json::to_vec_pretty(&Sealed { manifest, sha256 })
        })
        .map_err(|error| FileError::cannot_write(&path, error))?;
    disk::write_atomic(&path, &text)?;
    if read_manifest(&unfinished, generation)? != manifest {
        return Err(FileError::cannot_write(&path, "read back, the manifest differs from memory"));
    }
    disk::publish(&unfinished, &folder.generation(generation))
}

/// Reads a manifest, and checks it and the state's length.
fn read_manifest(place: &Path, generation: u64) -> Result<Manifest, FileError> {
    let path = place.join(MANIFEST);
    let damaged = |what: &str| FileError::damaged(&path, what);
    let bytes = fs::read(&path).map_err(|error| FileError::reading(&path, &error))?;
    let sealed: Sealed = serde_json::from_slice(&bytes).map_err(|error| damaged(&error.to_string()))?;
    if sha256(sealed.manifest.to_string().as_bytes()) != sealed.sha256 {
        return Err(damaged("its contents do not match its own checksum"));
    }
    // The version before the rest, whose shape may have changed since.
    let version = sealed.manifest.get("format_version").and_then(serde_json::Value::as_u64);
    let version = version.ok_or_else(|| damaged("it has no format_version"))?;
    if version > FORMAT_VERSION {
        return Err(FileError::Newer { path: path.display().to_string(), found: version, known: FORMAT_VERSION });
    }
    let manifest: Manifest = serde_json::from_value(sealed.manifest).map_err(|error| damaged(&error.to_string()))?;
    if manifest.generation != generation {
        return Err(damaged(&format!("it belongs to generation {}", manifest.generation)));
    }
    let state = place.join(STATE);
    let length = fs::metadata(&state).map_err(|error| FileError::reading(&state, &error))?.len();
    if length != manifest.state_bytes {
        let what = format!("it has {length} bytes, MANIFEST.json says {}", manifest.state_bytes);
        return Err(FileError::damaged(&state, what));
    }
    Ok(manifest)
}

/// Removes older generations, keeping the `keep` newest with a sound manifest and a state of the right length.
fn prune(folder: &RunFolder, keep: usize) -> Result<(), FileError> {
    let mut kept = 0;
    for generation in generations(folder)?.into_iter().rev() {
        let place = folder.generation(generation);
        if kept < keep {
            kept += usize::from(read_manifest(&place, generation).is_ok());
            continue;
        }
        // Renamed first: a generation that is half removed must not be taken for a damaged one.
        let doomed = folder.checkpoints().join(format!("gen-{generation:06}.{}.tmp", process::id()));
        let removed = fs::rename(&place, &doomed).and_then(|()| fs::remove_dir_all(&doomed));
        removed.map_err(|error| FileError::writing(&place, 0, &error))?;
    }
    Ok(())
}
