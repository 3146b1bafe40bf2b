//! Several methods on one capture: the file of a case of a benchmark.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize, Serializer};

use super::page::escaped;
use super::report::{Device, TraceEntry};
use crate::capture::Summary;
use crate::error::{Error, Result};
use crate::files::atomic;
use crate::measure::{Metrics, Reach};

/// A complete comparison, relative to the first method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Version of thirdbounce.
    pub version: String,
    /// Device used.
    pub device: Device,
    /// The common capture.
    pub capture: Summary,
    /// Its file.
    #[serde(serialize_with = "as_text")]
    pub capture_file: PathBuf,
    /// The truth's file, if any.
    #[serde(serialize_with = "as_text_if_any")]
    pub truth: Option<PathBuf>,
    /// Mask threshold as a share of the brightest albedo, if common to all methods; else each method's own mask.
    pub mask_fraction: Option<f64>,
    /// Whether the mask of every method is the share of the brightest albedo with the best IoU against truth.
    #[serde(default)]
    pub oracle: bool,
    /// Number of alternating runs per method.
    pub repeats: usize,
    /// Methods in the given order.
    pub methods: Vec<MethodReport>,
    /// Methods not applicable to this capture.
    #[serde(default)]
    pub left_out: Vec<LeftOut>,
}

/// A method not applicable to a capture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// The violated assumption.
    pub why: String,
}

/// One method. Times are medians over the repeats; metrics are those of the first run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodReport {
    /// Short name, unique in the comparison.
    pub name: String,
    /// Specification of the method; for foreign maps their location, or empty without maps.
    pub method: String,
    /// Whether the maps were made by another program. Its times are user-supplied.
    #[serde(default)]
    pub foreign: bool,
    /// Vulkan device, or host cores.
    #[serde(default)]
    pub runs_on: String,
    /// Folder of its maps, beside the case's file; empty for foreign maps.
    #[serde(default)]
    pub folder: String,
    /// Mask threshold as a share of the brightest albedo; `None`: the method's own mask.
    #[serde(default)]
    pub mask_fraction: Option<f64>,
    /// Resolved settings.
    pub settings: serde_json::Value,
    /// Iterations between measured points; 0: measured at the end only.
    pub trace_every: usize,
    /// Number of iterations.
    pub iterations: usize,
    /// Solve seconds, excluding load, set-up, measurement and export.
    pub seconds: f64,
    /// Solve seconds of each repeat.
    pub repeats_s: Vec<f64>,
    /// Seconds until the preview, included in all its times; `None` without one. The trace then starts with it as
    /// iteration 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preview_s: Option<f64>,
    /// Active voxels at the end.
    pub active: usize,
    /// Active voxels as a share of the grid.
    pub active_ratio: f64,
    /// Metrics at the end.
    pub metrics: Metrics,
    /// Times at which it reached the first method's final metrics.
    pub reach: Reached,
    /// Measured points.
    pub trace: Vec<TraceEntry>,
}

/// Times at which a method reached the first method's final metrics, each at its best mask fraction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// Depth error.
    pub depth_mae: Reach,
    /// Normal error.
    pub normal_error_deg: Reach,
    /// Best IoU.
    pub best_iou: Reach,
    /// All three.
    pub all: Reach,
}

impl MethodReport {
    /// Name, with the estimated reflectance model, or the origin of foreign maps, in brackets.
    pub fn name_and_model(&self) -> String {
        if self.foreign {
            return format!("{} (foreign)", self.name);
        }
        match self.settings["model_found"]["reflectance"].as_str() {
            Some(model) => format!("{} ({model})", self.name),
            None => self.name.clone(),
        }
    }
}

/// A table as text. The best figure of a row is between stars.
pub struct Table {
    /// Column heads.
    pub head: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Markdown, first column left-aligned, others right-aligned.
    pub fn markdown(&self) -> String {
        let cell = |text: &String| text.replace('|', "\\|").replace('\n', " ");
        let row =
            |cells: &[String]| format!("| {} |\n", cells.iter().map(cell).collect::<Vec<_>>().join(" | "));
        let line = format!("|---|{}\n", "--:|".repeat(self.head.len().saturating_sub(1)));
        row(&self.head) + &line + &self.rows.iter().map(|cells| row(cells)).collect::<String>()
    }

    /// HTML.
    pub fn html(&self) -> String {
        let cell = |tag: &str, text: &String| match text.strip_prefix("**").and_then(|t| t.strip_suffix("**"))
        {
            Some(best) => format!("<{tag}><b>{}</b></{tag}>", escaped(best)),
            None => format!("<{tag}>{}</{tag}>", escaped(text)),
        };
        let row = |tag: &str, cells: &[String]| {
            format!("<tr>{}</tr>\n", cells.iter().map(|text| cell(tag, text)).collect::<String>())
        };
        let rows: String = self.rows.iter().map(|cells| row("td", cells)).collect();
        format!("<table>\n{}{rows}</table>\n", row("th", &self.head))
    }
}

impl Comparison {
    /// Metrics of every method.
    pub fn table(&self) -> Table {
        let iou = if self.oracle { "IoU (oracle)" } else { "IoU" };
        let head = [
            "method",
            "runs on",
            "iterations",
            "time (s)",
            "active",
            iou,
            "best IoU",
            "completeness",
            "depth MAE (mm)",
            "depth RMSE (mm)",
            "normals (°)",
            "s to depth",
            "s to normals",
            "s to IoU",
            "s to all three",
            "paper: depth MAE, RMSE (m)",
            "paper: normals MAE, RMSE",
        ];
        let whole = self.methods.first().map_or(0.0, |m| m.seconds);
        let row = |m: &MethodReport| {
            let figure = |v: Option<f64>, unit: f64, digits: usize| {
                v.map_or("–".to_string(), |v| format!("{:.digits$}", unit * v))
            };
            let time = |r: &Reach| match r.kept_s {
                Some(s) => format!("{} ({:.3})", short(s), s / whole.max(1e-12)),
                None => "–".to_string(),
            };
            let both = |[mae, rmse]: [Option<f64>; 2]| match (mae, rmse) {
                (None, None) => "–".to_string(),
                _ => format!("{}, {}", figure(mae, 1.0, 4), figure(rmse, 1.0, 4)),
            };
            let (best, paper) = (m.metrics.at_best.unwrap_or_default(), m.metrics.paper);
            [
                m.name_and_model(),
                m.runs_on.clone(),
                m.iterations.to_string(),
                spread(m.seconds, &m.repeats_s),
                format!("{:.2} %", 100.0 * m.active_ratio),
                figure(m.metrics.iou, 1.0, 3),
                figure(m.metrics.best_iou, 1.0, 3),
                figure(best.completeness, 1.0, 3),
                figure(best.depth_mae, 1000.0, 2),
                figure(best.depth_rmse, 1000.0, 2),
                figure(best.normal_error_deg, 1.0, 1),
                time(&m.reach.depth_mae),
                time(&m.reach.normal_error_deg),
                time(&m.reach.best_iou),
                time(&m.reach.all),
                both([paper.depth_mae, paper.depth_rmse]),
                both([paper.normal_mae, paper.normal_rmse]),
            ]
            .into()
        };
        Table { head: head.map(String::from).into(), rows: self.methods.iter().map(row).collect() }
    }

    /// Sentences on the comparison and unusual conditions.
    pub(super) fn notes(&self) -> Vec<String> {
        let capture = &self.capture;
        let name =
            self.capture_file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let mut notes = vec![format!(
            "Capture {name}, {} pairs of {} bins. Device: {} ({}). Repeats: {}.",
            capture.pairs, capture.bins, self.device.name, self.device.kind, self.repeats
        )];
        for m in &self.methods {
            if m.name != m.method && !m.foreign {
                notes.push(format!("{} is {}.", m.name, m.method));
            }
            if let Some(seconds) = m.preview_s {
                notes.push(format!(
                    "The curve of {} begins after {} s with the preview that reconstruct shows first.",
                    m.name,
                    short(seconds)
                ));
            }
        }
        if self.methods.iter().any(|m| m.foreign) {
            notes.push(
                "Times of foreign methods, and figures without maps, are those that were given.".into(),
            );
        }
        notes
    }
}

/// A median and its range.
fn spread(median: f64, all: &[f64]) -> String {
    let (low, high) = all.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
    if all.len() < 2 {
        short(median)
    } else {
        format!("{} ({}–{})", short(median), short(low), short(high))
    }
}

/// Seconds with three digits.
fn short(s: f64) -> String {
    let digits = (2.0 - s.abs().max(1e-6).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{s:.digits$}")
}

/// A path may not be UTF-8; JSON is.
fn as_text<S: Serializer>(path: &Path, to: S) -> std::result::Result<S::Ok, S::Error> {
    to.serialize_str(&path.to_string_lossy())
}

fn as_text_if_any<S: Serializer>(path: &Option<PathBuf>, to: S) -> std::result::Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(to)
}

/// Writes the comparison as indented JSON.
///
/// # Errors
/// `Kind::Output` if the file cannot be written.
pub fn write_json(path: &Path, comparison: &Comparison) -> Result<()> {
    let mut json = serde_json::to_string_pretty(comparison).map_err(|e| {
        Error::output(format!("{}: cannot be packed as JSON: {e}", path.display()), "report this as a bug")
    })?;
    json.push('\n');
    atomic::write(path, json.as_bytes())
}

/// Reads a comparison.
///
/// # Errors
/// `Kind::Input` if the file cannot be read or is not a comparison.
pub fn read_json(path: &Path) -> Result<Comparison> {
    let json = std::fs::read_to_string(path)
        .map_err(|e| Error::input(format!("{}: cannot be read: {e}", path.display()), "check the path"))?;
    serde_json::from_str(&json).map_err(|e| {
        Error::input(
            format!("{}: is not a comparison: {e}", path.display()),
            "remove the file, and compare again",
        )
    })
}
