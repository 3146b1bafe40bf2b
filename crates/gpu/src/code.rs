//! A compiled kernel: its words, the buffers that it binds, its constants.

use super::names::{Buffer, Constant, Kernel};

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
