//! Reading of TOML tables by hand: every key is asked for once, every fault is kept with its place, and what nobody
//! asked for is reported with the keys that would have been valid.

use super::Fault;
use crate::units::{self, Dimension};
use std::{cell::RefCell, fmt::Display, ops::Range};
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

/// Faults found so far; shared by all readers of one text.
pub(super) struct Faults<'a> {
    text: &'a str,
    /// Byte offset, key path, message.
    list: RefCell<Vec<(usize, String, String)>>,
    /// Lines with syntax errors: what else is found there is a mere consequence.
    broken: RefCell<Vec<usize>>,
}

/// A value, with the place it was read from.
#[derive(Clone, Debug)]
pub(super) struct Found<T> {
    pub value: T,
    pub span: Range<usize>,
    pub key: String,
}

/// Values that are allowed.
pub(super) struct Allowed {
    /// Ends the sentence "it must be ...".
    pub says: &'static str,
    pub holds: fn(f64) -> bool,
}

pub(super) const ANY: Allowed = Allowed { says: "finite", holds: |_| true };
pub(super) const POSITIVE: Allowed = Allowed { says: "greater than 0", holds: |v| v > 0.0 };
pub(super) const NOT_NEGATIVE: Allowed = Allowed { says: "0 or greater", holds: |v| v >= 0.0 };

impl<'a> Faults<'a> {
    pub fn new(text: &'a str) -> Self {
        Self { text, list: RefCell::default(), broken: RefCell::default() }
    }

    /// A fault at a byte offset.
    pub fn add(&self, offset: usize, key: &str, message: impl Into<String>) {
        if !self.broken.borrow().contains(&self.line_and_column(offset).0) {
            self.list.borrow_mut().push((offset, key.to_string(), message.into()));
        }
    }

    /// A fault of a value.
    pub fn at<T>(&self, found: &Found<T>, message: impl Into<String>) {
        self.add(found.span.start, &found.key, message);
    }

    /// A fault that may be a mere consequence of a syntax error (something is missing or unknown): kept only where
    /// the text has none.
    pub fn structure(&self, offset: usize, key: &str, message: impl Into<String>) {
        if !self.broken() {
            self.add(offset, key, message);
        }
    }

    pub fn syntax(&self, error: &toml::de::Error) {
        let offset = error.span().map_or(0, |span| span.start);
        let line = self.line_and_column(offset).0;
        // Several on a line come from one mistake.
        if self.broken.borrow().contains(&line) {
            return;
        }
        let value = self.text.lines().nth(line - 1).and_then(|l| l.split_once('=')).map_or("", |(_, v)| v.trim());
        let bare = value.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
            && value.split('#').next().is_some_and(|v| v.contains(char::is_alphabetic));
        let hint = if bare { "; a number with a unit goes in quotes, e.g. \"4 mm\"" } else { "" };
        self.add(offset, "", format!("not valid TOML: {}{hint}", error.message()));
        self.broken.borrow_mut().push(line);
    }

    /// Has the text syntax errors?
    pub fn broken(&self) -> bool {
        !self.broken.borrow().is_empty()
    }

    pub fn is_empty(&self) -> bool {
        self.list.borrow().is_empty()
    }

    /// The text a value was read from.
    pub fn source<T>(&self, found: &Found<T>) -> &'a str {
        &self.text[found.span.clone()]
    }

    /// All faults in the order of the file.
    pub fn into_list(self) -> Vec<Fault> {
        let mut list = self.list.take();
        list.sort_by_key(|(offset, ..)| *offset);
        let place = |(offset, key, message)| {
            let (line, column) = self.line_and_column(offset);
            Fault { line, column, key, message }
        };
        list.into_iter().map(place).collect()
    }

    /// Both counted from 1; columns in characters.
    fn line_and_column(&self, offset: usize) -> (usize, usize) {
        let mut end = offset.min(self.text.len());
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        let before = &self.text[..end];
        let start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[start..].chars().count() + 1)
    }
}

/// A table that is being read.
pub(super) struct Table<'a> {
    pub faults: &'a Faults<'a>,
    /// Key path, empty for the whole file.
    pub path: String,
    /// Byte offset of its key.
    pub offset: usize,
    /// None: the file has no such table, and nothing is missing in it.
    entries: Option<&'a DeTable<'a>>,
    asked: RefCell<Vec<&'static str>>,
}

impl<'a> Table<'a> {
    pub fn root(entries: &'a DeTable<'a>, faults: &'a Faults<'a>) -> Self {
        Self { faults, path: String::new(), offset: 0, entries: Some(entries), asked: RefCell::default() }
    }

    /// Path of a key in this table.
    pub fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_string() } else { format!("{}.{key}", self.path) }
    }

    pub fn has(&self, key: &str) -> bool {
        self.entries.is_some_and(|entries| entries.contains_key(key))
    }

    /// Does the file have this table?
    pub fn is_there(&self) -> bool {
        self.entries.is_some()
    }

    /// Byte offset of a key; of the table itself where it has no such key.
    pub fn child_offset(&self, key: &str) -> usize {
        let key_offset = |entries: &'a DeTable<'a>| entries.get_key_value(key).map(|(key, _)| key.span().start);
        self.entries.and_then(key_offset).unwrap_or(self.offset)
    }

    /// The keys that nobody asked for are unknown: says so. To be called once all others have been read.
    pub fn finish(self) {
        let asked = self.asked.borrow();
        for (key, _) in self.entries.into_iter().flatten() {
            if !asked.iter().any(|known| known == key.get_ref()) {
                let what = if self.path.is_empty() { "key or table" } else { "key" };
                let message = unknown(what, key.get_ref(), &asked);
                self.faults.structure(key.span().start, &self.path_of(key.get_ref()), message);
            }
        }
    }

    fn get(&self, key: &'static str) -> Option<Found<&'a DeValue<'a>>> {
        self.asked.borrow_mut().push(key);
        let value = self.entries?.get(key)?;
        Some(Found { value: value.get_ref(), span: value.span(), key: self.path_of(key) })
    }

    /// Reports a key that the table should have.
    fn require(&self, key: &str, what: impl Display) {
        if self.entries.is_some() && !self.has(key) {
            let message = format!("missing; {what} is needed");
            self.faults.structure(self.offset, &self.path_of(key), message);
        }
    }

    /// A quantity in SI units; None where absent or faulty.
    pub fn number(&self, key: &'static str, dimension: Dimension, allowed: &Allowed) -> Option<Found<f64>> {
        self.quantity(self.get(key)?, dimension, allowed)
    }

    /// The same for a key that must be there.
    pub fn needed(&self, key: &'static str, dimension: Dimension, allowed: &Allowed) -> Option<Found<f64>> {
        self.require(key, format!("{} such as {}", dimension.name(), dimension.example()));
        self.number(key, dimension, allowed)
    }

    /// Three quantities.
    pub fn vector(&self, key: &'static str, dimension: Dimension) -> Option<[Found<f64>; 3]> {
        match self.vector_or_number(key, dimension)? {
            Err(vector) => Some(vector),
            Ok(number) => {
                self.faults.at(&number, format!("{} is needed, not one", three(dimension)));
                None
            }
        }
    }

    /// The same for a key that must be there.
    pub fn needed_vector(&self, key: &'static str, dimension: Dimension) -> Option<[Found<f64>; 3]> {
        self.require(key, three(dimension));
        self.vector(key, dimension)
    }

    /// One quantity (`Ok`) or three of them (`Err`).
    pub fn vector_or_number(
        &self,
        key: &'static str,
        dimension: Dimension,
    ) -> Option<Result<Found<f64>, [Found<f64>; 3]>> {
        let found = self.get(key)?;
        let DeValue::Array(items) = found.value else { return self.quantity(found, dimension, &ANY).map(Ok) };
        let read = |item: &'a Spanned<DeValue<'a>>| {
            self.quantity(Found { value: item.get_ref(), span: item.span(), key: found.key.clone() }, dimension, &ANY)
        };
        let items: Vec<_> = items.iter().map(read).collect();
        if items.len() != 3 {
            self.faults.at(&found, format!("has {} values; {} is needed", items.len(), three(dimension)));
            return None;
        }
        let items: Option<Vec<_>> = items.into_iter().collect();
        items?.try_into().ok().map(Err)
    }

    /// A whole number from 0.
    pub fn count(&self, key: &'static str) -> Option<Found<u64>> {
        let found = self.get(key)?;
        let value = match found.value {
            DeValue::Integer(i) => u64::from_str_radix(i.as_str(), i.radix()).ok(),
            _ => None,
        };
        if value.is_none() {
            let message = format!("`{}` is not a whole number from 0 to {}", self.faults.source(&found), i64::MAX);
            self.faults.at(&found, message);
        }
        value.map(|value| Found { value, span: found.span, key: found.key })
    }

    /// A string.
    pub fn text(&self, key: &'static str) -> Option<Found<String>> {
        let found = self.get(key)?;
        match found.value {
            DeValue::String(text) => Some(Found { value: text.to_string(), span: found.span, key: found.key }),
            other => {
                self.faults.at(&found, format!("a string in quotes is needed, not {}", kind(other)));
                None
            }
        }
    }

    /// The same for a key that must be there; `what` is said to be needed.
    pub fn needed_text(&self, key: &'static str, what: &str) -> Option<Found<String>> {
        self.require(key, what);
        self.text(key)
    }

    /// An array of points [x, y].
    pub fn points(&self, key: &'static str, dimension: Dimension) -> Option<Found<Vec<[f64; 2]>>> {
        let found = self.get(key)?;
        let example =
            format!("an array of points [x, y], each of two quantities such as {}, is needed", dimension.example());
        let DeValue::Array(items) = found.value else {
            self.faults.at(&found, format!("{example}, not {}", kind(found.value)));
            return None;
        };
        let mut points = Some(Vec::new());
        for item in items.iter() {
            let of = |value: &Spanned<DeValue<'_>>| Found { value: (), span: value.span(), key: found.key.clone() };
            let DeValue::Array(pair) = item.get_ref() else {
                self.faults.at(&of(item), format!("{example}; this is {}", kind(item.get_ref())));
                points = None;
                continue;
            };
            let read = |value: &'a Spanned<DeValue<'a>>| {
                let found = Found { value: value.get_ref(), span: value.span(), key: found.key.clone() };
                self.quantity(found, dimension, &ANY).map(|found| found.value)
            };
            let pair: Vec<Option<f64>> = pair.iter().map(read).collect();
            match (pair.as_slice(), &mut points) {
                ([Some(x), Some(y)], Some(points)) => points.push([*x, *y]),
                ([_, _], _) => points = None,
                _ => {
                    self.faults.at(&of(item), format!("has {} values; a point has two, [x, y]", pair.len()));
                    points = None;
                }
            }
        }
        points.map(|value| Found { value, span: found.span, key: found.key })
    }

    /// One of several names.
    pub fn choice<T: Copy>(&self, key: &'static str, choices: &[(&str, T)]) -> Option<Found<T>> {
        let found = self.get(key)?;
        self.chosen(found, choices)
    }

    /// The same for a key that must be there.
    pub fn needed_choice<T: Copy>(&self, key: &'static str, choices: &[(&str, T)]) -> Option<Found<T>> {
        self.require(key, format!("one of {}", quoted(&choices.iter().map(|c| c.0).collect::<Vec<_>>())));
        self.choice(key, choices)
    }

    /// An array of names; empty where absent.
    pub fn choices<T: Copy>(&self, key: &'static str, choices: &[(&str, T)]) -> Vec<Found<T>> {
        let Some(found) = self.get(key) else { return Vec::new() };
        let DeValue::Array(items) = found.value else {
            let names = quoted(&choices.iter().map(|c| c.0).collect::<Vec<_>>());
            self.faults.at(&found, format!("an array of names is needed, from {names}, not {}", kind(found.value)));
            return Vec::new();
        };
        let one = |item: &'a Spanned<DeValue<'a>>| {
            self.chosen(Found { value: item.get_ref(), span: item.span(), key: found.key.clone() }, choices)
        };
        items.iter().filter_map(one).collect()
    }

    fn chosen<T: Copy>(&self, found: Found<&DeValue<'_>>, choices: &[(&str, T)]) -> Option<Found<T>> {
        let names: Vec<_> = choices.iter().map(|choice| choice.0).collect();
        let DeValue::String(text) = found.value else {
            self.faults.at(&found, format!("one of {} is needed, not {}", quoted(&names), kind(found.value)));
            return None;
        };
        let choice = choices.iter().find(|choice| choice.0 == text);
        if choice.is_none() {
            self.faults.at(&found, unknown("name", text, &names));
        }
        choice.map(|choice| Found { value: choice.1, span: found.span, key: found.key })
    }

    /// A table within this one; empty where absent.
    pub fn child(&self, key: &'static str) -> Self {
        let found = self.get(key);
        let offset = self.child_offset(key);
        let entries = found.and_then(|found| match found.value {
            DeValue::Table(entries) => Some(entries),
            other => {
                self.faults.at(&found, format!("a table is needed, not {}", kind(other)));
                None
            }
        });
        Self { faults: self.faults, path: self.path_of(key), offset, entries, asked: RefCell::default() }
    }

    /// The same for a table that must be there.
    pub fn needed_child(&self, key: &'static str) -> Self {
        self.require(key, format!("a table [{}]", self.path_of(key)));
        self.child(key)
    }

    /// Name and content of the tables within a table of named tables, in the order of the file.
    pub fn named(&self, key: &'static str) -> Vec<(String, Self)> {
        let group = self.child(key);
        let mut entries: Vec<_> = group.entries.into_iter().flatten().collect();
        entries.sort_by_key(|(name, _)| name.span().start);
        let one = |(name, value): (&'a Spanned<_>, &'a Spanned<DeValue<'a>>)| {
            let name_text: &std::borrow::Cow<'a, str> = name.get_ref();
            let path = group.path_of(name_text);
            let DeValue::Table(entries) = value.get_ref() else {
                let message = format!("a table [{path}] is needed, not {}", kind(value.get_ref()));
                self.faults.add(value.span().start, &path, message);
                return None;
            };
            let offset = name.span().start;
            let table = Self { faults: self.faults, path, offset, entries: Some(entries), asked: RefCell::default() };
            Some((name_text.to_string(), table))
        };
        entries.into_iter().filter_map(one).collect()
    }

    fn quantity(&self, found: Found<&DeValue<'_>>, dimension: Dimension, allowed: &Allowed) -> Option<Found<f64>> {
        let value = match found.value {
            DeValue::String(text) => units::parse(text, dimension),
            // TOML has four notations for integers; only the decimal one can be beyond i64 in size, and is refused then.
            DeValue::Integer(i) => match i64::from_str_radix(i.as_str(), i.radix()) {
                Ok(value) => Ok(value as f64),
                Err(_) => Err(format!("`{i}` is too large for a whole number; write it with a decimal point")),
            },
            DeValue::Float(f) => match f.as_str().parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(format!("`{f}` is not a finite number")),
            },
            other => {
                Err(format!("{} such as {} is needed, not {}", dimension.name(), dimension.example(), kind(other)))
            }
        };
        let value = match value {
            Ok(value) if (allowed.holds)(value) => value,
            Ok(_) => {
                let source = self.faults.source(&found);
                self.faults.at(&found, format!("{source} is out of range; it must be {}", allowed.says));
                return None;
            }
            Err(message) => {
                self.faults.at(&found, message);
                return None;
            }
        };
        // Minus zero is zero.
        Some(Found { value: value + 0.0, span: found.span, key: found.key })
    }
}

/// The values of three quantities.
pub(super) fn values(vector: &[Found<f64>; 3]) -> [f64; 3] {
    vector.each_ref().map(|component| component.value)
}

/// Message for a name that is none of `known`.
pub(super) fn unknown(what: &str, name: &str, known: &[&str]) -> String {
    let nearest = known.iter().map(|k| (edits(name, k), k)).min();
    let hint = match nearest {
        Some((edits, k)) if edits <= 1 + name.len() / 4 => format!("did you mean `{k}`? "),
        _ => String::new(),
    };
    format!("unknown {what} `{name}`; {hint}valid: {}", known.join(", "))
}

fn quoted(names: &[&str]) -> String {
    names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
}

fn three(dimension: Dimension) -> String {
    format!("an array [x, y, z] of three quantities, each {},", dimension.name())
}

fn kind(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a string",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "an array",
        DeValue::Table(_) => "a table",
    }
}

/// Levenshtein distance: how many letters differ, are missing, or are too many.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let change = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = change.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
