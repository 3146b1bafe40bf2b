//! Submissions of an executor: command buffers, waits, timing.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use ash::vk;

use super::access::Accesses;
use super::device::Gpu;
use super::faults::Point;
use super::flight::{Flight, Ticket, TimelinePoint};
use super::memory::DeviceArena;
use super::names::{Buffer, Kernel};
use super::pace::Pace;
use super::pipeline::DescriptorSets;
use super::pipelines::Pipeline;
use super::schedule::{Command, Schedule};
use crate::Result;

/// Number and device time of a kernel's dispatches.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KernelTime {
    /// Dispatches.
    pub calls: u64,
    /// Total device time, seconds.
    pub seconds: f64,
}

/// Scratch state of recording, kept between submissions to avoid allocation.
#[derive(Default)]
pub(super) struct Scratch {
    /// Accesses of the current command.
    pub now: Accesses,
    /// Accesses since the last barrier.
    pub pending: Accesses,
    /// Buffers from which dispatch sizes are read.
    pub sizes: Vec<Buffer>,
    /// Timestamps read last.
    pub stamps: Vec<u64>,
}

/// Executes schedules over the buffers of an arena, in order of submission.
pub struct DeviceExecutor {
    pub(super) gpu: Gpu,
    pub(super) arena: DeviceArena,
    pub(super) pipelines: HashMap<Kernel, Arc<Pipeline>>,
    pub(super) sets: DescriptorSets,
    pool: vk::CommandPool,
    timeline: vk::Semaphore,
    pub(super) submitted: u64,
    pub(super) flights: VecDeque<Flight>,
    pub(super) spare: Vec<vk::CommandBuffer>,
    /// Unused timestamp pools with their sizes.
    spare_queries: Vec<(vk::QueryPool, u32)>,
    /// Unused sets for [`Flight::shared`].
    spare_shared: Vec<[HashSet<Buffer>; 2]>,
    /// See [`DeviceExecutor::spare_schedule`].
    spare_schedule: Schedule,
    /// Whether canaries were written.
    pub(super) guarded: bool,
    times: BTreeMap<&'static str, KernelTime>,
    gpu_seconds: f64,
    pub(super) pace: Pace,
    pub(super) scratch: Scratch,
}

impl DeviceExecutor {
    /// An executor for the buffers of `arena` as they are, initially without kernels.
    ///
    /// # Errors
    /// The device cannot create the queue's objects.
    pub(super) fn with(gpu: &Gpu, arena: DeviceArena) -> Result<DeviceExecutor> {
        let device = gpu.raw();
        let flags = vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER;
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.vulkan().family).flags(flags);
        let failed = |e| gpu.failed("starting", e);
        // SAFETY: the device is alive; the created objects are destroyed in drop.
        let before_call = || gpu.before_call(Point::Object);
        let pool = before_call()
            .and_then(|()| unsafe { device.create_command_pool(&info, None) })
            .map_err(failed)?;
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        let timeline = before_call().and_then(|()| unsafe { device.create_semaphore(&info, None) });
        let timeline =
            timeline.inspect_err(|_| unsafe { device.destroy_command_pool(pool, None) }).map_err(failed)?;
        gpu.name(pool, "command pool");
        gpu.name(timeline, "timeline");
        Ok(DeviceExecutor {
            gpu: gpu.clone(),
            arena,
            pipelines: HashMap::new(),
            sets: DescriptorSets::new(),
            pool,
            timeline,
            submitted: 0,
            flights: VecDeque::new(),
            spare: vec![],
            spare_queries: vec![],
            spare_shared: vec![],
            spare_schedule: Schedule::default(),
            guarded: false,
            times: BTreeMap::new(),
            gpu_seconds: 0.0,
            pace: Pace::new(gpu.info.kind, gpu.work),
            scratch: Scratch::default(),
        })
    }

    /// A submission before launch.
    pub(super) fn flight(&mut self, commands: vk::CommandBuffer) -> Flight {
        let ticket = Ticket(self.submitted + 1);
        let shared = self.spare_shared.pop().unwrap_or_default();
        Flight { ticket, commands, shared, ..Flight::default() }
    }

    /// Submits the recorded commands.
    pub(super) fn launch(&mut self, flight: Flight) -> Result<Ticket> {
        let gpu = self.gpu.clone();
        let _span = gpu.span("submit");
        let [after, before] = flight.between;
        // Without a timeline point, the second element of both is unused.
        let null = TimelinePoint::NONE;
        let (after, before, waits, signals) = (
            after.unwrap_or(null),
            before.unwrap_or(null),
            usize::from(after.is_some()),
            1 + usize::from(before.is_some()),
        );
        let values = [flight.ticket.0, before.value];
        let semaphores = [self.timeline, before.semaphore];
        let (wait_values, wait_semaphores) = ([after.value], [after.semaphore]);
        let stages = [vk::PipelineStageFlags::ALL_COMMANDS];
        let buffers = [flight.commands];
        let mut timeline = vk::TimelineSemaphoreSubmitInfo::default()
            .wait_semaphore_values(&wait_values[..waits])
            .signal_semaphore_values(&values[..signals]);
        let info = [vk::SubmitInfo::default()
            .command_buffers(&buffers)
            .wait_semaphores(&wait_semaphores[..waits])
            .wait_dst_stage_mask(&stages[..waits])
            .signal_semaphores(&semaphores[..signals])
            .push_next(&mut timeline)];
        let submitted = gpu.before_call(Point::Submission).and_then(|()| {
            let queue = gpu.queue();
            // SAFETY: the command buffer is recorded and not in flight; the queue is locked.
            unsafe { gpu.raw().queue_submit(*queue, &info, vk::Fence::null()) }
        });
        if let Err(e) = submitted {
            let doing = format!("submitting {}", flight.names());
            self.recycle(flight);
            return Err(gpu.failed(&doing, e));
        }
        self.submitted = flight.ticket.0;
        self.gpu.traffic[0].fetch_add(1, Relaxed);
        let ticket = flight.ticket;
        self.flights.push_back(flight);
        Ok(ticket)
    }

    /// Recycles the objects of a finished or never started flight.
    pub(super) fn recycle(&mut self, mut flight: Flight) {
        // Resets here, where drivers free the commands' resources, rather than at the next recording, which would
        // delay awaited work. Failure is ignored: starting to record resets again. SAFETY: the commands are not in
        // flight.
        let _ = unsafe {
            self.gpu.raw().reset_command_buffer(flight.commands, vk::CommandBufferResetFlags::empty())
        };
        self.spare.push(flight.commands);
        flight.shared.iter_mut().for_each(HashSet::clear);
        self.spare_shared.push(flight.shared);
        if flight.queries != vk::QueryPool::null() {
            self.spare_queries.push((flight.queries, flight.room));
        }
    }

    /// Waits for `ticket` and all earlier submissions.
    ///
    /// # Errors
    /// The device fails, or the watchdog times out.
    pub fn wait(&mut self, ticket: Ticket) -> Result<()> {
        if self.flights.front().is_none_or(|f| f.ticket > ticket) {
            return Ok(());
        }
        let gpu = self.gpu.clone();
        // SAFETY: the semaphore is alive.
        let reached = unsafe { gpu.raw().get_semaphore_counter_value(self.timeline) };
        if reached.is_ok_and(|reached| reached < ticket.0) {
            gpu.traffic[1].fetch_add(1, Relaxed);
        }
        let _span = gpu.span("wait");
        let semaphores = [self.timeline];
        let values = [ticket.0];
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        let due = self.flights.iter().take_while(|f| f.ticket <= ticket);
        let work = due.map(|f| f.work).fold(0, u64::saturating_add);
        let timeout = self.pace.timeout(work);
        gpu.before_call(Point::Wait)
            // SAFETY: the semaphore is alive.
            .and_then(|()| unsafe { gpu.raw().wait_semaphores(&info, nanoseconds(timeout)) })
            .map_err(|e| {
                let doing = format!("computing {}", self.unfinished());
                if e == vk::Result::TIMEOUT { gpu.timed_out(timeout, &doing) } else { gpu.failed(&doing, e) }
            })?;
        // Some drivers wait only here, for the timestamps.
        while self.flights.front().is_some_and(|f| f.ticket <= ticket) {
            let flight = self.flights.pop_front().expect("just seen");
            let read = self.read_times(&flight);
            self.recycle(flight);
            read?;
        }
        Ok(())
    }

    /// Commands of the first unfinished submission.
    fn unfinished(&self) -> String {
        // SAFETY: the semaphore is alive. A lost device may not answer, or report that all is done.
        let done = unsafe { self.gpu.raw().get_semaphore_counter_value(self.timeline) }.unwrap_or(0);
        let at = self.flights.iter().find(|f| f.ticket.0 > done).or(self.flights.back());
        at.map_or_else(|| "nothing".into(), Flight::names)
    }

    /// Waits for all submissions.
    ///
    /// # Errors
    /// As [`DeviceExecutor::wait`].
    pub fn settle(&mut self) -> Result<()> {
        self.wait(Ticket(self.submitted))
    }

    /// An empty schedule with the memory of a kept one.
    pub fn spare_schedule(&mut self) -> Schedule {
        std::mem::take(&mut self.spare_schedule)
    }

    /// Keeps the memory of a schedule for reuse.
    pub fn keep_schedule(&mut self, mut schedule: Schedule) {
        schedule.clear();
        self.spare_schedule = schedule;
    }

    /// Device seconds of all finished submissions; 0 without timestamps.
    pub fn gpu_seconds(&self) -> f64 {
        self.gpu_seconds
    }

    /// Times by kernel of finished submissions; empty unless the device was opened with `timings`.
    pub fn times(&self) -> &BTreeMap<&'static str, KernelTime> {
        &self.times
    }

    /// Returns and resets the times by kernel.
    pub fn take_times(&mut self) -> BTreeMap<&'static str, KernelTime> {
        std::mem::take(&mut self.times)
    }

    pub(super) fn command_buffer(&mut self) -> Result<vk::CommandBuffer> {
        if let Some(c) = self.spare.pop() {
            return Ok(c);
        }
        let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        // SAFETY: the pool is alive.
        let made = self
            .gpu
            .before_call(Point::Object)
            .and_then(|()| unsafe { self.gpu.raw().allocate_command_buffers(&info) });
        let made = made.map_err(|e| self.gpu.failed("creating a command buffer", e))?[0];
        self.gpu.name(made, "commands");
        Ok(made)
    }

    /// A timestamp pool large enough for `commands`, and its size: a spare or a new one.
    pub(super) fn query_pool(&mut self, commands: &[Command]) -> Result<(vk::QueryPool, u32)> {
        if self.gpu.vulkan().tick == 0.0 {
            return Ok((vk::QueryPool::null(), 0));
        }
        let count = stamps(commands, self.gpu.recorder.is_some());
        if let Some(spare) = self.spare_queries.iter().position(|(_, room)| *room >= count) {
            return Ok(self.spare_queries.swap_remove(spare));
        }
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count);
        // SAFETY: the device is alive; destroyed with the executor.
        let made = self
            .gpu
            .before_call(Point::Object)
            .and_then(|()| unsafe { self.gpu.raw().create_query_pool(&info, None) })
            .map_err(|e| self.gpu.failed("making timestamps", e))?;
        self.gpu.name(made, "time stamps");
        Ok((made, count))
    }

    fn read_times(&mut self, flight: &Flight) -> Result<()> {
        if flight.queries == vk::QueryPool::null() {
            return Ok(());
        }
        let mut stamps = std::mem::take(&mut self.scratch.stamps);
        stamps.clear();
        stamps.resize(flight.stamps as usize, 0);
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the submission is finished and wrote this number of timestamps.
        unsafe { self.gpu.raw().get_query_pool_results(flight.queries, 0, &mut stamps, flags) }
            .map_err(|e| self.gpu.failed("reading timestamps", e))?;
        let seconds = |a: u64, b: u64| b.saturating_sub(a) as f64 * self.gpu.vulkan().tick * 1e-9;
        let whole = seconds(stamps[0], stamps[stamps.len() - 1]);
        self.gpu_seconds += whole;
        self.pace.learn(flight.work, whole);
        for m in &flight.marks {
            let t = self.times.entry(m.kernel).or_default();
            t.calls += 1;
            t.seconds += seconds(stamps[m.from as usize], stamps[m.to as usize]);
        }
        if let Some(recorder) = &self.gpu.recorder {
            recorder.ran(flight, &stamps, self.gpu.vulkan().tick * 1e-9);
        }
        self.scratch.stamps = stamps;
        Ok(())
    }

    /// Waits for all submissions and destroys all objects.
    pub(super) fn destroy(&mut self) {
        let device = self.gpu.raw();
        let (semaphores, values) = ([self.timeline], [self.submitted]);
        let all = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        let timeout = self.pace.timeout(self.flights.iter().map(|f| f.work).fold(0, u64::saturating_add));
        // SAFETY: the semaphore is alive.
        let waited = unsafe { device.wait_semaphores(&all, nanoseconds(timeout)) };
        if self.gpu.has_hung() || waited == Err(vk::Result::TIMEOUT) {
            let _ = self.gpu.timed_out(timeout, &format!("computing {}", self.unfinished()));
            return;
        }
        // SAFETY: nothing of this executor is in flight after the wait (a lost device counts as idle); all objects
        // were created by it.
        unsafe {
            let flown = self.flights.drain(..).map(|f| f.queries);
            for queries in flown.chain(self.spare_queries.drain(..).map(|(queries, _)| queries)) {
                device.destroy_query_pool(queries, None);
            }
            self.sets.destroy(&self.gpu);
            device.destroy_semaphore(self.timeline, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}

/// Maximum number of timestamps of a submission of `commands`.
pub(super) fn stamps(commands: &[Command], timings: bool) -> u32 {
    if timings { 2 * commands.len() as u32 + 2 } else { 2 }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
