//! Non-line-of-sight reconstruction on Vulkan compute: albedo, depth and normals of a hidden scene from the
//! third bounce of light off a relay wall.
//!
//! Data flows one way: a [`capture`], a [`transport`] model of it, a [`solve`] schedule that the [`gpu`] runs, then
//! [`maps`] to [`measure`] and [`export`]. [`simulate`] makes captures of known scenes. A [`session`] solves frame after
//! frame of one scan. [`job`] does everything from input files to result files, as the command line does.
//!
//! Feature `formats` reads and writes files: without it there is no [`export`], no [`job`] and no reading of captures.
//! Feature `cli` adds the command.
//!
//! ```no_run
//! use std::ops::ControlFlow;
//! use std::path::Path;
//! use thirdbounce::solve::{VectorOptions, Watch, default_volume, vector};
//! use thirdbounce::{capture, export, gpu, transport};
//!
//! # fn main() -> thirdbounce::Result<()> {
//! let capture = capture::read(Path::new("capture.npz"))?;
//! let options = VectorOptions::default().with(|o| o.lateral = 64);
//! let volume = default_volume(&capture, options.domain.min_depth)?;
//! let grid = transport::Grid::new(volume, options.lateral, capture.bin_width)?;
//! let gpu = gpu::Gpu::open(&gpu::GpuOptions::default())?;
//! let mut hear = |p: &thirdbounce::solve::Progress| {
//!     println!("{} of {}", p.point.iteration, p.iterations);
//!     ControlFlow::Continue(())
//! };
//! let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
//! let result = vector::reconstruct(&gpu, &capture, grid, &options, None, false, &mut watch)?;
//! export::write_maps(Path::new("out"), &result.maps)?;
//! # Ok(())
//! # }
//! ```

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

#[cfg(feature = "formats")]
pub mod job;
#[cfg(feature = "formats")]
pub mod live;
pub mod session;
pub mod solve;
pub mod transport;
pub mod trials;

pub use thirdbounce_base::{Error, Kind, Result, advice, error, panic_message};
#[cfg(feature = "formats")]
pub use thirdbounce_base::{files, host};
pub use thirdbounce_capture as capture;
#[cfg(feature = "formats")]
pub use thirdbounce_export as export;
pub use thirdbounce_gpu as gpu;
pub use thirdbounce_maps::{maps, measure};
pub use thirdbounce_simulate as simulate;
#[cfg(feature = "formats")]
pub use thirdbounce_tags as tags;
