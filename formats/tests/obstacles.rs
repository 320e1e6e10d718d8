//! Obstacles: what a scene may say, what it may not, and the wall sites inside.

use formats::scene::{Scene, Slip, WallLattice};
use std::collections::HashSet;
use std::path::Path;

/// A box as text, without its first `without` triangles.
fn block(low: [f64; 3], high: [f64; 3], without: usize) -> String {
    let corner = |n: usize| [0, 1, 2].map(|a| if n >> a & 1 == 1 { high[a] } else { low[a] });
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let mut text = "solid box\n".to_string();
    let triangles = faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]);
    for triangle in triangles.skip(without) {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in triangle.map(corner) {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid\n"
}

const SCENE: &str = r#"space = "3d"
spacing = "0.5 m"
[material.drucker-prager]
density = 1800
young = "10 MPa"
poisson = 0.3
friction = 20
cohesion = 0
[body.slab]
box = { min = [0, 0, 0], max = [10, 10, 4] }
[wall.floor]
axis = "z"
at = 0
side = "above"
slip = "free-slip"
[obstacle.house]
file = "house.stl"
at = [12, 3, 0]
slip = "free-slip"
[end]
time = 1
"#;

const TERRAIN: &str = "[terrain]\nfile = \"dem.asc\"\nslip = \"no-slip\"\n";

fn place() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("house.stl", block([0.0, 0.0, -3.0], [6.0, 5.0, 4.0], 0));
    write("open.stl", block([0.0, 0.0, -3.0], [6.0, 5.0, 4.0], 1));
    write("small.stl", block([0.0, 0.0, 0.0], [0.006, 0.005, 0.004], 0));
    write("no.stl", "house".into());
    let row =
        |j: i32| (0..20).map(|i| (0.1 * f64::from(i) + 0.05 * f64::from(j)).to_string()).collect::<Vec<_>>().join(" ");
    let rows: String = (0..20).rev().map(|j| row(j) + "\n").collect();
    write("dem.asc", format!("ncols 20\nnrows 20\nxllcorner -5\nyllcorner -5\ncellsize 2\n{rows}"));
    folder
}

fn read(folder: &Path, text: &str) -> Result<Scene, String> {
    let name = folder.join("scene.toml").display().to_string();
    Scene::read(&name, text).map_err(|error| error.report().replace(&name, "scene.toml"))
}

fn with(pairs: &[(&str, &str)]) -> String {
    pairs.iter().fold(SCENE.to_string(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

#[test]
fn an_obstacle_is_read_and_placed() {
    let place = place();
    let scene = read(place.path(), SCENE).unwrap();
    let house = &scene.obstacles[0];
    assert_eq!((house.name.as_str(), house.file.as_str(), house.slip), ("house", "house.stl", Slip::FreeSlip));
    assert_eq!((house.solid.low, house.solid.high), ([12.0, 3.0, -3.0], [18.0, 8.0, 4.0]));
    assert_eq!(scene.files[0].0, "house.stl");
    let scaled = read(place.path(), &with(&[("\"house.stl\"", "\"small.stl\"\nscale = 1000")])).unwrap();
    assert!((scaled.obstacles[0].solid.high[0] - 18.0).abs() < 1e-12);
    let without = &SCENE[..SCENE.find("[obstacle").unwrap()].to_string();
    assert!(read(place.path(), &format!("{without}[end]\ntime = 1\n")).unwrap().obstacles.is_empty());
}

#[test]
fn what_cannot_be_an_obstacle_is_refused() {
    let place = place();
    let house = "\"house.stl\"";
    let at = "at = [12, 3, 0]";
    let cases: &[(&[(&str, &str)], &str, &str)] = &[
        (&[(house, "\"none.stl\"")], "17:8: obstacle.house.file: ", "none.stl: No such file"),
        (&[(house, "\"no.stl\"")], "17:8: obstacle.house.file: no.stl: is no STL file", "5 bytes"),
        (&[(house, "\"open.stl\"")], "open.stl: its surface is not closed: 3 edges", "(12, 3, -3)"),
        (&[(house, "\"small.stl\"")], "small.stl: is ", "is `scale` right? A file in millimetres takes scale = 0.001"),
        (&[(house, "\"house.stl\"\nscale = 1e6")], "spacings from 0 along x", "fewer than 1048576"),
        (&[(house, "\"house.stl\"\nscale = 0")], "18:9: obstacle.house.scale", "greater than 0"),
        (&[(at, "at = [12, 3, -4]")], "lies behind the wall z = 0 m", "z from -7 to 0 m"),
        (&[("spacing", "symmetry = [\"x\"]\nspacing"), (at, "at = [-6, 3, 0]")], "on the negative side of", "x = 0"),
        (&[("space = \"3d\"", "space = \"plane-strain\"")], "16:11: obstacle.house: there are no solids", "use \"3d\""),
        (&[("slip = \"free-slip\"\n[end]", "[end]")], "obstacle.house.slip: missing", "no-slip"),
        (&[(at, "up = 3")], "obstacle.house.up: unknown key", "file, scale, at, slip"),
        (&[("[end]", "[initial]\nrelax = 9\n[end]"), (at, "at = [9, 3, 0]")], "may reach into body `slab`", "relax"),
        (
            &[("spacing", "periodic = { x = { from = 0, to = 10 } }\nspacing")],
            "lies out of the period, 0 m to 10 m along x",
            "see `scale` and `at`",
        ),
    ];
    for (pairs, words, advice) in cases {
        let report = read(place.path(), &with(pairs)).expect_err(words);
        assert!(report.contains(words) && report.contains(advice), "{report}");
        assert_eq!(report.lines().count(), 1, "{report}");
    }
    let floor = &SCENE[SCENE.find("[wall").unwrap()..SCENE.find("[obstacle").unwrap()];
    let beyond = with(&[
        (floor, TERRAIN),
        (at, "at = [36, 3, 0]"),
        ("min = [0, 0, 0], max = [10, 10, 4]", "min = [0, 0, 2], max = [10, 10, 4]"),
    ]);
    let report = read(place.path(), &beyond).unwrap_err();
    assert!(report.contains("lies beyond the terrain, which reaches from -4 m to 34 m along x"), "{report}");
}

fn sites(lattice: &WallLattice, x: [f64; 3], reach: f64) -> HashSet<[i32; 3]> {
    let mut found = HashSet::new();
    lattice.near(x, reach, |site| {
        let p = lattice.position(site);
        let away = (0..3).map(|a| (p[a] - x[a]).powi(2)).sum::<f64>().sqrt();
        assert!(away < reach && found.insert(site), "{site:?}");
    });
    found
}

#[test]
fn a_box_has_the_sites_and_parities_of_a_plane_wall() {
    let place = place();
    let wall = "[wall.side]\naxis = \"x\"\nat = 12\nside = \"below\"\nslip = \"free-slip\"\n";
    let begin = SCENE.find("[obstacle").unwrap();
    let plane = read(place.path(), &format!("{}{wall}[end]\ntime = 1\n", &SCENE[..begin])).unwrap();
    let solid = read(place.path(), SCENE).unwrap();
    let (plane, solid) = (WallLattice::new(&plane), WallLattice::new(&solid));
    let (x, reach) = ([11.75, 5.25, 2.25], 1.3);
    let places = |lattice: &WallLattice| -> HashSet<[u64; 3]> {
        sites(lattice, x, reach).into_iter().map(|site| lattice.position(site).map(f64::to_bits)).collect()
    };
    assert_eq!(places(&plane), places(&solid));
    assert!(places(&solid).len() > 10);
    assert_eq!((plane.distance(x), solid.distance(x)), (0.25, 0.25));
    assert_eq!(solid.distance_of_sites([13.0, 5.0, 2.0]), -1.0);
    // Its normal, where the plane wall has an axis.
    let inside = solid.parity([12.25, 5.25, 2.25]);
    assert_eq!((inside.normal, inside.obstacle, inside.velocity), (Some([-1.0, 0.0, 0.0]), Some(0), [1.0; 3]));
    // Near the foot, which no material can touch, too; below the floor the floor has it.
    assert_eq!(solid.parity([12.75, 5.25, 0.25]).normal, Some([-1.0, 0.0, 0.0]));
    let below = solid.parity([12.25, 5.25, -0.25]);
    assert!(below.normal.is_none() && below.obstacle.is_none() && below.reflected == [false, false, true]);
    assert_eq!(solid.inside_obstacle([12.1, 5.0, 3.0]).map(|inside| inside.obstacle), Some(0));
    assert!(solid.inside_obstacle([11.9, 5.0, 3.0]).is_none());
    let no_slip = read(place.path(), &with(&[("slip = \"free-slip\"\n[end]", "slip = \"no-slip\"\n[end]")])).unwrap();
    let parity = WallLattice::new(&no_slip).parity([12.25, 5.25, 2.25]);
    assert!(parity.velocity == [-1.0; 3] && parity.normal.is_none() && parity.obstacle == Some(0));
}

/// All sites within reach of places in and around a house on a slope, against all lattice points one by one.
#[test]
fn over_a_terrain_sites_fill_the_house_above_ground() {
    let place = place();
    let floor = &SCENE[SCENE.find("[wall").unwrap()..SCENE.find("[obstacle").unwrap()];
    let body = ("min = [0, 0, 0], max = [10, 10, 4]", "min = [0, 0, 2], max = [10, 10, 4]");
    let scene = read(place.path(), &with(&[(floor, TERRAIN), body])).unwrap();
    let lattice = WallLattice::new(&scene);
    let reach = 2.3 * scene.h();
    for x in [[11.8, 5.1, 1.9], [11.9, 3.1, 1.6], [15.0, 2.9, 2.2], [18.2, 6.0, 2.2]] {
        let found = sites(&lattice, x, reach);
        let (mut house, mut ground) = (0, 0);
        for site in &found {
            let p = lattice.position(*site);
            let parity = lattice.parity(p);
            let below = lattice.ground(p).unwrap() > p[2];
            assert_eq!(parity.obstacle.is_none(), below, "{p:?}");
            assert!(below || scene.obstacles[0].solid.contains(p), "{p:?}");
            house += usize::from(!below);
            ground += usize::from(below);
            // The lattice of the house is not sheared.
            let cells = p[2] / 0.5 - 0.5;
            assert!(below || (cells - cells.round()).abs() < 1e-9, "{p:?}");
        }
        let mut wanted = 0;
        for n in 0..40 * 40 * 40 {
            let p = [n % 40, n / 40 % 40, n / 1600].map(|i: i32| f64::from(i) * 0.5 + 0.25);
            let away = (0..3).map(|a| (p[a] - x[a]).powi(2)).sum::<f64>().sqrt();
            let is_there = scene.obstacles[0].solid.contains(p) && lattice.ground(p).unwrap() <= p[2];
            wanted += usize::from(away < reach && is_there);
        }
        assert_eq!(house, wanted, "{x:?}");
        assert!(house > 5 && ground > 0, "{house} and {ground} at {x:?}");
        let numbers: HashSet<u64> = found.iter().map(|site| WallLattice::id(*site)).collect();
        assert_eq!(numbers.len(), found.len());
    }
}

#[test]
fn obstacles_are_mirrored_and_repeated_with_the_material() {
    let place = place();
    let lattice = |pairs: &[(&str, &str)]| WallLattice::new(&read(place.path(), &with(pairs)).unwrap());
    let near = [
        ("spacing", "symmetry = [\"x\"]\nspacing"),
        ("at = [12, 3, 0]", "at = [0.5, 3, 0]"),
        ("min = [0, 0", "min = [8, 0"),
        ("max = [10,", "max = [12,"),
    ];
    let mirrored = lattice(&near);
    let [here, there] = [0.75, -0.75].map(|x| mirrored.parity([x, 5.25, 2.25]).normal.unwrap());
    assert_eq!((here, there), ([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]));
    assert_eq!(mirrored.distance_of_sites([-0.1, 5.0, 2.0]), mirrored.distance_of_sites([0.1, 5.0, 2.0]));
    // A house across the end of a period: the other half is at the other end.
    let period = [("spacing", "periodic = { x = { from = 0, to = 15 } }\nspacing")];
    let repeated = lattice(&period);
    for x in [14.75, 0.25, 2.75, 12.25] {
        assert!(repeated.inside_obstacle([x, 5.0, 2.0]).is_some(), "{x}");
    }
    assert!(
        repeated.inside_obstacle([3.25, 5.0, 2.0]).is_none() && repeated.inside_obstacle([11.75, 5.0, 2.0]).is_none()
    );
    assert!((repeated.distance_of_sites([3.5, 5.0, 2.0]) - 0.5).abs() < 1e-12);
    let count = |x| sites(&repeated, [x, 5.25, 2.25], 1.3).len();
    assert_eq!(count(3.25), count(11.75));
}

/// Whatever else is symmetric.
#[test]
fn scenes_with_obstacles_are_not_reduced() {
    let place = place();
    let scene = read(place.path(), &SCENE.replace("space = \"3d\"", "space = \"auto\"")).unwrap();
    assert_eq!((scene.space.dimension(), scene.symmetry), (3, [false; 2]));
    let refused = scene.chosen.unwrap().refused;
    assert!(refused.iter().filter(|why| why.contains("there is an obstacle, `house`")).count() >= 2, "{refused:?}");
}
