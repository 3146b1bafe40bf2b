//! Vulkan compute: instance, device, memory, pipelines, schedules. Nothing here knows about light.
//!
//! A [`Schedule`] is plain data over named kernels and named buffers; an [`Executor`] records it with the
//! barriers that its hazards need and submits it. All `unsafe` of the crate is in this folder.

mod device;
mod execute;
mod faults;
mod instance;
mod memory;
mod pipeline;
mod record;
mod recording;
mod schedule;
pub mod spirv;
mod state;

pub use device::{Abilities, Accumulations, Gpu, GpuOptions, Limits};
pub use execute::{Executor, KernelTime, Ticket};
pub use faults::{Faults, Point};
pub use instance::{DeviceInfo, DeviceKind, devices};
pub use memory::{Arena, BufferPlan, Place, check};
pub use recording::{HostSpan, KernelMade, Ran, Recording};
pub use schedule::{Command, Schedule, Size, Stage};

/// One compiled kernel variant.
#[derive(Debug, Clone, Copy)]
pub struct KernelCode {
    pub name: &'static str,
    /// SPIR-V words, little-endian.
    pub spirv: &'static [u8],
    pub bindings: &'static [Binding],
    pub constants: &'static [Constant],
}

/// A buffer that a kernel binds, by the name of its block in the source.
#[derive(Debug, Clone, Copy)]
pub struct Binding {
    pub name: &'static str,
    pub slot: u32,
    pub uniform: bool,
    pub reads: bool,
    pub writes: bool,
}

/// A specialization constant.
#[derive(Debug, Clone, Copy)]
pub struct Constant {
    pub name: &'static str,
    pub id: u32,
}
