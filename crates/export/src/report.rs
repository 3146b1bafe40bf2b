//! `report.json`: complete record of a run.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::capture::Summary;
use crate::error::{Error, Result};
use crate::files::atomic;
use crate::measure::Metrics;
use crate::verdict::Verdict;

/// The whole report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The verdict on the result.
    #[serde(default)]
    pub verdict: Option<Verdict>,
    /// Version of thirdbounce.
    pub version: String,
    /// Device used.
    pub device: Device,
    /// Resolved settings.
    pub settings: serde_json::Value,
    /// What looks wrong with the capture or the result, as sentences.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// The capture.
    pub capture: Summary,
    /// The plan of the run.
    pub plan: PlanReport,
    /// The trace of the run.
    pub trace: Vec<TraceEntry>,
    /// Totals of the run.
    pub totals: Totals,
    /// Metrics against truth; null without truth.
    pub metrics: Option<Metrics>,
}

/// Device used.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Device {
    /// Name given by the driver.
    pub name: String,
    /// Name and version of the driver.
    pub driver: String,
    /// "discrete", "integrated", "cpu", ...
    pub kind: String,
}

/// The plan, made before solving.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanReport {
    /// Kernel variants chosen.
    pub variants: Vec<String>,
    /// Omitted work, with the savings.
    pub left_out: Vec<String>,
    /// Bytes of each buffer by name.
    pub buffers: BTreeMap<String, u64>,
    /// Whether the domain exceeded its room at some time, so that its dimmest voxels were dropped.
    pub full: bool,
}

/// One line of the trace.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TraceEntry {
    /// Iterations done.
    pub iteration: usize,
    /// Wall-clock seconds since solving began.
    pub seconds: f64,
    /// Device time in seconds; null without a clock or timing.
    pub gpu_seconds: Option<f64>,
    /// Lateral resolution of the grid.
    pub lateral: usize,
    /// Laser-sensor pairs of the iteration; the losses are means over their bins.
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
    /// ‖Av − h‖ / ‖h‖: the square root of `data_loss` over that of an empty volume. h is the measurement used by the
    /// solver, without a subtracted background. Null if not measured.
    #[serde(default)]
    pub residual: Option<f64>,
    /// Metrics against truth, as sibling fields; absent without truth.
    #[serde(flatten)]
    pub metrics: Option<Metrics>,
}

/// Totals of the run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Seconds of reading the capture.
    pub load_s: f64,
    /// Seconds of solving.
    pub solve_s: f64,
    /// Seconds of writing results.
    pub export_s: f64,
    /// Seconds of the solve until the preview; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preview_s: Option<f64>,
    /// Seconds of the stages of the run, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<StageSeconds>,
    /// Pair evaluations (one voxel or point, one pair, one direction).
    pub pairs: f64,
    /// Pair evaluations per second of solving.
    pub pairs_per_s: f64,
    /// Peak device memory, bytes.
    pub peak_device_bytes: u64,
}

/// A stage of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageSeconds {
    /// Its name.
    pub name: String,
    /// Wall-clock seconds.
    pub seconds: f64,
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
/// `Kind::Input` if the file cannot be read or is not a report.
pub fn read(path: &Path) -> Result<Report> {
    let json = std::fs::read_to_string(path)
        .map_err(|e| Error::input(format!("{}: cannot be read: {e}", path.display()), "check the path"))?;
    serde_json::from_str(&json).map_err(|e| {
        Error::input(
            format!("{}: is not a report: {e}", path.display()),
            "give a report.json that reconstruct wrote",
        )
    })
}
