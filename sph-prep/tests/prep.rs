//! The binary as users run it: alone, and on 1, 2, 3 and 5 ranks.

use formats::{
    folder::RunFolder,
    provenance,
    scene::Scene,
    snapshot::{self, Header, Rows},
};
use std::{
    f64::consts::PI,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// No call here takes more than a few seconds; a longer one hangs.
const PATIENCE: Duration = Duration::from_secs(60);

const COMMON: &str = r#"
[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "0.1 s"
"#;

const QUARTER: &str = r#"
space = "3d"
spacing = "4 mm"
symmetry = ["x", "y"]
[body.column]
cylinder = { radius = "0.1 m", height = "0.1 m" }
[initial]
stress = "k0"
k0 = 0.5
jitter = 0.1
"#;

const RINGS: &str = r#"
space = "axisymmetric"
spacing = "4 mm"
[body.column]
cylinder = { radius = "0.1 m", height = "0.1 m" }
[initial]
stress = "k0"
k0 = 0.43
"#;

const PLANE: &str = r#"
space = "plane-strain"
spacing = "5 mm"
[body.left]
box = { min = [0, 0, 0], max = ["0.1 m", 0, "0.05 m"] }
velocity = ["1 m/s", 0, 0]
[body.right]
wedge = { corner = ["0.2 m", 0, 0], size = ["0.2 m", 0, "0.1 m"], falls = "right" }
"#;

const PACKED: &str = r#"
space = "3d"
spacing = "8 mm"
symmetry = ["x"]
[body.column]
cylinder = { radius = "0.1 m", height = "0.1 m" }
[body.cube]
box = { min = ["0.2 m", 0, 0], max = ["0.25 m", "0.1 m", "0.1 m"] }
[initial]
lattice = "hexagonal"
jitter = 0.1
relax = 3
"#;

/// A folder of its own for a test.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn scene(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, format!("{text}{COMMON}")).unwrap();
        path
    }

    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// Runs the binary: alone for `ranks` = 0, else under mpirun.
fn prep(ranks: usize, arguments: &[&str]) -> Output {
    let binary = env!("CARGO_BIN_EXE_sph-prep");
    let mut command = if ranks == 0 {
        Command::new(binary)
    } else {
        let mut mpirun = Command::new("mpirun");
        mpirun.args(["-n", &ranks.to_string(), binary]);
        mpirun
    };
    // mpirun waits two seconds for ranks that have failed, although they have ended by themselves.
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "0");
    // Two jobs bound to the same cores would wait for each other.
    command.env("OMPI_MCA_hwloc_base_binding_policy", "none");
    let mut child =
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("{arguments:?} on {ranks} ranks hangs");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().unwrap()
}

fn stderr(output: &Output) -> String {
    // mpirun says on its own that a rank has left with a code.
    let lines = String::from_utf8_lossy(&output.stderr).into_owned();
    lines.split("--------------------").next().unwrap().to_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Prepares a scene alone and reads what came out.
fn made(scene: &str) -> (Scene, Header, Rows) {
    let place = Place::new();
    let (file, run) = (place.scene("scene.toml", scene), place.path("run"));
    let output = prep(0, &[text(&file), "-o", text(&run), "--quiet"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let checked = Scene::read("scene", &fs::read_to_string(&file).unwrap()).unwrap();
    let (header, rows) = snapshot::read(&RunFolder::new(run).initial()).unwrap();
    assert_eq!(header.count as usize, rows.len());
    assert!(rows.id.iter().enumerate().all(|(n, &id)| n as u64 == id));
    (checked, header, rows)
}

#[test]
fn the_particles_do_not_depend_on_the_number_of_ranks() {
    let place = Place::new();
    for (name, scene) in [("quarter", QUARTER), ("rings", RINGS), ("plane", PLANE), ("packed", PACKED)] {
        let file = place.scene(name, scene);
        let mut digests = Vec::new();
        for ranks in [0, 1, 2, 3, 5] {
            let run = place.path(&format!("{name}-{ranks}"));
            let output = prep(ranks, &[text(&file), "-o", text(&run)]);
            assert!(output.status.success(), "{}", stderr(&output));
            assert_eq!(String::from_utf8(output.stdout.clone()).unwrap().trim(), text(&run), "the result's path, once");
            let folder = RunFolder::new(&run);
            assert_eq!(fs::read(folder.scene()).unwrap(), fs::read(&file).unwrap());
            let origin = provenance::read(&folder.provenance()).unwrap();
            assert_eq!((origin.len(), origin[0].program.as_str()), (1, "sph-prep"));
            assert_eq!(origin[0].ranks, ranks.max(1));
            digests.push(snapshot::digest(&folder.initial()).unwrap());
            assert_eq!(fs::read_dir(&run).unwrap().count(), 3);
        }
        assert!(digests.iter().all(|d| *d == digests[0]), "{name}: {digests:?}");
    }
    assert!(place.names().iter().all(|n| !n.contains("tmp")), "{:?}", place.names());
}

#[test]
fn more_ranks_than_columns_or_particles() {
    let place = Place::new();
    let tiny = "space = \"plane-strain\"\nspacing = 0.1\n[body.b]\nbox = { min = [0, 0, 0], max = [0.1, 0, 0.2] }\n";
    let file = place.scene("tiny", tiny);
    for ranks in [1, 5] {
        let run = place.path(&format!("run-{ranks}"));
        let output = prep(ranks, &[text(&file), "-o", text(&run)]);
        assert!(output.status.success(), "{}", stderr(&output));
    }
    let digest = |run| snapshot::digest(&RunFolder::new(place.path(run)).initial()).unwrap();
    assert_eq!(digest("run-1"), digest("run-5"));
}

#[test]
fn rings_have_their_mass_and_their_stress() {
    let (scene, header, rows) = made(RINGS);
    assert_eq!(rows.len(), 25 * 25);
    assert_eq!((header.time, header.step, header.spacing), (0.0, 0, 0.004));
    let mass: f64 = rows.mass.iter().sum();
    assert!((mass / (2600.0 * PI * 0.01 * 0.1) - 1.0).abs() < 1e-12, "a lattice of rings has the whole volume");
    assert!((rows.position[0][0] - 0.002).abs() < 1e-15 && (rows.position[0][2] - 0.002).abs() < 1e-15);
    assert!((rows.mass[0] / (2.0 * PI * 0.002 * 2600.0 * 1.6e-5) - 1.0).abs() < 1e-12);
    for (x, s) in rows.position.iter().zip(&rows.stress) {
        let vertical = -2600.0 * 9.81 * (0.1 - x[2]);
        assert!((s[2] - vertical).abs() < 1e-9 * vertical.abs());
        assert!((s[0] - 0.43 * vertical).abs() < 1e-9 * vertical.abs());
        assert_eq!(s[1], s[0], "the hoop stress is a horizontal one");
        assert_eq!(s[3..], [0.0; 3]);
    }
    assert!((scene.h() - header.h).abs() < 1e-18);
}

#[test]
fn a_quarter_of_a_cylinder_is_a_quarter() {
    let (_, _, rows) = made(QUARTER);
    let disc = (0..25u64).flat_map(|i| (0..25u64).map(move |j| (2 * i + 1).pow(2) + (2 * j + 1).pow(2)));
    let count = disc.filter(|&d| d < 50 * 50).count() * 25;
    assert_eq!(rows.len(), count);
    let mass: f64 = rows.mass.iter().sum();
    assert!((mass / (2600.0 * 6.4e-8 * count as f64) - 1.0).abs() < 1e-12);
    assert!((mass / (2600.0 * PI * 0.01 * 0.1 / 4.0) - 1.0).abs() < 0.01);
    assert!(rows.position.iter().all(|x| x[0] > 0.0 && x[1] > 0.0 && x[2] > 0.0));
    for (x, s) in rows.position.iter().zip(&rows.stress) {
        let vertical = -2600.0 * 9.81 * (0.1 - x[2]);
        assert!((s[2] - vertical).abs() < 1e-9 * vertical.abs() && (s[0] - 0.5 * s[2]).abs() < 1e-9 * vertical.abs());
    }
    // Disorder moves particles by up to a tenth of the spacing off the lattice points (i + 1/2) dx.
    let off = |x: f64| (x / 0.004 - 0.5) - (x / 0.004 - 0.5).round();
    assert!(rows.position.iter().flatten().all(|x| off(*x).abs() < 0.1 + 1e-9));
    assert!(rows.position.iter().flatten().any(|x| off(*x).abs() > 0.09));
}

#[test]
fn a_box_and_a_wedge_follow_each_other() {
    let (scene, _, rows) = made(PLANE);
    let of = |body: u64| rows.body.iter().filter(|b| **b == body).count();
    assert_eq!(of(0), 20 * 10);
    assert!(rows.body.is_sorted());
    assert_eq!(rows.velocity[0], [1.0, 0.0, 0.0]);
    assert_eq!(rows.velocity[rows.len() - 1], [0.0; 3]);
    let area = of(1) as f64 * 2.5e-5;
    assert!((area / 0.01 - 1.0).abs() < 0.03, "{area}");
    for (x, _) in rows.position.iter().zip(&rows.body).filter(|(_, b)| **b == 1) {
        assert!(x[0] > 0.2 && x[2] < 0.1 * (1.0 - (x[0] - 0.2) / 0.2), "{x:?} lies under the slope");
    }
    assert!(rows.mass.iter().all(|m| (m / (2600.0 * 2.5e-5) - 1.0).abs() < 1e-12));
    assert!(rows.density.iter().all(|d| *d == scene.material.density()));
    assert!(rows.stress.iter().flatten().all(|s| *s == 0.0));
}

#[test]
fn the_summary_is_printed_once_and_can_be_silenced() {
    let place = Place::new();
    let file = place.scene("scene.toml", RINGS);
    let loud = prep(3, &[text(&file), "-o", text(&place.path("loud"))]);
    let printed = stderr(&loud);
    for what in ["625 particles", "axisymmetric", "time step", "snapshots", "memory", "walls"] {
        assert_eq!(printed.matches(what).count(), 1, "{what} in {printed}");
    }
    let alone = stderr(&prep(0, &[text(&file), "-o", text(&place.path("alone"))]));
    let walls = |s: &str| s.lines().find(|l| l.starts_with("walls")).unwrap().to_owned();
    assert_eq!(walls(&printed), walls(&alone));
    assert_eq!(stderr(&prep(2, &[text(&file), "-o", text(&place.path("quiet")), "--quiet"])), "");
}

#[test]
fn warnings_are_printed_even_when_quiet() {
    let place = Place::new();
    let doubtful = RINGS.replace("0.43", "0.2") + "[kernel]\nh-over-dx = 1.5\n[numerics]\nviscosity = 0\n";
    let file = place.scene("scene.toml", &doubtful);
    for ranks in [0, 3] {
        let output = prep(ranks, &[text(&file), "-o", text(&place.path(&format!("run-{ranks}"))), "--quiet"]);
        let printed = stderr(&output);
        assert!(output.status.success(), "{printed}");
        for what in ["h-over-dx = 1.5", "k0 = 0.2", "viscosity = 0"] {
            assert_eq!(printed.matches(what).count(), 1, "{what} in {printed}");
        }
        assert_eq!(printed.lines().count(), 3);
    }
}

#[test]
fn a_closed_pipe_does_no_harm() {
    let place = Place::new();
    let file = place.scene("scene.toml", RINGS);
    let bad = place.scene("bad.toml", &RINGS.replace("4 mm", "4 mmm"));
    for (scene, code) in [(&file, 0), (&bad, 2)] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let run = place.path(&format!("run-{code}"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_sph-prep"));
        command.args([text(scene), "-o", text(&run)]).stdin(Stdio::null());
        let status = command.stdout(writer.try_clone().unwrap()).stderr(writer).status().unwrap();
        assert_eq!(status.code(), Some(code));
        assert_eq!(RunFolder::new(&run).initial().exists(), code == 0);
    }
}

#[test]
fn a_folder_in_use_is_left_as_it_is() {
    let place = Place::new();
    let file = place.scene("scene.toml", RINGS);
    fs::create_dir(place.path("full")).unwrap();
    fs::write(place.path("full/scene.lock.toml"), "mine").unwrap();
    fs::write(place.path("file"), "mine").unwrap();
    fs::create_dir(place.path("empty")).unwrap();
    for ranks in [0, 3] {
        for target in ["full", "file"] {
            let output = prep(ranks, &[text(&file), "-o", text(&place.path(target))]);
            assert_eq!(output.status.code(), Some(73), "{}", stderr(&output));
            assert!(stderr(&output).contains(target));
            assert!(output.stdout.is_empty());
        }
    }
    assert_eq!(fs::read_to_string(place.path("full/scene.lock.toml")).unwrap(), "mine");
    assert_eq!(fs::read_dir(place.path("full")).unwrap().count(), 1);
    assert_eq!(fs::read_to_string(place.path("file")).unwrap(), "mine");
    let output = prep(2, &[text(&file), "-o", text(&place.path("empty"))]);
    assert!(output.status.success(), "an empty folder is taken: {}", stderr(&output));
    let again = prep(2, &[text(&file), "-o", text(&place.path("empty"))]);
    assert_eq!(again.status.code(), Some(73), "but not twice");
    assert_eq!(place.names(), ["empty", "file", "full", "scene.toml"]);
}

#[test]
fn a_bad_scene_ends_all_ranks_with_2_and_leaves_nothing() {
    let place = Place::new();
    let file = place.scene("scene.toml", &RINGS.replace("\"4 mm\"", "\"4 apples\"").replace("axisymmetric", "round"));
    for ranks in [0, 1, 3] {
        let output = prep(ranks, &[text(&file), "-o", text(&place.path("a/run"))]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        let printed = stderr(&output);
        assert_eq!(printed.matches("scene.toml:2:").count(), 1, "{printed}");
        assert_eq!(printed.matches("scene.toml:3:").count(), 1, "both faults at once: {printed}");
    }
    assert_eq!(place.names(), ["scene.toml"]);
}

#[test]
fn a_scene_that_is_no_text_ends_with_65() {
    let place = Place::new();
    fs::write(place.path("binary.toml"), [0x89, 0x48, 0x44, 0x46, 0xff, 0xfe]).unwrap();
    for ranks in [0, 3] {
        for name in ["missing.toml", "binary.toml", "."] {
            let output = prep(ranks, &[text(&place.path(name)), "-o", text(&place.path("run"))]);
            assert_eq!(output.status.code(), Some(65), "{}", stderr(&output));
            assert_eq!(stderr(&output).matches("cannot read the scene").count(), 1);
        }
    }
    assert_eq!(place.names(), ["binary.toml"]);
}

#[test]
fn a_wrong_command_line_is_told_once() {
    for ranks in [0, 3] {
        for arguments in [&["scene.toml"][..], &["scene.toml", "-o", "run", "--fast"], &[]] {
            let output = prep(ranks, arguments);
            assert_eq!(output.status.code(), Some(2));
            assert_eq!(stderr(&output).matches("Usage:").count(), 1, "{}", stderr(&output));
        }
        let help = prep(ranks, &["--help"]);
        assert!(help.status.success());
        assert_eq!(String::from_utf8_lossy(&help.stdout).matches("Exit codes").count(), 1);
    }
}
