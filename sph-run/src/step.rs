//! One time step: leap-frog in its kick-drift-kick form. Strain rates are taken from the velocities at the half step,
//! so that stress and position are known at whole steps, velocity at halves: the staggered scheme of Yang et al. 2020,
//! Eqs 33-39, without the lag of forces their text leaves open.

use crate::algebra::{Matrix, Vector};
use crate::lanes::{Element, Parts};
use crate::material::{Increment, Material, gated};
use crate::parallel::exchange::look_after;
use crate::parallel::halo::Fields;
use crate::phases::Phase;
use crate::physics::Physics;
use crate::rates::{
    momentum::{Stressed, Traction, momentum},
    velocity_gradient::gradient_of_part,
};
use crate::simulation::Simulation;
use crate::space::Space;
use crate::stabilize::Buffers;
use crate::sweep::{Precision, weight};
use crate::timestep::Plan;
use std::ops::Range;

/// Particles whose velocity gradients are kept at a time: whole blocks, and few enough for a near cache.
const PART: usize = 4096;

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// Accelerations at the very start, of stress and artificial viscosity: viscosities between particles follow from the
    /// first strain. Collective.
    pub fn begin(&mut self) {
        self.refresh_correction();
        self.accelerate(0);
    }

    /// Advances by the planned step. Collective.
    pub fn step(&mut self, plan: &Plan) {
        let dt = plan.time_step;
        self.watch.enter(Phase::Motion);
        self.kick(0.5 * dt);
        self.drift(dt);
        self.neighbors.moved(plan.farthest);
        let mut strained = 0;
        if plan.lists_go_stale {
            self.watch.enter(Phase::Lists);
            self.choose_skin(plan.farthest);
            self.rebuild();
        } else {
            self.refresh_volumes();
            // What corrects or diffuses comes before the strain, and needs copies.
            let ahead = if self.parameters.stabilisers.before_the_strain() { 0 } else { self.ahead() };
            self.fill_while(Fields::Motion, ahead, |run| {
                run.support_first(ahead);
                run.update_stress(0..ahead, dt);
            });
            strained = ahead;
        }
        if self.parameters.stabilisers.stress_diffusion > 0.0 {
            // New copies have none yet; and what crossed a plane of symmetry turned its own around.
            self.fill(Fields::Stress);
        }
        self.watch.enter(Phase::Stabilisers);
        self.refresh_correction();
        self.diffuse();
        self.update_stress(strained..self.particles.owned, dt);
        self.refresh_volumes();
        let ahead = self.ahead();
        self.fill_while(Fields::Stress, ahead, |run| {
            run.watch.enter(Phase::Acceleration);
            run.push(0..run.particles.owned, 0..ahead);
        });
        self.watch.enter(Phase::Stabilisers);
        self.fill_viscosity();
        self.watch.enter(Phase::Acceleration);
        self.accelerate(ahead);
        self.heat(dt);
        self.watch.enter(Phase::Motion);
        self.kick(0.5 * dt);
        self.watch.enter(Phase::Stabilisers);
        self.shift(dt);
        self.clock.time = plan.time;
        self.clock.time_step = dt;
        self.clock.step += 1;
    }

    /// v += a dt, damped implicitly.
    fn kick(&mut self, dt: f64) {
        let p = &mut self.particles;
        let kept = 1.0 / (1.0 + self.parameters.damping * dt);
        for i in 0..p.owned {
            p.v[i] = (p.v[i] + p.a[i] * dt) * kept;
        }
    }

    /// x += v dt
    fn drift(&mut self, dt: f64) {
        let p = &mut self.particles;
        for i in 0..p.owned {
            p.x[i] = p.x[i] + self.periods.rounded(p.v[i] * dt);
        }
        self.mirrors.keep_inside(p);
        self.walls.keep_out::<D, N, P::Space>(p, &self.periods, dt);
    }

    /// Density and stress of some owned particles, in whole blocks, from the velocity gradient.
    fn update_stress(&mut self, particles: Range<usize>, dt: f64) {
        for first in particles.clone().step_by(PART) {
            self.watch.enter(Phase::Gradient);
            look_after(self.comm);
            let part = first..(first + PART).min(particles.end);
            let mut gradient = std::mem::take(&mut self.gradient);
            gradient.resize(part.len(), Matrix::default());
            let (neighbors, pairs) = (&self.neighbors, self.parameters.pairs);
            match pairs.precision {
                Precision::Double => gradient_of_part::<D, P::Kernel, f64>(neighbors, pairs, first, &mut gradient),
                Precision::Mixed => gradient_of_part::<D, P::Kernel, f32>(neighbors, pairs, first, &mut gradient),
            }
            if self.parameters.stabilisers.gradient_correction {
                for (gradient, correction) in gradient.iter_mut().zip(&self.buffers.correction[part.clone()]) {
                    *gradient = gradient.product(correction);
                }
            }
            self.watch.enter(Phase::Material);
            self.strain(part, &gradient, dt);
            self.gradient = gradient;
        }
    }

    /// Density and stress of some owned particles under their velocity gradients.
    fn strain(&mut self, part: Range<usize>, gradients: &[Matrix<D>], dt: f64) {
        let (spacing, gate) = (self.parameters.spacing, self.parameters.gate);
        let p = &mut self.particles;
        let viscous = self.material.pair_viscosity().is_some();
        for (i, gradient) in part.zip(gradients) {
            // In the middle of the step, where the velocities are (Hughes & Winget 1980): dv/dx_mid = L (I - L dt/2)^-1, to
            // second order. At its end a rotation by omega dt would seem to dilate by (omega dt)^2/2 along each axis.
            let gradient = &gradient.with_square(0.5 * dt);
            let middle = p.x[i] - p.v[i] * (0.5 * dt);
            let strain = P::Space::strain_rate(gradient, middle, p.v[i], spacing) * dt;
            // drho/dt = -rho tr D, to second order and never negative.
            let half = (0.5 * strain.trace()).clamp(-0.5, 0.5);
            p.density[i] *= (1.0 - half) / (1.0 + half);
            let mut turned = self.material.rotate(p.stress[i], P::Space::spin(gradient), dt);
            if let Some(&rate) = self.buffers.density_rate.get(i) {
                p.density[i] += rate * dt;
            }
            if let Some(&rate) = self.buffers.stress_rate.get(i) {
                turned += rate * dt;
            }
            let step = Increment { strain, density: p.density[i], dt };
            let stress = gated(self.material.stress(turned, &step, &mut p.history[i]), p.density[i], gate);
            p.work[i].stress += 0.5 * (turned + stress).contract(strain) / p.density[i];
            p.stress[i] = stress;
            if viscous {
                p.viscosity[i] = self.material.viscosity(&step);
            }
        }
    }

    /// Accelerations of the owned particles, from the stresses around them. The first `ahead` have been pushed already.
    fn accelerate(&mut self, ahead: usize) {
        let owned = self.particles.owned;
        let laid_out = if ahead == 0 { 0 } else { owned };
        self.push(laid_out..self.particles.len(), ahead..owned);
        let mut a = std::mem::take(&mut self.particles.a);
        self.accelerate_further(&mut a);
        let spacing = self.parameters.spacing;
        let p = &mut self.particles;
        for (i, a) in a.iter_mut().enumerate() {
            *a += P::Space::hoop(&p.stress[i], p.density[i], p.x[i], spacing) + self.gravity;
        }
        p.a = a;
    }

    /// Lays out some particles, and sums the stresses around some owned ones.
    pub(crate) fn push(&mut self, new: Range<usize>, part: Range<usize>) {
        let spacing = self.parameters.spacing;
        let mut a = std::mem::take(&mut self.particles.a);
        let mut buffers = std::mem::take(&mut self.buffers);
        let Buffers { weighted, corrected, correction, heat, .. } = &mut buffers;
        let p = &self.particles;
        let weigh = |i: usize| p.stress[i] * P::Space::metric(p.x[i], spacing);
        let correct = |i: usize| P::Space::matrix(&weigh(i)).product(&correction[i]);
        match (self.parameters.stabilisers.gradient_correction, self.parameters.pairs.precision) {
            (false, Precision::Double) => self.push_by(new, part, weigh, &mut weighted.0, &mut a, heat),
            (false, Precision::Mixed) => self.push_by(new, part, weigh, &mut weighted.1, &mut a, heat),
            (true, Precision::Double) => self.push_by(new, part, correct, &mut corrected.0, &mut a, heat),
            (true, Precision::Mixed) => self.push_by(new, part, correct, &mut corrected.1, &mut a, heat),
        }
        self.buffers = buffers;
        self.particles.a = a;
    }

    fn push_by<F: Traction<D, N, T>, T: Element, G: Parts<Number = f64>>(
        &self,
        new: Range<usize>,
        part: Range<usize>,
        weighted: impl Fn(usize) -> G,
        stressed: &mut Vec<Stressed<F, T>>,
        a: &mut [Vector<D>],
        heat: &mut Vec<f64>,
    ) {
        let (p, parameters) = (&self.particles, &self.parameters);
        let (pairs, viscosity) = (parameters.pairs, parameters.viscosity);
        let per_volume = weight::<D, P::Kernel>(pairs.h, T::unit(pairs.h));
        Stressed::part::<D, N, P::Space, G>(new, p, pairs.spacing, per_volume, weighted, stressed);
        heat.resize(p.owned, 0.0);
        for first in part.clone().step_by(PART) {
            look_after(self.comm);
            let some = first..(first + PART).min(part.end);
            momentum::<D, N, P::Space, P::Kernel, F, T>(
                some,
                p,
                &self.neighbors,
                pairs,
                viscosity,
                stressed,
                (a, heat),
            );
        }
    }

    /// Counts the heat of the viscosity.
    fn heat(&mut self, dt: f64) {
        for (work, power) in self.particles.work.iter_mut().zip(&self.buffers.heat) {
            work.viscous += power * dt;
        }
    }
}
