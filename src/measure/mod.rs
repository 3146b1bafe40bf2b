//! How good a reconstruction is, against true maps.

pub mod metrics;

pub use metrics::{Metrics, metrics};
