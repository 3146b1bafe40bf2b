//! A caller's buffers and semaphores, and memory that other programs and interfaces share.

use std::os::fd::{AsRawFd, BorrowedFd, FromRawFd, IntoRawFd, OwnedFd, RawFd};
use std::sync::Arc;
use std::time::Duration;

use ash::vk;

use crate::device::Gpu;
use crate::executor::Executor;
use crate::flight::{Moment, Ticket};
use crate::names::Buffer;
use crate::{Error, Result};

/// A part of a buffer that a caller lends.
#[derive(Clone)]
pub struct Lent {
    pub(crate) buffer: vk::Buffer,
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
    /// Imported memory lives as long as it is lent.
    imported: Option<Imported>,
}

impl Lent {
    /// `bytes` bytes of `buffer` from byte `offset` on; both are multiples of 4.
    ///
    /// # Errors
    /// They are not.
    ///
    /// # Safety
    /// The buffer belongs to the device on which it is used, has memory, is so large, and lives until the frames that name it
    /// are over. It has VK_BUFFER_USAGE_TRANSFER_SRC_BIT to be read, VK_BUFFER_USAGE_TRANSFER_DST_BIT to be written. It is
    /// shared with the queue's family, or belongs to it. Nobody writes it while a frame reads it, and nobody uses it while
    /// a frame writes it.
    pub unsafe fn new(buffer: vk::Buffer, offset: u64, bytes: u64) -> Result<Lent> {
        if !offset.is_multiple_of(4) || !bytes.is_multiple_of(4) || bytes == 0 {
            return Err(Error::options(
                format!("{bytes} bytes of a buffer from byte {offset} on"),
                "give whole words of 4 bytes, at least one",
            ));
        }
        Ok(Lent { buffer, offset, bytes, imported: None })
    }

    /// Its size.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether it is on this device, as far as that can be known.
    pub fn is_on(&self, gpu: &Gpu) -> bool {
        self.imported.as_ref().is_none_or(|i| i.0.gpu.is(gpu))
    }
}

/// A buffer over memory of another program or interface (CUDA, another Vulkan device of the same GPU, a driver), which gave
/// a file descriptor for it. Clones are handles of the same buffer; it goes with the last one, and with the last frame that
/// uses it.
#[derive(Clone)]
pub struct Imported(Arc<Memory>);

struct Memory {
    gpu: Gpu,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    bytes: u64,
}

impl Imported {
    /// Imports `bytes` bytes of the memory behind an opaque file descriptor (VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT).
    /// `memory_bytes` is the size of the whole memory as it was allocated, and `memory_type` the index of its type, which
    /// Vulkan asks to be the same; `None` takes the lowest that fits. The descriptor belongs to this afterwards, if this
    /// succeeds; else it is as before.
    ///
    /// # Errors
    /// The device does not import memory, or not this memory.
    ///
    /// # Safety
    /// The descriptor is one of memory of this GPU, of so many bytes.
    pub unsafe fn by_fd(
        gpu: &Gpu,
        fd: i32,
        [memory_bytes, bytes]: [u64; 2],
        memory_type: Option<u32>,
    ) -> Result<Imported> {
        let refused = |e: vk::Result| {
            Error::memory(
                format!("{} does not import {bytes} bytes of memory ({e})", gpu.info.name),
                "export it from the same GPU as an opaque file descriptor, and give its whole size",
            )
        };
        if gpu.external_memory.is_none() {
            return Err(Error::device(
                format!(
                    "{} imports no memory: VK_KHR_external_memory_fd is missing or not enabled",
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
            // The buffer goes on every failure from here on, and the memory with it once there is some.
            let mut made = Memory { gpu: gpu.clone(), buffer, memory: vk::DeviceMemory::null(), bytes };
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
            // Vulkan takes the descriptor when it imports, but the binding may still fail: it gets a copy.
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

    /// The buffer, for passes of the caller's own.
    pub fn buffer(&self) -> vk::Buffer {
        self.0.buffer
    }

    /// All of it, to lend.
    ///
    /// # Errors
    /// Its size is no multiple of 4.
    pub fn lend(&self) -> Result<Lent> {
        // SAFETY: the buffer has all usages, is of the device that `is_on` names, and is kept by what is lent.
        let lent = unsafe { Lent::new(self.0.buffer, 0, self.0.bytes)? };
        Ok(Lent { imported: Some(self.clone()), ..lent })
    }
}

/// Another descriptor of the same file.
fn copied(fd: RawFd) -> Result<OwnedFd> {
    let none = |e: std::io::Error| {
        Error::options(
            format!("{fd} is no file descriptor ({e})"),
            "give the one that the memory was exported to",
        )
    };
    if fd < 0 {
        return Err(none(std::io::ErrorKind::InvalidInput.into()));
    }
    // SAFETY: it is borrowed for this call only; the system refuses one that is not open.
    unsafe { BorrowedFd::borrow_raw(fd) }.try_clone_to_owned().map_err(none)
}

impl Drop for Memory {
    fn drop(&mut self) {
        if self.gpu.has_hung() {
            return;
        }
        // SAFETY: made by this, and the frames that used it are over.
        unsafe {
            self.gpu.raw().destroy_buffer(self.buffer, None);
            self.gpu.raw().free_memory(self.memory, None);
        }
    }
}

impl Gpu {
    /// Waits until a moment has come, but no longer than `limit`. Whether it has.
    ///
    /// # Errors
    /// The device fails.
    pub fn wait_for(&self, moment: Moment, limit: Duration) -> Result<bool> {
        let (semaphores, values) = ([moment.semaphore], [moment.value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        let limit = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: who made the moment promised that the semaphore lives.
        match unsafe { self.raw().wait_semaphores(&info, limit) } {
            Ok(()) => Ok(true),
            Err(vk::Result::TIMEOUT) => Ok(false),
            Err(e) => Err(self.failed("waiting for a caller's semaphore", e)),
        }
    }

    /// Signals a moment from the host.
    ///
    /// # Errors
    /// The device fails.
    pub fn signal(&self, moment: Moment) -> Result<()> {
        let info = vk::SemaphoreSignalInfo::default().semaphore(moment.semaphore).value(moment.value);
        // SAFETY: who made the moment promised that the semaphore lives, and that its value is larger than those before.
        unsafe { self.raw().signal_semaphore(&info) }
            .map_err(|e| self.failed("signalling a caller's semaphore", e))
    }
}

impl Executor {
    /// Copies the lent bytes into the beginning of the device buffer `to`, after everything that was submitted and after the
    /// moment `after`. Brings the moment `taken` about when they are copied. Returns without waiting.
    ///
    /// # Errors
    /// The device fails. Then neither `taken` has come, nor will it.
    ///
    /// # Panics
    /// `to` is smaller, or the arena has no such buffer.
    pub fn take_lent(
        &mut self,
        from: &Lent,
        to: Buffer,
        [after, taken]: [Option<Moment>; 2],
    ) -> Result<Ticket> {
        let target = *self.arena.get(to);
        assert!(
            from.bytes <= target.bytes,
            "{} lent bytes are taken into `{to}`, which has {}",
            from.bytes,
            target.bytes
        );
        let region = [vk::BufferCopy { src_offset: from.offset, dst_offset: 0, size: from.bytes }];
        self.submit_between([after, taken], [&[], &[to]], |device, c| {
            // SAFETY: who lent the buffer promised that it can be read so far; the region fits into the target.
            unsafe { device.cmd_copy_buffer(c, from.buffer, target.handle, &region) }
        })
    }

    /// Writes `content` into the beginning of a lent buffer through the upload buffer `through`, after everything that was
    /// submitted, and waits. Brings the moment `done` about when it is written.
    ///
    /// # Errors
    /// The device fails. Then `done` has not come.
    ///
    /// # Panics
    /// `content` is longer than what is lent, or is no whole number of words.
    pub fn give_lent(
        &mut self,
        content: &[u8],
        through: Buffer,
        to: &Lent,
        done: Option<Moment>,
    ) -> Result<()> {
        let bytes = content.len() as u64;
        assert!(
            bytes <= to.bytes && bytes.is_multiple_of(4),
            "{bytes} bytes are given into {} lent bytes",
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
                // SAFETY: who lent the buffer promised that it can be written so far; the part fits into `through`.
                unsafe { device.cmd_copy_buffer(c, source.handle, to.buffer, &region) }
            })?;
            self.wait(ticket)?;
        }
        Ok(())
    }
}
