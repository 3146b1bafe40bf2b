//! Non-line-of-sight reconstruction on Vulkan compute: albedo, depth and normals of a hidden scene from the
//! third bounce of light off a relay wall.
//!
//! ```no_run
//! use thirdbounce::{Gpu, GpuOptions, Settings, SurfaceSettings, read, reconstruct, write};
//!
//! fn main() -> thirdbounce::Result<()> {
//!     let method = SurfaceSettings { lateral: Some(128), ..SurfaceSettings::default() }.into();
//!     let settings = Settings { stride: Some(2), method, ..Settings::default() };
//!     let capture = read("capture.npz", &settings)?;
//!     let gpu = Gpu::open(&GpuOptions::default())?;
//!     let solved = reconstruct(&gpu, &capture, &settings)?;
//!     println!("{}", solved.notes.join("\n"));
//!     write("result", &solved.maps)?;
//!     Ok(())
//! }
//! ```
//!
//! A field of [`Settings`] that is not set has its default for the capture, or is estimated. A [`session()`] solves frames of one
//! scan. [`Vulkan`] wraps the device of a program.
//!
//! Feature `formats` reads and writes files: without it there is no [`read()`], [`prepare()`] and [`write()`]. Feature `cli` adds
//! the command. A program that depends on thirdbounce with `default-features = false` compiles neither.
//!
//! Everything else that the crate holds is hidden: the command, the C and the Python interface and the tests use it, and it may
//! change in any release. `ARCHITECTURE.md` shows it.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod api;
#[doc(hidden)]
pub mod estimation;
#[cfg(feature = "formats")]
#[doc(hidden)]
pub mod job;
#[cfg(feature = "formats")]
#[doc(hidden)]
pub mod live;
#[doc(hidden)]
pub mod resolve;
#[doc(hidden)]
pub mod session;
#[doc(hidden)]
pub mod settings;
#[doc(hidden)]
pub mod solve;
#[doc(hidden)]
pub mod transport;
#[cfg(feature = "formats")]
#[doc(hidden)]
pub mod verify;

#[doc(hidden)]
pub use thirdbounce_base::{error, panic_message};
#[cfg(feature = "formats")]
#[doc(hidden)]
pub use thirdbounce_base::{files, host};
#[doc(hidden)]
pub use thirdbounce_capture as capture;
#[cfg(feature = "formats")]
#[doc(hidden)]
pub use thirdbounce_export as export;
#[doc(hidden)]
pub use thirdbounce_gpu as gpu;
#[doc(hidden)]
pub use thirdbounce_maps::{maps, measure};
#[doc(hidden)]
pub use thirdbounce_simulate as simulate;
#[cfg(feature = "formats")]
#[doc(hidden)]
pub use thirdbounce_tags as tags;

pub use api::{Solved, reconstruct, reconstruct_with, session};
#[cfg(feature = "formats")]
pub use api::{prepare, read, write};
pub use session::{
    Canceller, ExternalCounts, ExternalFrame, Feed, Format, Frame, FrameId, Hear, Latency, Session,
    SessionOptions, Submitter,
};
pub use settings::{Flip, ImpulseResponse, Model, Settings};
pub use solve::closed_form::{
    BpSettings, DlctSettings, FbpSettings, FkSettings, LctSettings, PhasorBpSettings, PhasorSettings,
};
pub use solve::{
    Bins, Doing, Follow, Method, PaperSettings, Preset, Progress, Reconstruction, SurfaceSettings,
    TracePoint, VolumeMap,
};
pub use transport::{Grid, Volume};

pub use {ash, glam};

#[doc(inline)]
pub use thirdbounce_base::advice::{self, Advice};
#[doc(inline)]
pub use thirdbounce_base::{Error, Kind, Result};
#[doc(inline)]
pub use thirdbounce_capture::{Capture, PairKind, Pulse, Reflectance, Summary};
#[doc(inline)]
pub use thirdbounce_gpu::external::{
    Block, BlockSource, ExternalBuffer, Features, Imported, QueueLock, Requirements, TimelinePoint, Vulkan,
    requirements,
};
#[doc(inline)]
pub use thirdbounce_gpu::{DeviceInfo, DeviceKind, Gpu, GpuOptions, Place, devices};
#[doc(inline)]
pub use thirdbounce_maps::maps::{Layer, Maps};
