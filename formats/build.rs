//! Hands the commit, the compiler and the profile to the crate, for `provenance.json`.

use std::{env, path::Path, process::Command};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // The log of HEAD grows with every commit; without a repository (a packaged source) the commit stays unknown.
    let log = "../.git/logs/HEAD";
    if Path::new(log).exists() {
        println!("cargo:rerun-if-changed={log}");
        if let Some(commit) = output("git", &["rev-parse", "HEAD"]) {
            println!("cargo:rustc-env=TALUS_COMMIT={commit}");
        }
    }
    let compiler = env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    if let Some(version) = output(&compiler, &["--version"]) {
        println!("cargo:rustc-env=TALUS_COMPILER={version}");
    }
    let variable = |name: &str| env::var(name).unwrap_or_else(|_| "unknown".into());
    let profile = format!("{}, opt-level {}, {}", variable("PROFILE"), variable("OPT_LEVEL"), variable("TARGET"));
    println!("cargo:rustc-env=TALUS_PROFILE={profile}");
}

/// What a program prints on one line, if it can be run and succeeds.
fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_string();
    (output.status.success() && !text.is_empty()).then_some(text)
}
