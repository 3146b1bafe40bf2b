//! What a solve needs of the device: levels, passes, buffers. Made before anything is allocated.

mod buffers;
mod constants;
mod demand;
mod divide;
mod domain;
mod left_out;
mod level;
mod levels;
pub mod passes;
mod saved;
mod scene;
mod sets;
mod spots;
mod tuning;
pub(crate) mod whole;

pub use buffers::{COLUMNS_HOST, MASK_HOST, RAW_HOST, RESIDUAL_HOST, UPLOAD};
pub use demand::Demand;
pub use divide::WorkDivision;
pub use domain::{DomainCapacity, gaussian_weights};
pub use left_out::LeftOut;
pub use level::{Level, LevelPairs};
pub use levels::{AMPLE, Levels};
pub use saved::mebibytes;
pub use scene::ModelSizes;
pub use spots::{BETWEEN, SEEN, Spots};
pub use tuning::{Accumulation, Tuning};
pub use whole::{Fault, Pass, Plan, Voxels};
