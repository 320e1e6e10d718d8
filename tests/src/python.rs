//! A Python of the tests' own, with other people's readers of our files in it.

use crate::{Output, left_out, repository, run_within, target};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Fetching wheels takes half a minute on a good line.
const SETUP_LIMIT: Duration = Duration::from_secs(280);

/// What pip says where the package index cannot be reached, or has not what was asked for. Nothing else is a reason to
/// leave a test out.
const INDEX_FAULTS: [&str; 8] = [
    "No matching distribution found",
    "Could not find a version that satisfies",
    "NewConnectionError",
    "ConnectionError",
    "ConnectTimeoutError",
    "ReadTimeoutError",
    "ProxyError",
    "HTTP error",
];

/// Path of the interpreter, set up in the target folder on the first call. None, with the reason on standard error,
/// where the packages cannot be had from the network. All else fails the test: no Python, no venv, a broken set-up.
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
    let mut make = Command::new("python3");
    make.args(["-m", "venv", "--clear"]).arg(&folder);
    crate::expect_program("python3", "Python 3 (Debian: python3-venv)");
    let made = run_within(SETUP_LIMIT, &mut make);
    assert!(made.code == 0, "python3 -m venv fails (Debian: is python3-venv installed?): {made}");
    let mut install = Command::new(folder.join("bin/pip"));
    install.args(["install", "--quiet", "--disable-pip-version-check", "--retries", "1", "--timeout", "20", "-r"]);
    let installed = run_within(SETUP_LIMIT, install.arg(&requirements));
    if let Some(reason) = index_fault(&installed) {
        left_out(&format!("the Python packages of tests/it/requirements.txt cannot be had: {reason}"));
        return None;
    }
    assert!(installed.code == 0, "pip cannot install tests/it/requirements.txt: {installed}");
    std::fs::write(&ready, "").expect("a file in the target folder");
    Some(python)
}

/// The line that says so, if it was the network or the index that failed.
fn index_fault(output: &Output) -> Option<String> {
    if output.timed_out {
        return Some(format!("pip took longer than {} s", SETUP_LIMIT.as_secs()));
    }
    if output.code == 0 {
        return None;
    }
    let line = output.stderr.lines().rfind(|line| INDEX_FAULTS.iter().any(|fault| line.contains(fault)));
    line.map(|line| line.trim().to_owned())
}

/// Runs a script of `tests/it` with the interpreter.
pub fn script(python: &Path, name: &str, arguments: &[&Path]) -> Output {
    repository_script(python, &format!("tests/it/{name}"), arguments)
}

/// Runs any script of the repository with the interpreter.
pub fn repository_script(python: &Path, name: &str, arguments: &[&Path]) -> Output {
    let mut command = Command::new(python);
    command.arg(repository().join(name)).args(arguments);
    // Rendering without a display; no byte code in the source folder.
    command.env("PYTHONDONTWRITEBYTECODE", "1").env("PYVISTA_OFF_SCREEN", "true");
    run_within(crate::TIME_LIMIT, &mut command)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_network_and_the_index_excuse() {
        let output = |code, stderr: &str| Output { code, stdout: "".into(), stderr: stderr.into(), timed_out: false };
        let refused = "WARNING: Retrying after connection broken by 'NewConnectionError('...')': /simple/vtk/\n\
                       ERROR: Could not find a version that satisfies the requirement vtk==9.5.2 (from versions: none)\n\
                       ERROR: No matching distribution found for vtk==9.5.2";
        assert!(index_fault(&output(1, refused)).unwrap().ends_with("found for vtk==9.5.2"));
        assert_eq!(index_fault(&output(0, refused)), None);
        for fault in ["ERROR: Could not open requirements file", "ERROR: No space left on device", ""] {
            assert_eq!(index_fault(&output(1, fault)), None, "{fault}");
        }
        assert!(index_fault(&Output { timed_out: true, ..output(143, "") }).is_some());
    }
}
