//! Compute on a Vulkan device or on the host: devices, memory, kernels, schedules. Independent of light transport.
//!
//! A [`Schedule`] is plain data over named kernels and buffers. On a Vulkan device an [`Executor`] records it with the
//! barriers that its hazards require and submits it; on the host it calls a function for every command. All `unsafe` of thirdbounce outside the C interface is in this crate.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod access;
mod budget;
mod code;
mod device;
mod driver_report;
mod executables;
mod execute;
mod executor;
pub mod external;
mod faults;
mod flight;
mod front;
mod guard;
mod host;
mod host_device;
mod host_executor;
mod instance;
mod kept;
mod label;
mod limits;
mod make;
mod memory;
mod names;
mod offered;
mod options;
mod owned;
mod pace;
mod pipeline;
mod pipelines;
mod place;
mod record;
mod recording;
mod rounding;
mod schedule;
mod short_list;
mod shuffle;
mod state;

use thirdbounce_base::{Error, Result, advice};

pub use access::barriers;
pub use budget::{Memory, check};
pub use code::{Binding, KernelCode, View};
pub use device::{DeviceState, Gpu};
pub use executables::{Compiled, Executable};
pub use executor::KernelTime;
pub use faults::{Faults, Guarded, Overrun, Point};
pub use flight::Ticket;
pub use front::{Arena, Executor};
pub use host_device::devices;
pub use instance::{DeviceInfo, DeviceKind};
pub use kept::kernels_are_kept;
pub use limits::{Abilities, Accumulations, Limits, MOST_STORAGE};
pub use make::KernelRequest;
pub use names::{Buffer, Constant, Kernel};
pub use options::GpuOptions;
pub use place::{BufferPlan, Place};
pub use recording::{HostSpan, KernelMade, Ran, Recording};
pub use rounding::to_nearest;
pub use schedule::{Binds, Command, Schedule, Size, Stage};
pub use short_list::ShortList;
