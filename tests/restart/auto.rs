//! `space = "auto"` from the scene to the figures, and through a stop: the bits are those of the smaller scene written
//! by hand, and the scene stays as its author wrote it.

use formats::{exit, folder::RunFolder, provenance, snapshot};
use std::path::PathBuf;
use tests::trial::{launch, short};
use tests::{WorkFolder, computed, prepared, run};

/// One of the short scenes without what it starts with up to its material, and with other bodies and walls.
fn scene(head: &str, short: &str, bodies: &str) -> String {
    let material = &short[short.find("[material").unwrap()..short.find("[body").unwrap()];
    let floor = &short[short.find("[wall.floor]").unwrap()..];
    let floor = &floor[..floor.find("slip").unwrap()];
    let rest = "slip = \"no-slip\"\n[initial]\njitter = 0.05\n[end]\ntime = \"100 ms\"\n\
                [output]\nsnapshots = \"40 ms\"\nhistory = \"7 ms\"\n";
    format!("title = \"A scene\"\nspacing = \"20 mm\"\n{head}{material}{bodies}{floor}{rest}")
}

const AUTO: &str = "space = \"auto\"\n";

fn side(name: &str, axis: &str, at: &str, side: &str) -> String {
    format!("[wall.{name}]\naxis = \"{axis}\"\nat = {at}\nside = \"{side}\"\nslip = \"free-slip\"\n")
}

/// Snapshots and the start, field by field, and what came first of the file: all but the hash of the scene.
fn fields(folder: &RunFolder) -> Vec<(String, snapshot::Digests)> {
    let entries = std::fs::read_dir(folder.out()).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == "hdf")).collect();
    files.sort();
    files.push(folder.initial());
    let one = |file: PathBuf| {
        let (header, digests) = snapshot::digests(&file).unwrap();
        let header = snapshot::Header { scene_hash: String::new(), ..header };
        (format!("{header:?}"), digests)
    };
    files.into_iter().map(one).collect()
}

/// Prepares, stops, resumes on other ranks, evaluates: and compares with the scene by hand.
fn same(name: &str, auto: &str, hand: &str) {
    let work = WorkFolder::new();
    let by_hand = computed(&work, "hand", hand, 1);
    let chosen = prepared(&work, "auto", auto, 2);
    launch(&chosen, 1, &["--stop-after-steps", "40"]).expect(exit::RESUMABLE);
    let resumed = launch(&chosen, 2, &[]).expect(exit::DONE);
    assert!(resumed.stderr.contains("resuming"), "{name}: {resumed}");
    assert_eq!(fields(&by_hand), fields(&chosen), "{name}");
    for folder in [&by_hand, &chosen] {
        run("sph-post", &[folder.path()], 0).expect(exit::DONE);
    }
    let texts = |folder: &RunFolder| {
        ["out/history.csv", "post/profile_final.csv"].map(|file| std::fs::read(folder.path().join(file)).unwrap())
    };
    assert_eq!(texts(&by_hand), texts(&chosen), "{name}");
    assert_eq!(std::fs::read_to_string(chosen.scene()).unwrap(), auto, "{name}: the scene is its author's");
    let told = |folder: &RunFolder| provenance::read(&folder.provenance()).unwrap()[0].chosen.join("\n");
    assert!(told(&chosen).contains("particle-steps instead of") && told(&by_hand).is_empty(), "{name}");

    // Under a later end it goes on; another space, even the chosen one by name, is another scene.
    let later = auto.replace("time = \"100 ms\"", "time = \"110 ms\"\nat-rest = \"auto\"");
    let [later, other] =
        [("later.toml", later.as_str()), ("other.toml", hand)].map(|(name, text)| work.write(name, text));
    launch(&chosen, 1, &["--scene", later.to_str().unwrap()]).expect(exit::DONE);
    let refused = launch(&chosen, 1, &["--scene", other.to_str().unwrap()]).expect(exit::USAGE);
    assert!(refused.stderr.contains("may not change"), "{refused}");
}

#[test]
fn rings_around_another_axis() {
    let column = |base: &str| format!("[body.column]\ncylinder = {{ radius = 0.2, height = 0.3, base = [{base}] }}\n");
    let auto = scene(AUTO, short::RINGS, &column("\"40 cm\", -0.1, 0"));
    same("rings", &auto, &scene("space = \"axisymmetric\"\n", short::RINGS, &column("0, 0, 0")));
}

#[test]
fn half_of_a_plane() {
    let block = |from: &str, low: &str, high: &str| {
        format!("[body.block]\nbox = {{ min = [{from}, {low}, 0], max = [0.2, {high}, 0.3] }}\n")
    };
    let right = side("right", "x", "0.26", "below");
    let walls =
        [side("left", "x", "\"-26 cm\"", "above"), side("a", "y", "-0.3", "above"), side("b", "y", "0.3", "below")];
    let auto = scene(AUTO, short::PLANE, &(block("-0.2", "-0.3", "0.3") + &walls.concat() + &right));
    let hand = scene("space = \"plane-strain\"\nsymmetry = [\"x\"]\n", short::PLANE, &(block("0", "0", "0") + &right));
    same("plane", &auto, &hand);
}

#[test]
fn a_quarter_of_two_bodies() {
    let block = |name: &str, [left, right]: [&str; 2], low: &str| {
        format!("[body.{name}]\nbox = {{ min = [{left}, {low}, 0], max = [{right}, 0.1, 0.16] }}\n")
    };
    let both = block("left", ["-0.2", "-0.1"], "-0.1") + &block("right", ["0.1", "0.2"], "-0.1");
    let hand = scene("space = \"3d\"\nsymmetry = [\"x\", \"y\"]\n", short::SOLID, &block("right", ["0.1", "0.2"], "0"));
    same("solid", &scene(AUTO, short::SOLID, &both), &hand);
}
