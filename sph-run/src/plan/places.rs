//! Where the particles are that a plan is made for: those of a run folder, or a scene's, laid out at its spacing without
//! what `sph-prep` does beyond (fitted lattices, relaxation): about as many, in the same places but for a spacing.

use crate::error::RunError;
use formats::folder::RunFolder;
use formats::laws::{lube_plane_runout, lube_runout};
use formats::outputs::Index;
use formats::scene::{Scene, Shape, Wall};
use formats::snapshot;
use formats::space::Space;
use std::path::Path;

/// How far a scene's collapse has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum State {
    /// As it starts.
    Start,
    /// Half of the run-out.
    Spreading,
    /// At rest again.
    Deposit,
}

impl State {
    /// Its word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Spreading => "spreading",
            Self::Deposit => "deposit",
        }
    }
}

/// Particles and the scene they belong to.
#[derive(Debug)]
pub struct Source {
    pub scene: Scene,
    pub points: Vec<[f64; 3]>,
    /// Particles that each of the points stands for.
    pub weight: f64,
    /// Where they are from, for people.
    pub origin: String,
}

impl Source {
    /// Of a scene file (a path that ends in .toml) or of a run folder: its newest snapshot, else its start. Of a scene with
    /// more particles than `sample` about so many places are taken, at random.
    ///
    /// # Errors
    /// Where nothing usable is there.
    pub fn read(path: &Path, state: State, sample: u64) -> Result<Self, RunError> {
        let is_scene = path.extension().is_some_and(|extension| extension == "toml");
        let folder = RunFolder::new(path);
        let file = if is_scene { path.to_owned() } else { folder.scene() };
        let text = std::fs::read_to_string(&file).map_err(|error| snapshot::FileError::reading(&file, &error))?;
        let scene = Scene::read(&file.display().to_string(), &text)?;
        if !is_scene {
            if state != State::Start {
                let message = format!("{}: --state is for scenes; a run has the places it has", path.display());
                return Err(RunError::Plan(message));
            }
            let index = Index::read(&folder)?.unwrap_or_default();
            let newest = index.snapshots().map(|(number, _)| folder.snapshot(number)).last();
            let file = newest.unwrap_or_else(|| folder.initial());
            let (header, rows) = snapshot::read(&file)?;
            let origin = format!("{} at t = {:.4} s", file.display(), header.time);
            return Ok(Self { scene, points: rows.position, weight: 1.0, origin });
        }
        if scene.bodies.iter().any(|body| matches!(body.shape, Shape::Release(_))) {
            let message = "released material is planned from its run folder: let sph-prep make it first";
            return Err(RunError::Plan(format!("{}: {message}", path.display())));
        }
        let about = volume(&scene) / scene.spacing.powi(scene.space.dimension() as i32);
        let mut origin = format!("{} ({})", path.display(), state.name());
        let mut coarser = scene.clone();
        if about > sample as f64 {
            coarser.spacing *= (about / sample as f64).powf(1.0 / scene.space.dimension() as f64);
            // Anywhere in its cell: distances to the planes of a coarser lattice would mean nothing.
            coarser.initial.jitter = 0.5;
            origin += ", a sample";
        }
        let points = points(&coarser, state);
        if points.is_empty() {
            return Err(RunError::Plan(format!("{}: no body holds a particle at this spacing", path.display())));
        }
        let weight = (coarser.spacing / scene.spacing).powi(scene.space.dimension() as i32);
        Ok(Self { scene, points, weight, origin })
    }
}

impl Source {
    /// Number of particles.
    pub fn count(&self) -> u64 {
        (self.points.len() as f64 * self.weight).round() as u64
    }
}

const REFUSED: &str = "scenes with released material are refused as they are read";

/// Volume of the bodies, in the plane spaces their section, without regard of symmetry.
fn volume(scene: &Scene) -> f64 {
    let volume = |shape: &Shape| {
        let flat = scene.space != Space::ThreeD;
        match *shape {
            Shape::Cylinder { radius, height, .. } if flat => radius * height,
            Shape::Cylinder { radius, height, .. } => std::f64::consts::PI * radius * radius * height,
            Shape::Box { min, max } => scene.space.axes().iter().map(|&a| max[a] - min[a]).product(),
            Shape::Wedge { size, .. } => 0.5 * scene.space.axes().iter().map(|&a| size[a]).product::<f64>(),
            Shape::Release(_) => unreachable!("{REFUSED}"),
        }
    };
    scene.bodies.iter().map(|body| volume(&body.shape)).sum()
}

/// Particles of a scene, body by body, x slowest, z fastest.
pub fn points(scene: &Scene, state: State) -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for body in &scene.bodies {
        match state {
            State::Start => lay(scene, &at_start(scene, &body.shape), scene.initial.jitter, &mut points),
            // A deposit is not a lattice any more.
            State::Spreading => {
                lay(scene, &spread(scene, &body.shape, 0.5), scene.initial.jitter.max(0.3), &mut points)
            }
            State::Deposit => lay(scene, &spread(scene, &body.shape, 1.0), scene.initial.jitter.max(0.3), &mut points),
        }
    }
    points
}

/// What a body stands on, and how high it is.
struct Heap {
    /// Where cells are counted from, m.
    origin: [f64; 3],
    /// Cells along x and y, from the first to before the last.
    cells: [std::ops::Range<i64>; 2],
    /// Height over a place of the foot relative to the origin, m.
    top: Box<dyn Fn(f64, f64) -> f64>,
}

/// Fills a heap with a cubic lattice, each particle shifted by up to `jitter` spacings.
fn lay(scene: &Scene, heap: &Heap, jitter: f64, points: &mut Vec<[f64; 3]>) {
    let (dx, origin, three) = (scene.spacing, heap.origin, scene.space == Space::ThreeD);
    let first = points.len();
    let symmetric = [scene.symmetry[0] || scene.space == Space::Axisymmetric, scene.symmetry[1]];
    for i in heap.cells[0].clone() {
        for j in heap.cells[1].clone() {
            let (u, v) = ((i as f64 + 0.5) * dx, if three { (j as f64 + 0.5) * dx } else { 0.0 });
            let (x, y) = (origin[0] + u, if three { origin[1] + v } else { 0.0 });
            if (symmetric[0] && x <= 0.0) || (three && symmetric[1] && y <= 0.0) {
                continue;
            }
            let layers = ((heap.top)(u, v) / dx).round().max(0.0) as u64;
            points.extend((0..layers).map(|k| [x, y, origin[2] + (k as f64 + 0.5) * dx]));
        }
    }
    if jitter > 0.0 {
        for (n, x) in points.iter_mut().enumerate().skip(first) {
            for &a in scene.space.axes() {
                x[a] += jitter * dx * random(3 * n as u64 + a as u64);
            }
        }
    }
}

/// Number in [-1, 1) from a place in a sequence (Steele et al. 2014).
fn random(n: u64) -> f64 {
    let mut z = n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn at_start(scene: &Scene, shape: &Shape) -> Heap {
    let dx = scene.spacing;
    let cells = |size: f64| (size / dx).round() as i64;
    let flat = scene.space != Space::ThreeD;
    match *shape {
        Shape::Cylinder { base, radius, height } => {
            let n = (radius / dx).ceil() as i64;
            let across = if flat { 0..1 } else { -n..n };
            let first = if flat { 0 } else { -n };
            let top = move |u: f64, v: f64| if u.hypot(v) < radius { height } else { 0.0 };
            Heap { origin: base, cells: [first..n, across], top: Box::new(top) }
        }
        Shape::Box { min, max } => {
            let height = max[2] - min[2];
            let across = if flat { 1 } else { cells(max[1] - min[1]) };
            Heap { origin: min, cells: [0..cells(max[0] - min[0]), 0..across], top: Box::new(move |_, _| height) }
        }
        Shape::Wedge { corner, size, falls_left } => {
            let n = cells(size[0]);
            let along = if falls_left { -n..0 } else { 0..n };
            let across = if flat { 1 } else { cells(size[1]) };
            let top = move |u: f64, _: f64| size[2] * (1.0 - u.abs() / size[0]);
            Heap { origin: corner, cells: [along, 0..across], top: Box::new(top) }
        }
        Shape::Release(_) => unreachable!("{REFUSED}"),
    }
}

/// A body after `share` of its run-out, with the run-outs of columns that collapse (Lube et al. 2004, 2005): a plateau as
/// high as the column with a slope of one inclination around it, or the slope alone, of the column's volume.
fn spread(scene: &Scene, shape: &Shape, share: f64) -> Heap {
    let dx = scene.spacing;
    let flat = scene.space != Space::ThreeD;
    let axis = scene.space == Space::Axisymmetric;
    let round = axis || matches!(shape, Shape::Cylinder { .. });
    let (low, high, volume) = match *shape {
        Shape::Cylinder { base: [x, y, z], radius, height } => {
            ([x - radius, y - radius, z], [x + radius, y + radius, z + height], 1.0)
        }
        Shape::Box { min, max } => (min, max, 1.0),
        Shape::Wedge { corner: [x, y, z], size, falls_left } => {
            let start = if falls_left { x - size[0] } else { x };
            ([start, y, z], [start + size[0], y + size[1], z + size[2]], 0.5)
        }
        Shape::Release(_) => unreachable!("{REFUSED}"),
    };
    let held = |side: f64| scene.walls.iter().any(|wall: &Wall| wall.axis == 0 && wall.side == side);
    let (left, right) = (held(1.0) || scene.symmetry[0], held(-1.0));
    // The line the material leaves, and how far it reaches from there at first.
    let middle = match (left, right) {
        _ if axis => 0.0,
        (true, false) if !round => low[0],
        (false, true) if !round => high[0],
        _ => 0.5 * (low[0] + high[0]),
    };
    let (length, height) = ((high[0] - middle).max(middle - low[0]), volume * (high[2] - low[2]));
    let aspect = height / length;
    // Where the law of channels has a gap or ends, its upper branch stands in.
    let in_channel = || lube_plane_runout(aspect).unwrap_or_else(|| 1.9 * aspect.powf(2.0 / 3.0));
    let run_out = if round { lube_runout(aspect) } else { in_channel() };
    let end = length * (1.0 + share * run_out);
    // Half widths of the plateau: of a frustum end^2 + end p + p^2 = 3 length^2, of a trapezium end + p = 2 length.
    let plateau = match round {
        true => 0.5 * ((12.0 * length * length - 3.0 * end * end).max(end * end).sqrt() - end),
        false => (2.0 * length - end).max(0.0),
    };
    let crest = match (plateau > 0.0, round) {
        (true, _) => height,
        (false, true) => 3.0 * height * (length / end).powi(2),
        (false, false) => 2.0 * height * length / end,
    };
    let top = move |distance: f64| crest * ((end - distance) / (end - plateau)).clamp(0.0, 1.0);
    let n = (end / dx).ceil() as i64;
    if round {
        let across = if flat { 0..1 } else { -n..n };
        let first = if flat { 0 } else { -n };
        let origin = [middle, 0.5 * (low[1] + high[1]), low[2]];
        return Heap { origin, cells: [first..n, across], top: Box::new(move |u, v| top(u.hypot(v))) };
    }
    let (from, to) = match (left, right) {
        (true, false) => (0, n),
        (false, true) => (-n, 0),
        _ => (-n, n),
    };
    let across = if flat { 1 } else { ((high[1] - low[1]) / dx).round() as i64 };
    Heap { origin: [middle, low[1], low[2]], cells: [from..to, 0..across], top: Box::new(move |u, _| top(u.abs())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(space: &str, body: &str) -> Scene {
        let text = format!(
            "space = \"{space}\"\nspacing = \"5 mm\"\n[material.drucker-prager]\ndensity = \"2600 kg/m3\"\n\
             young = \"6 MPa\"\npoisson = 0.3\nfriction = \"30 deg\"\ncohesion = \"0 Pa\"\n[body.column]\n{body}\n\
             [wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n[end]\ntime = \"1 s\"\n"
        );
        Scene::read("scene.toml", &text).unwrap()
    }

    #[test]
    fn spread_bodies_keep_their_volume_and_reach_further() {
        let cases = [
            ("3d", "box = { min = [0, 0, 0], max = [\"0.2 m\", \"0.05 m\", \"0.1 m\"] }"),
            ("3d", "cylinder = { radius = \"0.1 m\", height = \"0.3 m\" }"),
            ("3d", "cylinder = { radius = \"0.1 m\", height = \"0.05 m\" }"),
            ("axisymmetric", "box = { min = [0, 0, 0], max = [\"0.1 m\", 0, \"0.1 m\"] }"),
            ("plane-strain", "wedge = { corner = [0, 0, 0], size = [\"0.3 m\", 0, \"0.2 m\"], falls = \"right\" }"),
        ];
        for (space, body) in cases {
            let scene = scene(space, body);
            let [start, spreading, deposit] =
                [State::Start, State::Spreading, State::Deposit].map(|state| points(&scene, state));
            let furthest = |points: &[[f64; 3]]| points.iter().map(|x| x[0]).fold(f64::MIN, f64::max);
            assert!(furthest(&start) < furthest(&spreading) && furthest(&spreading) < furthest(&deposit), "{body}");
            let exact = volume(&scene) / 0.005f64.powi(scene.space.dimension() as i32);
            // Layers are whole cells.
            assert!((start.len() as f64 / exact - 1.0).abs() < 0.02, "{body}: {} of {exact}", start.len());
            if space != "axisymmetric" {
                for state in [&spreading, &deposit] {
                    assert!((state.len() as f64 / exact - 1.0).abs() < 0.05, "{body}: {} of {exact}", state.len());
                }
            }
            assert!(deposit.iter().all(|x| scene.space == Space::ThreeD || x[1] == 0.0));
        }
    }

    #[test]
    fn planes_of_symmetry_cut() {
        let body = "cylinder = { radius = \"0.1 m\", height = \"0.1 m\" }";
        let mut scene = scene("3d", body);
        let whole = points(&scene, State::Start).len();
        scene.symmetry = [true, true];
        let quarter = points(&scene, State::Start);
        assert_eq!(4 * quarter.len(), whole);
        assert!(quarter.iter().all(|x| x[0] > 0.0 && x[1] > 0.0));
    }
}
