//! What a program says on standard error while it works: lines for people, or with `--log json` a JSON object a line, for programs.
//!
//! ```text
//! {"time":"2026-01-31T12:00:00Z","program":"sph-run","level":"warning","message":"..."}
//! ```
//!
//! Levels are `note`, `progress`, `warning` and `error`; progress and errors have more keys. That nobody listens is no failure.

use crate::provenance;
use clap::ValueEnum;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::sync::OnceLock;

/// The form of what is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Log {
    /// Lines for people
    #[default]
    Text,
    /// A JSON object a line
    Json,
}

/// How much it matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    Note,
    Warning,
    Error,
}

impl Level {
    fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }

    /// What lines for people begin with.
    fn prefix(self) -> &'static str {
        match self {
            Self::Note => "",
            Self::Warning => "warning: ",
            Self::Error => "error: ",
        }
    }
}

/// Who speaks, and how.
static SPEAKER: OnceLock<(String, Log)> = OnceLock::new();

/// Says who speaks, and how: once, before anything is said.
pub fn speak(program: &str, log: Log) {
    let _ = SPEAKER.set((program.to_owned(), log));
}

fn speaker() -> (&'static str, Log) {
    SPEAKER.get().map_or(("talus", Log::Text), |(program, log)| (program, *log))
}

/// A line: `sph-run: warning: ...`.
pub fn tell(level: Level, message: &str) {
    let (program, log) = speaker();
    match log {
        Log::Text => write(&format!("{program}: {}{message}\n", level.prefix())),
        Log::Json => write(&object(program, level.name(), message, json!({}))),
    }
}

/// An error that ends the program with an exit code.
pub fn fail(message: &str, exit_code: i32) {
    match speaker() {
        (_, Log::Text) => tell(Level::Error, message),
        (program, Log::Json) => write(&object(program, "error", message, json!({ "exit_code": exit_code }))),
    }
}

/// Lines that stand as they are, with their own line ends. In JSON they are one message, without what marks warnings.
pub fn show(level: Level, text: &str) {
    match speaker() {
        (_, Log::Text) => write(text),
        (program, Log::Json) => {
            let message = text.trim().strip_prefix(level.prefix()).unwrap_or(text.trim());
            if !message.is_empty() {
                write(&object(program, level.name(), message, json!({})));
            }
        }
    }
}

/// How far the work is: a line for people, or these keys.
pub fn progress(line: &str, keys: Value) {
    match speaker() {
        (_, Log::Text) => write(&format!("{line}\n")),
        (program, Log::Json) => write(&object(program, "progress", line.trim(), keys)),
    }
}

/// Is standard error read by a program?
pub fn is_json() -> bool {
    speaker().1 == Log::Json
}

fn object(program: &str, level: &str, message: &str, more: Value) -> String {
    let mut all = Map::new();
    all.insert("time".into(), provenance::now().into());
    all.insert("program".into(), program.into());
    all.insert("level".into(), level.into());
    all.insert("message".into(), message.into());
    if let Value::Object(more) = more {
        all.extend(more);
    }
    Value::Object(all).to_string() + "\n"
}

fn write(text: &str) {
    let _ = std::io::stderr().write_all(text.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_is_one_line_with_all_keys() {
        let line = object("sph-run", "progress", "10 %\nof it", json!({ "step": 7 }));
        assert!(line.ends_with('\n') && line.matches('\n').count() == 1, "{line}");
        let value: Value = serde_json::from_str(&line).unwrap();
        assert_eq!((&value["program"], &value["level"]), (&json!("sph-run"), &json!("progress")));
        assert_eq!((&value["message"], &value["step"]), (&json!("10 %\nof it"), &json!(7)));
        assert!(value["time"].as_str().unwrap().ends_with('Z'));
    }
}
