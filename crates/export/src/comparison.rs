//! Several methods on one capture: `compare.json` and `compare.md`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize, Serializer};

use super::report::{Device, TraceEntry};
use crate::capture::Summary;
use crate::error::{Error, Result};
use crate::files::atomic;
use crate::measure::{Metrics, Reach};

/// A whole comparison. The other methods are compared with the first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Version of thirdbounce.
    pub version: String,
    /// The device that did the work.
    pub device: Device,
    /// The capture that all methods took.
    pub capture: Summary,
    /// Its file.
    #[serde(serialize_with = "as_text")]
    pub capture_file: PathBuf,
    /// The truth's file, if there is truth.
    #[serde(serialize_with = "as_text_if_any")]
    pub truth: Option<PathBuf>,
    /// Share of the brightest albedo above which a pixel is surface, if it is the same for all methods; else each has its
    /// usual mask.
    pub mask_fraction: Option<f64>,
    /// The truth chose the mask of every method: the share of the brightest albedo with the best IoU.
    #[serde(default)]
    pub oracle: bool,
    /// How often each method ran, in turns.
    pub repeats: usize,
    /// Every method, in the order they were given.
    pub methods: Vec<MethodReport>,
    /// Methods that do not take this capture.
    #[serde(default)]
    pub left_out: Vec<LeftOut>,
}

/// A method that does not take a capture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// The assumption that the capture breaks.
    pub why: String,
}

/// One method. Times are medians over the repeats; figures are those of the first run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodReport {
    /// Short name, unique in the comparison.
    pub name: String,
    /// The text that asked for it; of a foreign one, where its maps are; empty if there are only figures.
    pub method: String,
    /// Another program made it. Its times are those that its user gave.
    #[serde(default)]
    pub foreign: bool,
    /// What did the work: the Vulkan device, or the host's cores.
    #[serde(default)]
    pub runs_on: String,
    /// The folder of its maps, beside `compare.json`; of a foreign one empty.
    #[serde(default)]
    pub folder: String,
    /// Share of the brightest albedo above which its pixels are surface; `None`: the threshold was found at the albedo's edges.
    #[serde(default)]
    pub mask_fraction: Option<f64>,
    /// All settings as they were resolved.
    pub settings: serde_json::Value,
    /// Iterations between measured points; 0: measured at the end only.
    pub trace_every: usize,
    /// Iterations that ran.
    pub iterations: usize,
    /// Solve seconds, without load, set-up, measuring and export.
    pub seconds: f64,
    /// Solve seconds of each repeat.
    pub repeats_s: Vec<f64>,
    /// Seconds until the preview, which are part of all its times; `None` without one. The trace begins with it then, as
    /// iteration 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preview_s: Option<f64>,
    /// Active voxels at the end.
    pub active: usize,
    /// Their share of the grid.
    pub active_ratio: f64,
    /// Figures at the end.
    pub metrics: Metrics,
    /// When it was as good as the first method is at its end.
    pub reach: Reached,
    /// The measured points.
    pub trace: Vec<TraceEntry>,
}

/// When a method was as good as the first method is at its end, each at its best mask fraction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// In depth error.
    pub depth_mae: Reach,
    /// In the error of normals.
    pub normal_error_deg: Reach,
    /// In the best IoU.
    pub best_iou: Reach,
    /// In all three at once.
    pub all: Reach,
}

impl MethodReport {
    /// Its name, and in brackets the model of reflectance, if trials found it, or that another program made the maps.
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

impl Comparison {
    /// The figures as a Markdown table.
    pub fn table(&self) -> String {
        let mut out = format!(
            "| method | runs on | iterations | time (s) | active | IoU{} | best IoU | completeness | depth MAE (mm) | depth RMSE (mm) \
             | normals (°) | s to depth | s to normals | s to IoU | s to all three | paper: depth MAE, RMSE (m) \
             | paper: normals MAE, RMSE |\n\
             |---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
            if self.oracle { " (oracle)" } else { "" }
        );
        let whole = self.methods.first().map_or(0.0, |m| m.seconds);
        for m in &self.methods {
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
            let cells = [
                m.name_and_model().replace('|', "\\|"),
                m.runs_on.replace('|', "\\|"),
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
            ];
            out += &format!("| {} |\n", cells.join(" | "));
        }
        out
    }

    /// The whole page: what was compared, the plot, the table and how to read it.
    pub fn markdown(&self) -> String {
        let first = self.methods.first().map_or("", |m| m.name.as_str());
        let mut out = format!(
            "# Error against run time\n\n\
             Capture `{}`, {} pairs of {} bins. Device: {} ({}). thirdbounce {}.\n\n\
             ![Error against run time](error_vs_time.png)\n\n\
             ![Albedo, normals and depth of the truth and of every method](pictures.png)\n\n{}\n",
            file_name(&self.capture_file),
            self.capture.pairs,
            self.capture.bins,
            self.device.name,
            self.device.kind,
            self.version,
            self.table()
        );
        out += &format!(
            "Time is solve time, without load, set-up, measuring and export. Every method ran {}, in turns. The \
             time is the median, with the range in brackets. A pixel counts as surface above a fraction of the \
             brightest albedo. Every point uses the fraction with the best IoU, which only the truth tells; \
             *IoU* is that of {}. Depth and normal errors are over the \
             pixels that are surface both in the result and in truth. (Figures within that mask are in \
             compare.json.)\n\n\
             *s to …*: seconds until the figure is as good as that of `{first}` at its end, and stays as good. Their \
             share of the whole time of `{first}` is in brackets. Times are those of measured points: {}.\n\n\
             *paper: …*: errors over all pixels of the picture; what is empty in the truth or outside the mask counts as \
             depth 0 and normal (0, 0, 0).\n",
            times(self.repeats),
            self.mask_rule(),
            self.steps(),
        );
        if self.methods.iter().any(|m| m.foreign) {
            out += "\nOther programs made the maps of foreign methods. Their times, and figures without maps, are those that were \
                 given.\n";
        }
        for MethodReport { name, preview_s, .. } in &self.methods {
            if let Some(seconds) = preview_s {
                out += &format!(
                    "\nThe curve of `{name}` begins after {} s with the preview that `reconstruct` shows first. That is \
                     part of its time.\n",
                    short(*seconds)
                );
            }
        }
        for LeftOut { name, why } in &self.left_out {
            out += &format!("\n`{name}` is left out: {why}.\n");
        }
        if self.methods.iter().any(|m| !m.foreign && m.name_and_model() != m.name) {
            out += "\nA model in brackets was found by quick trials, whose time counts as solving.\n";
        }
        for m in self.methods.iter().filter(|m| m.name != m.method && !m.foreign) {
            out += &format!("\n`{}` is `{}`.\n", m.name, m.method);
        }
        out
    }

    /// Which mask the maps have, in words.
    fn mask_rule(&self) -> String {
        match self.mask_fraction {
            _ if self.oracle => "a mask that the truth chose as well (oracle): no user has it".into(),
            Some(f) => format!("the pixels above the fraction {f}"),
            None => "the maps' own mask, by the usual rule of each method".into(),
        }
    }

    /// Which points were measured, in words.
    fn steps(&self) -> String {
        let mut steps: Vec<usize> = self.methods.iter().map(|m| m.trace_every).collect();
        steps.dedup();
        match steps[..] {
            [0] => "only the last one".into(),
            [n] => format!("one after every {n} iterations"),
            _ => "their interval depends on the method (trace_every in compare.json)".into(),
        }
    }
}

fn times(repeats: usize) -> String {
    if repeats == 1 { "once".into() } else { format!("{repeats} times") }
}

/// A median and the range around it.
fn spread(median: f64, all: &[f64]) -> String {
    let (low, high) = all.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
    if all.len() < 2 {
        short(median)
    } else {
        format!("{} ({}–{})", short(median), short(low), short(high))
    }
}

/// Seconds with three figures.
fn short(s: f64) -> String {
    let digits = (2.0 - s.abs().max(1e-6).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{s:.digits$}")
}

/// A path may be no text; JSON is.
fn as_text<S: Serializer>(path: &Path, to: S) -> std::result::Result<S::Ok, S::Error> {
    to.serialize_str(&path.to_string_lossy())
}

fn as_text_if_any<S: Serializer>(path: &Option<PathBuf>, to: S) -> std::result::Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(to)
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
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
/// `Kind::Input` if the file cannot be read or is no comparison.
pub fn read_json(path: &Path) -> Result<Comparison> {
    let json = std::fs::read_to_string(path)
        .map_err(|e| Error::input(format!("{}: cannot be read: {e}", path.display()), "check the path"))?;
    serde_json::from_str(&json).map_err(|e| {
        Error::input(
            format!("{}: is no comparison: {e}", path.display()),
            "remove the file, and compare again",
        )
    })
}

/// Writes the page of [`Comparison::markdown`].
///
/// # Errors
/// `Kind::Output` if the file cannot be written.
pub fn write_markdown(path: &Path, comparison: &Comparison) -> Result<()> {
    atomic::write(path, comparison.markdown().as_bytes())
}
