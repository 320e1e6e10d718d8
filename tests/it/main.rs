//! Tests of the programs as users run them, in one binary.

mod about;
mod bad_input;
mod bench;
mod obstacles;
mod pages;
mod same_bits;
mod terrain;
mod tidy;
mod tools;
