//! Whole jobs, from a capture file to result files. The command line calls them.
//!
//! [`load`] reads and prepares a capture. [`run`] reconstructs it and writes every result. [`compare()`] does this by
//! several methods and compares them. [`evaluate()`] measures an earlier result. [`inspect()`] says what a run would
//! do. [`demo()`] simulates a scene and reconstructs it. Callers only gather options and show the results.

mod advice;
mod bins;
pub mod compare;
pub mod demo;
mod evaluate;
pub mod inspect;
mod overview;
mod places;
mod preview;
pub mod profile;
mod reconstruct;
mod report;
mod request;
mod simulated;
mod sizes;
pub mod state_file;
pub mod trials;
mod words;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use crate::Result;
use crate::capture::{self, Capture, Gate, Summary, auto_gate, published_gate};
use crate::export;
use crate::export::report::Report;
use crate::files::staging::Staging;
use crate::gpu::KernelTime;
use crate::maps::{Maps, Truth};
use crate::solve::{Preset, Progress, Reconstruction, VolumeMap};

pub use crate::solve::{SolverOptions, check_solver, reflectance};
use preview::Preview;

pub use advice::suggestions;
pub use bins::Bins;
pub use compare::{Compared, Comparison, Method, Turn, compare};
pub use demo::{Demo, demo};
pub use evaluate::{Evaluation, evaluate};
pub use inspect::{Inspection, inspect, schedule};
pub use places::{PREVIEW, check_file};
pub use request::{FindPulse, Request, memory_bytes};
pub use simulated::{Simulated, Simulation, simulate};
pub use sizes::usual_pipeline_cache;
pub use trials::MODELS;
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
    /// Bounces that count, for formats that keep them apart.
    pub bounce: Option<capture::Bounce>,
    /// File with the times of flight to the wall, for formats that keep them in a second file.
    pub time_of_flight: Option<PathBuf>,
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
    /// The instrument's pulse; `None` takes the file's, if it has one.
    pub pulse: Option<GivenPulse>,
    /// Full widths at half maximum, metres, of what laser and sensor see of the wall, 0 for points; `None` takes the
    /// file's.
    pub spots: Option<[f64; 2]>,
    /// The published set of parameters; `None` takes [`preset_for`]. [`Preset::Captured`] brings the published gate.
    pub preset: Option<Preset>,
}

impl Input {
    /// The part of the capture that is kept while it is read.
    pub fn keep(&self) -> capture::Keep {
        let keep = capture::Keep::default().with_stride(self.stride);
        keep.with_subset(self.subset, self.subset_seed).with_gate(self.gate)
    }

    /// The values that complete or correct those of the file.
    pub fn given(&self) -> capture::Given {
        capture::Given {
            wall: self.wall,
            bin_width: self.bin_width,
            bounce: self.bounce,
            time_of_flight: self.time_of_flight.clone(),
            turn: self.turn,
        }
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
    /// Seconds that loading took.
    pub seconds: f64,
}

impl Loaded {
    /// What the capture holds. Also counts the pairs that were left out, and says whether normals were estimated.
    pub fn summary(&self) -> Summary {
        Summary {
            dropped_pairs: self.dropped,
            normals_estimated: self.normals_estimated,
            ..self.capture.summary()
        }
    }
}

/// Reads and checks a capture. Estimates the normals of a curved wall without normals. Then scales the wall, thins the
/// scan and gates the bins. If no gate is given, direct light is left out, and captured histograms get the published
/// gate.
///
/// # Errors
/// Those of [`capture::read_kept`]; a wall size that does not fit the capture.
pub fn load(input: &Input) -> Result<Loaded> {
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
        if let Some(size) = input.wall {
            capture.set_wall(size)?;
            notes.push(format!("the wall is scaled so that its outermost scan points are {size} m apart"));
        }
        Ok(())
    };
    let capture::Opened { mut capture, dropped, mut notes } =
        capture::formats::read_prepared(&input.path, &input.given(), &input.keep(), &mut prepare)?;
    let mut gate = input.gate;
    if gate.is_none() && !input.no_auto_gate {
        let captured = input.preset.unwrap_or_else(|| preset_for(&capture)) == Preset::Captured;
        let direct = auto_gate(&capture);
        let published = captured.then(|| published_gate(&capture, direct.as_ref().map(|d| d.gate.from)));
        for found in direct.into_iter().chain(published) {
            notes.push(format!("automatic gate: {} (turn the automatic gate off to use all)", found.reason));
            gate = Some(found.gate);
        }
        if let Some(gate) = gate {
            capture.set_gate(gate)?;
        }
    }
    match &input.pulse {
        Some(GivenPulse::Sharp) => capture.pulse = None,
        Some(GivenPulse::Shape(pulse)) => {
            pulse.taps(capture.bin_width)?;
            capture.pulse = Some(pulse.clone());
        }
        None => {}
    }
    if let Some(spots) = input.spots {
        [capture.laser_spot, capture.sensor_spot] = spots.map(Some);
    }
    capture.check().map_err(|e| e.at(input.path.display()))?;
    let seconds = start.elapsed().as_secs_f64();
    Ok(Loaded { input: input.clone(), capture, gate, dropped, normals_estimated, notes, seconds })
}

/// The published set of parameters that fits the capture: if all counts are whole numbers, or some are negative, a
/// detector made them.
pub fn preset_for(capture: &Capture) -> Preset {
    let measured = capture.integer_counts || capture.histograms.iter().any(|v| *v < 0.0);
    if measured { Preset::Captured } else { Preset::Synthetic }
}

/// The result of a run, besides its files.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The report, as `report.json` has it.
    pub report: Report,
    /// Albedo, depth, normals and mask.
    pub maps: Maps,
    /// The truth, if its file was given.
    pub truth: Option<Truth>,
    /// Time per kernel, if it was asked for.
    pub kernels: Vec<(&'static str, KernelTime)>,
    /// Messages of the validation layer, if it was on.
    pub validation: Vec<String>,
    /// Warnings, as sentences.
    pub notes: Vec<String>,
    /// Every file that was written, the report last.
    pub files: Vec<PathBuf>,
}

/// Reconstructs a capture. Writes maps, pictures, points, the volume if the request names a file for it, and last the
/// report: a folder with a report holds a whole result. `hear` is called with the progress and may cancel.
///
/// # Errors
/// Before anything is computed: options out of range, a truth that cannot be read, or a place that cannot be written.
/// Later: the errors of [`SolverOptions::solve`], or a file that cannot be written. No report is written then.
pub fn run(
    request: &Request,
    loaded: &Loaded,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Outcome> {
    let truth = request.check()?;
    // What does not fit is told before a device is asked for.
    request.grid(&loaded.capture)?;
    let gpu = request.open()?;
    let preview = match request.preview {
        true => Preview::begin(request, &loaded.capture, &gpu, hear)?,
        false => None,
    };
    let mut done = reconstruct::solve(request, loaded, &gpu, truth.as_ref(), preview.as_ref(), hear)?;

    let start = Instant::now();
    // An older result stays whole until the new one is complete.
    let staging = Staging::new(&request.out)?;
    let mut staged = export::write_maps(staging.path(), &done.result.maps)?;
    let mut files = vec![];
    if let (Some(file), Some(volume)) = (&request.volume_file, done.result.volume.take()) {
        export::volume::write(file, &export_volume(volume))?;
        files.push(file.clone());
    }
    for (iteration, maps) in &done.snapshots {
        staged.extend(export::write_maps(&Request::snapshot_folder(staging.path(), *iteration), maps)?);
    }
    let mut notes: Vec<String> = done.found.notes();
    notes.extend(request::summed_note(done.sum, done.result.plan.bin_width));
    notes.extend(notes_on(request, &done.result));
    let mut report = report::report_of(request, loaded, &gpu, &done);
    report.totals.preview_s = preview.as_ref().map(|p| p.seconds);
    report.totals.export_s = start.elapsed().as_secs_f64();
    let path = staging.path().join("report.json");
    export::report::write(&path, &report)?;
    staged.push(path);
    files.splice(0..0, staging.commit(&staged)?);
    // The result shows more. One that a killed run left goes, too.
    let _ = std::fs::remove_file(request.out.join(PREVIEW));
    Ok(Outcome {
        report,
        maps: done.result.maps,
        truth,
        kernels: if request.timings { done.result.kernels } else { vec![] },
        validation: gpu.validation_messages(),
        notes,
        files,
    })
}

/// Warnings: an end before the last doubling, a surface that was not taken, an empty result.
fn notes_on(request: &Request, solved: &Reconstruction) -> Vec<String> {
    let mut notes = Vec::new();
    let (reached, wanted) = (solved.lateral, solved.plan.finest().grid.n[0]);
    if reached < wanted {
        notes.push(format!(
            "{} iterations end at {reached} lateral voxels, not at {wanted}: give more iterations, double the grid \
             earlier, or start with the finest grid",
            request.solver.common().iterations[0]
        ));
    }
    if let Some(beyond) = &solved.beyond {
        notes.push(format!(
            "light from beyond the box is taken off: a wider box leaves {:.2} % of pairs that it has not seen, the box \
             alone {:.2} %; {:.2} times what it has there",
            100.0 * beyond.left,
            100.0 * beyond.left_without,
            beyond.strength
        ));
    }
    if solved.surface_left {
        notes.push(
            "a surface explains the data far worse than the volume, for example if three objects lie behind each other: \
             the maps are those of the volume (with 0 iterations of the surface, a run takes less time and solves \
             the volume at the resolution of the maps)"
                .into(),
        );
    }
    if let Some(behind) = &solved.maps.behind {
        notes.push(format!(
            "{} pixels have a second surface behind the first: the maps hold the nearer one, layers_* of maps.npz, \
             points and mesh hold both",
            behind.mask.iter().filter(|m| **m).count()
        ));
    }
    if !solved.maps.mask.contains(&true) {
        notes.push(
            "nothing was found: the maps are empty. Check that volume and gate fit the capture (see \
             `thirdbounce info`)"
                .into(),
        );
    }
    notes
}

fn export_volume(volume: VolumeMap) -> export::volume::Volume {
    let ([x0, x1, y0, y1], [z0, z1]) = (volume.grid.extent(), volume.grid.depth_range());
    export::volume::Volume {
        size: volume.grid.n,
        extent: [x0, x1, y0, y1, z0, z1],
        albedo: volume.albedo,
        normal: None,
    }
}
