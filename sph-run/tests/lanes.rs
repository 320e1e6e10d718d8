//! Sums over pairs in lanes: what they are made of, against closed forms, and that no bit of them depends on instructions,
//! lists or blocks. Mixed precision against double.

use crate::support::{Random, accelerate, block, neighbors};
use pulp::{Simd, WithSimd};
use sph_run::algebra::{Matrix, Vector};
use sph_run::lanes::{Element, Instructions, Lanes, Parts};
use sph_run::material::Mean;
use sph_run::particles::Particles;
use sph_run::physics::{CubicSpline, Kernel, WendlandC2};
use sph_run::rates::correction::{Among, correction};
use sph_run::rates::momentum::Viscosity;
use sph_run::rates::velocity_gradient::velocity_gradient;
use sph_run::rates::wall::extrapolate;
use sph_run::rates::{artificial_stress, diffusion, shifting, viscosity};
use sph_run::space::{Axisymmetric, PlaneStrain, Space, ThreeD};
use sph_run::sweep::{Block, Needs, Pair, Pairs, Precision, Sums, Sweep};
use std::collections::BTreeMap;

/// All instructions that this processor has.
fn there() -> Vec<Instructions> {
    let all = [Instructions::Avx512, Instructions::Avx2, Instructions::Portable];
    all.into_iter().filter(|it| it.are_there()).collect()
}

/// 1/sqrt(x) as sweeps take it, or before it is refined.
struct Roots<'a, T> {
    x: &'a [T],
    refined: bool,
}

impl<T: Element> WithSimd for Roots<'_, T> {
    type Output = Vec<T>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, token: S) -> Vec<T> {
        let mut roots = Vec::new();
        for some in self.x.chunks(T::Lanes::<S>::LANES) {
            let x = T::Lanes::<S>::each(token, |k| some[k.min(some.len() - 1)]);
            let mut y = x.rough_inverse_root();
            if self.refined {
                y = x.closer_inverse_root(y);
            }
            roots.extend((0..some.len()).map(|k| y.lane(k)));
        }
        roots
    }
}

/// Roots by all instructions, which must agree bit by bit: the rough ones, and the refined ones.
fn roots<T: Element>(x: &[T]) -> [Vec<T>; 2] {
    [false, true].map(|refined| {
        let by = |it: Instructions| it.run(Roots { x, refined });
        let bits = |roots: &[T]| -> Vec<u64> { roots.iter().map(|root| root.wide().to_bits()).collect() };
        let first = by(there()[0]);
        for it in there() {
            let wrong = bits(&by(it)).iter().zip(bits(&first)).position(|(a, b)| *a != b);
            assert!(wrong.is_none(), "{it}, refined {refined}: {:?}", wrong.map(|n| x[n]));
        }
        first
    })
}

/// Numbers in [1, 4), the ends of binades among them.
fn mantissas() -> Vec<f64> {
    let mut random = Random(5);
    let mut all = vec![1.0, 2.0, 1.0 + f64::EPSILON, 2.0 - f64::EPSILON, 4.0 - 4.0 * f64::EPSILON];
    all.extend((0..200).map(|_| 2.5 + 1.5 * random.next()));
    all
}

#[test]
fn inverse_roots_of_doubles() {
    // The estimate is made in f32, and holds within its range.
    let powers: Vec<i32> = (-62..=62).collect();
    let x: Vec<f64> = powers.iter().flat_map(|&n| mantissas().into_iter().map(move |m| m * 4f64.powi(n))).collect();
    let [rough, refined] = roots(&x);
    let (mut roughest, mut worst) = (0.0_f64, 0.0_f64);
    for (n, &x) in x.iter().enumerate() {
        let scale = powers[n / mantissas().len()];
        let x = x * 4f64.powi(-scale);
        let [rough, y] = [rough[n], refined[n]].map(|y| y * 2f64.powi(scale));
        roughest = roughest.max((rough * x.sqrt() - 1.0).abs());
        // 1 - x y^2 without rounding but the last one, as the products' own roundings are known: it is twice the error.
        let square = y * y;
        let product = x * square;
        let lost = x.mul_add(square, -product) + x * y.mul_add(y, -square);
        let error = 0.5 * ((1.0 - product) - lost) * y;
        worst = worst.max(error.abs() / (y.next_up() - y));
    }
    println!("f64: estimate within {roughest}, refined within {worst} units in the last place");
    assert!(roughest < 2e-7, "{roughest}");
    assert!(worst <= 2.0, "{worst}");
}

#[test]
fn inverse_roots_of_singles() {
    let powers = -63..=62;
    let x: Vec<f32> = powers.flat_map(|n| mantissas().into_iter().map(move |m| (m * 4f64.powi(n)) as f32)).collect();
    let [rough, refined] = roots(&x);
    let (mut roughest, mut worst) = (0.0_f64, 0.0_f64);
    for (n, &x) in x.iter().enumerate() {
        let wanted = 1.0 / f64::from(x).sqrt();
        roughest = roughest.max((f64::from(rough[n]) / wanted - 1.0).abs());
        let y = refined[n];
        worst = worst.max((f64::from(y) - wanted).abs() / f64::from(y.next_up() - y));
    }
    println!("f32: estimate within {roughest}, refined within {worst} units in the last place");
    assert!(roughest < 2e-7, "{roughest}");
    assert!(worst <= 4.0, "{worst}");
}

/// Index of the other, slope and value of each pair of the first particle.
struct Record(Vec<(usize, f64, f64)>);

impl<T: Element> Sums<3, T> for Record {
    const NEEDS: Needs = Needs { slope: true, value: true };

    #[inline(always)]
    fn block<'a, L: Lanes<Element = T>>(&mut self, _: Block<L>, pairs: impl Iterator<Item = Pair<'a, 3, L>>) {
        self.0.extend(pairs.map(|pair| (pair.j, pair.slope.lane(0).wide(), pair.value.lane(0).wide())));
    }
}

/// W and W'/r of pairs against the closed forms, to `rounding` of the largest. Close by a slope is a difference of large
/// numbers over r, but what it is multiplied by is as small. Zero from the edge of the support on,
/// also where distances are off by `rounding`.
#[test]
fn kernels_in_lanes() {
    fn check<K: Kernel, T: Element>(instructions: Instructions, precision: Precision, rounding: f64) {
        let h = 1.3;
        let pairs = Pairs { h, spacing: 1.0, instructions, precision };
        let mut p = Particles::<3, 6>::default();
        let mut random = Random(9);
        let all: Vec<f64> = (0..=600).map(|k| 0.005 * f64::from(k)).chain([2.0 * (1.0 + 2.0 * rounding)]).collect();
        p.resize(all.len());
        (p.owned, p.halo, p.mirror) = (1, all.len(), all.len());
        for (n, q) in all.iter().enumerate() {
            let way: Vector<3> = random.vector(1.0);
            p.x[n] = if n % 2 == 0 { Vector([q * h, 0.0, 0.0]) } else { way * (q * h / way.norm()) };
            p.key[n] = n as u64;
        }
        let neighbors = neighbors::<3, 6, K>(&p, 4.0 * h, pairs);
        let mut record = Record(Vec::new());
        let (kind, h) = (K::KIND, h / T::unit(h));
        let (movers, lists) = (T::movers(&neighbors), &neighbors.of_owned);
        let sweep = Sweep { movers, lists, part: 0..1, first: 0 };
        sweep.run::<K>(h, instructions, &mut record);
        assert_eq!(record.0.len(), all.len());
        let (mut of_slope, mut of_value) = (0.0_f64, 0.0_f64);
        for (j, slope, value) in record.0 {
            let q = p.x[j].norm() / pairs.h;
            // Closer pairs count as h/1000 apart.
            let q = q.max(1e-3);
            let slope = slope * K::SLOPE * h.powi(2 - K::SLOPE_POWER);
            let value = value * K::VALUE * h.powi(-K::VALUE_POWER);
            if q >= 2.0 {
                assert!(
                    slope == 0.0 && value == 0.0,
                    "{kind:?} {instructions} {precision:?}: {slope:e} {value:e} at {q}"
                );
            }
            of_slope = of_slope
                .max((slope / kind.slope_over_q(0.0) - kind.slope_over_q(q) / kind.slope_over_q(0.0)).abs() * q);
            of_value = of_value.max((value - kind.shape(q)).abs() / kind.shape(0.0));
        }
        println!("{kind:?} {instructions} {precision:?}: slope {of_slope:e}, value {of_value:e}");
        assert!(of_slope < rounding && of_value < rounding, "{kind:?} {instructions} {precision:?}");
    }
    for it in there() {
        check::<CubicSpline, f64>(it, Precision::Double, 1e-13);
        check::<WendlandC2, f64>(it, Precision::Double, 1e-13);
        check::<CubicSpline, f32>(it, Precision::Mixed, 2e-6);
        check::<WendlandC2, f32>(it, Precision::Mixed, 2e-6);
    }
}

/// In random order by a seed.
fn shuffled(count: usize, seed: u64) -> Vec<u32> {
    let (mut order, mut random): (Vec<u32>, _) = ((0..count as u32).collect(), Random(seed));
    for k in (1..count).rev() {
        order.swap(k, ((0.5 + 0.5 * random.next()) * (k + 1) as f64) as usize);
    }
    order
}

/// A jittered block on three layers of wall particles; with a seed in random order.
fn walled<const D: usize, const N: usize, S: Space<D, N>>(side: usize, seed: Option<u64>) -> Particles<D, N> {
    let order = |count: usize| seed.map_or_else(|| (0..count as u32).collect(), |seed| shuffled(count, seed));
    let mut p = block::<D, N, S>(side, 0.15);
    for (i, viscosity) in p.viscosity.iter_mut().enumerate() {
        *viscosity = 1.0 + (i as f64).sin();
    }
    p.arrange(&order(p.owned));
    let layer = side.pow(D as u32 - 1);
    for n in order(3 * layer) {
        let (n, last) = (n as usize, D - 1);
        let mut place = [0.0; D];
        for (a, x) in place.iter_mut().enumerate().take(last) {
            *x = (n / side.pow(a as u32) % side) as f64 + 0.5;
        }
        place[last] = -0.5 - (n / layer) as f64;
        let mut random = Random(n as u64 + 100);
        p.key.push((1 << 60) + n as u64);
        p.x.push(Vector(place));
        p.v.push(random.vector(1.0));
        p.volume.push(1.0);
        p.stress.push(random.sym(1.0));
        p.viscosity.push(1.0);
    }
    p.resize(p.key.len());
    p
}

/// Bits of sums, by their name and the key of the particle.
type Bits = BTreeMap<(&'static str, u64), Vec<u64>>;

fn keep<F: Parts<Number = f64>>(bits: &mut Bits, name: &'static str, keys: &[u64], values: &[F]) {
    assert!(values.iter().any(|value| value.part(0) != 0.0), "{name}: nothing is tested");
    for (&key, value) in keys.iter().zip(values) {
        let numbers: Vec<f64> = (0..F::COUNT).map(|k| value.part(k)).collect();
        assert!(numbers.iter().all(|x| x.is_finite()), "{name} of {key}: {numbers:?}");
        bits.insert((name, key), numbers.into_iter().map(f64::to_bits).collect());
    }
}

fn same(got: &Bits, wanted: &Bits, name: &str) {
    assert_eq!(got.len(), wanted.len());
    let wrong: Vec<_> = wanted.iter().filter(|&(sum, bits)| got[sum] != *bits).map(|(sum, _)| sum).collect();
    assert!(wrong.is_empty(), "{name}: {} of {}, the first {:?}", wrong.len(), wanted.len(), wrong[0]);
}

/// Velocity gradient, and accelerations by w sigma and by w sigma L, in numbers T.
fn plain_sums<const D: usize, const N: usize, S: Space<D, N>, K: Kernel, T: Element>(
    p: &Particles<D, N>,
    pairs: Pairs,
    reach: f64,
    names: [&'static str; 5],
) -> Bits {
    let (mut bits, neighbors) = (Bits::new(), neighbors::<D, N, K>(p, reach, pairs));
    let mut gradient = vec![Matrix::default(); p.owned];
    velocity_gradient::<D, K, T>(&neighbors, pairs, &mut gradient);
    keep(&mut bits, names[0], &p.key, &gradient);
    let approaching = Viscosity { strength: 0.7, below: 0.0 };
    let weighted = |i: usize| p.stress[i] * S::metric(p.x[i], pairs.spacing);
    let (a, heat) = accelerate::<D, N, S, K, T, _>(p, &neighbors, pairs, approaching, weighted);
    keep(&mut bits, names[1], &p.key, &a);
    keep(&mut bits, names[2], &p.key, &heat);
    // Any tensor will do for L.
    let corrected = |i: usize| S::matrix(&weighted(i)).product(&S::matrix(&p.stress[i]));
    let all = Viscosity { strength: 0.7, below: f64::INFINITY };
    let (a, heat) = accelerate::<D, N, S, K, T, _>(p, &neighbors, pairs, all, corrected);
    keep(&mut bits, names[3], &p.key, &a);
    keep(&mut bits, names[4], &p.key, &heat);
    bits
}

/// Every sum there is over pairs in f64, and those that there are in f32 if lists are made for them.
fn sums<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
    p: &Particles<D, N>,
    pairs: Pairs,
    reach: f64,
) -> [Bits; 2] {
    let names = ["gradient", "stress", "heat", "corrected", "heat of all"];
    let mut bits = plain_sums::<D, N, S, K, f64>(p, pairs, reach, names);
    let neighbors = neighbors::<D, N, K>(p, reach, pairs);
    let (all, walls) = (&p.key[..], &p.key[p.mirror..]);
    let mut l = Vec::new();
    correction::<D, N, K>(p, &neighbors, pairs, Among::All, &mut l);
    keep(&mut bits, "correction", all, &l);
    correction::<D, N, K>(p, &neighbors, pairs, Among::Material, &mut l);
    keep(&mut bits, "correction in the material", all, &l);
    let (mut slopes, mut rate) = (Vec::new(), Vec::new());
    diffusion::gradient::<D, N, K, _>(p, &neighbors, pairs, &l, &p.density, &mut slopes);
    diffusion::diffusion::<D, N, K, _>(p, &neighbors, pairs, 0.3, &p.density, &slopes, &mut rate);
    keep(&mut bits, "gradient of density", all, &slopes);
    keep(&mut bits, "diffusion of density", all, &rate);
    let (mut slopes, mut rate) = (Vec::new(), Vec::new());
    diffusion::gradient::<D, N, K, _>(p, &neighbors, pairs, &l, &p.stress, &mut slopes);
    diffusion::diffusion::<D, N, K, _>(p, &neighbors, pairs, 0.3, &p.stress, &slopes, &mut rate);
    keep(&mut bits, "diffusion of stress", all, &rate);
    let nothing = (vec![Vector::default(); p.owned], vec![0.0; p.owned]);
    for (name, mean) in [("harmonic", Mean::Harmonic), ("arithmetic", Mean::Arithmetic)] {
        let (mut a, mut heat) = nothing.clone();
        viscosity::between_particles::<D, N, S, K>(p, &neighbors, pairs, mean, &mut a, &mut heat);
        keep(&mut bits, name, all, &a);
    }
    let (mut a, mut heat) = nothing.clone();
    viscosity::on_impact::<D, N, S, K>(p, &neighbors, pairs, 0.4, &mut a, &mut heat);
    keep(&mut bits, "impact", all, &a);
    keep(&mut bits, "heat of impact", all, &heat);
    let (mut a, mut opposing) = (nothing.0, Vec::new());
    artificial_stress::opposing::<D, N, S>(p, 0.3, pairs.spacing, &mut opposing);
    artificial_stress::artificial_stress::<D, N, S, K>(p, &neighbors, pairs, &opposing, &mut a);
    keep(&mut bits, "artificial stress", all, &a);
    let (mut surface, mut shift) = (Vec::new(), Vec::new());
    shifting::surface::<D, N, K>(p, &neighbors, pairs, &mut surface);
    keep(&mut bits, "surface", all, &surface);
    surface.resize(p.len(), 0.0);
    let how = shifting::Shifting { strength: 1.0, dt: 0.02, surface: &surface };
    shifting::shift::<D, N, K>(p, &neighbors, pairs, how, &mut shift);
    keep(&mut bits, "shift", all, &shift);
    let (mut v, mut stress) = (p.v.clone(), p.stress.clone());
    extrapolate::<D, K, _>(&neighbors, pairs, &mut v);
    extrapolate::<D, K, _>(&neighbors, pairs, &mut stress);
    keep(&mut bits, "velocity at walls", walls, &v[p.mirror..]);
    keep(&mut bits, "stress at walls", walls, &stress[p.mirror..]);
    let singles = match pairs.precision {
        Precision::Double => Bits::new(),
        Precision::Mixed => plain_sums::<D, N, S, K, f32>(p, pairs, reach, names),
    };
    [bits, singles]
}

/// Instructions, the length of blocks that goes with the precision, longer lists, and another order of the particles: none
/// changes a bit.
#[test]
fn sums_do_not_depend_on_instructions_lists_or_blocks() {
    fn check<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(side: usize) {
        let (p, other) = (walled::<D, N, S>(side, None), walled::<D, N, S>(side, Some(2)));
        assert!(p.key != other.key);
        let h = 1.2;
        let pairs = |instructions, precision| Pairs { h, spacing: 1.0, instructions, precision };
        let best = there()[0];
        let [doubles, _] = sums::<D, N, S, K>(&p, pairs(best, Precision::Double), 2.1 * h);
        let [_, singles] = sums::<D, N, S, K>(&p, pairs(best, Precision::Mixed), 2.1 * h);
        assert!(singles.len() == 5 * p.owned);
        for it in there() {
            for precision in [Precision::Double, Precision::Mixed] {
                for (p, reach) in [(&p, 2.1 * h), (&p, 2.9 * h), (&other, 2.1 * h)] {
                    let own = p.key == walled::<D, N, S>(side, None).key;
                    let name = format!("{:?} {:?} {it} {precision:?} {reach} in order {own}", S::KIND, K::KIND);
                    let [got, in_singles] = sums::<D, N, S, K>(p, pairs(it, precision), reach);
                    same(&got, &doubles, &name);
                    if precision == Precision::Mixed {
                        same(&in_singles, &singles, &name);
                    }
                }
            }
        }
    }
    check::<2, 4, PlaneStrain, CubicSpline>(13);
    check::<2, 4, PlaneStrain, WendlandC2>(13);
    check::<2, 4, Axisymmetric, CubicSpline>(13);
    check::<2, 4, Axisymmetric, WendlandC2>(13);
    check::<3, 6, ThreeD, CubicSpline>(9);
    check::<3, 6, ThreeD, WendlandC2>(9);
}

/// Velocity gradients and accelerations in a row.
fn numbers<const D: usize, const N: usize, S: Space<D, N>, T: Element>(
    p: &Particles<D, N>,
    pairs: Pairs,
) -> [Vec<f64>; 2] {
    let neighbors = neighbors::<D, N, CubicSpline>(p, 2.1 * pairs.h, pairs);
    let mut gradient = vec![Matrix::default(); p.owned];
    velocity_gradient::<D, CubicSpline, T>(&neighbors, pairs, &mut gradient);
    let weighted = |i: usize| p.stress[i] * S::metric(p.x[i], pairs.spacing);
    let viscosity = Viscosity { strength: 0.7 * pairs.spacing, below: 0.0 };
    let (a, _) = accelerate::<D, N, S, CubicSpline, T, _>(p, &neighbors, pairs, viscosity, weighted);
    [gradient.iter().flat_map(|g| g.0.into_iter().flatten()).collect(), a.iter().flat_map(|a| a.0).collect()]
}

/// A jittered block of some spacing, on points 2^-40 m apart: so moving it takes no digits away.
fn fine<const D: usize, const N: usize, S: Space<D, N>>(spacing: f64) -> Particles<D, N> {
    let mut p = block::<D, N, S>(if D == 2 { 14 } else { 8 }, 0.15);
    let points = 2f64.powi(40);
    for i in 0..p.owned {
        p.x[i] = Vector(p.x[i].0.map(|x| (x * spacing * points).round() / points));
        p.volume[i] *= spacing.powi(D as i32);
    }
    p
}

fn moved<const D: usize, const N: usize>(p: &Particles<D, N>, by: [f64; D]) -> Particles<D, N> {
    let mut p = p.clone();
    for x in &mut p.x {
        *x += Vector(by);
    }
    p
}

/// Mixed precision against double, relative to the largest; and what is left of it far from the origin. A plain f32 has
/// steps of 8e-6 m at 100 m, 1e-3 of the spacing here.
#[test]
fn mixed_precision() {
    fn check<const D: usize, const N: usize, S: Space<D, N>>() {
        // Rings do not move along the radius.
        let along = |by: f64| -> [f64; D] { std::array::from_fn(|a| if S::WEIGHTED && a == 0 { 0.0 } else { by }) };
        let mixed = |h, spacing, instructions| Pairs { h, spacing, instructions, precision: Precision::Mixed };
        let errors = |got: &[Vec<f64>; 2], wanted: &[Vec<f64>; 2]| -> [f64; 2] {
            std::array::from_fn(|k| {
                let size = wanted[k].iter().fold(0.0_f64, |size, x| size.max(x.abs()));
                got[k].iter().zip(&wanted[k]).fold(0.0_f64, |error, (a, b)| error.max((a - b).abs())) / size
            })
        };
        let bits = |of: &[Vec<f64>; 2]| of.each_ref().map(|x| x.iter().map(|x| x.to_bits()).collect::<Vec<u64>>());
        for it in there() {
            let (p, pairs) = (fine::<D, N, S>(0.01), mixed(0.012, 0.01, it));
            let double = numbers::<D, N, S, f64>(&p, Pairs { precision: Precision::Double, ..pairs });
            let here = errors(&numbers::<D, N, S, f32>(&p, pairs), &double);
            let there = errors(&numbers::<D, N, S, f32>(&moved(&p, along(100.0)), pairs), &double);
            println!("{:?} {it}: gradient, acceleration {here:?}, moved by 100 m {there:?}", S::KIND);
            for error in here.into_iter().chain(there) {
                assert!(error > 0.0 && error < 1e-5, "{:?} {it}: {here:?} {there:?}", S::KIND);
            }
            // With h a power of two, x/h is exact, and moving by the spacing of the grid changes a place's grid point only.
            let (p, pairs) = (fine::<D, N, S>(0.8), mixed(1.0, 0.8, it));
            let wanted = bits(&numbers::<D, N, S, f32>(&p, pairs));
            for by in [16.0, -16.0, 1.0, 1.0 / 16.0, 7.0 + 5.0 / 16.0, 4096.0] {
                let got = bits(&numbers::<D, N, S, f32>(&moved(&p, along(by)), pairs));
                assert!(got == wanted, "{:?} {it}: moved by {by} h", S::KIND);
            }
        }
    }
    check::<2, 4, PlaneStrain>();
    check::<2, 4, Axisymmetric>();
    check::<3, 6, ThreeD>();
}

/// Particles in one place have no direction to push each other in: no force, and nothing that is not a number.
#[test]
fn particles_in_one_place() {
    for instructions in there() {
        for precision in [Precision::Double, Precision::Mixed] {
            let pairs = Pairs { h: 1.2, spacing: 1.0, instructions, precision };
            let mut p = block::<3, 6, ThreeD>(2, 0.0);
            p.arrange(&[0, 1]);
            p.x[1] = p.x[0];
            for sums in [numbers::<3, 6, ThreeD, f64>(&p, pairs)]
                .into_iter()
                .chain((precision == Precision::Mixed).then(|| numbers::<3, 6, ThreeD, f32>(&p, pairs)))
            {
                assert!(sums.iter().flatten().all(|&x| x == 0.0), "{instructions} {precision:?}: {sums:?}");
            }
        }
    }
}
