//! VALIDATION.md: text by hand, with parts between `<!-- begin NAME -->` and `<!-- end NAME -->` that are made anew.

use super::{
    chart, coverage,
    definition::{Choice, Copied, Picture, Study},
    paper,
    results::Results,
    table,
};
use crate::{failure::Failure, paths};
use formats::disk;
use std::path::{Path, PathBuf};

/// Marker of the table of tests.
pub const COVERAGE: &str = "tests";

/// Kept pictures are not larger.
const MOST_BYTES: usize = 150_000;

/// Makes the study's pictures, and its parts of the page, anew; returns what was written.
pub fn refresh(study: &Study, results: &Results) -> Result<Vec<PathBuf>, Failure> {
    let path = paths::page();
    let fault = |e: String| Failure::no_input(format!("{}: {e}", paths::short(&path).display()));
    let mut page = std::fs::read_to_string(&path).map_err(|e| fault(e.to_string()))?;
    let mut written = vec![super::results::path(study)];
    written.retain(|path| path.is_file());
    let mut put = |name: &str, part: &str| {
        page = replaced(&page, name, part).map_err(fault)?;
        Ok::<(), Failure>(())
    };
    for table in &study.tables {
        put(&format!("{}/{}", study.name, table.name), &table::table(study, results, table))?;
    }
    for picture in &study.pictures {
        let (part, made) = drawn(study, results, picture)?;
        written.extend(made);
        put(&format!("{}/{}", study.name, picture.name), &part)?;
    }
    for copy in &study.copies {
        let (part, made) = copied(study, copy)?;
        written.extend(made);
        put(&format!("{}/{}", study.name, copy.name), &part)?;
    }
    put(COVERAGE, &coverage::table()?)?;
    disk::write_atomic(&path, page.as_bytes())
        .map_err(|e| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display())))?;
    written.push(path);
    Ok(written)
}

fn file(study: &Study, name: &str) -> PathBuf {
    paths::pictures().join(format!("{}-{name}.png", study.name))
}

fn shown(title: &str, path: &Path) -> String {
    let path = path.strip_prefix(paths::repository()).unwrap_or(path);
    format!("![{title}]({})\n", path.display())
}

fn drawn(study: &Study, results: &Results, picture: &Picture) -> Result<(String, Option<PathBuf>), Failure> {
    let known = table::Known { study, results };
    let all = || picture.panels.iter().flat_map(|panel| &panel.curves).chain(&picture.curves);
    let choice = |curve: &super::definition::Curve| Choice { series: curve.series.clone(), only: curve.only.clone() };
    let mut runs: Vec<_> = all().flat_map(|curve| study.chosen(&choice(curve))).collect();
    runs.sort_by(|a, b| a.name.cmp(&b.name));
    runs.dedup_by(|a, b| a.name == b.name);
    let provenance = table::provenance(results, &runs);
    if !runs.iter().any(|run| known.line(run).is_some()) {
        return Ok((format!("*{}: not run.*\n", picture.title), None));
    }
    let path = file(study, &picture.name);
    let png = chart::png(&known, picture).map_err(|e| Failure::no_input(format!("picture {}: {e}", picture.name)))?;
    keep(&path, &png)?;
    Ok((format!("{}\n{provenance}\n", shown(&picture.title, &path)), Some(path)))
}

/// From the run's folder, where it is there; else the picture that is kept.
fn copied(study: &Study, copy: &Copied) -> Result<(String, Option<PathBuf>), Failure> {
    let path = file(study, &copy.name);
    let made = paths::study_runs(&study.name).join(&copy.run).join("post").join(&copy.file);
    let fresh = match std::fs::read(&made) {
        Ok(png) => {
            let fault = |e: String| Failure::no_input(format!("{}: {e}", paths::short(&made).display()));
            keep(&path, &paper::repacked(&png, MOST_BYTES).map_err(fault)?)?;
            Some(path.clone())
        }
        Err(_) => None,
    };
    match path.is_file() {
        true => Ok((format!("{}\nRun `{}`.\n", shown(&copy.title, &path), copy.run), fresh)),
        false => Ok((format!("*{}: not run.*\n", copy.title), None)),
    }
}

fn keep(path: &Path, png: &[u8]) -> Result<(), Failure> {
    let fault = |e: String| Failure::cannot_write(format!("{}: {e}", paths::short(path).display()));
    if png.len() > MOST_BYTES {
        return Err(fault(format!("{} bytes, at most {MOST_BYTES} are kept", png.len())));
    }
    std::fs::create_dir_all(paths::pictures()).map_err(|e| fault(e.to_string()))?;
    disk::write_atomic(path, png).map_err(|e| fault(e.to_string()))
}

/// The page with the part between the markers of a name replaced; all else stays to the byte.
pub fn replaced(page: &str, name: &str, part: &str) -> Result<String, String> {
    let (begin, end) = (format!("<!-- begin {name} -->"), format!("<!-- end {name} -->"));
    let missing = |marker: &str| format!("there is no marker `{marker}`");
    let (before, rest) = page.split_once(&begin).ok_or_else(|| missing(&begin))?;
    let (_, after) = rest.split_once(&end).ok_or_else(|| missing(&end))?;
    if after.contains(&begin) {
        return Err(format!("the marker `{begin}` is there twice"));
    }
    Ok(format!("{before}{begin}\n\n{}\n\n{end}{after}", part.trim()))
}

/// The names of all markers of a page, in order.
#[cfg(test)]
pub fn markers(page: &str) -> Vec<&str> {
    page.split("<!-- begin ").skip(1).filter_map(|rest| rest.split(" -->").next()).collect()
}
