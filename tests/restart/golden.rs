//! Run folders of every release are read by this one, and those of a later one are refused.
//!
//! `tests/golden/VERSION/stopped` is a run folder as that release left it when it was stopped half way, `digests.json` what
//! its files say. For a new release: `cargo test -p tests --test restart -- --ignored golden::made_anew`.

use formats::outputs::Index;
use formats::{checkpoint, exit, folder::RunFolder, provenance, snapshot};
use std::fs;
use std::path::{Path, PathBuf};
use tests::trial::{launch, state};
use tests::{WorkFolder, prepared, repository, run};

/// Two dozen rings, stopped after two snapshots.
const SCENE: &str = r#"
title = "Golden"
space = "axisymmetric"
spacing = "40 mm"
[material.drucker-prager]
density = "2600 kg/m3"
young = "0.4 MPa"
poisson = 0.3
friction = "25 deg"
cohesion = "0 Pa"
[body.column]
cylinder = { radius = "0.2 m", height = "0.2 m" }
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "100 ms"
[output]
snapshots = "50 ms"
history = "10 ms"
"#;

fn golden() -> PathBuf {
    repository().join("tests/golden")
}

/// What the files of a folder say, by their paths in it.
fn digests(folder: &RunFolder) -> serde_json::Value {
    let files = state(folder.path()).into_keys().filter(|path| path.extension().is_some_and(|e| e == "hdf"));
    let name = |path: &Path| path.strip_prefix(folder.path()).unwrap().display().to_string();
    let digest = |path: &Path| snapshot::digest(path).unwrap_or_else(|error| panic!("{error}"));
    files.map(|path| (name(&path), digest(&path).into())).collect::<serde_json::Map<_, _>>().into()
}

fn copied(from: &Path, to: &Path) -> RunFolder {
    for path in state(from).into_keys() {
        let place = to.join(path.strip_prefix(from).unwrap());
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::copy(&path, &place).unwrap();
    }
    RunFolder::new(to)
}

#[test]
fn run_folders_of_all_releases_are_read() {
    let work = WorkFolder::new();
    let mut releases = 0;
    for entry in fs::read_dir(golden()).unwrap() {
        let release = entry.unwrap().path();
        let version = release.file_name().unwrap().to_string_lossy().into_owned();
        let folder = copied(&release.join("stopped"), &work.join(&version));
        let text = fs::read_to_string(release.join("digests.json")).unwrap();
        assert_eq!(digests(&folder), serde_json::from_str::<serde_json::Value>(&text).unwrap(), "{version}");
        assert!(Index::read(&folder).unwrap().unwrap().faults(&folder).is_empty(), "{version}");
        run("sph-run", &[folder.path().as_os_str(), "--check".as_ref()], 0).expect(exit::DONE);
        run("sph-post", &[folder.path()], 0).expect(exit::DONE);
        let resumed = launch(&folder, 2, &[]).expect(exit::DONE);
        assert!(resumed.stderr.contains("resuming"), "{version}: {resumed}");
        run("sph-post", &[folder.path()], 0).expect(exit::DONE);
        releases += 1;
    }
    assert!(releases > 0, "there are none");
}

/// A later program's checkpoint is refused, not passed over for an older one: that would lose work.
#[test]
fn checkpoints_of_a_later_release_are_refused() {
    let work = WorkFolder::new();
    let folder = copied(&golden().join(env!("CARGO_PKG_VERSION")).join("stopped"), &work.join("run"));
    launch(&folder, 1, &["--stop-after-steps", "3"]).expect(exit::RESUMABLE);
    let path = folder.generation(*checkpoint::generations(&folder).unwrap().last().unwrap()).join("MANIFEST.json");
    let mut sealed: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    sealed["manifest"]["format_version"] = (checkpoint::FORMAT_VERSION + 1).into();
    sealed["sha256"] = provenance::sha256(sealed["manifest"].to_string().as_bytes()).into();
    fs::write(&path, sealed.to_string()).unwrap();
    let before = state(folder.path());
    let refused = launch(&folder, 2, &[]).expect(exit::NO_INPUT);
    assert!(refused.stderr.contains("use a newer program"), "{refused}");
    assert_eq!(state(folder.path()), before);
}

#[test]
#[ignore = "writes tests/golden anew, for a release"]
fn made_anew() {
    let work = WorkFolder::new();
    let made = prepared(&work, "run", SCENE, 1);
    launch(&made, 1, &["--stop-after-steps", "40"]).expect(exit::RESUMABLE);
    assert_eq!(Index::read(&made).unwrap().unwrap().snapshots().count(), 2, "half way");
    // Rates and hosts of this machine are of no use.
    fs::remove_dir_all(made.log()).unwrap();
    fs::remove_file(made.provenance()).unwrap();
    let release = golden().join(env!("CARGO_PKG_VERSION"));
    let _ = fs::remove_dir_all(&release);
    let folder = copied(made.path(), &release.join("stopped"));
    fs::write(release.join("digests.json"), format!("{:#}\n", digests(&folder))).unwrap();
}
