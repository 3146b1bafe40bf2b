//! What every method can do that turns a capture into maps, and the problem that it is given.

use super::outline::TimedSchedule;
use super::plan::Plan;
use super::prepared::Prepared;
use super::result::Reconstruction;
use crate::Result;
use crate::capture::Capture;
use crate::engine::drive::Watch;
use crate::engine::plan::Accumulation;
use crate::gpu::{Abilities, Gpu};
use crate::options::Options;
use crate::transport::{Grid, Reflectance};

/// A method, as its options.
pub trait Solver: Options {
    /// What the options of all methods have.
    fn common(&self) -> Common;

    /// Checks the options.
    ///
    /// # Errors
    /// The first option that makes no sense, by its name on the command line.
    fn check(&self) -> Result<()>;

    /// Checks that a capture breaks no assumption of the method. Its counts do not matter.
    ///
    /// # Errors
    /// `Kind::Input`: the assumption that it breaks, and what to choose instead.
    fn takes(&self, _capture: &Capture) -> Result<()> {
        Ok(())
    }

    /// The depth of the least detail that its volume has along z, in distances of scan points, if voxels should not be
    /// deeper. They become half as deep as otherwise at the most.
    fn detail(&self) -> Option<f64> {
        None
    }

    /// The plan for a problem. Its budget does not matter.
    ///
    /// # Errors
    /// The method does not take the capture (`Kind::Input`), or the grid exceeds the limits of the device.
    fn plan(&self, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan>;

    /// The schedules of a whole solve with `plan`; none if the device has no part in it.
    fn outline(&self, plan: &Plan) -> Vec<TimedSchedule>;

    /// Prepares the method for captures of one scan; counts are not used.
    ///
    /// # Errors
    /// Options, scan, memory or device do not allow the solve.
    fn prepare(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Box<dyn Prepared>>;

    /// Solves a problem.
    ///
    /// # Errors
    /// Options, capture, memory or device do not allow the solve; the watch cancels ([`crate::Kind::Cancelled`]); a loss is not
    /// finite.
    fn solve(&self, gpu: &Gpu, problem: &Problem<'_>, watch: &mut Watch<'_>) -> Result<Reconstruction> {
        self.check()?;
        problem.capture.check()?;
        self.prepare(gpu, problem)?.solve(problem.capture, watch)
    }
}

/// What the options of all methods have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Common {
    /// Lateral pixels of the maps.
    pub lateral: usize,
    /// The most iterations of the volume, and of what follows it.
    pub iterations: [usize; 2],
    /// How surfaces reflect.
    pub reflectance: Reflectance,
    /// How rendered values are to be added up.
    pub accumulation: Accumulation,
    /// Nothing nearer than this is reconstructed, metres.
    pub min_depth: f64,
    /// Pixels of the maps side by side in a voxel of the finest grid.
    pub pixels_per_voxel: usize,
    /// Where the work is done.
    pub runs_on: RunsOn,
}

/// Where a method does its work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunsOn {
    /// By kernels, on a GPU or on the host as a device.
    Device,
    /// In functions of the host that are no kernels.
    Host,
}

/// A capture, the grid that it is solved on, and what the solve may take and is to give.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'c> {
    /// The capture. For plans and preparations its counts do not matter.
    pub capture: &'c Capture,
    /// The grid whose lateral cells are the maps' pixels.
    pub grid: Grid,
    /// The most bytes that each device may hold, if there is a budget.
    pub memory: Option<u64>,
    /// The volume is read back.
    pub with_volume: bool,
    /// A closed form is to initialise a surface: photon noise is alike at all depths.
    pub is_start: bool,
}

impl<'c> Problem<'c> {
    /// The maps of a capture alone, without a budget.
    pub fn new(capture: &'c Capture, grid: Grid) -> Problem<'c> {
        Problem { capture, grid, memory: None, with_volume: false, is_start: false }
    }

    /// The same, and the volume.
    pub fn and_volume(self) -> Problem<'c> {
        Problem { with_volume: true, ..self }
    }
}
