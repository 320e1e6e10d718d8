//! The charts that come along, and small ones made up here.

use super::{
    definition::{self, BASE, Chart, PAIRS},
    front::Rank,
    netcdf, page, pairs, picture, points, singles,
};
use crate::{
    paths,
    study::{
        definition::Run,
        page::markers,
        results::{self, Line, Results},
        template,
    },
};
use formats::scene::Scene;
use std::collections::BTreeMap;
use std::path::Path;

const CHART: &str = r#"
title = "Made up"
scene = ["t.toml", "sand.toml"]
measures = ["runout"]
also = ["run-out = runout"]
[constants]
r0 = 0.1
law = 2
[error]
title = "error [1]"
words = "of the run-out"
expression = "abs(runout/law - 1)"
[base]
resolutions = [10, 20]
seeds = 2
[options]
resolutions = [10]
seeds = 2
[pairs]
most = 2
resolution = 10
seeds = 1
[[choice]]
name = "kernel"
option = [{ name = "wendland", set.kernel.kind = "wendland-c2" }, { name = "wide", set.kernel.h-over-dx = 1.5 }]
[[choice]]
name = "law"
option = [{ name = "fluid", instead = { "sand.toml" = "fluid.toml" } }]
[[choice]]
name = "stiffness"
option = [{ name = "soft", set.material.drucker-prager.young = 1e6 }]
[[choice]]
name = "step"
option = [{ name = "short", set.numerics.courant = 0.2 }]
"#;

const TEMPLATE: &str = r#"
title = "{resolution}, {seed}"
space = "axisymmetric"
spacing = {r0/resolution}
[body.column]
cylinder = { radius = {r0}, height = {r0} }
[wall.floor]
axis = "z"
at = 0
side = "above"
slip = "no-slip"
[initial]
jitter = 0.05
seed = {seed}
[end]
time = 1
"#;

const SAND: &str =
    "[material.drucker-prager]\ndensity = 2600\nyoung = 5.98e6\npoisson = 0.3\nfriction = 30\ncohesion = 0\n";
const FLUID: &str = "[material.mu-i]\ndensity = 2600\nsound-speed = 40\nfriction-static = 0.5\n";

fn made_up(folder: &Path, chart: &str) -> Result<Chart, crate::failure::Failure> {
    for (name, text) in [("chart.toml", chart), ("t.toml", TEMPLATE), ("sand.toml", SAND), ("fluid.toml", FLUID)] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    Chart::read("made-up", folder)
}

/// Results in which a setting has a run-out and takes a time: all its lattices the same.
fn with(chart: &Chart, settings: &[(&str, f64, f64)]) -> Results {
    let mut results = Results::default();
    for run in &chart.study.runs {
        let Some((_, runout, seconds)) = settings.iter().find(|(name, ..)| run.name.starts_with(name)) else {
            continue;
        };
        let measures = [("runout", *runout), ("processor_s", *seconds), ("particle_steps", 1e6)];
        let line = Line {
            measures: measures.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect::<BTreeMap<_, _>>(),
            scene: results::hash(run),
            commit: "abc".into(),
            date: "2026-01-31".into(),
            particles: Some(100),
            ranks: 1,
            ..Line::default()
        };
        results.0.insert(run.name.clone(), line);
    }
    results
}

/// The base is 10 % off; `wide`, `fluid`, `soft` and `short` are each better in something; `wendland` is worse in both.
const SINGLE: [(&str, f64, f64); 7] = [
    ("base-resolution-10", 2.2, 1.0),
    ("base-resolution-20", 2.1, 9.0),
    ("kernel-wendland", 2.4, 2.0),
    ("kernel-wide", 2.1, 1.5),
    ("law-fluid", 2.16, 1.2),
    ("stiffness-soft", 2.3, 0.5),
    ("step-short", 2.02, 4.0),
];

#[test]
fn every_run_of_every_chart_is_a_valid_scene() {
    let names = definition::shelf().names().unwrap();
    for name in ["bagnold-film", "bars-bui", "cd-a05", "cd-a626", "k0-column", "lube-a1", "lube-a4"] {
        assert!(names.iter().any(|known| known == name), "{name}: {names:?}");
    }
    for name in names {
        // Reading has checked the scenes; what stays is that resolution and lattice have arrived.
        let chart = Chart::named(&name).unwrap_or_else(|e| panic!("{e}"));
        let settings = points::of(&chart, &Results::default()).missing;
        assert!(settings >= 45, "{name}: {settings} settings");
        // Every option has at least two resolutions, one of them that of the pairs or all of its own.
        for option in chart.choices.iter().flat_map(|choice| &choice.options) {
            let of_it = |run: &&Run| run.parameters[0].1.to_string() == option.name;
            let mut found: Vec<f64> = chart
                .study
                .runs
                .iter()
                .filter(of_it)
                .filter_map(|r| template::number(&r.parameters, "resolution"))
                .collect();
            found.dedup();
            assert!(found.len() >= 2, "{name}, {}: {found:?}", option.name);
            assert!(option.alone || found.contains(&chart.pairs.resolution), "{name}, {}: {found:?}", option.name);
        }
        let lower = chart.pairs.lower.unwrap();
        let base: Vec<&Run> = chart.study.runs.iter().filter(|run| run.series == BASE).collect();
        let has_base =
            |resolution: f64| base.iter().any(|r| template::number(&r.parameters, "resolution") == Some(resolution));
        assert!(lower < chart.pairs.resolution && has_base(lower) && has_base(chart.pairs.resolution), "{name}");
        for run in &chart.study.runs {
            let scene = Scene::read(&run.name, &run.scene).unwrap();
            let number = |key: &str| template::number(&run.parameters, key).unwrap();
            assert_eq!(scene.initial.seed, number("seed") as u64, "{}", run.name);
            let ratio = scene.spacing * number("resolution");
            assert!([0.1, 0.02].iter().any(|length| (ratio / length - 1.0).abs() < 1e-9), "{}: {ratio}", run.name);
        }
    }
}

/// A choice that touches what the scene's author says about the material must be marked, and no other. Sound speed, mean stress, cap, and
/// what carries stress below yield are numbers of the method; see tests/charts/README.md.
#[test]
fn options_of_another_material_are_marked() {
    let physical = ["young", "poisson", "friction", "cohesion", "dilatancy", "cone", "curve", "tension", "density"];
    for name in definition::shelf().names().unwrap() {
        let chart = Chart::named(&name).unwrap();
        for choice in &chart.choices {
            for option in &choice.options {
                let laws = option.set.get("material").and_then(toml::Value::as_table);
                let keys = laws.into_iter().flatten().filter_map(|(_, law)| law.as_table()).flat_map(|law| law.keys());
                let mut files = option.instead.keys();
                let is_physical = keys.into_iter().any(|key| physical.contains(&key.as_str()))
                    || files.any(|file| file.contains("materials/"));
                assert_eq!(choice.material, is_physical, "{name}: {}", option.name);
                assert_eq!(chart.is_other_material(&option.name), is_physical, "{name}: {}", option.name);
            }
        }
        assert!(chart.choices.iter().any(|choice| choice.material), "{name}");
        assert!(!chart.is_other_material(BASE), "{name}");
    }
}

#[test]
fn the_laws_in_the_charts_are_those_of_the_library() {
    for (name, a) in [("lube-a1", 1.0), ("lube-a4", 4.0)] {
        let constants = Chart::named(name).unwrap().study.constants;
        let of = |key: &str| template::number(&constants, key).unwrap();
        assert!((of("lube_runout") - formats::laws::lube_runout(a)).abs() < 1e-4, "{name}");
        assert!((of("lube_height") - formats::laws::lube_height(a).unwrap()).abs() < 1e-4, "{name}");
        assert_eq!(of("aspect"), a);
    }
    // Bagnold's film: u_s = 2/3 I sqrt(p/rho_s)/d H with mu(I) = tan 24 deg, for the beads of the test of row F2.
    let constants = Chart::named("bagnold-film").unwrap().study.constants;
    let of = |key: &str| template::number(&constants, key).unwrap();
    let (angle, height) = (24.0_f64.to_radians(), of("height"));
    assert!((of("sine") - angle.sin()).abs() < 1e-8 && (of("cosine") - angle.cos()).abs() < 1e-8);
    let inertial = 0.279 * (angle.tan() - 0.38) / (0.64 - angle.tan());
    let rate = inertial * (1500.0 * 9.81 * angle.cos() * height / 2500.0).sqrt() / 0.5e-3;
    assert!((of("surface") - 2.0 / 3.0 * rate * height).abs() < 1e-5, "{}", 2.0 / 3.0 * rate * height);
}

#[test]
fn the_page_has_markers_for_every_chart_and_no_others() {
    let text = std::fs::read_to_string(paths::charts_page()).unwrap();
    let mut wanted = Vec::new();
    for name in definition::shelf().names().unwrap() {
        let chart = Chart::named(&name).unwrap();
        if chart.reduction.is_some() {
            wanted.push(format!("{name}/reduction"));
        }
        wanted.push(name);
        wanted.extend(chart.group);
    }
    let mut found: Vec<String> = markers(&text).into_iter().map(str::to_owned).collect();
    found.sort();
    wanted.sort();
    wanted.dedup();
    assert_eq!(found, wanted);
}

#[test]
fn options_are_laid_over_the_base_or_replace_its_files() {
    let work = tempfile::tempdir().unwrap();
    let chart = made_up(work.path(), CHART).unwrap();
    let names: Vec<&str> = chart.study.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names.len(), 4 + 5 * 2);
    assert_eq!(names[3], "base-resolution-20-seed-2");
    let scene = |name: &str| {
        let run = chart.study.runs.iter().find(|run| run.name == name).unwrap();
        Scene::read(name, &run.scene).unwrap()
    };
    assert_eq!(scene("base-resolution-20-seed-2").spacing, 0.005);
    assert_eq!(scene("kernel-wide-resolution-10-seed-1").h_over_dx, 1.5);
    assert!(scene("law-fluid-resolution-10-seed-1").material.is_fluid());
    assert_eq!(chart.study.series, ["base", "kernel", "law", "stiffness", "step", "pairs"]);
}

#[test]
fn faults_name_their_place() {
    let work = tempfile::tempdir().unwrap();
    for (from, to, fault) in [
        ("title", "titel", "titel"),
        ("= runout\"]", "= runin\"]", "also: `runin`: the name `runin` is not known"),
        ("law = 2", "", "error: `abs(runout/law - 1)`: the name `law` is not known"),
        ("name = \"step\"", "name = \"pairs\"", "choice pairs: this name is taken"),
        ("name = \"wide\"", "name = \"soft\"", "choice stiffness: option `soft`: another one has this name"),
        ("\"sand.toml\" =", "\"mud.toml\" =", "choice law: option fluid: `mud.toml` is none of the scene's files"),
        ("\"fluid.toml\"", "\"none.toml\"", "choice law: none.toml: cannot read the template"),
        ("courant = 0.2", "courant = 2", "choice step: step-short-resolution-10-seed-1"),
        ("r0 = 0.1", "", "`r0` is not known"),
        ("[base]", "[reduction]\nchoice = \"law\"\nresolution = 10\n[base]", "reduction: it needs stations"),
        ("[base]", "[[field]]\nname = \"s\"\nof = \"tension\"\n[base]", "field s: `tension`"),
        ("[base]", "[profile]\nfile = \"none.csv\"\ncurve = \"c\"\n[base]", "profile: "),
    ] {
        let failure = made_up(work.path(), &CHART.replacen(from, to, 1)).unwrap_err();
        assert!(failure.message.contains("chart.toml: ") && failure.message.contains(fault), "{failure}");
    }
}

#[test]
fn pairs_are_the_promising_ones_and_chosen_once() {
    let work = tempfile::tempdir().unwrap();
    let mut chart = made_up(work.path(), CHART).unwrap();
    let results = with(&chart, &SINGLE);
    let done = points::of(&chart, &results).done;
    assert_eq!(done.len(), 7);
    // Errors times costs over those of the base: short 0.4, soft 0.75, wide 0.75, fluid 0.96. `soft` changes a key of the law that
    // `fluid` replaces: no scene.
    let name = |pair: [&str; 2]| pair.map(str::to_owned);
    let found = pairs::promising(&chart, &done);
    assert_eq!(found, [name(["short", "soft"]), name(["short", "wide"])]);
    chart.pairs.most = 100;
    let all = pairs::promising(&chart, &done);
    assert_eq!(all.len(), 5);
    assert!(!all.contains(&name(["fluid", "soft"])) && all.iter().flatten().all(|option| option != "wendland"));
    // The order of the points, which is that of their costs, does not matter.
    let mut reversed = done.clone();
    reversed.reverse();
    assert_eq!(pairs::promising(&chart, &reversed), all);
    chart.pairs.most = 2;

    // Nothing is chosen while something is missing.
    assert!(!pairs::add_kept(&mut chart).unwrap());
    let mut partly = results.clone();
    partly.0.remove("step-short-resolution-10-seed-2");
    assert!(!pairs::choose(&mut chart, &partly).unwrap() && !pairs::path(&chart).exists());
    assert!(pairs::choose(&mut chart, &results).unwrap());
    let of_pairs = |chart: &Chart| -> Vec<String> {
        chart.study.runs.iter().filter(|run| run.series == PAIRS).map(|run| run.name.clone()).collect()
    };
    let names = ["pairs-short-and-soft-resolution-10-seed-1", "pairs-short-and-wide-resolution-10-seed-1"];
    assert_eq!(of_pairs(&chart), names);
    // Another call has the same ones, whatever the results are by then; options that are gone are passed over.
    let mut again = made_up(work.path(), CHART).unwrap();
    assert!(pairs::add_kept(&mut again).unwrap());
    assert_eq!(of_pairs(&again), names);
    let mut without = made_up(work.path(), &CHART.replace("\"soft\"", "\"softer\"")).unwrap();
    assert!(pairs::add_kept(&mut without).unwrap());
    assert_eq!(of_pairs(&without), names[1..]);
}

/// The same with `law` and `stiffness` as other materials, and pairs at a resolution below.
fn with_materials(folder: &Path) -> Chart {
    let text = ["law", "stiffness"].iter().fold(CHART.replace("most = 2", "most = 2\nlower = 5"), |text, name| {
        text.replace(&format!("name = \"{name}\"\n"), &format!("name = \"{name}\"\nmaterial = true\n"))
    });
    made_up(folder, &text).unwrap()
}

#[test]
fn the_front_of_the_own_material_knows_no_other() {
    let work = tempfile::tempdir().unwrap();
    let chart = with_materials(work.path());
    let points = points::of(&chart, &with(&chart, &SINGLE));
    let place = |label: &str| {
        let point = points.done.iter().find(|point| point.label() == label).unwrap();
        (point.rank, point.of_all)
    };
    // `soft` is the cheapest, `fluid` more accurate than what is cheaper: both on the front of all, neither on that of the own.
    assert_eq!(place("soft, 10"), (None, Rank::Front));
    assert_eq!(place("fluid, 10"), (None, Rank::Front));
    assert_eq!(place("default, 10"), (Some(Rank::Front), Rank::Front));
    assert_eq!(place("default, 20"), (Some(Rank::Behind), Rank::Behind));
    // A setting that only another material beats: behind among all, on the front of its own.
    let mut better = SINGLE;
    better[4] = ("law-fluid", 2.08, 0.9);
    let points = points::of(&chart, &with(&chart, &better));
    let default = points.done.iter().find(|point| point.label() == "default, 10").unwrap();
    assert_eq!((default.rank, default.of_all), (Some(Rank::Front), Rank::Behind));
    let part = page::part(&chart, &with(&chart, &better), &points);
    for line in [
        "- The default is on the front with resolution 10.",
        "- On the front of all settings are also of other materials: soft, 10; fluid, 10.",
        "| fluid | law | 10 | 100 | 2 | 0.0400 ± 0 | 2.08 | 0.900 | 1.00 | other material; of all: **front** |",
    ] {
        assert!(part.lines().any(|l| l == line), "no {line}\n{part}");
    }
    assert!(!part.contains("*fluid, 10*"), "the default is judged against its own material\n{part}");
    assert!(picture::png(&chart, &points).unwrap().len() > 1000);
    let path = work.path().join("chart.nc");
    netcdf::dataset(&chart, &points).write(&path).unwrap();
    let of = |name: &str| formats::results::read(&path, name).unwrap();
    // By cost: soft, fluid, default, wide, wendland, short, default at 20.
    assert_eq!(of("other_material"), [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(of("on_front"), [0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0]);
    assert_eq!(of("on_front_of_all"), [1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
}

#[test]
fn pairs_of_the_own_material_come_first_and_the_best_also_below() {
    let work = tempfile::tempdir().unwrap();
    let mut chart = with_materials(work.path());
    let results = with(&chart, &SINGLE);
    assert!(pairs::choose(&mut chart, &results).unwrap());
    let text = std::fs::read_to_string(pairs::path(&chart)).unwrap();
    // Of the own material there are `short`, `wide`, and behind their front `wendland`, which excludes `wide`.
    assert_eq!(text, "first,second\nshort,wide\nshort,wendland\nshort,soft\n");
    let names = |chart: &Chart| -> Vec<String> {
        chart.study.runs.iter().filter(|run| run.series == PAIRS).map(|run| run.name.clone()).collect()
    };
    let expected = [
        "pairs-short-and-wide-resolution-5-seed-1",
        "pairs-short-and-wide-resolution-10-seed-1",
        "pairs-short-and-wendland-resolution-5-seed-1",
        "pairs-short-and-wendland-resolution-10-seed-1",
        "pairs-short-and-soft-resolution-10-seed-1",
    ];
    assert_eq!(names(&chart), expected);
    let with_soft = points::of(&chart, &with(&chart, &[("pairs", 2.01, 1.0)]));
    let pair = with_soft.done.iter().find(|point| point.setting == "short and soft").unwrap();
    assert!(pair.is_other() && with_soft.done.iter().filter(|point| point.is_other()).count() == 1);
}

#[test]
fn settings_count_once_all_their_lattices_are_there() {
    let work = tempfile::tempdir().unwrap();
    let chart = made_up(work.path(), CHART).unwrap();
    let mut results = with(&chart, &SINGLE);
    results.0.remove("kernel-wide-resolution-10-seed-1");
    results.0.get_mut("law-fluid-resolution-10-seed-2").unwrap().exit = 70;
    let points = points::of(&chart, &results);
    assert_eq!((points.done.len(), points.missing), (5, 1));
    assert_eq!(points.failed, ["fluid, 10 (1 of 2)"]);
    let rank = |label: &str| points.done.iter().find(|point| point.label() == label).unwrap().rank.unwrap();
    assert_eq!([rank("soft, 10"), rank("default, 10"), rank("short, 10")], [Rank::Front; 3]);
    assert_eq!([rank("wendland, 10"), rank("default, 20")], [Rank::Behind; 2]);
}

#[test]
fn the_page_says_where_the_default_lies() {
    let work = tempfile::tempdir().unwrap();
    let chart = made_up(work.path(), CHART).unwrap();
    let mut results = with(&chart, &SINGLE);
    let part = |results: &Results| page::part(&chart, results, &points::of(&chart, results));
    assert!(part(&Results::default()).contains("*Not run.*"));
    let text = part(&results);
    for line in [
        "Error: of the run-out.",
        "- The default is on the front with resolution 10.",
        "- *short, 10* (an error of 0.0100 ± 0 in 4.00 s) dominates the default: with resolution 20 0.0500 ± 0 in 9.00 s.",
        "| **default** | base | 10 | 100 | 2 | 0.100 ± 0 | 2.20 | 1.00 | 1.00 | **front** |",
        "| wendland | kernel | 10 | 100 | 2 | 0.200 ± 0 | 2.40 | 2.00 | 1.00 | dominated |",
    ] {
        assert!(text.lines().any(|l| l == line), "no {line}\n{text}");
    }
    assert!(text.contains("7 settings. 14 of 14 runs, computed by abc, 2026-01-31."), "{text}");
    results.0.get_mut("law-fluid-resolution-10-seed-2").unwrap().exit = 70;
    assert!(part(&results).contains("numerical failure: fluid, 10 (1 of 2)."));
}

#[test]
fn other_programs_find_the_points_in_a_file() {
    let work = tempfile::tempdir().unwrap();
    let chart = made_up(work.path(), CHART).unwrap();
    let points = points::of(&chart, &with(&chart, &SINGLE));
    let path = work.path().join("chart.nc");
    netcdf::dataset(&chart, &points).write(&path).unwrap();
    let of = |name: &str| formats::results::read(&path, name).unwrap();
    assert_eq!(of("cost_seconds"), [0.5, 1.0, 1.2, 1.5, 2.0, 4.0, 9.0]);
    assert_eq!(of("on_front"), [1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0]);
    assert_eq!(of("default_setting"), [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert!((of("error")[0] - 0.15).abs() < 1e-12 && of("particle_steps")[6] == 1e6);
    // The picture of a scatter of nothing, and of a single point, is a picture too.
    assert!(picture::png(&chart, &points).unwrap().len() > 1000);
    let one = points::of(&chart, &with(&chart, &SINGLE[..1]));
    assert!(picture::png(&chart, &one).unwrap().len() > 1000);
}

#[test]
fn single_settings_are_compared_with_the_default_over_charts() {
    let work = tempfile::tempdir().unwrap();
    let charts: Vec<_> = [("step-short", 2.05), ("step-short", 2.4)]
        .map(|changed| {
            let chart = with_materials(work.path());
            let single =
                SINGLE.map(|(name, runout, cost)| (name, if name == changed.0 { changed.1 } else { runout }, cost));
            let points = points::of(&chart, &with(&chart, &single));
            (chart, points)
        })
        .into();
    let rows = singles::rows(&charts);
    // Of another material: fluid, soft.
    assert_eq!(rows.iter().map(|row| row.setting.as_str()).collect::<Vec<_>>(), ["wendland", "wide", "short"]);
    // 2.5 % and 20 % in place of 10 %: their geometric mean, 7 %, is 0.7 of that, in four times the time.
    let short = &rows[2];
    assert!((short.error - 0.5_f64.sqrt()).abs() < 1e-9 && (short.cost - 4.0).abs() < 1e-9, "{short:?}");
    assert_eq!((short.better, short.worse, short.of, short.broken), (1, 1, 2, 0));
    assert!((rows[1].error - 0.5).abs() < 1e-9 && rows[1].better == 2, "{:?}", rows[1]);
    // One that broke down counts as that, and a chart without it does not count.
    let mut results = with(&charts[0].0, &SINGLE);
    results.0.get_mut("kernel-wide-resolution-10-seed-2").unwrap().exit = 70;
    let points = points::of(&charts[0].0, &results);
    let broken = singles::rows(&[(with_materials(work.path()), points)]);
    assert_eq!((broken[1].of, broken[1].broken), (0, 1));
}
