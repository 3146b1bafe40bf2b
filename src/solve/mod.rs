//! Solvers: what is minimised over which voxels, in what order, as schedules that the device runs.
//!
//! [`paper`] is the ECCV 2024 solver; [`Plan`] is what a job needs of the device, made before anything is
//! allocated.

mod assume;
mod checkpoint;
mod domain;
mod drive;
mod extent;
mod faults;
mod job;
pub mod paper;
mod plan;
mod schedule;
pub mod surface;
pub mod vector;

pub use assume::{assume_reflectance, falloff_slope};
pub use checkpoint::{Checkpoint, Identity, Keep};
pub use domain::{compact, double, due, extract, initialise, reduce, restart};
pub use drive::{Beside, Progress, TracePoint, Watch};
pub use extent::default_volume;
pub use job::{Job, upload};
pub use paper::{Decay, NoiseTerm, PaperOptions, Preset, Reconstruction, VolumeMap};
pub use plan::{Accumulation, Level, Plan, Sizes, Tuning, Wanted};
pub use schedule::iteration;
pub use vector::VectorOptions;
