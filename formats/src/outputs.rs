//! What a run has put out so far: segments, each written once and never touched again, and their index.
//!
//! ```text
//! out/snapshot-000010.hdf    particles
//! out/history/000010.csv     lines of the history since the segment before, under the names of the columns
//! out/index.json             the segments in order, each with lengths and digests: what counts, and nothing else
//! out/history.csv            all lines as one file, for people; grows while the run goes on
//! out/snapshot.hdf.series    the snapshots with their times, for ParaView
//! ```
//!
//! A segment ends at every snapshot, and after [`LONGEST`] lines without one. So its borders follow from the scene alone,
//! and the files are the same however often a run was stopped. Lines after the last segment wait in the checkpoint.

use crate::disk;
use crate::folder::RunFolder;
use crate::provenance::sha256;
use crate::snapshot::{self, FileError};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// Version of the index; a newer one is refused.
pub const FORMAT_VERSION: u64 = 1;

/// Lines of the history in one segment, at most.
pub const LONGEST: u64 = 1000;

/// A piece of output that is written once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Counted from 0.
    pub number: u64,
    /// Steps done at its end.
    pub step: u64,
    /// Time at its end, s.
    pub time: f64,
    /// Lines of the history.
    pub history: History,
    /// The snapshot at its end.
    pub snapshot: Option<Snapshot>,
}

/// The lines of a segment: a file of [`RunFolder::history_piece`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct History {
    /// Without the names of the columns.
    pub lines: u64,
    pub bytes: u64,
    pub sha256: String,
}

/// The snapshot of a segment: a file of [`RunFolder::snapshot`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Snapshot {
    pub number: u64,
    pub bytes: u64,
    /// [`snapshot::digest`].
    pub digest: String,
}

/// The segments of a run, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Index {
    /// [`FORMAT_VERSION`].
    pub format_version: u64,
    pub segments: Vec<Segment>,
}

impl Default for Index {
    fn default() -> Self {
        Self { format_version: FORMAT_VERSION, segments: Vec::new() }
    }
}

impl Index {
    /// The index of a run folder; `None` where there is none yet. Serial.
    ///
    /// # Errors
    /// `CannotRead`, `Newer`, `Damaged`.
    pub fn read(folder: &RunFolder) -> Result<Option<Self>, FileError> {
        let path = folder.index();
        let text = match fs::read(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(FileError::reading(&path, &error)),
        };
        let damaged = |error: serde_json::Error| FileError::damaged(&path, error);
        let value: serde_json::Value = serde_json::from_slice(&text).map_err(damaged)?;
        let found = value["format_version"].as_u64().unwrap_or(0);
        if found > FORMAT_VERSION {
            return Err(FileError::Newer { path: path.display().to_string(), found, known: FORMAT_VERSION });
        }
        serde_json::from_value(value).map(Some).map_err(damaged)
    }

    /// Replaces the index of a run folder. Serial.
    ///
    /// # Errors
    /// `CannotWrite`, `DiskFull`.
    pub fn write(&self, folder: &RunFolder) -> Result<(), FileError> {
        let path = folder.index();
        let mut text = serde_json::to_vec_pretty(self).map_err(|error| FileError::cannot_write(&path, error))?;
        text.push(b'\n');
        disk::write_atomic(&path, &text)
    }

    /// Numbers and times of the snapshots.
    pub fn snapshots(&self) -> impl Iterator<Item = (u64, f64)> {
        self.segments.iter().filter_map(|segment| Some((segment.snapshot.as_ref()?.number, segment.time)))
    }

    /// All lines of the history, under the names of the columns; empty where there is no segment. Serial.
    ///
    /// # Errors
    /// `NotFound`, `CannotRead`, `Damaged`.
    pub fn history(&self, folder: &RunFolder) -> Result<String, FileError> {
        let mut text = String::new();
        for segment in &self.segments {
            let path = folder.history_piece(segment.number);
            let bytes = fs::read(&path).map_err(|error| FileError::reading(&path, &error))?;
            check_history(&path, &segment.history, &bytes)?;
            let piece = String::from_utf8(bytes).map_err(|error| FileError::damaged(&path, error))?;
            let lines = piece.find('\n').map_or(0, |end| end + 1);
            text += if text.is_empty() { &piece } else { &piece[lines..] };
        }
        Ok(text)
    }

    /// What is wrong with the files the index lists; a snapshot that was moved away is not wrong. Serial; reads
    /// everything.
    pub fn faults(&self, folder: &RunFolder) -> Vec<FileError> {
        self.segments.iter().flat_map(|segment| segment.faults(folder)).collect()
    }
}

impl Segment {
    /// The segment that ends here, of which `lines` of history (under the names of the columns in `head`) are put on
    /// the disk. Its snapshot must be there. Serial.
    ///
    /// # Errors
    /// `CannotWrite`, `DiskFull`.
    pub fn write(
        folder: &RunFolder,
        end: (u64, u64, f64),
        head: &str,
        lines: &str,
        snapshot: Option<(u64, String)>,
    ) -> Result<Self, FileError> {
        let (number, step, time) = end;
        let text = format!("{head}{lines}");
        disk::write_atomic(&folder.history_piece(number), text.as_bytes())?;
        let history =
            History { lines: lines.lines().count() as u64, bytes: text.len() as u64, sha256: sha256(text.as_bytes()) };
        let snapshot = snapshot.map(|(number, digest)| {
            let path = folder.snapshot(number);
            let bytes = fs::metadata(&path).map_err(|error| FileError::reading(&path, &error))?.len();
            Ok(Snapshot { number, bytes, digest })
        });
        Ok(Self { number, step, time, history, snapshot: snapshot.transpose()? })
    }

    fn faults(&self, folder: &RunFolder) -> Vec<FileError> {
        let path = folder.history_piece(self.number);
        let history = fs::read(&path)
            .map_err(|error| FileError::reading(&path, &error))
            .and_then(|bytes| check_history(&path, &self.history, &bytes));
        let snapshot = self.snapshot.as_ref().map_or(Ok(()), |listed| {
            let path = folder.snapshot(listed.number);
            match snapshot::digest(&path) {
                Ok(digest) if digest == listed.digest => Ok(()),
                Ok(_) => Err(FileError::damaged(&path, "its numbers do not match the digest in index.json")),
                // Users move old snapshots away.
                Err(FileError::NotFound { .. }) => Ok(()),
                Err(error) => Err(error),
            }
        });
        [history, snapshot].into_iter().filter_map(Result::err).collect()
    }
}

fn check_history(path: &Path, listed: &History, bytes: &[u8]) -> Result<(), FileError> {
    match bytes.len() as u64 == listed.bytes && sha256(bytes) == listed.sha256 {
        true => Ok(()),
        false => Err(FileError::damaged(path, "its bytes do not match the checksum in index.json")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "time [s],step [1]\n";

    /// A folder with two segments, without snapshots.
    fn written() -> (tempfile::TempDir, RunFolder, Index) {
        let place = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(place.path());
        fs::create_dir_all(folder.history_pieces()).unwrap();
        let first = Segment::write(&folder, (0, 0, 0.0), HEAD, "0e0,0\n", None).unwrap();
        let second = Segment::write(&folder, (1, 9, 0.1 + 0.2), HEAD, "1e-1,4\n3e-1,9\n", None).unwrap();
        let index = Index { segments: vec![first, second], ..Index::default() };
        index.write(&folder).unwrap();
        (place, folder, index)
    }

    #[test]
    fn pieces_join_to_one_history() {
        let (_place, folder, index) = written();
        assert_eq!(Index::read(&folder).unwrap().as_ref(), Some(&index));
        assert_eq!(index.history(&folder).unwrap(), format!("{HEAD}0e0,0\n1e-1,4\n3e-1,9\n"));
        assert_eq!(index.segments[1].history.lines, 2);
        assert!(index.faults(&folder).is_empty());
        assert_eq!(Index::read(&RunFolder::new("/nowhere")).unwrap(), None);
    }

    #[test]
    fn damage_is_named() {
        let (_place, folder, index) = written();
        let piece = folder.history_piece(1);
        for bytes in [&b"time [s],step [1]\n1e-1,4\n3e-1,8\n"[..], b"", b"time [s],step [1]\n1e-1,4\n"] {
            fs::write(&piece, bytes).unwrap();
            let error = index.history(&folder).unwrap_err();
            assert!(matches!(&error, FileError::Damaged { path, .. } if path.ends_with("000001.csv")), "{error}");
            assert_eq!(index.faults(&folder), [error]);
        }
        fs::remove_file(&piece).unwrap();
        assert!(matches!(index.history(&folder), Err(FileError::NotFound { .. })));

        fs::write(folder.index(), "{\"format_version\": 2, \"parts\": []}").unwrap();
        assert!(matches!(Index::read(&folder), Err(FileError::Newer { found: 2, known: 1, .. })));
        for text in ["", "{}", "[]", "{\"format_version\": 1}"] {
            fs::write(folder.index(), text).unwrap();
            assert!(matches!(Index::read(&folder), Err(FileError::Damaged { .. })), "{text}");
        }
    }
}
