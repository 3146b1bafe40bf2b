//! What any solver runs on: a [`Plan`] is made before anything is allocated, [`OnDevice`] holds its buffers, and the driver submits
//! schedules and reads the trace of finished blocks. It does not depend on any solver.

mod adam;
mod bins;
pub(crate) mod drive;
mod extent;
pub mod noise;
mod on_device;
pub(crate) mod outline;
pub(crate) mod over_pairs;
pub mod plan;
pub(crate) mod prepared;
mod result;
mod room;
mod rounding;
mod solver;

pub(crate) use adam::unbiased;
pub use bins::Bins;
pub use drive::{Doing, OnProgress, Progress, TracePoint, Watch};
pub(crate) use drive::{Driven, Iterate, drive, maps_stage, read_whole, stage_values, submit_whole};
pub use extent::{default_volume, pixel_of};
pub(crate) use noise::enough_pairs;
pub use noise::{background, expected_noise, variance_per_count, variances};
pub use on_device::{OnDevice, VolumeMap};
pub(crate) use on_device::{columns_of, maps_of};
pub use outline::{Step, TimedSchedule, When};
pub use plan::{
    AMPLE, Accumulation, COLUMNS_HOST, Demand, Fault, LeftOut, Level, Pass, Plan, RAW_HOST, RESIDUAL_HOST,
    Tuning, UPLOAD, Voxels, gaussian_weights, mebibytes, passes,
};
pub(crate) use prepared::Planned;
pub use prepared::Prepared;
pub(crate) use result::finish;
pub use result::{Evidence, ImageNoise, Reconstruction, Sharpness};
pub use room::{room_light, without_room};
pub use solver::{Common, Problem, RunsOn, Solver};
