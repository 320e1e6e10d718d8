//! Viscosity between particles beyond the linear artificial one. Each adds to accelerations and to the heat that
//! [`super::momentum`] has begun.

use crate::algebra::{Matrix, Vector};
use crate::lanes::Lanes;
use crate::material::Mean;
use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::rates::momentum::half_radius;
use crate::space::Space;
use crate::sweep::{Block, Mover, Needs, Pair, Pairs, Sums};

/// Adds the acceleration by the viscosity of a fluid of variable viscosity (Szewc 2017, Eq 9, in volume form), m/s2:
///
/// ```text
/// 1/rho_i sum_j V_j (mu_i + mu_j) x_ij . grad_i W_ij/(r^2 + eta^2) v_ij      eta = 0.01 h
/// ```
///
/// or with 4 mu_i mu_j/(mu_i + mu_j) in place of the sum (Cleary & Monaghan 1999). It stands for div(mu grad v), without
/// the part of grad v^T. In the axisymmetric space pairs count by the mean of their radii, and -mu v_r/(rho r^2) is added.
pub fn between_particles<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    mean: Mean,
    acceleration: &mut [Vector<D>],
    heat: &mut [f64],
) {
    let force = Force::all(particles.owned);
    let radius = &radii::<D, N, S>(&particles.x, pairs.spacing);
    let Particles { x, v, viscosity, .. } = particles;
    let mut sums =
        Between { movers: &neighbors.movers, viscosity, radius, mean, eta2: 1e-4 * pairs.h * pairs.h, force };
    neighbors.sweep::<K, f64>(pairs, &mut sums);
    sums.force.add::<N, S>(particles, pairs, acceleration, heat);
    for (i, (acceleration, heat)) in acceleration.iter_mut().zip(heat).enumerate() {
        let hoop = S::strain_rate(&Matrix::default(), x[i], v[i], pairs.spacing) * viscosity[i];
        let hoop = S::hoop(&hoop, particles.density[i], x[i], pairs.spacing);
        *acceleration += hoop;
        *heat -= hoop.dot(v[i]);
    }
}

fn radii<const D: usize, const N: usize, S: Space<D, N>>(x: &[Vector<D>], spacing: f64) -> Vec<f64> {
    x.iter().map(|&x| half_radius::<D, N, S>(x, spacing)).collect()
}

/// w sum_j .. and its power, of every owned particle.
struct Force<const D: usize> {
    force: Vec<Vector<D>>,
    power: Vec<f64>,
}

impl<const D: usize> Force<D> {
    fn all(count: usize) -> Self {
        Self { force: vec![Vector::default(); count], power: vec![0.0; count] }
    }

    fn add<const N: usize, S: Space<D, N>>(
        &self,
        particles: &Particles<D, N>,
        pairs: Pairs,
        acceleration: &mut [Vector<D>],
        heat: &mut [f64],
    ) {
        for i in 0..particles.owned {
            let per_mass = 1.0 / (particles.density[i] * S::metric(particles.x[i], pairs.spacing).abs());
            acceleration[i] += self.force[i] * per_mass;
            heat[i] -= 0.5 * self.power[i] * per_mass;
        }
    }
}

struct Between<'a, const D: usize> {
    movers: &'a [Mover<D, f64>],
    viscosity: &'a [f64],
    radius: &'a [f64],
    mean: Mean,
    eta2: f64,
    force: Force<D>,
}

impl<const D: usize> Sums<D, f64> for Between<'_, D> {
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let (v, mu, radius) = (
            block.own_of(self.movers, |mover| &mover.v),
            block.own_numbers(self.viscosity),
            block.own_numbers(self.radius),
        );
        let (eta2, smallest, four) = (block.number(self.eta2), block.number(f64::MIN_POSITIVE), block.number(4.0));
        let mut sum: Vector<D, L> = block.zero();
        let mut power = block.number(0.0);
        for pair in pairs {
            let j = pair.j;
            let other = block.same(self.viscosity[j]);
            let both = match self.mean {
                Mean::Arithmetic => mu + other,
                Mean::Harmonic => (four * mu * other).over((mu + other).largest(smallest)),
            };
            let r2 = pair.d.norm2();
            let distance = r2.over(r2 + eta2) * (radius + block.same(self.radius[j]));
            let weight = block.same(pair.other.weight) * pair.slope * both * distance;
            let difference = v - block.all(&pair.other.v);
            sum.add_scaled(weight, difference);
            power = difference.norm2().multiply_add(weight, power);
        }
        block.put(&mut self.force.force, sum);
        block.put(&mut self.force.power, power);
    }
}

/// Quadratic artificial viscosity of impacts (von Neumann & Richtmyer 1950; Monaghan 1992): on approaching pairs the
/// pressures of both add up to
/// beta rho0 (h v_ij . x_ij/(r^2 + 0.01 h^2))^2. `strength`: beta rho0 h^2, Pa s2.
pub fn on_impact<const D: usize, const N: usize, S: Space<D, N>, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors<D>,
    pairs: Pairs,
    strength: f64,
    acceleration: &mut [Vector<D>],
    heat: &mut [f64],
) {
    let force = Force::all(particles.owned);
    let radius = &radii::<D, N, S>(&particles.x, pairs.spacing);
    let mut sums = Impact { movers: &neighbors.movers, radius, strength, eta2: 0.01 * pairs.h * pairs.h, force };
    neighbors.sweep::<K, f64>(pairs, &mut sums);
    sums.force.add::<N, S>(particles, pairs, acceleration, heat);
}

struct Impact<'a, const D: usize> {
    movers: &'a [Mover<D, f64>],
    radius: &'a [f64],
    strength: f64,
    eta2: f64,
    force: Force<D>,
}

impl<const D: usize> Sums<D, f64> for Impact<'_, D> {
    const NEEDS: Needs = Needs::SLOPE;

    #[inline(always)]
    fn block<'a, L: Lanes<Element = f64>>(&mut self, block: Block<L>, pairs: impl Iterator<Item = Pair<'a, D, L>>) {
        let (v, radius) = (block.own_of(self.movers, |mover| &mover.v), block.own_numbers(self.radius));
        let (eta2, strength, zero) = (block.number(self.eta2), block.number(-self.strength), block.number(0.0));
        let mut sum: Vector<D, L> = block.zero();
        let mut power = zero;
        for pair in pairs {
            let j = pair.j;
            let approach = (v - block.all(&pair.other.v)).dot(pair.d).least(zero);
            let rate = approach.over(pair.d.norm2() + eta2);
            let weight = block.same(pair.other.weight) * pair.slope * (radius + block.same(self.radius[j]));
            let push = strength * rate * rate * weight;
            sum.add_scaled(push, pair.d);
            power = approach.multiply_add(push, power);
        }
        block.put(&mut self.force.force, sum);
        block.put(&mut self.force.power, power);
    }
}
