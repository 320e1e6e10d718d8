//! No work is ever lost: whatever happens to a run, the same command goes on, and ends with the same bits.

mod auto;
mod batch;
mod exchange;
mod faults;
mod generations;
mod golden;
mod limits;
mod outputs;
mod scene;
