//! Makes run folders without the other stages.

use formats::{
    folder::RunFolder,
    h5::Communicator,
    outputs::{Index, Segment},
    scene::{Scene, Shape},
    schema::Kept,
    snapshot::{self, Header, Rows},
    space::Space,
};
use std::f64::consts::PI;
use std::fmt::Write;
use std::sync::{Mutex, MutexGuard, OnceLock};
use tempfile::TempDir;

/// A scene for every space.
pub struct Case {
    pub name: &'static str,
    pub text: &'static str,
    /// What the staircase of a round body on a square lattice costs in area.
    pub round: f64,
}

pub const SCENES: [Case; 3] = [
    Case { name: "axisymmetric", text: AXISYMMETRIC, round: 1e-9 },
    Case { name: "plane-strain", text: PLANE, round: 1e-9 },
    Case { name: "3d", text: SPACE, round: 0.06 },
];

const AXISYMMETRIC: &str = r#"
title = "Cylinder collapse, a = 1"
space = "axisymmetric"
spacing = "4 mm"
[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.column]
cylinder = { radius = "0.1 m", height = "0.1 m" }
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "0.4 s"
"#;

const PLANE: &str = r#"
title = "Column collapse in the plane"
space = "plane-strain"
spacing = "4 mm"
symmetry = ["x"]
[kernel]
kind = "wendland-c2"
h-over-dx = 1.5
[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.column]
box = { min = ["0 m", "0 m", "0 m"], max = ["0.1 m", "0 m", "0.1 m"] }
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "0.4 s"
"#;

const SPACE: &str = r#"
title = "Cylinder collapse, a quarter"
space = "3d"
spacing = "5 mm"
symmetry = ["x", "y"]
[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.column]
cylinder = { radius = "0.1 m", height = "0.1 m" }
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "0.4 s"
"#;

/// MPI is started once in this process, and only one test at a time may use it.
fn world() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    static STARTED: OnceLock<()> = OnceLock::new();
    let guard = ONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    STARTED.get_or_init(|| std::mem::forget(mpi::initialize_with_threading(mpi::Threading::Serialized).unwrap()));
    guard
}

/// A run folder in the making.
pub struct Made {
    pub run: RunFolder,
    pub scene: Scene,
    text: &'static str,
    _folder: TempDir,
}

impl Made {
    pub fn new(text: &'static str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::new(folder.path().join("run"));
        std::fs::create_dir_all(run.history_pieces()).unwrap();
        std::fs::write(run.scene(), text).unwrap();
        let scene = Scene::read("scene", text).unwrap();
        Self { run, scene, text, _folder: folder }
    }

    fn write(&self, path: &std::path::Path, time: f64, step: u64, rows: &Rows) {
        let s = &self.scene;
        let header = Header {
            title: s.title.clone(),
            scene_hash: Scene::hash(self.text),
            space: s.space,
            kernel: s.kernel,
            spacing: s.spacing,
            h: s.h(),
            gravity: s.gravity,
            time,
            step,
            count: rows.len() as u64,
        };
        let _guard = world();
        snapshot::write(path, &header, rows, Kept::Everywhere, &Communicator::world()).unwrap();
    }

    pub fn initial(&self, rows: &Rows) {
        self.write(&self.run.initial(), 0.0, 0, rows);
    }

    pub fn snapshot(&self, number: u64, time: f64, step: u64, rows: &Rows) {
        self.write(&self.run.snapshot(number), time, step, rows);
        self.segment(time, step, "", Some((number, snapshot::digest(&self.run.snapshot(number)).unwrap())));
    }

    /// All lines of the history, with the names of its columns.
    pub fn history(&self, text: &str) {
        self.segment(f64::MAX, 0, text, None);
    }

    /// One segment more, in place of an earlier one with that snapshot, or without any.
    fn segment(&self, time: f64, step: u64, text: &str, snapshot: Option<(u64, String)>) {
        let mut index = Index::read(&self.run).unwrap().unwrap_or_default();
        let number = snapshot.as_ref().map_or(index.segments.len() as u64, |(number, _)| *number);
        index.segments.retain(|segment| segment.number != number && (snapshot.is_some() || segment.snapshot.is_some()));
        index.segments.push(Segment::write(&self.run, (number, step, time), "", text, snapshot).unwrap());
        index.write(&self.run).unwrap();
    }
}

/// The particles of a scene's one body on their lattice.
pub fn block(scene: &Scene) -> Rows {
    let dx = scene.spacing;
    let n = (0.1 / dx).round() as usize;
    let mut rows = Rows::default();
    for i in 0..n {
        for j in 0..if scene.space == Space::ThreeD { n } else { 1 } {
            for k in 0..n {
                let y = if scene.space == Space::ThreeD { (j as f64 + 0.5) * dx } else { 0.0 };
                let x = [(i as f64 + 0.5) * dx, y, (k as f64 + 0.5) * dx];
                let round = matches!(scene.bodies[0].shape, Shape::Cylinder { .. });
                if round && x[0].hypot(x[1]) >= 0.1 {
                    continue;
                }
                let volume = match scene.space {
                    Space::PlaneStrain => dx * dx,
                    Space::Axisymmetric => 2.0 * PI * x[0] * dx * dx,
                    Space::ThreeD => dx * dx * dx,
                };
                rows.id.push(rows.id.len() as u64);
                rows.body.push(0);
                rows.position.push(x);
                rows.velocity.push([0.0; 3]);
                rows.mass.push(2600.0 * volume);
                rows.density.push(2600.0);
                rows.stress.push([0.0; 6]);
                rows.stress_work.push(0.0);
                rows.viscous_work.push(0.0);
                rows.plastic_strain.push(0.0);
            }
        }
    }
    rows
}

/// Stress at rest, K0 = 3/7, under a surface 0.1 m high.
pub fn hydrostatic(scene: &Scene, rows: &mut Rows) {
    for (s, x) in rows.stress.iter_mut().zip(&rows.position) {
        let v = 2600.0 * scene.gravity[2] * (0.1 - x[2]);
        *s = [v * 3.0 / 7.0, v * 3.0 / 7.0, v, 0.0, 0.0, 0.0];
    }
}

/// Eleven snapshots and a history, in which energies add up, of a column that turns into a cone (a wedge in plane strain), filled anew with
/// particles at each time: no mechanics, but all that pictures need.
pub fn spreading(made: &Made) {
    let (start, end) = (block(&made.scene), 4.0 * (0.1_f64 / 9.81).sqrt());
    made.initial(&start);
    for k in 0..=10_u64 {
        made.snapshot(k, 0.1 * k as f64 * end, 100 * k, &frustum(&made.scene, 0.1 * k as f64));
    }
    let mut text = String::from(
        "time [s],step [1],kinetic_energy [J],potential_energy [J],elastic_energy [J],stress_work [J],viscous_work [J],\
         max_speed [m/s]\n",
    );
    for k in 0..=100 {
        let s = f64::from(k) / 100.0;
        let (kinetic, potential) = (2.0 * (s * (1.0 - s)).powi(2), 1.0 - 0.5 * s * s * (3.0 - 2.0 * s));
        let lost = 1.0 - kinetic - potential;
        let (stress, viscous) = (0.9 * lost, 0.1 * lost);
        let _ =
            writeln!(text, "{:e},{k},{kinetic:e},{potential:e},{:e},{stress:e},{viscous:e},{kinetic:e}", s * end, 1e-4);
    }
    made.history(&text);
}

/// The column on its way (0 to 1) to a cone: a frustum of the same volume.
fn frustum(scene: &Scene, way: f64) -> Rows {
    let (dx, s) = (scene.spacing, way * way * (3.0 - 2.0 * way));
    let (top, base) = (0.1 * (1.0 - s), 0.1 + 0.12 * s);
    let height = match scene.space {
        Space::PlaneStrain => 0.1 * 0.1 * 2.0 / (top + base),
        _ => 3.0 * 0.1_f64.powi(3) / (top * top + top * base + base * base),
    };
    let n = [(base / dx).ceil() as usize, if scene.space == Space::ThreeD { (base / dx).ceil() as usize } else { 1 }];
    let mut rows = Rows::default();
    let mut state = 1_u64;
    for i in 0..n[0] {
        for j in 0..n[1] {
            for k in 0..(height / dx).ceil() as usize {
                let y = if scene.space == Space::ThreeD { (j as f64 + 0.5) * dx } else { 0.0 };
                let mut x = [(i as f64 + 0.5) * dx, y, (k as f64 + 0.5) * dx];
                let r = x[0].hypot(x[1]);
                let surface = height * ((base - r) / (base - top).max(1e-9)).min(1.0);
                if r >= base || x[2] >= surface {
                    continue;
                }
                let volume = match scene.space {
                    Space::PlaneStrain => dx * dx,
                    Space::Axisymmetric => 2.0 * PI * x[0] * dx * dx,
                    Space::ThreeD => dx * dx * dx,
                };
                for &a in scene.space.axes() {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    x[a] += 0.3 * s.min(1.0) * dx * ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5);
                }
                let speed = 3.0 * way * (1.0 - way);
                let p = -2600.0 * 9.81 * (surface - x[2]).max(0.0);
                rows.id.push(rows.id.len() as u64);
                rows.body.push(0);
                rows.position.push(x);
                rows.velocity.push([speed * x[0] / base, speed * x[1] / base, -speed * x[2] / base]);
                rows.mass.push(2600.0 * volume);
                rows.density.push(2600.0);
                rows.stress.push([0.45 * p, 0.45 * p, p, 0.0, 0.2 * p * x[1] / base, 0.2 * p * x[0] / base]);
                rows.stress_work.push(0.0);
                rows.viscous_work.push(0.0);
                rows.plastic_strain.push(s);
            }
        }
    }
    rows
}
