//! The pictures, inside the page.

use super::html::escape;
use crate::failure::Failure;
use formats::snapshot::FileError;
use std::path::PathBuf;

/// What pictures show, by the name of their files. Those of one analysis stand together.
const CAPTIONS: [(&str, &str); 18] = [
    ("profiles", "Surface of the deposit at all snapshots, or at 21 of them."),
    ("surfaces", "The surface at the times that papers show, and in the end."),
    ("front", "Front over time by its three definitions."),
    ("run-out", "The true run-out of single particles against the effective one of the continuous deposit."),
    ("time-series", "Run-out and energies over time."),
    ("energies", "Where the potential energy went, and whether the energies add up."),
    ("particles", "Speed of the particles."),
    ("layers-horizontal", "Where the horizontal layers of the start went."),
    ("layers-vertical", "Where the vertical layers of the start went."),
    ("static", "Static and flowing material, and the interface between them."),
    ("static-share", "Share of the volume that is static."),
    ("failure-plane", "The failure plane of a column that begins to fall."),
    ("top-view", "Height of the surface from above."),
    ("inertial-number", "Inertial number inside the flow."),
    ("shear-rate", "Shear rate inside the material."),
    ("stress-sections", "Vertical stress inside the material."),
    ("basal-stress", "Stress near the floor, and the weight of the column above."),
    ("basal-stress-normalised", "The dip of the pressure below the centre."),
];

/// All of them.
pub fn all(pictures: &[PathBuf]) -> Result<String, Failure> {
    let mut out = String::new();
    for path in pictures.iter().filter(|path| path.extension().is_some_and(|e| e == "svg")) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let text = std::fs::read_to_string(path).map_err(|error| FileError::reading(path, &error))?;
        let caption = caption(&name);
        let from = text.find("<svg").unwrap_or(0);
        let label = escape(&caption);
        // Read aloud, it is one picture with that name.
        let picture = text[from..].replacen("<svg", &format!("<svg role=\"img\" aria-label=\"{label}\""), 1);
        out.push_str(&format!(
            "<figure id=\"figure-{name}\">\n{}\n<figcaption>{label} <code>{name}.svg</code></figcaption>\n</figure>\n",
            picture.trim_end()
        ));
    }
    Ok(out)
}

fn caption(name: &str) -> String {
    if let Some((_, caption)) = CAPTIONS.iter().find(|c| c.0 == name) {
        return (*caption).into();
    }
    match name.strip_prefix("particles-") {
        Some(field) => format!("Particles coloured by {}.", field.replace('_', " ")),
        None => format!("{}.", name.replace('-', " ")),
    }
}
