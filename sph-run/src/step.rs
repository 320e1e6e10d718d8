//! One time step: leap-frog in its kick-drift-kick form. Strain rates are taken from the velocities at the half step,
//! so that stress and position are known at whole steps, velocity at halves: the staggered scheme of Yang et al. 2020,
//! Eqs 33-39, without the lag of forces their text leaves open.

use crate::algebra::{Matrix, Sym, Vector};
use crate::material::{Increment, Material, gated};
use crate::parallel::halo::Fields;
use crate::physics::Physics;
use crate::rates::{
    momentum::{Traction, momentum},
    velocity_gradient::velocity_gradient,
};
use crate::simulation::Simulation;
use crate::space::Space;
use crate::timestep::Plan;

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// Accelerations at the very start, of stress and artificial viscosity: viscosities between particles follow from the
    /// first strain. Collective.
    pub fn begin(&mut self) {
        self.find_support();
        self.refresh_correction();
        self.accelerate();
    }

    /// Advances by the planned step. Collective.
    pub fn step(&mut self, plan: &Plan) {
        let dt = plan.time_step;
        self.kick(0.5 * dt);
        self.drift(dt);
        if plan.lists_go_stale {
            self.rebuild();
        } else {
            self.refresh_volumes();
            self.fill(Fields::Motion);
        }
        if self.parameters.stabilisers.stress_diffusion > 0.0 {
            // New copies have none yet; and what crossed a plane of symmetry turned its own around.
            self.fill(Fields::Stress);
        }
        self.find_support();
        self.refresh_correction();
        self.diffuse();
        self.update_stress(dt);
        self.fill(Fields::Stress);
        self.fill_viscosity();
        self.accelerate();
        self.heat(dt);
        self.kick(0.5 * dt);
        self.shift(dt);
        self.clock.time = plan.time;
        self.clock.time_step = dt;
        self.clock.step += 1;
    }

    fn find_support(&mut self) {
        self.neighbors.find::<D, N, P::Kernel>(&self.particles, self.parameters.h);
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
    }

    /// Density and stress of the owned particles, from the velocity gradient.
    fn update_stress(&mut self, dt: f64) {
        let (spacing, gate) = (self.parameters.spacing, self.parameters.gate);
        velocity_gradient(&self.particles, &self.neighbors, &mut self.gradient);
        self.correct_gradient();
        let p = &mut self.particles;
        let viscous = self.material.pair_viscosity().is_some();
        for (i, gradient) in self.gradient.iter().enumerate() {
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
        self.refresh_volumes();
    }

    /// Accelerations of the owned particles, from the stresses around them.
    fn accelerate(&mut self) {
        let spacing = self.parameters.spacing;
        let mut a = std::mem::take(&mut self.particles.a);
        let (p, buffers) = (&self.particles, &mut self.buffers);
        let weigh = |(&s, &x): (&Sym<N>, &Vector<D>)| s * P::Space::metric(x, spacing);
        buffers.weighted.clear();
        buffers.weighted.extend(p.stress.iter().zip(&p.x).map(weigh));
        if self.parameters.stabilisers.gradient_correction {
            let correct = |(s, l): (&Sym<N>, &Matrix<D>)| P::Space::matrix(s).product(l);
            buffers.corrected.clear();
            buffers.corrected.extend(buffers.weighted.iter().zip(&buffers.correction).map(correct));
            let corrected = std::mem::take(&mut buffers.corrected);
            self.accelerate_by(&corrected, &mut a);
            self.buffers.corrected = corrected;
        } else {
            let weighted = std::mem::take(&mut buffers.weighted);
            self.accelerate_by(&weighted, &mut a);
            self.buffers.weighted = weighted;
        }
        self.accelerate_further(&mut a);
        let p = &mut self.particles;
        for (i, a) in a.iter_mut().enumerate() {
            *a += P::Space::hoop(&p.stress[i], p.density[i], p.x[i], spacing) + self.gravity;
        }
        p.a = a;
    }

    fn accelerate_by<T: Traction<D, N>>(&mut self, weighted: &[T], a: &mut [Vector<D>]) {
        let (p, heat, parameters) = (&self.particles, &mut self.buffers.heat, &self.parameters);
        heat.resize(p.owned, 0.0);
        let (pairs, viscosity) = (parameters.pairs, parameters.viscosity);
        momentum::<D, N, P::Space, T>(p, &self.neighbors, pairs, viscosity, weighted, a, heat);
    }

    /// Counts the heat of the viscosity.
    fn heat(&mut self, dt: f64) {
        for (work, power) in self.particles.work.iter_mut().zip(&self.buffers.heat) {
            work.viscous += power * dt;
        }
    }
}
