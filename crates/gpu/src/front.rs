//! Arena and executor of an opened device, which is a Vulkan device or the host.

use std::collections::BTreeMap;
use std::ops::{ControlFlow, RangeBounds};

use super::code::KernelCode;
use super::device::Gpu;
use super::executor::{DeviceExecutor, KernelTime};
use super::external::{ExternalBuffer, TimelinePoint};
use super::flight::Ticket;
use super::host_executor::{HostArena, HostExecutor};
use super::make::KernelRequest;
use super::memory::DeviceArena;
use super::names::{Buffer, Constant, Kernel};
use super::place::BufferPlan;
use super::schedule::Schedule;
use crate::{Error, Result};

/// All buffers of one job.
pub enum Arena {
    /// Of a Vulkan device.
    Device(Box<DeviceArena>),
    /// Of the host.
    Host(HostArena),
}

impl Arena {
    /// Allocates every buffer of `plan`. `budget` limits the bytes of all buffers; default: free bytes as the driver or the
    /// system reports them.
    ///
    /// # Errors
    /// A buffer exceeds the largest binding, the plan exceeds the budget (the error names the largest buffers), or
    /// the driver refuses an allocation. Nothing remains allocated.
    pub fn new(gpu: &Gpu, plan: &[BufferPlan], budget: Option<u64>) -> Result<Arena> {
        Ok(match gpu.is_host() {
            true => Arena::Host(HostArena::new(gpu, plan, budget)?),
            false => Arena::Device(Box::new(DeviceArena::new(gpu, plan, budget)?)),
        })
    }

    /// Bytes of all buffers, including host-visible ones, excluding canaries.
    pub fn bytes(&self) -> u64 {
        match self {
            Arena::Device(arena) => arena.bytes(),
            Arena::Host(arena) => arena.bytes(),
        }
    }

    /// Bytes of memory blocks allocated for the buffers: at least [`Arena::bytes`], as small buffers share blocks.
    pub fn taken(&self) -> u64 {
        match self {
            Arena::Device(arena) => arena.taken(),
            Arena::Host(arena) => arena.bytes(),
        }
    }
}

/// Executes schedules over the buffers of an arena, in order of submission.
pub struct Executor(ExecutorKind);

enum ExecutorKind {
    Device(Box<DeviceExecutor>),
    Host(Box<HostExecutor>),
}

/// Calls a method of both executors.
macro_rules! both {
    ($kind:expr, $executor:ident => $call:expr) => {
        match $kind {
            ExecutorKind::Device($executor) => $call,
            ExecutorKind::Host($executor) => $call,
        }
    };
}

impl Executor {
    /// An executor for the buffers of `arena`, initially without kernels.
    ///
    /// # Errors
    /// The device cannot create the queue's objects.
    ///
    /// # Panics
    /// The arena is of another kind of device.
    pub fn new(gpu: &Gpu, arena: Arena) -> Result<Executor> {
        Ok(Executor(match arena {
            Arena::Device(arena) => ExecutorKind::Device(Box::new(DeviceExecutor::new(gpu, *arena)?)),
            Arena::Host(arena) => ExecutorKind::Host(Box::new(HostExecutor::new(gpu, arena))),
        }))
    }

    /// Bytes of all its buffers, including host-visible ones.
    pub fn bytes(&self) -> u64 {
        both!(&self.0, executor => executor.arena.bytes())
    }

    /// Bytes of a buffer.
    ///
    /// # Panics
    /// The plan has no such buffer.
    pub fn size(&self, buffer: Buffer) -> u64 {
        match &self.0 {
            ExecutorKind::Device(executor) => executor.arena.size(buffer),
            ExecutorKind::Host(executor) => 4 * executor.arena.words(buffer).len() as u64,
        }
    }

    /// Creates kernels concurrently, replacing kernels of the same names.
    ///
    /// # Errors
    /// The device fails.
    pub fn add_kernels(&mut self, wanted: &[KernelRequest<'_>]) -> Result<()> {
        match &mut self.0 {
            ExecutorKind::Device(executor) => executor.add_kernels(wanted),
            ExecutorKind::Host(executor) => {
                executor.add_kernels(wanted);
                Ok(())
            }
        }
    }

    /// Creates `kernel` from `code` with these specialization constants, replacing a kernel of the same name.
    ///
    /// # Errors
    /// The device fails.
    pub fn add_kernel(
        &mut self,
        kernel: impl Into<Kernel>,
        code: &KernelCode,
        constants: &[(Constant, u32)],
    ) -> Result<()> {
        self.add_kernels(&[KernelRequest { kernel: kernel.into(), code, constants: constants.to_vec() }])
    }

    /// Whether a kernel of this name exists.
    pub fn has_kernel(&self, kernel: Kernel) -> bool {
        both!(&self.0, executor => executor.has_kernel(kernel))
    }

    /// Creates the descriptor sets required to submit `schedule`.
    ///
    /// # Errors
    /// The device fails.
    ///
    /// # Panics
    /// A kernel was not added, or a buffer is not in the arena.
    pub fn reserve(&mut self, schedule: &Schedule) -> Result<()> {
        match &mut self.0 {
            ExecutorKind::Device(executor) => executor.reserve(schedule),
            ExecutorKind::Host(_) => Ok(()),
        }
    }

    /// Submits `schedule` after earlier submissions without waiting. Long schedules are divided so that no part
    /// approaches a driver's watchdog timeout; the ticket is that of the last part. On the host it is complete on return.
    ///
    /// # Errors
    /// The device fails.
    pub fn submit(&mut self, schedule: &Schedule) -> Result<Ticket> {
        match &mut self.0 {
            ExecutorKind::Device(executor) => executor.submit(schedule),
            ExecutorKind::Host(executor) => {
                executor.run(schedule, &mut || ControlFlow::Continue(()));
                Ok(executor.submitted())
            }
        }
    }

    /// As [`Executor::submit`]. Where the host's processors are the device, `hear` is called about every tenth of a second:
    /// `None` if it breaks, which leaves the rest out.
    ///
    /// # Errors
    /// The device fails.
    pub fn submit_heard(
        &mut self,
        schedule: &Schedule,
        hear: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Ticket>> {
        match &mut self.0 {
            ExecutorKind::Device(executor) => executor.submit_heard(schedule, hear),
            ExecutorKind::Host(executor) => Ok(executor.run(schedule, hear)),
        }
    }

    /// Submits a schedule and waits for it.
    ///
    /// # Errors
    /// The device fails.
    pub fn run(&mut self, schedule: &Schedule) -> Result<()> {
        let ticket = self.submit(schedule)?;
        self.wait(ticket)
    }

    /// Submits the commands that `write` adds to an empty schedule, and waits. Reuses the memory of the previous one.
    ///
    /// # Errors
    /// The device fails.
    pub fn run_once(&mut self, write: impl FnOnce(&mut Schedule)) -> Result<()> {
        let mut schedule = self.spare_schedule();
        write(&mut schedule);
        let done = self.run(&schedule);
        self.keep_schedule(schedule);
        done
    }

    /// Waits for `ticket` and all earlier submissions.
    ///
    /// # Errors
    /// The device fails, or the watchdog times out.
    pub fn wait(&mut self, ticket: Ticket) -> Result<()> {
        match &mut self.0 {
            ExecutorKind::Device(executor) => executor.wait(ticket),
            ExecutorKind::Host(_) => Ok(()),
        }
    }

    /// Waits for all submissions.
    ///
    /// # Errors
    /// As [`Executor::wait`].
    pub fn settle(&mut self) -> Result<()> {
        match &mut self.0 {
            ExecutorKind::Device(executor) => executor.settle(),
            ExecutorKind::Host(_) => Ok(()),
        }
    }

    /// An empty schedule with the memory of a kept one.
    pub fn spare_schedule(&mut self) -> Schedule {
        both!(&mut self.0, executor => executor.spare_schedule())
    }

    /// Keeps the memory of a schedule for reuse.
    pub fn keep_schedule(&mut self, schedule: Schedule) {
        both!(&mut self.0, executor => executor.keep_schedule(schedule));
    }

    /// Device seconds of all finished submissions; 0 without timestamps.
    pub fn gpu_seconds(&self) -> f64 {
        both!(&self.0, executor => executor.gpu_seconds())
    }

    /// Times by kernel of finished submissions; empty unless the device was opened with `timings`.
    pub fn times(&self) -> &BTreeMap<&'static str, KernelTime> {
        both!(&self.0, executor => executor.times())
    }

    /// Returns and resets the times by kernel.
    pub fn take_times(&mut self) -> BTreeMap<&'static str, KernelTime> {
        both!(&mut self.0, executor => executor.take_times())
    }

    /// Reads `items` of an upload or readback buffer, counted in whole `T`s.
    ///
    /// # Panics
    /// A submission that may write the buffer is pending, or the buffer is missing or too short.
    pub fn read<T: bytemuck::Pod>(&self, buffer: Buffer, items: impl RangeBounds<usize>) -> Vec<T> {
        match &self.0 {
            ExecutorKind::Device(executor) => executor.read(buffer, items),
            ExecutorKind::Host(executor) => {
                let mut read = vec![];
                executor.read_into(buffer, items, &mut read);
                read
            }
        }
    }

    /// Reads items that the submission `done` and earlier ones wrote to a part of the buffer, replacing the content
    /// of `into`. No later submission may write this part.
    ///
    /// # Panics
    /// `done` is pending, or the buffer is missing or too short.
    pub fn read_behind<T: bytemuck::Pod>(
        &self,
        done: Ticket,
        buffer: Buffer,
        items: impl RangeBounds<usize>,
        into: &mut Vec<T>,
    ) {
        match &self.0 {
            ExecutorKind::Device(executor) => executor.read_behind(done, buffer, items, into),
            ExecutorKind::Host(executor) => executor.read_into(buffer, items, into),
        }
    }

    /// Writes the start of an upload or readback buffer.
    ///
    /// # Panics
    /// As [`Executor::write_at`].
    pub fn write(&mut self, buffer: Buffer, bytes: &[u8]) {
        self.write_at(buffer, 0, bytes);
    }

    /// Writes an upload or readback buffer from byte `offset`.
    ///
    /// # Panics
    /// A submission that may access the buffer is pending, or the buffer is missing or too short.
    pub fn write_at(&mut self, buffer: Buffer, offset: u64, bytes: &[u8]) {
        both!(&mut self.0, executor => executor.write_at(buffer, offset, bytes));
    }

    /// Copies an external range to the start of the device buffer `to`, after all earlier submissions and the
    /// timeline point `after`. Signals `taken` once copied. Does not block.
    ///
    /// # Errors
    /// The device fails, or is the host; `taken` is then never signalled.
    ///
    /// # Panics
    /// `to` is smaller than the range, or not in the arena.
    pub fn copy_external(
        &mut self,
        from: &ExternalBuffer,
        to: Buffer,
        moments: [Option<TimelinePoint>; 2],
    ) -> Result<Ticket> {
        match &mut self.0 {
            ExecutorKind::Device(executor) => executor.copy_external(from, to, moments),
            ExecutorKind::Host(_) => Err(no_external()),
        }
    }

    /// Writes `content` to the start of an external range through the upload buffer `through`, after all earlier
    /// submissions, and waits. Signals `done` once written.
    ///
    /// # Errors
    /// The device fails, or is the host; `done` is then not signalled.
    ///
    /// # Panics
    /// `content` exceeds the range, or is not a whole number of words.
    pub fn write_external(
        &mut self,
        content: &[u8],
        through: Buffer,
        to: &ExternalBuffer,
        done: Option<TimelinePoint>,
    ) -> Result<()> {
        match &mut self.0 {
            ExecutorKind::Device(executor) => executor.write_external(content, through, to, done),
            ExecutorKind::Host(_) => Err(no_external()),
        }
    }
}

fn no_external() -> Error {
    Error::device("the host has no external buffers", "open the application's Vulkan device for them")
}
