//! Rates of the particles, each a sum over pairs.
//!
//! One work-conjugate pair of operators serves all spaces. With the volume V, the metric w (1, or the radius r in the
//! axisymmetric space, where V is the area of the ring's section) and the gradient of the kernel at i:
//!
//! ```text
//! grad v_i = sum_j V_j (v_j - v_i) (x) L_i grad_i W_ij
//! a_i      = 1/(rho_i w_i) sum_j V_j [w_i sigma_i L_i + w_j sigma_j L_j + viscosity] . grad_i W_ij  (+ hoop term + g)
//! ```
//!
//! L is the unit tensor, or with `gradient-correction = "variational"` the [`correction`] that makes the gradient exact
//! for linear fields. The force between two particles of the material is antisymmetric in i and j, and its power is minus
//! the power of the stress on the velocity gradient, to rounding: sum m v.a = -sum w V sigma:D (test C10). Images across
//! the axis, which have signed radii, and wall particles by Shepard's interpolation are not exactly conjugate.

pub mod artificial_stress;
pub mod correction;
pub mod diffusion;
pub mod momentum;
pub mod shifting;
pub mod velocity_gradient;
pub mod viscosity;
pub mod wall;
