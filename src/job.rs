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

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::Result;
use crate::capture::{self, Capture, Gate, Summary, auto_gate, published_gate, recorded_gate};
use crate::settings::{Flip, Settings};
use crate::solve::Preset;
use crate::tags;

pub use crate::estimation::{MODELS, preset_for};
pub use crate::settings::memory_bytes;
pub use crate::solve::{Bins, SolverOptions, method};

pub use advice::suggestions;
pub use batch::{Batch, batch};
pub use benchmark::{Benchmark, benchmark};
pub use compare::{Compared, Comparison, Foreign, ForeignResult, Method, Turn, compare};
pub use demo::{Demo, demo};
pub use evaluate::{Evaluation, evaluate};
pub use histogram::{Histogramming, histogram};
pub use inspect::{Inspection, inspect, schedule};
pub use places::{PREVIEW, check_file, check_inputs, check_not_input};
pub use request::Request;
pub use run::{Outcome, Solved, run, solve};
pub use simulated::{Simulated, Simulation, simulate};
pub use sizes::usual_pipeline_cache;
pub use words::{plain, write_json};

/// A capture that is ready to be reconstructed.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The file, or the folder of several; empty for a capture that was in memory.
    pub path: PathBuf,
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

/// Reads and checks a capture by the groups `Capture file` and `Capture` of the settings. Estimates the normals of a curved wall without normals. Then scales the wall, thins the
/// scan and gates the bins. If no gate is given, direct light is left out, and captured histograms get the published
/// gate.
///
/// # Errors
/// Those of [`capture::read_kept`]; a wall size that does not fit the capture.
pub fn load(path: &Path, settings: &Settings) -> Result<Loaded> {
    prepared(path, settings, |prepare| {
        capture::formats::read_prepared(path, &reading(settings)?, &keep(settings), prepare)
    })
}

/// The part of the capture that is kept while it is read.
fn keep(settings: &Settings) -> capture::Keep {
    let keep = capture::Keep::default().with_stride(settings.stride);
    keep.with_subset(settings.subset, u64::from(settings.seed())).with_gate(settings.gate)
}

/// The values that complete or correct those of a file.
///
/// # Errors
/// A bounce or a rotation that makes no sense.
pub fn reading(settings: &Settings) -> Result<capture::ReadOptions> {
    let bounce = settings.bounce.as_deref().map(capture::Bounce::parse).transpose()?;
    Ok(capture::ReadOptions::default()
        .with_wall(settings.wall)
        .with_bin_width(settings.bin_width)
        .with_depth_unit(settings.wall_depth_unit)
        .with_bounce(bounce)
        .with_time_of_flight(settings.tof.clone())
        .with_turn(turn(settings)?))
}

/// How the scan is mirrored and rotated.
///
/// # Errors
/// A rotation that is no quarter turn.
pub fn turn(settings: &Settings) -> Result<capture::Turn> {
    let degrees = settings.rotate.map(|degrees| u32::try_from(degrees).unwrap_or(u32::MAX));
    capture::Turn::parse(settings.flip.map(Flip::name), degrees)
}

/// Prepares a capture that is in memory as [`load`] prepares one that it reads. Values that complete a file are not used:
/// `bin_width`, `wall_depth_unit`, `bounce` and `tof`.
///
/// # Errors
/// Those of [`Capture::check`]; a wall size that does not fit the capture.
pub fn take(capture: Capture, settings: &Settings) -> Result<Loaded> {
    prepared(Path::new(""), settings, |prepare| {
        let mut notes = vec![];
        let whole = capture::formats::measured(capture, &mut notes)?;
        capture::formats::keep_prepared(whole, turn(settings)?, &keep(settings), prepare, notes)
    })
}

/// Makes a capture of the time tags or histograms of an instrument in a file, and prepares it as [`load`] does. `scan` and
/// `asked` hold the points, their mirroring and rotation; values that complete a file are not used.
///
/// # Errors
/// Those of [`tags::histogram()`] and [`take`].
pub fn load_tags(path: &Path, settings: &Settings, scan: &tags::Scan, asked: &tags::Asked) -> Result<Loaded> {
    let start = Instant::now();
    let made = tags::histogram(path, scan, asked)?;
    let settings = Settings { wall: None, flip: None, rotate: None, ..settings.clone() };
    let mut loaded = take(made.capture, &settings)?;
    loaded.path = path.into();
    loaded.notes.splice(0..0, made.notes);
    loaded.dropped += made.dropped;
    loaded.seconds = start.elapsed().as_secs_f64();
    Ok(loaded)
}

fn prepared(
    path: &Path,
    settings: &Settings,
    read: impl FnOnce(&mut capture::formats::Prepare) -> Result<capture::Opened>,
) -> Result<Loaded> {
    let start = Instant::now();
    let mut normals_estimated = false;
    // Before the scan is thinned: near neighbours give better normals, and the outermost points tell the wall's size.
    // Before bins are gated: pile-up comes from all earlier counts.
    let mut prepare = |capture: &mut Capture, notes: &mut Vec<String>| {
        notes.extend(capture.take_pile_up_out()?);
        match capture.set_normals() {
            Ok(note) => {
                normals_estimated = note.is_some();
                notes.extend(note);
            }
            // Some models need no normals. The others report the error.
            Err(e) => notes.push(format!("wall normals are unknown: {}", e.what)),
        }
        if let Some(size) = settings.wall {
            capture.set_wall(size)?;
            notes.push(format!("the wall is scaled so that its outermost scan points are {size} m apart"));
        }
        Ok(())
    };
    let capture::Opened { mut capture, dropped, mut notes, .. } = read(&mut prepare)?;
    let mut gate = settings.gate;
    if gate.is_none() && settings.auto_gate != Some(false) {
        let captured = settings.preset.unwrap_or_else(|| preset_for(&capture)) == Preset::Captured;
        // First, as it fills what other gates are found by.
        let recorded = recorded_gate(&mut capture).map(|(found, filled)| {
            if filled > 0 {
                notes.push(format!(
                    "{filled} pairs were not recorded, or not as long as the others: the mean of their neighbours in the scan \
                     takes their place"
                ));
            }
            found
        });
        let direct = auto_gate(&capture);
        let published = captured.then(|| published_gate(&capture, direct.as_ref().map(|d| d.gate.from)));
        // Half of the bins may be more than were recorded.
        let published = published.filter(|p| recorded.as_ref().is_none_or(|r| !p.gate.holds(r.gate)));
        for found in recorded.into_iter().chain(direct).chain(published) {
            notes.push(format!("automatic gate: {} (turn the automatic gate off to use all)", found.reason));
            gate = Some(gate.map_or(found.gate, |before: Gate| before.within(found.gate)));
        }
        if let Some(gate) = gate {
            capture.set_gate(gate)?;
        }
    }
    if let Some(given) = &settings.pulse {
        capture.pulse = given.samples()?;
        capture.pulse.as_ref().map(|pulse| pulse.taps(capture.bin_width)).transpose()?;
    }
    if let Some(spots) = settings.spot {
        [capture.laser_spot, capture.sensor_spot] = spots.map(Some);
    }
    // A capture that was in memory has no path.
    let is_file = !path.as_os_str().is_empty();
    capture.check().map_err(|e| if is_file { e.at(path.display()) } else { e })?;
    notes.extend(capture.clipped_note());
    if let Some([low, high]) = capture.background().range() {
        notes.push(format!(
            "the background differs from pair to pair: {low:.2} to {high:.2} counts in a bin; all methods but paper take \
             off that of each pair"
        ));
    }
    let seconds = start.elapsed().as_secs_f64();
    Ok(Loaded { path: path.into(), capture, gate, dropped, normals_estimated, notes, seconds })
}
