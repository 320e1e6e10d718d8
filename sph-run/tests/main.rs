//! Tests of the solver, in one binary: the steps of all laws, kernels and spaces are compiled once.

mod balance;
mod boundaries;
mod density_gate;
mod dynamics;
mod halo;
mod lanes;
mod lists;
mod material;
mod momentum;
mod mu_i;
mod operators;
mod orb;
mod phases;
mod plan;
mod resolution;
mod stabilisers;
mod stepping;
mod support;
mod visco_plastic;

#[global_allocator]
static ALLOCATOR: support::memory::Counting = support::memory::Counting;
