//! Our files in other people's readers: VTK, PyVista, h5dump, ncdump, xarray and the checker of the CF conventions.

use formats::exit;
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{WorkFolder, python, whole_run};

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

fn scene(space: &str) -> String {
    COLUMN.replace("SPACE", space)
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
    for space in ["axisymmetric", "3d"] {
        let folder = whole_run(&work, space, &scene(space), 2);
        python::script(&interpreter, "snapshot.py", &[&last_snapshot(&folder), &folder.series()]).expect(exit::DONE);
        python::script(&interpreter, "snapshot.py", &[&folder.initial(), &folder.series()]).expect(exit::DONE);
    }
}

#[test]
fn results_open_in_xarray_and_pass_the_cf_checker() {
    let Some(interpreter) = python::interpreter() else { return };
    let work = WorkFolder::new();
    for space in ["axisymmetric", "3d"] {
        let folder = whole_run(&work, space, &scene(space), 2);
        let results = folder.post().join("results.nc");
        python::script(&interpreter, "results.py", &[&results]).expect(exit::DONE);
        let mut checker = Command::new(interpreter.with_file_name("compliance-checker"));
        checker.args(["--test=cf:1.11", "--criteria=strict"]).arg(&results);
        tests::run_within(tests::TIME_LIMIT, &mut checker).expect(exit::DONE);
    }
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
