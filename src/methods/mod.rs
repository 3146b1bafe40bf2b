//! The methods of this version by their names, and the solver of the paper.

pub mod paper;
mod table;

pub use paper::{Decay, NoiseTerm, PaperOptions, PaperSettings};
pub use table::{Method, SolverOptions, method, pass_of};
