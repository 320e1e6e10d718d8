//! What may change in a scene while a run goes on, and the hash of what may not.
//!
//! Both look at the values that the text sets, key by key. Comments, layout, the order of keys and how a quantity is spelt do
//! not count; the order of bodies, walls and obstacles does, because particles, wall sites and copies of files are numbered by
//! it. Defaults are not filled in: a later version may have keys that this one does not know, and must still find the same hash.

use super::{Output, Scene, SceneError, Sources, raw::Faults};
use crate::{folder::RunFolder, provenance, units};
use std::{collections::BTreeMap, fmt, ops::Range, path::Path};
use toml::de::{DeTable, DeValue};

/// Keys that may change while a run goes on: a title for people, when the run is over, and what is written meanwhile. On none
/// of them depends how a particle moves, but for steps that are shortened to meet a time. Everything else is either in the
/// particles already (bodies, the state at the start) or in the equations (material, walls, numerical parameters): a run in
/// which it changed half way would be the run of no scene.
pub const MAY_CHANGE: [&str; 5] = ["title", "end.time", "end.at-rest", "output.snapshots", "output.history"];

/// Tables whose order counts.
const ORDERED: [&str; 3] = ["body", "wall", "obstacle"];

/// A key that has another value than before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// Key path, e.g. `end.time`.
    pub key: String,
    /// What the scene said, in its own words; none where it left the key out.
    pub old: Option<String>,
    /// What it says now.
    pub new: Option<String>,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = |value: &Option<String>| value.clone().unwrap_or_else(|| "not set".into());
        write!(f, "{}: {}, was {}", self.key, words(&self.new), words(&self.old))
    }
}

impl Scene {
    /// How the scene `new` of a run differs from `old`, the one it was made from, where all that differs may change
    /// ([`MAY_CHANGE`]); nothing where they say the same. `name` is used in messages.
    ///
    /// # Errors
    /// All faults of the new scene; or else all keys that may not change and did, in the order of the file.
    pub fn changes(name: &str, old: &str, new: &str) -> Result<Vec<Change>, SceneError> {
        Self::read(name, new)?;
        Self::differences(name, old, new)
    }

    /// The same between the scene of a run folder and one at `path` that is to replace it; the files that both name may not have
    /// changed either. `name` is used in messages.
    ///
    /// # Errors
    /// As [`Scene::changes`].
    pub fn changes_in(
        run: &RunFolder,
        old: &str,
        path: &Path,
        name: &str,
        new: &str,
    ) -> Result<Vec<Change>, SceneError> {
        let now = Self::read_with(name, new, &Sources::of(path))?;
        if !now.files.is_empty() {
            let lock = run.scene();
            let then = Self::read_with(&lock.display().to_string(), old, &Sources::of(&lock))?;
            let differs = |file: &&(String, String)| then.files.iter().any(|old| old.0 == file.0 && old.1 != file.1);
            if let Some((file, _)) = now.files.iter().find(differs) {
                let faults = Faults::new(new);
                let message = format!("{file} is not what it was when the run was made; it may not change");
                faults.add(new.find(file.as_str()).unwrap_or(0), "", message);
                return Err(SceneError { file: name.to_string(), faults: faults.into_list() });
            }
        }
        Self::differences(name, old, new)
    }

    fn differences(name: &str, old: &str, new: &str) -> Result<Vec<Change>, SceneError> {
        let (then, now) = (Values::of(old), Values::of(new));
        let mut changes = Vec::new();
        let faults = Faults::new(new);
        let keys: std::collections::BTreeSet<&String> = then.set.keys().chain(now.set.keys()).collect();
        for key in keys {
            let (before, after) = (then.set.get(key), now.set.get(key));
            if before.map(|v| &v.canonical) == after.map(|v| &v.canonical) {
                continue;
            }
            let change = Change {
                key: key.clone(),
                old: before.map(|value| words(old, &value.span)),
                new: after.map(|value| words(new, &value.span)),
            };
            if MAY_CHANGE.contains(&key.as_str()) {
                changes.push(change);
            } else {
                faults.add(now.place(key), key, refusal(&change));
            }
        }
        for table in ORDERED {
            let names = |values: &Values| values.order.get(table).map(|(names, _)| names.clone()).unwrap_or_default();
            let (before, after) = (names(&then), names(&now));
            if before != after && sorted(&before) == sorted(&after) {
                let list = |names: &[String]| Some(names.join(", "));
                let change = Change { key: table.into(), old: list(&before), new: list(&after) };
                faults.add(now.place(table), table, format!("in another order: {}", refusal(&change)));
            }
        }
        match faults.into_list() {
            faults if faults.is_empty() => Ok(changes),
            faults => Err(SceneError { file: name.to_string(), faults }),
        }
    }

    /// What tells scenes apart that cannot go on from each other's files, and is stored in every file a scene leads to:
    /// SHA-256 of what the text sets, without what may change while a run goes on.
    ///
    /// One line for each key, `key = value`, in the order of the keys. A quantity is its number in SI units, shortest form
    /// with exponent; other text is a JSON string. The names of bodies, and those of walls, follow in the order of the file.
    /// Text that is no TOML is hashed as it is.
    pub fn hash(text: &str) -> String {
        provenance::sha256(canonical(text).unwrap_or_else(|| text.into()).as_bytes())
    }

    /// SHA-256 of the text, byte for byte: what a figure was made from, end time and all.
    pub fn text_hash(text: &str) -> String {
        provenance::sha256(text.as_bytes())
    }
}

impl Output {
    /// Where an output goes on whose interval is another one from `time` on: the number of the first multiple of `interval`
    /// after it. A time that differs from a multiple by rounding only is that multiple, as it is when outputs are due.
    pub fn first_after(interval: f64, time: f64) -> u64 {
        (time / interval + 1e-9).floor() as u64 + 1
    }
}

/// What [`Scene::hash`] hashes; none where the text is no TOML.
fn canonical(text: &str) -> Option<String> {
    let (_, syntax_errors) = DeTable::parse_recoverable(text);
    if !syntax_errors.is_empty() {
        return None;
    }
    let values = Values::of(text);
    let set = values.set.iter().filter(|(key, _)| !MAY_CHANGE.contains(&key.as_str()));
    let set = set.map(|(key, value)| format!("{key} = {}\n", value.canonical));
    let order = values.order.iter().map(|(table, (names, _))| format!("[{table}] {}\n", names.join(", ")));
    Some(set.chain(order).collect())
}

/// What a text sets.
#[derive(Default)]
struct Values {
    /// By key path.
    set: BTreeMap<String, Value>,
    /// Names in the tables of [`ORDERED`], in the order of the file, and where they are.
    order: BTreeMap<String, (Vec<String>, usize)>,
    /// Where tables begin, byte offsets by key path.
    tables: BTreeMap<String, usize>,
}

struct Value {
    canonical: String,
    span: Range<usize>,
}

impl Values {
    fn of(text: &str) -> Self {
        let mut values = Self::default();
        values.take(DeTable::parse_recoverable(text).0.get_ref(), "");
        values
    }

    fn take(&mut self, table: &DeTable<'_>, path: &str) {
        let mut entries: Vec<_> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        for (key, value) in &entries {
            let name = word(key.get_ref());
            let path = if path.is_empty() { name } else { format!("{path}.{name}") };
            match value.get_ref() {
                DeValue::Table(inner) => {
                    self.tables.insert(path.clone(), key.span().start);
                    self.take(inner, &path);
                }
                other => {
                    self.set.insert(path, Value { canonical: plain(other), span: value.span() });
                }
            }
        }
        if ORDERED.contains(&path)
            && let Some((first, _)) = entries.first()
        {
            let names = entries.iter().map(|(key, _)| word(key.get_ref())).collect();
            self.order.insert(path.into(), (names, first.span().start));
        }
    }

    /// Where a key is, or the innermost table that it should be in.
    fn place(&self, key: &str) -> usize {
        let own = self.set.get(key).map(|value| value.span.start);
        let order = self.order.get(key).map(|(_, start)| *start);
        let tables =
            self.tables.iter().filter(|(path, _)| key.strip_prefix(path.as_str()).is_some_and(|k| k.starts_with('.')));
        own.or(order).or(tables.map(|(path, start)| (path.len(), *start)).max().map(|(_, start)| start)).unwrap_or(0)
    }
}

/// A key as TOML writes it: bare, or in quotes.
fn word(key: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if !key.is_empty() && key.chars().all(bare) { key.into() } else { quoted(key) }
}

/// As a JSON string.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// The same text for the same value.
fn plain(value: &DeValue<'_>) -> String {
    // Minus zero is zero.
    let number = |number: f64| format!("{:e}", number + 0.0);
    match value {
        DeValue::String(text) => units::any(text).map_or_else(|| quoted(text), number),
        DeValue::Integer(i) => match i64::from_str_radix(i.as_str(), i.radix()) {
            // Larger ones, which only seeds can be, are not all numbers of the other kind.
            Ok(value) if value.unsigned_abs() <= 1 << 53 => number(value as f64),
            Ok(value) => value.to_string(),
            Err(_) => i.to_string(),
        },
        DeValue::Float(f) => f.as_str().parse().map_or_else(|_| f.to_string(), number),
        DeValue::Array(items) => {
            format!("[{}]", items.iter().map(|item| plain(item.get_ref())).collect::<Vec<_>>().join(", "))
        }
        // No scene has these, but any text has a hash.
        DeValue::Boolean(value) => value.to_string(),
        DeValue::Datetime(value) => value.to_string(),
        DeValue::Table(entries) => {
            let mut entries: Vec<_> = entries.iter().map(|(k, v)| (word(k.get_ref()), plain(v.get_ref()))).collect();
            entries.sort();
            let entries: Vec<_> = entries.iter().map(|(key, value)| format!("{key} = {value}")).collect();
            format!("{{{}}}", entries.join(", "))
        }
    }
}

/// A value as the file writes it, on one line.
fn words(text: &str, span: &Range<usize>) -> String {
    text[span.clone()].split_whitespace().collect::<Vec<_>>().join(" ")
}

fn refusal(change: &Change) -> String {
    let words = |value: &Option<String>| value.clone().unwrap_or_else(|| "not set".into());
    format!("{} now, {} when the run was made; it may not change", words(&change.new), words(&change.old))
}

fn sorted(names: &[String]) -> Vec<&String> {
    let mut names: Vec<_> = names.iter().collect();
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = r#"
title = "One"
space = "plane-strain"
spacing = "4 mm"

[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = 0

[body.column]
box = { min = [0, 0, 0], max = ["0.1 m", 0, "0.1 m"] }

[wall.floor]
axis = "z"
at = 0
side = "above"
slip = "no-slip"

[wall.side]
axis = "x"
at = 0
side = "above"
slip = "free-slip"

[initial]
seed = 9007199254740993

[end]
time = "0.35 s"

[output]
history = "5 ms"
"#;

    fn with(pairs: &[(&str, &str)]) -> String {
        pairs.iter().fold(SCENE.to_string(), |text, (old, new)| {
            assert!(text.contains(old), "{old}");
            text.replacen(old, new, 1)
        })
    }

    /// The refusals, line by line.
    fn refused(new: &str) -> Vec<String> {
        assert_ne!(Scene::hash(SCENE), Scene::hash(new), "what may not change has another hash");
        let error = Scene::changes("new.toml", SCENE, new).unwrap_err();
        error.report().lines().map(String::from).collect()
    }

    #[test]
    fn what_reads_the_same_is_the_same() {
        // The order of keys and tables, comments, spelling of quantities and strings, tables inline or not.
        let same = r#"# The same again.
end.time = 0.35
output = { history = "0.005 s" }
spacing = 4e-3
title = "One"
"space" = 'plane-strain'
[initial]
seed = 0x20000000000001
[body]
column.box.max = [0.1, -0.0, "10 cm"]
column.box.min = [0, "0 m", 0.0]
[wall.floor]
at = 0
axis = "z"
slip = "no-slip"
side = "above"
[wall.side]
slip = "free-slip"
side = "above" # the material is to the right
axis = "x"
at = "-0 mm"
[numerics]
[material.drucker-prager]
cohesion = "0 kPa"
friction = 30
poisson = "0.3"
young = "5.98e3 kPa"
density = "2.6 g/cm³"
"#;
        assert_eq!(Scene::changes("new.toml", SCENE, same), Ok(vec![]));
        assert_eq!(Scene::read("a", SCENE).unwrap(), Scene::read("b", same).unwrap());
        assert_eq!(Scene::hash(SCENE), Scene::hash(same));
        assert_ne!(Scene::text_hash(SCENE), Scene::text_hash(same));
    }

    #[test]
    fn what_may_change_is_told_and_has_no_part_in_the_hash() {
        let new = with(&[
            ("title = \"One\"\n", ""),
            ("time = \"0.35 s\"", "time = \"2 s\"\nat-rest = 1e-3"),
            ("history = \"5 ms\"", "history = \"10 ms\"\nsnapshots = 0.5"),
        ]);
        let changes = Scene::changes("new.toml", SCENE, &new).unwrap();
        let told: Vec<_> = changes.iter().map(Change::to_string).collect();
        assert_eq!(
            told,
            [
                "end.at-rest: 1e-3, was not set",
                "end.time: \"2 s\", was \"0.35 s\"",
                "output.history: \"10 ms\", was \"5 ms\"",
                "output.snapshots: 0.5, was not set",
                "title: not set, was \"One\"",
            ]
        );
        let keys: Vec<_> = changes.iter().map(|change| change.key.as_str()).collect();
        assert!(keys.iter().all(|key| MAY_CHANGE.contains(key)) && keys.len() == MAY_CHANGE.len(), "{keys:?}");
        assert_eq!(Scene::hash(SCENE), Scene::hash(&new));
        assert_eq!(Scene::changes("old.toml", &new, SCENE).unwrap().len(), 5, "and back again");
    }

    #[test]
    fn everything_else_is_refused_at_once_in_the_order_of_the_file() {
        let new = with(&[
            ("title = \"One\"", "title = \"Two\""),
            ("spacing = \"4 mm\"", "spacing = \"5 mm\""),
            ("poisson = 0.3\n", "poisson = 0.3\ncone =   \"plane-strain\"\n"),
            ("max = [\"0.1 m\", 0,", "max = [\"0.1 m\",\n  0,"),
            ("\"0.1 m\"] }", "0.12] }"),
            ("slip = \"free-slip\"", "slip = \"no-slip\""),
            ("[initial]\nseed = 9007199254740993\n", ""),
        ]);
        assert_eq!(
            refused(&new),
            [
                "new.toml:1:1: initial.seed: not set now, 9007199254740993 when the run was made; it may not change",
                "new.toml:4:11: spacing: \"5 mm\" now, \"4 mm\" when the run was made; it may not change",
                "new.toml:10:10: material.drucker-prager.cone: \"plane-strain\" now, not set when the run was made; it may not \
                 change",
                "new.toml:15:32: body.column.box.max: [\"0.1 m\", 0, 0.12] now, [\"0.1 m\", 0, \"0.1 m\"] when the run was \
                 made; it may not change",
                "new.toml:28:8: wall.side.slip: \"no-slip\" now, \"free-slip\" when the run was made; it may not change",
            ]
        );
        // A key that is gone is missed where it should be.
        let new = with(&[("friction = \"30 deg\"", "dilation = 0\nfriction = \"30 deg\"")]);
        let error = Scene::changes("a.toml", &new, SCENE).unwrap_err();
        assert_eq!((error.faults[0].line, error.faults[0].column), (6, 11), "{error}");
        // Not the same number of seeds, though the same number as a float.
        assert_eq!(refused(&with(&[("740993", "740992")])).len(), 1);
        // Like all numerical parameters: a run half way in f32 would be the run of no scene.
        let mixed = "[numerics]\nprecision = \"mixed\"\n[end]";
        let message = "numerics.precision: \"mixed\" now, not set when the run was made; it may not change";
        assert!(refused(&with(&[("[end]", mixed)]))[0].ends_with(message));
    }

    #[test]
    fn the_order_of_walls_counts() {
        let floor = &SCENE[SCENE.find("[wall.floor]").unwrap()..SCENE.find("[wall.side]").unwrap()];
        let new = with(&[(floor, ""), ("[initial]", &format!("{floor}[initial]"))]);
        assert_eq!(
            refused(&new),
            [
                "new.toml:16:7: wall: in another order: side, floor now, floor, side when the run was made; it may not change"
            ]
        );
        let named = with(&[("[wall.side]", "[wall.left]")]);
        let keys: Vec<_> = Scene::changes("a", SCENE, &named).unwrap_err().faults.into_iter().map(|f| f.key).collect();
        assert_eq!(keys.iter().filter(|key| key.starts_with("wall.left.")).count(), 4, "{keys:?}");
        assert!(!keys.contains(&"wall".to_string()), "other names say enough: {keys:?}");
    }

    #[test]
    fn a_new_scene_with_faults_of_its_own_is_told_those() {
        let new = with(&[("poisson = 0.3", "poisson = 0.7"), ("\"0.35 s\"", "\"0.35\"")]);
        let error = Scene::changes("new.toml", SCENE, &new).unwrap_err();
        assert!(error.faults.len() == 2 && error.report().contains("must be in [0, 0.5)"), "{error}");
    }

    #[test]
    fn outputs_go_on_at_the_next_multiple() {
        for (interval, time, next) in
            [(0.1, 0.0, 1), (0.1, 0.05, 1), (0.1, 0.1 + 0.2, 4), (0.25, 1.0, 5), (2.0, 1.0, 1)]
        {
            assert_eq!(Output::first_after(interval, time), next, "{interval} after {time}");
        }
        // 0.7 / 0.1 is less than 7.
        assert_eq!(Output::first_after(0.1, 0.7), 8);
    }

    /// The form is for good: files carry its hash.
    #[test]
    fn the_canonical_form() {
        let text = "title = \"t\"\nend.time = 1\nspacing = \"2 mm\"\nsymmetry = ['x']\ngravity = [0, 0, -9.81]\n\
                    [wall.\"my floor\"]\nat = 0\n[wall.a]\nat = \"1.5 km\"\n[body.b]\n";
        let form = "gravity = [0e0, 0e0, -9.81e0]\nspacing = 2e-3\nsymmetry = [\"x\"]\nwall.\"my floor\".at = 0e0\n\
                    wall.a.at = 1.5e3\n[body] b\n[wall] \"my floor\", a\n";
        assert_eq!(canonical(text).as_deref(), Some(form));
        assert_eq!(Scene::hash(text), provenance::sha256(form.as_bytes()));
        assert_eq!(Scene::hash("no = = TOML"), Scene::text_hash("no = = TOML"));
    }
}
