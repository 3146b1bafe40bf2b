//! The benchmark, by the built command: `make build` first.

mod builds;
mod cases;
mod foreign;
mod methods;
