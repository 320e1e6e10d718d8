//! The report for a browser: one file that needs nothing else, of whatever there is of a run.

use super::{Made, SCENES, block, post, spreading};
use formats::{exit, journal::Event};
use roxmltree::{Document, Node, ParsingOptions};
use std::path::Path;

const XHTML: &str = "http://www.w3.org/1999/xhtml";
const SVG: &str = "http://www.w3.org/2000/svg";

fn page(made: &Made) -> String {
    std::fs::read_to_string(made.run.post().join("report.html")).unwrap()
}

fn parsed(text: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).unwrap_or_else(|error| panic!("not well-formed: {error}"))
}

/// All text below a node.
fn words(node: Node) -> String {
    node.descendants().filter(Node::is_text).filter_map(|n| n.text()).collect::<Vec<_>>().join(" ")
}

fn of_id<'a>(document: &'a Document, id: &str) -> Node<'a, 'a> {
    document.descendants().find(|n| n.attribute("id") == Some(id)).unwrap_or_else(|| panic!("no #{id}"))
}

/// What a browser would fetch, run or take from elsewhere.
fn needs(document: &Document, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for node in document.descendants().filter(Node::is_element) {
        let name = node.tag_name().name();
        if ["script", "link", "img", "image", "iframe", "object", "embed", "base", "use", "audio", "video"]
            .contains(&name)
        {
            found.push(format!("<{name}>"));
        }
        for attribute in node.attributes() {
            let (key, value) = (attribute.name(), attribute.value());
            let inside = key == "href" && value.starts_with('#') && {
                of_id(document, &value[1..]);
                true
            };
            let elsewhere = ["://", "url(", "data:", "@import"].iter().any(|word| value.contains(word));
            if (["src", "srcset", "href", "data", "action"].contains(&key) && !inside)
                || key.starts_with("on")
                || elsewhere
            {
                found.push(format!("{key}=\"{value}\""));
            }
        }
        if name == "style" && ["url(", "@import"].iter().any(|word| words(node).contains(word)) {
            found.push("an asset in <style>".into());
        }
    }
    // The names of the two languages are the only addresses.
    let without_names = text.replace(&format!("xmlns=\"{XHTML}\""), "").replace(&format!("xmlns=\"{SVG}\""), "");
    found.extend(
        ["http://", "https://", "//www"].iter().filter(|w| without_names.contains(**w)).map(ToString::to_string),
    );
    found
}

fn pictures(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter_map(|n| n.strip_suffix(".svg").map(str::to_owned)).collect();
    names.sort();
    names
}

#[test]
fn the_report_is_one_well_formed_file_with_every_picture_inside() {
    for scene in SCENES {
        let made = Made::new(scene.text);
        spreading(&made);
        let called = post(made.run.path(), &[]);
        assert_eq!(called.code, Some(exit::DONE), "{}", called.err);
        let text = page(&made);
        let document = parsed(&text);
        assert!(text.starts_with("<!DOCTYPE html>\n<html") && document.root_element().has_tag_name((XHTML, "html")));
        assert_eq!(needs(&document, &text), [""; 0], "{}", scene.name);
        let figures: Vec<Node> = document.descendants().filter(|n| n.has_tag_name((XHTML, "figure"))).collect();
        let mut shown: Vec<String> =
            figures.iter().map(|f| f.attribute("id").unwrap().trim_start_matches("figure-").to_owned()).collect();
        shown.sort();
        assert_eq!(shown, pictures(&made.run.post()), "{}", scene.name);
        for figure in figures {
            let drawing =
                figure.children().find(|n| n.has_tag_name((SVG, "svg"))).expect("a picture inside the figure");
            assert!(drawing.descendants().filter(Node::is_element).count() > 10);
            assert!(drawing.attribute("aria-label").is_some_and(|label| label.ends_with('.')));
            assert!(!words(figure.last_element_child().unwrap()).is_empty());
        }
        for section in ["warnings", "results", "energies", "figures", "course", "settings", "provenance"] {
            assert!(words(of_id(&document, section)).len() > 20, "{section}");
        }
        // The made-up history loses half of the potential energy, a tenth of it to the viscosity, and closes.
        let energies = words(of_id(&document, "energies"));
        assert!(energies.contains("(45.0 %)") && energies.contains("(5.0 %)"), "{energies}");
        let settings = words(of_id(&document, "settings"));
        assert!(settings.contains("material.drucker-prager.friction") && settings.contains("30 deg"), "{settings}");
        assert!(settings.contains(scene.text.trim()), "the scene is there as it is");
        // Of columns with a law the law's numbers stand beside.
        let results = words(of_id(&document, "results"));
        let law = if scene.name == "plane-strain" { "1.2 (Lube et al. (2005)" } else { "1.24 (Lube et al. (2004)" };
        assert!(results.contains(law), "{}: {results}", scene.name);
    }
}

#[test]
fn an_unfinished_run_says_how_far_it_is() {
    let made = Made::new(SCENES[1].text);
    made.initial(&block(&made.scene));
    let state = || {
        assert_eq!(post(made.run.path(), &["--quiet"]).code, Some(exit::DONE));
        let text = page(&made);
        let document = parsed(&text);
        let state = document.descendants().find(|n| n.attribute("class") == Some("state")).unwrap();
        (words(state), words(of_id(&document, "warnings")), words(of_id(&document, "course")))
    };
    // Prepared only: neither logs nor provenance.
    let (far, warnings, course) = state();
    assert!(far.contains("Unfinished: t = 0 of 0.4 s (0 %)"), "{far}");
    assert!(warnings.contains("not reached its end") && course.contains("no logs"), "{warnings} {course}");
    // On its way: the log is ahead of the snapshots.
    std::fs::create_dir_all(made.run.log()).unwrap();
    let progress = r#"{"time":0.1,"end":0.4,"step":9,"time_step":1e-5,"particles":625,"ranks":2,"rate":1.0,"elapsed":1.0,
        "left":3.0,"updated":"2026-01-01T00:00:00Z","job":null,"deadline":null}"#;
    std::fs::write(made.run.progress(), progress).unwrap();
    let mut event = Event::now("start", 0, 0.0, 2);
    event.what = "pairs in <f64> & \"lanes\"".into();
    event.append(&made.run).unwrap();
    let phases = "step [1],steps [1],particle_steps [1],ranks [1],loop [s],lists [s],halo [s],memory_largest [B],\
                  memory_sum [B],neighbours [1]\n9,9,5625,2,4.0,3.0,1.0,1000000,2000000,20.5\n";
    std::fs::write(made.run.log().join("phases.csv"), phases).unwrap();
    let rates = "time [s],step [1],wall [s],particle_steps_per_second [1/s],imbalance [1],ranks [1]\n0,0,0,0,1,2\n1,9,1,9e6,1.75,2\n";
    std::fs::write(made.run.log().join("performance.csv"), rates).unwrap();
    let (far, warnings, course) = state();
    assert!(far.contains("t = 0.1 of 0.4 s (25 %)"), "{far}");
    assert!(warnings.contains("1.75 times the mean"), "{warnings}");
    for word in ["pairs in <f64> & \"lanes\"", "75.0 %", "4.0 s in the loop", "2 MB", "9.000e6"] {
        assert!(course.contains(word), "{word} in {course}");
    }
    // Stopped, then failed, then done.
    std::fs::write(made.run.to_continue(), "the wall limit is near\n").unwrap();
    assert!(state().0.contains("Stopped at t = 0.1 of 0.4 s (25 %): the wall limit is near"));
    std::fs::write(made.run.out().join("fault.hdf"), "").unwrap();
    assert!(state().1.contains("The computation failed"));
    std::fs::remove_file(made.run.out().join("fault.hdf")).unwrap();
    std::fs::write(made.run.done(), "").unwrap();
    let (far, warnings, _) = state();
    assert!(far.starts_with("Finished") && !warnings.contains("not reached"), "{far} {warnings}");
}

/// The tests above would find what must not be there.
#[test]
fn what_a_page_needs_is_found() {
    let found = |body: &str| {
        let text = format!("<html xmlns=\"{XHTML}\"><body id=\"b\">{body}</body></html>");
        needs(&parsed(&text), &text)
    };
    assert_eq!(found("<a href=\"#b\">text</a>"), [""; 0]);
    for body in [
        "<script>1</script>",
        "<img src=\"a.png\"/>",
        "<a href=\"https://example.org\">a</a>",
        "<p style=\"background:url(a.png)\">a</p>",
        "<style>@import 'a.css';</style>",
        "<p onclick=\"x()\">a</p>",
        "<p>see http://example.org</p>",
    ] {
        assert!(!found(body).is_empty(), "{body}");
    }
}
