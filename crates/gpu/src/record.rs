//! Recording and submission of schedules: barriers at hazards, labels, timestamps.

use ash::vk;

use super::access::sizes_of;
use super::executor::{DeviceExecutor, Scratch, stamps};
use super::flight::{Flight, Mark, Ticket};
use super::names::Kernel;
use super::pipelines::Pipeline;
use super::schedule::{Binds, Command, Schedule, Size, Stage};
use super::shuffle::pieces;
use crate::Result;

/// A recording step: a command, or the start or end of a label.
#[derive(Debug, PartialEq)]
enum RecordingStep<'s> {
    /// Starts a label for the stage.
    Enter(&'s Stage),
    /// Starts a label.
    Open(&'static str),
    /// Ends the innermost label.
    Close,
    Run(&'s Command),
}

/// The commands with a label around each and around each stage. `open`: the stage continued from an earlier
/// submission.
fn steps<'s>(commands: &'s [Command], open: Option<&'s Stage>) -> impl Iterator<Item = RecordingStep<'s>> {
    let mut in_stage = open.is_some();
    let last = in_stage || commands.iter().any(|c| matches!(c, Command::Stage(_)));
    let of_command = move |command: &'s Command| match command {
        Command::Stage(stage) => {
            let before = std::mem::replace(&mut in_stage, true).then_some(RecordingStep::Close);
            [before, Some(RecordingStep::Enter(stage)), None]
        }
        _ => {
            [RecordingStep::Open(command.name()), RecordingStep::Run(command), RecordingStep::Close].map(Some)
        }
    };
    let all = commands.iter().flat_map(of_command).flatten();
    open.map(RecordingStep::Enter).into_iter().chain(all).chain(last.then_some(RecordingStep::Close))
}

impl DeviceExecutor {
    /// Submits a part of a schedule. `open`: the stage continued from the previous part.
    pub(super) fn submit_part(&mut self, part: &[Command], open: Option<&Stage>) -> Result<Ticket> {
        let commands = self.command_buffer()?;
        let (queries, room) = match self.query_pool(part) {
            Ok(queries) => queries,
            Err(e) => {
                self.spare.push(commands);
                return Err(e);
            }
        };
        let mut flight = self.flight(commands);
        (flight.queries, flight.room) = (queries, room);
        flight.continues_stage = open.is_some();
        let mut names = part.iter().filter(|c| !matches!(c, Command::Stage(_))).map(Command::name);
        let first = names.next().unwrap_or_default();
        flight.ends = [first, names.next_back().unwrap_or(first)];
        flight.work = part.iter().map(Command::work).fold(0, u64::saturating_add);
        let gpu = self.gpu.clone();
        let recorded = {
            let _span = gpu.span("record");
            self.record(part, open, &mut flight)
        };
        match recorded {
            Ok(()) => self.launch(flight),
            Err(e) => {
                self.recycle(flight);
                Err(e)
            }
        }
    }

    /// Records `commands`. `open`: the stage continued from an earlier submission.
    fn record(&mut self, commands: &[Command], open: Option<&Stage>, flight: &mut Flight) -> Result<()> {
        let gpu = self.gpu.clone();
        let device = gpu.raw();
        let c = flight.commands;
        let failed = |e| gpu.failed("recording", e);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let queries = flight.queries;
        let timed = queries != vk::QueryPool::null();
        let mut taken = 0;
        let mut stamp = || {
            if timed {
                // SAFETY: `taken` is below the pool's size, see `stamps`. A timestamp waits for earlier commands and
                // does not delay later ones.
                unsafe {
                    device.cmd_write_timestamp(c, vk::PipelineStageFlags::BOTTOM_OF_PIPE, queries, taken)
                };
                taken += 1;
            }
            taken.saturating_sub(1)
        };
        // SAFETY: the command buffer is not in flight; all recorded handles outlive it.
        unsafe {
            device.begin_command_buffer(c, &begin).map_err(failed)?;
            if timed {
                device.cmd_reset_query_pool(c, queries, 0, stamps(commands, gpu.recorder.is_some()));
            }
            // Makes the writes of earlier submissions visible.
            barrier(device, c, Seen::BY_SIZES);
            // At this timestamp, all dependencies of the next command are complete.
            let mut last = stamp();
            let Scratch { mut now, mut pending, mut sizes, stamps } = std::mem::take(&mut self.scratch);
            pending.clear();
            sizes_of(commands, &mut sizes);
            let mut labels = 0;
            for step in steps(commands, open) {
                match step {
                    RecordingStep::Enter(stage) => {
                        labels += 1;
                        gpu.open_label(c, &stage);
                        if gpu.recorder.is_some() {
                            flight.stages.push(*stage);
                        }
                    }
                    RecordingStep::Open(name) => {
                        labels += 1;
                        gpu.open_label(c, &name);
                    }
                    RecordingStep::Close => {
                        labels -= 1;
                        gpu.close_label(c);
                    }
                    RecordingStep::Run(command) => {
                        now.take(command, |kernel| self.pipeline(kernel).bindings);
                        self.share(flight, &now.reads, &now.writes);
                        if pending.conflicts(&now) {
                            let by_sizes = pending.write_any(&sizes);
                            barrier(device, c, if by_sizes { Seen::BY_SIZES } else { Seen::BY_KERNELS });
                            pending.clear();
                            if gpu.recorder.is_some() {
                                last = stamp();
                            }
                        }
                        pending.add(&now);
                        self.record_one(c, command)?;
                        if gpu.recorder.is_some() {
                            let from = last;
                            last = stamp();
                            let stage = flight.stages.len().checked_sub(1);
                            flight.marks.push(Mark { kernel: command.name(), stage, from, to: last });
                        }
                    }
                }
            }
            debug_assert_eq!(labels, 0, "as many labels are closed as were opened");
            self.scratch = Scratch { now, pending, sizes, stamps };
            let [_, writes] = &flight.shared;
            if !writes.is_empty() {
                barrier(device, c, Seen::BY_HOST);
            }
            stamp();
            flight.stamps = taken;
            device.end_command_buffer(c).map_err(failed)
        }
    }

    fn pipeline(&self, kernel: Kernel) -> &Pipeline {
        self.pipelines.get(&kernel).unwrap_or_else(|| panic!("no kernel `{kernel}` was added"))
    }

    /// Creates the descriptor sets required to submit `schedule`.
    ///
    /// # Errors
    /// The device fails.
    ///
    /// # Panics
    /// A kernel was not added, or a buffer is not in the arena.
    pub fn reserve(&mut self, schedule: &Schedule) -> Result<()> {
        for command in &schedule.commands {
            if let Command::Dispatch { kernel, bind, .. } = command {
                self.set_of(*kernel, bind)?;
            }
        }
        Ok(())
    }

    /// The descriptor set of a kernel's buffers.
    fn set_of(&mut self, kernel: Kernel, bind: &Binds) -> Result<vk::DescriptorSet> {
        let pipeline =
            self.pipelines.get(&kernel).unwrap_or_else(|| panic!("no kernel `{kernel}` was added"));
        self.sets.get(&self.gpu, &self.arena, pipeline, bind)
    }

    unsafe fn record_one(&mut self, c: vk::CommandBuffer, command: &Command) -> Result<()> {
        let gpu = self.gpu.clone();
        let device = gpu.raw();
        // SAFETY: see `record`, the only caller; sizes are asserted against the buffers.
        unsafe {
            match command {
                Command::Dispatch { kernel, size, bind, push, first, .. } => {
                    let set = self.set_of(*kernel, bind)?;
                    let pipeline = self.pipeline(*kernel);
                    let point = vk::PipelineBindPoint::COMPUTE;
                    device.cmd_bind_pipeline(c, point, pipeline.handle);
                    device.cmd_bind_descriptor_sets(c, point, pipeline.layout, 0, &[set], &[]);
                    let stage = vk::ShaderStageFlags::COMPUTE;
                    device.cmd_push_constants(c, pipeline.layout, stage, 0, bytemuck::cast_slice(push));
                    match size {
                        Size::Groups(g) => {
                            let most = self.gpu.limits.groups;
                            assert!(
                                (0..3).all(|i| first[i] + g[i] <= most[i]),
                                "`{kernel}`: {g:?} workgroups from {first:?} on, at most {most:?}"
                            );
                            let from_base = |at: [u32; 3], n: [u32; 3]| {
                                let [x, y, z] = [0, 1, 2].map(|i| first[i] + at[i]);
                                device.cmd_dispatch_base(c, x, y, z, n[0], n[1], n[2]);
                            };
                            match self.gpu.faults().shuffle {
                                None if *first == [0; 3] => device.cmd_dispatch(c, g[0], g[1], g[2]),
                                None => from_base([0; 3], *g),
                                Some(seed) => {
                                    pieces(*g, seed).into_iter().for_each(|[at, n]| from_base(at, n));
                                }
                            }
                        }
                        Size::Indirect(buffer, offset, _) => {
                            let b = self.arena.get(*buffer);
                            assert!(offset + 12 <= b.bytes, "`{kernel}`: arguments beyond `{buffer}`");
                            device.cmd_dispatch_indirect(c, b.handle, *offset);
                        }
                    }
                }
                Command::Copy { from, from_offset, to, to_offset, bytes } => {
                    let (a, b) = (self.arena.get(*from), self.arena.get(*to));
                    assert!(
                        from_offset + bytes <= a.bytes && to_offset + bytes <= b.bytes,
                        "copy {from} -> {to}"
                    );
                    let region =
                        vk::BufferCopy { src_offset: *from_offset, dst_offset: *to_offset, size: *bytes };
                    device.cmd_copy_buffer(c, a.handle, b.handle, &[region]);
                }
                Command::Fill { buffer, offset, bytes, value } => {
                    let b = self.arena.get(*buffer);
                    assert!(offset + bytes <= b.bytes, "fill beyond `{buffer}`");
                    device.cmd_fill_buffer(c, b.handle, *offset, *bytes, *value);
                }
                Command::Stage(_) => {}
            }
        }
        Ok(())
    }
}

/// Destination scope of a barrier. Host and indirect reads are separate: some GPUs flush caches or stall their front
/// end for them.
struct Seen(vk::PipelineStageFlags, vk::AccessFlags);

const UNITS: vk::PipelineStageFlags = vk::PipelineStageFlags::from_raw(
    vk::PipelineStageFlags::COMPUTE_SHADER.as_raw() | vk::PipelineStageFlags::TRANSFER.as_raw(),
);

impl Seen {
    /// Kernels, copies and fills.
    const BY_KERNELS: Seen = Seen(
        UNITS,
        vk::AccessFlags::from_raw(
            vk::AccessFlags::SHADER_READ.as_raw()
                | vk::AccessFlags::SHADER_WRITE.as_raw()
                | vk::AccessFlags::UNIFORM_READ.as_raw()
                | vk::AccessFlags::TRANSFER_READ.as_raw()
                | vk::AccessFlags::TRANSFER_WRITE.as_raw(),
        ),
    );
    /// These, and indirect reads.
    const BY_SIZES: Seen = Seen(
        vk::PipelineStageFlags::from_raw(UNITS.as_raw() | vk::PipelineStageFlags::DRAW_INDIRECT.as_raw()),
        vk::AccessFlags::from_raw(
            Seen::BY_KERNELS.1.as_raw() | vk::AccessFlags::INDIRECT_COMMAND_READ.as_raw(),
        ),
    );
    /// The host.
    const BY_HOST: Seen = Seen(vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_READ);
}

/// Waits for all earlier commands and makes their writes visible to `seen`.
unsafe fn barrier(device: &ash::Device, c: vk::CommandBuffer, Seen(after, read): Seen) {
    let memory = [vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(read)];
    // SAFETY: the caller is recording into `c`.
    unsafe { device.cmd_pipeline_barrier(c, UNITS, after, vk::DependencyFlags::empty(), &memory, &[], &[]) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Buffer;

    #[test]
    fn every_command_has_a_label_inside_its_stage_and_all_are_closed() {
        let mut s = Schedule::default();
        s.dispatch(Kernel::named("before"), [1, 1, 1], 1);
        s.stage("iteration", &[("iteration", 4), ("lateral", 32)]);
        s.dispatch(Kernel::named("forward"), [1, 1, 1], 1);
        s.fill(Buffer::named("counts"), 4, 0);
        s.stage("domain", &[]);
        s.dispatch(Kernel::named("threshold"), [1, 1, 1], 1);
        let (mut open, mut seen) = (vec![], vec![]);
        for step in steps(&s.commands, None) {
            match step {
                RecordingStep::Enter(stage) => open.push(stage.to_string()),
                RecordingStep::Open(name) => open.push(name.to_string()),
                RecordingStep::Close => assert!(open.pop().is_some(), "closed before it was opened"),
                RecordingStep::Run(_) => seen.push(open.join(" / ")),
            }
        }
        assert!(open.is_empty(), "left open: {open:?}");
        let iteration = "iteration iteration=4 lateral=32";
        let want = [
            "before",
            &format!("{iteration} / forward"),
            &format!("{iteration} / fill"),
            "domain / threshold",
        ];
        assert_eq!(seen, want);
    }
}
