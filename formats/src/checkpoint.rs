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
use crate::outputs::Segment;
use crate::provenance::{Build, sha256};
use crate::schema::Kept;
use crate::snapshot::{self, Digests, FileError, Header, Rows};
use mpi::collective::SystemOperation;
use mpi::traits::{Communicator as _, CommunicatorCollectives};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::cmp::Ordering;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{fs, io, process};

/// Version of the manifest; a newer one is refused.
pub const FORMAT_VERSION: u64 = 2;

/// What belongs to one generation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`FORMAT_VERSION`].
    pub format_version: u64,
    /// Number of the generation; rises, is never used twice while an older one is kept.
    pub generation: u64,
    /// The generation that was the newest when this one was written.
    pub parent: Option<u64>,
    /// Steps done.
    pub step: u64,
    /// Time, s.
    pub time: f64,
    /// The scene's text: a scene that is changed later is compared with it.
    pub scene: String,
    /// As in the header of the state.
    pub scene_hash: String,
    /// Of the numbers of the state, field by field: the same on any number of ranks.
    pub digests: Digests,
    /// [`checksum`] of `state.hdf`: checked before HDF5 is let near the file.
    pub state_checksum: String,
    /// Length of `state.hdf` in bytes.
    pub state_bytes: u64,
    /// The run's own state (next output times, sums over time). Finite floats keep their bits; JSON knows no others.
    pub clock: serde_json::Value,
    /// What had been put out by then. What lies beyond is dropped on resume.
    pub outputs: Outputs,
    /// What writing this generation took, s.
    pub write_seconds: f64,
    /// The scheduler's job that wrote it.
    pub job: Option<String>,
    /// On so many ranks.
    pub ranks: u64,
    /// What wrote it.
    pub build: Build,
}

/// The outputs that belong to a generation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outputs {
    pub segments: Vec<Segment>,
    /// Lines of the history since the last segment.
    pub pending: String,
}

/// The manifest with its own checksum, as it is on disk.
#[derive(Serialize, Deserialize)]
struct Sealed {
    manifest: serde_json::Value,
    sha256: String,
}

/// The generation to go on from.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Its manifest.
    pub manifest: Manifest,
    /// Its `state.hdf`.
    pub state: PathBuf,
    /// Newer generations that were passed over because they are damaged; to be logged.
    pub warnings: Vec<FileError>,
}

/// Which generations are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Keep {
    /// So many sound ones, at least one.
    pub newest: usize,
    /// And for ever those whose number is a multiple of this.
    pub archive: Option<u64>,
}

/// A generation to write. What is marked (0) counts on rank 0 only.
pub struct Generation<'a> {
    pub folder: &'a RunFolder,
    pub header: &'a Header,
    /// As in [`snapshot::write`], with all fields.
    pub rows: &'a Rows,
    /// (0) See [`Manifest`], as all that follows.
    pub clock: &'a serde_json::Value,
    /// (0) On the disk already.
    pub outputs: Option<&'a Outputs>,
    /// (0)
    pub scene: &'a str,
    /// (0)
    pub job: Option<&'a str>,
    /// (0)
    pub keep: Keep,
    /// (0) Does this process still own the folder? Asked before anything is removed and before the generation gets its name.
    pub still_ours: &'a dyn Fn() -> Result<(), FileError>,
}

/// Collective: writes, reads back and publishes a new generation, then removes older ones. Returns its number.
///
/// # Errors
/// The same on all ranks: `CannotWrite`, `DiskFull`; `Damaged` if what was read back is not what was written. The
/// generations that were there before are then untouched.
pub fn commit(new: &Generation, comm: &Communicator) -> Result<u64, FileError> {
    let begun = Instant::now();
    let folder = new.folder;
    let generation = h5::from_root(comm, || (new.still_ours)().and_then(|()| begin(folder)))?;
    let unfinished = unfinished(folder, generation);
    let outcome = write_verified(&unfinished.join(STATE), new, comm).and_then(|(digests, checksum)| {
        let ranks = comm.size() as u64;
        h5::from_root(comm, || seal(new, generation, ranks, begun, digests, checksum))
    });
    if outcome.is_err() && comm.rank() == 0 && (new.still_ours)().is_ok() {
        let _ = fs::remove_dir_all(&unfinished);
    }
    outcome?;
    // The new generation is safe; only now may older ones go. That one can't be removed is no reason to stop a run.
    if comm.rank() == 0 {
        let _ = disk::replace(&folder.checkpoints().join("LATEST"), format!("gen-{generation:06}\n").as_bytes());
        let _ = prune(folder, new.keep);
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

/// The sound generation of a step; if several, the newest. Those after it are set aside, under names that no launch looks
/// at. Serial.
///
/// # Errors
/// `CannotRead` where there is none of that step, with the steps there are; as [`verify`]; `CannotWrite`.
pub fn go_back(folder: &RunFolder, step: u64) -> Result<Found, FileError> {
    let generations = generations(folder)?;
    let manifest =
        |&generation: &u64| Some((generation, read_manifest(&folder.generation(generation), generation).ok()?));
    let manifests: Vec<_> = generations.iter().filter_map(manifest).collect();
    let Some((generation, _)) = manifests.iter().rev().find(|(_, manifest)| manifest.step == step) else {
        let steps: Vec<_> = manifests.iter().map(|(_, manifest)| manifest.step.to_string()).collect();
        let what = format!("no checkpoint of step {step}; there are those of {}", steps.join(", "));
        return Err(FileError::CannotRead { path: folder.checkpoints().display().to_string(), what });
    };
    let manifest = verify(folder, *generation)?;
    // The newest first: wherever this is cut off, the newest that is left is a state the run was in.
    for later in generations.into_iter().filter(|later| later > generation).rev() {
        let place = folder.generation(later);
        let aside = (1..).map(|n| folder.checkpoints().join(format!("aside-{later:06}-{n}"))).find(|p| !p.exists());
        let moved = aside.map_or(Ok(()), |aside| fs::rename(&place, aside));
        moved.map_err(|error| FileError::writing(&place, 0, &error))?;
    }
    disk::sync_folder(&folder.checkpoints())?;
    Ok(Found { state: folder.generation(*generation).join(STATE), manifest, warnings: Vec::new() })
}

/// The newest generation whose manifest is sound, without a look at its state. Serial.
///
/// # Errors
/// `CannotRead`.
pub fn newest_manifest(folder: &RunFolder) -> Result<Option<Manifest>, FileError> {
    let manifest = |generation| read_manifest(&folder.generation(generation), generation).ok();
    Ok(generations(folder)?.into_iter().rev().find_map(manifest))
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
    if checksum(&state)? != manifest.state_checksum {
        let mut what = String::from("its bytes do not match the checksum in MANIFEST.json");
        if let Ok((_, digests)) = snapshot::digests(&state) {
            let fields = digests.different(&manifest.digests);
            what += &if fields.is_empty() { String::new() } else { format!(": changed in {}", fields.join(", ")) };
        }
        return Err(FileError::damaged(&state, what));
    }
    let (header, digests) = snapshot::digests(&state)?;
    let same = header.step == manifest.step
        && header.time.to_bits() == manifest.time.to_bits()
        && header.scene_hash == manifest.scene_hash;
    if !same || digests != manifest.digests {
        return Err(FileError::damaged(&state, "it belongs to another MANIFEST.json"));
    }
    Ok(manifest)
}

/// Computing time between checkpoints that makes a run end soonest where writing one takes `delta` and failures come
/// every `m` on average: J. T. Daly, A higher order estimate of the optimum checkpoint interval for restart dumps, Future
/// Generation Computer Systems 22 (2006) 303, the estimate of highest order.
pub fn optimum(delta: f64, m: f64) -> f64 {
    if delta >= 2.0 * m {
        return m;
    }
    let x = delta / (2.0 * m);
    (2.0 * delta * m).sqrt() * (1.0 + x.sqrt() / 3.0 + x / 9.0) - delta
}

/// Computing time between two checkpoints where writing one takes `cost` and failures come every `mtbf` on average:
/// [`optimum`], but never so short that writing takes more than 5 % of the time.
pub fn interval(cost: f64, mtbf: f64) -> f64 {
    optimum(cost, mtbf).max(19.0 * cost)
}

/// Bytes of a file that are hashed as one.
const BLOCK: u64 = 4 << 20;

/// A checksum of a file's bytes that ranks can share the work of: SHA-256 over those of its blocks of 4 MiB. Serial.
///
/// # Errors
/// `NotFound`, `CannotRead`.
pub fn checksum(path: &Path) -> Result<String, FileError> {
    Ok(sha256(&block_hashes(path, 0, 1)?))
}

/// Collective: [`checksum`], of which every rank does its share.
fn checksum_together(path: &Path, comm: &Communicator) -> Result<String, FileError> {
    let mine = h5::agree(comm, block_hashes(path, comm.rank() as u64, comm.size() as u64))?;
    let mut all = vec![0u8; mine.len()];
    comm.all_reduce_into(&mine[..], &mut all[..], SystemOperation::bitwise_or());
    Ok(sha256(&all))
}

/// The hashes of every `size`-th block from number `first` on; zeros stand for the others.
fn block_hashes(path: &Path, first: u64, size: u64) -> Result<Vec<u8>, FileError> {
    let reading = |error| FileError::reading(path, &error);
    let file = File::open(path).map_err(reading)?;
    let length = file.metadata().map_err(reading)?.len();
    let blocks = length.div_ceil(BLOCK).max(1);
    let mut hashes = vec![0u8; 32 * blocks as usize];
    let mut bytes = Vec::new();
    for block in (first..blocks).step_by(size as usize) {
        bytes.resize(BLOCK.min(length - block * BLOCK) as usize, 0);
        file.read_exact_at(&mut bytes, block * BLOCK).map_err(reading)?;
        hashes[32 * block as usize..][..32].copy_from_slice(&Sha256::digest(&bytes));
    }
    Ok(hashes)
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

/// Collective: writes the state, and has every rank read back what another one wrote. Returns the digests of its
/// numbers and the checksum of its bytes.
fn write_verified(state: &Path, new: &Generation, comm: &Communicator) -> Result<(Digests, String), FileError> {
    let digests = snapshot::write(state, new.header, new.rows, Kept::Checkpoint, comm)?;
    let (header, read) = snapshot::digests_of_shares(state, new.header.count, comm)?;
    if header != *new.header || read != digests {
        let what = format!("read back, it differs from memory: {}", read.different(&digests).join(", "));
        return Err(FileError::cannot_write(state, what));
    }
    Ok((digests, checksum_together(state, comm)?))
}

/// Rank 0: the manifest last, then the name.
fn seal(
    new: &Generation,
    generation: u64,
    ranks: u64,
    begun: Instant,
    digests: Digests,
    state_checksum: String,
) -> Result<(), FileError> {
    let (folder, header) = (new.folder, new.header);
    let unfinished = unfinished(folder, generation);
    let state = unfinished.join(STATE);
    let manifest = Manifest {
        format_version: FORMAT_VERSION,
        generation,
        parent: generations(folder)?.last().copied(),
        step: header.step,
        time: header.time,
        scene: new.scene.to_owned(),
        scene_hash: header.scene_hash.clone(),
        digests,
        state_checksum,
        state_bytes: fs::metadata(&state).map_err(|error| FileError::reading(&state, &error))?.len(),
        clock: new.clock.clone(),
        outputs: new.outputs.cloned().unwrap_or_default(),
        write_seconds: begun.elapsed().as_secs_f64(),
        job: new.job.map(str::to_owned),
        ranks,
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
    (new.still_ours)()?;
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
    let name = || path.display().to_string();
    match version.cmp(&FORMAT_VERSION) {
        Ordering::Greater => {
            return Err(FileError::Newer { path: name(), found: version, known: FORMAT_VERSION });
        }
        Ordering::Less => return Err(FileError::Older { path: name(), found: version, known: FORMAT_VERSION }),
        Ordering::Equal => {}
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

/// Removes older generations, keeping the newest with a sound manifest and a state of the right length, and those of
/// the archive.
fn prune(folder: &RunFolder, keep: Keep) -> Result<(), FileError> {
    let mut kept = 0;
    for generation in generations(folder)?.into_iter().rev() {
        let place = folder.generation(generation);
        if kept < keep.newest.max(1) {
            kept += usize::from(read_manifest(&place, generation).is_ok());
            continue;
        }
        if keep.archive.is_some_and(|every| generation.is_multiple_of(every)) {
            continue;
        }
        // Renamed first: a generation that is half removed must not be taken for a damaged one.
        let doomed = folder.checkpoints().join(format!("gen-{generation:06}.{}.tmp", process::id()));
        let removed = fs::rename(&place, &doomed).and_then(|()| fs::remove_dir_all(&doomed));
        removed.map_err(|error| FileError::writing(&place, 0, &error))?;
    }
    Ok(())
}
