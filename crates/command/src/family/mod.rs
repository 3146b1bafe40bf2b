//! A family of random hidden scenes and of ways to measure them: every seed is one capture with truth. Nobody chose them, so
//! they cannot be tuned to.

mod case;
mod dice;
mod losses;
mod measured;
mod things;

pub use case::{FamilyCase, TRAINING, kind};
pub use losses::Losses;
