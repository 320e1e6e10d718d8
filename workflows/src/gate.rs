//! `test`: every test of the repository, by cargo-nextest where it is installed, else by `cargo test`.

use crate::{failure::Failure, launch, stage};
use xshell::{Cmd, cmd};

/// Exit code of `test` where a test fails or does not build, whatever code the test runner has for it.
const TESTS_FAILED: i32 = 1;

/// Settings of Open MPI for tests, where the environment has none. All ranks are on this machine: the search for fast networks
/// would take most of the time that MPI needs to start, and ranks that wait should leave the cores to other tests.
const SETTINGS: [(&str, &str); 2] = [("OMPI_MCA_pml", "ob1"), ("OMPI_MCA_mpi_yield_when_idle", "1")];

/// Runs the whole workspace's tests; `arguments` go to the test runner. cargo-nextest leaves the examples in the
/// documentation to `cargo test`. Fails with exit code 1.
pub fn test(arguments: &[String]) -> Result<(), Failure> {
    let shell = launch::shell()?;
    let _settings: Vec<_> = SETTINGS
        .into_iter()
        .filter(|(name, _)| std::env::var_os(name).is_none())
        .map(|(name, value)| shell.push_env(name, value))
        .collect();
    let cargo = stage::cargo();
    let nextest = cmd!(shell, "{cargo} nextest --version").quiet().ignore_stdout().ignore_stderr().run().is_ok();
    if nextest {
        passed(cmd!(shell, "{cargo} nextest run --workspace --no-fail-fast {arguments...}"))?;
        if arguments.is_empty() {
            passed(cmd!(shell, "{cargo} test --workspace --doc --quiet"))?;
        }
    } else {
        passed(cmd!(shell, "{cargo} test --workspace --no-fail-fast {arguments...}"))?;
    }
    eprintln!("talus: all tests passed; where one was left out, a line above says LEFT OUT and why");
    Ok(())
}

fn passed(command: Cmd<'_>) -> Result<(), Failure> {
    let name = command.to_string();
    eprintln!("talus: {name}");
    let end = launch::wait(command, launch::Stop::AtOnce)?;
    match end.status.success() {
        true => Ok(()),
        false => {
            let message = format!("`{name}` failed, see above; once more, one test: ./talus test NAME");
            Err(Failure { code: TESTS_FAILED, message })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_failure_of_the_test_runner_is_code_1() {
        let shell = launch::shell().unwrap();
        passed(cmd!(shell, "true")).unwrap();
        for script in ["exit 1", "exit 100", "exit 101", "kill -9 $$"] {
            assert_eq!(passed(cmd!(shell, "sh -c {script}")).unwrap_err().code, TESTS_FAILED, "{script}");
        }
    }
}
