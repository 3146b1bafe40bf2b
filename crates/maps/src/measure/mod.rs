//! Metrics of reconstructions against truth, and times at which methods reach a target.

pub mod calibration;
pub mod metrics;
pub mod paper;
pub mod reach;

pub use calibration::Calibration;
pub use metrics::{AtBest, LayerMetrics, Metrics, metrics};
pub use paper::PaperMeasure;
pub use reach::{Reach, median, reach};
