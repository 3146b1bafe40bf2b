//! External buffers and semaphores: those of an application, and memory shared by other programs and interfaces.

use std::os::fd::{AsRawFd, BorrowedFd, FromRawFd, IntoRawFd, OwnedFd, RawFd};
use std::sync::Arc;
use std::time::Duration;

use ash::vk;

use crate::device::Gpu;
use crate::executor::DeviceExecutor;
use crate::flight::{Ticket, TimelinePoint};
use crate::names::Buffer;
use crate::{Error, Result};

/// A range of an application's buffer.
#[derive(Clone)]
pub struct ExternalBuffer {
    pub(crate) buffer: vk::Buffer,
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
    /// Keeps imported memory alive.
    imported: Option<Imported>,
}

impl ExternalBuffer {
    /// The `bytes` bytes of `buffer` from byte `offset`; both are multiples of 4.
    ///
    /// # Errors
    /// Offset or size is not a multiple of 4.
    ///
    /// # Safety
    /// The buffer belongs to the device on which it is used, has memory, is at least `offset + bytes` long, and
    /// outlives the frames that name it. It has VK_BUFFER_USAGE_TRANSFER_SRC_BIT if it is read,
    /// VK_BUFFER_USAGE_TRANSFER_DST_BIT if it is written. It is shared with, or owned by, the queue's family. It is
    /// not written while a frame reads it, and not accessed while a frame writes it.
    pub unsafe fn new(buffer: vk::Buffer, offset: u64, bytes: u64) -> Result<ExternalBuffer> {
        if !offset.is_multiple_of(4) || !bytes.is_multiple_of(4) || bytes == 0 {
            return Err(Error::options(
                format!("{bytes} bytes of a buffer from byte {offset} on"),
                "give whole words of 4 bytes, at least one",
            ));
        }
        Ok(ExternalBuffer { buffer, offset, bytes, imported: None })
    }

    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether the range is on this device, as far as known.
    pub fn is_on(&self, gpu: &Gpu) -> bool {
        self.imported.as_ref().is_none_or(|i| i.0.gpu.is(gpu))
    }
}

/// A buffer over memory of another program or interface (CUDA, another Vulkan device of the same GPU, a driver),
/// imported by file descriptor. Clones are handles of the same buffer, which is destroyed with the last one and the
/// last frame that uses it.
#[derive(Clone)]
pub struct Imported(Arc<ImportedMemory>);

struct ImportedMemory {
    gpu: Gpu,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    bytes: u64,
}

impl Imported {
    /// Imports `bytes` bytes of the memory behind an opaque file descriptor
    /// (VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT). `memory_bytes` is the size of the original allocation, and
    /// `memory_type` the index of its type, which Vulkan requires to be the same; `None` selects the lowest suitable
    /// type. On success the library owns the descriptor; on failure it is unchanged.
    ///
    /// # Errors
    /// The device does not support import, or the memory cannot be imported.
    ///
    /// # Safety
    /// The descriptor refers to memory of this GPU of the given size.
    pub unsafe fn by_fd(
        gpu: &Gpu,
        fd: i32,
        [memory_bytes, bytes]: [u64; 2],
        memory_type: Option<u32>,
    ) -> Result<Imported> {
        let refused = |e: vk::Result| {
            Error::memory(
                format!("{} cannot import {bytes} bytes of memory ({e})", gpu.info.name),
                "export it from the same GPU as an opaque file descriptor, and give its whole size",
            )
        };
        if gpu.vulkan().external_memory.is_none() {
            return Err(Error::device(
                format!(
                    "{} cannot import memory: VK_KHR_external_memory_fd is missing or not enabled",
                    gpu.info.name
                ),
                "enable it, or copy through the host",
            ));
        }
        if bytes == 0 || bytes > memory_bytes {
            return Err(Error::options(
                format!("{bytes} bytes of {memory_bytes} bytes of memory"),
                "give no more bytes than the memory has, and at least one",
            ));
        }
        let kind = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
        let usage = vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST
            | vk::BufferUsageFlags::STORAGE_BUFFER;
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(kind);
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage).push_next(&mut external);
        let device = gpu.raw();
        // SAFETY: the device is alive; every object is destroyed on failure, or by `drop`.
        unsafe {
            let buffer = device.create_buffer(&info, None).map_err(refused)?;
            // Destroys the buffer, and the memory once imported, on every failure from here.
            let mut made =
                ImportedMemory { gpu: gpu.clone(), buffer, memory: vk::DeviceMemory::null(), bytes };
            let needs = device.get_buffer_memory_requirements(buffer);
            let lowest = needs.memory_type_bits.trailing_zeros();
            let memory_type = memory_type.unwrap_or(lowest);
            let fits = needs.memory_type_bits.checked_shr(memory_type).is_some_and(|bits| bits & 1 == 1);
            if !fits || needs.size > memory_bytes {
                return Err(Error::options(
                    format!(
                        "memory of type {memory_type} with {memory_bytes} bytes does not take a buffer of {bytes} bytes, which needs {}",
                        needs.size
                    ),
                    "give the whole size and the type with which the memory was allocated, or fewer bytes",
                ));
            }
            // Vulkan takes ownership on import, but the binding may still fail: import a copy.
            let copy = copied(fd)?;
            let mut import = vk::ImportMemoryFdInfoKHR::default().handle_type(kind).fd(copy.as_raw_fd());
            let allocate = vk::MemoryAllocateInfo::default()
                .allocation_size(memory_bytes)
                .memory_type_index(memory_type)
                .push_next(&mut import);
            made.memory = device.allocate_memory(&allocate, None).map_err(refused)?;
            let _ = copy.into_raw_fd();
            device.bind_buffer_memory(buffer, made.memory, 0).map_err(refused)?;
            drop(OwnedFd::from_raw_fd(fd));
            gpu.name(buffer, "imported");
            Ok(Imported(Arc::new(made)))
        }
    }

    /// The buffer, for the application's own passes.
    pub fn buffer(&self) -> vk::Buffer {
        self.0.buffer
    }

    /// The whole buffer as an external range.
    ///
    /// # Errors
    /// Its size is not a multiple of 4.
    pub fn lend(&self) -> Result<ExternalBuffer> {
        // SAFETY: the buffer has all usages, belongs to the device that `is_on` compares, and is kept alive by the
        // range.
        let external = unsafe { ExternalBuffer::new(self.0.buffer, 0, self.0.bytes)? };
        Ok(ExternalBuffer { imported: Some(self.clone()), ..external })
    }
}

/// A duplicate of a file descriptor.
fn copied(fd: RawFd) -> Result<OwnedFd> {
    let none = |e: std::io::Error| {
        Error::options(
            format!("{fd} is not a valid file descriptor ({e})"),
            "give the descriptor of the exported memory",
        )
    };
    if fd < 0 {
        return Err(none(std::io::ErrorKind::InvalidInput.into()));
    }
    // SAFETY: it is borrowed for this call only; the system refuses one that is not open.
    unsafe { BorrowedFd::borrow_raw(fd) }.try_clone_to_owned().map_err(none)
}

impl Drop for ImportedMemory {
    fn drop(&mut self) {
        if self.gpu.has_hung() {
            return;
        }
        // SAFETY: created by this value; the frames that used it are finished.
        unsafe {
            self.gpu.raw().destroy_buffer(self.buffer, None);
            self.gpu.raw().free_memory(self.memory, None);
        }
    }
}

impl Gpu {
    /// Waits until a timeline point is reached, at most for `limit`. Returns whether it was reached.
    ///
    /// # Errors
    /// The device fails.
    pub fn wait_for(&self, moment: TimelinePoint, limit: Duration) -> Result<bool> {
        let (semaphores, values) = ([moment.semaphore], [moment.value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        let limit = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: the creator of the timeline point guarantees the semaphore's lifetime.
        match unsafe { self.raw().wait_semaphores(&info, limit) } {
            Ok(()) => Ok(true),
            Err(vk::Result::TIMEOUT) => Ok(false),
            Err(e) => Err(self.failed("waiting for an external semaphore", e)),
        }
    }

    /// Signals a timeline point from the host.
    ///
    /// # Errors
    /// The device fails.
    pub fn signal(&self, moment: TimelinePoint) -> Result<()> {
        let info = vk::SemaphoreSignalInfo::default().semaphore(moment.semaphore).value(moment.value);
        // SAFETY: the creator of the timeline point guarantees the semaphore's lifetime and an increasing value.
        unsafe { self.raw().signal_semaphore(&info) }
            .map_err(|e| self.failed("signalling an external semaphore", e))
    }
}

impl DeviceExecutor {
    /// As [`crate::Executor::copy_external`].
    pub fn copy_external(
        &mut self,
        from: &ExternalBuffer,
        to: Buffer,
        [after, taken]: [Option<TimelinePoint>; 2],
    ) -> Result<Ticket> {
        let target = *self.arena.get(to);
        assert!(
            from.bytes <= target.bytes,
            "{} bytes of an external buffer do not fit into `{to}`, which has {}",
            from.bytes,
            target.bytes
        );
        let region = [vk::BufferCopy { src_offset: from.offset, dst_offset: 0, size: from.bytes }];
        self.submit_between([after, taken], [&[], &[to]], |device, c| {
            // SAFETY: the creator of the range guarantees that it is readable; the region fits into the target.
            unsafe { device.cmd_copy_buffer(c, from.buffer, target.handle, &region) }
        })
    }

    /// As [`crate::Executor::write_external`].
    pub fn write_external(
        &mut self,
        content: &[u8],
        through: Buffer,
        to: &ExternalBuffer,
        done: Option<TimelinePoint>,
    ) -> Result<()> {
        let bytes = content.len() as u64;
        assert!(
            bytes <= to.bytes && bytes.is_multiple_of(4),
            "{bytes} bytes do not fit into {} bytes of an external buffer",
            to.bytes
        );
        self.settle()?;
        let source = *self.arena.get(through);
        let parts = content.chunks(source.bytes as usize / 4 * 4);
        let last = parts.len().saturating_sub(1);
        for (i, part) in parts.enumerate() {
            self.write(through, part);
            let dst_offset = to.offset + i as u64 * (source.bytes / 4 * 4);
            let region = [vk::BufferCopy { src_offset: 0, dst_offset, size: part.len() as u64 }];
            let moments = [None, done.filter(|_| i == last)];
            let ticket = self.submit_between(moments, [&[through], &[]], |device, c| {
                // SAFETY: the creator of the range guarantees that it is writable; the part fits into `through`.
                unsafe { device.cmd_copy_buffer(c, source.handle, to.buffer, &region) }
            })?;
            self.wait(ticket)?;
        }
        Ok(())
    }
}
