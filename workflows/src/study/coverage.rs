//! Which test covers which row of `tests/validation/rows.csv`: tests that do so begin with the row's name, such as
//! `c2_c3_c4_lattice_sums`.

use crate::{failure::Failure, paths};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Folders with tests.
const PACKAGES: [&str; 6] = ["formats", "sph-prep", "sph-run", "sph-post", "workflows", "tests"];

/// The table as Markdown.
pub fn table() -> Result<String, Failure> {
    let path = paths::validation().join("rows.csv");
    let fault = |e: String| Failure::no_input(format!("{}: {e}", paths::short(&path).display()));
    let rows = std::fs::read_to_string(&path).map_err(|e| fault(e.to_string()))?;
    let mut tests: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for package in PACKAGES {
        let folder = paths::repository().join(package);
        collect(&folder, &mut tests).map_err(|e| fault(format!("{}: {e}", folder.display())))?;
    }
    Ok(rows_with(&rows, &tests))
}

/// Lines `name; what; where else`, the last one empty where there is only the tests.
fn rows_with(rows: &str, tests: &BTreeMap<String, Vec<String>>) -> String {
    let mut text = "| row | what | tests |\n|---|---|---|\n".to_owned();
    for row in rows.lines().skip(1).filter(|row| !row.trim().is_empty()) {
        let mut cells = row.split(';').map(str::trim);
        let (name, what) = (cells.next().unwrap_or_default(), cells.next().unwrap_or_default());
        let elsewhere = cells.next().filter(|place| !place.is_empty()).map(str::to_owned);
        let found = tests.get(name).into_iter().flatten().cloned().chain(elsewhere);
        let places: Vec<String> = found.collect();
        let places = if places.is_empty() { "none yet".to_owned() } else { places.join(", ") };
        let _ = writeln!(text, "| {name} | {what} | {places} |");
    }
    text
}

fn collect(folder: &Path, tests: &mut BTreeMap<String, Vec<String>>) -> std::io::Result<()> {
    let mut entries: Vec<_> = std::fs::read_dir(folder)?.flatten().map(|entry| entry.path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            collect(&path, tests)?;
        } else if path.extension().is_some_and(|kind| kind == "rs") {
            let text = std::fs::read_to_string(&path)?;
            let file = path.strip_prefix(paths::repository()).unwrap_or(&path).display().to_string();
            for name in text.lines().filter_map(|line| line.trim_start().strip_prefix("fn ")) {
                let name = name.split('(').next().unwrap_or_default();
                for row in rows_of(name) {
                    tests.entry(row).or_default().push(format!("`{name}` ({file})"));
                }
            }
        }
    }
    Ok(())
}

/// `c2_c3_c4_lattice_sums` tests C2, C3 and C4.
fn rows_of(name: &str) -> Vec<String> {
    let is_row = |part: &&str| {
        let mut letters = part.chars();
        letters.next().is_some_and(|c| ('a'..='h').contains(&c))
            && letters.clone().count() > 0
            && letters.all(|c| c.is_ascii_digit())
    };
    name.split('_').take_while(is_row).map(str::to_uppercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_in_the_names_of_tests() {
        assert_eq!(rows_of("c2_c3_c4_lattice_sums"), ["C2", "C3", "C4"]);
        assert_eq!(rows_of("a_block_rests"), Vec::<String>::new());
        assert_eq!(rows_of("h1"), ["H1"]);
        let mut tests = BTreeMap::new();
        tests.insert("A1".to_owned(), vec!["`a1_x` (f.rs)".to_owned()]);
        let text = rows_with("row;what;where\nA1;constants;\nG3;Lube;study `columns`\nZ9;nothing;\n", &tests);
        for line in
            ["| A1 | constants | `a1_x` (f.rs) |", "| G3 | Lube | study `columns` |", "| Z9 | nothing | none yet |"]
        {
            assert!(text.lines().any(|l| l == line), "{text}");
        }
    }

    #[test]
    fn every_row_that_a_test_names_is_in_the_list() {
        let rows = std::fs::read_to_string(paths::validation().join("rows.csv")).unwrap();
        let mut tests = BTreeMap::new();
        for package in PACKAGES {
            collect(&paths::repository().join(package), &mut tests).unwrap();
        }
        let known: Vec<&str> = rows.lines().filter_map(|row| row.split(';').next()).collect();
        let unknown: Vec<_> = tests.keys().filter(|row| !known.contains(&row.as_str())).collect();
        assert!(unknown.is_empty() && tests.len() > 20, "{unknown:?}");
    }
}
