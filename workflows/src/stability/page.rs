//! docs/stability/README.md: words by hand, with the map and the tables of its rows between markers.

use super::{
    definition::{Map, Row},
    judge::{Cell, Verdict, cell, three},
    picture,
};
use crate::{
    failure::Failure,
    paths,
    study::{definition::Run, page::replaced, results, results::Results, table},
};
use formats::disk;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Marker of the picture.
pub const MAP: &str = "map";
/// Marker of the rows.
pub const ROWS: &str = "rows";

/// Draws the map and makes the parts of the page anew; what was written.
pub fn refresh(map: &Map, results: &Results) -> Result<Vec<PathBuf>, Failure> {
    let path = paths::stability_page();
    let picture = path.with_file_name("map.png");
    let cannot = |path: &PathBuf, e: String| Failure::cannot_write(format!("{}: {e}", paths::short(path).display()));
    let fault = |e: String| Failure::no_input(format!("{}: {e}", paths::short(&path).display()));
    let page = std::fs::read_to_string(&path).map_err(|e| fault(e.to_string()))?;
    let page = replaced(&page, MAP, &summary(map, results)).map_err(fault)?;
    let page = replaced(&page, ROWS, &rows(map, results)).map_err(fault)?;
    let png = picture::png(map, results).map_err(fault)?;
    disk::write_atomic(&picture, &png).map_err(|e| cannot(&picture, e.to_string()))?;
    disk::write_atomic(&path, page.as_bytes()).map_err(|e| cannot(&path, e.to_string()))?;
    let mut written = vec![results::path(&map.study), picture, path];
    written.retain(|path| path.is_file());
    Ok(written)
}

/// The picture, and how many cells are what.
pub fn summary(map: &Map, results: &Results) -> String {
    let all = || map.rows.iter().flat_map(|row| map.methods.iter().map(move |m| cell(map, results, row, &m.name)));
    let count = |verdict: Verdict| all().filter(|cell| cell.verdict() == Some(verdict)).count();
    let open = all().filter(|cell| matches!(cell, Cell::ToDo | Cell::NoValue)).count();
    let runs: Vec<&Run> = map.study.runs.iter().collect();
    format!(
        "![Map of {} scenes and {} methods: which holds, degrades, fails](map.png)\n\n{} cells hold, {} degrade, {} fail{}. {}",
        map.rows.len(),
        map.methods.len(),
        count(Verdict::Holds),
        count(Verdict::Degrades),
        count(Verdict::Fails),
        if open == 0 { String::new() } else { format!(", {open} are open") },
        table::provenance(results, &runs),
    )
}

fn rows(map: &Map, results: &Results) -> String {
    map.rows.iter().map(|row| section(map, results, row)).collect::<Vec<_>>().join("\n\n")
}

/// What a row is about, its table, and what came of it.
pub fn section(map: &Map, results: &Results, row: &Row) -> String {
    let mut text = format!("### F{}: {} (`{}`)\n\n{}\n\n", row.failure, row.title, row.name, row.why);
    let sign = if row.holds < row.degrades { "≤" } else { "≥" };
    let (measure, formula) = (&row.measure.title, &row.measure.expression);
    let _ = writeln!(
        text,
        "Measure: {measure}, `{formula}`{}; holds {sign} {}, degrades {sign} {}, else fails.\n",
        row.reference.as_ref().map_or(String::new(), |name| format!(" (reference: `{name}`)")),
        row.holds,
        row.degrades
    );
    let _ = writeln!(text, "*Expected:* {}\n\n| Method | {measure} | |\n|---|---|---|", row.expected.trim());
    for method in &map.methods {
        let cell = cell(map, results, row, &method.name);
        let value = match cell {
            Cell::Empty => continue,
            Cell::ToDo => "to do".into(),
            Cell::NoValue => "no value".into(),
            Cell::Broke => "broke down (70)".into(),
            Cell::Judged(_, value) => three(value),
        };
        let _ = writeln!(text, "| {} | {value} | {} |", method.title, cell.verdict().map_or("", Verdict::word));
    }
    if !row.found.is_empty() {
        let _ = write!(text, "\n*Found:* {}", row.found.trim());
    }
    text.trim_end().to_owned()
}
