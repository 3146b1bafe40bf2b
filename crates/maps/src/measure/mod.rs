//! Metrics of reconstructions against truth.

mod albedo;
pub mod coverage;
mod median;
pub mod metrics;
mod missing;
pub mod paper;

pub use coverage::ErrorCoverage;
pub use median::median;
pub use metrics::{AtBest, LayerMetrics, Metrics, metrics};
pub use paper::PaperMeasure;
