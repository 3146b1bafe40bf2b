//! Kernels: SPIR-V words, functions of the host, bindings, constants.

use super::names::{Buffer, Constant, Kernel};

/// One compiled kernel variant.
#[derive(Debug, Clone, Copy)]
pub struct KernelCode {
    /// Name of the variant, unique among all modules.
    pub name: &'static str,
    /// The kernel as a function on host memory; `None` for a module that runs on Vulkan devices only.
    pub host: Option<thirdbounce_kernels::Function<f32>>,
    /// SPIR-V words, little-endian.
    pub spirv: &'static [u8],
    /// Bound blocks.
    pub bindings: &'static [Binding],
    /// Specialization constants and their ids.
    pub constants: &'static [(Constant, u32)],
}

impl From<&KernelCode> for Kernel {
    fn from(code: &KernelCode) -> Kernel {
        Kernel::named(code.name)
    }
}

/// Descriptor type of a buffer in a kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// As a uniform block.
    Uniform,
    /// As a storage block.
    Storage,
}

/// A buffer binding of a kernel, by default to the buffer with the block's name.
#[derive(Debug, Clone, Copy)]
pub struct Binding {
    /// Name of the block.
    pub block: Buffer,
    /// Binding number in descriptor set 0.
    pub slot: u32,
    /// Descriptor type.
    pub view: View,
    /// Whether the kernel reads it.
    pub reads: bool,
    /// Whether the kernel writes it.
    pub writes: bool,
}
