//! Metrics of reconstructions against truth.

pub mod calibration;
mod median;
pub mod metrics;
pub mod paper;

pub use calibration::ErrorCalibration;
pub use median::median;
pub use metrics::{AtBest, LayerMetrics, Metrics, metrics};
pub use paper::PaperMeasure;
