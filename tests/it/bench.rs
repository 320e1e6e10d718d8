//! `./talus bench`: that it works, on tiny scenes; what it measures there means nothing.

use formats::exit;
use std::path::Path;
use std::process::Command;
use tests::{TIME_LIMIT, WorkFolder, program, run_within, workflows};

/// `./talus bench`, with the programs of these tests.
fn bench(work: &Path, words: &[&str]) -> Command {
    let programs = program("sph-run").parent().unwrap().to_path_buf();
    let mut command = Command::new(workflows());
    command.arg("bench").args(words).arg("--programs").arg(programs).arg("--out").arg(work);
    for name in ["OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"] {
        command.env(name, "1");
    }
    for (name, value) in [("OMPI_MCA_mpi_yield_when_idle", "1"), ("OMPI_MCA_hwloc_base_binding_policy", "none")] {
        command.env(name, value);
    }
    command.env_remove("TALUS_MPIRUN");
    command
}

#[test]
fn speed_writes_a_page() {
    let work = WorkFolder::new();
    let words = ["speed", "--quick", "--rows", "rz-mu", "--peak", "50"];
    let output = run_within(TIME_LIMIT, &mut bench(work.path(), &words)).expect(exit::DONE);
    let page = work.join("quick/speed.md");
    assert_eq!(output.stdout.trim(), page.display().to_string(), "{output}");
    let text = std::fs::read_to_string(&page).unwrap();
    let row = text.lines().find(|line| line.starts_with("| rz-mu-i-wendland | axisymmetric | mu-i |")).expect(&text);
    assert!(row.contains("| f64 | 625 | 10 |"), "{row}");
    assert!(
        text.contains("of peak (50.0 GFLOP/s)") && text.contains("| one rank | support | gradient | material |"),
        "{text}"
    );
    // The run in the middle of its collapse is kept: no other preparation.
    let again = run_within(TIME_LIMIT, &mut bench(work.path(), &words)).expect(exit::DONE);
    assert!(output.stderr.contains("goes to the middle") && !again.stderr.contains("goes to the middle"), "{again}");
}

#[test]
fn a_row_that_is_not_there_is_refused() {
    let work = WorkFolder::new();
    let output = run_within(TIME_LIMIT, &mut bench(work.path(), &["speed", "--rows", "rz,4d"])).expect(exit::USAGE);
    assert!(output.stderr.contains("`4d`") && output.stderr.contains("3d-wendland"), "{output}");
}

#[test]
fn instructions_name_the_tool_that_is_missing() {
    let work = WorkFolder::new();
    let mut command = bench(work.path(), &["instructions"]);
    let output = run_within(TIME_LIMIT, command.env("PATH", work.path())).expect(exit::NO_INPUT);
    assert!(output.stderr.contains("valgrind") && output.stderr.contains("apt-get install"), "{output}");
}
