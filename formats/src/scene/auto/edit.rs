//! Edits of a parsed document: what somebody would change who writes the smaller scene by hand. Keys keep their places
//! in the text, so that a fault of the edited document is told where its cause stands.

use crate::{scene::Scene, space::Space};
use toml::{
    Spanned,
    de::{DeArray, DeTable, DeValue},
};

/// One change. Bodies and walls are counted in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Edit {
    Space(Space),
    /// One more plane of symmetry.
    AddPlane(usize),
    /// One less; both, where the axis is implied.
    DropPlane(usize),
    DropWall(usize),
    DropBody(usize),
    DropPeriod(usize),
    /// A component of one of the vectors of a body's shape, m.
    Component {
        body: usize,
        shape: &'static str,
        key: &'static str,
        axis: usize,
        value: f64,
    },
}

/// Makes all edits; `scene` is that of the document before.
pub(super) fn apply(document: &mut DeTable<'_>, scene: &Scene, edits: &[Edit]) {
    // Numbers are those before the first edit.
    let (bodies, walls) = (names(document, "body"), names(document, "wall"));
    let mut planes = scene.symmetry;
    for edit in edits {
        match *edit {
            Edit::Space(space) => set_text(document, &["space"], space.name()),
            Edit::AddPlane(axis) => planes[axis] = true,
            Edit::DropPlane(axis) => planes[axis] = false,
            Edit::DropWall(wall) => remove(document, &["wall", &walls[wall]]),
            Edit::DropBody(body) => remove(document, &["body", &bodies[body]]),
            Edit::DropPeriod(axis) => remove(document, &["periodic", ["x", "y"][axis]]),
            Edit::Component { body, shape, key, axis, value } => {
                let array = entry(document, &["body", &bodies[body], shape, key]);
                if let Some(DeValue::Array(items)) = array.map(Spanned::get_mut)
                    && let Some(item) = items.get_mut(axis)
                {
                    let span = item.span();
                    *item = Spanned::new(span, DeValue::String(format!("{value:e} m").into()));
                }
            }
        }
    }
    if planes != scene.symmetry {
        let mut names = DeArray::new();
        for (name, _) in ["x", "y"].into_iter().zip(planes).filter(|(_, is)| *is) {
            names.push(Spanned::new(0..0, DeValue::String(name.into())));
        }
        set(document, &["symmetry"], DeValue::Array(names));
    }
}

/// The value at a path, if it is text.
pub(super) fn text_at<'d>(document: &'d DeTable<'_>, path: &[&str]) -> Option<&'d str> {
    match find(document, path)?.get_ref() {
        DeValue::String(text) => Some(text),
        _ => None,
    }
}

pub(super) fn is_auto(document: &DeTable<'_>, path: &[&str]) -> bool {
    text_at(document, path) == Some("auto")
}

pub(super) fn has(document: &DeTable<'_>, path: &[&str]) -> bool {
    find(document, path).is_some()
}

/// Byte offset of the value at a path.
pub(super) fn place(document: &DeTable<'_>, path: &[&str]) -> usize {
    find(document, path).map_or(0, |value| value.span().start)
}

/// Sets a key to a text: at the place of the value that it has, at the beginning of the file where it has none.
pub(super) fn set_text(document: &mut DeTable<'_>, path: &[&str], text: &str) {
    set(document, path, DeValue::String(text.to_string().into()));
}

pub(super) fn remove(document: &mut DeTable<'_>, path: &[&str]) {
    let [tables @ .., last] = path else { return };
    if let Some(table) = table(document, tables) {
        table.remove(*last);
    }
}

fn set<'i>(document: &mut DeTable<'i>, path: &[&str], value: DeValue<'i>) {
    if let Some(old) = entry(document, path) {
        *old = Spanned::new(old.span(), value);
        return;
    }
    let [tables @ .., last] = path else { return };
    if let Some(table) = table(document, tables) {
        table.insert(Spanned::new(0..0, last.to_string().into()), Spanned::new(0..0, value));
    }
}

fn find<'d, 'i>(document: &'d DeTable<'i>, path: &[&str]) -> Option<&'d Spanned<DeValue<'i>>> {
    let [tables @ .., last] = path else { return None };
    let mut table = document;
    for name in tables {
        let DeValue::Table(inner) = table.get(*name)?.get_ref() else { return None };
        table = inner;
    }
    table.get(*last)
}

fn table<'d, 'i>(document: &'d mut DeTable<'i>, path: &[&str]) -> Option<&'d mut DeTable<'i>> {
    let mut table = document;
    for name in path {
        let DeValue::Table(inner) = table.get_mut(*name)?.get_mut() else { return None };
        table = inner;
    }
    Some(table)
}

fn entry<'d, 'i>(document: &'d mut DeTable<'i>, path: &[&str]) -> Option<&'d mut Spanned<DeValue<'i>>> {
    let [tables @ .., last] = path else { return None };
    table(document, tables)?.get_mut(*last)
}

/// Names in a table of named tables, in the order of the file.
fn names(document: &DeTable<'_>, key: &str) -> Vec<String> {
    let Some(DeValue::Table(group)) = document.get(key).map(Spanned::get_ref) else { return Vec::new() };
    let mut all: Vec<_> = group.iter().map(|(name, _)| (name.span().start, name.get_ref().to_string())).collect();
    all.sort();
    all.into_iter().map(|(_, name)| name).collect()
}
