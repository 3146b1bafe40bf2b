//! Options that all closed-form methods have.

use crate::solve::option::options;
use crate::transport::Reflectance;

options! {
    /// Options of every closed-form method.
    pub struct ImageOptions(suit) {
        nested {}
        "Solver" {
            /// How surfaces reflect
            reflectance: Reflectance = suit.reflectance, Range::Internal;
        }
        "Domain" {
            /// Nothing nearer than this is reconstructed, metres
            min_depth: f64 = 0.2 * suit.unit, Range::NotNegative;
        }
        "Vector solver" {
            /// Subtract the background, estimated from the bins after the signal
            background: bool = true, Range::Flag;
        }
    }
}
