//! Vulkan compute: instance, device, memory, pipelines, schedules. Nothing here knows about light.
//!
//! A [`Schedule`] is plain data over named kernels and named buffers; an [`Executor`] records it with the
//! barriers that its hazards need and submits it. All `unsafe` of thirdbounce is in this crate, but for the C interface.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod access;
mod budget;
pub mod caller;
mod device;
mod exchange;
mod executables;
mod execute;
mod faults;
mod few;
mod guard;
mod host;
mod instance;
mod kept;
mod label;
mod make;
mod memory;
mod names;
mod offered;
mod owned;
mod pace;
mod pipeline;
mod record;
mod recording;
mod rounding;
mod schedule;
pub mod spirv;
mod state;
mod told;

use thirdbounce_base::{Error, Result, advice};

pub use access::barriers;
pub use budget::{Memory, check};
pub use device::{Abilities, Accumulations, Gpu, GpuOptions, Limits, MOST_STORAGE, Opened};
pub use exchange::{Counted, EXCHANGED, Exchange, Exchanged, Summed, is_left, room_for};
pub use executables::{Compiled, Executable};
pub use execute::{Executor, KernelTime, Ticket};
pub use faults::{Faults, Point};
pub use few::Few;
pub use guard::{Guarded, Overrun};
pub use instance::{DeviceInfo, DeviceKind, devices};
pub use make::Wanted;
pub use memory::{Arena, BufferPlan, Place};
pub use names::{Buffer, Constant, Kernel};
pub use recording::{HostSpan, KernelMade, Ran, Recording};
pub use rounding::to_nearest;
pub use schedule::{Binds, Command, Schedule, Size, Stage};

/// One compiled kernel variant.
#[derive(Debug, Clone, Copy)]
pub struct KernelCode {
    /// Name of the variant, unique among all modules.
    pub name: &'static str,
    /// SPIR-V words, little-endian.
    pub spirv: &'static [u8],
    /// The blocks that it binds.
    pub bindings: &'static [Binding],
    /// Specialization constants with their numbers.
    pub constants: &'static [(Constant, u32)],
}

impl From<&KernelCode> for Kernel {
    fn from(code: &KernelCode) -> Kernel {
        Kernel::named(code.name)
    }
}

/// How a kernel sees a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// As a uniform block.
    Uniform,
    /// As a storage block.
    Storage,
    /// As texels of 1 or 4 floats (`imageBuffer` in GLSL).
    Texels {
        /// Floats of a texel.
        words: u32,
    },
}

/// A buffer of a kernel. It binds the buffer of its own name unless a schedule says otherwise.
#[derive(Debug, Clone, Copy)]
pub struct Binding {
    /// Name of the block.
    pub block: Buffer,
    /// Binding number in descriptor set 0.
    pub slot: u32,
    /// How the kernel sees the buffer.
    pub view: View,
    /// The kernel reads it.
    pub reads: bool,
    /// The kernel writes it.
    pub writes: bool,
}
