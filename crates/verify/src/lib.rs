//! Kernels against their float64 reference (`crates/kernels`), by one table of cases (`cases.rs`). The tests run all of it, `thirdbounce profile
//! --check` the part that shows what a device computes wrong.
//!
//! A case runs the schedules of a solver on a random scene. Before each dispatch the reference gets what the kernel's buffers
//! hold, and after it every buffer that the kernel writes is compared with the reference's ([`How::Steps`]). Or the reference runs a
//! whole schedule by itself ([`How::Whole`]), or their gradient is compared with finite differences of their objective
//! ([`How::Slope`]).

mod cases;
mod device;
mod host;
mod physics;
pub mod reference;
pub mod scenes;
mod slope;
mod solvers;
mod steps;

pub use cases::cases;
pub use device::{Needs, job, perform, read_words, write, zero_histograms};
pub use host::Host;
pub use physics::{Raw, Sample, Way, instrument, rendered};
pub use solvers::place;

use thirdbounce::Result;
use thirdbounce::engine::Accumulation;
use thirdbounce::gpu::{Abilities, Buffer, DeviceKind, Gpu};
use thirdbounce::methods::PaperOptions;
use thirdbounce::transport::{Grid, Model};

/// A row of the table.
#[derive(Debug, Clone)]
pub struct KernelCase {
    /// What it is about.
    pub name: &'static str,
    /// The scene.
    pub model: Model,
    /// Its voxels.
    pub grid: Grid,
    /// Whose schedules run.
    pub solver: CaseSolver,
    /// What is compared.
    pub how: How,
    /// On which accumulation paths.
    pub paths: Paths,
    /// Sizes that differ from the plan's.
    pub sizes: CaseSizes,
    /// The largest relative error of fp32 numbers. Integers are equal.
    pub allowed: f64,
    /// Whether `profile --check` runs it.
    pub checks_devices: bool,
}

/// The schedules of a case.
#[derive(Debug, Clone, Copy)]
pub enum CaseSolver {
    /// The paper's: its start, iterations, reductions, a doubling, the maps.
    Paper {
        /// Changes its options.
        change: fn(&mut PaperOptions),
        /// The room for voxels that a reduction gets, as a share of the active ones; the plan's own if `None`.
        rooms: &'static [Option<f64>],
        /// A doubling from half the resolution.
        doubled: Doubled,
        /// Whether no smoothed albedo is above zero.
        dark: bool,
    },
    /// The default: bonds, iterations, the maps.
    Surface {
        /// Points of a pixel.
        points: usize,
        /// First sigma of the Gaussian that spreads gradients, pixels.
        spread: f32,
        /// Whether steps reach the ends of depths and albedos.
        long_steps: bool,
    },
    /// A back-projection.
    Projection {
        /// Sigma of the filter, bins.
        sigma: f64,
        /// Whether its two sides differ in sign.
        odd: bool,
    },
    /// The learned start, on a small box.
    Learned,
    /// The test of how a device rounds.
    Rounding,
}

/// A doubling of the resolution by the paper's solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubled {
    /// None.
    No,
    /// All voxels become four.
    All,
    /// The brightest become four, within room for this share of the voxels.
    Brightest(f64),
    /// None, and room for only half of the rim.
    HalfRim,
}

/// What a case compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum How {
    /// Every dispatch with its reference.
    Steps,
    /// The result of several iterations.
    Whole,
    /// The gradient of the reference with finite differences.
    Slope,
}

/// The accumulation paths of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Paths {
    /// All that the device offers.
    All,
    /// All but the one where a histogram belongs to one invocation.
    Shared,
    /// These.
    Only(&'static [Accumulation]),
}

/// Sizes of a case; the plan's own where `None`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CaseSizes {
    /// Bins of a private column; 0 for none. Chunks are then short enough to be several.
    pub window: Option<u32>,
    /// Voxels and lanes of a workgroup that gathers, and lanes that fill the device.
    pub gather: Option<[u32; 3]>,
    /// Lanes that own a row of a high-pass, or 0, and lanes that share a pixel.
    pub shared: Option<[u32; 2]>,
    /// Distances of gathers are polished, as on devices with rough roots.
    pub polished: bool,
}

/// A comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// The module; for a whole schedule or a gradient, what was compared.
    pub module: &'static str,
    /// The buffer.
    pub buffer: Buffer,
    /// Largest difference over the largest true value, each component by itself. Infinite where integers differ.
    pub error: f64,
    /// The largest error that passes.
    pub allowed: f64,
    /// A number that follows from all bits of the device's result.
    pub bits: u64,
}

impl Compared {
    /// Whether the error is allowed. NaN is not.
    pub fn passed(&self) -> bool {
        self.error <= self.allowed
    }
}

impl KernelCase {
    /// The accumulation paths on which it runs.
    pub fn accumulations(&self, device: &Abilities) -> Vec<Accumulation> {
        use Accumulation::{Fixed, Float, Owned};
        let has = |path: &Accumulation| match path {
            Float => device.accumulations.float,
            Fixed => device.accumulations.int64,
            _ => true,
        };
        let wanted: &[_] = match self.paths {
            Paths::All => &[Float, Fixed, Owned],
            Paths::Shared => &[Float, Fixed],
            Paths::Only(these) => these,
        };
        match device.kind {
            // A task owns a histogram there. What the other paths alone have, it has not.
            DeviceKind::Host if self.paths == Paths::Shared => vec![],
            // Its network is no schedule.
            DeviceKind::Host if matches!(self.solver, CaseSolver::Learned) => vec![],
            DeviceKind::Host => vec![Owned],
            _ => wanted.iter().copied().filter(has).collect(),
        }
    }

    /// Runs it.
    ///
    /// # Errors
    /// The device fails. A difference is not an error here.
    pub fn run(&self, gpu: &Gpu, accumulation: Accumulation) -> Result<Vec<Compared>> {
        match self.how {
            How::Steps => solvers::steps(self, gpu, accumulation),
            How::Whole => solvers::whole(self, gpu, accumulation),
            How::Slope => slope::slope(self, gpu, accumulation),
        }
    }
}
