//! Forces of the material on obstacles.

use crate::exact::{self, Sum};
use crate::parallel::comm::Reduce;
use crate::physics::Physics;
use crate::simulation::Simulation;
use crate::space::Space;
use formats::scene::Scene;

/// Names and units of their columns in the history, after those of [`crate::report::columns`].
pub fn columns(scene: &Scene) -> Vec<String> {
    let names = plain(scene.obstacles.iter().map(|obstacle| obstacle.name.as_str()));
    names.iter().flat_map(|name| ["x", "y", "z"].map(|axis| format!("force_{name}_{axis} [N]"))).collect()
}

/// Names with letters that every reader of tables takes; those that have others, or would be the same, go by their number, from 1.
fn plain<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let names: Vec<String> = names.map(|name| name.replace('-', "_")).collect();
    let fits = |name: &String| {
        name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && names.iter().filter(|n| *n == name).count() == 1
    };
    names.iter().enumerate().map(|(n, name)| if fits(name) { name.clone() } else { (n + 1).to_string() }).collect()
}

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// Force on each obstacle, N: what its wall particles do to the material, summed pair by pair and turned around. All that
    /// acts between particles counts, for every sum over neighbours weighs them with their volume: here only those
    /// of one obstacle have any. What puts lone particles back onto the surface does not. Collective.
    pub fn obstacle_forces(&mut self) -> Vec<[f64; 3]> {
        let count = self.walls.obstacles();
        if count == 0 {
            return Vec::new();
        }
        let mut largest = [self.particles.mass[..self.particles.owned].iter().copied().fold(0.0, f64::max)];
        self.comm.max(&mut largest);
        let parameters = self.parameters;
        let mass = largest[0] * parameters.count as f64;
        let bound = mass * parameters.sound_speed * parameters.sound_speed / parameters.spacing;
        let mut sums = vec![Sum::new(bound); 3 * count];
        self.refresh_correction();
        let of: Vec<Option<usize>> = self.walls.of_obstacles().collect();
        let (volumes, acceleration) = (self.particles.volume.clone(), self.particles.a.clone());
        for n in (0..count).filter(|n| of.contains(&Some(*n))) {
            let p = &mut self.particles;
            p.volume.fill(0.0);
            for (j, _) in of.iter().enumerate().filter(|(_, of)| **of == Some(n)) {
                p.volume[p.mirror + j] = volumes[p.mirror + j];
            }
            self.neighbors.refresh::<N, P::Kernel>(&self.particles, parameters.pairs);
            let (all, owned) = (self.particles.len(), self.particles.owned);
            self.push(0..all, 0..owned);
            let mut a = std::mem::take(&mut self.particles.a);
            self.accelerate_further(&mut a);
            for (a, mass) in a.iter().zip(&self.particles.mass) {
                let force = P::Space::to_disk(*a * -mass);
                (0..3).for_each(|axis| sums[3 * n + axis].add(force[axis]));
            }
            self.particles.a = a;
        }
        (self.particles.volume, self.particles.a) = (volumes, acceleration);
        self.neighbors.refresh::<N, P::Kernel>(&self.particles, parameters.pairs);
        exact::reduce(self.comm, &mut sums);
        sums.chunks_exact(3).map(|force| [0, 1, 2].map(|axis| force[axis].value())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn every_obstacle_has_columns_of_its_own() {
        let names = |names: &[&str]| plain(names.iter().copied());
        assert_eq!(names(&["wall", "house-1", "höhle"]), ["wall", "house_1", "3"]);
        assert_eq!(names(&["a-b", "a_b", "c"]), ["1", "2", "c"]);
    }
}
