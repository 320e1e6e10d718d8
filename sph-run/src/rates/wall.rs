//! Extrapolation of the material's state to wall particles (Yang et al. 2020, Eqs 27-32).

use crate::neighbors::Neighbors;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::{Pairs, Scales, values};

/// Shepard weights V_j W_wj / sum V_k W_wk of the material around every wall particle, in the order of its list.
/// All zero where no material is in reach.
pub fn weights<const D: usize, const N: usize, K: Kernel>(
    particles: &Particles<D, N>,
    neighbors: &Neighbors,
    pairs: Pairs,
    weights: &mut Vec<f64>,
) {
    let scales = Scales::new::<D, K>(pairs.h);
    weights.clear();
    for wall in 0..neighbors.of_wall.len() {
        let first = weights.len();
        let mut sum = 0.0;
        values::<D, N, K>(particles, neighbors.of_wall.of(wall), scales, particles.mirror + wall, |j, value| {
            let weight = particles.volume[j] * value;
            sum += weight;
            weights.push(weight);
        });
        if sum > 0.0 {
            for weight in &mut weights[first..] {
                *weight /= sum;
            }
        }
    }
}

/// Sum over the material around wall particle `wall` of weight times `field`.
pub fn extrapolate<T: Copy + Default + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>>(
    neighbors: &Neighbors,
    weights: &[f64],
    wall: usize,
    field: &[T],
) -> T {
    let first = neighbors.of_wall.start(wall);
    let list = neighbors.of_wall.of(wall).iter().zip(&weights[first..]);
    list.fold(T::default(), |sum, (&j, &weight)| sum + field[j as usize] * weight)
}
