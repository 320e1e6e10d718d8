//! The cases that come with Talus: `workflows/cases/<case>/{scene.toml, README.md}`.

use crate::{failure::Failure, paths};
use std::path::{Path, PathBuf};

/// A scene to run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// Folder name of a case, file stem of a user's own scene.
    pub name: String,
    /// The scene's title, or its name.
    pub title: String,
    /// The scene file.
    pub scene: PathBuf,
}

/// The case of a name, or a user's own scene file where `name` ends in `.toml`.
pub fn find(name: &str) -> Result<Case, Failure> {
    if name.ends_with(".toml") {
        let scene = paths::from_caller(Path::new(name));
        let stem = scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        return read(stem, scene);
    }
    let scene = paths::cases().join(name).join("scene.toml");
    if !scene.is_file() {
        let names = names()?.join(", ");
        return Err(Failure::usage(format!("there is no case `{name}`; there are: {names}; or name a file: my.toml")));
    }
    read(name.to_owned(), scene)
}

/// Prints names and titles.
pub fn list() -> Result<(), Failure> {
    for name in names()? {
        println!("{name:<22} {}", find(&name)?.title);
    }
    Ok(())
}

/// Folder names, sorted.
fn names() -> Result<Vec<String>, Failure> {
    let folder = paths::cases();
    let entries = std::fs::read_dir(&folder)
        .map_err(|e| Failure::no_input(format!("{}: cannot list the cases: {e}", folder.display())))?;
    let mut names: Vec<String> = entries
        .flatten()
        .filter(|entry| entry.path().join("scene.toml").is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    Ok(names)
}

/// Only the title is read here: `sph-prep` checks scenes, and reports their faults with line and column.
fn read(name: String, scene: PathBuf) -> Result<Case, Failure> {
    let text = std::fs::read_to_string(&scene)
        .map_err(|e| Failure::no_input(format!("{}: cannot read the scene: {e}", scene.display())))?;
    let title = text.parse::<toml::Table>().ok().and_then(|table| Some(table.get("title")?.as_str()?.to_owned()));
    Ok(Case { title: title.unwrap_or_else(|| name.clone()), name, scene })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_a_valid_scene_with_a_title_and_a_readme() {
        let names = names().unwrap();
        assert!(names.iter().any(|n| n == "column-demo"), "{names:?}");
        for name in names {
            let case = find(&name).unwrap();
            assert_ne!(case.title, name, "{name}: no title");
            let text = std::fs::read_to_string(&case.scene).unwrap();
            if let Err(faults) = formats::scene::Scene::read(&case.scene.display().to_string(), &text) {
                panic!("{faults}");
            }
            let readme = std::fs::read_to_string(case.scene.with_file_name("README.md")).unwrap();
            assert!(readme.contains(&format!("./talus case {name}")) || name == "column-demo", "{name}: no command");
        }
    }

    #[test]
    fn an_unknown_case_is_answered_with_the_known_ones() {
        let failure = find("collumn").unwrap_err();
        assert_eq!(failure.code, formats::exit::USAGE);
        assert!(failure.message.contains("column-demo"), "{failure}");
    }
}
