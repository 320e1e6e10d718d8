//! Terrain and release: what a scene may say, what it may not, and the wall sites below.

use formats::raster::Grid;
use formats::scene::{Depth, Scene, Shape, Slip, WallLattice};
use std::collections::HashSet;
use std::path::Path;

/// A raster of 12 x 12 cells of 10 m, south-western corner at (500, 300).
fn raster(z: impl Fn(f64, f64) -> f64) -> String {
    let mut text = "ncols 12\nnrows 12\nxllcorner 500\nyllcorner 300\ncellsize 10\nnodata_value -9999\n".to_string();
    for j in (0..12).rev() {
        let row = |i: i32| z(f64::from(i) * 10.0 + 505.0, f64::from(j) * 10.0 + 305.0).to_string();
        text += &((0..12).map(row).collect::<Vec<_>>().join(" ") + "\n");
    }
    text
}

fn slope(x: f64, y: f64) -> f64 {
    900.0 - 0.5 * (x - 505.0) + 0.25 * (y - 305.0)
}

const SCENE: &str = r#"space = "3d"
spacing = "2 m"
[material.drucker-prager]
density = 1800
young = "10 MPa"
poisson = 0.3
friction = 20
cohesion = 0
[terrain]
file = "dem.asc"
origin = [505, 305, 800]
slip = "no-slip"
[body.slab]
release = { polygon = [[20, 20], [60, 20], ["60 m", 70], [20, 70]], thickness = "5 m" }
[end]
time = 1
"#;

/// The files beside the scene.
fn place() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("dem.asc", raster(slope));
    write(
        "slab.asc",
        raster(|x, y| if (540.0..580.0).contains(&x) && (330.0..370.0).contains(&y) { 4.0 } else { -9999.0 }),
    );
    write("top.asc", raster(|x, y| if x < 550.0 { slope(x, y) + 6.0 } else { -9999.0 }));
    write("shifted.asc", raster(|_, _| 1.0).replace("xllcorner 500", "xllcorner 505"));
    write("negative.asc", raster(|x, _| 560.0 - x));
    write("holes.asc", raster(|x, y| if x > 560.0 && y > 360.0 { -9999.0 } else { slope(x, y) }));
    write("broken.asc", raster(slope).replace("ncols 12", "ncols 13"));
    folder
}

fn read(folder: &Path, text: &str) -> Result<Scene, String> {
    let name = folder.join("scene.toml").display().to_string();
    Scene::read(&name, text).map_err(|error| error.report().replace(&name, "scene.toml"))
}

fn good(folder: &Path, from: &str, to: &str) -> Scene {
    assert!(SCENE.contains(from), "{from}");
    read(folder, &SCENE.replacen(from, to, 1)).unwrap_or_else(|report| panic!("{report}"))
}

fn bad(folder: &Path, from: &str, to: &str) -> String {
    assert!(SCENE.contains(from), "{from}");
    read(folder, &SCENE.replacen(from, to, 1)).expect_err("a fault")
}

const RELEASE: &str = r#"release = { polygon = [[20, 20], [60, 20], ["60 m", 70], [20, 70]], thickness = "5 m" }"#;

#[test]
fn a_release_lies_on_the_ground() {
    let place = place();
    let scene = good(place.path(), "", "");
    let terrain = scene.terrain.as_ref().unwrap();
    assert_eq!((terrain.slip, terrain.file.as_str(), terrain.origin), (Slip::NoSlip, "dem.asc", [505.0, 305.0, 800.0]));
    assert!((terrain.height(33.0, 41.0) - (100.0 - 16.5 + 10.25)).abs() < 1e-9);
    let Shape::Release(slab) = &scene.bodies[0].shape else { panic!("{:?}", scene.bodies) };
    assert_eq!((slab.depth.clone(), slab.thickest()), (Depth::Constant(5.0), 5.0));
    assert_eq!([slab.thickness(40.0, 40.0), slab.thickness(61.0, 40.0), slab.thickness(40.0, 71.0)], [5.0, 0.0, 0.0]);
    assert!((slab.volume(scene.space, [false; 2], 2.0) - 40.0 * 50.0 * 5.0).abs() < 1e-6);
    let (low, high) = scene.bodies[0].shape.bounds(scene.space);
    assert_eq!((low, high), ([20.0, 20.0, 75.0], [60.0, 70.0, 112.5]));
    assert_eq!(scene.floor(), 800.0 - 800.0 + 900.0 - 55.0 - 800.0);

    let scene = good(place.path(), RELEASE, "release = { thickness-file = \"slab.asc\" }");
    let Shape::Release(slab) = &scene.bodies[0].shape else { panic!("{:?}", scene.bodies) };
    // Sixteen cells of 100 m2; bilinear, so that half as much lies half-way out of them.
    assert!((slab.volume(scene.space, [false; 2], 2.0) - 16.0 * 100.0 * 4.0).abs() < 1e-9);
    assert!((slab.thickness(50.0, 40.0) - 4.0).abs() < 1e-12 && (slab.thickness(35.0, 40.0) - 2.0).abs() < 1e-12);

    let scene = good(place.path(), RELEASE, "release = { surface-file = \"top.asc\" }");
    let Shape::Release(slab) = &scene.bodies[0].shape else { panic!("{:?}", scene.bodies) };
    assert!((slab.thickness(33.0, 50.0) - 6.0).abs() < 1e-9);
    assert_eq!(slab.thickness(48.0, 50.0), 0.0);
}

#[test]
fn the_files_are_part_of_the_hash() {
    let place = place();
    let before = good(place.path(), "", "");
    assert_eq!(before.files.len(), 1);
    assert_ne!(before.hash_of(SCENE), Scene::hash(SCENE));
    std::fs::write(place.path().join("dem.asc"), raster(|x, y| slope(x, y) + 0.01)).unwrap();
    assert_ne!(good(place.path(), "", "").hash_of(SCENE), before.hash_of(SCENE));
}

#[test]
fn faults_come_at_once_with_their_places() {
    let place = place();
    let text = SCENE
        .replace("dem.asc", "broken.asc")
        .replace("slip = \"no-slip\"", "slip = \"none\"")
        .replace("thickness = \"5 m\"", "thickness = \"5\"");
    let report = read(place.path(), &text).unwrap_err();
    let lines: Vec<&str> = report.lines().collect();
    assert_eq!(lines.len(), 3, "{report}");
    assert!(
        lines[0].starts_with("scene.toml:10:8: terrain.file: broken.asc: it ends in line 18 with 144 values"),
        "{report}"
    );
    assert!(lines[1].starts_with("scene.toml:12:8: terrain.slip: unknown name `none`"), "{report}");
    assert!(lines[2].starts_with("scene.toml:14:81: body.slab.release.thickness:"), "{report}");
}

#[test]
fn what_does_not_fit_the_terrain_is_refused() {
    let place = place();
    let cases = [
        ("file = \"dem.asc\"", "file = \"none.asc\"", "10:8: terrain.file: ", "none.asc: No such file"),
        (
            "origin = [505, 305, 800]",
            "origin = [-9e6, 0, 0]",
            "terrain.file: reaches",
            "set terrain.origin to a point of it",
        ),
        ("[60, 20]", "[140, 20]", "body.slab.release: reaches beyond the terrain's edge", "from 0 m to 110 m"),
        ("dem.asc", "holes.asc", "body.slab.release: lies on cells of the terrain without data", "gdal_fillnodata"),
        (RELEASE, "release = { thickness-file = \"shifted.asc\" }", "its grid is not that of dem.asc", "x = 5 m"),
        (RELEASE, "release = { thickness-file = \"negative.asc\" }", "it has a thickness of -", "0 or greater"),
        (RELEASE, "release = { thickness = 1 }", "release.polygon: missing", "same everywhere"),
        (RELEASE, "release = { polygon = [[0, 0], [1, 1]], thickness = 1 }", "has 2 points", "at least three"),
        (RELEASE, "release = { polygon = [[0, 0], [1], [2, 3]], thickness = 1 }", "has 1 values", "a point has two"),
        (RELEASE, "release = {}", "has no thickness", "one of thickness, thickness-file, surface-file"),
        ("thickness = \"5 m\"", "thickness = 0.9", "holds no particle", "half the spacing is 1 m"),
        (
            RELEASE,
            "box = { min = [20, 20, 80], max = [40, 40, 120] }",
            "below the terrain at",
            "which lies on the terrain",
        ),
        ("[terrain]", "[initial]\nrelax = 3\n[terrain]", "initial.relax: released material", "jitter"),
        ("[terrain]", "[initial]\nlattice = \"hexagonal\"\n[terrain]", "initial.lattice", "only \"cubic\""),
        (
            "[end]",
            "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n[end]",
            "wall.floor.axis: the terrain is the floor",
            "drop this wall",
        ),
        (
            "[end]",
            "[body.more]\nrelease = { polygon = [[50, 50], [80, 50], [80, 80]], thickness = 3 }\n[end]",
            "overlaps body `slab`",
            "bodies may touch",
        ),
        (
            "[terrain]\nfile = \"dem.asc\"\norigin = [505, 305, 800]\nslip = \"no-slip\"\n",
            "",
            "add a table [terrain]",
            "",
        ),
    ];
    for (from, to, what, advice) in cases {
        let report = bad(place.path(), from, to);
        assert!(report.contains(what) && report.contains(advice) && report.lines().count() == 1, "{to}: {report}");
    }
}

/// Sites of a lattice near a point, checked one by one: no two alike, behind a wall, and in reach.
fn sites(lattice: &WallLattice, x: [f64; 3], reach: f64) -> HashSet<[i32; 3]> {
    let mut found = HashSet::new();
    lattice.near(x, reach, |site| {
        let p = lattice.position(site);
        let away = (0..3).map(|a| (p[a] - x[a]).powi(2)).sum::<f64>().sqrt();
        assert!(away < reach && lattice.distance(p) < 0.0 && found.insert(site), "{site:?}");
    });
    found
}

#[test]
fn sites_lie_below_the_ground_and_none_is_missed() {
    let place = place();
    // A step of 40 m in 10 m.
    std::fs::write(place.path().join("dem.asc"), raster(|x, _| if x > 555.0 { 860.0 } else { 900.0 })).unwrap();
    let scene = good(place.path(), RELEASE, "release = { polygon = [[10, 20], [40, 20], [40, 70]], thickness = 5 }");
    let (lattice, reach) = (WallLattice::new(&scene), 2.3 * scene.h());
    for x in [[30.0, 40.0, 101.0], [52.0, 50.0, 100.5], [57.0, 50.0, 90.0], [61.0, 50.0, 61.0], [60.5, 33.0, 75.0]] {
        let found = sites(&lattice, x, reach);
        let mut wanted = HashSet::new();
        for i in -2..60 {
            for j in -2..60 {
                for k in -40..0 {
                    let p = lattice.position([i, j, k]);
                    if (0..3).map(|a| (p[a] - x[a]).powi(2)).sum::<f64>() < reach * reach {
                        wanted.insert([i, j, k]);
                    }
                }
            }
        }
        assert!(!wanted.is_empty() && found == wanted, "{x:?}: {} of {}", found.len(), wanted.len());
        assert!(wanted.iter().all(|&s| lattice.parity(lattice.position(s)).velocity == [-1.0; 3]));
    }
    // High above the level part there are none; beside the cliff the distance says how near it may be.
    assert!(sites(&lattice, [20.0, 40.0, 106.0], reach).is_empty());
    assert!(lattice.distance([60.0, 50.0, 70.0]) < reach);
    assert!(lattice.distance([20.0, 40.0, 106.0]) > reach && lattice.distance([20.0, 40.0, 99.0]) < 0.0);
}

#[test]
fn beyond_planes_of_symmetry_and_walls_the_ground_is_a_mirror_image() {
    let place = place();
    let side = "symmetry = [\"y\"]\n[wall.side]\naxis = \"x\"\nat = \"70 m\"\nside = \"below\"\nslip = \"free-slip\"\n";
    let text = SCENE.replacen("[material", &format!("{side}[material"), 1).replace("\"no-slip\"", "\"free-slip\"");
    let scene = read(place.path(), &text).unwrap();
    let lattice = WallLattice::new(&scene);
    for k in [-3, -1, 4] {
        for n in 0..5 {
            let ([a, b], [c, d]) = ([[-1 - n, 7, k], [n, 7, k]], [[3, -1 - n, k], [3, n, k]]);
            // The lattice begins at the wall, 70 m from the plane x = 0.
            let (left, right) = (lattice.position(a), lattice.position(b));
            assert_eq!(left[2], right[2]);
            assert!((left[0] + right[0] - 140.0).abs() < 1e-9);
            assert_eq!(lattice.position(c)[2], lattice.position(d)[2]);
        }
    }
    let normal = |x| lattice.parity(x).normal.unwrap();
    let (here, beyond, across) = (normal([60.0, 30.0, 60.0]), normal([80.0, 30.0, 60.0]), normal([60.0, -30.0, 60.0]));
    let length = (1.0_f64 + 0.25 + 0.0625).sqrt();
    let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k] / length).abs() < 1e-9);
    assert!(close(here, [0.5, -0.25, 1.0]) && close(beyond, [-0.5, -0.25, 1.0]) && close(across, [0.5, 0.25, 1.0]));
    // Sites behind the wall stand above the ground, too.
    assert!(sites(&lattice, [69.0, 30.0, 90.0], 5.0).len() > 20);
}

#[test]
fn a_section_follows_the_ground_along_y_0() {
    let place = place();
    let text = SCENE.replace("\"3d\"", "\"plane-strain\"").replace("origin = [505, 305", "origin = [505, 345");
    let text = text.replace("[20, 20], [60, 20], [\"60 m\", 70], [20, 70]", "[20, -9], [60, -9], [60, 9], [20, 9]");
    let scene = read(place.path(), &text).unwrap();
    let Shape::Release(slab) = &scene.bodies[0].shape else { panic!("{:?}", scene.bodies) };
    assert!((slab.volume(scene.space, [false; 2], 2.0) - 200.0).abs() < 1e-9);
    assert!((WallLattice::new(&scene).position([10, 0, -1])[2] - (110.0 - 10.5 - 1.0)).abs() < 1e-9);
    let away = text.replace("345", "205");
    assert!(read(place.path(), &away).unwrap_err().contains("the section y = 0 lies beyond the terrain"));
    let rings = SCENE.replace("\"3d\"", "\"axisymmetric\"");
    assert!(read(place.path(), &rings).unwrap_err().contains("there is no terrain in the space"));
    assert!(Grid::read(raster(slope).as_bytes()).is_ok());
}
