//! Our files in other people's readers: VTK, PyVista, h5dump, ncdump, xarray, the checker of the CF conventions, a browser.

use formats::exit;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{WorkFolder, prepared, python, run, whole_run};

const COLUMN: &str = r#"
title = "Column for readers"
space = "SPACE"
spacing = "2 cm"

[material.drucker-prager]
density = "2600 kg/m3"
young = "0.6 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"

[body.column]
cylinder = { radius = "0.1 m", height = "0.1 m" }

[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"

[end]
time = "0.04 s"

[output]
snapshots = "10 ms"
history = "2 ms"
"#;

const SPACES: [&str; 3] = ["axisymmetric", "plane-strain", "3d"];

fn scene(space: &str) -> String {
    let cylinder = r#"cylinder = { radius = "0.1 m", height = "0.1 m" }"#;
    let rectangle = r#"box = { min = [0, 0, 0], max = ["0.1 m", 0, "0.1 m"] }"#;
    let text = COLUMN.replace("SPACE", space);
    if space == "plane-strain" { text.replace(cylinder, rectangle) } else { text }
}

/// The last snapshot of a run.
fn last_snapshot(folder: &formats::folder::RunFolder) -> PathBuf {
    let (name, _) = tests::digests(folder).pop().expect("a run leaves snapshots");
    folder.out().join(name)
}

/// What a tool says about the header of a file; the tool must be there.
fn dump(tool: &str, package: &str, header_only: &str, file: &Path) -> String {
    tests::expect_program(tool, package);
    tests::run_within(tests::TIME_LIMIT, Command::new(tool).arg(header_only).arg(file)).expect(exit::DONE).stdout
}

#[test]
fn snapshots_open_in_vtk_and_pyvista() {
    let Some(interpreter) = python::interpreter() else { return };
    let work = WorkFolder::new();
    for space in SPACES {
        let folder = whole_run(&work, space, &scene(space), 2);
        let state = folder.generation(1).join("state.hdf");
        for path in [&last_snapshot(&folder), &folder.initial(), &state] {
            python::script(&interpreter, "snapshot.py", &[path, &folder.series()]).expect(exit::DONE);
        }
    }
    // What is left of a run that failed at once, since its body falls too fast.
    let falls = scene("axisymmetric").replace("\n\n[wall.floor]", "\nvelocity = [0, 0, \"-2000 m/s\"]\n\n[wall.floor]");
    let folder = prepared(&work, "falls", &falls, 1);
    run("sph-run", &[folder.path()], 1).expect(exit::NUMERICAL);
    python::repository_script(&interpreter, "tests/vtk/open.py", &[&folder.out().join("fault.hdf")]).expect(exit::DONE);
}

#[test]
fn results_open_in_xarray_and_pass_the_cf_checker() {
    let Some(interpreter) = python::interpreter() else { return };
    let work = WorkFolder::new();
    for space in SPACES {
        let folder = prepared(&work, space, &scene(space), 1);
        run("sph-run", &[folder.path()], 1).expect(exit::DONE);
        let asked: [&OsStr; 3] = [folder.path().as_os_str(), "--grain-diameter".as_ref(), "1 mm".as_ref()];
        run("sph-post", &asked, 0).expect(exit::DONE);
        let [results, history] = ["results.nc", "history.nc"].map(|name| folder.post().join(name));
        python::script(&interpreter, "results.py", &[&results]).expect(exit::DONE);
        let mut checker = Command::new(interpreter.with_file_name("compliance-checker"));
        checker.args(["--test=cf:1.11", "--criteria=strict"]).args([&results, &history]);
        tests::run_within(tests::TIME_LIMIT, &mut checker).expect(exit::DONE);
    }
}

#[test]
fn an_ensemble_of_restarted_runs_has_the_numbers_of_sph_post() {
    let Some(interpreter) = python::interpreter() else { return };
    let work = WorkFolder::new();
    let longer = scene("axisymmetric").replace("2 cm", "1 cm").replace("0.04 s", "0.2 s");
    let folders = ["25 deg", "35 deg"].map(|friction| {
        let name = &friction[..2];
        let folder = prepared(&work, name, &longer.replace("30 deg", friction), 1);
        // Stopped once, on the way, and gone on with on two ranks.
        let stop: [&OsStr; 3] = [folder.path().as_os_str(), "--stop-after-steps".as_ref(), "150".as_ref()];
        run("sph-run", &stop, 1).expect(exit::RESUMABLE);
        run("sph-run", &[folder.path()], 2).expect(exit::DONE);
        run("sph-post", &[folder.path()], 0).expect(exit::DONE);
        folder
    });
    let [weak, strong] = [folders[0].path(), folders[1].path()];
    let said = python::script(&interpreter, "ensemble.py", &[weak, strong]).expect(exit::DONE).stdout;
    assert!(said.contains("over 2 members"), "{said}");
    // The figure of the guide, from the same runs.
    let figure = work.join("figure.pdf");
    let words = [weak, strong, Path::new("-o"), &figure];
    python::repository_script(&interpreter, "docs/guide/figure.py", &words).expect(exit::DONE);
    assert!(std::fs::read(&figure).unwrap().starts_with(b"%PDF-"));
}

/// Browsers that work without a display, by the names of their programs.
const BROWSERS: [&str; 5] =
    ["chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

#[test]
fn the_report_opens_in_a_browser_without_network() {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).flat_map(|folder| BROWSERS.map(|name| folder.join(name)));
    let Some(browser) = found.into_iter().find(|path| path.is_file()) else {
        tests::left_out(
            "no browser on the path (Debian: chromium-headless-shell), so the report was not looked at in one",
        );
        return;
    };
    let work = WorkFolder::new();
    let folder = whole_run(&work, "run", &scene("axisymmetric"), 1);
    let report = folder.post().join("report.html");
    let words = [browser.as_path(), &report, &work.join("screen.png")];
    let said = python::repository_script(Path::new("python3"), "tests/it/report.py", &words).expect(exit::DONE).stdout;
    assert!(said.contains("figures"), "{said}");
}

#[test]
fn the_command_line_tools_of_hdf5_and_netcdf_read_them() {
    let work = WorkFolder::new();
    let folder = whole_run(&work, "run", &scene("axisymmetric"), 1);
    let text = dump("h5dump", "hdf5-tools", "-H", &last_snapshot(&folder));
    assert!(text.contains("VTKHDF") && text.contains("particles"), "{text}");
    let text = dump("ncdump", "netcdf-bin", "-h", &folder.post().join("results.nc"));
    assert!(text.contains("t:units = \"s\"") && text.contains(":Conventions = \"CF-1.11\""), "{text}");
}
