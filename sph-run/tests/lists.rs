//! When neighbour lists are built, and with them copies and images, changes no bit of the answer: also where particles cross
//! planes of symmetry in between, and with everything on that a scene may switch on.

use crate::support::{Random, alone};
use formats::scene::Scene;
use sph_run::dispatch::{Job, resolve};
use sph_run::particles::{Particles, id, key};
use sph_run::physics::Physics;
use sph_run::simulation::{Clock, Simulation};
use sph_run::timestep::Requests;
use std::collections::BTreeMap;

const SIDE: usize = 6;
const LAWS: [&str; 3] = [
    "[material.drucker-prager]\ndensity = 2000\nyoung = 1e6\npoisson = 0.3\nfriction = 30\ncohesion = 1e3\n\
     [numerics]\nstress-diffusion = 0.2\ngradient-correction = \"variational\"\nartificial-stress = 0.3\n\
     quadratic-viscosity = 1\nshifting = 0.5",
    "[material.mu-i]\ndensity = 2000\nsound-speed = 20\nfriction-static = 0.4\nunyielded = \"elastic\"\n\
     tension = \"kept\"\n[numerics]\nstress-diffusion = 0.2\ndensity-diffusion = 0.2",
    "[material.visco-plastic]\ndensity = 2000\nsound-speed = 20\nfriction = 20\ncohesion = 1e2\nviscosity = 1\n\
     viscosity-solid = 20\n[numerics]\ndensity-diffusion = 0.2\nshifting = 0.5",
];

/// State of every particle by its number after some steps, and how many crossed a plane of symmetry.
struct Run<'a> {
    scene: &'a Scene,
    always_rebuild: bool,
}

impl Job for Run<'_> {
    type Output = (BTreeMap<u64, Vec<u64>>, usize, usize);
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) -> Self::Output {
        let (_turn, comm) = alone();
        let (mut random, mut particles) = (Random(3), Particles::<D, N>::default());
        let dx = self.scene.spacing;
        for n in 0..SIDE.pow(D as u32) {
            let place: sph_run::algebra::Vector<D> =
                sph_run::algebra::Vector(std::array::from_fn(|a| (n / SIDE.pow(a as u32) % SIDE) as f64 + 0.5));
            particles.key.push(key(n as u64, 0));
            // The first layer lies so close to the planes that random velocities carry it across.
            let near = |x: f64| if x < 1.0 { 0.02 * dx } else { x * dx };
            particles.x.push(sph_run::algebra::Vector(place.0.map(near)));
            particles.v.push(random.vector(1.0));
            particles.stress.push(random.sym(2e3));
            particles.a.push(Default::default());
            particles.mass.push(2000.0 * dx.powi(D as i32));
            particles.density.push(2000.0 * (1.02 + 0.02 * random.next()));
            particles.history.push(Default::default());
            particles.work.push(Default::default());
            particles.body.push(0);
        }
        let count = particles.key.len();
        particles.own(count);
        let mut run =
            Simulation::<D, N, P>::new(&comm, self.scene, material, particles, count as u64, Clock::default());
        run.begin();
        let (mut rebuilds, mut crossings) = (0, 0);
        for _ in 0..40 {
            let mut plan = run.plan(f64::INFINITY, Requests::default()).expect("a sound state");
            let v_x = |run: &Simulation<D, N, P>| -> BTreeMap<u64, f64> {
                (0..count).map(|i| (run.particles.key[i], run.particles.v[i].0[0])).collect()
            };
            let before = v_x(&run);
            plan.lists_go_stale |= self.always_rebuild;
            rebuilds += usize::from(plan.lists_go_stale);
            run.step(&plan);
            // A reflection turns the velocity around at once.
            let turned = |(key, v): (&u64, &f64)| *v < -0.1 && (before[key] + v).abs() > 0.0 && v_x(&run)[key] > 0.1;
            crossings += before.iter().filter(|&(key, v)| turned((key, v))).count();
        }
        let p = &run.particles;
        let state = |i: usize| {
            let mut bits: Vec<u64> = [p.x[i].0, p.v[i].0, p.a[i].0].iter().flatten().map(|f| f.to_bits()).collect();
            bits.extend(p.stress[i].0.iter().map(|f| f.to_bits()));
            bits.extend([p.density[i], p.work[i].stress, p.work[i].viscous].map(f64::to_bits));
            (id(p.key[i]), bits)
        };
        ((0..p.owned).map(state).collect(), rebuilds, crossings)
    }
}

/// The skin of the next lists over h, for steps in which particles go no further than `farthest` h.
struct Skin<'a> {
    scene: &'a Scene,
    farthest: f64,
}

impl Job for Skin<'_> {
    type Output = f64;
    fn run<const D: usize, const N: usize, P: Physics<D, N>>(self, material: P::Material) -> f64 {
        let (_turn, comm) = alone();
        let nobody = Particles::<D, N>::default();
        let mut run = Simulation::<D, N, P>::new(&comm, self.scene, material, nobody, 0, Clock::default());
        run.choose_skin(self.farthest * run.parameters.h);
        run.parameters.skin / run.parameters.h
    }
}

/// Lists of a fast flow are thicker, so that they serve for some steps, but not where a period has no room for them.
#[test]
fn lists_are_thicker_in_fast_flow() {
    let skin = |period: &str, farthest: f64| {
        let text = format!(
            "space = \"plane-strain\"\nspacing = 0.01\n{period}{}\n[body.block]\n\
             box = {{ min = [0, 0, 0], max = [0.06, 0.06, 0.06] }}\n[end]\ntime = 1\n",
            LAWS[0].split("[numerics]").next().unwrap()
        );
        let scene = Scene::read("scene", &text).unwrap_or_else(|error| panic!("{error}"));
        resolve(&scene, Skin { scene: &scene, farthest })
    };
    let near = |got: f64, want: f64| assert!((got - want).abs() < 1e-12, "{got} {want}");
    near(skin("", 0.0), 0.3);
    // Half of it, 0.2 h, in 16 steps.
    near(skin("", 0.0125), 0.4);
    near(skin("", 1.0), 0.6);
    near(skin("[periodic]\nx = { from = 0, to = 0.3 }\n", 1.0), 0.3);
}

#[test]
fn lists_change_no_bit() {
    for space in ["plane-strain", "3d"] {
        for law in LAWS {
            let symmetry = if space == "3d" { "\"x\", \"y\"" } else { "\"x\"" };
            let text = format!(
                "space = \"{space}\"\nspacing = 0.01\ngravity = [0, 0, -9.81]\nsymmetry = [{symmetry}]\n{law}\n\
                 [body.block]\nbox = {{ min = [0, 0, 0], max = [0.06, 0.06, 0.06] }}\n\
                 [wall.floor]\naxis = \"z\"\nat = \"-10 mm\"\nside = \"above\"\nslip = \"no-slip\"\n[end]\ntime = 1\n"
            );
            let scene = Scene::read("scene", &text).unwrap_or_else(|error| panic!("{error}"));
            let run = |always_rebuild: bool| resolve(&scene, Run { scene: &scene, always_rebuild });
            let ((seldom, few, crossings), (always, many, _)) = (run(false), run(true));
            assert!(few < 20 && many == 40 && crossings > 3, "{few} {many} {crossings}");
            for (n, bits) in &seldom {
                assert_eq!(*bits, always[n], "{space}, particle {n}\n{law}");
            }
        }
    }
}
