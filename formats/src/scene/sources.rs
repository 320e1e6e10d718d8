//! The files that a scene names: where they are found, and how they come to all ranks and into the run folder.
//!
//! Paths are relative to the scene file. A run folder holds copies in `rasters/`, named by their number in the order in which the
//! scene asks for them, so that a run goes on where the originals are not.

use crate::provenance::sha256;
use std::{
    cell::RefCell,
    fs, io,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Name of the scene in a run folder.
const IN_RUN: &str = "scene.lock.toml";
/// Folder of the copies in a run folder.
const COPIES: &str = "rasters";

/// Files that a scene names, read when they are asked for, and then kept.
#[derive(Debug)]
pub struct Sources {
    place: Place,
    taken: RefCell<Vec<(String, Found)>>,
}

/// The bytes of a file; what the system says where there is none.
type Found = Result<Arc<[u8]>, String>;

#[derive(Debug)]
enum Place {
    /// Relative to this folder.
    Beside(PathBuf),
    /// Copies in this run folder.
    Run(PathBuf),
    /// Nowhere but among those taken.
    Given,
}

impl Sources {
    /// Those of a scene file, or of the scene in a run folder.
    pub fn of(scene: &Path) -> Self {
        let folder = scene.parent().unwrap_or(Path::new("")).to_owned();
        let in_run = scene.file_name().is_some_and(|name| name == IN_RUN);
        let place = if in_run { Place::Run(folder) } else { Place::Beside(folder) };
        Self { place, taken: RefCell::default() }
    }

    /// The bytes of a file; what the system says where there is none.
    pub(super) fn get(&self, path: &str) -> Found {
        let mut taken = self.taken.borrow_mut();
        if let Some((_, found)) = taken.iter().find(|(name, _)| name == path) {
            return found.clone();
        }
        let read = |file: PathBuf| fs::read(&file).map(Arc::from).map_err(|e| format!("{}: {e}", file.display()));
        let found = match &self.place {
            Place::Beside(folder) => read(folder.join(path)),
            Place::Run(folder) => read(folder.join(copy(taken.len(), path))),
            Place::Given => Err("was not handed on".into()),
        };
        taken.push((path.to_string(), found.clone()));
        found
    }

    /// Names and SHA-256 of the files that were found.
    pub(super) fn digests(&self) -> Vec<(String, String)> {
        let taken = self.taken.borrow();
        let found = taken.iter().filter_map(|(path, found)| Some((path.clone(), sha256(found.as_ref().ok()?))));
        found.collect()
    }

    /// All that was taken so far, for other ranks.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (path, found) in self.taken.borrow().iter() {
            let (kind, content) = match found {
                Ok(content) => (0, &content[..]),
                Err(why) => (1, why.as_bytes()),
            };
            for part in [path.as_bytes(), content] {
                bytes.extend((part.len() as u64).to_le_bytes());
                bytes.extend(part);
            }
            bytes.push(kind);
        }
        bytes
    }

    /// The inverse of [`Sources::to_bytes`].
    pub fn from_bytes(mut bytes: &[u8]) -> Self {
        let mut taken = Vec::new();
        while let Some((path, found)) = entry(&mut bytes) {
            taken.push((path, found));
        }
        Self { place: Place::Given, taken: RefCell::new(taken) }
    }

    /// The copies that the run folder needs: places within it, and contents.
    pub fn copies(&self) -> Vec<(PathBuf, Arc<[u8]>)> {
        let numbered =
            |(number, (path, found)): (usize, &(String, Found))| Some((copy(number, path), found.clone().ok()?));
        self.taken.borrow().iter().enumerate().filter_map(numbered).collect()
    }

    /// The folder of the copies within a run folder.
    pub fn folder(run: &Path) -> PathBuf {
        run.join(COPIES)
    }

    /// Writes the copies into a run folder.
    ///
    /// # Errors
    /// What the system says.
    pub fn write(&self, run: &Path) -> io::Result<()> {
        let copies = self.copies();
        if copies.is_empty() {
            return Ok(());
        }
        fs::create_dir(Self::folder(run))?;
        for (path, content) in copies {
            let mut file = fs::File::create_new(run.join(path))?;
            io::Write::write_all(&mut file, &content)?;
            file.sync_all()?;
        }
        fs::File::open(Self::folder(run))?.sync_all()
    }
}

/// What [`Sources::to_bytes`] writes of one file.
fn entry(bytes: &mut &[u8]) -> Option<(String, Found)> {
    let mut part = || {
        let (length, rest) = bytes.split_first_chunk::<8>()?;
        let (part, rest) = rest.split_at_checked(u64::from_le_bytes(*length) as usize)?;
        *bytes = rest;
        Some(part)
    };
    let (path, content) = (part()?, part()?);
    let (kind, rest) = bytes.split_first()?;
    *bytes = rest;
    let text = |part: &[u8]| String::from_utf8_lossy(part).into_owned();
    Some((text(path), if *kind == 0 { Ok(Arc::from(content)) } else { Err(text(content)) }))
}

fn copy(number: usize, path: &str) -> PathBuf {
    let name = Path::new(path).file_name().map_or_else(|| "raster".into(), |name| name.to_string_lossy());
    Path::new(COPIES).join(format!("{number}-{name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_folder_has_copies_of_what_was_taken() {
        let place = tempfile::tempdir().unwrap();
        fs::create_dir_all(place.path().join("a/b")).unwrap();
        fs::write(place.path().join("a/b/one.asc"), "1").unwrap();
        fs::write(place.path().join("one.asc"), "other").unwrap();
        let run = place.path().join("run");
        fs::create_dir(&run).unwrap();
        let sources = Sources::of(&place.path().join("a/scene.toml"));
        let ask = |sources: &Sources| {
            ["b/one.asc", "b/none.prj", "../one.asc", "b/one.asc"].map(|path| sources.get(path).ok())
        };
        let found = ask(&sources);
        assert_eq!(found[0].as_deref(), Some(&b"1"[..]));
        assert!(found[1].is_none() && found[2].as_deref() == Some(&b"other"[..]));
        // Other ranks, and the run folder after the originals are gone.
        assert_eq!(ask(&Sources::from_bytes(&sources.to_bytes())), found);
        sources.write(&run).unwrap();
        fs::remove_dir_all(place.path().join("a")).unwrap();
        assert_eq!(ask(&Sources::of(&run.join("scene.lock.toml"))), found);
        assert!(run.join("rasters/0-one.asc").exists() && run.join("rasters/2-one.asc").exists());
        assert!(Sources::from_bytes(&[]).get("x").is_err());
        let error = Sources::of(&place.path().join("scene.toml")).get("none.asc").unwrap_err();
        assert!(error.contains("none.asc: No such file"), "{error}");
    }
}
