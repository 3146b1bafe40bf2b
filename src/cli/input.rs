//! Options that say which capture, which volume and which device.

use std::path::PathBuf;

use clap::Args;
use thirdbounce::capture::Gate;
use thirdbounce::job::{self, Loaded, Request};
use thirdbounce::solve::Preset;
use thirdbounce::transport::Volume;
use thirdbounce::{Error, Result};

use super::solver::SolverArgs;

/// The capture and what of it is used.
#[derive(Args)]
pub struct CaptureArgs {
    /// Capture file: npz, or y-tal HDF5
    pub capture: PathBuf,
    /// Use every Nth scan point in x and in y
    #[arg(long, value_name = "N", help_heading = "Capture")]
    pub stride: Option<usize>,
    /// Use these paths only, in metres; an end may be left out (0.8:2.4, 0.8:, :2.4)
    #[arg(long, value_name = "FROM:TO", allow_hyphen_values = true, help_heading = "Capture")]
    pub gate: Option<String>,
    /// Use all paths: neither look for direct light nor, for --preset captured, for the half with the most counts
    #[arg(long, conflicts_with = "gate", help_heading = "Capture")]
    pub no_auto_gate: bool,
    /// Scale the wall so that its outermost scan points are SIZE metres apart
    #[arg(long, value_name = "SIZE", help_heading = "Capture")]
    pub wall: Option<f64>,
}

impl CaptureArgs {
    pub fn input(&self, preset: Option<Preset>) -> Result<job::Input> {
        Ok(job::Input {
            path: self.capture.clone(),
            wall: self.wall,
            stride: self.stride,
            gate: self.gate.as_deref().map(Gate::parse).transpose()?,
            no_auto_gate: self.no_auto_gate,
            preset,
        })
    }
}

/// The grid besides its lateral resolution.
#[derive(Args)]
pub struct VolumeArgs {
    /// Voxel size along z in metres [default: the bin width]
    #[arg(long, value_name = "M", help_heading = "Volume")]
    pub depth_pitch: Option<f64>,
    /// Reconstruct this box, in metres [default: the wall's extent, and the depths that the gate allows]
    #[arg(
        long = "box",
        value_name = "X0,X1,Y0,Y1,Z0,Z1",
        allow_hyphen_values = true,
        help_heading = "Volume"
    )]
    pub volume_box: Option<String>,
}

impl VolumeArgs {
    pub fn volume(&self) -> Result<Option<Volume>> {
        let Some(text) = &self.volume_box else { return Ok(None) };
        let numbers: Vec<f64> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
        match numbers[..] {
            [x0, x1, y0, y1, z0, z1] if text.split(',').count() == 6 => {
                Ok(Some(Volume { min: glam::dvec3(x0, y0, z0), max: glam::dvec3(x1, y1, z1) }))
            }
            _ => Err(Error::options(
                format!("--box is {text:?}"),
                "give six lengths in metres with commas between, as -0.5,0.5,-0.5,0.5,0.3,1.2",
            )),
        }
    }
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
    let (input, memory, volume) = (capture.input(solver.preset)?, device.memory()?, grid.volume()?);
    let mut loaded = job::load(&input)?;
    let (preset, note, solver) = solver.resolve(None, &loaded.capture);
    loaded.notes.extend(note);
    let request = Request {
        preset: Some(preset),
        depth_pitch: grid.depth_pitch,
        volume,
        memory,
        device: device.device.clone(),
        validation: device.validation,
        ..Request::new(solver, "")
    };
    Ok((loaded, request))
}
