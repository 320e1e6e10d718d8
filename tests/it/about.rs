//! What the programs say about themselves, and how: completions, manual pages, explanations, colours.

use formats::exit;
use std::process::Command;
use tests::{TIME_LIMIT, WorkFolder, expect_program, program, run_within};

const PROGRAMS: [&str; 3] = ["sph-prep", "sph-run", "sph-post"];

#[test]
fn completions_and_manual_pages_are_sound() {
    let work = WorkFolder::new();
    for name in PROGRAMS {
        let asked =
            |words: &[&str]| run_within(TIME_LIMIT, Command::new(program(name)).args(words)).expect(exit::DONE).stdout;
        let script = work.write(&format!("{name}.bash"), &asked(&["--completions", "bash"]));
        // Bash itself completes an option with it.
        let complete = format!(
            "source '{}'; set -- $(complete -p {name}); while [ \"$1\" != -F ]; do shift; done; COMP_WORDS=({name} --comp); \
             COMP_CWORD=1; $2 {name} --comp {name}; echo \"${{COMPREPLY[@]}}\"",
            script.display()
        );
        let said = run_within(TIME_LIMIT, Command::new("bash").args(["--norc", "-c", &complete])).expect(exit::DONE);
        assert!(said.stdout.split_whitespace().any(|word| word == "--completions"), "{name}: {said}");
        let page = asked(&["--man"]);
        assert!(page.contains(&format!(".TH {name} 1")) && page.contains("Exit codes"), "{page}");
        let help = asked(&["--help"]);
        for option in help.split_whitespace().filter(|word| word.starts_with("--") && !word.contains('[')) {
            let option = option.trim_end_matches(|c: char| !c.is_ascii_alphanumeric());
            assert!(page.contains(&option.replace('-', "\\-")), "{name}: {option} is not in the manual page");
        }
        let wrong = run_within(TIME_LIMIT, Command::new(program(name)).args(["--completions", "csh"]));
        assert!(wrong.code == exit::USAGE && wrong.stdout.is_empty(), "{wrong}");
    }
}

#[test]
fn every_case_can_be_explained_in_plain_words() {
    let cases = std::fs::read_dir(tests::repository().join("workflows/cases")).unwrap();
    let scenes: Vec<_> =
        cases.map(|case| case.unwrap().path().join("scene.toml")).filter(|path| path.is_file()).collect();
    assert!(scenes.len() > 5);
    for scene in scenes {
        let said =
            run_within(TIME_LIMIT, Command::new(program("sph-prep")).arg("explain").arg(&scene)).expect(exit::DONE);
        for words in ["What it is", "What comes out", "particles", "What it leaves out", "particle-steps"] {
            assert!(said.stdout.contains(words), "{}: {words} in {said}", scene.display());
        }
        assert_eq!(said.stderr, "");
    }
    let work = WorkFolder::new();
    let wrong = work.write("wrong.toml", "space = \"4d\"\n");
    let said = run_within(TIME_LIMIT, Command::new(program("sph-prep")).arg("explain").arg(&wrong)).expect(exit::USAGE);
    assert!(said.stderr.contains("wrong.toml:1") && said.stdout.is_empty(), "{said}");
    let none = work.join("none.toml");
    run_within(TIME_LIMIT, Command::new(program("sph-prep")).arg("explain").arg(none)).expect(exit::NO_INPUT);
}

/// What a program says on a terminal, with and without NO_COLOR.
#[test]
fn terminals_get_no_colours_where_they_are_not_wanted() {
    expect_program("script", "util-linux (Debian: bsdutils)");
    let work = WorkFolder::new();
    let scene = work.write("wrong.toml", "space = \"4d\" # no\nspacing = 1\n");
    let colours = |command: &str, no_color: Option<&str>| {
        let mut terminal = Command::new("script");
        terminal.args(["-qec", command, "/dev/null"]).env("TERM", "xterm-256color").env_remove("CLICOLOR_FORCE");
        match no_color {
            Some(value) => terminal.env("NO_COLOR", value),
            None => terminal.env_remove("NO_COLOR"),
        };
        let said = run_within(TIME_LIMIT, &mut terminal).stdout;
        assert!(said.len() > 40, "{command}: {said}");
        // Select Graphic Rendition: ESC [ numbers m.
        said.split("\u{1b}[")
            .skip(1)
            .filter(|rest| {
                let end = rest.find(|c: char| !c.is_ascii_digit() && c != ';').unwrap_or(0);
                rest[end..].starts_with('m')
            })
            .count()
    };
    let prep = format!("'{}' '{}' -o '{}'", program("sph-prep").display(), scene.display(), work.join("run").display());
    assert!(colours(&prep, None) > 0 && colours(&prep, Some("1")) == 0);
    for name in PROGRAMS {
        let command = format!("'{}' --nonsense", program(name).display());
        assert!(colours(&command, None) > 0, "{name}");
        assert_eq!(colours(&command, Some("1")), 0, "{name}");
    }
}

/// All that the programs say on the way from a scene to results, and why they refuse, is a JSON object a line where that is asked for.
#[test]
fn what_programs_say_can_be_read_by_programs() {
    let work = WorkFolder::new();
    let scene = work.write(
        "scene.toml",
        "space = \"plane-strain\"\nspacing = 0.01\n[kernel]\nh-over-dx = 1.5\n[material.drucker-prager]\ndensity = 2600\n\
         young = 4e5\npoisson = 0.3\nfriction = 30\ncohesion = 0\n[body.b]\nbox = { min = [0, 0, 0], max = [0.1, 0, 0.1] }\n\
         [wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n[end]\ntime = 0.02\n",
    );
    let run = work.join("run");
    let [scene, run] = [&scene, &run].map(|path| path.to_str().unwrap());
    let said = |program: &str, words: &[&str], code: i32| {
        let words = [words, &["--log", "json"]].concat();
        let output = tests::run(program, &words, 0).expect(code);
        let objects: Vec<serde_json::Value> = output
            .stderr
            .lines()
            .map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}\n{output}")))
            .collect();
        for object in &objects {
            assert!(
                object["program"] == program && object["time"].is_string() && object["message"].is_string(),
                "{object}"
            );
        }
        objects
    };
    let levels = |objects: &[serde_json::Value], level: &str| objects.iter().filter(|o| o["level"] == level).count();
    let prepared = said("sph-prep", &[scene, "-o", run], exit::DONE);
    assert!(levels(&prepared, "note") >= 2 && levels(&prepared, "warning") == 1, "{prepared:?}");
    let computed = said("sph-run", &[run, "--verbose"], exit::DONE);
    let last = computed.iter().rfind(|object| object["level"] == "progress").unwrap();
    assert!(
        last["step"].as_u64().unwrap() > 50 && last["end_s"] == 0.02 && last["done"].as_f64().unwrap() > 0.8,
        "{last}"
    );
    assert!(
        computed.iter().any(|object| object["message"].as_str().unwrap().contains("checkpoint: gen-")),
        "{computed:?}"
    );
    assert_eq!(levels(&said("sph-post", &[run], exit::DONE), "note"), 1);
    for (program, words, code) in [
        ("sph-prep", vec![scene, "-o", run], exit::CANNOT_WRITE),
        ("sph-prep", vec!["no.toml", "-o", "x"], exit::NO_INPUT),
        ("sph-run", vec!["no-run"], exit::NO_INPUT),
        ("sph-post", vec!["no-run"], exit::NO_INPUT),
    ] {
        let refused = said(program, &words, code);
        let last = refused.last().unwrap();
        assert!(last["level"] == "error" && last["exit_code"] == code, "{program} {words:?}: {refused:?}");
    }
    let wrong = work.write("wrong.toml", "space = \"4d\"\n");
    let refused = said("sph-prep", &[wrong.to_str().unwrap(), "-o", "x"], exit::USAGE);
    assert!(refused[0]["message"].as_str().unwrap().contains("wrong.toml:1") && refused[0]["exit_code"] == exit::USAGE);
}
