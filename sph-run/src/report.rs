//! The lines of the history: totals over all ranks, the same bits on any number of them.

use crate::exact::{self, Sum};
use crate::parallel::comm::Reduce;
use crate::physics::Physics;
use crate::simulation::Simulation;
use crate::space::Space;
use formats::scene::{Material, Scene};

/// Names and units of the columns, as in the first line of the file. Energies are per metre of depth in plane strain.
pub fn columns(space: formats::space::Space) -> [&'static str; 16] {
    let [kinetic, potential, elastic, stress_work, viscous_work] = match space {
        formats::space::Space::PlaneStrain => [
            "kinetic_energy [J/m]",
            "potential_energy [J/m]",
            "elastic_energy [J/m]",
            "stress_work [J/m]",
            "viscous_work [J/m]",
        ],
        _ => {
            ["kinetic_energy [J]", "potential_energy [J]", "elastic_energy [J]", "stress_work [J]", "viscous_work [J]"]
        }
    };
    [
        "time [s]",
        "step [1]",
        "time_step [s]",
        kinetic,
        potential,
        elastic,
        stress_work,
        viscous_work,
        "max_speed [m/s]",
        "front [m]",
        "front_mass_99_5 [m]",
        "height [m]",
        "volume_ratio [1]",
        "min_density [kg/m3]",
        "max_density [kg/m3]",
        "below_floor [1]",
    ]
}

/// One line of the history.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    pub kinetic: f64,
    pub potential: f64,
    pub elastic: f64,
    /// Work the stress has done on the material: stored or turned into heat.
    pub stress_work: f64,
    /// Heat of the viscosity between particles.
    pub viscous_work: f64,
    pub max_speed: f64,
    /// Farthest particle from the axis ([`Scene::is_radial`]), or from x = 0 along +x, plus half a spacing, m.
    pub front: f64,
    /// Distance within which 99.5 % of the mass lies, m.
    pub front_mass: f64,
    /// Top of the highest particle above the floor ([`Scene::floor`]), m.
    pub height: f64,
    /// Volume over that of the same mass at the initial density.
    pub volume_ratio: f64,
    pub min_density: f64,
    pub max_density: f64,
    /// Particles behind a wall.
    pub below_floor: u64,
}

/// What the totals need of the scene.
#[derive(Clone, Debug)]
pub struct Scales {
    material: Material,
    radial: bool,
    floor: f64,
    density: f64,
}

/// Share of the mass inside `front_mass`.
const MASS_SHARE: f64 = 0.995;

impl Scales {
    /// From the scene.
    pub fn new(scene: &Scene) -> Self {
        Self {
            material: scene.material.clone(),
            radial: scene.is_radial(),
            floor: scene.floor(),
            density: scene.material.density(),
        }
    }
}

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// Totals of the present state. Collective.
    pub fn totals(&self, scales: &Scales) -> Line {
        let (p, par) = (&self.particles, &self.parameters);
        let place = |i: usize| P::Space::to_disk(self.periods.wrapped(p.x[i]));
        let distance = |x: [f64; 3]| if scales.radial { (x[0] * x[0] + x[1] * x[1]).sqrt() } else { x[0] };

        let mut extremes = [f64::NEG_INFINITY; 6];
        for i in 0..p.owned {
            let x = place(i);
            let found = [p.v[i].norm2(), distance(x), x[2], p.density[i], -p.density[i], p.mass[i]];
            for (extreme, found) in extremes.iter_mut().zip(found) {
                *extreme = extreme.max(found);
            }
        }
        self.comm.max(&mut extremes);
        let [speed2, farthest, top, max_density, min_density, max_mass] = extremes;

        let mass_bound = max_mass * par.count as f64;
        let energy_bound = mass_bound * par.sound_speed * par.sound_speed;
        let volume_bound = mass_bound / scales.density;
        let e = energy_bound;
        let mut sums = [e, e, e, e, e, volume_bound, mass_bound].map(Sum::new);
        let mut below = [0u64];
        for i in 0..p.owned {
            let volume = p.mass[i] / p.density[i];
            sums[0].add(0.5 * p.mass[i] * p.v[i].norm2());
            sums[1].add(-p.mass[i] * self.gravity.dot(self.periods.wrapped(p.x[i])));
            let stress = P::Space::stress_to_disk(p.stress[i]);
            sums[2].add(p.mass[i] * scales.material.stored_energy(stress, p.density[i]));
            sums[3].add(p.mass[i] * p.work[i].stress);
            sums[4].add(p.mass[i] * p.work[i].viscous);
            sums[5].add(volume);
            sums[6].add(p.mass[i]);
            below[0] += u64::from(self.walls.distance::<D, N, P::Space>(p.x[i]) < 0.0);
        }
        exact::reduce(self.comm, &mut sums);
        self.comm.sum(&mut below);
        let [kinetic, potential, elastic, stress_work, viscous_work, volume, mass] = sums.map(|s| s.value());

        let masses = (0..p.owned).map(|i| (distance(place(i)), p.mass[i]));
        Line {
            kinetic,
            potential,
            elastic,
            stress_work,
            viscous_work,
            max_speed: speed2.sqrt(),
            front: farthest + 0.5 * par.spacing,
            front_mass: self.quantile(masses, farthest, mass),
            height: top + 0.5 * par.spacing - scales.floor,
            volume_ratio: volume * scales.density / mass,
            min_density: -min_density,
            max_density,
            below_floor: below[0],
        }
    }

    /// Distance within which [`MASS_SHARE`] of the mass lies, from a histogram in whole numbers.
    fn quantile(&self, masses: impl Iterator<Item = (f64, f64)>, farthest: f64, total: f64) -> f64 {
        const BINS: usize = 8192;
        const WHOLE: f64 = (1u64 << 52) as f64;
        let width = (self.parameters.spacing / 8.0).max(farthest / (BINS - 1) as f64);
        let mut bins = vec![0u64; BINS];
        for (distance, mass) in masses {
            bins[((distance / width).max(0.0) as usize).min(BINS - 1)] += (mass / total * WHOLE) as u64;
        }
        self.comm.sum(&mut bins);
        let wanted = MASS_SHARE * bins.iter().sum::<u64>() as f64;
        // Between the bins that hold something, the share of mass inside grows linearly: in a sparse toe a bin is one
        // particle, and `sph-post` interpolates between particles in the same way.
        let (mut inside, mut before) = (0u64, (0.0, 0.0));
        for (k, &bin) in bins.iter().enumerate().filter(|(_, bin)| **bin > 0) {
            inside += bin;
            let here = ((k as f64 + 0.5) * width, inside as f64);
            if here.1 >= wanted {
                let part = (wanted - before.1) / (here.1 - before.1);
                return before.0 + part * (here.0 - before.0);
            }
            before = here;
        }
        farthest
    }
}

impl Line {
    /// The line as it stands in the file, with the forces on obstacles.
    pub fn csv(&self, clock: &crate::simulation::Clock, forces: &[[f64; 3]]) -> String {
        let e = |value: f64| format!("{value:e}");
        let cells = [
            e(clock.time),
            clock.step.to_string(),
            e(clock.time_step),
            e(self.kinetic),
            e(self.potential),
            e(self.elastic),
            e(self.stress_work),
            e(self.viscous_work),
            e(self.max_speed),
            e(self.front),
            e(self.front_mass),
            e(self.height),
            e(self.volume_ratio),
            e(self.min_density),
            e(self.max_density),
            self.below_floor.to_string(),
        ];
        let forces: String = forces.iter().flatten().map(|force| format!(",{force:e}")).collect();
        cells.join(",") + &forces + "\n"
    }
}
