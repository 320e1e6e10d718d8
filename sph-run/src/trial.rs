//! Trial: both rates from one sweep over the pairs. Chosen by environment variables, one rank, plain scheme only.

use crate::algebra::{Matrix, Sym, Vector};
use crate::material::{Increment, Material, gated};
use crate::neighbors::Neighbors;
use crate::parallel::halo::Fields;
use crate::particles::Particles;
use crate::physics::{Kernel, Physics};
use crate::rates::momentum::Viscosity;
use crate::simulation::Simulation;
use crate::space::Space;
use crate::sweep::{Pair, Pairs, around, around_listed};
use crate::timestep::Plan;

/// How time is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// Two sweeps.
    KickDriftKick,
    /// v*(n+3/2) = v(n+1/2) + dt ((1 + gamma) a(n) - gamma a(n-1)): TALUS_TRIAL=staggered:gamma
    Staggered(f64),
    /// y(n+1) = y(n-1) + 2 dt f(n), every `every` steps Euler; `lag`: viscosity from v(n-1): TALUS_TRIAL=verlet:40[:lag]
    Verlet { every: u64, lag: bool },
}

impl Scheme {
    /// From the environment.
    pub fn asked() -> Self {
        let asked = std::env::var("TALUS_TRIAL").unwrap_or_default();
        let parts: Vec<&str> = asked.split(':').collect();
        match parts[0] {
            "" => Self::KickDriftKick,
            "staggered" => Self::Staggered(parts[1].parse().expect("gamma")),
            "verlet" => Self::Verlet { every: parts[1].parse().expect("steps"), lag: parts.get(2) == Some(&"lag") },
            other => panic!("TALUS_TRIAL={other}"),
        }
    }
}

/// What a particle remembers for the trial.
#[derive(Clone, Copy, Debug, Default)]
pub struct Past<const D: usize, const N: usize> {
    pub v: Vector<D>,
    pub a: Vector<D>,
    pub stress: Sym<N>,
    pub density: f64,
}

/// Velocity gradient and acceleration in one sweep; `viscous` velocities for the viscosity.
fn rates<const D: usize, const N: usize, const LISTED: bool, S: Space<D, N>, K: Kernel>(
    p: &Particles<D, N>,
    neighbors: &Neighbors,
    (pairs, viscosity): (Pairs, Viscosity),
    weighted: &[Sym<N>],
    viscous: &[Vector<D>],
    gradient: &mut [Matrix<D>],
    acceleration: &mut [Vector<D>],
    heat: &mut [f64],
) {
    let nearest = 1e-6 * pairs.h * pairs.h;
    for (i, ((acceleration, heat), gradient)) in acceleration.iter_mut().zip(heat).zip(gradient).enumerate() {
        let (v, w, own) = (p.v[i], viscous[i], weighted[i]);
        let metric = S::metric(p.x[i], pairs.spacing);
        let (mut sum, mut power, mut slope) = (Vector::default(), 0.0, Matrix::default());
        let visit = |pair: Pair<D>| {
            let j = pair.j;
            let weight = p.volume[j] * pair.slope;
            slope.add_outer(weight, p.v[j] - v, pair.d);
            let approach = (w - viscous[j]).dot(pair.d).min(viscosity.below);
            let mean_metric = 0.5 * (metric.abs() + S::metric(p.x[j], pairs.spacing).abs());
            let push = viscosity.strength * mean_metric * approach / pair.r2().max(nearest);
            sum += (S::traction(&(own + weighted[j]), pair.d) + pair.d * push) * weight;
            power += push * approach * weight;
        };
        if LISTED {
            around_listed::<D, N, K>(p, neighbors.of_owned.of(i), pairs.h, i, visit);
        } else {
            around(p, &neighbors.support, i, visit);
        }
        *gradient = slope;
        *acceleration = sum * (1.0 / (p.density[i] * metric));
        *heat = -0.5 * power / (p.density[i] * metric);
    }
}

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// Rates at the very start.
    pub fn begin_trial(&mut self) {
        self.particles.past = vec![Past::default(); self.particles.owned];
        self.sweep_once(None);
        for (past, &a) in self.particles.past.iter_mut().zip(&self.particles.a) {
            past.a = a;
        }
    }

    fn sweep_once(&mut self, viscous: Option<&[Vector<D>]>) {
        let spacing = self.parameters.spacing;
        let listed = self.listed;
        if !listed {
            self.find_support();
        }
        let mut a = std::mem::take(&mut self.particles.a);
        let (p, buffers) = (&self.particles, &mut self.buffers);
        buffers.weighted.clear();
        buffers.weighted.extend(p.stress.iter().zip(&p.x).map(|(&s, &x)| s * P::Space::metric(x, spacing)));
        buffers.heat.resize(p.owned, 0.0);
        let rates =
            if listed { rates::<D, N, true, P::Space, P::Kernel> } else { rates::<D, N, false, P::Space, P::Kernel> };
        rates(
            p,
            &self.neighbors,
            (self.parameters.pairs, self.parameters.viscosity),
            &buffers.weighted,
            viscous.unwrap_or(&p.v),
            &mut self.gradient,
            &mut a,
            &mut buffers.heat,
        );
        for (i, a) in a.iter_mut().enumerate() {
            *a += P::Space::hoop(&p.stress[i], p.density[i], p.x[i], spacing) + self.gravity;
        }
        self.particles.a = a;
    }

    fn fill_all(&mut self, plan: &Plan) {
        if plan.lists_go_stale {
            self.rebuild();
        } else {
            self.refresh_volumes();
            self.fill(Fields::Motion);
        }
        self.fill(Fields::Stress);
    }

    pub fn step_staggered(&mut self, plan: &Plan, gamma: f64) {
        let dt = plan.time_step;
        let (spacing, gate) = (self.parameters.spacing, self.parameters.gate);
        self.kick(0.5 * dt);
        self.drift(dt);
        let p = &mut self.particles;
        for (i, gradient) in self.gradient.iter().enumerate() {
            // Taken at the places at the start of the step.
            let gradient = &gradient.with_square(-0.5 * dt);
            let middle = p.x[i] - p.v[i] * (0.5 * dt);
            let strain = P::Space::strain_rate(gradient, middle, p.v[i], spacing) * dt;
            let half = (0.5 * strain.trace()).clamp(-0.5, 0.5);
            p.density[i] *= (1.0 - half) / (1.0 + half);
            let turned = self.material.rotate(p.stress[i], P::Space::spin(gradient), dt);
            let step = Increment { strain, density: p.density[i], dt };
            let stress = gated(self.material.stress(turned, &step, &mut p.history[i]), p.density[i], gate);
            p.work[i].stress += 0.5 * (turned + stress).contract(strain) / p.density[i];
            p.stress[i] = stress;
            let past = &mut p.past[i];
            past.v = p.v[i];
            p.v[i] += p.a[i] * (dt * (1.0 + gamma)) - past.a * (dt * gamma);
        }
        self.fill_all(plan);
        for (past, &a) in self.particles.past.iter_mut().zip(&self.particles.a) {
            past.a = a;
        }
        self.sweep_once(None);
        let p = &mut self.particles;
        for (v, past) in p.v.iter_mut().zip(&p.past) {
            *v = past.v;
        }
        self.heat(dt);
        self.kick(0.5 * dt);
        self.tick(plan);
    }

    pub fn step_verlet(&mut self, plan: &Plan, every: u64, lag: bool) {
        let dt = plan.time_step;
        let (spacing, gate) = (self.parameters.spacing, self.parameters.gate);
        let euler = self.clock.step.is_multiple_of(every) || self.clock.step == 0;
        let span = if euler { dt } else { dt + self.clock.time_step };
        let p = &mut self.particles;
        for (i, gradient) in self.gradient.iter().enumerate() {
            let (x, v) = (p.x[i], p.v[i]);
            let now = Past { v, a: p.a[i], stress: p.stress[i], density: p.density[i] };
            let base = if euler { now } else { p.past[i] };
            let rate = P::Space::strain_rate(gradient, x, v, spacing);
            let strain = rate * span;
            let half = (0.5 * strain.trace()).clamp(-0.5, 0.5);
            p.density[i] = base.density * (1.0 - half) / (1.0 + half);
            let turned = self.material.rotate(base.stress, P::Space::spin(gradient), span);
            let step = Increment { strain, density: p.density[i], dt: span };
            let plastic = p.history[i].plastic_strain;
            let stress = gated(self.material.stress(turned, &step, &mut p.history[i]), p.density[i], gate);
            p.history[i].plastic_strain = plastic + (p.history[i].plastic_strain - plastic) * (dt / span);
            p.work[i].stress += now.stress.contract(rate) * dt / now.density;
            p.stress[i] = stress;
            p.x[i] = x + self.periods.rounded(v * dt + now.a * (0.5 * dt * dt));
            p.v[i] = base.v + now.a * span;
            p.past[i] = now;
        }
        self.mirrors.keep_inside(p);
        self.fill_all(plan);
        if lag {
            let p = &mut self.particles;
            let now = p.v.clone();
            for (v, past) in p.v.iter_mut().zip(&p.past) {
                *v = past.v;
            }
            self.fill(Fields::Motion);
            let then = std::mem::replace(&mut self.particles.v, now);
            self.sweep_once(Some(&then));
        } else {
            self.sweep_once(None);
        }
        self.heat(dt);
        self.tick(plan);
    }

    fn tick(&mut self, plan: &Plan) {
        self.clock.time = plan.time;
        self.clock.time_step = plan.time_step;
        self.clock.step += 1;
    }
}
