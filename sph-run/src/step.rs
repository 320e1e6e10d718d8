//! One time step: leap-frog in its kick-drift-kick form. Strain rates are taken from the velocities at the half step,
//! so that stress and position are known at whole steps, velocity at halves: the staggered scheme of Yang et al. 2020,
//! Eqs 33-39, without the lag of forces their text leaves open.

use crate::algebra::{Sym, Vector};
use crate::material::{Material, gated};
use crate::parallel::halo::Fields;
use crate::physics::Physics;
use crate::simulation::Simulation;
use crate::space::Space;
use crate::sweep;
use crate::timestep::Plan;

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
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
        self.update_stress(dt);
        self.fill(Fields::Stress);
        self.accelerate();
        self.kick(0.5 * dt);
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
    }

    /// Density and stress of the owned particles, from the velocity gradient.
    fn update_stress(&mut self, dt: f64) {
        let (spacing, gate) = (self.parameters.spacing, self.parameters.gate);
        let p = &mut self.particles;
        sweep::velocity_gradient::<D, N, P::Kernel>(p, &self.neighbors, self.parameters.pairs, &mut self.gradient);
        for (i, gradient) in self.gradient.iter().enumerate() {
            let strain = P::Space::strain_rate(gradient, p.x[i], p.v[i], spacing) * dt;
            // drho/dt = -rho tr D, to second order and never negative.
            let half = (0.5 * strain.trace()).clamp(-0.5, 0.5);
            p.density[i] *= (1.0 - half) / (1.0 + half);
            let turned = self.material.rotate(p.stress[i], P::Space::spin(gradient), dt);
            let stress = self.material.stress(turned, strain, &mut p.history[i]);
            p.stress[i] = gated(stress, p.density[i], gate);
        }
        self.refresh_volumes();
    }

    /// Accelerations of the owned particles, from the stresses around them.
    pub fn accelerate(&mut self) {
        let spacing = self.parameters.spacing;
        let p = &mut self.particles;
        self.weighted.clear();
        self.weighted
            .extend(p.stress.iter().zip(&p.x).map(|(&s, &x): (&Sym<N>, &Vector<D>)| s * P::Space::metric(x, spacing)));
        let mut a = std::mem::take(&mut p.a);
        sweep::momentum::<D, N, P::Space, P::Kernel>(p, &self.neighbors, self.parameters.pairs, &self.weighted, &mut a);
        for (i, a) in a.iter_mut().enumerate() {
            *a += P::Space::hoop(&p.stress[i], p.density[i], p.x[i], spacing) + self.gravity;
        }
        p.a = a;
    }
}
