//! Records schedules with the barriers that their hazards need, submits them and keeps the times.

use std::collections::{BTreeMap, HashMap, VecDeque};

use ash::vk;

use super::pipeline::{DescriptorSets, Pipeline};
use super::{Arena, Command, Gpu, KernelCode, Schedule, Size};
use crate::Result;

/// Calls and device seconds of one kernel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KernelTime {
    pub calls: u64,
    pub seconds: f64,
}

/// A submission; [`Executor::wait`] waits for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ticket(u64);

struct Flight {
    ticket: Ticket,
    commands: vk::CommandBuffer,
    queries: vk::QueryPool,
    /// Name of what lies between query i and i + 1.
    spans: Vec<&'static str>,
}

/// Runs schedules over the buffers of an arena, in order of submission.
pub struct Executor<'g> {
    gpu: &'g Gpu,
    pub arena: Arena<'g>,
    pipelines: HashMap<&'static str, Pipeline>,
    sets: DescriptorSets,
    pool: vk::CommandPool,
    timeline: vk::Semaphore,
    submitted: u64,
    flights: VecDeque<Flight>,
    spare: Vec<vk::CommandBuffer>,
    times: BTreeMap<&'static str, KernelTime>,
    gpu_seconds: f64,
}

impl<'g> Executor<'g> {
    pub fn new(gpu: &'g Gpu, arena: Arena<'g>) -> Result<Executor<'g>> {
        let device = gpu.raw();
        let flags = vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER;
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.family).flags(flags);
        let failed = |e| gpu.failed("starting", e);
        // SAFETY: the device is alive; what is made here is destroyed in drop.
        let pool = unsafe { device.create_command_pool(&info, None) }.map_err(failed)?;
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        let timeline = unsafe { device.create_semaphore(&info, None) };
        let timeline =
            timeline.inspect_err(|_| unsafe { device.destroy_command_pool(pool, None) }).map_err(failed)?;
        gpu.name(timeline, "timeline");
        Ok(Executor {
            gpu,
            arena,
            pipelines: HashMap::new(),
            sets: DescriptorSets::new(),
            pool,
            timeline,
            submitted: 0,
            flights: VecDeque::new(),
            spare: vec![],
            times: BTreeMap::new(),
            gpu_seconds: 0.0,
        })
    }

    /// Makes kernel `name` from `code` with some specialization constants set.
    pub fn add_kernel(
        &mut self,
        name: &'static str,
        code: &KernelCode,
        constants: &[(&str, u32)],
    ) -> Result<()> {
        let made = Pipeline::new(self.gpu, name, code, constants)?;
        if let Some(old) = self.pipelines.insert(name, made) {
            old.destroy(self.gpu);
        }
        Ok(())
    }

    /// Submits `schedule` behind what was submitted before, and returns without waiting for it.
    pub fn submit(&mut self, schedule: &Schedule) -> Result<Ticket> {
        let commands = self.command_buffer()?;
        let queries = self.query_pool(schedule)?;
        let mut flight = Flight { ticket: Ticket(self.submitted + 1), commands, queries, spans: vec![] };
        self.record(schedule, &mut flight)?;
        let values = [flight.ticket.0];
        let semaphores = [self.timeline];
        let buffers = [commands];
        let mut timeline = vk::TimelineSemaphoreSubmitInfo::default().signal_semaphore_values(&values);
        let info = [vk::SubmitInfo::default()
            .command_buffers(&buffers)
            .signal_semaphores(&semaphores)
            .push_next(&mut timeline)];
        let device = self.gpu.raw();
        // SAFETY: the command buffer is recorded and not in flight; one thread owns the queue (`&mut self`).
        unsafe { device.queue_submit(self.gpu.queue, &info, vk::Fence::null()) }
            .map_err(|e| self.gpu.failed("submitting work", e))?;
        self.submitted = flight.ticket.0;
        let ticket = flight.ticket;
        self.flights.push_back(flight);
        Ok(ticket)
    }

    /// Waits until `ticket` and all before it are done.
    pub fn wait(&mut self, ticket: Ticket) -> Result<()> {
        let semaphores = [self.timeline];
        let values = [ticket.0];
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is alive.
        unsafe { self.gpu.raw().wait_semaphores(&info, u64::MAX) }
            .map_err(|e| self.gpu.failed("computing", e))?;
        while self.flights.front().is_some_and(|f| f.ticket <= ticket) {
            let flight = self.flights.pop_front().expect("just seen");
            self.read_times(&flight)?;
            self.spare.push(flight.commands);
            unsafe { self.gpu.raw().destroy_query_pool(flight.queries, None) };
        }
        Ok(())
    }

    /// Submits and waits.
    pub fn run(&mut self, schedule: &Schedule) -> Result<()> {
        let ticket = self.submit(schedule)?;
        self.wait(ticket)
    }

    /// Device seconds of all finished submissions; 0 where the queue has no timestamps.
    pub fn gpu_seconds(&self) -> f64 {
        self.gpu_seconds
    }

    /// Times by kernel of finished submissions; empty unless the device was opened with `timings`.
    pub fn times(&self) -> &BTreeMap<&'static str, KernelTime> {
        &self.times
    }

    fn command_buffer(&mut self) -> Result<vk::CommandBuffer> {
        if let Some(c) = self.spare.pop() {
            return Ok(c);
        }
        let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        // SAFETY: the pool is alive.
        let made = unsafe { self.gpu.raw().allocate_command_buffers(&info) };
        Ok(made.map_err(|e| self.gpu.failed("making a command buffer", e))?[0])
    }

    fn query_pool(&self, schedule: &Schedule) -> Result<vk::QueryPool> {
        if self.gpu.tick == 0.0 {
            return Ok(vk::QueryPool::null());
        }
        let count = if self.gpu.timings { schedule.commands.len() as u32 + 1 } else { 2 };
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count);
        // SAFETY: the device is alive; destroyed when the flight is over.
        unsafe { self.gpu.raw().create_query_pool(&info, None) }
            .map_err(|e| self.gpu.failed("making timestamps", e))
    }

    fn record(&mut self, schedule: &Schedule, flight: &mut Flight) -> Result<()> {
        let gpu = self.gpu;
        let device = gpu.raw();
        let c = flight.commands;
        let failed = |e| gpu.failed("recording", e);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let mut stamp = |name: Option<&'static str>| {
            if flight.queries == vk::QueryPool::null() {
                return;
            }
            let at = flight.spans.len() as u32 + u32::from(name.is_some());
            flight.spans.extend(name);
            // SAFETY: `at` is below the pool's size, which is one more than there can be spans.
            unsafe {
                device.cmd_write_timestamp(c, vk::PipelineStageFlags::BOTTOM_OF_PIPE, flight.queries, at)
            };
        };
        // SAFETY: the command buffer is not in flight; every handle recorded lives as long as the executor.
        unsafe {
            device.begin_command_buffer(c, &begin).map_err(failed)?;
            if flight.queries != vk::QueryPool::null() {
                let count = if gpu.timings { schedule.commands.len() as u32 + 1 } else { 2 };
                device.cmd_reset_query_pool(c, flight.queries, 0, count);
            }
            // What earlier submissions wrote.
            barrier(device, c);
            stamp(None);
            let mut pending = Pending::default();
            for command in &schedule.commands {
                let (reads, writes) = self.accesses(command);
                if pending.conflicts(&reads, &writes) || gpu.timings {
                    barrier(device, c);
                    pending.clear();
                }
                pending.add(reads, writes);
                self.record_one(c, command)?;
                if gpu.timings {
                    stamp(Some(command.name()));
                }
            }
            // What the host reads.
            barrier(device, c);
            if !gpu.timings {
                stamp(Some("all"));
            }
            device.end_command_buffer(c).map_err(failed)
        }
    }

    /// Buffers that a command reads and writes.
    fn accesses(&self, command: &Command) -> (Vec<&'static str>, Vec<&'static str>) {
        match command {
            Command::Dispatch { size, bind, kernel, .. } => {
                let bindings = self.pipeline(kernel).bindings;
                let named = |b: &super::Binding| buffer_of(bind, b.name);
                let mut reads: Vec<_> = bindings.iter().filter(|b| b.reads).map(named).collect();
                if let Size::Indirect(buffer, _) = size {
                    reads.push(buffer);
                }
                (reads, bindings.iter().filter(|b| b.writes).map(named).collect())
            }
            Command::Copy { from, to, .. } => (vec![from], vec![to]),
            Command::Fill { buffer, .. } => (vec![], vec![buffer]),
        }
    }

    fn pipeline(&self, kernel: &str) -> &Pipeline {
        self.pipelines.get(kernel).unwrap_or_else(|| panic!("no kernel `{kernel}` was added"))
    }

    unsafe fn record_one(&mut self, c: vk::CommandBuffer, command: &Command) -> Result<()> {
        let device = self.gpu.raw();
        // SAFETY: see `record`, the only caller; sizes are asserted against the buffers.
        unsafe {
            match command {
                Command::Dispatch { kernel, size, bind, push } => {
                    let pipeline = self.pipelines.get(kernel);
                    let pipeline = pipeline.unwrap_or_else(|| panic!("no kernel `{kernel}` was added"));
                    let buffers: Vec<_> = pipeline.bindings.iter().map(|b| buffer_of(bind, b.name)).collect();
                    let set = self.sets.get(self.gpu, &self.arena, pipeline, &buffers)?;
                    let point = vk::PipelineBindPoint::COMPUTE;
                    device.cmd_bind_pipeline(c, point, pipeline.handle);
                    device.cmd_bind_descriptor_sets(c, point, pipeline.layout, 0, &[set], &[]);
                    let stage = vk::ShaderStageFlags::COMPUTE;
                    device.cmd_push_constants(c, pipeline.layout, stage, 0, bytemuck::cast_slice(push));
                    match size {
                        Size::Groups(g) => {
                            let most = self.gpu.limits.groups;
                            assert!(
                                (0..3).all(|i| g[i] <= most[i]),
                                "`{kernel}`: {g:?} workgroups, at most {most:?}"
                            );
                            device.cmd_dispatch(c, g[0], g[1], g[2]);
                        }
                        Size::Indirect(buffer, offset) => {
                            let b = self.arena.get(buffer);
                            assert!(offset + 12 <= b.bytes, "`{kernel}`: arguments beyond `{buffer}`");
                            device.cmd_dispatch_indirect(c, b.handle, *offset);
                        }
                    }
                }
                Command::Copy { from, from_offset, to, to_offset, bytes } => {
                    let (a, b) = (self.arena.get(from), self.arena.get(to));
                    assert!(
                        from_offset + bytes <= a.bytes && to_offset + bytes <= b.bytes,
                        "copy {from} -> {to}"
                    );
                    let region =
                        vk::BufferCopy { src_offset: *from_offset, dst_offset: *to_offset, size: *bytes };
                    device.cmd_copy_buffer(c, a.handle, b.handle, &[region]);
                }
                Command::Fill { buffer, offset, bytes, value } => {
                    let b = self.arena.get(buffer);
                    assert!(offset + bytes <= b.bytes, "fill beyond `{buffer}`");
                    device.cmd_fill_buffer(c, b.handle, *offset, *bytes, *value);
                }
            }
        }
        Ok(())
    }

    fn read_times(&mut self, flight: &Flight) -> Result<()> {
        if flight.queries == vk::QueryPool::null() {
            return Ok(());
        }
        let mut stamps = vec![0u64; flight.spans.len() + 1];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the submission is over and wrote as many stamps as there are spans, plus one.
        unsafe { self.gpu.raw().get_query_pool_results(flight.queries, 0, &mut stamps, flags) }
            .map_err(|e| self.gpu.failed("reading timestamps", e))?;
        let seconds = |a: u64, b: u64| b.saturating_sub(a) as f64 * self.gpu.tick * 1e-9;
        self.gpu_seconds += seconds(stamps[0], stamps[flight.spans.len()]);
        if self.gpu.timings {
            for (name, pair) in flight.spans.iter().zip(stamps.windows(2)) {
                let t = self.times.entry(name).or_default();
                t.calls += 1;
                t.seconds += seconds(pair[0], pair[1]);
            }
        }
        Ok(())
    }
}

impl Drop for Executor<'_> {
    fn drop(&mut self) {
        let device = self.gpu.raw();
        // SAFETY: nothing is in flight after the wait (a lost device counts as idle); all was made by this.
        unsafe {
            let _ = device.device_wait_idle();
            for f in self.flights.drain(..) {
                device.destroy_query_pool(f.queries, None);
            }
            for p in self.pipelines.values() {
                p.destroy(self.gpu);
            }
            self.sets.destroy(self.gpu);
            device.destroy_semaphore(self.timeline, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}

fn buffer_of(bind: &[(&'static str, &'static str)], block: &'static str) -> &'static str {
    bind.iter().find(|(b, _)| *b == block).map_or(block, |(_, buffer)| buffer)
}

/// Reads and writes since the last barrier.
#[derive(Default)]
struct Pending {
    reads: Vec<&'static str>,
    writes: Vec<&'static str>,
}

impl Pending {
    fn conflicts(&self, reads: &[&'static str], writes: &[&'static str]) -> bool {
        reads.iter().any(|r| self.writes.contains(r))
            || writes.iter().any(|w| self.writes.contains(w) || self.reads.contains(w))
    }

    fn add(&mut self, reads: Vec<&'static str>, writes: Vec<&'static str>) {
        self.reads.extend(reads);
        self.writes.extend(writes);
    }

    fn clear(&mut self) {
        self.reads.clear();
        self.writes.clear();
    }
}

/// Everything before is done and visible to everything after, indirect arguments and the host included.
unsafe fn barrier(device: &ash::Device, c: vk::CommandBuffer) {
    let before = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
    let after = before | vk::PipelineStageFlags::DRAW_INDIRECT | vk::PipelineStageFlags::HOST;
    let memory = [vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(
            vk::AccessFlags::SHADER_READ
                | vk::AccessFlags::SHADER_WRITE
                | vk::AccessFlags::UNIFORM_READ
                | vk::AccessFlags::TRANSFER_READ
                | vk::AccessFlags::TRANSFER_WRITE
                | vk::AccessFlags::INDIRECT_COMMAND_READ
                | vk::AccessFlags::HOST_READ,
        )];
    // SAFETY: the caller is recording into `c`.
    unsafe { device.cmd_pipeline_barrier(c, before, after, vk::DependencyFlags::empty(), &memory, &[], &[]) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_barrier_stands_where_there_is_a_hazard_and_only_there() {
        let mut p = Pending::default();
        assert!(!p.conflicts(&["a"], &["b"]));
        p.add(vec!["a"], vec!["b"]);
        assert!(!p.conflicts(&["a", "c"], &["d"]), "read after read, and other buffers");
        assert!(p.conflicts(&["b"], &[]), "read after write");
        assert!(p.conflicts(&[], &["a"]), "write after read");
        assert!(p.conflicts(&[], &["b"]), "write after write");
        p.clear();
        assert!(!p.conflicts(&["b"], &["a", "b"]));
    }
}
