//! Whole jobs, from a capture file to result files. The command line calls them.
//!
//! [`load`] reads and prepares a capture. [`run()`] reconstructs it and writes every result. [`batch()`] does this with many
//! captures. [`benchmark()`] compares methods on captures and scenes. [`evaluate()`] measures an earlier result. [`inspect()`] says what a run would
//! do. [`demo()`] simulates a scene and reconstructs it. Callers only gather options and show the results.

mod advice;
pub mod batch;
pub mod benchmark;
pub mod compare;
pub mod demo;
mod evaluate;
mod histogram;
pub mod inspect;
mod overview;
mod places;
mod planned;
mod preview;
pub mod profile;
mod reconstruct;
mod record;
mod report;
mod request;
mod run;
mod simulated;
mod sizes;
mod words;

use std::path::PathBuf;
use std::time::Instant;

use crate::Result;
use crate::capture::conditioning::{self, Conditioning};
use crate::capture::{self, Capture, Gate, Summary};
use crate::solve::Preset;
use crate::tags;

pub use crate::estimation::{Choice, FindPulse, MODELS, Resolved, preset_for};
pub use crate::solve::{Bins, SolverOptions, check_solver, reflectance};

pub use advice::suggestions;
pub use batch::{Batch, batch};
pub use benchmark::{Benchmark, benchmark};
pub use compare::{Compared, Comparison, Foreign, ForeignResult, Method, Turn, compare};
pub use demo::{Demo, demo};
pub use evaluate::{Evaluation, evaluate};
pub use histogram::{Histogramming, histogram};
pub use inspect::{Inspection, inspect, schedule};
pub use places::{PREVIEW, check_file, check_inputs, check_not_input};
pub use request::{Request, memory_bytes};
pub use run::{Outcome, Solved, run, solve};
pub use simulated::{Simulated, Simulation, simulate};
pub use sizes::usual_pipeline_cache;
pub use words::{plain, write_json};

/// A capture, and the part of it that is used.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Input {
    /// The file, or the folder of several.
    pub path: PathBuf,
    /// Scale the wall so that its outermost scan points are this far apart, metres.
    pub wall: Option<f64>,
    /// Bin width in metres of path, for files without it.
    pub bin_width: Option<f64>,
    /// Metres of a step of the wall's depth, for formats that do not say.
    pub depth_unit: Option<f64>,
    /// Bounces that count, for formats that keep them apart.
    pub bounce: Option<capture::Bounce>,
    /// File with the times of flight to the wall, for formats that keep them in a second file.
    pub time_of_flight: Option<PathBuf>,
    /// The axes of a file with a single array.
    pub axes: Option<capture::AxisOrder>,
    /// How to turn the scan, for files that do not say how it lies on the wall.
    pub turn: capture::Turn,
    /// Keep every Nth scan point in x and in y; `None` keeps all.
    pub stride: Option<usize>,
    /// Keep this many pairs, drawn at random after the stride; `None` keeps all.
    pub subset: Option<usize>,
    /// Seed of the random draw.
    pub subset_seed: u64,
    /// Paths that are used; `None` looks for direct light and leaves it out.
    pub gate: Option<Gate>,
    /// Do not look for a gate: use every path.
    pub no_auto_gate: bool,
    /// Keep pairs without any count, although their neighbours have many.
    pub keep_empty: bool,
    /// The instrument's pulse; `None` takes the file's, if it has one.
    pub pulse: Option<GivenPulse>,
    /// Full widths at half maximum, metres, of what laser and sensor see of the wall, 0 for points; `None` takes the
    /// file's.
    pub spots: Option<[f64; 2]>,
    /// The published set of parameters; `None` takes [`preset_for`]. [`Preset::Captured`] brings the published gate.
    pub preset: Option<Preset>,
}

impl Input {
    /// What the capture goes through before a solve.
    pub fn conditioning(&self) -> Conditioning {
        let keep = capture::Keep::default().with_stride(self.stride);
        Conditioning {
            turn: self.turn,
            wall: self.wall,
            keep: keep.with_subset(self.subset, self.subset_seed).with_gate(self.gate),
            keep_empty: self.keep_empty,
            no_auto_gate: self.no_auto_gate,
            published_gate: self.preset.map(|preset| preset == Preset::Captured),
            pulse: self.pulse.as_ref().map(|pulse| match pulse {
                GivenPulse::Sharp => None,
                GivenPulse::Shape(pulse) => Some(pulse.clone()),
            }),
            spots: self.spots,
        }
    }

    /// The values that complete or correct those of the file.
    pub fn given(&self) -> capture::ReadOptions {
        let given = capture::ReadOptions::default().with_wall(self.wall).with_bin_width(self.bin_width);
        let given = given.with_depth_unit(self.depth_unit).with_bounce(self.bounce);
        given.with_time_of_flight(self.time_of_flight.clone()).with_axes(self.axes)
    }
}

/// The instrument's pulse, as the user gives it.
#[derive(Debug, Clone, PartialEq)]
pub enum GivenPulse {
    /// No pulse: paths are sharp, even if the file has a pulse.
    Sharp,
    /// This pulse.
    Shape(capture::Pulse),
}

/// A capture that is ready to be reconstructed.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// What was asked for.
    pub input: Input,
    /// The capture, ready to be reconstructed.
    pub capture: Capture,
    /// The gate in force, given or found.
    pub gate: Option<Gate>,
    /// Pairs of the file that were left out because they were not measured.
    pub dropped: usize,
    /// Whether wall normals were estimated from neighbouring points.
    pub normals_estimated: bool,
    /// What was done to the capture, as sentences.
    pub notes: Vec<String>,
    /// What looks wrong and was not corrected.
    pub warnings: Vec<String>,
    /// Seconds that loading took.
    pub seconds: f64,
}

impl Loaded {
    /// What the capture holds. Also counts the pairs that were left out, and says whether normals were estimated.
    pub fn summary(&self) -> Summary {
        let mut summary = self.capture.summary();
        (summary.dropped_pairs, summary.normals_estimated) = (self.dropped, self.normals_estimated);
        summary
    }
}

/// Reads a capture and makes it ready ([`conditioning::FOR_A_SOLVE`]).
///
/// # Errors
/// Those of [`capture::read_kept`]; a wall size that does not fit the capture; units that cannot be.
pub fn load(input: &Input) -> Result<Loaded> {
    let start = Instant::now();
    let done = capture::formats::read_prepared(&input.path, &input.given(), &input.conditioning());
    Ok(loaded(input, start, done.map_err(|e| placed(e, &input.path))?))
}

/// Prepares a capture that is in memory as [`load`] prepares one that it reads. The path of `input` is only for the report,
/// and values that complete a file are not used: `bin_width`, `depth_unit`, `bounce`, `time_of_flight` and `axes`.
///
/// # Errors
/// Those of [`conditioning::prepare`].
pub fn take(capture: Capture, input: &Input) -> Result<Loaded> {
    let start = Instant::now();
    let done = conditioning::prepare(capture, &input.conditioning());
    Ok(loaded(input, start, done.map_err(|e| placed(e, &input.path))?))
}

/// Makes a capture of time tags or of an instrument's histograms, the file of `input`, and prepares it as [`load`] does. Where
/// the points are and how they are turned is in `scan` and `asked`; values that complete a file are not used.
///
/// # Errors
/// Those of [`tags::histogram()`] and [`take`].
pub fn load_tags(input: &Input, scan: &tags::Scan, asked: &tags::Asked) -> Result<Loaded> {
    let start = Instant::now();
    let made = tags::histogram(&input.path, scan, asked)?;
    let input = Input { wall: None, turn: capture::Turn::default(), ..input.clone() };
    let mut loaded = take(made.capture, &input)?;
    loaded.notes.splice(0..0, made.notes);
    loaded.dropped += made.dropped;
    loaded.seconds = start.elapsed().as_secs_f64();
    Ok(loaded)
}

fn loaded(input: &Input, start: Instant, done: conditioning::Conditioned) -> Loaded {
    let conditioning::Conditioned { capture, gate, dropped, normals_estimated, notes, warnings, .. } = done;
    let seconds = start.elapsed().as_secs_f64();
    Loaded { input: input.clone(), capture, gate, dropped, normals_estimated, notes, warnings, seconds }
}

/// An error of a file names the file. What was never a file has no path.
fn placed(error: crate::Error, path: &std::path::Path) -> crate::Error {
    let text = path.display().to_string();
    let names_it = text.is_empty() || error.what.starts_with(&text) || error.kind != crate::Kind::Input;
    if names_it { error } else { error.at(text) }
}
