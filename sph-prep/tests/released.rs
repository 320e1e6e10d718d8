//! Released material: columns on the ground, their mass, and the stress at the start.

use formats::scene::{Scene, WallLattice};
use sph_prep::{fill, initial::Stress, lattice::Lattice};
use std::fs;

/// A plane that falls by 3 in 4 towards +x, and a slab of some thickness on it.
fn scene(thickness: &str, stress: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let row: Vec<String> = (0..12).map(|i| (-0.75 * (f64::from(i) + 0.5)).to_string()).collect();
    let text =
        format!("ncols 12\nnrows 10\nxllcorner 0\nyllcorner 0\ncellsize 1\n{}", (row.join(" ") + "\n").repeat(10));
    fs::write(folder.path().join("plane.asc"), text).unwrap();
    let text = format!(
        "space = \"3d\"\nspacing = 0.25\n[material.drucker-prager]\ndensity = 2000\nyoung = 1e7\npoisson = 0.3\n\
         friction = 30\ncohesion = 0\n[terrain]\nfile = \"plane.asc\"\nslip = \"no-slip\"\n\
         [body.slab]\nrelease = {{ polygon = [[2, 2], [8, 2], [8, 7.1], [2, 7.1]], {thickness} }}\n\
         [initial]\n{stress}\n[end]\ntime = 1\n"
    );
    Scene::read(&folder.path().join("scene.toml").display().to_string(), &text).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn columns_stand_on_those_of_the_wall_and_hold_the_volume() {
    for thickness in [1.0, 0.9, 0.3] {
        let scene = scene(&format!("thickness = {thickness}"), "");
        let (lattice, walls) = (Lattice::new(&scene, 0), WallLattice::new(&scene));
        let mut volume = 0.0;
        for column in (0..lattice.columns()).map(|c| lattice.column(c)).filter(|c| c.cells > 0) {
            let [i, j] = [column.x, column.y].map(|x| (x / 0.25 - 0.5).round() as i32);
            let site = walls.position([i, j, -1]);
            assert!((site[0] - column.x).abs() < 1e-12 && (site[1] - column.y).abs() < 1e-12);
            assert_eq!(column.cells, (thickness / 0.25_f64).round() as u64);
            // From the ground, half-way between the first particle and its image, to the surface.
            let pitch = thickness / column.cells as f64 * lattice.scale;
            let ground = site[2] + 0.125;
            assert!((lattice.z(column, 0) - ground - 0.5 * pitch).abs() < 1e-12);
            volume += column.cells as f64 * lattice.bulk_volume(&column);
        }
        // 6 x 5.1 of which the columns cover 6 x 5; the rest makes them thicker.
        assert!((volume / (6.0 * 5.1 * thickness) - 1.0).abs() < 0.01, "{volume}");
        assert!((volume / lattice.solid.ideal_volume() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_weight_that_acts_across_the_ground_is_the_stress() {
    let scene = scene("thickness = 1", "stress = \"k0\"\nk0 = 0.4");
    let (lattices, n) = (fill::lattices(&scene), [0.6, 0.0, 0.8]);
    let s = Stress::new(&scene).at(&lattices, [5.0, 4.0], -0.75 * 5.0 + 0.25);
    let t = [s[0] * n[0] + s[5] * n[2], s[3] * n[0] + s[4] * n[2], s[5] * n[0] + s[2] * n[2]];
    // Three quarters of a metre below the surface along z, 0.6 m across the ground.
    let across = -2000.0 * 9.81 * 0.75 * 0.64;
    assert!((0..3).all(|a| (t[a] - across * n[a]).abs() < 1e-6), "{t:?}");
    // Along the ground, and along y, 0.4 of that.
    let along = s[0] * 0.64 + s[2] * 0.36 - 2.0 * s[5] * 0.48;
    assert!((along - 0.4 * across).abs() < 1e-6 && (s[1] - 0.4 * across).abs() < 1e-6, "{s:?}");
}
