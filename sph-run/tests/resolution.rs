//! What operators and walls make of smooth fields: rows C6, C7 and C15 of the list of verification problems, and E2 under
//! a load that grows slowly, which no scene can ask for.

use crate::support::{Random, alone, block, neighbors, pairs};
use formats::scene::Scene;
use formats::snapshot::Rows;
use sph_run::algebra::{Matrix, Vector};
use sph_run::dispatch::{Job, resolve};
use sph_run::parallel::halo::Fields;
use sph_run::particles::Particles;
use sph_run::physics::{CubicSpline, Kernel, Physics};
use sph_run::rates::correction::{Among, correction};
use sph_run::rates::velocity_gradient::velocity_gradient;
use sph_run::simulation::{Clock, Simulation};
use sph_run::space::{PlaneStrain, Space};
use sph_run::timestep::Requests;
use std::f64::consts::TAU;

/// Spacing, m: a power of two, so that periods of whole spacings are exact.
const DX: f64 = 0.0078125;
/// kg/m3
const DENSITY: f64 = 2600.0;

fn scene(head: &str, spacing: f64, law: &str, tail: &str) -> Scene {
    let text = format!(
        "{head}\nspacing = {spacing}\n[material.drucker-prager]\ndensity = {DENSITY}\nyoung = 5.98e6\npoisson = 0.3\n\
         friction = 30\n{law}\n[body.block]\nbox = {{ min = [0, 0, 0], max = [0.03125, 0.03125, 0.03125] }}\n\
         {tail}\n[end]\ntime = 1\n"
    );
    Scene::read("field.toml", &text).unwrap_or_else(|error| panic!("{error}"))
}

/// Lattice places from the origin on, each moved by up to `jitter` spacings.
fn rows<const D: usize, const N: usize, S: Space<D, N>>(
    sides: [usize; 3],
    spacing: f64,
    jitter: f64,
    velocity: impl Fn([f64; 3]) -> [f64; 3],
) -> Rows {
    let (mut rows, mut random) = (Rows::default(), Random(3));
    let [nx, ny, nz] = [sides[0], if D == 3 { sides[1] } else { 1 }, sides[2]];
    for k in 0..nx * ny * nz {
        let cell = [k % nx, k / nx % ny, k / nx / ny];
        let place = [0, 1, 2].map(|a| (cell[a] as f64 + 0.5 + jitter * random.next()) * spacing);
        let place = S::to_disk(S::from_disk(place));
        rows.id.push(k as u64);
        rows.position.push(place);
        rows.velocity.push(velocity(place));
    }
    let count = rows.len();
    rows.body = vec![0; count];
    rows.mass = vec![DENSITY * spacing.powi(D as i32); count];
    rows.density = vec![DENSITY; count];
    rows.stress = vec![[0.0; 6]; count];
    rows.stress_work = vec![0.0; count];
    rows.viscous_work = vec![0.0; count];
    rows.plastic_strain = vec![0.0; count];
    rows
}

/// A standing wave along x on the infinite lattice; its result: the speed of sound in it over that of the solid, and what
/// the lattice's gradient of sin(kx) over k cos(kx) makes of it.
struct Wave<'a> {
    scene: &'a Scene,
    /// Spacings in a wave.
    length: usize,
}

impl Job for Wave<'_> {
    type Output = (f64, f64);
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) -> (f64, f64) {
        let (_turn, comm) = alone();
        let c = self.scene.material.sound_speed();
        let wave_length = self.length as f64 * DX;
        let k = TAU / wave_length;
        let rows = rows::<D, N, P::Space>([self.length, 6, 6], DX, 0.0, |x| [1e-8 * c * (k * x[0]).sin(), 0.0, 0.0]);
        let particles = Particles::from_rows::<P::Space>(&rows);
        let count = particles.owned as u64;
        let mut run = Simulation::<D, N, P>::new(&comm, self.scene, material, particles, count, Clock::default());
        run.begin();
        let swing = |run: &Simulation<D, N, P>| -> f64 {
            let p = &run.particles;
            (0..p.owned).map(|i| p.v[i].0[0] * (k * p.x[i].0[0]).sin()).sum()
        };
        // From one passage through rest to the next it is half a period.
        let (mut passages, mut before) = (Vec::new(), (0.0, swing(&run)));
        while passages.len() < 2 {
            let plan = run.plan(f64::INFINITY, Requests::default()).expect("a sound state");
            run.step(&plan);
            let now = (run.clock.time, swing(&run));
            if before.1 * now.1 <= 0.0 {
                passages.push(before.0 + (now.0 - before.0) * before.1 / (before.1 - now.1));
            }
            before = now;
        }
        let measured = wave_length / (2.0 * (passages[1] - passages[0])) / c;
        (measured, lattice_slope::<D, P::Kernel>(self.scene.h_over_dx, k * DX))
    }
}

/// Gradient of sin(kx) over k cos(kx) on the infinite lattice of spacing 1.
fn lattice_slope<const D: usize, K: Kernel>(h: f64, k: f64) -> f64 {
    let reach = (2.0 * h).ceil() as i32;
    let mut sum = 0.0;
    for cell in 0..(2 * reach + 1).pow(D as u32) {
        let x: Vec<f64> =
            (0..D as u32).map(|a| f64::from(cell / (2 * reach + 1).pow(a) % (2 * reach + 1) - reach)).collect();
        let q = x.iter().map(|x| x * x).sum::<f64>().sqrt() / h;
        if q < 2.0 {
            let slope = K::KIND.norm(D) / h.powi(D as i32) * K::KIND.slope_over_q(q) / (h * h);
            sum -= (k * x[0]).sin() * slope * x[0];
        }
    }
    sum / k
}

/// C6: elastic waves are as slow as the gradient on the lattice is flat, once in the strain and once in the force: c M11. With
/// corrected gradients long waves have the speed of the solid.
#[test]
fn c6_the_speed_of_waves() {
    let walls = ["floor\"0\"above", "lid\"0.046875\"below"].map(|wall| {
        let part: Vec<_> = wall.split('"').collect();
        format!(
            "[wall.{}]\naxis = \"z\"\nat = {}\nside = \"{}\"\nslip = \"free-slip\"\nkind = \"mirror\"\n",
            part[0], part[1], part[2]
        )
    });
    for (space, slope) in [("plane-strain", 0.990_793), ("3d", 0.981_689)] {
        for correction in ["none", "variational"] {
            for length in [40, 80] {
                let across = if space == "3d" { ", y = { from = 0, to = 0.046875 }" } else { "" };
                let head = format!(
                    "space = \"{space}\"\ngravity = 0\nperiodic = {{ x = {{ from = 0, to = {} }}{across} }}",
                    length as f64 * DX
                );
                let tail = format!(
                    "{}[numerics]\nviscosity = 0\ncourant = 0.3\ngradient-correction = \"{correction}\"",
                    walls.concat()
                );
                let scene = scene(&head, DX, "cohesion = 1e9", &tail);
                let (measured, of_lattice) = resolve(&scene, Wave { scene: &scene, length });
                let wanted = if correction == "none" { slope } else { 1.0 };
                println!(
                    "C6 {space} {correction}, {length} spacings: {measured:.5} c; M11 {wanted:.5}, of this wave {of_lattice:.5}"
                );
                // The lattice's own figure at this length of wave, by (omega dt)^2/24 = 1.4e-4 of the leap-frog.
                let exact = if correction == "none" { of_lattice } else { of_lattice / slope };
                assert!((measured / exact - 1.0).abs() < 3e-4, "{space} {correction} {length}: {measured}, {exact}");
                // The row's 2e-3 holds for long waves; one of 40 spacings is slower by (k sigma)^2/2, sigma the kernel's width.
                let tolerance = if length == 40 { 8e-3 } else { 2e-3 };
                assert!((measured / wanted - 1.0).abs() < tolerance, "{space} {correction} {length}: {measured}");
            }
        }
    }
}

/// Root mean square error of the gradient of sin(k(x + z/2)) over its size, on a jittered block of `side` places a side that
/// holds one wave along x: plain inside, corrected inside, plain and corrected beside the surface.
fn errors(side: usize, jitter: f64, h: f64) -> [f64; 4] {
    let mut p = block::<2, 4, PlaneStrain>(side, jitter);
    let k = TAU / side as f64;
    for i in 0..p.owned {
        // Volume 1: the density does not vary.
        p.volume[i] = 1.0;
        p.v[i] = Vector([(k * (p.x[i].0[0] + 0.5 * p.x[i].0[1])).sin(), 0.0]);
    }
    let pairs = pairs(h);
    let neighbors = neighbors::<2, 4, CubicSpline>(&p, 2.1 * h, pairs);
    let mut gradient = vec![Matrix::default(); p.owned];
    velocity_gradient::<2, CubicSpline, f64>(&neighbors, pairs, &mut gradient);
    let mut tensors = Vec::new();
    correction::<2, 4, CubicSpline>(&p, &neighbors, pairs, Among::All, &mut tensors);
    let (mut sums, mut counts) = ([0.0; 4], [0.0; 4]);
    for i in 0..p.owned {
        let x = p.x[i].0;
        let edge = x.iter().map(|&x| x.min(side as f64 - x)).fold(f64::INFINITY, f64::min);
        let outside = if edge > 2.0 * h + 0.5 { 0 } else { 2 };
        let slope = k * (k * (x[0] + 0.5 * x[1])).cos();
        for (which, g) in [(0, gradient[i]), (1, gradient[i].product(&tensors[i]))] {
            sums[outside + which] += (g.0[0][0] - slope).powi(2) + (g.0[0][1] - 0.5 * slope).powi(2);
            counts[outside + which] += 1.25 * k * k * 0.5;
        }
    }
    std::array::from_fn(|k| f64::sqrt(sums[k] / counts[k]))
}

/// C7: with a fixed h/dx the plain gradient stays wrong by |M11 - 1| on a lattice, and by the disorder elsewhere. Corrected it
/// is of first order at surfaces, and of second inside a lattice; disorder makes that the first as well. The plain one
/// converges where h/dx grows as well, with h^2.
#[test]
fn c7_the_order_of_the_gradient() {
    let order = |coarse: f64, fine: f64, ratio: f64| (coarse / fine).ln() / ratio.ln();
    // (jitter, order inside). Measured 0.02, 2.00 and 1.02; with jitter -0.01, 1.10 and 1.02.
    for (jitter, inside) in [(0.0, 2.0), (0.15, 1.0)] {
        let runs = [80, 160].map(|side| errors(side, jitter, 1.2));
        let orders: [f64; 4] = std::array::from_fn(|k| order(runs[0][k], runs[1][k], 2.0));
        println!("C7 jitter {jitter}: {:.5?}, orders {orders:.2?}", runs[1]);
        for (which, wanted) in [(1, inside), (2, 0.0), (3, 1.0)] {
            assert!((orders[which] - wanted).abs() < 0.2, "jitter {jitter}: {orders:?}");
        }
        // Measured 0.96 % on the lattice, 1 - M11 = 0.92 %, and 6.7 % with jitter.
        let plateau = if jitter == 0.0 { 0.0086..0.0106 } else { 0.05..0.08 };
        assert!(orders[0] < 0.2 && plateau.contains(&runs[1][0]), "jitter {jitter}: {:?}", runs[1]);
    }
    let (coarse, fine) = (errors(40, 0.15, 1.5)[0], errors(160, 0.15, 3.0)[0]);
    // h is halved, dx a quarter of it. Measured 1.88.
    let in_h = order(coarse, fine, 2.0);
    println!("C7 with h/dx growing from 1.5 to 3: {coarse:.2e}, {fine:.2e}, order {in_h:.2} in h");
    assert!((in_h - 2.0).abs() < 0.2, "{in_h}");
}

/// What a no-slip floor takes from a state that varies as `field`.
struct Walls<'a, F> {
    scene: &'a Scene,
    sides: [usize; 3],
    field: F,
}

/// Largest errors of velocity and stress, against the state at the mirrored place.
type Worst = [f64; 2];

impl<F: Fn([f64; 3]) -> f64> Job for Walls<'_, F> {
    type Output = Worst;
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) -> Worst {
        let (_turn, comm) = alone();
        let spacing = self.scene.spacing;
        let rows = rows::<D, N, P::Space>(self.sides, spacing, 0.15, |_| [0.0; 3]);
        let particles = Particles::from_rows::<P::Space>(&rows);
        let count = particles.owned as u64;
        let mut run = Simulation::<D, N, P>::new(&comm, self.scene, material, particles, count, Clock::default());
        let p = &mut run.particles;
        for i in 0..p.owned {
            let value = (self.field)(P::Space::to_disk(p.x[i]));
            p.v[i] = P::Space::from_disk([1.0, 2.0, 3.0]) * value;
            p.stress[i] = P::Space::stress_from_disk([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) * value;
        }
        run.fill(Fields::Motion);
        run.fill(Fields::Stress);
        let p = &run.particles;
        // As the floor reflects them: all of the velocity, nothing of the stress.
        let v = P::Space::from_disk([-1.0, -2.0, -3.0]);
        let s = P::Space::stress_from_disk([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let stress_norm = s.contract(s).sqrt();
        let (mut worst, mut seen) = ([0.0_f64; 2], 0);
        for w in p.mirror..p.len() {
            let place = P::Space::to_disk(p.x[w]);
            let sees = (0..p.mirror).any(|j| (p.x[j] - p.x[w]).norm() < 1.999 * run.parameters.h);
            if !sees {
                continue;
            }
            seen += 1;
            let value = (self.field)([place[0], place[1], -place[2]]);
            worst[0] = worst[0].max((p.v[w] - v * value).norm() / v.norm());
            let off = p.stress[w] - s * value;
            worst[1] = worst[1].max(off.contract(off).sqrt() / stress_norm);
        }
        assert!(seen > 50, "{seen}");
        worst
    }
}

/// C15: Shepard's interpolation takes up a constant state exactly; of a linear one it misses a distance of the order of the
/// spacing (Yang et al. 2020, Eqs 27-30), whatever the spacing.
#[test]
fn c15_walls_take_up_what_is_before_them() {
    let floor = "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\n";
    for space in ["plane-strain", "3d"] {
        let worst = |refinement: usize, field: fn([f64; 3]) -> f64| {
            let spacing = DX / refinement as f64;
            let scene = scene(&format!("space = \"{space}\"\ngravity = 0"), spacing, "cohesion = 1e9", floor);
            let sides = if space == "3d" { [10, 10, 6] } else { [24, 1, 8] };
            let sides = sides.map(|side| side * refinement);
            resolve(&scene, Walls { scene: &scene, sides, field }).map(|error| error / spacing)
        };
        let constant = worst(1, |_| 1.0).map(|error| error * DX);
        // The slope is 1: errors are distances in spacings.
        let (coarse, fine) = (worst(1, |x| 0.6 * x[0] + 0.8 * x[2]), worst(2, |x| 0.6 * x[0] + 0.8 * x[2]));
        println!("C15 {space}: constant {constant:?}; linear {coarse:.3?} dx, {fine:.3?} of half the dx");
        // Rounding of a sum of some twenty weights.
        assert!(constant.iter().all(|e| *e < 1e-14), "{constant:?}");
        for error in coarse.into_iter().chain(fine) {
            // All that it sees is within 2h = 2.4 dx.
            assert!((0.2..2.4).contains(&error), "{coarse:?} {fine:?}");
        }
    }
}

/// K0 of a column between smooth sides under a weight that grows over a time, after it has come to rest.
struct Loading<'a> {
    scene: &'a Scene,
    /// s
    growth: f64,
}

impl Job for Loading<'_> {
    type Output = (f64, [f64; 2]);
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) -> Self::Output {
        let (_turn, comm) = alone();
        let rows = rows::<D, N, P::Space>([8, 1, 20], DX, 0.0, |_| [0.0; 3]);
        let particles = Particles::from_rows::<P::Space>(&rows);
        let count = particles.owned as u64;
        let mut run = Simulation::<D, N, P>::new(&comm, self.scene, material, particles, count, Clock::default());
        let full = run.gravity;
        run.begin();
        while run.clock.time < self.growth + 0.2 {
            let plan = run.plan(self.growth + 0.2, Requests::default()).expect("a sound state");
            run.gravity = full * (plan.time / self.growth).min(1.0);
            run.step(&plan);
        }
        let p = &run.particles;
        let mut of_rows = vec![[0.0; 2]; 20];
        for i in 0..p.owned {
            let s = P::Space::stress_to_disk(p.stress[i]);
            let row = &mut of_rows[(p.x[i].0[D - 1] / DX) as usize];
            *row = [row[0] + s[0], row[1] + s[2]];
        }
        let all = of_rows.iter().fold([0.0; 2], |sum, row| [sum[0] + row[0], sum[1] + row[1]]);
        let ratios = || of_rows.iter().map(|row| row[0] / row[1]);
        (all[0] / all[1], [ratios().fold(f64::INFINITY, f64::min), ratios().fold(0.0, f64::max)])
    }
}

/// E2: with Bui's cone at 30 degrees a column yields as it is loaded, and K0 is that of the oedometer, 0.4648. Where gravity
/// comes on at once the overshoot locks in more.
#[test]
fn e2_plastic_columns_under_a_growing_weight() {
    let head = "space = \"plane-strain\"\nperiodic = { x = { from = 0, to = 0.0625 } }";
    let floor = "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"free-slip\"\nkind = \"mirror\"\n";
    let law = "cohesion = 0\ncone = \"plane-strain\"";
    let scene = scene(head, DX, law, &format!("{floor}[numerics]\ndamping = 60\ndamping-in-flow = \"forced\""));
    let k0 = [1e-6, 0.1, 0.4].map(|growth| {
        let (k0, range) = resolve(&scene, Loading { scene: &scene, growth });
        println!("E2 in {growth} s: {k0:.5}, rows {range:.4?}");
        k0
    });
    // Measured 0.4959; the prototype of the list had 0.499.
    assert!((0.46..0.56).contains(&k0[0]), "{k0:?}");
    // The row's 0.5 %: measured 0.14 and 0.04 % more than the cone's.
    for k0 in &k0[1..] {
        assert!((k0 / 0.464_816 - 1.0).abs() < 0.005, "{k0}");
    }
}
