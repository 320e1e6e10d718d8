//! What the pages say of scenes and figures, held against the programs: examples are valid, keys are those the reader
//! knows, figures are those of the scenes as they are now.

use formats::scene::{Scene, SceneError};
use std::collections::{BTreeMap, BTreeSet};
use tests::repository;
use toml::{Table, Value};

const HASH_DIGITS: usize = 8;

fn page(name: &str) -> String {
    std::fs::read_to_string(repository().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// The examples in TOML of a page.
fn examples(text: &str) -> Vec<&str> {
    text.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap_or(rest)).collect()
}

#[test]
fn the_examples_are_valid_scenes() {
    for (name, least) in [("README.md", 1), ("docs/scene.md", 3)] {
        let text = page(name);
        let found = examples(&text);
        assert!(found.len() >= least, "{name}: {} examples", found.len());
        for (number, example) in found.into_iter().enumerate() {
            if let Err(faults) = Scene::read(&format!("{name}, example {}", number + 1), example) {
                panic!("{faults}\n{example}");
            }
        }
    }
}

/// The keys in the first cells of the tables below `## Keys`: `wall.NAME.axis`.
fn documented_keys() -> BTreeSet<String> {
    let text = page("docs/scene.md");
    let section = text.split("\n## Keys\n").nth(1).expect("docs/scene.md has a section `## Keys`");
    let section = section.split("\n## ").next().unwrap_or(section);
    let key = |line: &str| Some(line.strip_prefix("| `")?.split_once("` |")?.0.to_owned());
    section.lines().filter_map(key).collect()
}

/// What the reader says about a valid scene in which one key has a value that no key may have.
fn faults_with(key: &str) -> SceneError {
    let mut scene: Table = examples(&page("README.md"))[0].parse().unwrap();
    let (path, last) = key.rsplit_once('.').unwrap_or(("", key));
    let mut table = &mut scene;
    for part in path.split('.').filter(|part| !part.is_empty()) {
        let entry = table.entry(part).or_insert_with(|| Value::Table(Table::new()));
        table = entry.as_table_mut().unwrap_or_else(|| panic!("{key}: {part} is no table"));
    }
    table.insert(last.to_owned(), Value::Array(vec![Value::Boolean(true)]));
    Scene::read("probe", &scene.to_string()).expect_err("no key may have that value")
}

/// The reader's list of the keys that would have been valid, where it does not know this one.
fn valid_instead_of(key: &str) -> Option<Vec<String>> {
    let faults = faults_with(key).faults;
    // Not only of the key itself: a table on the way to it may be the unknown one.
    let on_the_way = |name: &str| key == name || key.starts_with(&format!("{name}."));
    let fault = faults.into_iter().find(|f| f.message.starts_with("unknown key") && on_the_way(&f.key))?;
    let (_, valid) = fault.message.split_once("valid: ").expect("a list of what would be valid");
    Some(valid.split(", ").map(str::to_owned).collect())
}

#[test]
fn every_documented_key_is_known_to_the_reader() {
    let keys = documented_keys();
    assert!(keys.len() > 30 && keys.contains("numerics.courant"), "{keys:?}");
    assert!(valid_instead_of("numerics.corant").is_some() && valid_instead_of("numeric.courant").is_some());
    let unknown: Vec<_> = keys.iter().filter(|key| valid_instead_of(key).is_some()).collect();
    assert!(unknown.is_empty(), "docs/scene.md names keys that the reader does not know: {unknown:?}");
}

#[test]
fn every_key_of_the_reader_is_documented() {
    let keys = documented_keys();
    let parents: BTreeSet<&str> =
        keys.iter().map(|key| key.rsplit_once('.').map_or("", |(parent, _)| parent)).collect();
    let mut missing = Vec::new();
    for parent in parents {
        let path = |key: &str| if parent.is_empty() { key.to_owned() } else { format!("{parent}.{key}") };
        let valid = valid_instead_of(&path("nonsense")).unwrap_or_else(|| panic!("{}: accepted", path("nonsense")));
        let is_documented = |key: &str| keys.iter().any(|k| k == key || k.starts_with(&format!("{key}.")));
        missing.extend(valid.iter().map(|key| path(key)).filter(|key| !is_documented(key)));
    }
    assert!(missing.is_empty(), "docs/scene.md does not name {missing:?}");
}

/// The rows of all tables of a page, each row's cells by the headings of its table.
fn rows(text: &str) -> Vec<BTreeMap<&str, &str>> {
    let cells = |line| -> Option<Vec<&str>> {
        let line: &str = line;
        Some(line.trim().strip_prefix('|')?.strip_suffix('|')?.split('|').map(str::trim).collect())
    };
    let (mut rows, mut heading) = (Vec::new(), None::<Vec<&str>>);
    for line in text.lines() {
        match (cells(line), &heading) {
            (None, _) => heading = None,
            (Some(cells), None) => heading = Some(cells),
            (Some(cells), Some(_)) if cells.iter().all(|cell| cell.starts_with("--")) => {}
            (Some(cells), Some(heading)) => rows.push(heading.iter().copied().zip(cells).collect()),
        }
    }
    rows
}

/// The cases that the checks.toml of all validations name.
fn validated_cases() -> BTreeSet<String> {
    let folder = repository().join("tests/validation");
    let mut cases = BTreeSet::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path().join("checks.toml");
        if path.is_file() {
            let checks: Table = std::fs::read_to_string(&path).unwrap().parse().unwrap();
            for check in checks["check"].as_array().unwrap() {
                let named = ["case", "as-case"].iter().filter_map(|key| check.get(key)?.as_str());
                cases.extend(named.map(str::to_owned));
            }
        }
    }
    cases
}

/// What is wrong with the figures of a RESULTS.md, given the hash of a case's scene as it is now.
fn stale(results: &str, validated: &BTreeSet<String>, hash_now: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let rows = rows(results);
    let mut hashes: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for case in rows.iter().filter_map(|row| row.get("case")).copied().chain(validated.iter().map(String::as_str)) {
        hashes.entry(case).or_default();
    }
    for row in &rows {
        if let (Some(case), Some(hash)) = (row.get("case"), row.get("scene")) {
            hashes.entry(case).or_default().insert(hash);
        }
    }
    let mut faults = Vec::new();
    for (case, hashes) in hashes {
        match hash_now(case) {
            None => faults.push(format!("{case}: there is no such case")),
            Some(_) if hashes.is_empty() => faults.push(format!("{case}: the hash of its scene is not there")),
            Some(now) => faults.extend(
                hashes
                    .iter()
                    .filter(|hash| **hash != now)
                    .map(|hash| format!("{case}: of scene {hash}, now it is {now}")),
            ),
        }
    }
    faults
}

#[test]
fn the_figures_are_those_of_the_scenes_as_they_are() {
    let hash_now = |case: &str| {
        let text = std::fs::read_to_string(repository().join("workflows/cases").join(case).join("scene.toml")).ok()?;
        Some(Scene::text_hash(&text)[..HASH_DIGITS].to_owned())
    };
    let faults = stale(&page("tests/validation/RESULTS.md"), &validated_cases(), hash_now);
    let advice = "tests/validation/RESULTS.md is out of date; run ./talus validate --reuse";
    assert!(faults.is_empty(), "{advice}:\n{}", faults.join("\n"));
}

#[test]
fn stale_figures_are_found() {
    let table = |case: &str, hash: &str| format!("text\n\n| case | scene |\n|---|---|\n| {case} | {hash} |\n\n");
    let validated = BTreeSet::from(["a".to_owned()]);
    let faults = |text: &str| stale(text, &validated, |case| (case != "gone").then(|| "12345678".to_owned()));
    assert_eq!(faults(&table("a", "12345678")), [""; 0]);
    assert_eq!(faults(&table("a", "87654321")), ["a: of scene 87654321, now it is 12345678"]);
    assert_eq!(faults("none"), ["a: the hash of its scene is not there"]);
    let two = table("a", "12345678") + "| case | here |\n|---|---|\n| b | 1 |\n| gone | 2 |\n";
    assert_eq!(faults(&two), ["b: the hash of its scene is not there", "gone: there is no such case"]);
}

/// What a page of the guide says of options and pictures is what `sph-post` has.
#[test]
fn the_guide_names_options_and_pictures_that_there_are() {
    let help = tests::run("sph-post", &["--help"], 0).expect(formats::exit::DONE).stdout;
    let text = page("docs/guide/results.md");
    let options: BTreeSet<&str> = text
        .lines()
        .filter(|line| line.starts_with("    sph-post "))
        .flat_map(str::split_whitespace)
        .filter(|word| word.starts_with("--"))
        .collect();
    assert!(options.len() > 5, "{options:?}");
    let unknown: Vec<_> = options.into_iter().filter(|option| !help.contains(&format!("{option} <"))).collect();
    assert!(unknown.is_empty(), "docs/guide/results.md names options that sph-post has not: {unknown:?}");
    let shown: BTreeSet<&str> = rows(&text)
        .iter()
        .filter_map(|row| row.get("Picture").copied())
        .flat_map(|cell| cell.split(", ").map(|name| name.trim_matches('`')))
        .collect();
    let sources = repository().join("sph-post/src/plot");
    let drawn: String =
        std::fs::read_dir(sources).unwrap().map(|e| std::fs::read_to_string(e.unwrap().path()).unwrap()).collect();
    for name in &shown {
        let quoted = format!("\"{}", name.replace("FIELD", ""));
        assert!(drawn.contains(&quoted), "docs/guide/results.md names a picture that is not drawn: {name}");
    }
    assert!(shown.len() > 15, "{shown:?}");
}
