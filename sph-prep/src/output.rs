//! The run folder: it appears complete, or not at all.
//!
//! Everything is written into a staging folder, which is then renamed to the run folder, so that neither a failure
//! nor a killed process leaves half a run behind under its name. An empty folder that exists already may be a mount
//! point or lie where its owner can't make others, so then the staging folder lies within, and its files move up.

use crate::failure::Failure;
use formats::{disk, folder::RunFolder, scene::Sources};
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// A run folder in the making; gone again when dropped, unless published. One rank alone handles it.
#[derive(Debug)]
pub struct Staging {
    target: PathBuf,
    existed: bool,
    folder: RunFolder,
    /// Parents made on the way, outermost first.
    parents: Vec<PathBuf>,
    published: bool,
}

impl Staging {
    /// Starts a run folder at `target`, with its parents.
    ///
    /// # Errors
    /// [`Failure::Output`] where `target` is a file or a folder that isn't empty, or nothing can be written there.
    pub fn new(target: &Path) -> Result<Self, Failure> {
        let refuse = |why: &str| Err(Failure::Output { path: target.to_owned(), why: why.to_owned() });
        // A name that ends in "/" or "." would give the staging folder a name within the target.
        let target = target.components().collect::<PathBuf>();
        let existed = match fs::metadata(&target) {
            Ok(meta) if !meta.is_dir() => return refuse("is a file; the run folder must not exist yet, or be empty"),
            Ok(_) => {
                let mut entries = fs::read_dir(&target).map_err(|e| Failure::output(&target, &e))?;
                if entries.next().is_some() {
                    return refuse("is not empty, and nothing in it is overwritten; name a new or an empty folder");
                }
                true
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                if fs::symlink_metadata(&target).is_ok() {
                    return refuse("is a link to nowhere; the run folder must not exist yet, or be empty");
                }
                false
            }
            Err(e) => return Err(Failure::output(&target, &e)),
        };
        let id = std::process::id();
        let folder = match target.file_name() {
            Some(name) if !existed => target.with_file_name(format!("{}.tmp-{id}", name.to_string_lossy())),
            _ => target.join(format!(".tmp-{id}")),
        };
        let mut staging =
            Self { target, existed, folder: RunFolder::new(&folder), parents: Vec::new(), published: false };
        let missing: Vec<_> =
            folder.ancestors().skip(1).take_while(|p| !p.as_os_str().is_empty() && !p.exists()).collect();
        for parent in missing.into_iter().rev() {
            fs::create_dir(parent).map_err(|e| Failure::output(parent, &e))?;
            staging.parents.push(parent.to_owned());
        }
        fs::create_dir(&folder).map_err(|e| Failure::output(&staging.target, &e))?;
        Ok(staging)
    }

    /// Where to write.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// Writes a small file.
    ///
    /// # Errors
    /// [`Failure::Output`].
    pub fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), Failure> {
        let written = fs::File::create_new(path).and_then(|mut file| {
            io::Write::write_all(&mut file, bytes)?;
            file.sync_all()
        });
        written.map_err(|e| Failure::output(&self.target, &e))
    }

    /// Gives the folder its name.
    ///
    /// # Errors
    /// [`Failure::Output`], for example where another process has put something there meanwhile.
    pub fn publish(mut self) -> Result<(), Failure> {
        let moved = if self.existed { self.move_up() } else { fs::rename(self.folder.path(), &self.target) };
        moved.map_err(|e| Failure::output(&self.target, &e))?;
        self.published = true;
        Ok(())
    }

    /// Moves the files up into the folder around; takes them back where one can't be moved.
    fn move_up(&self) -> io::Result<()> {
        let mut moved: Vec<PathBuf> = Vec::new();
        let copies = [self.folder.path(), self.target.as_path()].map(Sources::folder);
        if copies[0].exists() {
            fs::rename(&copies[0], &copies[1])?;
        }
        // The particles first: once the scene is there, so is all it needs.
        let files = [self.folder.initial(), self.folder.provenance(), self.folder.scene()];
        for from in files {
            let to = self.target.join(from.file_name().unwrap_or_default());
            // A hard link, unlike a rename, never replaces a file; but not all file systems have them.
            let linked = match fs::hard_link(&from, &to) {
                Err(e) if e.kind() != io::ErrorKind::AlreadyExists && !to.exists() => fs::rename(&from, &to),
                other => other,
            };
            if let Err(error) = linked {
                moved.iter().for_each(|file| drop(fs::remove_file(file)));
                return Err(error);
            }
            moved.push(to);
        }
        fs::remove_dir_all(self.folder.path())?;
        disk::sync_folder(&self.target).map_err(io::Error::other)
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        if !self.published {
            // Nothing more can be done about a failure here.
            let _ = fs::remove_dir_all(self.folder.path());
            for parent in self.parents.iter().rev() {
                let _ = fs::remove_dir(parent);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fill(staging: &Staging) {
        for path in [staging.folder().initial(), staging.folder().provenance(), staging.folder().scene()] {
            staging.write(&path, b"x").unwrap();
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_new_folder_appears_when_published() {
        let place = tempfile::tempdir().unwrap();
        for target in [place.path().join("a/b/run/"), place.path().join("empty")] {
            if target.ends_with("empty") {
                fs::create_dir(&target).unwrap();
            }
            let staging = Staging::new(&target).unwrap();
            fill(&staging);
            assert!(!target.join("initial.hdf").exists());
            staging.publish().unwrap();
            assert_eq!(names(&target), ["initial.hdf", "provenance.json", "scene.lock.toml"]);
        }
        assert_eq!(names(place.path()), ["a", "empty"]);
        assert_eq!(names(&place.path().join("a/b")), ["run"]);
    }

    #[test]
    fn a_failure_leaves_nothing_behind() {
        let place = tempfile::tempdir().unwrap();
        fs::create_dir(place.path().join("empty")).unwrap();
        for target in ["a/b/run", "empty", "run"] {
            fill(&Staging::new(&place.path().join(target)).unwrap());
        }
        assert_eq!(names(place.path()), ["empty"]);
        assert!(names(&place.path().join("empty")).is_empty());
    }

    #[test]
    fn what_is_there_is_refused_and_kept() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("file");
        fs::write(&file, "mine").unwrap();
        for target in [&file, &file.join("run"), &place.path().to_owned()] {
            let failure = Staging::new(target).unwrap_err();
            assert_eq!(failure.exit_code(), 73, "{failure}");
        }
        assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
        assert_eq!(names(place.path()), ["file"]);
    }

    #[test]
    fn the_faster_of_two_wins() {
        let place = tempfile::tempdir().unwrap();
        for existed in [false, true] {
            let target = place.path().join(format!("run-{existed}"));
            if existed {
                fs::create_dir(&target).unwrap();
            }
            let staging = Staging::new(&target).unwrap();
            fill(&staging);
            fs::create_dir_all(&target).unwrap();
            fs::write(target.join("scene.lock.toml"), "theirs").unwrap();
            assert_eq!(staging.publish().unwrap_err().exit_code(), 73);
            assert_eq!(names(&target), ["scene.lock.toml"]);
            assert_eq!(fs::read_to_string(target.join("scene.lock.toml")).unwrap(), "theirs");
        }
    }
}
