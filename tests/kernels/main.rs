//! Every kernel against its float64 twin, and the twins' gradients against finite differences.

mod domain;
mod follow;
mod held;
mod intake;
mod isa;
mod paper;
mod paper_gradient;
mod place;
mod surface;
mod surface_gather;
mod surface_gradient;
mod traffic;
mod vector;
mod vector_domain;
mod vector_forward;
mod vector_gradient;
mod vector_momentum;
mod vector_start;
mod wide;
