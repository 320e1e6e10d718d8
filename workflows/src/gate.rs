//! `test`: every test of the repository, by cargo-nextest where it is installed, else by `cargo test`.

use crate::{failure::Failure, launch, stage};
use xshell::{Cmd, cmd};

/// Runs the whole workspace's tests; `arguments` go to the test runner. cargo-nextest leaves the examples in the
/// documentation to `cargo test`.
pub fn test(arguments: &[String]) -> Result<(), Failure> {
    let shell = launch::shell()?;
    let cargo = stage::cargo();
    let nextest = cmd!(shell, "{cargo} nextest --version").quiet().ignore_stdout().ignore_stderr().run().is_ok();
    if !nextest {
        return passed(cmd!(shell, "{cargo} test --workspace --no-fail-fast {arguments...}"));
    }
    passed(cmd!(shell, "{cargo} nextest run --workspace --no-fail-fast {arguments...}"))?;
    match arguments.is_empty() {
        true => passed(cmd!(shell, "{cargo} test --workspace --doc --quiet")),
        false => Ok(()),
    }
}

fn passed(command: Cmd<'_>) -> Result<(), Failure> {
    let name = command.to_string();
    eprintln!("talus: {name}");
    let end = launch::wait(command, launch::Stop::AtOnce)?;
    match end.status.success() {
        true => Ok(()),
        false => {
            let message = format!("`{name}` failed, see above; once more, one test: ./talus test NAME");
            Err(Failure { code: stage::code(end.status), message })
        }
    }
}
