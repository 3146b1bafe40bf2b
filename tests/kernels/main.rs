//! Every kernel against its float64 twin, and the twins' gradients against finite differences.

mod backproject;
mod domain;
mod forward;
mod held;
mod isa;
mod paper;
mod paper_gradient;
mod place;
mod surface;
mod surface_gather;
mod surface_gradient;
mod wide;
