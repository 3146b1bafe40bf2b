//! From a file or a capture in memory to a capture that is ready to be reconstructed.

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::capture::conditioning::Conditioning;
use crate::capture::{Capture, Gate, Summary, conditioning};
use crate::methods::Method;
use crate::options::Preset;
use crate::settings::Settings;
use crate::{Result, capture};

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
    /// What looks wrong and was not corrected.
    pub warnings: Vec<String>,
    /// What is wrong for certain; `warnings` holds it, too.
    pub faults: Vec<String>,
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

/// Reads a capture by the groups `Capture file` and `Capture` of the settings and makes it ready
/// ([`conditioning::FOR_A_SOLVE`]).
///
/// # Errors
/// Those of [`capture::read_kept`]; a wall size that does not fit the capture; units that cannot be.
pub fn load(path: &Path, settings: &Settings) -> Result<Loaded> {
    let start = Instant::now();
    if settings.empty.is_some() {
        let opened = capture::read_given(path, &as_recorded(settings)?)?;
        let mut loaded = take(opened.capture, settings).map_err(|e| placed(e, path))?;
        (loaded.path, loaded.seconds) = (path.into(), start.elapsed().as_secs_f64());
        loaded.notes.splice(0..0, opened.notes);
        return Ok(loaded);
    }
    let done = capture::formats::read_prepared(path, &reading(settings)?, &conditioning_of(settings)?);
    Ok(loaded(path, start, done.map_err(|e| placed(e, path))?))
}

/// What a capture goes through before a solve.
///
/// # Errors
/// A rotation that is no quarter turn, or an impulse response that cannot be read.
fn conditioning_of(settings: &Settings) -> Result<Conditioning> {
    let keep = capture::Keep::default().with_stride(settings.stride);
    Ok(Conditioning {
        turn: turn(settings)?,
        wall: settings.wall,
        speed: settings.speed,
        keep: keep.with_subset(settings.subset, u64::from(settings.seed())).with_gate(settings.gate),
        keep_empty: settings.keep_empty == Some(true),
        no_auto_gate: settings.auto_gate == Some(false),
        is_captured: settings.preset.map(|preset| preset == Preset::Captured),
        has_published_gate: matches!(settings.method, Method::Paper(_)),
        pulse: settings.pulse.as_ref().map(|given| given.samples()).transpose()?,
        spots: settings.spot,
    })
}

/// The values that complete or correct those of a file.
///
/// # Errors
/// A rotation that is no quarter turn.
pub fn reading(settings: &Settings) -> Result<capture::ReadOptions> {
    Ok(capture::ReadOptions::default()
        .with_wall(settings.wall)
        .with_bin_width(settings.bin_width)
        .with_depth_unit(settings.wall_depth_unit)
        .with_bounce(settings.bounce)
        .with_time_of_flight(settings.tof.clone())
        .with_axes(settings.axes)
        .with_array(settings.array.clone())
        .with_keep_empty(settings.keep_empty == Some(true))
        .with_speed(settings.speed)
        .with_turn(turn(settings)?))
}

/// As [`reading`], with all pairs as the file has them: for two files that are prepared together.
fn as_recorded(settings: &Settings) -> Result<capture::ReadOptions> {
    let all = Settings { speed: None, flip: None, rotate: None, keep_empty: Some(true), ..settings.clone() };
    reading(&all)
}

/// How the scan is mirrored and rotated.
///
/// # Errors
/// A rotation that is no quarter turn.
pub fn turn(settings: &Settings) -> Result<capture::Turn> {
    capture::Turn::of(settings.flip, settings.rotate)
}

/// Prepares a capture that is in memory as [`load`] prepares one that it reads. Values that complete a file are not used:
/// `bin_width`, `wall_depth_unit`, `bounce`, `tof`, `axes` and `array`.
///
/// # Errors
/// Those of [`conditioning::prepare`].
pub fn take(capture: Capture, settings: &Settings) -> Result<Loaded> {
    let start = Instant::now();
    let (mut capture, mut notes) = (capture, vec![]);
    if let Some(file) = &settings.empty {
        let room = capture::read_given(file, &as_recorded(settings)?)?.capture;
        notes = capture.set_empty(&room).map_err(|e| placed(e, file))?;
    }
    let mut done = loaded(Path::new(""), start, conditioning::prepare(capture, &conditioning_of(settings)?)?);
    done.notes.splice(0..0, notes);
    Ok(done)
}

fn loaded(path: &Path, start: Instant, done: conditioning::Conditioned) -> Loaded {
    let conditioning::Conditioned {
        capture, gate, dropped, normals_estimated, notes, warnings, faults, ..
    } = done;
    let seconds = start.elapsed().as_secs_f64();
    Loaded { path: path.into(), capture, gate, dropped, normals_estimated, notes, warnings, faults, seconds }
}

/// An error of the contents of a file begins with its path.
fn placed(error: crate::Error, path: &Path) -> crate::Error {
    let text = path.display().to_string();
    let is_placed = error.what.starts_with(&text) || error.kind != crate::Kind::Input;
    if is_placed { error } else { error.at(text) }
}
