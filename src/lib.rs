//! Non-line-of-sight reconstruction on Vulkan compute: albedo, depth and normals of a hidden scene from the
//! third bounce of light off a relay wall.
//!
//! ```no_run
//! use thirdbounce::{Gpu, GpuOptions, Options, read, reconstruct, write};
//!
//! fn main() -> thirdbounce::Result<()> {
//!     let capture = read("capture.npz")?;
//!     let gpu = Gpu::open(&GpuOptions::default())?;
//!     let solved = reconstruct(&gpu, &capture, &Options::default().set("lateral", 128))?;
//!     println!("{}", solved.notes.join("\n"));
//!     write("result", &solved.maps)?;
//!     Ok(())
//! }
//! ```
//!
//! [`Options`] says how; what nobody sets follows from the capture, as it does for the command. A [`Session`] solves frame after
//! frame of one scan. [`Vulkan`] lends a program's own device.
//!
//! Feature `formats` reads and writes files: without it there is no [`read()`], [`prepare()`] and [`write()`]. Feature `cli` adds
//! the command. A program that depends on thirdbounce with `default-features = false` compiles neither.
//!
//! Everything else that the crate holds is hidden: the command, the C and the Python interface and the tests use it, and it may
//! change in any release. `ARCHITECTURE.md` shows it.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod door;
#[doc(hidden)]
pub mod estimation;
#[cfg(feature = "formats")]
#[doc(hidden)]
pub mod job;
#[cfg(feature = "formats")]
#[doc(hidden)]
pub mod live;
#[doc(hidden)]
pub mod session;
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

pub use door::{Options, Solved, reconstruct};
#[cfg(feature = "formats")]
pub use door::{prepare, read, write};
pub use session::{
    Canceller, Feed, Format, Frame, FrameId, Hear, Latency, LentCounts, LentFrame, Session, SessionOptions,
    Submitter,
};
pub use solve::option::OptionValue;
pub use solve::{Doing, Follow, Progress, Reconstruction, TracePoint, VolumeMap};
pub use transport::{Grid, Volume};

#[doc(inline)]
pub use thirdbounce_base::advice::{self, Advice};
#[doc(inline)]
pub use thirdbounce_base::{Error, Kind, Result};
#[doc(inline)]
pub use thirdbounce_capture::{Capture, PairKind, Pulse, Reflectance, Summary};
#[doc(inline)]
pub use thirdbounce_gpu::caller::{
    Block, BlockSource, Features, Imported, Lent, Moment, QueueLock, Requirements, Vulkan, requirements,
};
#[doc(inline)]
pub use thirdbounce_gpu::{DeviceInfo, DeviceKind, Gpu, GpuOptions, Place, devices};
#[doc(inline)]
pub use thirdbounce_maps::maps::{Layer, Maps};
