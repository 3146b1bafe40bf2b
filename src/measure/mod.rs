//! How good a reconstruction is, against true maps, and how soon.

pub mod metrics;
pub mod reach;

pub use metrics::{AtBest, Metrics, metrics};
pub use reach::{Reach, median, reach};
