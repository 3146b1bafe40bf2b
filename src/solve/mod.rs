//! Solvers: what is minimised over which voxels, in what order, as schedules that the device runs.
//!
//! A solver has a folder: [`paper`] is the ECCV 2024 one, [`surface`] the default.
//! Each declares its passes as rows ([`Pass`]) and what it needs of a plan ([`Needs`]). It builds the schedules of its
//! start, of its iterations and of the changes between them. The rest is shared: a [`Plan`] is made before anything is
//! allocated, [`OnDevice`] holds its buffers, and the driver submits schedules and reads the trace of finished blocks.

mod adam;
mod bins;
pub mod closed_form;
mod conditions;
mod discretisation;
pub(crate) mod drive;
mod estimate;
mod extent;
#[doc(hidden)]
pub mod learned;
mod on_device;
pub mod option;
mod outline;
mod over_pairs;
pub mod paper;
mod plan;
pub(crate) mod prepared;
mod result;
mod rounding;
mod solver;
mod solvers;
pub mod surface;
pub mod units;

pub use bins::Bins;
pub use conditions::{conclude, conclude_iterate};
pub use discretisation::{Discretisation, Ready};
pub use drive::{Doing, Progress, TracePoint, Watch};
pub(crate) use estimate::enough_pairs;
pub use estimate::{background, expected_noise, variance_per_count, variances};
pub use extent::default_volume;
pub use on_device::{OnDevice, VolumeMap};
pub use option::{Preset, SceneTraits};
pub use outline::{Step, TimedSchedule, When};
pub use paper::{Decay, NoiseTerm, PaperOptions, PaperSettings};
pub use plan::{
    Accumulation, COLUMNS_HOST, Demand, Fault, LeftOut, Level, Needs, Pass, Plan, RESIDUAL_HOST, Tuning,
    UPLOAD, Voxels, gaussian_weights, passes,
};
pub use prepared::Prepared;
pub use result::{Evidence, ImageNoise, Reconstruction, Sharpness};
pub use solver::{Begun, Common, Problem, RunsOn, Solver};
pub use solvers::{Method, SolverOptions, method, pixel_of, reflectance};
pub use surface::{Begin, Follow, SurfaceOptions, SurfaceSettings};

/// The passes of all solvers: those that they share, then one list for each.
pub static PASSES: &[&[&Pass]] =
    &[passes::ALL, paper::passes::ALL, closed_form::passes::ALL, surface::passes::ALL];

/// The pass that schedules call by this name. Some names stand for one pass in each solver.
pub fn pass_of(kernel: &str) -> Option<&'static Pass> {
    PASSES.iter().copied().flatten().copied().find(|p| p.kernel.name() == kernel)
}
