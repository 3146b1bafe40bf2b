//! Options for the capture, the volume and the device.

use std::path::{Path, PathBuf};

use clap::Args;
use thirdbounce::capture::{AxisOrder, Bounce, Capture, Gate, Pulse, ReadOptions, Turn};
use thirdbounce::job::{self, Bins, FindPulse, GivenPulse, Loaded, Request};
use thirdbounce::transport::Volume;
use thirdbounce::{Error, Result};

use super::solver::SolverArgs;
use super::units;

/// The capture, and the part of it that is used.
#[derive(Args)]
pub struct CaptureArgs {
    /// Capture: a file (npz, HDF5 or MATLAB), or the folder of a capture with several files
    pub capture: PathBuf,
    #[command(flatten)]
    pub part: PartArgs,
}

/// The part of a capture that is used.
#[derive(Args)]
pub struct PartArgs {
    /// Use every Nth scan point in x and in y
    #[arg(long, value_name = "N", help_heading = "Capture")]
    pub stride: Option<usize>,
    /// Use only N pairs, drawn at random with --seed
    #[arg(long, value_name = "N", help_heading = "Capture")]
    pub subset: Option<usize>,
    /// Use only these paths; one end may be left out: 0.8:2.4 or 80cm:240cm or 2.7ns:8ns, 0.8:, :2.4
    #[arg(long, value_name = "FROM:TO", allow_hyphen_values = true, help_heading = "Capture")]
    pub gate: Option<String>,
    /// Use all paths. Without this option, direct light is left out, and --preset captured takes the half of the bins
    /// with the most counts
    #[arg(long, conflicts_with = "gate", help_heading = "Capture")]
    pub no_auto_gate: bool,
    /// How the instrument spreads a path over time: the full width at half maximum of a Gaussian, as a time (60ps) or a path
    /// (18mm, metres as a plain number); the same and, behind a colon, the length over which its tail falls to 1/e; an npz file with pulse, pulse_delta_t and
    /// pulse_t_start; none for sharp paths; or auto to find the width by quick
    /// trials [default: the pulse in the capture, else auto for --preset captured and the surface solver, else auto if the
    /// trials of the model show a pulse, else none]
    #[arg(long, value_name = "M|M:TAIL|FILE|none|auto", help_heading = "Capture")]
    pub pulse: Option<String>,
    /// Laser and sensor see areas of the wall: the full width at half maximum of a Gaussian each, on the wall (2cm, metres
    /// as a plain number). One number is both; 0 or none is a point [default: the spots in the capture, else points]
    #[arg(long, value_name = "M|LASER,SENSOR|none", help_heading = "Capture")]
    pub spot: Option<String>,
    // Not flattened from UnsaidArgs: with a group inside a group, clap cannot tell whether a capture was given.
    /// Distance between the outermost scan points; the wall is scaled to it: 2m, 80cm, metres as a plain number
    #[arg(long, value_name = "SIZE", value_parser = units::length, help_heading = "Capture")]
    pub wall: Option<f64>,
    /// Bin width, for files without it: a time (32ps) or a path (9.6mm, metres as a plain number)
    #[arg(long, value_name = "WIDTH", value_parser = units::path, help_heading = "Capture")]
    pub bin_width: Option<f64>,
    /// A step of the wall's depth, for a CC-SOCR capture of a wall that is not flat: 1cm, metres as a plain number
    #[arg(long, value_name = "SIZE", value_parser = units::length, help_heading = "Capture")]
    pub wall_depth_unit: Option<f64>,
    /// The bounce of a rendered Z-NLOS capture that counts: third, all, or a number, 2 or more [default: third]
    #[arg(long, value_name = "WHICH", help_heading = "Capture")]
    pub bounce: Option<String>,
    /// Order of the axes of a file with a single array of counts, as the program that wrote it shows them: xyt, yxt, txy
    /// [default: found by where the light is]
    #[arg(long, value_name = "ORDER", help_heading = "Capture")]
    pub axes: Option<String>,
    /// Keep pairs without any count as dark ones. Without this option, those beside lit pairs are left out
    #[arg(long, help_heading = "Capture")]
    pub keep_empty: bool,
    /// File with tofgrid, for a Stanford f-k capture [default: tof.mat beside the capture]
    #[arg(long, value_name = "FILE", help_heading = "Capture")]
    pub tof: Option<PathBuf>,
    /// Mirror the scan: x swaps left and right as seen in the pictures, y swaps up and down, xy does both; for files
    /// that do not say how the scan lies on the wall
    #[arg(long, value_name = "x|y|xy", help_heading = "Capture")]
    pub flip: Option<String>,
    /// Turn the scan by 90, 180 or 270 degrees after --flip, clockwise as seen in the pictures (+x to the
    /// left, +y up)
    #[arg(long, value_name = "DEGREES", help_heading = "Capture")]
    pub rotate: Option<u32>,
}

/// Values that a capture file may lack, for verbs without a solver.
#[derive(Args)]
pub struct UnsaidArgs {
    /// Distance between the outermost scan points; the wall is scaled to it: 2m, 80cm, metres as a plain number
    #[arg(long, value_name = "SIZE", value_parser = units::length, help_heading = "Capture")]
    pub wall: Option<f64>,
    /// Bin width, for files without it: a time (32ps) or a path (9.6mm, metres as a plain number)
    #[arg(long, value_name = "WIDTH", value_parser = units::path, help_heading = "Capture")]
    pub bin_width: Option<f64>,
    /// A step of the wall's depth, for a CC-SOCR capture of a wall that is not flat: 1cm, metres as a plain number
    #[arg(long, value_name = "SIZE", value_parser = units::length, help_heading = "Capture")]
    pub wall_depth_unit: Option<f64>,
    /// The bounce of a rendered Z-NLOS capture that counts: third, all, or a number, 2 or more [default: third]
    #[arg(long, value_name = "WHICH", help_heading = "Capture")]
    pub bounce: Option<String>,
    /// Order of the axes of a file with a single array of counts, as the program that wrote it shows them: xyt, yxt, txy
    /// [default: found by where the light is]
    #[arg(long, value_name = "ORDER", help_heading = "Capture")]
    pub axes: Option<String>,
    /// Keep pairs without any count as dark ones. Without this option, those beside lit pairs are left out
    #[arg(long, help_heading = "Capture")]
    pub keep_empty: bool,
    /// File with tofgrid, for a Stanford f-k capture [default: tof.mat beside the capture]
    #[arg(long, value_name = "FILE", help_heading = "Capture")]
    pub tof: Option<PathBuf>,
    /// Mirror the scan: x swaps left and right as seen in the pictures, y swaps up and down, xy does both; for files
    /// that do not say how the scan lies on the wall
    #[arg(long, value_name = "x|y|xy", help_heading = "Capture")]
    pub flip: Option<String>,
    /// Turn the scan by 90, 180 or 270 degrees after --flip, clockwise as seen in the pictures (+x to the
    /// left, +y up)
    #[arg(long, value_name = "DEGREES", help_heading = "Capture")]
    pub rotate: Option<u32>,
}

impl UnsaidArgs {
    pub fn given(&self) -> Result<ReadOptions> {
        Ok(ReadOptions::default()
            .with_wall(self.wall)
            .with_bin_width(self.bin_width)
            .with_depth_unit(self.wall_depth_unit)
            .with_bounce(self.bounce.as_deref().map(Bounce::parse).transpose()?)
            .with_time_of_flight(self.tof.clone())
            .with_axes(self.axes.as_deref().map(AxisOrder::parse).transpose()?)
            .with_keep_empty(self.keep_empty)
            .with_turn(Turn::parse(self.flip.as_deref(), self.rotate)?))
    }
}

impl PartArgs {
    /// The input without its path.
    pub fn input(&self, solver: &SolverArgs) -> Result<job::Input> {
        Ok(job::Input {
            path: PathBuf::new(),
            wall: self.wall,
            bin_width: self.bin_width,
            depth_unit: self.wall_depth_unit,
            bounce: self.bounce.as_deref().map(Bounce::parse).transpose()?,
            time_of_flight: self.tof.clone(),
            axes: self.axes.as_deref().map(AxisOrder::parse).transpose()?,
            keep_empty: self.keep_empty,
            turn: Turn::parse(self.flip.as_deref(), self.rotate)?,
            stride: self.stride,
            subset: self.subset,
            subset_seed: solver.choice().seed(),
            gate: self.gate.as_deref().map(gate).transpose()?,
            no_auto_gate: self.no_auto_gate,
            pulse: match self.pulse.as_deref() {
                None => None,
                // The file's pulse is dropped. With `auto`, the run then finds one.
                Some("none" | "auto") => Some(GivenPulse::Sharp),
                Some(text) => Some(GivenPulse::Shape(pulse(text)?)),
            },
            spots: self.spot.as_deref().map(spots).transpose()?,
            preset: solver.preset,
        })
    }

    /// Whether a run finds the pulse first: with `auto`, or if that is `usual` and no pulse is given.
    pub fn find_pulse(&self, usual: FindPulse) -> FindPulse {
        match self.pulse.as_deref() {
            None => usual,
            Some("auto") => FindPulse::Always,
            Some(_) => FindPulse::Never,
        }
    }
}

/// Reads a range of paths from an option; either end may have a unit.
pub fn gate(text: &str) -> Result<Gate> {
    let metres =
        |part: &str| units::path(part).map_or_else(|_| part.to_string(), |metres| metres.to_string());
    Gate::parse(&text.split(':').map(metres).collect::<Vec<_>>().join(":"))
}

/// Reads a pulse from an option: a Gaussian's width as a path or a time, the same and the length of its tail, or a file.
pub fn pulse(text: &str) -> Result<Pulse> {
    let numbers: Vec<Option<f64>> = text.split(':').map(|n| units::path(n).ok()).collect();
    match numbers[..] {
        [Some(width)] => Pulse::gaussian(width),
        [Some(width), Some(tail)] => Pulse::gaussian(width)?.with_tail(tail),
        _ => Pulse::read(Path::new(text)),
    }
}

/// Reads the widths of the spots of laser and sensor from an option; metres if no unit is given.
pub fn spots(text: &str) -> Result<[f64; 2]> {
    let wrong = || {
        Error::options(
            format!("--spot is {text:?}"),
            "give the full width at half maximum on the wall in metres: 0.05, or 0.05,0.02 for laser and sensor, or none",
        )
    };
    if text == "none" {
        return Ok([0.0; 2]);
    }
    let width = |n: &str| units::length(n).ok().filter(|w| w.is_finite() && *w >= 0.0).ok_or_else(wrong);
    match text.split_once(',') {
        None => Ok([width(text)?; 2]),
        Some((laser, sensor)) => Ok([width(laser)?, width(sensor)?]),
    }
}

/// The grid, apart from its lateral resolution.
#[derive(Args)]
pub struct VolumeArgs {
    /// Bins of the capture that are one for the solver: auto sums what neither the maps' pixels nor the pulse tell
    /// apart, native none, N every N neighbours [default: auto; the paper's solver native]
    #[arg(long, value_name = "auto|native|N", help_heading = "Volume")]
    pub bins: Option<String>,
    /// Voxel size along z (4mm, metres as a plain number) [default: the bin width; of the surface solver at least half of
    /// a voxel's width]
    #[arg(long, value_name = "M", value_parser = units::length, help_heading = "Volume")]
    pub depth_pitch: Option<f64>,
    /// Reconstruct this box, in metres, for example -0.5:0.5,-0.5:0.5,0.3:1.2 [default: the wall's extent, and the
    /// depths that the gate allows]. Given the name of a .npz or .hdf5 file, the verb reconstruct writes the volume to
    /// it. Box and file may both be given
    #[arg(
        long = "volume",
        value_name = "X0:X1,Y0:Y1,Z0:Z1 or FILE",
        allow_hyphen_values = true,
        help_heading = "Volume"
    )]
    given: Vec<String>,
}

impl VolumeArgs {
    /// How many bins are one for the solver.
    pub fn bins(&self) -> Result<Bins> {
        self.bins.as_deref().map_or(Ok(Bins::Auto), str::parse)
    }

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
                    "give at most one box and one file",
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
                format!("--volume is {:?}, which is not a box", file.display().to_string()),
                format!("give {BOX}; only reconstruct writes the volume to a file"),
            )),
        }
    }
}

const BOX: &str = "three ranges in metres, for x, y and z: -0.5:0.5,-0.5:0.5,0.3:1.2";

/// A box of three ranges; `None` if the text is a file's name.
fn box_of(text: &str) -> Result<Option<Volume>> {
    let wrong = || Error::options(format!("--volume is {text:?}"), format!("give {BOX}, or a file"));
    let number = |n: &str| units::length(n).map_err(|_| wrong());
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

/// The device, and how it is used.
#[derive(Args)]
pub struct DeviceArgs {
    /// Index or part of the name of the device (see `thirdbounce devices`) [default: the best kind available]
    #[arg(long, value_name = "DEVICE", help_heading = "Device")]
    pub device: Option<String>,
    /// Most device memory to use: a number in MiB, or with K, M or G after it. Pairs whose histograms do not fit are taken in
    /// parts [default: all free memory]
    #[arg(long, value_name = "SIZE", help_heading = "Device")]
    pub memory: Option<String>,
    /// Folder in which compiled kernels are kept between runs, or off [default: thirdbounce/kernels in the user's
    /// cache folder]
    #[arg(long, value_name = "FOLDER|off", help_heading = "Device")]
    pub pipeline_cache: Option<PathBuf>,
    /// Turn on the Vulkan validation layer
    #[arg(long, help_heading = "Device")]
    pub validation: bool,
}

impl DeviceArgs {
    pub fn memory(&self) -> Result<Option<u64>> {
        self.memory.as_deref().map(job::memory_bytes).transpose()
    }

    pub fn pipeline_cache(&self) -> Option<PathBuf> {
        match &self.pipeline_cache {
            Some(given) => Some(given.clone()).filter(|folder| folder.as_os_str() != "off"),
            None => job::usual_pipeline_cache(),
        }
    }
}

/// Loads the capture, and makes the request that several verbs share: without truth and without the folder of results.
/// Options are checked before the capture is read, as far as that is possible.
pub fn load(
    capture: &CaptureArgs,
    solver: &SolverArgs,
    grid: &VolumeArgs,
    device: &DeviceArgs,
) -> Result<(Loaded, Request)> {
    load_file(&capture.capture, &capture.part, solver, grid, device)
}

/// As [`load`], for a capture of another path.
pub fn load_file(
    path: &Path,
    part: &PartArgs,
    solver: &SolverArgs,
    grid: &VolumeArgs,
    device: &DeviceArgs,
) -> Result<(Loaded, Request)> {
    load_with(path, part, solver, grid, device, job::load)
}

/// As [`load_file`], by another way of reading.
pub fn load_with(
    path: &Path,
    part: &PartArgs,
    solver: &SolverArgs,
    grid: &VolumeArgs,
    device: &DeviceArgs,
    read: impl FnOnce(&job::Input) -> Result<Loaded>,
) -> Result<(Loaded, Request)> {
    check(solver, grid, device)?;
    let input = job::Input { path: path.into(), ..part.input(solver)? };
    let mut loaded = read(&input)?;
    let (mut request, notes) = request(&loaded.capture, solver, grid, device)?;
    loaded.notes.extend(notes);
    request.find_pulse = part.find_pulse(request.find_pulse);
    Ok((loaded, request))
}

/// Refuses options that no capture makes good.
pub fn check(solver: &SolverArgs, grid: &VolumeArgs, device: &DeviceArgs) -> Result<()> {
    solver.choice().check()?;
    solver.check_fit()?;
    device.memory()?;
    grid.bins()?;
    grid.volume().map(drop)
}

/// The request for a capture that no arguments change, and notes on what was chosen.
pub fn request(
    capture: &Capture,
    solver: &SolverArgs,
    grid: &VolumeArgs,
    device: &DeviceArgs,
) -> Result<(Request, Vec<String>)> {
    let (volume, volume_file) = grid.volume()?;
    let resolved = solver.choice().resolve(capture);
    let note = |why| format!("{why}: --preset {} is used", job::plain(&resolved.preset));
    let notes = resolved.why.map(note).into_iter().collect();
    let request = Request {
        bins: grid.bins()?,
        depth_pitch: grid.depth_pitch,
        volume,
        volume_file,
        memory: device.memory()?,
        device: device.device.clone(),
        pipeline_cache: device.pipeline_cache(),
        validation: device.validation,
        ..resolved.request()
    };
    Ok((request, notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_widths_have_units_or_none() {
        let metres = |text: &str| gate(text).map(|g| [g.from, g.to]).unwrap();
        assert_eq!(metres("80cm:2.4"), [0.8, 2.4]);
        assert_eq!(metres(":2.4m"), [f64::NEG_INFINITY, 2.4]);
        assert!((metres("2ns:4ns")[1] - 1.199_169_832).abs() < 1e-9);
        for wrong in ["2x:3", "80cm", "2m:1m"] {
            assert!(gate(wrong).is_err(), "{wrong}");
        }
        assert_eq!(spots("2cm,5mm").unwrap(), [0.02, 0.005]);
        assert!(spots("20ps").is_err());
        let [narrow, wide] = ["60ps", "60ps:1ns"].map(|text| pulse(text).unwrap());
        assert!((narrow.fwhm() / 0.017_987_547 - 1.0).abs() < 0.02 && wide.end() > 1.0);
        assert_eq!(
            box_of("-50cm:0.5,-0.5:50cm,30cm:1.2m").unwrap().map(|v| v.max.to_array()),
            Some([0.5, 0.5, 1.2])
        );
    }
}
