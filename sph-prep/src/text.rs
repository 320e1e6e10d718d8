//! The scene's text: read once, known to all ranks; and its faults, shown in their place.

use crate::failure::{Failure, agree};
use formats::news::{self, Level};
use formats::scene::SceneError;
use miette::{GraphicalReportHandler, LabeledSpan, MietteDiagnostic, NamedSource, Report, SourceOffset};
use mpi::traits::*;
use std::{io::IsTerminal, path::Path};

/// Reads a file on rank 0 and hands its text to all ranks. Collective.
///
/// # Errors
/// [`Failure::NoScene`] on rank 0 where the file is missing, can't be read, or isn't UTF-8.
pub fn share(path: &Path, comm: &impl Communicator) -> Result<String, Failure> {
    let read = if comm.rank() == 0 { read(path) } else { Ok(String::new()) };
    let bytes = broadcast(agree(comm, read)?.into_bytes(), comm);
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Hands rank 0's bytes to all ranks. Collective.
pub fn broadcast(mut bytes: Vec<u8>, comm: &impl Communicator) -> Vec<u8> {
    let root = comm.process_at_rank(0);
    let mut length = bytes.len() as u64;
    root.broadcast_into(&mut length);
    bytes.resize(length as usize, 0);
    // MPI refuses the address of an empty buffer.
    if length > 0 {
        root.broadcast_into(&mut bytes[..]);
    }
    bytes
}

/// Reads a file; one rank alone.
///
/// # Errors
/// As [`share`].
pub fn read(path: &Path) -> Result<String, Failure> {
    let failure = |why: String| Failure::NoScene { path: path.to_owned(), why };
    let bytes = std::fs::read(path).map_err(|e| failure(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| {
        let valid = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = valid.iter().filter(|b| **b == b'\n').count() + 1;
        failure(format!("it is not UTF-8 text (line {line}, byte {})", valid.len()))
    })
}

/// Prints a failure to standard error. The faults of a scene come one a line; on a terminal each is followed by the
/// lines of the scene it is about.
pub fn print(failure: &Failure, text: &str) {
    match failure {
        Failure::Scene(error) if !news::is_json() => {
            news::show(Level::Error, &format!("{}\n", error.report()));
            if std::io::stderr().is_terminal() {
                news::show(Level::Error, &excerpts(error, text));
            }
        }
        Failure::Scene(error) => news::fail(&error.report(), failure.exit_code()),
        // Rank 0 prints even if only another rank knows the reason.
        other => news::fail(&other.to_string(), other.exit_code()),
    }
}

fn excerpts(error: &SceneError, text: &str) -> String {
    let mut out = String::new();
    for fault in &error.faults {
        let at = SourceOffset::from_location(text, fault.line, fault.column).offset();
        let rest = text[at..].split('\n').next().unwrap_or_default();
        // The value or key that starts here ends at the line's end, a comment, or the next item.
        let length = rest.find(['#', ',']).unwrap_or(rest.len()).max(1).min(rest.len());
        let label = LabeledSpan::at(at..at + length, &fault.message);
        let title = if fault.key.is_empty() { "the scene" } else { &fault.key };
        let diagnostic = MietteDiagnostic::new(title).with_label(label);
        let report = Report::new(diagnostic).with_source_code(NamedSource::new(&error.file, text.to_owned()));
        // It fails only where the place lies outside of the text; the plain line has been printed already.
        let _ = GraphicalReportHandler::new().with_links(false).render_report(&mut out, report.as_ref());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::scene::Fault;

    #[test]
    fn an_excerpt_shows_the_line() {
        let text = "space = \"4d\" # no\nspacing = 1\n";
        let fault = Fault { line: 1, column: 9, key: "space".into(), message: "unknown".into() };
        let error = SceneError { file: "scene.toml".into(), faults: vec![fault] };
        let shown = excerpts(&error, text);
        assert!(shown.contains("space = \"4d\"") && shown.contains("unknown"), "{shown}");
    }

    #[test]
    fn a_place_beyond_the_text_does_no_harm() {
        let fault = Fault { line: 99, column: 99, key: String::new(), message: "missing".into() };
        excerpts(&SceneError { file: "s".into(), faults: vec![fault] }, "");
    }

    #[test]
    fn other_encodings_are_refused_with_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("latin1.toml");
        std::fs::write(&path, b"title = \"ok\"\ntitle = \"B\xf6schung\"\n").unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(message.contains("latin1.toml") && message.contains("line 2"), "{message}");
        assert_eq!(read(&path).unwrap_err().exit_code(), 65);
        assert_eq!(read(folder.path()).unwrap_err().exit_code(), 65);
    }
}
