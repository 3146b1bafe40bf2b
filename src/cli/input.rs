//! Options that say which capture, which volume and which device.

use std::path::{Path, PathBuf};

use clap::Args;
use thirdbounce::capture::{Bounce, Gate, Given, Pulse, Turn};
use thirdbounce::job::{self, GivenPulse, Loaded, Request, SolverOptions};
use thirdbounce::solve::Preset;
use thirdbounce::transport::Volume;
use thirdbounce::{Error, Result};

use super::solver::SolverArgs;

/// The capture and what of it is used.
#[derive(Args)]
pub struct CaptureArgs {
    /// Capture: a file (npz, HDF5 or MATLAB), or the folder of one that has several
    pub capture: PathBuf,
    /// Use every Nth scan point in x and in y
    #[arg(long, value_name = "N", help_heading = "Capture")]
    pub stride: Option<usize>,
    /// Use so many pairs only, drawn at random by --seed
    #[arg(long, value_name = "N", help_heading = "Capture")]
    pub subset: Option<usize>,
    /// Use these paths only, in metres; an end may be left out (0.8:2.4, 0.8:, :2.4)
    #[arg(long, value_name = "FROM:TO", allow_hyphen_values = true, help_heading = "Capture")]
    pub gate: Option<String>,
    /// Use all paths: neither look for direct light nor, for --preset captured, for the half with the most counts
    #[arg(long, conflicts_with = "gate", help_heading = "Capture")]
    pub no_auto_gate: bool,
    /// How the instrument spreads a path over time: the full width at half maximum of a Gaussian in metres of path, an npz with
    /// pulse, pulse_delta_t and pulse_t_start, none for sharp paths, or auto to find its width by quick trials [default:
    /// what the capture holds, else auto for --preset captured and the vector solver, else none]
    #[arg(long, value_name = "M|FILE|none|auto", help_heading = "Capture")]
    pub pulse: Option<String>,
    // Not flattened from UnsaidArgs: a group within a group would hide from clap whether a capture was given.
    /// Scale the wall so that its outermost scan points are SIZE metres apart
    #[arg(long, value_name = "SIZE", help_heading = "Capture")]
    pub wall: Option<f64>,
    /// Bin width in metres of path (picoseconds times 0.000299792458), for files that do not say it
    #[arg(long, value_name = "M", help_heading = "Capture")]
    pub bin_width: Option<f64>,
    /// Which bounce of a rendered Z-NLOS capture counts: third, all, or a number from 2 [default: third]
    #[arg(long, value_name = "WHICH", help_heading = "Capture")]
    pub bounce: Option<String>,
    /// File with tofgrid, for a Stanford f-k capture [default: tof.mat beside the capture]
    #[arg(long, value_name = "FILE", help_heading = "Capture")]
    pub tof: Option<PathBuf>,
    /// Mirror the scan: x swaps left and right as seen in the pictures, y swaps up and down, xy does both; for files that do
    /// not say which way the scan lies on the wall
    #[arg(long, value_name = "x|y|xy", help_heading = "Capture")]
    pub flip: Option<String>,
    /// Turn the scan by 90, 180 or 270 degrees, counter-clockwise as seen in the pictures (+x to the right, y up), after --flip
    #[arg(long, value_name = "DEGREES", help_heading = "Capture")]
    pub rotate: Option<u32>,
}

/// What a capture file may not say, for verbs that take no solver.
#[derive(Args)]
pub struct UnsaidArgs {
    /// Scale the wall so that its outermost scan points are SIZE metres apart
    #[arg(long, value_name = "SIZE", help_heading = "Capture")]
    pub wall: Option<f64>,
    /// Bin width in metres of path (picoseconds times 0.000299792458), for files that do not say it
    #[arg(long, value_name = "M", help_heading = "Capture")]
    pub bin_width: Option<f64>,
    /// Which bounce of a rendered Z-NLOS capture counts: third, all, or a number from 2 [default: third]
    #[arg(long, value_name = "WHICH", help_heading = "Capture")]
    pub bounce: Option<String>,
    /// File with tofgrid, for a Stanford f-k capture [default: tof.mat beside the capture]
    #[arg(long, value_name = "FILE", help_heading = "Capture")]
    pub tof: Option<PathBuf>,
    /// Mirror the scan: x swaps left and right as seen in the pictures, y swaps up and down, xy does both; for files that do
    /// not say which way the scan lies on the wall
    #[arg(long, value_name = "x|y|xy", help_heading = "Capture")]
    pub flip: Option<String>,
    /// Turn the scan by 90, 180 or 270 degrees, counter-clockwise as seen in the pictures (+x to the right, y up), after --flip
    #[arg(long, value_name = "DEGREES", help_heading = "Capture")]
    pub rotate: Option<u32>,
}

impl UnsaidArgs {
    pub fn given(&self) -> Result<Given> {
        Ok(Given::default()
            .with_wall(self.wall)
            .with_bin_width(self.bin_width)
            .with_bounce(self.bounce.as_deref().map(Bounce::parse).transpose()?)
            .with_time_of_flight(self.tof.clone())
            .with_turn(Turn::parse(self.flip.as_deref(), self.rotate)?))
    }
}

impl CaptureArgs {
    pub fn input(&self, solver: &SolverArgs) -> Result<job::Input> {
        Ok(job::Input {
            path: self.capture.clone(),
            wall: self.wall,
            bin_width: self.bin_width,
            bounce: self.bounce.as_deref().map(Bounce::parse).transpose()?,
            time_of_flight: self.tof.clone(),
            turn: Turn::parse(self.flip.as_deref(), self.rotate)?,
            stride: self.stride,
            subset: self.subset,
            subset_seed: solver.seed(),
            gate: self.gate.as_deref().map(Gate::parse).transpose()?,
            no_auto_gate: self.no_auto_gate,
            pulse: match self.pulse.as_deref() {
                None => None,
                // To be found anew, whatever the file says.
                Some("none" | "auto") => Some(GivenPulse::Sharp),
                Some(text) => Some(GivenPulse::Shape(pulse(text)?)),
            },
            preset: solver.preset,
        })
    }

    /// Whether the pulse is to be found: where that is asked for, and for a detector's counts unless it is the published
    /// solver's turn, which takes paths for sharp.
    pub fn finds_pulse(&self, preset: Preset, solver: &SolverOptions) -> bool {
        match (self.pulse.as_deref(), solver) {
            (None, SolverOptions::Vector(o)) => preset == Preset::Captured && o.surface.iterations > 0,
            (given, _) => given == Some("auto"),
        }
    }
}

/// A pulse as options tell it: a Gaussian's width in metres of path, or a file.
pub fn pulse(text: &str) -> Result<Pulse> {
    match text.trim().parse::<f64>() {
        Ok(width) => Pulse::gaussian(width),
        Err(_) => Pulse::read(Path::new(text)),
    }
}

/// The grid besides its lateral resolution.
#[derive(Args)]
pub struct VolumeArgs {
    /// Voxel size along z in metres [default: the bin width]
    #[arg(long, value_name = "M", help_heading = "Volume")]
    pub depth_pitch: Option<f64>,
    /// Reconstruct this box, in metres, as -0.5:0.5,-0.5:0.5,0.3:1.2 [default: the wall's extent, and the depths
    /// that the gate allows]; reconstruct takes a file's name too, .npz or .hdf5, and writes the volume there
    #[arg(
        long = "volume",
        value_name = "X0:X1,Y0:Y1,Z0:Z1 or FILE",
        allow_hyphen_values = true,
        help_heading = "Volume"
    )]
    given: Vec<String>,
}

impl VolumeArgs {
    /// The box to reconstruct and the file to write the volume to.
    pub fn volume(&self) -> Result<(Option<Volume>, Option<PathBuf>)> {
        let (mut volume, mut file) = (None, None);
        for text in &self.given {
            let twice = match box_of(text)? {
                Some(given) => volume.replace(given).is_some(),
                None => file.replace(PathBuf::from(text)).is_some(),
            };
            if twice {
                return Err(Error::options(
                    format!("--volume {text:?} is the second of its kind"),
                    "give one box and one file at most",
                ));
            }
        }
        Ok((volume, file))
    }

    /// The box to reconstruct, where no volume is written.
    pub fn volume_only(&self) -> Result<Option<Volume>> {
        match self.volume()? {
            (volume, None) => Ok(volume),
            (_, Some(file)) => Err(Error::options(
                format!("--volume is {:?}, which is no box", file.display().to_string()),
                format!("give {BOX}; only reconstruct writes the volume to a file"),
            )),
        }
    }
}

const BOX: &str = "three ranges in metres, x, y and z, as -0.5:0.5,-0.5:0.5,0.3:1.2";

/// A box of three ranges; `None` if the text is a file's name.
fn box_of(text: &str) -> Result<Option<Volume>> {
    let wrong = || Error::options(format!("--volume is {text:?}"), format!("give {BOX}, or a file"));
    let number = |n: &str| n.trim().parse::<f64>().map_err(|_| wrong());
    let is_file = [".npz", ".hdf5", ".h5"].iter().any(|e| text.to_ascii_lowercase().ends_with(e));
    if is_file || !text.contains([':', ',']) {
        return Ok(None);
    }
    let ranges: Vec<&str> = text.split(',').collect();
    let [x, y, z] = ranges[..] else { return Err(wrong()) };
    let range = |part: &str| -> Result<[f64; 2]> {
        let (from, to) = part.split_once(':').ok_or_else(wrong)?;
        Ok([number(from)?, number(to)?])
    };
    let ([x0, x1], [y0, y1], [z0, z1]) = (range(x)?, range(y)?, range(z)?);
    Ok(Some(Volume { min: glam::dvec3(x0, y0, z0), max: glam::dvec3(x1, y1, z1) }))
}

/// Which device, and how it is watched.
#[derive(Args)]
pub struct DeviceArgs {
    /// Index or part of the name of the device (see `thirdbounce devices`) [default: the best kind there is]
    #[arg(long, value_name = "DEVICE", help_heading = "Device")]
    pub device: Option<String>,
    /// Most device memory to use: MiB, or with K, M or G behind it [default: what is free]
    #[arg(long, value_name = "SIZE", help_heading = "Device")]
    pub memory: Option<String>,
    /// Turn on the Vulkan validation layer
    #[arg(long, help_heading = "Device")]
    pub validation: bool,
}

impl DeviceArgs {
    pub fn memory(&self) -> Result<Option<u64>> {
        self.memory.as_deref().map(job::memory_bytes).transpose()
    }
}

/// A capture as told, and what is asked of it but for truth and places: what `info` and `reconstruct` share.
/// Everything that can be refused without the capture is refused before it is read.
pub fn load(
    capture: &CaptureArgs,
    solver: &SolverArgs,
    grid: &VolumeArgs,
    device: &DeviceArgs,
) -> Result<(Loaded, Request)> {
    solver.check(None)?;
    solver.check_fit()?;
    let (input, memory) = (capture.input(solver)?, device.memory()?);
    let (volume, volume_file) = grid.volume()?;
    let mut loaded = job::load(&input)?;
    let (preset, notes, solver) = solver.resolve(None, &loaded.capture);
    loaded.notes.extend(notes);
    let request = Request {
        preset: Some(preset),
        depth_pitch: grid.depth_pitch,
        volume,
        volume_file,
        memory,
        device: device.device.clone(),
        validation: device.validation,
        tuned: true,
        find_pulse: capture.finds_pulse(preset, &solver),
        ..Request::new(solver, "")
    };
    Ok((loaded, request))
}
