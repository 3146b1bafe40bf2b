//! Buffers to allocate, where they live, and memory of a caller's for them.

use ash::vk;

use super::names::Buffer;

/// Where a buffer lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// On the device; the host reaches it by copies only.
    Device,
    /// Written by the host, read by the device.
    Upload,
    /// Written by the device, read by the host.
    Readback,
    /// On the host, for the device to copy from and to while it computes: what does not fit on the device. A budget does
    /// not count it.
    Store,
}

/// A buffer to allocate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BufferPlan {
    /// Its name.
    pub buffer: Buffer,
    /// Its size, bytes.
    pub bytes: u64,
    /// Where it lives.
    pub place: Place,
}

impl BufferPlan {
    /// The smallest size of a buffer, bytes: Vulkan has no empty buffers.
    pub const LEAST: u64 = 16;

    /// A buffer of `bytes` bytes, but at least [`BufferPlan::LEAST`], rounded up to the whole words that copies need.
    pub fn new(buffer: Buffer, bytes: u64, place: Place) -> BufferPlan {
        BufferPlan { buffer, bytes: bytes.max(Self::LEAST).next_multiple_of(4), place }
    }
}

/// Memory for a buffer.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    /// The memory object.
    pub memory: vk::DeviceMemory,
    /// Where the buffer begins in it, bytes: a multiple of the alignment that was asked for.
    pub offset: u64,
    /// Where that byte is mapped; null for [`Place::Device`]. Mapped memory must be coherent.
    pub mapped: *mut std::ffi::c_void,
}

// SAFETY: handles and an address, which the library uses from one thread at a time.
unsafe impl Send for Block {}
// SAFETY: as above; a shared block is only read.
unsafe impl Sync for Block {}

/// Where the library's buffers get their memory from, in place of its own allocator.
///
/// # Safety
/// A block that `allocate` returns belongs to the device, is as large and aligned as was asked for, of one of the memory
/// types that were allowed, mapped and coherent unless it is for [`Place::Device`], and nobody else uses it before `free`
/// gets it back.
pub unsafe trait BlockSource: Send + Sync {
    /// Gives a block for a buffer; `None` if there is no memory. The types of memory that the requirements allow are coherent
    /// unless the buffer is for [`Place::Device`].
    fn allocate(&self, requirements: &vk::MemoryRequirements, place: Place) -> Option<Block>;

    /// Takes a block back. No work on the device uses it any more.
    fn free(&self, block: Block);
}
