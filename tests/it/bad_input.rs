//! Wrong input, one case after the other: each must end all ranks with the documented exit code and one message that
//! names the place, within a minute, and must leave what is on the disk as it was.

use formats::{exit, folder::RunFolder, lock::RunLock};
use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};
use tests::{Output, WorkFolder, command, ends_by_itself, prepared, run, run_within};

/// Nothing here computes anything: what takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(60);

/// Alone, and under mpirun.
const RANKS: [usize; 2] = [0, 3];

/// A sound scene, small and short.
const SOUND: &str = r#"title = "sound"
space = "plane-strain"
spacing = "10 mm"
[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.column]
box = { min = [0, 0, 0], max = ["0.1 m", 0, "0.1 m"] }
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "1 ms"
"#;

/// What is replaced in the sound scene, by what, and a word the message must have. The fault must be reported on a
/// line of the replacement.
const SCENES: &[(&str, &str, &str)] = &[
    // Not TOML.
    (r#"title = "sound""#, r#"title = "sound"#, "TOML"),
    (r#"spacing = "10 mm""#, "spacing = 10 mm", "quotes"),
    (r#"[end]"#, "[end", "TOML"),
    ("poisson = 0.3", "poisson = 0.3\npoisson = 0.2", "duplicate"),
    ("poisson = 0.3", "poisson = 0,3", "TOML"),
    // Not a quantity.
    (r#""10 mm""#, r#""10 apples""#, "apples"),
    (r#""10 mm""#, r#""10 kg/m3""#, "length"),
    (r#""10 mm""#, r#""ten mm""#, "length"),
    (r#""10 mm""#, "nan", "spacing"),
    (r#""10 mm""#, "inf", "spacing"),
    (r#""10 mm""#, "1e999", "spacing"),
    (r#""10 mm""#, "true", "length"),
    ("poisson = 0.3", r#"poisson = "0.3 Pa""#, "unit"),
    ("min = [0, 0, 0]", "min = [0, 0]", "min"),
    ("box = {", "box = 3 # {", "box"),
    // Out of range.
    (r#""10 mm""#, "0", "greater than 0"),
    (r#""10 mm""#, r#""-10 mm""#, "greater than 0"),
    (r#""30 deg""#, r#""90 deg""#, "90"),
    ("poisson = 0.3", "poisson = 0.5", "0.5"),
    (r#""2600 kg/m3""#, r#""0 kg/m3""#, "greater than 0"),
    (r#""0 Pa""#, r#""-1 Pa""#, "0 or greater"),
    ("cohesion =", "dilation = \"31 deg\"\ncohesion =", "friction"),
    (r#""1 ms""#, r#""0 s""#, "greater than 0"),
    ("[end]", "[kernel]\nh-over-dx = 5\n[end]", "h-over-dx"),
    ("[end]", "[initial]\njitter = 0.5\n[end]", "jitter"),
    ("[end]", "[initial]\nseed = -1\n[end]", "seed"),
    ("[end]", "[numerics]\ncourant = 0\n[end]", "courant"),
    ("[end]", "[numerics]\nshifting = 2\n[end]", "shifting"),
    ("[end]", "[numerics]\nprecision = \"f32\"\n[end]", "mixed"),
    ("[end]", "[initial]\nstress = \"pressure\"\npressure = \"-1 Pa\"\n[end]", "0 or greater"),
    ("[end]", "[output]\nsnapshots = \"2 ms\"\n[end]", "end.time"),
    // Unknown or missing.
    ("spacing =", "spcing = 1\nspacing =", "spcing"),
    (r#""plane-strain""#, r#""4d""#, "axisymmetric"),
    ("[material.drucker-prager]", "[material.concrete]", "concrete"),
    (r#""no-slip""#, r#""sticky""#, "free-slip"),
    (r#"slip = "no-slip""#, "", "slip"),
    ("[end]", "[wind]\nspeed = 1\n[end]", "wind"),
    // What does not fit together.
    (r#"title = "sound""#, r#"symmetry = ["y"]"#, "plane-strain"),
    (r#"title = "sound""#, r#"gravity = [0, "1 m/s2", 0]"#, "gravity"),
    (r#"axis = "z""#, r#"axis = "y""#, "normal to y"),
    ("[end]", "[initial]\nk0 = 0.4\n[end]", "k0"),
    ("[end]", "[initial]\nstress = \"pressure\"\n[end]", "missing"),
    ("[end]", "[initial]\nlattice = \"body-centred\"\n[end]", "three dimensions"),
    ("[end]", "[material.mu-i]\nviscosity = 1\n[end]", "exactly one is needed"),
    ("[end]", "[periodic]\nx = { from = 0, to = \"0.105 m\" }\n[end]", "whole number of spacings"),
    ("[end]", "[periodic]\nx = { from = 0, to = \"0.09 m\" }\n[end]", "out of the period"),
    (
        "[end]",
        "[periodic]\nx = { from = 0, to = 0.1 }\n[wall.side]\naxis = \"x\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n[end]",
        "repeats itself",
    ),
    (
        "[end]",
        "[periodic]\nx = { from = 0, to = 0.1 }\n[numerics]\nprecision = \"mixed\"\n[end]",
        "depend on where a run was stopped",
    ),
    (
        "[end]",
        "[wall.lid]\naxis = \"z\"\nat = \"0.02 m\"\nside = \"below\"\nslip = \"no-slip\"\nkind = \"mirror\"\n[end]",
        "2.2 h",
    ),
    ("[end]", "[numerics]\ndamping = \"1 1/s\"\n[end]", "damps a flow"),
    ("[end]", "[numerics]\nviscous-courant = 0.1\n[end]", "only with a viscosity"),
    (r#"slip = "no-slip""#, "slip = \"no-slip\"\nvelocity = [0, 0, 1]", "slides along itself"),
    (r#"slip = "no-slip""#, "slip = \"free-slip\"\nvelocity = [1, 0, 0]", "takes nothing along"),
    ("[wall.floor]", "cylinder = { radius = 1, height = 1 }\n[wall.floor]", "shape"),
    ("box = { min = [0, 0, 0]", "box = { min = [0, 0, -0.1]", "floor"),
    ("[wall.floor]", "[body.twin]\nbox = { min = [0, 0, 0], max = [0.1, 0, 0.1] }\n[wall.floor]", "overlaps"),
    (r#"max = ["0.1 m", 0, "0.1 m"]"#, r#"max = ["0.1 m", 0, "1 mm"]"#, "no particle"),
    (r#"max = ["0.1 m", 0, "0.1 m"]"#, r#"max = ["100 km", 0, "0.1 m"]"#, "2^20"),
    ("box = { min = [0, 0, 0], max =", "cylinder = { radius = 0.1, height = 0.1 } #", "cylinder"),
    (
        "[end]",
        "[wall.lid]\naxis = \"z\"\nat = \"0.505 m\"\nside = \"below\"\nslip = \"no-slip\"\n[end]",
        "whole number of spacings",
    ),
];

/// Every file and folder below a folder, with its contents.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(place) = open.pop() {
        for path in fs::read_dir(&place).unwrap().map(|entry| entry.unwrap().path()) {
            let link = fs::symlink_metadata(&path).unwrap().is_symlink();
            if path.is_dir() && !link {
                open.push(path.clone());
                found.insert(path, None);
            } else {
                let bytes = if link { Vec::new() } else { fs::read(&path).unwrap() };
                found.insert(path, Some(bytes));
            }
        }
    }
    found
}

/// Runs a command that should fail in a folder.
fn within(folder: &Path, command: &mut Command) -> Output {
    run_within(PATIENCE, ends_by_itself(command.current_dir(folder)))
}

/// Runs a program on wrong input and checks everything but the place.
#[track_caller]
fn refused(work: &WorkFolder, program: &str, arguments: &[OsString], ranks: usize, code: i32) -> String {
    let before = contents(work.path());
    let output: Output = within(work.path(), &mut command(program, arguments, ranks));
    let said = format!("{program} {arguments:?} on {ranks} ranks: {output}");
    assert!(!output.timed_out, "hangs: {said}");
    assert_eq!(output.code, code, "{said}");
    assert_eq!(output.stdout, "", "a failure has no result: {said}");
    assert!(!output.stderr.contains("panicked"), "{said}");
    let after = contents(work.path());
    let names = |c: &BTreeMap<PathBuf, _>| c.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&before), names(&after), "{said}");
    assert!(before == after, "a file has changed: {said}");
    // mpirun adds a paragraph of its own between rules.
    output.stderr.split("--------------------").next().unwrap_or_default().to_owned()
}

/// The messages of a failure: lines that start with the program's name and "error:", as clap's do with "error:" alone,
/// or with a place in a scene.
fn messages<'a>(program: &str, said: &'a str) -> Vec<&'a str> {
    let own = format!("{program}: error: ");
    let is_place = |line: &str| {
        let mut parts = line.split(": ").next().unwrap_or_default().rsplit(':');
        let number = |part: Option<&str>| part.is_some_and(|part| part.parse::<usize>().is_ok());
        number(parts.next()) && number(parts.next())
    };
    said.lines().filter(|l| l.starts_with(&own) || l.starts_with("error: ") || is_place(l)).collect()
}

/// As [`refused`], on every number of ranks. There must be one message, or one a fault of a scene, said by one rank
/// only; one of them must name `place` and say `word`, or say it in the lines that follow it.
#[track_caller]
fn refused_at(work: &WorkFolder, program: &str, arguments: &[&str], code: i32, place: &str, word: &str) {
    let arguments: Vec<OsString> = arguments.iter().map(OsString::from).collect();
    for ranks in RANKS {
        let said = refused(work, program, &arguments, ranks, code);
        told_once(program, &said, place, word);
    }
}

#[track_caller]
fn told_once(program: &str, said: &str, place: &str, word: &str) {
    assert!(said.contains(place) && said.contains(word), "{program}: no {place} or {word} in: {said}");
    let found = messages(program, said);
    let own = found.iter().filter(|line| line.contains("error: ")).count();
    // A program may put its name before the first fault of a scene.
    let faults = found.iter().filter(|line| line.contains(".toml:")).count();
    assert!(own == 1 || (own == 0 && faults > 0), "{} messages: {said}", found.len());
    assert!(own == 0 || found.len() == own.max(faults), "more than one message: {said}");
    for line in found {
        let tail = line.rsplit("error: ").next().unwrap_or(line);
        assert_eq!(said.matches(tail).count(), 1, "said more than once: {said}");
    }
}

fn sound(work: &WorkFolder) {
    work.write("scene.toml", SOUND);
}

#[test]
fn a_sound_scene_is_taken() {
    let work = WorkFolder::new();
    prepared(&work, "run", SOUND, 1);
}

#[test]
fn scenes_with_a_fault() {
    for (old, new, word) in SCENES {
        let work = WorkFolder::new();
        assert_eq!(SOUND.matches(old).count(), 1, "{old} stands once in the sound scene");
        let scene = SOUND.replace(old, new);
        work.write("scene.toml", &scene);
        let first = SOUND[..SOUND.find(old).unwrap()].lines().count().max(1);
        for ranks in RANKS {
            let arguments = ["scene.toml", "-o", "run"].map(OsString::from);
            let said = refused(&work, "sph-prep", &arguments, ranks, exit::USAGE);
            assert!(said.contains(word), "no {word} after {new}: {said}");
            // A fault may be found at the section it lies in, or at the first line that makes no sense.
            let lines = first.saturating_sub(6)..=first + new.lines().count() + 1;
            let place = said.split("scene.toml:").nth(1).and_then(|rest| rest.split(':').next()?.parse::<usize>().ok());
            assert!(place.is_some_and(|line| lines.contains(&line)), "not on lines {lines:?}: {new}: {said}");
            for line in said.lines() {
                assert_eq!(said.matches(line).count(), 1, "said more than once: {said}");
            }
        }
    }
}

#[test]
fn several_faults_are_told_at_once() {
    let work = WorkFolder::new();
    let scene = SOUND.replace("10 mm", "10 mmm").replace("30 deg", "300 deg").replace("no-slip", "noslip");
    work.write("scene.toml", &scene);
    for place in ["scene.toml:3:11: spacing: ", "scene.toml:8:12: material.", "scene.toml:16:8: wall.floor.slip: "] {
        refused_at(&work, "sph-prep", &["scene.toml", "-o", "run"], exit::USAGE, place, "");
    }
}

#[test]
fn scenes_that_are_empty_or_lack_a_section() {
    for missing in ["material", "body", "end", ""] {
        let work = WorkFolder::new();
        let kept = SOUND.split("\n[").filter(|section| !missing.is_empty() && !section.starts_with(missing));
        let scene = kept.collect::<Vec<_>>().join("\n[");
        work.write("scene.toml", &scene);
        refused_at(
            &work,
            "sph-prep",
            &["scene.toml", "-o", "run"],
            exit::USAGE,
            "scene.toml:1:1: ",
            match missing {
                "" => "space: ",
                name => name,
            },
        );
    }
}

#[test]
fn scenes_that_are_no_text() {
    let work = WorkFolder::new();
    fs::write(work.join("latin1.toml"), b"title = \"B\xf6schung\"\n").unwrap();
    fs::write(work.join("hdf.toml"), b"\x89HDF\r\n\x1a\n\0\0\0\0\xff\xff\xff\xff").unwrap();
    fs::create_dir(work.join("folder.toml")).unwrap();
    for name in ["latin1.toml", "hdf.toml", "folder.toml", "missing.toml", "latin1.toml/scene.toml"] {
        refused_at(&work, "sph-prep", &[name, "-o", "run"], exit::NO_INPUT, name, "cannot read the scene");
    }
}

#[test]
fn command_lines_with_a_fault() {
    let work = WorkFolder::new();
    sound(&work);
    let prep: &[&[&str]] = &[
        &[],
        &["scene.toml"],
        &["-o", "run"],
        &["scene.toml", "-o"],
        &["scene.toml", "-o", ""],
        &["scene.toml", "-o", "run", "--fast"],
        &["scene.toml", "other.toml", "-o", "run"],
    ];
    for arguments in prep {
        refused_at(&work, "sph-prep", arguments, exit::USAGE, "error: ", "");
    }
    refused_at(&work, "sph-prep", &["scene.toml"], exit::USAGE, "  --output <RUN>", "");
}

#[test]
fn run_folders_that_are_in_the_way() {
    let work = WorkFolder::new();
    sound(&work);
    work.write("file", "mine");
    fs::create_dir_all(work.join("full/deep")).unwrap();
    fs::write(work.join("full/deep/scene.lock.toml"), "mine").unwrap();
    std::os::unix::fs::symlink("nowhere", work.join("link")).unwrap();
    let cases = [
        ("file", "is a file"),
        ("full", "not empty"),
        ("link", "link to nowhere"),
        ("file/run", "cannot write"),
        // Not even root can make a folder there.
        ("/proc/run", "cannot write"),
        ("/proc/a/run", "cannot write"),
        (".", "not empty"),
    ];
    for (target, word) in cases {
        let place = target.split("/run").next().unwrap_or(target);
        refused_at(&work, "sph-prep", &["scene.toml", "-o", target], exit::CANNOT_WRITE, place, word);
    }
}

#[test]
fn command_lines_of_the_run_with_a_fault() {
    let work = WorkFolder::new();
    prepared(&work, "run", SOUND, 1);
    let cases: &[&[&str]] = &[
        &[],
        &["run", "--fast"],
        &["run", "--stop-after-steps", "-3"],
        &["run", "--stop-after-steps", "many"],
        &["run", "--instructions", "avx"],
        &["run", "--checkpoint-every", "0s"],
        &["run", "--checkpoint-every", "5 parsecs"],
        &["run", "--ranks", "4"],
        &["run", "--plan", "--ranks", "0"],
        &["run", "--plan", "--ranks", "4,many"],
        &["run", "--plan", "--cost", "-1"],
        &["run", "--plan", "--bandwidth", "0"],
        &["run", "--plan", "--overlap", "1.5"],
        &["run", "--plan", "--new"],
        &["run", "--plan", "--state", "deposit"],
        &["run", "--plan", "--ranks", "65536"],
    ];
    for arguments in cases {
        refused_at(&work, "sph-run", arguments, exit::USAGE, "error: ", "");
    }
}

#[test]
fn run_folders_that_cannot_be_run() {
    let work = WorkFolder::new();
    work.write("file", "mine");
    fs::create_dir(work.join("empty")).unwrap();
    for folder in ["missing", "empty", "file"] {
        refused_at(&work, "sph-run", &[folder], exit::NO_INPUT, folder, "scene.lock.toml");
    }
}

#[test]
fn scenes_too_large_for_the_memory() {
    let huge = [
        (SOUND.replace("10 mm", "1 um"), "about 10000000000 particles"),
        // Too many even to be counted.
        (
            SOUND.replace("10 mm", "0.02 mm").replace("plane-strain", "3d").replace("[0, 0, 0]", "[0, -0.1, 0]"),
            "about 125000000000 particles",
        ),
    ];
    for (scene, count) in huge {
        let work = WorkFolder::new();
        work.write("scene.toml", &scene);
        let arguments = ["scene.toml", "-o", "runs/huge"];
        refused_at(&work, "sph-prep", &arguments, exit::USAGE, count, "m would fit");
        let said = refused(&work, "sph-prep", &arguments.map(OsString::from), 0, exit::USAGE);
        let cost = said.find("memory  ").expect("the cost is told");
        assert!(cost < said.find("error: ").unwrap(), "before it is refused: {said}");
    }
}

#[test]
fn results_that_cannot_be_written() {
    // Not even root writes into a file as if it were a folder.
    let in_the_way = |folder: PathBuf| move |_: &RunFolder| fs::write(&folder, "mine").unwrap();
    damaged_in("sph-run", "out", |f| in_the_way(f.out())(f), exit::CANNOT_WRITE, "out");
    damaged_in("sph-post", "post", |f| in_the_way(f.post())(f), exit::CANNOT_WRITE, "post");
}

/// The lock is taken before the particles are looked at, so its file may stay: it is left out of the comparison.
#[track_caller]
fn damaged(name: &str, damage: impl Fn(&RunFolder), code: i32, word: &str) {
    damaged_in("sph-run", name, damage, code, word);
}

/// As [`damaged`], for any program.
#[track_caller]
fn damaged_in(program: &str, name: &str, damage: impl Fn(&RunFolder), code: i32, word: &str) {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", SOUND, 1);
    damage(&folder);
    for ranks in RANKS {
        let before = contents(folder.path());
        let output = within(work.path(), &mut command(program, &["run"], ranks));
        let said = format!("{program}, {name} on {ranks} ranks: {output}");
        assert!(!output.timed_out, "hangs: {said}");
        assert_eq!(output.code, code, "{said}");
        assert!(!output.stderr.contains("panicked"), "{said}");
        told_once(program, output.stderr.split("--------------------").next().unwrap_or_default(), "", word);
        let after = contents(folder.path());
        for (path, bytes) in &before {
            assert!(after.get(path) == Some(bytes) || *path == folder.lock(), "{} has changed: {said}", path.display());
        }
        assert!(!folder.done().exists(), "{said}");
    }
}

#[test]
fn particles_that_cannot_be_read() {
    let initial = "initial.hdf";
    damaged("missing", |f| fs::remove_file(f.initial()).unwrap(), exit::NO_INPUT, initial);
    damaged("empty", |f| fs::write(f.initial(), "").unwrap(), exit::NO_INPUT, initial);
    damaged("text", |f| fs::write(f.initial(), "particles").unwrap(), exit::NO_INPUT, initial);
    let cut = |f: &RunFolder| {
        let bytes = fs::read(f.initial()).unwrap();
        fs::write(f.initial(), &bytes[..bytes.len() / 2]).unwrap();
    };
    damaged("cut off", cut, exit::NO_INPUT, initial);
    // Of the version before: it lacks fields, but is not called damaged.
    let age = |f: &RunFolder| {
        let file = hdf5::File::open_rw(f.initial()).unwrap();
        file.group("sph").unwrap().attr("format_version").unwrap().write_scalar(&1u64).unwrap();
        file.unlink("particles/stress_work").unwrap();
        file.close().unwrap();
    };
    for program in ["sph-run", "sph-post"] {
        damaged_in(
            program,
            "older",
            age,
            exit::NO_INPUT,
            "format version 1, this program reads 2; prepare the scene anew",
        );
    }
}

#[test]
fn scenes_changed_after_preparation() {
    let edit = |from: &'static str, to: &'static str| {
        move |f: &RunFolder| fs::write(f.scene(), SOUND.replace(from, to)).unwrap()
    };
    damaged("another scene", edit("30 deg", "31 deg"), exit::NO_INPUT, "scene");
    for program in ["sph-run", "sph-post"] {
        let bad = edit("30 deg", "31 degrees");
        damaged_in(program, "a bad scene", bad, exit::USAGE, "scene.lock.toml:8:");
        damaged_in(program, "no TOML", edit("poisson = 0.3", "poisson = 0,3"), exit::USAGE, "scene.lock.toml:");
        damaged_in(program, "no scene", |f| fs::remove_file(f.scene()).unwrap(), exit::NO_INPUT, "scene.lock.toml");
    }
}

#[test]
fn runs_that_another_process_holds_or_has_begun() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", SOUND, 1);
    let held = RunLock::acquire(&folder.lock()).unwrap();
    refused_at(&work, "sph-run", &["run"], exit::LOCKED, "run", "LOCK");
    drop(held);
    run_within(PATIENCE, command("sph-run", &["run", "--stop-after-steps", "3"], 1).current_dir(work.path()))
        .expect(exit::RESUMABLE);
    let arguments = ["run", "--new"].map(OsString::from);
    for ranks in RANKS {
        let said = refused(&work, "sph-run", &arguments, ranks, exit::USAGE);
        told_once("sph-run", &said, "run", "begun");
    }
}

#[test]
fn runs_that_cannot_be_evaluated() {
    let work = WorkFolder::new();
    let folder = prepared(&work, "run", SOUND, 1);
    work.write("file", "mine");
    for arguments in [&[][..], &["run", "--fast"], &["run", "--basal-height", "3 kg"]] {
        refused_at(&work, "sph-post", arguments, exit::USAGE, "error: ", "");
    }
    let refuse = |name: &str, word: &str| refused_at(&work, "sph-post", &[name], exit::NO_INPUT, name, word);
    refuse("missing", "missing");
    refuse("file", "file");
    run("sph-run", &[folder.path().as_os_str(), "--stop-after-steps".as_ref(), "0".as_ref()], 0)
        .expect(exit::RESUMABLE);
    let bytes = fs::read(folder.snapshot(0)).unwrap();
    fs::write(folder.snapshot(0), &bytes[..bytes.len() / 2]).unwrap();
    refuse("run", "snapshot-000000");
}
