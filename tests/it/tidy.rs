//! Rules of the house that a machine can check.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{WorkFolder, repository};

const PACKAGES: [&str; 6] = ["formats", "sph-prep", "sph-run", "sph-post", "workflows", "tests"];
const MOST_LINES: usize = 600;

/// Every file below `folder` with one of the endings, sorted.
fn files(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| endings.iter().any(|ending| e == *ending)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// All Rust sources, with their text.
fn sources() -> Vec<(PathBuf, String)> {
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        (path, text)
    };
    PACKAGES.iter().flat_map(|package| files(&repository().join(package), &["rs"])).map(read).collect()
}

fn none(faults: Vec<String>) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn no_file_is_too_long() {
    let long = |(path, text): &(PathBuf, String)| {
        let lines = text.lines().count();
        (lines > MOST_LINES).then(|| format!("{}: {lines} lines, at most {MOST_LINES}", path.display()))
    };
    none(sources().iter().filter_map(long).collect());
}

#[test]
fn nothing_is_left_to_do() {
    // Spelled in two parts, or this file would find itself.
    let marks = [concat!("to", "do!"), concat!("unimple", "mented!"), concat!("db", "g!(")];
    let mut faults = Vec::new();
    for (path, text) in sources() {
        for (number, line) in text.lines().enumerate() {
            if let Some(mark) = marks.iter().find(|mark| line.contains(**mark)) {
                faults.push(format!("{}:{}: {mark}", path.display(), number + 1));
            }
        }
    }
    none(faults);
}

#[test]
fn no_path_of_one_machine() {
    let marks = [concat!("/ho", "me/"), concat!("/ro", "ot/"), concat!("/wo", "rk/"), concat!("/Us", "ers/")];
    let mut faults = Vec::new();
    for (path, text) in sources() {
        for (number, line) in text.lines().enumerate() {
            if let Some(mark) = marks.iter().find(|mark| line.contains(**mark)) {
                faults.push(format!("{}:{}: {mark}", path.display(), number + 1));
            }
        }
    }
    none(faults);
}

#[test]
fn formatted() {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let has = Command::new(&cargo).args(["fmt", "--version"]).output().is_ok_and(|output| output.status.success());
    if !has {
        tests::left_out("rustfmt is not installed");
        return;
    }
    let output = Command::new(cargo).args(["fmt", "--all", "--check"]).current_dir(repository()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let shown: Vec<&str> = said.lines().filter(|line| line.starts_with("Diff in")).collect();
    assert!(output.status.success(), "run `cargo fmt --all`:\n{}", shown.join("\n"));
}

/// `pub const NAME: i32 = 65;` in formats/src/exit.rs.
fn exit_codes() -> BTreeMap<i32, String> {
    let text = std::fs::read_to_string(repository().join("formats/src/exit.rs")).unwrap();
    let code = |line: &str| {
        let (name, value) = line.strip_prefix("pub const ")?.split_once(": i32 = ")?;
        Some((value.trim_end_matches(';').parse().ok()?, name.to_owned()))
    };
    text.lines().filter_map(code).collect()
}

/// First cells of the table below the heading `## Exit codes`.
fn exit_codes_of_the_readme() -> BTreeSet<i32> {
    let text = std::fs::read_to_string(repository().join("README.md")).unwrap();
    let section = text.split("\n## Exit codes").nth(1).expect("README.md has a section `## Exit codes`");
    let section = section.split("\n## ").next().unwrap_or(section);
    let cells = section.lines().filter_map(|line| line.strip_prefix('|')?.split('|').next());
    cells.filter_map(|cell| cell.trim().parse().ok()).collect()
}

#[test]
fn the_readme_names_the_exit_codes() {
    let codes = exit_codes();
    assert!(codes.len() >= 7 && codes[&65] == "NO_INPUT", "{codes:?}");
    // 1 is no code of the stages: `./talus test` has it for tests that fail.
    let with_tests: BTreeSet<_> = codes.into_keys().chain([1]).collect();
    assert_eq!(with_tests, exit_codes_of_the_readme());
}

#[test]
fn links_lead_somewhere() {
    let root = repository();
    let mut pages: Vec<PathBuf> = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "VALIDATION.md", "LICENSE"]
        .iter()
        .map(|name| root.join(name))
        .collect();
    pages.retain(|page| page.is_file());
    assert!(pages.iter().any(|page| page.ends_with("README.md")));
    for folder in ["docs", "packaging", "workflows", "tests"] {
        let folder = root.join(folder);
        pages.extend(if folder.is_dir() { files(&folder, &["md"]) } else { Vec::new() });
    }
    let mut faults = Vec::new();
    for page in pages {
        let text = std::fs::read_to_string(&page).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let path = target.split('#').next().unwrap_or_default();
            let elsewhere = target.contains("://") || target.starts_with("mailto:") || path.is_empty();
            if !elsewhere && !page.with_file_name(path).exists() {
                faults.push(format!("{}: there is no {target}", page.display()));
            }
        }
    }
    none(faults);
}

#[test]
fn every_package_is_a_member_with_the_common_settings() {
    for package in PACKAGES {
        let text = std::fs::read_to_string(repository().join(package).join("Cargo.toml")).unwrap();
        for line in ["version.workspace = true", "license.workspace = true", "[lints]\nworkspace = true"] {
            assert!(text.contains(line), "{package}/Cargo.toml: no `{line}`");
        }
    }
}

/// EasyBuild fetches the crates by itself and needs each of them, with the checksum of the lock file.
#[test]
fn the_easyconfig_has_the_crates_of_the_lock_file() {
    let lock: toml::Table = std::fs::read_to_string(repository().join("Cargo.lock")).unwrap().parse().unwrap();
    let easyconfigs = files(&repository().join("packaging/easybuild"), &["eb"]);
    let [easyconfig] = easyconfigs.as_slice() else { panic!("{easyconfigs:?}") };
    let text = std::fs::read_to_string(easyconfig).unwrap();
    let listed: BTreeSet<&str> = text.lines().map(str::trim).filter(|line| line.contains(".tar.gz': '")).collect();
    let mut locked = BTreeSet::new();
    for package in lock["package"].as_array().unwrap() {
        let [name, version] = ["name", "version"].map(|key| package[key].as_str().unwrap());
        if let Some(checksum) = package.get("checksum") {
            locked.insert(format!("{{'{name}-{version}.tar.gz': '{}'}},", checksum.as_str().unwrap()));
            assert!(text.contains(&format!("    ('{name}', '{version}'),\n")), "{name} {version} is not in `crates`");
        }
    }
    assert!(locked.len() > 100, "{}", locked.len());
    let locked: BTreeSet<&str> = locked.iter().map(String::as_str).collect();
    let other: Vec<_> = listed.symmetric_difference(&locked).collect();
    assert!(other.is_empty(), "run `python3 packaging/easybuild/crates.py`; these differ: {other:?}");
}

/// Runs ./talus with a cargo that answers `--version` with a line and else says how it was called.
fn launched_with_cargo(version: &str) -> tests::Output {
    use std::os::unix::fs::PermissionsExt;
    let work = WorkFolder::new();
    let script = format!("#!/bin/sh\n[ \"$1\" = --version ] && echo \"{version}\" && exit 0\necho \"called: $*\"\n");
    let cargo = work.write("cargo", &script);
    std::fs::set_permissions(cargo, std::fs::Permissions::from_mode(0o755)).unwrap();
    let mut path = work.path().as_os_str().to_owned();
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    let mut command = Command::new(repository().join("talus"));
    // Without a cargo in the home folder either.
    command.arg("cases").env("PATH", path).env("HOME", work.path()).env("TALUS_NO_INSTALL", "1");
    tests::run_within(tests::TIME_LIMIT, &mut command)
}

#[test]
fn the_launcher_refuses_a_cargo_that_is_too_old() {
    let manifest: toml::Table = std::fs::read_to_string(repository().join("Cargo.toml")).unwrap().parse().unwrap();
    let wanted = manifest["workspace"]["package"]["rust-version"].as_str().unwrap().to_owned();
    let (major, minor) = wanted.split_once('.').unwrap();
    let minor: u32 = minor.parse().unwrap();
    for old in [format!("{major}.{}.9", minor - 1), format!("{major}.9.0"), "0.99.0".to_owned()] {
        let output = launched_with_cargo(&format!("cargo {old} (abc 2020-01-01)")).expect(formats::exit::CANNOT_WRITE);
        let said = &output.stderr;
        assert!(said.contains(&format!("cargo {old} is too old")) && said.contains("rustup"), "{said}");
        assert!(said.contains(&format!("Rust {wanted} or newer")) && output.stdout.is_empty(), "{output}");
    }
    for new in [format!("{wanted}.0"), format!("{major}.{}.0-nightly", minor + 10), "2.0.0".to_owned()] {
        let output = launched_with_cargo(&format!("cargo {new} (abc 2030-01-01)")).expect(formats::exit::DONE);
        assert!(output.stdout.contains("called: run"), "{output}");
    }
}
