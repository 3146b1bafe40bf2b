//! `report.json`: everything that a run did.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::capture::Summary;
use crate::error::{Error, Result};
use crate::files::atomic;
use crate::measure::Metrics;

/// The whole report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of thirdbounce.
    pub version: String,
    /// The device that did the work.
    pub device: Device,
    /// All settings as they were resolved.
    pub settings: serde_json::Value,
    /// What looks wrong with the capture or the result, as sentences.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// The capture.
    pub capture: Summary,
    /// The plan of the run.
    pub plan: Plan,
    /// The trace of the run.
    pub trace: Vec<TraceEntry>,
    /// Sums over the run.
    pub totals: Totals,
    /// Figures against truth; null without truth.
    pub metrics: Option<Metrics>,
}

/// The device that did the work.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Device {
    /// Name of the device as its driver gives it.
    pub name: String,
    /// Name and version of the driver.
    pub driver: String,
    /// "discrete", "integrated", "cpu", ...
    pub kind: String,
}

/// The plan, made before solving.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Kernel variants chosen.
    pub variants: Vec<String>,
    /// What this scene does not need, and what leaving it out saved.
    pub left_out: Vec<String>,
    /// In how many parts the pairs of each level of the volume, then of the surface, were taken.
    #[serde(default)]
    pub parts: [Vec<usize>; 2],
    /// Bytes of histograms on the host that the device read part by part.
    #[serde(default)]
    pub stored_bytes: u64,
    /// Bytes of each buffer by name.
    pub buffers: BTreeMap<String, u64>,
    /// The domain was larger than its room at some time, so its dimmest voxels were left out.
    pub full: bool,
}

/// One line of the trace.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TraceEntry {
    /// Iterations done.
    pub iteration: usize,
    /// Wall-clock seconds since solving began.
    pub seconds: f64,
    /// Seconds that the device was busy; null if it has no clock or was not timed.
    pub gpu_seconds: Option<f64>,
    /// Lateral resolution of the grid.
    pub lateral: usize,
    /// Laser-sensor pairs that the iteration used; the losses are means over their bins.
    #[serde(default)]
    pub pairs: usize,
    /// Active voxels.
    pub active: usize,
    /// Active voxels as a share of the whole grid.
    pub active_ratio: f64,
    /// The loss; written as null if it is not finite.
    #[serde(deserialize_with = "null_is_nan")]
    pub loss: f64,
    /// Mean squared difference over the bins, without any solver's weights or regularisation.
    #[serde(default)]
    pub data_loss: Option<f64>,
    /// ‖Av − h‖ / ‖h‖: the square root of `data_loss` over that of an empty volume. h is the measurement as the solver
    /// uses it, without the background if the solver subtracts one. Null if nothing was measured.
    #[serde(default)]
    pub residual: Option<f64>,
    /// Figures against truth, as fields beside the others; left out without truth.
    #[serde(flatten)]
    pub metrics: Option<Metrics>,
}

/// Sums over the whole run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Seconds of reading the capture.
    pub load_s: f64,
    /// Seconds of solving.
    pub solve_s: f64,
    /// Seconds of writing results.
    pub export_s: f64,
    /// Seconds until the preview of the back-projection, which are part of no other; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preview_s: Option<f64>,
    /// Voxel-pair evaluations.
    pub pairs: f64,
    /// Voxel-pair evaluations per second of solving.
    pub pairs_per_s: f64,
    /// Most bytes of device memory in use at once.
    pub peak_device_bytes: u64,
}

fn null_is_nan<'de, D: serde::Deserializer<'de>>(from: D) -> std::result::Result<f64, D::Error> {
    Option::<f64>::deserialize(from).map(|loss| loss.unwrap_or(f64::NAN))
}

/// Writes the report as indented JSON.
///
/// # Errors
/// `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, report: &Report) -> Result<()> {
    let mut json = serde_json::to_string_pretty(report).map_err(|e| {
        Error::output(format!("{}: cannot be packed as JSON: {e}", path.display()), "report this as a bug")
    })?;
    json.push('\n');
    atomic::write(path, json.as_bytes())
}

/// Reads a report.
///
/// # Errors
/// `Kind::Input` if the file cannot be read or is no report.
pub fn read(path: &Path) -> Result<Report> {
    let json = std::fs::read_to_string(path)
        .map_err(|e| Error::input(format!("{}: cannot be read: {e}", path.display()), "check the path"))?;
    serde_json::from_str(&json).map_err(|e| {
        Error::input(
            format!("{}: is no report: {e}", path.display()),
            "give a report.json that reconstruct wrote",
        )
    })
}
