//! Floors from rasters: slides down a plane against closed forms and against a plane floor under inclined gravity, and mass on
//! a valley.

use formats::folder::RunFolder;
use formats::results;
use formats::snapshot::{self, Rows};
use tests::{WorkFolder, computed, rasters, run};

const GRAVITY: f64 = 9.81;
const SPACING: f64 = 0.02;

/// A slab ten or more spacings thick on a plane that falls by `angle` towards +x.
#[derive(Clone, Copy)]
struct Slab {
    angle: f64,
    slip: &'static str,
    speed: f64,
    thickness: f64,
    length: f64,
    end: f64,
}

/// Mean velocity along the plane, and mean height above it, at the start, the middle and the end.
type Course = [[f64; 2]; 3];

impl Slab {
    fn rest(&self, body: &str, gravity: [f64; 3]) -> String {
        let end = self.end;
        format!(
            "space = \"plane-strain\"\nspacing = {SPACING}\ngravity = {gravity:?}\n\
             [material.drucker-prager]\ndensity = 1500\nyoung = \"0.3 MPa\"\npoisson = 0.3\nfriction = 30\ncohesion = 0\n\
             cone = \"plane-strain-isochoric\"\n[initial]\nstress = \"hydrostatic\"\n{body}\
             [end]\ntime = {end}\n[output]\nsnapshots = {}\nhistory = {}\n",
            0.5 * end,
            0.1 * end
        )
    }

    /// On a raster, gravity downwards.
    fn on_terrain(&self, work: &WorkFolder, name: &str) -> Course {
        let (sin, cos) = self.angle.to_radians().sin_cos();
        rasters::write(work, "plane.asc", [90, 4], [-1.0, -0.2], 0.1, |x, _| -x * sin / cos);
        let (Self { slip, speed, .. }, end) = (*self, 0.3 + self.length * cos);
        let body = format!(
            "[terrain]\nfile = \"plane.asc\"\nslip = \"{slip}\"\n\
             [body.slab]\nrelease = {{ polygon = [[0.3, -1], [{end}, -1], [{end}, 1], [0.3, 1]], thickness = {} }}\n\
             velocity = [{}, 0, {}]\n",
            self.thickness / cos,
            speed * cos,
            -speed * sin
        );
        let folder = computed(work, name, &self.rest(&body, [0.0, 0.0, -GRAVITY]), 0);
        course(&folder, |v| [v[0] * cos - v[2] * sin, v[0] * sin + v[2] * cos])
    }

    /// On a level wall, gravity inclined.
    fn on_wall(&self, work: &WorkFolder, name: &str) -> Course {
        let (sin, cos) = self.angle.to_radians().sin_cos();
        let body = format!(
            "[body.slab]\nbox = {{ min = [0.3, 0, 0], max = [{}, 0, {}] }}\nvelocity = [{}, 0, 0]\n{}",
            0.3 + self.length,
            self.thickness,
            self.speed,
            crate::wall("floor", "z", 0.0, "above", self.slip)
        );
        let gravity = [GRAVITY * sin, 0.0, -GRAVITY * cos];
        course(&computed(work, name, &self.rest(&body, gravity), 0), |v| [v[0], v[2]])
    }
}

fn course(folder: &RunFolder, turned: impl Fn([f64; 3]) -> [f64; 2]) -> Course {
    [0, 1, 2].map(|number| {
        let (_, rows) = snapshot::read(&folder.snapshot(number)).expect("a snapshot can be read");
        let mean = |of: &dyn Fn(usize) -> f64| {
            let mass: f64 = rows.mass.iter().sum();
            (0..rows.len()).map(|i| rows.mass[i] * of(i)).sum::<f64>() / mass
        };
        [mean(&|i| turned(rows.velocity[i])[0]), mean(&|i| turned(rows.position[i])[1])]
    })
}

/// Without friction the middle of the mass speeds up by g sin t, however the slab spreads.
#[test]
fn k1_a_smooth_slope() {
    let slab = Slab { angle: 30.0, slip: "free-slip", speed: 0.0, thickness: 0.2, length: 1.0, end: 0.6 };
    let work = WorkFolder::new();
    let [_, _, terrain] = slab.on_terrain(&work, "terrain");
    let exact = GRAVITY * 0.5 * slab.end;
    println!("smooth slope: {:.5} of {exact:.5} m/s, height {:.5} m", terrain[0], terrain[1]);
    // Measured 0.05 % with half the spacing; a normal that is off by a degree is 3 %.
    assert!((terrain[0] / exact - 1.0).abs() < 0.005, "{terrain:?}");
}

/// A layer that yields at its foot speeds up by g (sin t - mu cos t), with mu = sin phi in simple shear on the cone
/// alpha = sin(phi)/3; below the angle it slows down and stops.
#[test]
fn k2_a_rough_slope_steeper_than_friction() {
    let slab = Slab { angle: 35.0, slip: "no-slip", speed: 0.0, thickness: 0.3, length: 3.0, end: 0.6 };
    let work = WorkFolder::new();
    let (terrain, wall) = (slab.on_terrain(&work, "terrain"), slab.on_wall(&work, "wall"));
    let (sin, cos) = slab.angle.to_radians().sin_cos();
    let exact = GRAVITY * (sin - 0.5 * cos);
    let of = |course: Course| (course[2][0] - course[1][0]) / (0.5 * slab.end);
    println!("rough slope: {:.4} on the terrain, {:.4} on a wall, {exact:.4} m/s2", of(terrain), of(wall));
    assert!((of(terrain) / exact - 1.0).abs() < 0.1, "{} of {exact}", of(terrain));
    assert!((of(terrain) / of(wall) - 1.0).abs() < 0.08, "{} and {}", of(terrain), of(wall));
    assert!((terrain[2][1] / wall[2][1] - 1.0).abs() < 0.05, "heights {terrain:?}, {wall:?}");
}

/// The same below the angle of friction: it loses speed as on a plane floor.
#[test]
fn k3_a_rough_slope_less_steep_than_friction() {
    let slab = Slab { angle: 15.0, slip: "no-slip", speed: 1.0, thickness: 0.2, length: 1.6, end: 1.0 };
    let work = WorkFolder::new();
    let (terrain, wall) = (slab.on_terrain(&work, "terrain"), slab.on_wall(&work, "wall"));
    let (sin, cos) = slab.angle.to_radians().sin_cos();
    let stop = slab.speed / (GRAVITY * (0.5 * cos - sin));
    println!("braking slope: {terrain:.4?}, {wall:.4?}, a rigid block stops after {stop:.4} s");
    assert!(stop < 0.5 * slab.end);
    // What is still moving is the free ends that crumble.
    assert!(terrain[2][0] < 0.15 * slab.speed && (terrain[1][0] - wall[1][0]).abs() < 0.05 * slab.speed, "{terrain:?}");
    assert!((terrain[2][1] / wall[2][1] - 1.0).abs() < 0.05, "heights {terrain:?}, {wall:?}");
}

/// A valley with a paraboloid of material near its head.
fn valley(work: &WorkFolder) -> (String, f64) {
    let (size, corner, cell) = ([24, 16], [4000.0, 8000.0], 5.0);
    let away = |y: f64| (y - 8040.0) / 10.0;
    rasters::write(work, "valley.asc", size, corner, cell, |x, y| {
        300.0 + 0.004 * (4120.0 - x).powi(2) + 2.0 * away(y) * away(y) + (x / 7.0).sin()
    });
    let depth = |x: f64, y: f64| {
        let r2 = ((x - 4025.0) / 14.0).powi(2) + away(y).powi(2);
        (6.0 * (1.0 - r2)).max(0.0)
    };
    rasters::write(work, "slab.asc", size, corner, cell, depth);
    let cells = (0..16).flat_map(|j| (0..24).map(move |i| [f64::from(i) + 0.5, f64::from(j) + 0.5].map(|n| n * cell)));
    let volume = cells.map(|[x, y]| depth(x + corner[0], y + corner[1]) * cell * cell).sum();
    let text = "space = \"3d\"\nspacing = 1.5\n[material.drucker-prager]\ndensity = 1800\nyoung = \"4 MPa\"\npoisson = 0.3\n\
                friction = 20\ncohesion = 0\ncone = \"plane-strain-isochoric\"\n\
                [terrain]\nfile = \"valley.asc\"\norigin = [4000, 8000, 300]\nslip = \"no-slip\"\ncrs = \"EPSG:32632\"\n\
                [body.slab]\nrelease = { thickness-file = \"slab.asc\" }\n\
                [initial]\nstress = \"hydrostatic\"\njitter = 0.05\n[numerics]\ndensity-gate = 0.98\n\
                [end]\ntime = 5\n[output]\nsnapshots = 1\nhistory = 0.5\n";
    (text.into(), volume)
}

/// The mass is that of the raster, and stays; what flows follows the valley, above the ground; the maps hold its volume.
#[test]
fn k4_a_valley_keeps_the_mass() {
    let work = WorkFolder::new();
    let (text, volume) = valley(&work);
    let folder = computed(&work, "valley", &text, 0);
    run("sph-post", &[folder.path()], 0).expect(formats::exit::DONE);
    let mass = |rows: &Rows| rows.mass.iter().sum::<f64>();
    let (_, start) = snapshot::read(&folder.initial()).unwrap();
    let (_, end) = crate::last(&folder);
    // Densities at the start follow from the stress; without compression they are that of the scene.
    assert!((mass(&start) / (1800.0 * volume) - 1.0).abs() < 1e-9, "{} of {}", mass(&start), 1800.0 * volume);
    assert_eq!(mass(&start), mass(&end), "the same particles");
    let middle = |rows: &Rows| rows.position.iter().map(|x| x[0]).sum::<f64>() / rows.len() as f64;
    let below: f64 = crate::history(&folder, "below_floor").last().copied().unwrap();
    println!("valley: {} particles, moved {:.2} m, {below} below", end.len(), middle(&end) - middle(&start));
    assert!(middle(&end) - middle(&start) > 15.0);
    assert!(below <= 0.005 * end.len() as f64, "{below} of {} particles below the ground", end.len());

    let maps = folder.post().join("terrain.nc");
    let read = |name: &str| results::read(&maps, name).unwrap();
    let sum = |field: &[f64]| field.iter().filter(|v| v.is_finite()).map(|v| v * 25.0).sum::<f64>();
    assert!((sum(&read("deposit_thickness")) / volume - 1.0).abs() < 1e-9);
    assert_eq!((read("x")[0], read("y")[15]), (4002.5, 8077.5));
    let (most, arrival) = (read("max_thickness"), read("arrival_time"));
    let reached = most.iter().zip(&arrival).filter(|(h, t)| **h >= 0.75 && t.is_finite()).count();
    assert_eq!(reached, arrival.iter().filter(|t| t.is_finite()).count());
    // Down the valley it comes later.
    let at = |x: usize| arrival[8 * 24 + x];
    assert!(at(5) == 0.0 && at(8) > 0.0 && at(11) > at(8), "{arrival:?}");
    assert!(read("max_speed").iter().copied().fold(0.0, f64::max) > 5.0);
    assert!(read("ground").iter().all(|z| (290.0..400.0).contains(z)));
}
