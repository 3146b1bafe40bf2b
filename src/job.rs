//! Whole jobs, from a capture file to result files: what stands behind the command line.
//!
//! [`load`] reads and prepares a capture, [`run`] reconstructs it and writes every result, [`inspect()`] tells
//! what a run would do, [`demo()`] makes its own scene. Callers only gather options and show what comes back.

mod account;
pub mod demo;
pub mod inspect;
mod overview;
mod places;
mod scene;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::capture::{self, Capture, Gate, auto_gate, published_gate};
use crate::export::{self, report};
use crate::gpu::{Gpu, GpuOptions, KernelTime};
use crate::maps::{Maps, Truth};
use crate::measure::{Metrics, metrics};
use crate::solve::VolumeMap;
use crate::solve::paper;
use crate::solve::{PaperOptions, Preset, Progress, Reconstruction, Watch, default_volume};
use crate::transport::{Grid, Volume};
use crate::{Error, Result};

pub use account::plain;
pub use demo::{Demo, demo};
pub use inspect::{Inspection, inspect};
pub use scene::{Simulated, Simulation, simulate};

/// Which capture, and what of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Input {
    pub path: PathBuf,
    /// Scale the wall so that its outermost scan points are so many metres apart.
    pub wall: Option<f64>,
    /// Keep every so-manieth scan point in x and in y; `None` keeps all.
    pub stride: Option<usize>,
    /// Paths that are used; `None` looks for direct light and leaves it out.
    pub gate: Option<Gate>,
    /// Use every path even if there seems to be direct light.
    pub no_auto_gate: bool,
    /// The set of parameters to come; `None` takes [`preset_for`]. Captures get the published gate.
    pub preset: Option<Preset>,
}

/// A capture that is ready to be reconstructed.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    pub input: Input,
    pub capture: Capture,
    /// The gate in force, given or found.
    pub gate: Option<Gate>,
    /// What was done to the capture, in sentences for people.
    pub notes: Vec<String>,
    pub seconds: f64,
}

/// Reads and checks a capture, then scales its wall, thins its scan and gates its bins: as told, or without
/// direct light and, for captured histograms, as published.
///
/// # Errors
/// Those of [`capture::read`]; a wall, stride or gate that does not fit the capture.
pub fn load(input: &Input) -> Result<Loaded> {
    let start = Instant::now();
    let mut capture = capture::read(&input.path)?;
    let mut notes = Vec::new();
    if let Some(size) = input.wall {
        capture.set_wall(size)?;
        notes.push(format!("the wall is scaled so that its outermost scan points are {size} m apart"));
    }
    if let Some(n) = input.stride.filter(|n| *n != 1) {
        let [x, y] = capture.scan;
        capture = capture.stride(n)?;
        let [to_x, to_y] = capture.scan;
        notes.push(format!("of {x} x {y} scan points every {}, {to_x} x {to_y}, is used", ordinal(n)));
    }
    let mut gate = input.gate;
    if let Some(gate) = gate {
        capture = capture.gated(gate)?;
    } else if !input.no_auto_gate {
        let captured = input.preset.unwrap_or_else(|| preset_for(&capture)) == Preset::Captured;
        let direct = auto_gate(&capture);
        let published = captured.then(|| published_gate(&capture, direct.as_ref().map(|d| d.gate.from)));
        for found in direct.into_iter().chain(published) {
            notes.push(format!("automatic gate: {} (--no-auto-gate keeps all)", found.reason));
            gate = Some(found.gate);
        }
        if let Some(gate) = gate {
            capture = capture.gated(gate)?;
        }
    }
    capture.check().map_err(|e| e.at(input.path.display()))?;
    Ok(Loaded { input: input.clone(), capture, gate, notes, seconds: start.elapsed().as_secs_f64() })
}

/// The published set of parameters that fits the capture: whole counts come from a detector.
pub fn preset_for(capture: &Capture) -> Preset {
    if capture.integer_counts { Preset::Captured } else { Preset::Synthetic }
}

/// What to reconstruct, how, and where the results go. The capture comes beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Where `options` started from; for the report only.
    pub preset: Option<Preset>,
    pub options: PaperOptions,
    /// Voxel size along z in metres; `None` takes the bin width.
    pub depth_pitch: Option<f64>,
    /// The box to reconstruct; `None` takes the wall's extent and the depths that the gate allows.
    pub volume: Option<Volume>,
    /// Most device memory to use, in bytes.
    pub memory: Option<u64>,
    /// Index or part of the name of the device.
    pub device: Option<String>,
    pub validation: bool,
    /// Time every kernel by itself, which is slower.
    pub timings: bool,
    /// Truth to measure the result against.
    pub truth: Option<PathBuf>,
    /// A pixel is surface above this share of the brightest albedo.
    pub mask_fraction: f64,
    /// Folder of the results.
    pub out: PathBuf,
    /// File for the volume, .npz or .hdf5.
    pub volume_file: Option<PathBuf>,
}

impl Request {
    /// A request with the given options and the defaults for the rest.
    pub fn new(options: PaperOptions, out: impl Into<PathBuf>) -> Request {
        Request {
            preset: None,
            options,
            depth_pitch: None,
            volume: None,
            memory: None,
            device: None,
            validation: false,
            timings: false,
            truth: None,
            mask_fraction: Maps::MASK_FRACTION,
            out: out.into(),
            volume_file: None,
        }
    }

    /// The grid for a capture.
    ///
    /// # Errors
    /// A box without voxels, or more voxels than can be counted.
    pub fn grid(&self, capture: &Capture) -> Result<Grid> {
        let volume = match self.volume {
            Some(volume) => volume,
            None => default_volume(capture, self.options.min_depth)?,
        };
        let pitch = self.depth_pitch.unwrap_or(capture.bin_width);
        let grid = Grid::new(volume, self.options.lateral, pitch)?;
        if volume.max.z <= self.options.min_depth {
            return Err(Error::options(
                format!("--box ends at a depth of {} m", volume.max.z),
                format!("nothing nearer than --min-depth, {} m, is reconstructed", self.options.min_depth),
            ));
        }
        if grid.origin.z > volume.max.z {
            return Err(Error::options(
                format!("no voxel of {pitch} m depth fits from {:.4} to {:.4} m", volume.min.z, volume.max.z),
                "give a smaller --depth-pitch or a deeper --box",
            ));
        }
        Ok(grid)
    }

    fn open(&self) -> Result<Gpu> {
        Gpu::open(&GpuOptions {
            device: self.device.clone(),
            validation: self.validation,
            timings: self.timings,
        })
    }

    /// Everything that can be known to be wrong before the work begins; yields the truth if one was named.
    fn check(&self) -> Result<Option<Truth>> {
        self.options.check()?;
        if !(0.0..1.0).contains(&self.mask_fraction) {
            return Err(Error::options(
                format!("--mask-fraction is {}", self.mask_fraction),
                format!(
                    "give a share of the brightest albedo from 0 to below 1, usually {}",
                    Maps::MASK_FRACTION
                ),
            ));
        }
        places::check_results(&self.out)?;
        if let Some(file) = &self.volume_file {
            places::check_volume(file)?;
        }
        self.truth.as_deref().map(export::npz::read_truth).transpose()
    }
}

/// What a run yields besides its files.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub report: report::Report,
    pub maps: Maps,
    pub truth: Option<Truth>,
    /// Time per kernel, if it was asked for.
    pub kernels: Vec<(&'static str, KernelTime)>,
    /// What the validation layer said, if it was asked for.
    pub validation: Vec<String>,
    /// What the caller may not have wanted, in sentences.
    pub notes: Vec<String>,
    pub files: Vec<PathBuf>,
}

/// Reconstructs a capture and writes maps, pictures, points, the volume if a file was named, and last the
/// report: a folder with a report holds a whole result. `hear` is told of the progress and may break off.
///
/// # Errors
/// Bad options, an unreadable truth or a place that cannot be written before anything is computed; what
/// [`paper::reconstruct`] finds; a file that cannot be written. Without success there is no report.
pub fn run(
    request: &Request,
    loaded: &Loaded,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Outcome> {
    let truth = request.check()?;
    let grid = request.grid(&loaded.capture)?;
    let gpu = request.open()?;
    let with_volume = request.volume_file.is_some();
    let mut watch = Watch { hear, maps_every: None };
    let mut solved = paper::reconstruct(
        &gpu,
        &loaded.capture,
        grid,
        &request.options,
        request.memory,
        with_volume,
        &mut watch,
    )?;
    solved.maps.set_mask(request.mask_fraction);
    let metrics = truth.as_ref().map(|t| metrics(&solved.maps, t, request.mask_fraction)).transpose()?;

    let start = Instant::now();
    let path = request.out.join("report.json");
    // From here on an older report in this folder would stand beside files that it does not describe.
    places::remove(&path)?;
    let mut files = export::write_maps(&request.out, &solved.maps)?;
    if let (Some(file), Some(volume)) = (&request.volume_file, solved.volume.take()) {
        export::volume::write(file, &export_volume(volume))?;
        files.push(file.clone());
    }
    let notes = notes_on(request, &solved);
    let mut report = account::report_of(request, loaded, &grid, &gpu, &solved, metrics);
    report.totals.export_s = start.elapsed().as_secs_f64();
    report::write(&path, &report)?;
    files.push(path);
    Ok(Outcome {
        report,
        maps: solved.maps,
        truth,
        kernels: if request.timings { solved.kernels } else { vec![] },
        validation: gpu.validation_messages(),
        notes,
        files,
    })
}

/// What the caller may not have wanted: an end before the last doubling, an empty result.
fn notes_on(request: &Request, solved: &Reconstruction) -> Vec<String> {
    let mut notes = Vec::new();
    let (reached, wanted) = (solved.maps.nx, solved.plan.finest().grid.n[0]);
    if reached < wanted {
        notes.push(format!(
            "{} iterations, doubling after every {}, end at {reached} lateral voxels, not at {wanted}: give more \
             --iterations, a smaller --double-every or --no-coarse-to-fine",
            request.options.iterations, request.options.double_every
        ));
    }
    if !solved.maps.mask.contains(&true) {
        notes.push(
            "nothing was found: the maps are empty. Check --box and --gate against the capture (`thirdbounce info`)"
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

/// Reads an amount of memory: MiB, or a number with K, M or G behind it.
///
/// # Errors
/// Anything else.
pub fn memory_bytes(text: &str) -> Result<u64> {
    let wrong = || {
        Error::options(
            format!("--memory is {text:?}"),
            "give MiB, or a number with K, M or G behind it, as 512, 512M or 2G",
        )
    };
    let trimmed = text.trim();
    let lower = trimmed.to_ascii_lowercase();
    let number = lower.trim_end_matches("ib").trim_end_matches('b');
    let (digits, unit) = match number.chars().last() {
        Some('k') => (&number[..number.len() - 1], 10),
        Some('m') => (&number[..number.len() - 1], 20),
        Some('g') => (&number[..number.len() - 1], 30),
        _ => (number, 20),
    };
    let value: f64 = digits.trim().parse().map_err(|_| wrong())?;
    let bytes = value * f64::from(1u32 << unit);
    if !(bytes.is_finite() && (1.0..9e18).contains(&bytes)) {
        return Err(wrong());
    }
    Ok(bytes as u64)
}

/// Whether a solver of DESIGN's list can be had.
///
/// # Errors
/// One that is not in this version, or not known at all.
pub fn check_solver(name: &str) -> Result<()> {
    choice("solver", name, "paper", &["vector", "fbp", "bp", "lct", "dlct", "fk", "phasor"])
}

/// Whether a light-transport model can be had.
///
/// # Errors
/// One that is not in this version, or not known at all.
pub fn check_model(name: &str) -> Result<()> {
    choice("model", name, "cosine", &["lambertian", "retroreflective", "isotropic", "auto"])
}

fn choice(option: &str, name: &str, here: &str, later: &[&str]) -> Result<()> {
    if name == here {
        return Ok(());
    }
    let what = if later.contains(&name) { "is not in this version" } else { "is not known" };
    Err(Error::options(
        format!("--{option} {name} {what}"),
        format!("use --{option} {here}, or leave it out"),
    ))
}

fn ordinal(n: usize) -> String {
    let ending = match (n % 10, n % 100) {
        (1, r) if r != 11 => "st",
        (2, r) if r != 12 => "nd",
        (3, r) if r != 13 => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}

/// The maps of an earlier run against truth, with its solve seconds if it left a report.
///
/// # Errors
/// Files that cannot be read, or a mask fraction out of range.
pub fn evaluate(folder: &Path, truth: &Path, mask_fraction: Option<f64>) -> Result<(Metrics, Option<f64>)> {
    let (file, report) = if folder.is_file() {
        (folder.to_path_buf(), None)
    } else {
        (folder.join("maps.npz"), report::read(&folder.join("report.json")).ok())
    };
    let maps = export::npz::read_maps(&file)?;
    let truth = export::npz::read_truth(truth)?;
    let metrics = metrics(&maps, &truth, mask_fraction.unwrap_or(maps.mask_fraction))?;
    Ok((metrics, report.map(|r| r.totals.solve_s)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_in_mebibytes_or_with_a_unit() {
        let read = |text| memory_bytes(text).ok();
        assert_eq!(read("512"), Some(512 << 20));
        assert_eq!(read("64k"), Some(64 << 10));
        assert_eq!(read("1.5 G"), Some(3 << 29));
        assert_eq!(read("2GiB"), Some(2 << 30));
        assert_eq!(read("300MB"), Some(300 << 20));
        for wrong in ["", "G", "-1", "0", "NaN", "inf", "1e300", "3T", "1,5G", "\u{e9}"] {
            assert_eq!(read(wrong), None, "{wrong:?}");
        }
    }

    #[test]
    fn ordinals_end_as_spoken() {
        let all = [1, 2, 3, 4, 11, 12, 13, 21, 102, 111].map(ordinal);
        assert_eq!(all, ["1st", "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "102nd", "111th"]);
    }
}
