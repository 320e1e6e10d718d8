//! From a scene's template to a scene: placeholders, and keys that a series or a variant sets.
//!
//! `{aspect}` and `{6*sqrt(r0*aspect/9.81)}` are placeholders. Inline tables of TOML are not: a placeholder has no `=`, and no
//! braces, inside. The scene is written out anew, with sorted keys and without remarks, so that it stays the same to the byte
//! where only the remarks of its template change.

use super::expression;
use toml::{Table, Value as Toml};

/// Value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number.
    Number(f64),
    /// Text, such as the name of a cone or of a variant.
    Text(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{}", tidy(*number)),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// Names and values that fill placeholders.
pub type Values = [(String, Value)];

/// The scene of a template: `text` with its placeholders filled, and each of `sets` laid over it.
pub fn scene(text: &str, sets: &[&Table], values: &Values) -> Result<String, String> {
    let mut scene: Table = expand(text, values)?.parse().map_err(|e: toml::de::Error| e.to_string())?;
    for set in sets {
        overlay(&mut scene, set, values)?;
    }
    toml::to_string(&scene).map_err(|e| e.to_string())
}

/// A number without the dust of binary arithmetic: twelve digits.
pub fn tidy(number: f64) -> f64 {
    format!("{number:.11e}").parse().unwrap_or(number)
}

/// Number of a parameter by name; not-a-number for text.
pub fn number(values: &Values, name: &str) -> Option<f64> {
    values.iter().find(|(known, _)| known == name).map(|(_, value)| match value {
        Value::Number(number) => *number,
        Value::Text(_) => f64::NAN,
    })
}

fn expand(text: &str, values: &Values) -> Result<String, String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(begin) = rest.find('{') {
        let after = &rest[begin + 1..];
        let end = after.find(['{', '}', '=', '\n']).filter(|&end| after[end..].starts_with('}'));
        match end {
            Some(end) if !after[..end].trim().is_empty() => {
                out += &rest[..begin];
                out += &filled(after[..end].trim(), values)?.to_string();
                rest = &after[end + 1..];
            }
            _ => {
                out += &rest[..=begin];
                rest = after;
            }
        }
    }
    Ok(out + rest)
}

fn filled(placeholder: &str, values: &Values) -> Result<Value, String> {
    if let Some((_, value @ Value::Text(_))) = values.iter().find(|(name, _)| name == placeholder) {
        return Ok(value.clone());
    }
    let value = expression::evaluate(placeholder, &|name| number(values, name))?;
    match value.is_finite() {
        true => Ok(Value::Number(value)),
        false => Err(format!("`{{{placeholder}}}` is not a finite number")),
    }
}

fn overlay(scene: &mut Table, set: &Table, values: &Values) -> Result<(), String> {
    for (key, value) in set {
        match (scene.get_mut(key), value) {
            (Some(Toml::Table(below)), Toml::Table(above)) => overlay(below, above, values)?,
            (_, Toml::Table(above)) => {
                let mut fresh = Table::new();
                overlay(&mut fresh, above, values)?;
                scene.insert(key.clone(), Toml::Table(fresh));
            }
            // Text that is one placeholder becomes its value: young = "{5.98e6*stiffness}".
            (_, Toml::String(text)) => {
                let inner =
                    text.strip_prefix('{').and_then(|t| t.strip_suffix('}')).filter(|t| !t.contains(['{', '}']));
                let value = match inner.map(|inner| filled(inner, values)).transpose()? {
                    Some(Value::Number(number)) => Toml::Float(tidy(number)),
                    Some(Value::Text(text)) => Toml::String(text),
                    None => Toml::String(expand(text, values)?),
                };
                scene.insert(key.clone(), value);
            }
            (_, other) => {
                scene.insert(key.clone(), other.clone());
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values() -> Vec<(String, Value)> {
        vec![("a".into(), Value::Number(0.35)), ("cone".into(), Value::Text("extension".into()))]
    }

    #[test]
    fn placeholders_are_filled_and_inline_tables_left() {
        let text = "title = \"a = {a}\" # {nothing = here}\nc = { radius = 0.1, height = {0.1*a} }\nk = \"{cone}\"";
        let scene: Table = scene(text, &[], &values()).unwrap().parse().unwrap();
        assert_eq!(scene["title"].as_str(), Some("a = 0.35"));
        // 0.1*0.35 is 0.034999999999999996 in binary.
        assert_eq!(scene["c"]["height"].as_float(), Some(0.035));
        assert_eq!(scene["k"].as_str(), Some("extension"));
        for (wrong, fault) in [("x = {b}", "`b` is not known"), ("x = {1/0}", "not a finite"), ("x = ", "TOML")] {
            let found = super::scene(wrong, &[], &values()).unwrap_err();
            assert!(found.contains(fault), "{found}");
        }
    }

    #[test]
    fn what_is_set_lies_over_the_template() {
        let text = "s = 1\n[m.law]\nyoung = 2.0\nkept = 3\n";
        let set: Table = "[m.law]\nyoung = \"{10*a}\"\ncone = \"{cone}\"\n[n]\ngate = 0.98".parse().unwrap();
        let text = scene(text, &[&set], &values()).unwrap();
        assert_eq!(text, "s = 1\n\n[m.law]\ncone = \"extension\"\nkept = 3\nyoung = 3.5\n\n[n]\ngate = 0.98\n");
        // Remarks change nothing.
        assert_eq!(scene(&format!("# remark\n{text}"), &[], &values()).unwrap(), text);
    }
}
