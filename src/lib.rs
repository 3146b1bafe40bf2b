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
//! scan:
//!
//! ```no_run
//! use thirdbounce::glam::DVec3;
//! use thirdbounce::{Capture, Gpu, GpuOptions, Maps, SessionOptions, Settings, session};
//!
//! /// Shows the maps of every frame. `counts` returns those of bin b of pair p at [p * bins + b].
//! fn frames(
//!     wall: Vec<DVec3>,
//!     mut counts: impl FnMut() -> Vec<f32>,
//!     mut show: impl FnMut(&Maps),
//! ) -> thirdbounce::Result<()> {
//!     let gpu = Gpu::open(&GpuOptions::default())?;
//!     let scan = Capture::new([32, 32], wall.clone(), wall, 512, 0.006, vec![]); // no counts yet
//!     let mut settings = Settings::default();
//!     settings.set("lateral", "64")?;
//!     let options = SessionOptions::default();
//!     let (mut session, _) = session(&gpu, &scan, &settings, options)?;
//!     loop {
//!         session.submit(&counts())?;
//!         show(&session.wait()?.result.maps); // or poll(), or wait_for(limit)
//!     }
//! }
//! ```
//!
//! [`Vulkan`] wraps the device of a program, whose buffers hold counts and maps:
//!
//! ```no_run
//! use thirdbounce::ash::{Device, Entry, Instance, vk};
//! use thirdbounce::{
//!     Capture, ExternalBuffer, ExternalCounts, ExternalFrame, Format, Gpu, SessionOptions, Settings,
//!     TimelinePoint, Vulkan, requirements, session,
//! };
//!
//! /// Solves a frame whose counts are in a buffer of the program, and leaves its maps in another one.
//! unsafe fn frame(
//!     (entry, instance, device): (&Entry, &Instance, &Device),
//!     (physical_device, queue): (vk::PhysicalDevice, vk::Queue),
//!     (counts, maps): (vk::Buffer, vk::Buffer),
//!     (written, solved): (vk::Semaphore, vk::Semaphore),
//!     scan: &Capture,
//! ) -> thirdbounce::Result<()> {
//!     let get_instance_proc_addr = entry.static_fn().get_instance_proc_addr;
//!     let (instance, api_version) = (instance.handle(), vk::API_VERSION_1_2);
//!     // vkCreateDevice with required.extensions() and required.features, or a subset of both
//!     let required = unsafe { requirements(get_instance_proc_addr, instance, api_version, physical_device)? };
//!     let gpu = unsafe {
//!         Gpu::of_external(&Vulkan {
//!             get_instance_proc_addr,
//!             instance,
//!             api_version,
//!             physical_device,
//!             device: device.handle(),
//!             queue,
//!             family: required.family,
//!             enabled: required.features,
//!             lock: None,
//!             blocks: None,
//!             pipeline_cache: vk::PipelineCache::null(),
//!         })?
//!     };
//!     let options = SessionOptions { external: true, ..SessionOptions::default() };
//!     let settings = Settings::default();
//!     let (mut session, _) = session(&gpu, scan, &settings, options)?;
//!     let counts_bytes = 4 * (scan.pair_count() * scan.bins) as u64;
//!     session.submit_external(ExternalFrame {
//!         counts: ExternalCounts {
//!             counts: ExternalBuffer::new(counts, 0, counts_bytes)?,
//!             format: Format::U32,
//!             after: Some(TimelinePoint::new(written, 1)),
//!             taken: None,
//!         },
//!         maps: Some(ExternalBuffer::new(maps, 0, session.external_maps_bytes())?),
//!         done: Some(TimelinePoint::new(solved, 1)),
//!     })?;
//!     session.wait().map(drop)
//! }
//! ```
//!
//! Feature `formats` reads and writes files: without it there is no [`read()`], [`prepare()`] and [`write()`]. It is off by
//! default. The command is a crate of its own, `crates/command`.
//!
//! Everything else that the crate holds is hidden: the command, the C and the Python interface and the tests use it, and it may
//! change in any release. `ARCHITECTURE.md` shows it.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod api;
#[doc(hidden)]
pub mod closed_form;
#[doc(hidden)]
pub mod engine;
#[cfg(feature = "formats")]
#[doc(hidden)]
pub mod job;
#[doc(hidden)]
pub mod judge;
#[doc(hidden)]
pub mod learned;
#[doc(hidden)]
pub mod methods;
#[doc(hidden)]
pub mod options;
#[doc(hidden)]
pub mod session;
#[doc(hidden)]
pub mod settings;
#[doc(hidden)]
pub mod solve;
#[doc(hidden)]
pub mod surface;
#[doc(hidden)]
pub mod transport;

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

#[cfg(feature = "formats")]
pub use api::{Written, evaluate, prepare, read, read_truth, reconstruct_file, write};
pub use api::{reconstruct, reconstruct_with, session, session_with};
pub use closed_form::{
    BpSettings, DlctSettings, FbpSettings, FkSettings, LctSettings, PhasorBpSettings, PhasorSettings,
};
pub use engine::{Bins, Doing, Progress, Reconstruction, TracePoint, VolumeMap};
pub use methods::{Method, PaperSettings};
pub use options::Preset;
pub use session::{
    Canceller, ExternalCounts, ExternalFrame, Feed, Format, Frame, FrameId, Hear, Latency, Session,
    SessionOptions, Submitter,
};
pub use settings::{Calibrate, ImpulseResponse, ReflectanceSetting, Settings};
pub use surface::{Follow, SurfaceSettings};
pub use transport::{Grid, Volume};

pub use {ash, glam};

#[doc(inline)]
pub use thirdbounce_base::advice::{self, Advice};
#[doc(inline)]
pub use thirdbounce_base::{Error, Kind, Result};
#[doc(inline)]
pub use thirdbounce_capture::{AxisOrder, Bounce, Capture, Flip, PairKind, Pulse, Reflectance, Summary};
#[doc(inline)]
pub use thirdbounce_gpu::external::{
    Block, BlockSource, ExternalBuffer, Features, Imported, QueueLock, Requirements, TimelinePoint, Vulkan,
    requirements,
};
#[doc(inline)]
pub use thirdbounce_gpu::{DeviceInfo, DeviceKind, Gpu, GpuOptions, Place, devices};
#[doc(inline)]
pub use thirdbounce_maps::maps::{Layer, Maps, Truth};
#[doc(inline)]
pub use thirdbounce_maps::measure::{AtBest, LayerMetrics, Metrics, PaperMeasure};
#[doc(inline)]
pub use thirdbounce_maps::verdict::{Grade, Verdict};
