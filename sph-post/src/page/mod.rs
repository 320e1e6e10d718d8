//! The report of a run as one file for a browser: `post/report.html`, with all pictures inside. It needs no other file, no
//! network and no script, and is well-formed XML. It is made from whatever is there, of unfinished runs, too.

mod course;
mod figures;
mod html;
mod numbers;
mod settings;
mod warnings;

use crate::{analysis::Analysis, failure::Failure};
use formats::{disk, folder::RunFolder};
use html::{escape, section};
use std::path::PathBuf;

/// What the page looks like, on paper also.
const STYLE: &str = "\
body{font:15px/1.5 system-ui,sans-serif;color:#222;background:#fff;max-width:1180px;margin:0 auto;padding:1.5em}
h1{font-size:1.6em;margin:0 0 .2em}h2{font-size:1.25em;border-bottom:1px solid #ccc;margin:2em 0 .8em}h3{font-size:1em;margin:1.4em 0 .4em}
table{border-collapse:collapse;margin:.6em 0 1em}th,td{padding:.2em .9em .2em 0;text-align:left;vertical-align:top;border-bottom:1px solid #e4e4e4}
tbody th{font-weight:normal}td{font-variant-numeric:tabular-nums;overflow-wrap:anywhere}nav a{margin-right:1.1em}
.state{font-size:1.05em}.warnings li{background:#fff4d6;border-left:4px solid #d55e00;padding:.3em .7em;margin:.3em 0;list-style:none}
.warnings ul{padding:0}figure{margin:1.2em 0 2em}figure svg{max-width:100%;height:auto;display:block}figcaption{color:#444}
pre{background:#f6f6f6;padding:.8em;overflow-x:auto;font-size:13px}.bar{background:#0072b2;height:.75em;display:inline-block}
@media print{figure,table{break-inside:avoid}nav{display:none}}";

/// Writes the report and returns its path. `pictures` are the paths of all pictures; those in SVG are shown.
///
/// # Errors
/// A picture that can't be read; a page that can't be written.
pub fn write(a: &Analysis, run: &RunFolder, pictures: &[PathBuf]) -> Result<PathBuf, Failure> {
    let course = course::Course::read(run);
    let warnings = warnings::all(a, run, &course);
    let warnings = if warnings.is_empty() { "<p>None.</p>\n".to_string() } else { html::list(&warnings) };
    let parts = [
        ("results", "Run-out and deposit", numbers::deposit(a)),
        ("energies", "Energies", numbers::energies(a)),
        ("figures", "Figures", figures::all(pictures)?),
        ("course", "Course and timings", course.page()),
        ("settings", "Settings", settings::scene(a)),
        ("provenance", "Provenance", settings::provenance(run)),
    ];
    let title = if a.scene.title.is_empty() { "A run without a title" } else { &a.scene.title };
    let links: String = [("warnings", "Warnings")]
        .into_iter()
        .chain(parts.iter().filter(|p| !p.2.is_empty()).map(|p| (p.0, p.1)))
        .map(|(name, heading)| format!("<a href=\"#{name}\">{heading}</a>\n"))
        .collect();
    let body: String = parts.iter().map(|(name, heading, body)| section(name, heading, body)).collect();
    let page = format!(
        "<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\"/>\n\
         <title>{title}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n\
         <p class=\"state\">{state}</p>\n<nav>\n{links}</nav>\n</header>\n\
         <section id=\"warnings\" class=\"warnings\">\n<h2>Warnings</h2>\n{warnings}</section>\n{body}\
         <footer><p>Made by sph-post {version}. SI units; tension is positive. Numbers are of the modelled part, \
         per metre of depth in plane strain.</p></footer>\n</body>\n</html>\n",
        title = escape(title),
        state = escape(&course.state(a, run)),
        version = env!("CARGO_PKG_VERSION"),
    );
    let path = run.post().join("report.html");
    disk::write_atomic(&path, page.as_bytes())?;
    Ok(path)
}
