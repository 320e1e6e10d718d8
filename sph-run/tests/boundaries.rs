//! Periodic axes, mirror walls and walls that slide along themselves, on one rank.

use formats::h5::Communicator;
use formats::scene::{Material as Law, Scene};
use formats::snapshot::Rows;
use sph_run::algebra::{Matrix, Sym, Vector};
use sph_run::boundary::field::Reflection;
use sph_run::material::DruckerPrager;
use sph_run::particles::{Particles, id, key};
use sph_run::physics::{CubicSpline, Model, Physics};
use sph_run::simulation::{Clock, Simulation};
use sph_run::space::{Axisymmetric, PlaneStrain, Space, ThreeD};
use sph_run::timestep::Requests;

/// Spacing, m: a power of two, so that sums of spacings are exact. Ten of them are 0.078125 m.
const DX: f64 = 0.0078125;
/// kg/m3
const DENSITY: f64 = 2600.0;

type Plane = Model<PlaneStrain, CubicSpline, DruckerPrager>;
type Rings = Model<Axisymmetric, CubicSpline, DruckerPrager>;
type Solid = Model<ThreeD, CubicSpline, DruckerPrager>;

fn scene(head: &str, walls: &str, cohesion: f64) -> Scene {
    let body = match head {
        head if head.contains("axi") => "cylinder = { radius = 0.078125, height = 0.078125 }",
        head if head.contains("3d") => "box = { min = [0, 0, 0], max = [0.078125, 0.0625, 0.078125] }",
        _ => "box = { min = [0, 0, 0], max = [0.078125, 0, 0.078125] }",
    };
    let text = format!(
        "{head}\nspacing = {DX}\n[material.drucker-prager]\ndensity = {DENSITY}\nyoung = 5.98e6\npoisson = 0.3\n\
         friction = 30\ncohesion = {cohesion}\n[body.block]\n{body}\n{walls}[end]\ntime = 1\n"
    );
    Scene::read("scene.toml", &text).expect("a sound scene")
}

fn start<'a, const D: usize, const N: usize, P: Physics<D, N, Material = DruckerPrager>>(
    comm: &'a Communicator,
    scene: &Scene,
    rows: &Rows,
) -> Simulation<'a, D, N, P> {
    let Law::DruckerPrager(law) = &scene.material else { unreachable!() };
    let particles = Particles::from_rows::<P::Space>(rows);
    let count = particles.owned as u64;
    let mut run = Simulation::new(comm, scene, DruckerPrager::new(law), particles, count, Clock::default());
    run.begin();
    run
}

fn steps<const D: usize, const N: usize, P: Physics<D, N>>(run: &mut Simulation<'_, D, N, P>, steps: usize) {
    for _ in 0..steps {
        let plan = run.plan(f64::INFINITY, Requests::default()).expect("a sound state");
        run.step(&plan);
    }
}

/// Lattice places along x, y, z, jittered, with velocities in [-speed, speed) about `mean`.
fn block<const D: usize, const N: usize, S: Space<D, N>>(
    cells: [usize; 3],
    jitter: f64,
    speed: f64,
    mean: [f64; 3],
) -> Rows {
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let mut rows = Rows::default();
    let [nx, ny, nz] = cells;
    for k in 0..nx * ny * nz {
        let cell = [k / (ny * nz), k / nz % ny, k % nz];
        let there = |a: usize| f64::from(u8::from(S::axis(a).is_some()));
        rows.id.push(k as u64);
        rows.position.push([0, 1, 2].map(|a| there(a) * (cell[a] as f64 + 0.5 + jitter * random()) * DX));
        rows.velocity.push([0, 1, 2].map(|a| there(a) * (mean[a] + speed * random())));
    }
    let count = rows.len();
    rows.body = vec![0; count];
    let mass = |x: &[f64; 3]| DENSITY * DX.powi(D as i32) / S::volume(1.0, 1.0, S::from_disk(*x), DX);
    rows.mass = rows.position.iter().map(mass).collect();
    rows.density = vec![DENSITY; count];
    rows.stress = vec![[0.0; 6]; count];
    rows.stress_work = vec![0.0; count];
    rows.viscous_work = vec![0.0; count];
    rows.plastic_strain = vec![0.0; count];
    rows
}

/// Owned particles by id: index of each.
fn by_id<const D: usize, const N: usize>(p: &Particles<D, N>) -> Vec<usize> {
    let mut order = vec![0; p.owned];
    for i in 0..p.owned {
        order[id(p.key[i]) as usize] = i;
    }
    order
}

/// What MPI allows once a process, for all tests of this file that need a run.
#[test]
fn runs() {
    let (_turn, comm) = crate::support::alone();
    d4_a_block_that_leaves_comes_in_again_as_it_was(&comm);
    the_answer_does_not_know_where_the_border_is(&comm);
    what_gets_behind_a_mirror_is_put_back(&comm);
    images_are_where_the_mirrors_put_them(&comm);
    virtual_particles_move_with_their_wall(&comm);
}

/// D4: rigid translation through the periodic borders leaves no stress and the same shape, to the last bit.
fn d4_a_block_that_leaves_comes_in_again_as_it_was(comm: &Communicator) {
    fn check<const D: usize, const N: usize, P: Physics<D, N, Material = DruckerPrager>>(
        comm: &Communicator,
        head: &str,
        cells: [usize; 3],
    ) {
        let scene = scene(&format!("{head}\ngravity = 0"), "", 0.0);
        let rows = block::<D, N, P::Space>(cells, 0.1, 0.0, [3.0, if D == 3 { -2.0 } else { 0.0 }, 0.5]);
        let mut run = start::<D, N, P>(comm, &scene, &rows);
        let first = run.particles.clone();
        let old = by_id(&first);
        steps(&mut run, 800);
        let p = &run.particles;
        let new = by_id(p);
        let mut crossed = 0;
        for n in 0..p.owned {
            let (i, j, zero) = (new[n], old[n], (new[0], old[0]));
            assert_eq!(p.stress[i], Sym::default());
            assert_eq!(p.v[i], first.v[j]);
            let shape = |p: &Particles<D, N>, i: usize, zero: usize| run.periods.wrapped(p.x[i] - p.x[zero]);
            let (was, is) = (shape(&first, j, zero.1), shape(p, i, zero.0));
            // Along periodic axes to the bit; along z to the rounding of x += v dt.
            for a in 0..D {
                let tolerance = if a == D - 1 { 1e-13 } else { 0.0 };
                assert!((was.0[a] - is.0[a]).abs() <= tolerance, "{was:?} {is:?}");
            }
            crossed += usize::from(run.periods.wrapped(p.x[i]).0[0] < first.x[j].0[0]);
        }
        assert!(
            run.clock.time * 3.0 > 0.16 && crossed > 0,
            "it went around, {crossed} particles are behind their start"
        );
    }
    check::<2, 4, Plane>(
        comm,
        "space = \"plane-strain\"\nperiodic = { x = { from = -0.015625, to = 0.1015625 } }",
        [10, 1, 10],
    );
    check::<3, 6, Solid>(
        comm,
        "space = \"3d\"\nperiodic = { x = { from = 0, to = 0.078125 }, y = { from = -0.0546875, to = 0.0859375 } }",
        [10, 5, 5],
    );
}

/// Material that fills the period over a sticking floor, and the same moved on by some cells: the same bits, though other
/// particles meet the border at other times. Wrapping at every step changes nothing either.
fn the_answer_does_not_know_where_the_border_is(comm: &Communicator) {
    fn check<const D: usize, const N: usize, P: Physics<D, N, Material = DruckerPrager>>(
        comm: &Communicator,
        head: &str,
        cells: [usize; 3],
    ) {
        let floor = "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\nvelocity = [1, 0, 0]\n";
        let scene = scene(head, floor, 1e4);
        let rows = block::<D, N, P::Space>(cells, 0.1, 2.0, [1.0, 0.0, 0.0]);
        let mut reference = start::<D, N, P>(comm, &scene, &rows);
        // From places on the quantum: else the shift itself would round.
        let mut rows = rows;
        for x in &mut rows.position {
            let shifts = [4.0 * DX, 7.0 * DX];
            for a in 0..2 {
                if let Some(axis) = scene.periodic_axis(a) {
                    x[a] = axis.round(x[a]) + shifts[a];
                }
            }
        }
        let mut moved = start::<D, N, P>(comm, &scene, &rows);
        let mut often = start::<D, N, P>(comm, &scene, &rows);
        steps(&mut reference, 150);
        steps(&mut moved, 150);
        for _ in 0..150 {
            steps(&mut often, 1);
            often.rebuild();
        }
        for other in [&moved, &often] {
            let (p, q) = (&reference.particles, &other.particles);
            let mut stressed = 0;
            for (i, j) in by_id(p).into_iter().zip(by_id(q)) {
                assert_eq!((p.v[i], p.stress[i], p.density[i]), (q.v[j], q.stress[j], q.density[j]));
                assert_eq!(p.x[i].0[D - 1], q.x[j].0[D - 1]);
                stressed += usize::from(p.stress[i] != Sym::default());
            }
            assert!(stressed > p.owned / 2);
        }
    }
    check::<2, 4, Plane>(comm, "space = \"plane-strain\"\nperiodic = { x = { from = 0, to = 0.078125 } }", [10, 1, 10]);
    check::<3, 6, Solid>(
        comm,
        "space = \"3d\"\nperiodic = { x = { from = 0, to = 0.078125 }, y = { from = 0, to = 0.0625 } }",
        [10, 8, 5],
    );
}

const BOX_OF_MIRRORS: &str = "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\nkind = \"mirror\"\n\
     velocity = [0.5, 0, 0]\n\
     [wall.side]\naxis = \"x\"\nat = 0.078125\nside = \"below\"\nslip = \"free-slip\"\nkind = \"mirror\"\n";

/// Thrown against mirror walls, nothing stays behind them.
fn what_gets_behind_a_mirror_is_put_back(comm: &Communicator) {
    let left = "[wall.left]\naxis = \"x\"\nat = 0\nside = \"above\"\nslip = \"free-slip\"\nkind = \"mirror\"\n";
    let scene = scene("space = \"plane-strain\"", &(left.to_owned() + BOX_OF_MIRRORS), 0.0);
    let mut rows = block::<2, 4, PlaneStrain>([10, 1, 10], 0.0, 0.0, [0.0; 3]);
    // One just before the side, one just above the floor, faster than the others could turn them in a step.
    (rows.position[95][0], rows.velocity[95][0]) = (10.0 * DX - 1e-6, 8.0);
    (rows.position[40][2], rows.velocity[40][2]) = (1e-6, -8.0);
    let mut run = start::<2, 4, Plane>(comm, &scene, &rows);
    let dt = 1e-4;
    let plan = sph_run::timestep::Plan {
        time_step: dt,
        time: dt,
        farthest: 0.0,
        lists_go_stale: true,
        requests: Requests::default(),
    };
    run.step(&plan);
    let (p, at) = (&run.particles, by_id(&run.particles));
    let (side, floor) = (p.x[at[95]], p.x[at[40]]);
    // Less than v dt = 0.8 mm from the wall, and on their way back.
    assert!(
        (10.0 * DX - 1e-3..10.0 * DX).contains(&side.0[0]) && p.v[at[95]].0[0] < -5.0,
        "{side:?} {:?}",
        p.v[at[95]]
    );
    assert!((0.0..0.001).contains(&floor.0[1]) && p.v[at[40]].0[1] > 5.0, "{floor:?} {:?}", p.v[at[40]]);
    // The floor's motion is felt: v' = 2 V - v.
    assert!(p.v[at[40]].0[0] > 0.5, "{:?}", p.v[at[40]]);
    steps(&mut run, 300);
    for x in &run.particles.x[..run.particles.owned] {
        assert!((0.0..=10.0 * DX).contains(&x.0[0]) && x.0[1] >= 0.0, "{x:?}");
    }
}

/// Images in a corner, and those of rings: place, velocity, stress and volume.
fn images_are_where_the_mirrors_put_them(comm: &Communicator) {
    fn find<const D: usize, const N: usize>(p: &Particles<D, N>, n: u64, image: u16) -> usize {
        p.key.iter().position(|&k| k == key(n, image)).expect("an image near the wall")
    }
    let text = BOX_OF_MIRRORS.replace("velocity = [0.5, 0, 0]\n", "");
    let scene = scene("space = \"axisymmetric\"", &text, 1e6);
    let mut rows = block::<2, 4, Axisymmetric>([10, 1, 10], 0.2, 1.0, [0.0; 3]);
    for (k, stress) in rows.stress.iter_mut().enumerate() {
        *stress = [1.0, 2.0, 3.0, 0.0, 0.0, 4.0 + k as f64];
    }
    let run = start::<2, 4, Rings>(comm, &scene, &rows);
    let p = &run.particles;
    // In the corner of floor and tube.
    let i = by_id(p)[90];
    let (x, v, s) = (p.x[i].0, p.v[i].0, p.stress[i].0);
    let side = find(p, 90, 2);
    assert_eq!(p.x[side].0, [0.15625 - x[0], x[1]]);
    assert_eq!(p.v[side].0, [-v[0], v[1]]);
    assert_eq!(p.stress[side].0, [s[0], s[1], s[2], -s[3]]);
    let floor = find(p, 90, 1 << 6);
    assert_eq!(p.x[floor].0, [x[0], -x[1]]);
    assert_eq!(p.v[floor].0, [-v[0], -v[1]]);
    assert_eq!(p.stress[floor].0, s);
    let corner = find(p, 90, 2 | 1 << 6);
    assert_eq!(p.x[corner].0, [0.15625 - x[0], -x[1]]);
    assert_eq!(p.v[corner].0, [v[0], -v[1]]);
    assert_eq!(p.stress[corner].0, [s[0], s[1], s[2], -s[3]]);
    for image in [side, floor, corner] {
        assert_eq!(p.volume[image], p.volume[i]);
    }
    // Rings behind the tube lie further out, those across the axis have negative radii.
    assert!(Axisymmetric::metric(p.x[side], DX) > 10.0 * DX);
    let axis = find(p, 0, 1);
    assert!(Axisymmetric::metric(p.x[axis], DX) < 0.0);
}

/// Behind a no-slip wall that slides, virtual particles have 2 V - v: none of them is stretched where all move with it.
fn virtual_particles_move_with_their_wall(comm: &Communicator) {
    let walls = "[wall.floor]\naxis = \"z\"\nat = 0\nside = \"above\"\nslip = \"no-slip\"\nvelocity = [0.5, 0, 0]\n";
    let scene =
        scene("space = \"plane-strain\"\ngravity = 0\nperiodic = { x = { from = 0, to = 0.078125 } }", walls, 1e6);
    let rows = block::<2, 4, PlaneStrain>([10, 1, 10], 0.1, 0.0, [0.5, 0.0, 0.0]);
    let mut run = start::<2, 4, Plane>(comm, &scene, &rows);
    assert!(run.particles.len() > run.particles.mirror);
    steps(&mut run, 20);
    for s in &run.particles.stress[..run.particles.owned] {
        // 0.5 m/s dt/dx times E times 2^-52: rounding of the extrapolation only.
        assert!(s.0.iter().all(|s| s.abs() < 1e-8), "{s:?}");
    }
    // And where they do not, it drags them along.
    let rows = block::<2, 4, PlaneStrain>([10, 1, 10], 0.1, 0.0, [0.0; 3]);
    let mut run = start::<2, 4, Plane>(comm, &scene, &rows);
    steps(&mut run, 20);
    let momentum: f64 = run.particles.v[..run.particles.owned].iter().map(|v| v.0[0]).sum();
    assert!(momentum > 1.0, "{momentum}");
}

/// A velocity, a stress and a tensor that vary in space, reflected through a plane: what the law of the wall asks.
#[test]
fn reflections_of_every_kind_of_field() {
    let through_y = Reflection::<3, 6>::slip(1, 0.5, Sym([1.0, 1.0, 1.0, -1.0, -1.0, 1.0]));
    let (x, v, s) = (Vector([1.0, 2.0, 3.0]), Vector([4.0, 5.0, 6.0]), Sym([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    let m = Matrix([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]);
    assert_eq!(through_y.place(x).0, [1.0, -1.0, 3.0]);
    assert_eq!(through_y.velocity(v).0, [4.0, -5.0, 6.0]);
    assert_eq!(through_y.stress(s).0, [1.0, 2.0, 3.0, -4.0, -5.0, 6.0]);
    assert_eq!(through_y.matrix(m).0, [[1.0, -2.0, 3.0], [-4.0, 5.0, -6.0], [7.0, -8.0, 9.0]]);
    let lid = Reflection::<3, 6>::stick(2, 1.0, Vector([0.5, 0.0, 0.0]));
    assert_eq!(lid.place(x).0, [1.0, 2.0, -1.0]);
    assert_eq!(lid.velocity(v).0, [-3.0, -5.0, -6.0]);
    assert_eq!(lid.stress(s), s);
    // In a corner, and twice between planes that face each other: a shift by twice their distance.
    let corner = through_y.then(&lid);
    assert_eq!((corner.place(x).0, corner.velocity(v).0), ([1.0, -1.0, -1.0], [-3.0, 5.0, -6.0]));
    assert_eq!(corner.stress(s), through_y.stress(s));
    let facing = Reflection::slip(1, 2.5, Sym([1.0, 1.0, 1.0, -1.0, -1.0, 1.0]));
    let twice = through_y.then(&facing);
    assert_eq!((twice.place(x).0, twice.velocity(v), twice.stress(s), twice.matrix(m)), ([1.0, 6.0, 3.0], v, s, m));
    // Nothing to add changes no bit, not even the sign of a zero.
    let mirror = Reflection::<3, 6>::slip(0, 0.0, Sym([1.0; 6]));
    let zero = mirror.place(Vector([0.0; 3])).0.map(f64::to_bits);
    assert_eq!(zero, [-0.0, 0.0, 0.0].map(f64::to_bits));
}
