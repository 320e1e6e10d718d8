//! What a scene may ask for beyond the plain scheme: corrected gradients, diffusion of density and stress, artificial
//! stress, viscosity of impacts, shifting. Each is off unless the law or the scene asks
//! for it, and then costs sweeps of its own: the plain
//! scheme pays nothing.

use crate::algebra::{Matrix, Sym, Vector};
use crate::material::Material as _;
use crate::phases::Phase;
use crate::physics::Physics;
use crate::rates::correction::{Among, correction};
use crate::rates::momentum::Stressed;
use crate::rates::wall::extrapolate;
use crate::rates::{artificial_stress, diffusion, shifting, viscosity};
use crate::simulation::Simulation;
use formats::scene::Scene;

/// Strengths of the stabilisers; 0 where off.
#[derive(Clone, Copy, Debug)]
pub struct Stabilisers {
    /// Gradients by sigma_i L_i + sigma_j L_j?
    pub gradient_correction: bool,
    /// delta h c0 of the density's diffusion, m2/s.
    pub density_diffusion: f64,
    /// zeta h c0 of the stress's diffusion, m2/s.
    pub stress_diffusion: f64,
    /// epsilon of the artificial stress.
    pub artificial_stress: f64,
    /// beta rho0 h^2 of the quadratic viscosity, Pa s2.
    pub impact: f64,
    /// Strength of shifting.
    pub shifting: f64,
}

impl Stabilisers {
    /// Those of a scene.
    pub fn new(scene: &Scene) -> Self {
        let (numerics, h) = (&scene.numerics, scene.h());
        let spread = h * scene.material.sound_speed();
        Self {
            gradient_correction: numerics.gradient_correction,
            density_diffusion: numerics.density_diffusion * spread,
            stress_diffusion: numerics.stress_diffusion * spread,
            artificial_stress: numerics.artificial_stress,
            impact: numerics.quadratic_viscosity * scene.material.density() * h * h,
            shifting: numerics.shifting,
        }
    }

    /// Does anything need copies between the drift and the strain?
    pub fn before_the_strain(&self) -> bool {
        self.gradient_correction || self.density_diffusion > 0.0 || self.stress_diffusion > 0.0
    }
}

/// Fields that live within a step; kept between steps for their memory only.
#[derive(Clone, Debug, Default)]
pub struct Buffers<const D: usize, const N: usize> {
    /// w sigma of all particles, or w sigma L with corrected gradients; in f64 or f32.
    pub weighted: (Vec<Stressed<Sym<N>, f64>>, Vec<Stressed<Sym<N, f32>, f32>>),
    pub corrected: (Vec<Stressed<Matrix<D>, f64>>, Vec<Stressed<Matrix<D, f32>, f32>>),
    /// L of all particles, with corrected gradients; the unit tensor behind walls.
    pub correction: Vec<Matrix<D>>,
    /// L among the material alone, of owned particles.
    material_correction: Vec<Matrix<D>>,
    /// Heat of viscosity, W/kg.
    pub heat: Vec<f64>,
    /// Rate of change of density by diffusion, kg/m3/s; empty without.
    pub density_rate: Vec<f64>,
    /// Rate of change of stress by diffusion, Pa/s; empty without.
    pub stress_rate: Vec<Sym<N>>,
    density: Vec<f64>,
    density_gradient: Vec<[f64; D]>,
    stress_gradient: Vec<[Sym<N>; D]>,
    opposing: Vec<Sym<N>>,
    surface: Vec<f64>,
    shift: Vec<Vector<D>>,
}

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// L of every particle where the scene asks for corrected gradients. Collective.
    pub fn refresh_correction(&mut self) {
        if !self.parameters.stabilisers.gradient_correction {
            return;
        }
        let mut tensors = std::mem::take(&mut self.buffers.correction);
        correction::<D, N, P::Kernel>(
            &self.particles,
            &self.neighbors,
            self.parameters.pairs,
            Among::All,
            &mut tensors,
        );
        self.spread(&mut tensors);
        // Behind walls the support is full of what the wall mirrors.
        tensors[self.particles.mirror..].fill(Matrix::unit());
        self.buffers.correction = tensors;
    }

    /// Rates of change of density and stress by diffusion. Collective.
    pub fn diffuse(&mut self) {
        let Stabilisers { density_diffusion, stress_diffusion, .. } = self.parameters.stabilisers;
        if density_diffusion == 0.0 && stress_diffusion == 0.0 {
            return;
        }
        let (pairs, mut buffers) = (self.parameters.pairs, std::mem::take(&mut self.buffers));
        let p = &self.particles;
        correction::<D, N, P::Kernel>(p, &self.neighbors, pairs, Among::Material, &mut buffers.material_correction);
        let l = &buffers.material_correction;
        if density_diffusion > 0.0 {
            let mut density = std::mem::take(&mut buffers.density);
            density.clone_from(&self.particles.density);
            self.spread(&mut density);
            let (p, slopes) = (&self.particles, &mut buffers.density_gradient);
            diffusion::gradient::<D, N, P::Kernel, _>(p, &self.neighbors, pairs, l, &density, slopes);
            self.spread(&mut buffers.density_gradient);
            let (p, slopes, rate) = (&self.particles, &buffers.density_gradient, &mut buffers.density_rate);
            diffusion::diffusion::<D, N, P::Kernel, _>(
                p,
                &self.neighbors,
                pairs,
                density_diffusion,
                &density,
                slopes,
                rate,
            );
            buffers.density = density;
        }
        if stress_diffusion > 0.0 {
            let (p, slopes) = (&self.particles, &mut buffers.stress_gradient);
            diffusion::gradient::<D, N, P::Kernel, _>(p, &self.neighbors, pairs, l, &p.stress, slopes);
            self.spread(&mut buffers.stress_gradient);
            let (p, slopes, rate) = (&self.particles, &buffers.stress_gradient, &mut buffers.stress_rate);
            diffusion::diffusion::<D, N, P::Kernel, _>(
                p,
                &self.neighbors,
                pairs,
                stress_diffusion,
                &p.stress,
                slopes,
                rate,
            );
        }
        self.buffers = buffers;
    }

    /// Viscosities of copies, images and walls, where the law has one between particles. Collective.
    pub fn fill_viscosity(&mut self) {
        if self.material.pair_viscosity().is_none() {
            return;
        }
        let mut viscosity = std::mem::take(&mut self.particles.viscosity);
        self.spread(&mut viscosity);
        extrapolate::<D, P::Kernel, _>(&self.neighbors, self.parameters.pairs, &mut viscosity);
        self.particles.viscosity = viscosity;
    }

    /// Adds what the law and the scene ask for to the accelerations and the heat of stress and artificial viscosity.
    pub fn accelerate_further(&mut self, acceleration: &mut [Vector<D>]) {
        let stabilisers = &self.parameters.stabilisers;
        if self.material.pair_viscosity().is_none() && stabilisers.impact == 0.0 && stabilisers.artificial_stress == 0.0
        {
            return;
        }
        // Volumes have changed with the densities.
        self.neighbors.refresh::<N, P::Kernel>(&self.particles, self.parameters.pairs);
        let before = self.watch.enter(Phase::Stabilisers);
        let (p, neighbors, pairs) = (&self.particles, &self.neighbors, self.parameters.pairs);
        let Stabilisers { artificial_stress: epsilon, impact, .. } = self.parameters.stabilisers;
        let Buffers { heat, opposing, .. } = &mut self.buffers;
        if let Some(mean) = self.material.pair_viscosity() {
            viscosity::between_particles::<D, N, P::Space, P::Kernel>(p, neighbors, pairs, mean, acceleration, heat);
        }
        if impact > 0.0 {
            viscosity::on_impact::<D, N, P::Space, P::Kernel>(p, neighbors, pairs, impact, acceleration, heat);
        }
        if epsilon > 0.0 {
            artificial_stress::opposing::<D, N, P::Space>(p, epsilon, pairs.spacing, opposing);
            artificial_stress::artificial_stress::<D, N, P::Space, P::Kernel>(
                p,
                neighbors,
                pairs,
                opposing,
                acceleration,
            );
        }
        self.watch.enter(before);
    }

    /// Shifts particles inside the body, where the scene asks for it. Last of a step: what follows sees them at their new
    /// places, whether or not the run is stopped and resumed in between. Collective.
    pub fn shift(&mut self, dt: f64) {
        let strength = self.parameters.stabilisers.shifting;
        if strength == 0.0 {
            return;
        }
        let (pairs, mut buffers) = (self.parameters.pairs, std::mem::take(&mut self.buffers));
        self.neighbors.refresh::<N, P::Kernel>(&self.particles, pairs);
        let Buffers { surface, shift, .. } = &mut buffers;
        shifting::surface::<D, N, P::Kernel>(&self.particles, &self.neighbors, pairs, surface);
        self.spread(surface);
        let how = shifting::Shifting { strength, dt, surface };
        shifting::shift::<D, N, P::Kernel>(&self.particles, &self.neighbors, pairs, how, shift);
        for (x, shift) in self.particles.x.iter_mut().zip(shift.iter()) {
            *x += self.periods.rounded(*shift);
        }
        self.neighbors.moved(shifting::LARGEST * pairs.spacing);
        self.buffers = buffers;
    }
}
