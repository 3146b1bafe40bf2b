//! The light-transport model: the hidden volume's grid, the numbers that kernels need of a scene, and the
//! compiled kernels.

mod fine;
mod grid;
mod high_pass;
pub mod kernels;
mod model;
mod reach;
mod rows;
mod spot;
mod spread;
mod wall;

pub use crate::capture::Reflectance;
pub use grid::{BRICK_VOXELS, Grid, Volume};
pub use high_pass::{HighPass, LANES};
pub use model::{Binning, Gradient, Model, Sampling, cells};
pub use rows::Rows;
pub use spot::{Rendered, Spot, SpotTaps};
pub use spread::spread_order;
pub use wall::{Geometry, Wall};
