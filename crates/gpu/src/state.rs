//! Operations on whole buffers outside schedules: poisoning of fresh memory.

use ash::vk;

use super::executor::DeviceExecutor;
use super::flight::{Ticket, TimelinePoint};
use super::memory::Made;
use super::names::Buffer;
use super::place::Place;
use crate::Result;

impl DeviceExecutor {
    /// Executes the commands recorded by `write`, and waits. `reads` and `writes` are their buffers.
    pub(super) fn run_now(
        &mut self,
        [reads, writes]: [&[Buffer]; 2],
        write: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) -> Result<()> {
        let ticket = self.submit_between([None; 2], [reads, writes], write)?;
        self.wait(ticket)
    }

    /// Submits the commands recorded by `write`, after the first external timeline point, and signals the second.
    /// `reads` and `writes` are their buffers.
    pub(super) fn submit_between(
        &mut self,
        moments: [Option<TimelinePoint>; 2],
        [reads, writes]: [&[Buffer]; 2],
        write: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) -> Result<Ticket> {
        let commands = self.command_buffer()?;
        let mut flight = self.flight(commands);
        flight.between = moments;
        flight.ends = ["copies"; 2];
        self.share(&mut flight, reads, writes);
        let gpu = self.gpu.clone();
        let device = gpu.raw();
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let all = vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE;
        let memory = [vk::MemoryBarrier::default().src_access_mask(all).dst_access_mask(all)];
        let barrier = |c| {
            let stages = vk::PipelineStageFlags::ALL_COMMANDS | vk::PipelineStageFlags::HOST;
            let none = vk::DependencyFlags::empty();
            // SAFETY: the caller is recording into `c`.
            unsafe { device.cmd_pipeline_barrier(c, stages, stages, none, &memory, &[], &[]) };
        };
        // SAFETY: the command buffer is not in flight; `write` records this executor's own objects.
        let recorded = unsafe {
            device.begin_command_buffer(commands, &begin).and_then(|()| {
                barrier(commands);
                write(device, commands);
                barrier(commands);
                device.end_command_buffer(commands)
            })
        };
        if let Err(e) = recorded {
            self.recycle(flight);
            return Err(gpu.failed("recording", e));
        }
        self.launch(flight)
    }

    /// Fills every buffer with the poison word, so that reads of unwritten memory are visible.
    pub(super) fn poison(&mut self) -> Result<()> {
        let Some(word) = self.gpu.faults().poison else { return Ok(()) };
        self.fill_all(word, |b| [0, b.bytes])
    }

    /// Fills a part of every buffer (offset and bytes), and waits.
    pub(super) fn fill_all(&mut self, word: u32, part: impl Fn(&Made) -> [u64; 2]) -> Result<()> {
        let all = self.arena.buffers();
        for (buffer, b) in all.iter().filter(|(_, b)| b.place != Place::Device) {
            self.fill_shared(*buffer, part(b), word);
        }
        self.run_now([&[], &[]], |device, c| {
            for (_, b) in all.iter().filter(|(_, b)| b.place == Place::Device) {
                let [offset, bytes] = part(b);
                // SAFETY: the buffers outlive the executor, and the part is inside.
                unsafe { device.cmd_fill_buffer(c, b.handle, offset, bytes, word) };
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Arena, BufferPlan, Executor, Faults, Gpu, GpuOptions, Schedule};

    const STATE: Buffer = Buffer::named("state");
    const UP: Buffer = Buffer::named("up");
    const DOWN: Buffer = Buffer::named("down");

    #[test]
    fn poison_arrives_in_every_buffer() {
        let faults = Faults { poison: Some(0xdead_beef), ..Faults::default() };
        let gpu = Gpu::open(&GpuOptions { faults, ..GpuOptions::default() }).expect("a Vulkan device");
        let plan = [
            BufferPlan::new(STATE, 1000, Place::Device),
            BufferPlan::new(UP, 256, Place::Upload),
            BufferPlan::new(DOWN, 1000, Place::Readback),
        ];
        let mut executor = Executor::new(&gpu, Arena::new(&gpu, &plan, None).unwrap()).unwrap();
        for buffer in [UP, DOWN] {
            assert!(executor.read::<u32>(buffer, ..).iter().all(|w| *w == 0xdead_beef), "{buffer}");
        }
        executor.run(&Schedule::of(|s| s.fill(STATE, 4, 7))).unwrap();
        executor.run(&Schedule::of(|s| s.copy(STATE, DOWN, 1000))).unwrap();
        let all = executor.read::<u32>(DOWN, ..);
        assert!(all[0] == 7 && all[1..].iter().all(|w| *w == 0xdead_beef));
        drop(executor);
        assert_eq!(gpu.allocated(), 0);
    }
}
