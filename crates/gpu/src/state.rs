//! Work on whole buffers outside schedules: saves and restores their content, and fills fresh memory with poison.

use ash::vk;

use super::executor::Executor;
use super::flight::{Moment, Ticket};
use super::memory::Made;
use super::names::Buffer;
use super::place::Place;
use crate::Result;

impl Executor {
    /// Runs what `write` records, and waits. It uses the buffers `reads` and `writes`.
    pub(super) fn at_once(
        &mut self,
        [reads, writes]: [&[Buffer]; 2],
        write: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) -> Result<()> {
        let ticket = self.submit_between([None; 2], [reads, writes], write)?;
        self.wait(ticket)
    }

    /// Submits what `write` records, after a caller's first moment, and before the second, which it brings about. It uses
    /// the buffers `reads` and `writes`.
    pub(super) fn submit_between(
        &mut self,
        moments: [Option<Moment>; 2],
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
        // SAFETY: the command buffer is not in flight; what `write` records is this executor's own.
        let recorded = unsafe {
            device.begin_command_buffer(commands, &begin).and_then(|()| {
                barrier(commands);
                write(device, commands);
                barrier(commands);
                device.end_command_buffer(commands)
            })
        };
        if let Err(e) = recorded {
            self.land(flight);
            return Err(gpu.failed("recording", e));
        }
        self.launch(flight)
    }

    /// Reads a device buffer through the readback buffer `through`, whose content is lost. Waits for all earlier
    /// submissions.
    ///
    /// # Errors
    /// The device fails.
    ///
    /// # Panics
    /// The arena has no such buffers.
    pub fn download(&mut self, buffer: Buffer, through: Buffer) -> Result<Vec<u8>> {
        let (from, to) = (self.arena.get(buffer), self.arena.get(through));
        let (bytes, part, from, to) = (from.bytes, to.bytes, from.handle, to.handle);
        let mut all = Vec::with_capacity(bytes as usize);
        for offset in (0..bytes).step_by(part as usize) {
            let size = part.min(bytes - offset);
            let region = [vk::BufferCopy { src_offset: offset, dst_offset: 0, size }];
            self.at_once([&[buffer], &[through]], |device, c| {
                // SAFETY: both buffers live as long as the executor, and the region lies within them.
                unsafe { device.cmd_copy_buffer(c, from, to, &region) }
            })?;
            all.extend(self.read::<u8>(through, ..size as usize));
        }
        Ok(all)
    }

    /// Writes `content` to the beginning of a device buffer, through the upload buffer `through`. Waits for all earlier
    /// submissions, which may use that.
    ///
    /// # Errors
    /// The device fails.
    ///
    /// # Panics
    /// `content` is longer than the buffer, or the arena has no such buffers.
    pub fn restore(&mut self, buffer: Buffer, content: &[u8], through: Buffer) -> Result<()> {
        assert!(content.len() as u64 <= self.arena.get(buffer).bytes, "restoring beyond `{buffer}`");
        self.settle()?;
        let (from, to) = (self.arena.get(through).handle, self.arena.get(buffer).handle);
        let part = self.arena.size(through) as usize;
        for (i, piece) in content.chunks(part).enumerate() {
            self.write(through, piece);
            let dst_offset = (i * part) as u64;
            let region = [vk::BufferCopy { src_offset: 0, dst_offset, size: piece.len() as u64 }];
            self.at_once([&[through], &[buffer]], |device, c| {
                // SAFETY: as in `download`.
                unsafe { device.cmd_copy_buffer(c, from, to, &region) }
            })?;
        }
        Ok(())
    }

    /// Fills every buffer with the poison word of the tests, so that reads of unwritten memory show.
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
        self.at_once([&[], &[]], |device, c| {
            for (_, b) in all.iter().filter(|(_, b)| b.place == Place::Device) {
                let [offset, bytes] = part(b);
                // SAFETY: the buffers live as long as the executor, and the part lies within.
                unsafe { device.cmd_fill_buffer(c, b.handle, offset, bytes, word) };
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Arena, BufferPlan, Faults, Gpu, GpuOptions};

    const STATE: Buffer = Buffer::named("state");
    const UP: Buffer = Buffer::named("up");
    const DOWN: Buffer = Buffer::named("down");

    #[test]
    fn poison_arrives_and_contents_come_back_in_parts() {
        let faults = Faults { poison: Some(0xdead_beef), ..Faults::default() };
        let gpu = Gpu::open(&GpuOptions { faults, ..GpuOptions::default() }).expect("a Vulkan device");
        let plan = [
            BufferPlan::new(STATE, 1000, Place::Device),
            BufferPlan::new(UP, 256, Place::Upload),
            BufferPlan::new(DOWN, 64, Place::Readback),
        ];
        let mut executor = Executor::new(&gpu, Arena::new(&gpu, &plan, None).unwrap()).unwrap();
        let fresh = executor.download(STATE, DOWN).unwrap();
        assert!(fresh.len() == 1000 && fresh.chunks(4).all(|w| w == 0xdead_beef_u32.to_le_bytes()));
        assert!(executor.read::<u32>(UP, ..).iter().all(|w| *w == 0xdead_beef));
        let content: Vec<u8> = (0..1000u32).map(|i| (i * 7 % 251) as u8).collect();
        executor.restore(STATE, &content, UP).unwrap();
        assert_eq!(executor.download(STATE, DOWN).unwrap(), content);
        drop(executor);
        assert_eq!(gpu.allocated(), 0);
    }
}
