//! `./talus bench`: that it works, on tiny scenes; what it measures there means nothing.

use formats::exit;
use std::path::Path;
use std::process::Command;
use tests::{TIME_LIMIT, WorkFolder, program, run_within, workflows};

/// `./talus bench`, with the programs of these tests.
fn bench(work: &Path, words: &[&str]) -> Command {
    command(&[&["bench"], words].concat(), work)
}

/// `./talus` and these words, with the programs of these tests.
fn command(words: &[&str], work: &Path) -> Command {
    let programs = program("sph-run").parent().unwrap().to_path_buf();
    let mut command = Command::new(workflows());
    command.args(words).arg("--programs").arg(programs).arg("--out").arg(work);
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

/// `./talus scaling`: real runs on 1 and 2 ranks, plans and migrations, all small.
#[test]
fn scaling_writes_a_page() {
    let work = WorkFolder::new();
    let mut scaling = command(&["scaling", "--quick"], work.path());
    let output = run_within(TIME_LIMIT, &mut scaling).expect(exit::DONE);
    assert!(output.stdout.trim().ends_with("scaling.md"), "{output}");
    let text = std::fs::read_to_string(work.join("scaling.md")).unwrap();
    let row =
        |start: &str| text.lines().find(|line| line.starts_with(start)).unwrap_or_else(|| panic!("{start}: {text}"));
    assert!(row("| 2 | 1728 |").contains("the same bits"), "{text}");
    assert!(row("| deposit |").contains("| hold |") && !text.contains("NaN"), "{text}");
    // Counted on 16 ranks, really gone on 2.
    assert!(row("| 16 | 1950 |").contains("| - |") && !row("| 2 | 1950 |").contains("| - |"), "{text}");
    for picture in ["scaling-weak.svg", "scaling-strong.svg"] {
        assert!(text.contains(picture) && std::fs::read_to_string(work.join(picture)).unwrap().starts_with("<svg"));
    }
    let words = ["--programs", "nowhere", "--ranks", "0"];
    let refused = run_within(TIME_LIMIT, Command::new(workflows()).arg("scaling").args(words)).expect(exit::USAGE);
    assert!(refused.stderr.contains("--ranks"), "{refused}");
}
