//! How sound a run is: numbers that tell of clumping, noise, drift, penetration and voids.
//!
//! They measure what is known to go wrong in SPH: tensile and pairing instability (Swegle et al. 1995; Dehnen & Aly 2012),
//! noise of stress without resistance (Nguyen et al. 2017), places and densities that part company (Antuono et al. 2010). What asks
//! for neighbours is taken from the last snapshot only. Images at planes of symmetry complete sums; walls and the copies of a
//! period do not, so sums are looked at inside, see [`INSIDE`].

use crate::{field::pressure, geometry::Geometry, sample::Sampler};
use formats::{scene::Scene, snapshot::Rows, space::Space};

/// Two particles nearer than this part of a spacing are a pair: between the 1 of a lattice (0.95 body-centred) and the 0 of
/// a clump; what relaxation leaves at least.
const CLOSE: f64 = 0.7;

/// Particles nearer than this many spacings belong to one piece: more than the diagonal of a square of the lattice.
const LINKED: f64 = 1.5;

/// Inside is where the centre of what the kernel sees is no further away than this part of h. On a plane surface it is 0.2
/// to 0.3, in a lattice 0.
const INSIDE: f64 = 0.1;

/// Below this part of its density at the start the material is loose.
const LOOSE: f64 = 0.9;

/// Sectors around the axis in which fronts are compared.
const SECTORS: usize = 16;

/// Share of the mass of a sector that lies within its front.
const WITHIN: f64 = 0.95;

/// The numbers; those that have no meaning for the scene are NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct Health {
    /// Smallest distance to a nearest neighbour, in spacings.
    pub nearest: f64,
    /// Share of the particles with a neighbour nearer than 0.7 spacings.
    pub close: f64,
    /// Number of pieces that hang together by distances below 1.5 spacings, single particles included.
    pub pieces: usize,
    /// Mean of Σ V W inside: 1 where density and places agree.
    pub sum_mean: f64,
    /// Standard deviation of Σ V W inside, over its mean.
    pub sum_scatter: f64,
    /// N = ‖σ - S\[σ]‖/‖σ‖ over the volume, with S the moving least squares, which let a linear profile be up to walls and
    /// surfaces: stress that changes from particle to particle.
    pub noise: f64,
    /// The same of what is static.
    pub noise_static: f64,
    /// Share of the particles with negative pressure.
    pub tension: f64,
    /// Largest |ρ - Σ m W/Σ V W|/ρ0: density that changes from particle to particle.
    pub density_noise: f64,
    /// Share of the mass below 0.9 ρ0.
    pub loose: f64,
    /// Root mean square of the speed at the end, m/s.
    pub speed: f64,
    /// Root mean square of the displacement from the first snapshot, in spacings.
    pub displacement: f64,
    /// |L - L0|/|L0|, angular momentum about the centre of mass: where there are no walls, images or periods.
    pub turned: f64,
    /// (largest - smallest)/mean of the radii within which 95 % of the mass of each of 16 sectors lies: whole columns in 3-D.
    pub uneven: f64,
    /// Deepest place behind a wall or below the ground at any snapshot, in spacings.
    pub deepest: f64,
    /// Largest share of the axis inside the material that is empty, at any snapshot: 1 - mean of Σ V W there.
    pub void: f64,
    /// Smallest and largest density at any snapshot, over ρ0.
    pub densities: [f64; 2],
    /// Largest pressure at any snapshot, Pa.
    pub pressure: f64,
}

/// The first snapshot, which the last one is held against.
#[derive(Clone, Debug)]
pub struct Start {
    id: Vec<u64>,
    position: Vec<[f64; 3]>,
    angular: [f64; 3],
}

impl Start {
    /// Of these particles.
    pub fn of(rows: &Rows) -> Self {
        Self { id: rows.id.clone(), position: rows.position.clone(), angular: angular_momentum(rows) }
    }
}

impl Default for Health {
    fn default() -> Self {
        let none = f64::NAN;
        Self {
            nearest: none,
            close: none,
            pieces: 0,
            sum_mean: none,
            sum_scatter: none,
            noise: none,
            noise_static: none,
            tension: none,
            density_noise: none,
            loose: none,
            speed: none,
            displacement: none,
            turned: none,
            uneven: none,
            deepest: none,
            void: none,
            densities: [none; 2],
            pressure: none,
        }
    }
}

impl Health {
    /// Under their names in `summary.json`.
    pub fn numbers(&self) -> impl Iterator<Item = (&'static str, f64)> {
        [
            ("nearest_distance_dx", self.nearest),
            ("close_share", self.close),
            ("pieces", self.pieces as f64),
            ("kernel_sum_mean", self.sum_mean),
            ("kernel_sum_scatter", self.sum_scatter),
            ("stress_noise", self.noise),
            ("stress_noise_static", self.noise_static),
            ("tension_share", self.tension),
            ("density_noise", self.density_noise),
            ("density_lowest", self.densities[0]),
            ("density_highest", self.densities[1]),
            ("loose_share", self.loose),
            ("pressure_peak_Pa", self.pressure),
            ("final_speed_rms_m_s", self.speed),
            ("displacement_rms_dx", self.displacement),
            ("angular_momentum_change", self.turned),
            ("front_uneven_round", self.uneven),
            ("deepest_behind_wall_dx", self.deepest),
            ("axis_void", self.void),
        ]
        .into_iter()
        // No -0.
        .map(|(name, value)| (name, value + 0.0))
    }
}

impl Health {
    /// The numbers that are watched at every snapshot; heights are those above the ground on a terrain.
    pub fn at(scene: &Scene, g: &Geometry, rows: &Rows, sampler: &Sampler) -> Self {
        let over = |bound: fn(f64, f64) -> f64| rows.density.iter().map(|d| d / g.density).fold(f64::NAN, bound);
        Self {
            deepest: deepest(scene, g, rows),
            void: void(g, rows, sampler),
            densities: [over(f64::min), over(f64::max)],
            pressure: rows.stress.iter().map(|&s| pressure(s)).fold(f64::NAN, f64::max),
            ..Self::default()
        }
    }

    /// With those of the last snapshot besides.
    pub fn at_end(
        scene: &Scene,
        g: &Geometry,
        rows: &Rows,
        sampler: &Sampler,
        static_speed: f64,
        start: &Start,
    ) -> Self {
        let mut health = Self::at(scene, g, rows, sampler);
        health.displacement = displacement(scene, g, rows, start);
        health.turned = turned(scene, g, rows, start.angular);
        health.uneven = uneven(scene, g, rows);
        let (count, mass) = (rows.len() as f64, rows.mass.iter().sum::<f64>());
        let is_loose = |row: &usize| rows.density[*row] < LOOSE * g.density;
        health.loose = (0..rows.len()).filter(is_loose).map(|row| rows.mass[row]).sum::<f64>() / mass;
        let largest = rows.stress.iter().map(|&s| pressure(s).abs()).fold(0.0, f64::max);
        // Rounding is no tension.
        let pulls = |s: &&[f64; 6]| pressure(**s) < -1e-9 * largest;
        health.tension = rows.stress.iter().filter(pulls).count() as f64 / count;
        health.speed = (0..rows.len()).map(|row| rows.mass[row] * square(rows.velocity[row])).sum::<f64>() / mass;
        health.speed = health.speed.sqrt();
        neighbourhood(&mut health, g, rows, sampler);
        noise(&mut health, rows, sampler, static_speed);
        health
    }

    /// Of a run whose next snapshot has shown this: the extremes of both, all else of the later one. NaN, "not known", gives way to
    /// any number.
    #[must_use]
    pub fn and_then(self, later: Self) -> Self {
        Self {
            deepest: self.deepest.max(later.deepest),
            void: self.void.max(later.void),
            densities: [self.densities[0].min(later.densities[0]), self.densities[1].max(later.densities[1])],
            pressure: self.pressure.max(later.pressure),
            ..later
        }
    }
}

fn square(v: [f64; 3]) -> f64 {
    v.iter().map(|v| v * v).sum()
}

fn deepest(scene: &Scene, g: &Geometry, rows: &Rows) -> f64 {
    let behind = |x: &[f64; 3]| {
        let walls = scene.walls.iter().map(|wall| {
            let at =
                if g.radial && g.space == Space::Axisymmetric && wall.axis == 0 { x[0].abs() } else { x[wall.axis] };
            wall.side * (wall.at - at)
        });
        walls.chain(scene.terrain.is_some().then_some(-x[2])).fold(0.0, f64::max)
    };
    rows.position.iter().map(behind).fold(0.0, f64::max) / g.dx
}

/// Along the axis, from 2h above the lowest particle within 4h of it to 2h below the highest one.
fn void(g: &Geometry, rows: &Rows, sampler: &Sampler) -> f64 {
    if !g.radial || rows.is_empty() {
        return f64::NAN;
    }
    let heights = || rows.position.iter().filter(|x| g.along(**x) < 4.0 * g.h).map(|x| x[2]);
    let low = heights().fold(f64::INFINITY, f64::min) + 2.0 * g.h;
    let high = heights().fold(f64::NEG_INFINITY, f64::max) - 2.0 * g.h;
    let count = ((high - low) / g.dx).floor();
    // Nothing there, or nothing between.
    if count.is_nan() || count < 0.0 {
        return f64::NAN;
    }
    let points = 0..=count as usize;
    let filled: f64 = points.clone().map(|k| sampler.fraction([0.0, 0.0, low + k as f64 * g.dx])).sum();
    1.0 - filled / points.count() as f64
}

fn displacement(scene: &Scene, g: &Geometry, rows: &Rows, start: &Start) -> f64 {
    if rows.id != start.id {
        return f64::NAN;
    }
    let moved = |(now, then): (&[f64; 3], &[f64; 3])| {
        square([0, 1, 2].map(|a| match scene.periodic[a] {
            Some([from, to]) => {
                let (way, period) = (now[a] - then[a], to - from);
                way - period * (way / period).round()
            }
            None => now[a] - then[a],
        }))
    };
    let sum: f64 = rows.position.iter().zip(&start.position).map(moved).sum();
    (sum / rows.len() as f64).sqrt() / g.dx
}

fn angular_momentum(rows: &Rows) -> [f64; 3] {
    let mass: f64 = rows.mass.iter().sum();
    let mean = |of: &[[f64; 3]], a: usize| of.iter().zip(&rows.mass).map(|(of, m)| m * of[a]).sum::<f64>() / mass;
    let [x0, v0] = [&rows.position, &rows.velocity].map(|of| [0, 1, 2].map(|a| mean(of, a)));
    (0..rows.len()).fold([0.0; 3], |sum, row| {
        let [x, v] =
            [(rows.position[row], x0), (rows.velocity[row], v0)].map(|(f, f0)| [0, 1, 2].map(|a| f[a] - f0[a]));
        let m = rows.mass[row];
        [0, 1, 2].map(|a| {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            sum[a] + m * (x[b] * v[c] - x[c] * v[b])
        })
    })
}

fn turned(scene: &Scene, g: &Geometry, rows: &Rows, start: [f64; 3]) -> f64 {
    let held = !scene.walls.is_empty() || scene.terrain.is_some() || scene.periodic.iter().any(Option::is_some);
    // Something to lose: a thousandth of what the extent and the speeds of now would allow.
    let speed = rows.velocity.iter().map(|&v| square(v)).sum::<f64>().sqrt() / (rows.len() as f64).sqrt();
    let reach = g.dx * (rows.len() as f64).powf(1.0 / g.space.dimension() as f64);
    let least = 1e-3 * rows.mass.iter().sum::<f64>() * reach * speed;
    if held || g.mirrored != [false; 2] || square(start).sqrt() <= least {
        return f64::NAN;
    }
    let now = angular_momentum(rows);
    (square([0, 1, 2].map(|a| now[a] - start[a])) / square(start)).sqrt()
}

fn uneven(scene: &Scene, g: &Geometry, rows: &Rows) -> f64 {
    if g.space != Space::ThreeD || !g.radial || scene.symmetry != [false; 2] {
        return f64::NAN;
    }
    let mut sectors = vec![Vec::new(); SECTORS];
    for x in &rows.position {
        let turn = x[1].atan2(x[0]) / std::f64::consts::TAU + 0.5;
        sectors[((turn * SECTORS as f64) as usize).min(SECTORS - 1)].push(x[0].hypot(x[1]));
    }
    if sectors.iter().any(Vec::is_empty) {
        return f64::NAN;
    }
    // All particles of a body have the same mass.
    let fronts: Vec<f64> = sectors
        .iter_mut()
        .map(|radii| {
            radii.sort_by(f64::total_cmp);
            radii[(WITHIN * (radii.len() - 1) as f64).round() as usize]
        })
        .collect();
    let (low, high) = fronts.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), r| (low.min(*r), high.max(*r)));
    (high - low) / (fronts.iter().sum::<f64>() / SECTORS as f64)
}

/// Distances, pieces, and sums of the kernel.
fn neighbourhood(health: &mut Health, g: &Geometry, rows: &Rows, sampler: &Sampler) {
    let mut pieces = Pieces((0..rows.len()).collect());
    let (mut nearest, mut close, mut noise) = (f64::INFINITY, 0, 0.0_f64);
    let mut inside = Vec::new();
    for row in 0..rows.len() {
        let (mut own, mut volume, mut mass, mut centre) = (f64::INFINITY, 0.0, 0.0, [0.0; 3]);
        sampler.neighbours(rows.position[row], |other| {
            volume += other.weight;
            mass += other.weight * rows.density[other.row];
            (0..3).for_each(|a| centre[a] += other.weight * other.offset[a]);
            if other.row != row && !other.is_image {
                own = own.min(other.distance);
                if other.distance < LINKED * g.dx {
                    pieces.join(row, other.row);
                }
            }
        });
        nearest = nearest.min(own);
        close += usize::from(own < CLOSE * g.dx);
        noise = noise.max((rows.density[row] - mass / volume).abs());
        if square(centre).sqrt() < INSIDE * g.h * volume {
            inside.push(volume);
        }
    }
    let count = inside.len() as f64;
    let mean = inside.iter().sum::<f64>() / count;
    let variance = inside.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / count;
    // A lone particle has none within 2h.
    health.nearest = if nearest.is_finite() { nearest / g.dx } else { f64::NAN };
    health.close = close as f64 / rows.len() as f64;
    health.pieces = pieces.count();
    health.sum_mean = mean;
    health.sum_scatter = variance.sqrt() / mean;
    health.density_noise = noise / g.density;
}

/// Sets that grow together.
struct Pieces(Vec<usize>);

impl Pieces {
    fn of(&mut self, mut k: usize) -> usize {
        while self.0[k] != k {
            self.0[k] = self.0[self.0[k]];
            k = self.0[k];
        }
        k
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a.max(b)] = a.min(b);
    }

    fn count(&self) -> usize {
        (0..self.0.len()).filter(|&k| self.0[k] == k).count()
    }
}

fn noise(health: &mut Health, rows: &Rows, sampler: &Sampler, static_speed: f64) {
    let norm =
        |s: [f64; 6]| s[..3].iter().map(|s| s * s).sum::<f64>() + 2.0 * s[3..].iter().map(|s| s * s).sum::<f64>();
    // Rough part and whole, of all and of what is static.
    let mut sums = [[0.0; 2]; 2];
    for row in 0..rows.len() {
        // Too few neighbours to tell what is rough.
        let Some(stencil) = sampler.stencil(rows.position[row]) else { continue };
        let (smooth, s) = (stencil.symmetric(&rows.stress), rows.stress[row]);
        let volume = rows.mass[row] / rows.density[row];
        let parts = [norm([0, 1, 2, 3, 4, 5].map(|c| s[c] - smooth[c])), norm(s)];
        let is_static = square(rows.velocity[row]) < static_speed * static_speed;
        for (of, sum) in sums.iter_mut().enumerate() {
            if of == 0 || is_static {
                (0..2).for_each(|k| sum[k] += volume * parts[k]);
            }
        }
    }
    [health.noise, health.noise_static] = sums.map(|[rough, all]| (rough / all).sqrt());
}

#[cfg(test)]
mod tests;
