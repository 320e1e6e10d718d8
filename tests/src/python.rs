//! A Python of the tests' own, with other people's readers of our files in it.

use crate::{Output, repository, run_within, target};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Fetching wheels takes half a minute on a good line.
const SETUP_LIMIT: Duration = Duration::from_secs(280);

/// Path of the interpreter, set up in the target folder on the first call. None, with the reason on standard error,
/// where that cannot be done: no Python, no network. A set-up that is there but wrong fails.
pub fn interpreter() -> Option<PathBuf> {
    let requirements = repository().join("tests/it/requirements.txt");
    let text = std::fs::read_to_string(&requirements).expect("tests/it/requirements.txt");
    let (target, _) = target();
    let folder = target.join(format!("python-{}", &formats::provenance::sha256(text.as_bytes())[..12]));
    let (ready, python) = (folder.join("READY"), folder.join("bin/python"));
    if ready.is_file() {
        return Some(python);
    }
    // Tests run in processes of their own under nextest: one sets up, the others wait.
    let guard = File::create(folder.with_extension("lock")).expect("a lock file in the target folder");
    guard.lock().expect("a lock in the target folder");
    if ready.is_file() {
        return Some(python);
    }
    let steps: [(&str, Command); 2] = [
        ("python3 -m venv", {
            let mut command = Command::new("python3");
            command.args(["-m", "venv", "--clear"]).arg(&folder);
            command
        }),
        ("pip install", {
            let mut command = Command::new(folder.join("bin/pip"));
            command.args([
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "--retries",
                "1",
                "--timeout",
                "20",
                "-r",
            ]);
            command.arg(&requirements);
            command
        }),
    ];
    for (name, mut command) in steps {
        if !starts(&command) {
            return skipped(&format!("{name}: there is no such program"));
        }
        let output = run_within(SETUP_LIMIT, &mut command);
        if output.code != 0 {
            return skipped(&format!("{name} failed: {}", output.stderr.trim().lines().last().unwrap_or("no reason")));
        }
    }
    std::fs::write(&ready, "").expect("a file in the target folder");
    Some(python)
}

/// Runs a script of `tests/it` with the interpreter.
pub fn script(python: &Path, name: &str, arguments: &[&Path]) -> Output {
    let mut command = Command::new(python);
    command.arg(repository().join("tests/it").join(name)).args(arguments);
    // Rendering without a display; no byte code in the source folder.
    command.env("PYTHONDONTWRITEBYTECODE", "1").env("PYVISTA_OFF_SCREEN", "true");
    run_within(crate::TIME_LIMIT, &mut command)
}

fn starts(command: &Command) -> bool {
    let program = Path::new(command.get_program());
    let on_path =
        || std::env::var_os("PATH").is_some_and(|path| std::env::split_paths(&path).any(|f| f.join(program).is_file()));
    program.is_file() || on_path()
}

fn skipped(reason: &str) -> Option<PathBuf> {
    eprintln!("LEFT OUT: no Python environment for this test: {reason}");
    None
}
