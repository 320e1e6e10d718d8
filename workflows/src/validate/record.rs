//! `validation.json` in a run folder: which sources computed the run, when, and from which scene. A figure in RESULTS.md
//! carries what stands there, however often the run is evaluated again.

use crate::{failure::Failure, launch, paths};
use formats::{disk, folder::RunFolder, provenance, scene::Scene};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use xshell::cmd;

/// The sources the programs are built from, now.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sources {
    /// Commit, 12 digits, or `unknown`.
    pub commit: String,
    /// Are there changes in the programs that are not committed?
    pub changed: bool,
}

/// Of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// What computed it.
    #[serde(flatten)]
    pub sources: Sources,
    /// The day it began, UTC: `2026-01-31`.
    pub date: String,
    /// Hash of the scene file, as [`Scene::text_hash`] has it.
    pub scene: String,
    /// MPI ranks.
    pub ranks: u32,
    /// Wall time of all stages, s; none until it is done, and where it was stopped on the way.
    pub seconds: Option<f64>,
}

/// What an earlier run is good for.
#[derive(Debug, PartialEq)]
pub enum Earlier {
    /// It is done, and of the same scene.
    Done(Record),
    /// It was stopped on the way, and the same sources can go on with it.
    Begun(Record),
    /// Nothing, and why.
    Useless(&'static str),
}

impl Sources {
    /// Asks git about what the figures depend on: programs, scenes and their locked dependencies.
    pub fn now() -> Result<Self, Failure> {
        let shell = launch::shell()?;
        let read = |command: xshell::Cmd<'_>| command.quiet().ignore_stderr().read().unwrap_or_default();
        let commit = read(cmd!(shell, "git rev-parse --short=12 HEAD"));
        let parts = ["Cargo.toml", "Cargo.lock", "formats", "sph-prep", "sph-run", "sph-post", "workflows"];
        let changed = !read(cmd!(shell, "git status --porcelain -- {parts...}")).is_empty();
        Ok(Self { commit: if commit.is_empty() { "unknown".into() } else { commit }, changed })
    }
}

impl Sources {
    /// The last commit that changed what computes a run, so that commits of scenes, results and pages do not make old runs
    /// look out of date.
    pub fn of_programs() -> Result<Self, Failure> {
        let shell = launch::shell()?;
        let read = |command: xshell::Cmd<'_>| command.quiet().ignore_stderr().read().unwrap_or_default();
        let parts = ["formats/src", "sph-prep/src", "sph-run/src"];
        let commit = read(cmd!(shell, "git log -1 --format=%h --abbrev=12 -- {parts...}"));
        let changed = !read(cmd!(shell, "git status --porcelain -- {parts...}")).is_empty();
        Ok(Self { commit: if commit.is_empty() { "unknown".into() } else { commit }, changed })
    }
}

impl std::fmt::Display for Sources {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", self.commit, if self.changed { " with uncommitted changes" } else { "" })
    }
}

impl Record {
    /// Of a run that begins now.
    pub fn begun(sources: &Sources, scene: &str, ranks: u32) -> Self {
        Self { sources: sources.clone(), date: today(), scene: Scene::text_hash(scene), ranks, seconds: None }
    }

    /// Puts it in the run folder.
    pub fn write(&self, folder: &Path) -> Result<(), Failure> {
        let path = path(folder);
        let fault = |e: String| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display()));
        let text = serde_json::to_string_pretty(self).map_err(|e| fault(e.to_string()))?;
        disk::write_atomic(&path, format!("{text}\n").as_bytes()).map_err(|e| fault(e.to_string()))
    }
}

/// Looks at a run folder: what is in it counts only if it was made from the text of the case's scene.
pub fn earlier(folder: &Path, scene: &str, sources: &Sources) -> Earlier {
    let Ok(text) = std::fs::read_to_string(path(folder)) else {
        return Earlier::Useless("nothing says which sources made it");
    };
    let Ok(record) = serde_json::from_str::<Record>(&text) else {
        return Earlier::Useless("its validation.json cannot be read");
    };
    let run = RunFolder::new(folder);
    let prepared = std::fs::read_to_string(run.scene()).unwrap_or_default();
    if record.scene != Scene::text_hash(scene) || prepared != scene {
        Earlier::Useless("its scene is another one by now")
    } else if run.done().is_file() {
        Earlier::Done(record)
    } else if record.sources == *sources {
        Earlier::Begun(record)
    } else {
        Earlier::Useless("it was stopped on the way, and its sources have changed since")
    }
}

/// The day now, UTC.
pub fn today() -> String {
    provenance::now().chars().take("2026-01-31".len()).collect()
}

fn path(folder: &Path) -> PathBuf {
    folder.join("validation.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_runs_of_the_same_scene_are_used_again() {
        let work = tempfile::tempdir().unwrap();
        let (folder, run) = (work.path(), RunFolder::new(work.path()));
        let sources = |commit: &str| Sources { commit: commit.into(), changed: false };
        let useless = |scene: &str, commit: &str, why: &str| match earlier(folder, scene, &sources(commit)) {
            Earlier::Useless(reason) => assert!(reason.contains(why), "{reason}"),
            other => panic!("{other:?}"),
        };
        std::fs::write(run.scene(), "spacing = 1").unwrap();
        useless("spacing = 1", "a", "nothing says");
        let record = Record::begun(&sources("a"), "spacing = 1", 2);
        assert!(record.date.len() == 10 && record.date.starts_with("20"), "{record:?}");
        record.write(folder).unwrap();
        assert_eq!(earlier(folder, "spacing = 1", &sources("a")), Earlier::Begun(record.clone()));
        useless("spacing = 1", "b", "stopped on the way");
        std::fs::write(run.done(), "").unwrap();
        // Today's commit is not put on it.
        assert_eq!(earlier(folder, "spacing = 1", &sources("b")), Earlier::Done(record));
        useless("spacing = 2", "a", "another");
        std::fs::write(run.scene(), "spacing = 3").unwrap();
        useless("spacing = 1", "a", "another");
        std::fs::write(path(folder), "{}").unwrap();
        useless("spacing = 1", "a", "cannot be read");
    }
}
