//! The scene, and who made what.

use super::html::{escape, number, quantity, table};
use crate::analysis::Analysis;
use formats::{folder::RunFolder, provenance};
use toml::{Table, Value};

/// Every key of the scene with its value, what follows from them, and the text as it is.
pub fn scene(a: &Analysis) -> String {
    let mut rows = Vec::new();
    // The scene was read before, so this is a table.
    flatten("", &a.text.parse::<Table>().unwrap_or_default(), &mut rows);
    let g = &a.geometry;
    let last = a.last();
    let or_dash = |value: Option<f64>, unit: &str| quantity(value.unwrap_or(f64::NAN), unit);
    let derived = [
        ("particles", last.particles.to_string()),
        ("smoothing length h", quantity(g.h, "m")),
        ("extent of the body r0 or L0", or_dash(g.r0(), "m")),
        ("initial height H0", quantity(g.height, "m")),
        ("time scale T = sqrt(H0/g)", or_dash(g.time_scale(), "s")),
        ("share of the whole that is modelled", number(g.modelled())),
        ("height at which basal stresses are taken", quantity(a.level, "m")),
        ("speed below which material is static", quantity(a.static_speed, "m/s")),
    ];
    let derived = derived.into_iter().map(|(name, value)| vec![name.to_string(), value]);
    let choices = a.scene.chosen.iter().flat_map(|chosen| &chosen.choices);
    let chosen =
        choices.map(|choice| vec![format!("chosen: {}", choice.key), format!("{}: {}", choice.value, choice.why)]);
    let derived: Vec<Vec<String>> = chosen.chain(derived).collect();
    format!(
        "<h3>Keys that the scene sets</h3>\n{}<h3>What follows</h3>\n{}\
         <details>\n<summary>The scene file, SHA-256 {}</summary>\n<pre>{}</pre>\n</details>\n",
        table(&[], &rows),
        table(&[], &derived),
        a.hash,
        escape(&a.text)
    )
}

fn flatten(path: &str, found: &Table, rows: &mut Vec<Vec<String>>) {
    for (key, value) in found {
        let name = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        match value {
            Value::Table(inner) => flatten(&name, inner, rows),
            Value::String(text) => rows.push(vec![name, text.clone()]),
            other => rows.push(vec![name, other.to_string()]),
        }
    }
}

/// Every launch of a program, from `provenance.json`.
pub fn provenance(run: &RunFolder) -> String {
    let entries = match provenance::read(&run.provenance()) {
        Ok(entries) => entries,
        Err(error) => return format!("<p>{}</p>\n", escape(&error.to_string())),
    };
    if entries.is_empty() {
        return "<p>There is no provenance.json.</p>\n".into();
    }
    let rows: Vec<Vec<String>> = entries
        .into_iter()
        .map(|e| {
            let libraries: Vec<String> =
                e.build.libraries.iter().map(|(name, version)| format!("{name} {version}")).collect();
            vec![
                format!("{} {}", e.program, e.build.version),
                e.time,
                e.ranks.to_string(),
                e.host,
                e.build.commit,
                format!("{}; {}", e.build.compiler, e.build.profile),
                libraries.join("; "),
                e.command.join(" "),
            ]
        })
        .collect();
    let headings = ["program", "when (UTC)", "ranks", "host", "commit", "build", "libraries", "command"];
    format!("<div style=\"overflow-x:auto\">\n{}</div>\n", table(&headings, &rows))
}
