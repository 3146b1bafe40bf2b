//! Planned buffers, their memory places, and external memory for them.

use ash::vk;

use super::names::Buffer;

/// Memory place of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Device memory; accessed by the host through copies only.
    Device,
    /// Written by the host, read by the device.
    Upload,
    /// Written by the device, read by the host.
    Readback,
}

/// A buffer to allocate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BufferPlan {
    /// Its name.
    pub buffer: Buffer,
    /// Its size, bytes.
    pub bytes: u64,
    /// Memory place.
    pub place: Place,
}

impl BufferPlan {
    /// Minimum size of a buffer, bytes: Vulkan has no empty buffers.
    pub const LEAST: u64 = 16;

    /// A buffer of `bytes` bytes, at least [`BufferPlan::LEAST`], rounded up to whole words for copies.
    pub fn new(buffer: Buffer, bytes: u64, place: Place) -> BufferPlan {
        BufferPlan { buffer, bytes: bytes.max(Self::LEAST).next_multiple_of(4), place }
    }
}

/// Memory for a buffer.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    /// The memory object.
    pub memory: vk::DeviceMemory,
    /// Offset of the buffer in it, bytes, a multiple of the required alignment.
    pub offset: u64,
    /// Host address of that byte; null for [`Place::Device`]. Mapped memory must be coherent.
    pub mapped: *mut std::ffi::c_void,
}

// SAFETY: handles and an address, used by one thread at a time.
unsafe impl Send for Block {}
// SAFETY: as above; a shared block is read-only.
unsafe impl Sync for Block {}

/// An allocator of buffer memory, in place of the library's own.
///
/// # Safety
/// A block returned by `allocate` belongs to the device, has the required size and alignment and an allowed memory
/// type, is mapped and coherent unless for [`Place::Device`], and is used by no one else until `free`.
pub unsafe trait BlockSource: Send + Sync {
    /// Allocates a block for a buffer; `None` if out of memory. The allowed memory types are coherent unless for
    /// [`Place::Device`].
    fn allocate(&self, requirements: &vk::MemoryRequirements, place: Place) -> Option<Block>;

    /// Frees a block, no longer used by the device.
    fn free(&self, block: Block);
}
