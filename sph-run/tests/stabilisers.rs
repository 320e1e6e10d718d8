//! The operators a scene may switch on, on lattices and jittered blocks: corrected gradients (rows C5, C9, C10 of the list
//! of verification problems, by the solver's own tensor), viscosities (C11), diffusion (C12), artificial stress, shifting.

use crate::support::{Random, accelerate, block, close};
use sph_run::algebra::{Matrix, Sym, Vector};
use sph_run::material::Mean;
use sph_run::neighbors::Neighbors;
use sph_run::particles::Particles;
use sph_run::physics::{CubicSpline, Kernel, WendlandC2};
use sph_run::rates::correction::{Among, correction};
use sph_run::rates::momentum::Viscosity;
use sph_run::rates::velocity_gradient::velocity_gradient;
use sph_run::rates::{artificial_stress, diffusion, shifting, viscosity};
use sph_run::space::{Axisymmetric, PlaneStrain, Space, ThreeD};
use sph_run::sweep::Pairs;

/// Smoothing length over the spacing, which is 1.
const H: f64 = 1.2;
const NONE: Viscosity = Viscosity { strength: 0.0, below: 0.0 };

fn pairs() -> Pairs {
    crate::support::pairs(H)
}

fn neighbors<const D: usize, const N: usize, K: Kernel>(p: &Particles<D, N>) -> Neighbors<D> {
    crate::support::neighbors::<D, N, K>(p, 2.1 * H, pairs())
}

fn corrections<const D: usize, const N: usize, K: Kernel>(p: &Particles<D, N>) -> Vec<Matrix<D>> {
    let mut tensors = Vec::new();
    correction::<D, N, K>(p, &neighbors::<_, _, K>(p), pairs(), Among::All, &mut tensors);
    tensors
}

fn gradients<const D: usize, const N: usize, K: Kernel>(p: &Particles<D, N>) -> Vec<Matrix<D>> {
    let mut gradient = vec![Matrix::default(); p.owned];
    velocity_gradient::<D, K, f64>(&neighbors::<_, _, K>(p), pairs(), &mut gradient);
    gradient.iter().zip(corrections::<D, N, K>(p)).map(|(g, l)| g.product(&l)).collect()
}

/// Accelerations by w sigma L.
fn corrected_momentum<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
    p: &Particles<D, N>,
) -> Vec<Vector<D>> {
    let l = corrections::<D, N, K>(p);
    let weighted = |i: usize| S::matrix(&(p.stress[i] * S::metric(p.x[i], 1.0))).product(&l[i]);
    accelerate::<D, N, S, K, f64, _>(p, &neighbors::<_, _, K>(p), pairs(), NONE, weighted).0
}

/// C5: the corrected gradient is exact for linear fields on a jittered block up to its free surface.
#[test]
fn c5_the_corrected_gradient_is_exact() {
    fn check<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>() {
        let mut p = block::<D, N, S>(8, 0.15);
        let slope = Matrix::<D>(std::array::from_fn(|a| std::array::from_fn(|b| (1 + a * D + b) as f64 * 0.1 - 0.4)));
        for i in 0..p.owned {
            p.v[i] = slope.times(p.x[i]);
        }
        let error =
            |g: &Matrix<D>| (0..D * D).fold(0.0_f64, |e, k| e.max((g.0[k / D][k % D] - slope.0[k / D][k % D]).abs()));
        let worst = gradients::<D, N, K>(&p).iter().map(error).fold(0.0, f64::max);
        println!("C5 {:?} {}: {worst:e}", S::KIND, K::KIND.name());
        assert!(worst < 1e-12, "{worst}");
        // No particle of a block is taken for a lone one.
        let norm = |l: &Matrix<D>| l.0.iter().flatten().map(|l| l * l).sum::<f64>().sqrt();
        let largest = corrections::<D, N, K>(&p).iter().map(norm).fold(0.0, f64::max);
        assert!(largest < 11.0 && corrections::<D, N, K>(&p).iter().all(|l| *l != Matrix::unit()), "{largest}");
    }
    check::<2, 4, PlaneStrain, CubicSpline>();
    check::<2, 4, Axisymmetric, CubicSpline>();
    check::<3, 6, ThreeD, CubicSpline>();
    check::<3, 6, ThreeD, WendlandC2>();
}

/// Particles with hardly any neighbours, or with all in a row, keep the plain gradient.
#[test]
fn lone_particles_are_not_corrected() {
    for count in [1, 2, 3] {
        let mut p = block::<3, 6, ThreeD>(3, 0.0);
        p.arrange(&(0..count).collect::<Vec<u32>>());
        assert!(corrections::<3, 6, CubicSpline>(&p).iter().all(|l| *l == Matrix::unit()));
    }
}

/// Sum of the forces, and of their moments about the origin, over the sums of their sizes.
fn imbalance<const D: usize, const N: usize>(p: &Particles<D, N>, a: &[Vector<D>]) -> (f64, f64) {
    let (mut force, mut size) = (Vector::<D>::default(), 0.0);
    // x_a f_b - x_b f_a of all pairs of axes.
    let (mut moment, mut arm) = ([0.0; 3], 0.0);
    for i in 0..p.owned {
        let f = a[i] * p.mass[i];
        force += f;
        size += f.norm();
        arm += p.x[i].norm() * f.norm();
        for (k, (a, b)) in [(0, 1), (1, 2), (0, 2)].into_iter().filter(|&(_, b)| b < D).enumerate() {
            moment[k] += p.x[i].0[a] * f.0[b] - p.x[i].0[b] * f.0[a];
        }
    }
    (force.norm() / size, Vector(moment).norm() / arm)
}

/// C9: the pair sigma_i L_i + sigma_j L_j conserves momentum and angular momentum to rounding under any stress.
#[test]
fn c9_the_corrected_pair_conserves_both_momenta() {
    fn check<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>() {
        let p = block::<D, N, S>(8, 0.15);
        let (force, moment) = imbalance(&p, &corrected_momentum::<D, N, S, K>(&p));
        println!("C9 {:?} {}: force {force:e}, moment {moment:e}", S::KIND, K::KIND.name());
        let rounding = 1e-15 * (p.owned as f64).sqrt();
        assert!(force < rounding && moment < rounding, "{force:e} {moment:e}");
    }
    check::<2, 4, PlaneStrain, CubicSpline>();
    check::<2, 4, PlaneStrain, WendlandC2>();
    check::<3, 6, ThreeD, CubicSpline>();
    check::<3, 6, ThreeD, WendlandC2>();
}

/// C10: corrected, the power of the forces is still minus the power of the stress, in all spaces.
#[test]
fn c10_the_corrected_pair_is_conjugate() {
    fn check<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>() {
        let p = block::<D, N, S>(8, 0.15);
        let (a, gradient) = (corrected_momentum::<D, N, S, K>(&p), gradients::<D, N, K>(&p));
        let (mut of_forces, mut of_stress) = (0.0, 0.0);
        for i in 0..p.owned {
            let a = a[i] + S::hoop(&p.stress[i], p.density[i], p.x[i], 1.0);
            let rate = S::strain_rate(&gradient[i], p.x[i], p.v[i], 1.0);
            of_forces += p.mass[i] * p.v[i].dot(a);
            of_stress += p.mass[i] / p.density[i] * p.stress[i].contract(rate);
        }
        let relative = (of_forces + of_stress).abs() / of_stress.abs();
        println!("C10 {:?} {}: {relative:e}", S::KIND, K::KIND.name());
        assert!(relative < 1e-13 * (p.owned as f64).sqrt() && of_stress.abs() > 1e-3, "{relative}");
    }
    check::<2, 4, PlaneStrain, CubicSpline>();
    check::<2, 4, Axisymmetric, CubicSpline>();
    check::<3, 6, ThreeD, CubicSpline>();
    check::<3, 6, ThreeD, WendlandC2>();
}

/// Every viscosity there is between particles.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Approaching,
    Always,
    Impact,
    Fluid(Mean),
}
const ALL: [Kind; 5] =
    [Kind::Approaching, Kind::Always, Kind::Impact, Kind::Fluid(Mean::Arithmetic), Kind::Fluid(Mean::Harmonic)];

/// Its accelerations and heat.
fn viscous<const D: usize, const N: usize, S: Space<D, N>>(
    p: &Particles<D, N>,
    kind: Kind,
) -> (Vec<Vector<D>>, Vec<f64>) {
    let neighbors = neighbors::<_, _, CubicSpline>(p);
    let linear = match kind {
        Kind::Approaching => Viscosity { strength: 1.0, below: 0.0 },
        Kind::Always => Viscosity { strength: 1.0, below: f64::INFINITY },
        Kind::Impact | Kind::Fluid(_) => NONE,
    };
    let (mut a, mut heat) =
        accelerate::<D, N, S, CubicSpline, f64, _>(p, &neighbors, pairs(), linear, |_| Sym::<N>::default());
    match kind {
        Kind::Impact => viscosity::on_impact::<D, N, S, CubicSpline>(p, &neighbors, pairs(), 1.0, &mut a, &mut heat),
        Kind::Fluid(mean) => {
            viscosity::between_particles::<D, N, S, CubicSpline>(p, &neighbors, pairs(), mean, &mut a, &mut heat);
        }
        Kind::Approaching | Kind::Always => {}
    }
    (a, heat)
}

/// C11 for all viscosities: they take energy out, exactly what they report as heat, of which no particle has less than
/// nothing; they change no momentum; translation they leave alone, rotation all but the fluid's (its operator leaves out
/// the part of grad v^T), separation those that act on approach.
#[test]
fn c11_viscosities() {
    fn check<const D: usize, const N: usize, S: Space<D, N>>(kind: Kind) {
        let mut p = block::<D, N, S>(8, 0.15);
        let mut random = Random(11);
        p.viscosity = (0..p.owned).map(|_| 10f64.powf(2.0 * random.next())).collect();
        let power = |p: &Particles<D, N>| {
            let (a, heat) = viscous::<D, N, S>(p, kind);
            let power: f64 = (0..p.owned).map(|i| p.mass[i] * p.v[i].dot(a[i])).sum();
            let warmth: f64 = (0..p.owned).map(|i| p.mass[i] * heat[i]).sum();
            assert!(heat.iter().all(|&h| h >= 0.0), "{:?} {kind:?}: cools", S::KIND);
            // In a rotation v_ij . x_ij rounds to 1e-16 of its terms instead of 0, and all that is left is rounding.
            let terms: f64 = (0..p.owned).map(|i| (p.mass[i] * p.v[i].dot(a[i])).abs()).sum();
            let rounding = 1e-13 * warmth + f64::EPSILON * terms;
            assert!((power + warmth).abs() <= rounding, "{:?} {kind:?}: {power} {warmth} {terms}", S::KIND);
            (power, a)
        };
        let (dissipated, a) = power(&p);
        let size: f64 = (0..p.owned).map(|i| p.mass[i] * a[i].norm()).sum();
        assert!(dissipated < -0.01 * size, "{:?} {kind:?}: {dissipated} {size}", S::KIND);
        if S::KIND != Axisymmetric::KIND {
            let (force, moment) = imbalance(&p, &a);
            assert!(force < 1e-15 * (p.owned as f64).sqrt(), "{kind:?}: {force}");
            // Along the line of a pair, or along its velocity.
            let central = !matches!(kind, Kind::Fluid(_));
            assert_eq!(moment < 1e-15 * (p.owned as f64).sqrt(), central, "{kind:?}: {moment}");
        }
        let last = D - 1;
        let mut moving = |field: &dyn Fn(Vector<D>) -> Vector<D>| {
            for i in 0..p.owned {
                p.v[i] = field(p.x[i]);
            }
            -power(&p).0 / size
        };
        // The radial velocity of rings is no rigid motion.
        let up = moving(&|_| Vector(std::array::from_fn(|a| if a == last { 0.7 } else { 0.0 })));
        assert!(up < 1e-13, "{:?} {kind:?}: {up}", S::KIND);
        let turning = moving(&|x| {
            let mut v = Vector::default();
            (v.0[0], v.0[last]) = (-x.0[last], x.0[0]);
            v
        });
        assert_eq!(turning < 1e-13, !matches!(kind, Kind::Fluid(_)), "{:?} {kind:?}: {turning}", S::KIND);
        let opening = moving(&|x| x * 0.3);
        assert_eq!(
            opening < 1e-13,
            matches!(kind, Kind::Approaching | Kind::Impact),
            "{:?} {kind:?}: {opening}",
            S::KIND
        );
    }
    for kind in ALL {
        check::<2, 4, PlaneStrain>(kind);
        check::<2, 4, Axisymmetric>(kind);
        check::<3, 6, ThreeD>(kind);
    }
}

/// The quadratic viscosity of two particles that approach along their line: the pressure strength (v/r r^2/(r^2 + 0.01 h^2)
/// )^2/h^2 of each, with strength = beta rho0 h^2.
#[test]
fn the_pressure_of_impact() {
    let mut p = block::<3, 6, ThreeD>(2, 0.0);
    p.arrange(&[0, 1]);
    (p.v[0], p.v[1]) = (Vector([0.5, 0.0, 0.0]), Vector([-1.5, 0.0, 0.0]));
    let (a, _) = viscous::<3, 6, ThreeD>(&p, Kind::Impact);
    let slope = (1.5 / H - 2.0) * 3.0 / (2.0 * std::f64::consts::PI) / H.powi(5);
    let pressure = (2.0 / (1.0 + 0.01 * H * H)).powi(2);
    close(a[0].0[0], p.volume[1] * pressure * slope / p.density[0], 1e-12);
    close(a[1].0[0], -p.volume[0] * pressure * slope / p.density[1], 1e-12);
    assert!(a[0].0[0] < 0.0);
}

/// Szewc's Eq 9 on a lattice: (mu/rho) times the Laplacian of a quadratic velocity, short of it by the slope of the lattice
/// and what eta takes, both means alike.
#[test]
fn the_laplacian_of_a_fluid() {
    fn check<const D: usize, const N: usize, S: Space<D, N>>(mean: Mean, slope: std::ops::Range<f64>) {
        let side = 11;
        let mut p = block::<D, N, S>(side, 0.0);
        let centre = (0..D).fold(0, |c, a| c + side.pow(a as u32) * (side / 2));
        p.density.fill(2.0);
        p.volume.fill(1.0);
        p.viscosity.fill(3.0);
        for i in 0..p.owned {
            let x = p.x[i];
            // Laplacians 0.2 (D = 2: of z^2 and x^2), -0.6, and 0 of what is linear.
            p.v[i] = Vector(std::array::from_fn(|a| match a {
                0 => 0.1 * x.0[D - 1].powi(2) + 0.7 * x.0[0],
                1 => -0.3 * x.0[0].powi(2) + 0.2,
                _ => 4.0 - x.0[1],
            }));
        }
        let (a, _) = viscous::<D, N, S>(&p, Kind::Fluid(mean));
        let wanted = [0.2, -0.6, 0.0].map(|laplacian| 1.5 * laplacian);
        for axis in 0..2 {
            let ratio = a[centre].0[axis] / wanted[axis];
            println!("{:?} {mean:?}: {ratio} of the Laplacian", S::KIND);
            assert!(slope.contains(&ratio), "{ratio}");
        }
        if D == 3 {
            assert!(a[centre].0[2].abs() < 1e-13);
        }
    }
    for mean in [Mean::Arithmetic, Mean::Harmonic] {
        check::<2, 4, PlaneStrain>(mean, 0.985..1.005);
        check::<3, 6, ThreeD>(mean, 0.98..1.005);
    }
}

/// Across a jump of viscosity the harmonic mean carries the stress of both layers in series, 4 mu1 mu2/(mu1 + mu2), the
/// arithmetic one mu1 + mu2; a layer without viscosity takes the force away, and nothing is divided by nothing.
#[test]
fn viscosities_of_two_layers() {
    let mut p = block::<2, 4, PlaneStrain>(2, 0.0);
    p.arrange(&[0, 1]);
    (p.v[0], p.v[1]) = (Vector([0.0, 1.0]), Vector([0.0, -1.0]));
    let mut force = |mu: [f64; 2], mean| {
        p.viscosity.copy_from_slice(&mu);
        viscous::<2, 4, PlaneStrain>(&p, Kind::Fluid(mean)).0[0].0[1]
    };
    let unit = force([0.5, 0.5], Mean::Arithmetic);
    assert!(unit < 0.0);
    close(force([2.0, 6.0], Mean::Arithmetic) / unit, 8.0, 1e-14);
    close(force([2.0, 6.0], Mean::Harmonic) / unit, 6.0, 1e-14);
    close(force([1e-3, 1e6], Mean::Harmonic) / unit, 4e-3, 1e-8);
    for mu in [[0.0, 1e6], [0.0, 0.0]] {
        assert_eq!(force(mu, Mean::Harmonic), 0.0);
    }
}

/// C12: what one particle gains the other loses, the variance falls, and linear fields stay as they are up to the surface.
#[test]
fn c12_diffusion() {
    /// Rates of a field by diffusion with strength 1.
    fn rates<const D: usize, const N: usize, T: diffusion::Diffusing>(p: &Particles<D, N>, field: &[T]) -> Vec<T> {
        let (neighbors, mut l, mut slopes, mut rate) =
            (neighbors::<_, _, CubicSpline>(p), Vec::new(), Vec::new(), Vec::new());
        correction::<D, N, CubicSpline>(p, &neighbors, pairs(), Among::Material, &mut l);
        diffusion::gradient::<D, N, CubicSpline, T>(p, &neighbors, pairs(), &l, field, &mut slopes);
        diffusion::diffusion::<D, N, CubicSpline, T>(p, &neighbors, pairs(), 1.0, field, &slopes, &mut rate);
        rate
    }
    fn check<const D: usize, const N: usize, S: Space<D, N>>() {
        let p = block::<D, N, S>(8, 0.15);
        let all = 0..p.owned;
        let rate = rates(&p, &p.density);
        let gained: f64 = all.clone().map(|i| p.volume[i] * rate[i]).sum();
        let size: f64 = all.clone().map(|i| p.volume[i] * rate[i].abs()).sum();
        let variance: f64 = all.clone().map(|i| p.volume[i] * p.density[i] * rate[i]).sum();
        println!("C12 {:?}: density {:e}, variance {:e}", S::KIND, gained / size, variance / size);
        assert!(gained.abs() < 1e-13 * size && variance < -0.01 * size, "{gained} {variance} {size}");

        let rate = rates(&p, &p.stress);
        let mut gained = Sym::<N>::default();
        all.clone().for_each(|i| gained += rate[i] * p.volume[i]);
        let size: f64 = all.clone().map(|i| p.volume[i] * rate[i].contract(rate[i]).sqrt()).sum();
        let variance: f64 = all.clone().map(|i| p.volume[i] * p.stress[i].contract(rate[i])).sum();
        println!(
            "C12 {:?}: stress {:e}, variance {:e}",
            S::KIND,
            gained.contract(gained).sqrt() / size,
            variance / size
        );
        assert!(gained.contract(gained).sqrt() < 1e-13 * size && variance < -0.01 * size, "{gained:?} {variance}");

        let slope: Vector<D> = Vector(std::array::from_fn(|a| 0.3 - 0.5 * a as f64));
        let linear: Vec<f64> = p.x.iter().map(|x| 2.0 + slope.dot(*x)).collect();
        let rate = rates(&p, &linear);
        assert!(rate.iter().all(|r| r.abs() < 1e-12), "{:?}", S::KIND);
        let along: Sym<N> = Random(3).sym(1.0);
        let linear: Vec<Sym<N>> = linear.iter().map(|&f| along * f).collect();
        assert!(rates(&p, &linear).iter().flat_map(|r| r.0).all(|r| r.abs() < 1e-12), "{:?}", S::KIND);
    }
    check::<2, 4, PlaneStrain>();
    check::<3, 6, ThreeD>();
}

/// delta-SPH (Yang et al. 2020, Eqs 23, 24) of two particles: 2 strength V_j (f_j - f_i) x_ji . grad W/r^2, less the gradients.
#[test]
fn the_rate_of_diffusion() {
    let mut p = block::<3, 6, ThreeD>(2, 0.0);
    p.arrange(&[0, 1]);
    let slope = (1.5 / H - 2.0) * 3.0 / (2.0 * std::f64::consts::PI) / H.powi(5);
    let mut rate = Vec::new();
    let slopes = [[0.4, 9.0, 9.0], [0.1, -9.0, 9.0]];
    let field = [1.0, 3.0];
    diffusion::diffusion::<3, 6, CubicSpline, f64>(
        &p,
        &neighbors::<_, _, CubicSpline>(&p),
        pairs(),
        5.0,
        &field,
        &slopes,
        &mut rate,
    );
    // x_ji = (1, 0, 0), and grad_i W points to j times -slope.
    close(rate[0], 5.0 * p.volume[1] * (2.0 * 2.0 - 0.5) * -slope, 1e-13);
    close(rate[1], -5.0 * p.volume[0] * (2.0 * 2.0 - 0.5) * -slope, 1e-13);
    assert!(rate[0] > 0.0);
}

/// The artificial stress pushes pairs in tension apart, most those that are close, as (W(r)/W(dx))^n; it leaves compression
/// alone, and conserves momentum.
#[test]
fn artificial_stress() {
    fn push<const D: usize, const N: usize, S: Space<D, N>>(p: &Particles<D, N>) -> Vec<Vector<D>> {
        let (mut opposing, mut a) = (Vec::new(), vec![Vector::default(); p.owned]);
        artificial_stress::opposing::<D, N, S>(p, 0.5, 1.0, &mut opposing);
        artificial_stress::artificial_stress::<D, N, S, CubicSpline>(
            p,
            &neighbors::<_, _, CubicSpline>(p),
            pairs(),
            &opposing,
            &mut a,
        );
        a
    }
    fn check<const D: usize, const N: usize, S: Space<D, N>>() {
        let p = block::<D, N, S>(6, 0.15);
        let (force, _) = imbalance(&p, &push::<D, N, S>(&p));
        assert!(force < 1e-15 * (p.owned as f64).sqrt(), "{:?}: {force}", S::KIND);
        let mut pressed = p.clone();
        pressed.stress.fill(Sym::isotropic(-3.0));
        assert!(push::<D, N, S>(&pressed).iter().all(|a| *a == Vector::default()));
    }
    check::<2, 4, PlaneStrain>();
    check::<3, 6, ThreeD>();

    let mut p = block::<2, 4, PlaneStrain>(2, 0.0);
    p.arrange(&[0, 1]);
    p.density.fill(2.0);
    // Tension along the pair, compression across.
    p.stress.fill(Sym([7.0, -1.0, -5.0, 0.0]));
    let apart = push::<2, 4, PlaneStrain>(&p);
    let slope = |r: f64| {
        let q = r / H;
        (1.5 * q - 2.0) * 15.0 / (7.0 * std::f64::consts::PI) / H.powi(4)
    };
    close(apart[0].0[0], p.volume[1] * 2.0 * 0.5 * 7.0 * slope(1.0) / 2.0, 1e-13);
    close(apart[1].0[0], -p.volume[0] * 2.0 * 0.5 * 7.0 * slope(1.0) / 2.0, 1e-13);
    assert!(apart[0].0[0] < 0.0 && apart[0].0[1] == 0.0);
    // Closer: n = W(0)/W(dx), 2.55 at h = 1.2 dx.
    let shape = |r: f64| 2.0 / 3.0 - (r / H).powi(2) + 0.5 * (r / H).powi(3);
    let n = shape(0.0) / shape(1.0);
    assert!((n - 2.55).abs() < 0.01, "{n}");
    p.x[1] = p.x[0] + Vector([0.7, 0.0]);
    let closer = push::<2, 4, PlaneStrain>(&p);
    close(closer[0].0[0], p.volume[1] * 7.0 * 0.7 * slope(0.7) / 2.0 * (shape(0.7) / shape(1.0)).powf(n), 1e-12);
    // Sheared: it pulls along the diagonal with the size of the shear.
    p.x[1] = p.x[0] + Vector([1.0, 0.0]);
    p.stress.fill(Sym([0.0, 0.0, 0.0, 4.0]));
    let sheared = push::<2, 4, PlaneStrain>(&p);
    close(sheared[0].0[0], p.volume[1] * 0.5 * 4.0 * slope(1.0) / 2.0, 1e-12);
    close(sheared[0].0[1], sheared[0].0[0], 1e-12);
}

/// Shifting evens a jittered block out: sum V W, which is 1 where particles lie evenly, varies less. It moves nothing at
/// free surfaces, nothing that is at rest, and nothing on a lattice.
#[test]
fn shifting_evens_out() {
    fn check<const D: usize, const N: usize, S: Space<D, N>>() {
        let side = 14;
        let shift = |p: &Particles<D, N>, dt: f64| {
            let (mut surface, mut shift) = (Vec::new(), Vec::new());
            shifting::surface::<D, N, CubicSpline>(p, &neighbors::<_, _, CubicSpline>(p), pairs(), &mut surface);
            let how = shifting::Shifting { strength: 1.0, dt, surface: &surface };
            shifting::shift::<D, N, CubicSpline>(p, &neighbors::<_, _, CubicSpline>(p), pairs(), how, &mut shift);
            shift
        };
        let deep =
            |i: usize, least: usize| (0..D).all(|a| (least..side - least).contains(&(i / side.pow(a as u32) % side)));
        let mut p = block::<D, N, S>(side, 0.15);
        p.volume.fill(1.0);
        p.v.fill(Vector([1.0; D]));
        let spread = |p: &Particles<D, N>| {
            let w = |r: f64| CubicSpline::KIND.norm(D) / H.powi(D as i32) * CubicSpline::KIND.shape(r / H);
            let sum = |i: usize| (0..p.owned).map(|j| w((p.x[i] - p.x[j]).norm())).sum::<f64>();
            let sums: Vec<f64> = (0..p.owned).filter(|&i| deep(i, 4)).map(sum).collect();
            let mean = sums.iter().sum::<f64>() / sums.len() as f64;
            (sums.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / sums.len() as f64).sqrt()
        };
        let before = spread(&p);
        for _ in 0..20 {
            for (i, shift) in shift(&p, 0.03).into_iter().enumerate() {
                assert!(deep(i, 1) || shift == Vector::default(), "{i} lies at the surface and moves {shift:?}");
                assert!(shift.norm() < 0.05 + 1e-12);
                p.x[i] += shift;
            }
        }
        let after = spread(&p);
        println!("{:?}: spread of sum V W {before} before, {after} after", S::KIND);
        assert!(after < 0.5 * before, "{before} {after}");
        p.v.fill(Vector::default());
        assert!(shift(&p, 0.03).iter().all(|s| *s == Vector::default()));
        let mut even = block::<D, N, S>(side, 0.0);
        even.volume.fill(1.0);
        even.v.fill(Vector([1.0; D]));
        let moved = shift(&even, 0.03);
        let largest =
            |least: usize| (0..even.owned).filter(|&i| deep(i, least)).map(|i| moved[i].norm()).fold(0.0, f64::max);
        println!("{:?}: on a lattice {:e} in all, {:e} inside", S::KIND, largest(0), largest(2));
        assert!(largest(0) < 1e-15);
    }
    check::<2, 4, PlaneStrain>();
    check::<3, 6, ThreeD>();
}
