//! Schedules on the host: every command is a call, in order. No driver, no mapping, no waits.

use std::collections::{BTreeMap, HashMap};
use std::ops::{ControlFlow, RangeBounds};
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{AcqRel, Acquire, Relaxed, Release};
use std::time::{Duration, Instant};

use thirdbounce_kernels::{Call, Cells, Function};

use super::budget::check;
use super::code::{KernelCode, View};
use super::device::Gpu;
use super::executor::KernelTime;
use super::flight::Ticket;
use super::host::range_of;
use super::make::KernelRequest;
use super::names::{Buffer, Kernel};
use super::place::BufferPlan;
use super::recording::KernelMade;
use super::schedule::{Binds, Command, PUSH_WORDS, Schedule, Size, Stage};
use crate::Result;

/// Time between two progress reports.
const HEARD: Duration = Duration::from_millis(100);

/// All buffers of one job, as words.
pub struct HostArena {
    gpu: Gpu,
    buffers: BTreeMap<Buffer, Cells<f32>>,
    bytes: u64,
}

impl HostArena {
    /// Allocates every buffer of `plan`, all zero. `budget` limits the bytes of all buffers; default: available memory.
    ///
    /// # Errors
    /// The plan exceeds the budget.
    pub fn new(gpu: &Gpu, plan: &[BufferPlan], budget: Option<u64>) -> Result<HostArena> {
        let _span = gpu.span("allocate");
        check(plan, &gpu.memory(), budget)?;
        let fresh = gpu.faults().poison.unwrap_or(0);
        let words = |b: &BufferPlan| (b.buffer, Cells::Words(vec![fresh; b.bytes.div_ceil(4) as usize]));
        let bytes = plan.iter().map(|b| b.bytes).sum();
        gpu.allocated.fetch_add(bytes, Relaxed);
        Ok(HostArena { gpu: gpu.clone(), buffers: plan.iter().map(words).collect(), bytes })
    }

    /// Bytes of all buffers.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The content of a buffer.
    ///
    /// # Panics
    /// The plan has no such buffer.
    pub fn words(&self, buffer: Buffer) -> &[u32] {
        match self.buffers.get(&buffer) {
            Some(Cells::Words(words)) => words,
            _ => panic!("the plan holds no buffer `{buffer}`"),
        }
    }

    fn held(&mut self, buffer: Buffer) -> &mut Cells<f32> {
        self.buffers.get_mut(&buffer).unwrap_or_else(|| panic!("the plan holds no buffer `{buffer}`"))
    }

    fn words_mut(&mut self, buffer: Buffer) -> &mut [u32] {
        self.held(buffer).u()
    }

    /// Takes the content of a buffer out of the arena, for the time of a command.
    fn take(&mut self, buffer: Buffer) -> Cells<f32> {
        std::mem::replace(self.held(buffer), Cells::NONE)
    }

    /// Puts content that was taken back.
    fn put(&mut self, buffer: Buffer, content: Cells<f32>) {
        *self.held(buffer) = content;
    }
}

impl Drop for HostArena {
    fn drop(&mut self) {
        self.gpu.allocated.fetch_sub(self.bytes, Relaxed);
    }
}

/// What a run leaves in the timeline.
#[derive(Default)]
struct Log {
    stages: Vec<Stage>,
    /// (command, its stage, start and end)
    ran: Vec<(&'static str, Option<usize>, [f64; 2])>,
}

/// Whether some executor keeps the threads of the pool awake.
static KEPT_AWAKE: AtomicBool = AtomicBool::new(false);

/// Runs `work` on a thread of the pool, while the others look for parts of it without going to sleep: waking one takes as long as a
/// small kernel. Where another executor does so already, the threads are awake: two that waited for each other's end would wait
/// for ever.
fn awake<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let is_done = AtomicBool::new(false);
    rayon::scope(|scope| {
        if KEPT_AWAKE.swap(true, AcqRel) {
            return work();
        }
        let (own, is_done) = (rayon::current_thread_index(), &is_done);
        // Also where `work` panics: the scope waits for the others.
        let _end = OnDrop(|| {
            is_done.store(true, Release);
            KEPT_AWAKE.store(false, Release);
        });
        scope.spawn_broadcast(move |_, context| {
            // It ends without work for a while: a thread that takes this inside a part of a kernel owes that kernel the rest.
            let mut idle = 0;
            while Some(context.index()) != own && !is_done.load(Acquire) && idle < SPINS {
                idle = if rayon::yield_now() == Some(rayon::Yield::Executed) { 0 } else { idle + 1 };
                std::hint::spin_loop();
            }
        });
        work()
    })
}

/// Turns without work, some hundred microseconds, after which a thread may sleep.
const SPINS: u32 = 1 << 12;

struct OnDrop<F: Fn()>(F);

impl<F: Fn()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// A kernel of an executor.
struct HostKernel {
    code: KernelCode,
    function: Function<f32>,
    constants: Vec<(&'static str, u32)>,
}

/// Executes schedules over the buffers of an arena. A submission is complete when the call returns.
pub struct HostExecutor {
    gpu: Gpu,
    pub(super) arena: HostArena,
    kernels: HashMap<Kernel, HostKernel>,
    submitted: u64,
    seconds: f64,
    times: BTreeMap<&'static str, KernelTime>,
    spare: Schedule,
    /// Buffers of a dispatch, by binding. Kept to avoid allocation.
    cells: Vec<Cells<f32>>,
}

impl HostExecutor {
    pub fn new(gpu: &Gpu, arena: HostArena) -> HostExecutor {
        HostExecutor {
            gpu: gpu.clone(),
            arena,
            kernels: HashMap::new(),
            submitted: 0,
            seconds: 0.0,
            times: BTreeMap::new(),
            spare: Schedule::default(),
            cells: vec![],
        }
    }

    /// As [`super::Executor::add_kernels`].
    ///
    /// # Panics
    /// A module runs on Vulkan devices only.
    pub fn add_kernels(&mut self, wanted: &[KernelRequest<'_>]) {
        for w in wanted {
            let function =
                w.code.host.unwrap_or_else(|| panic!("`{}` is no kernel of the host", w.code.name));
            let constants = w.constants.iter().map(|(name, value)| (name.name(), *value)).collect();
            if let Some(recorder) = &self.gpu.recorder {
                let constants = w.constants.iter().map(|(n, v)| (n.to_string(), *v)).collect();
                recorder.made(w.kernel.name(), KernelMade { code: *w.code, constants, statistics: vec![] });
            }
            self.kernels.insert(w.kernel, HostKernel { code: *w.code, function, constants });
        }
    }

    pub fn has_kernel(&self, kernel: Kernel) -> bool {
        self.kernels.contains_key(&kernel)
    }

    /// Runs a schedule. `hear` is called about ten times a second; if it breaks, the rest is left out.
    pub fn run(&mut self, schedule: &Schedule, hear: &mut dyn FnMut() -> ControlFlow<()>) -> Option<Ticket> {
        let began = Instant::now();
        let mut log = Log::default();
        self.submitted += 1;
        self.gpu.traffic[0].fetch_add(1, Relaxed);
        let mut rest = &schedule.commands[..];
        while !rest.is_empty() {
            rest = awake(|| self.run_until(rest, Instant::now() + HEARD, &mut log));
            if !rest.is_empty() && hear().is_break() {
                return None;
            }
        }
        self.seconds += began.elapsed().as_secs_f64();
        if let Some(recorder) = &self.gpu.recorder {
            recorder.ran_on_host(self.submitted, &log.stages, &log.ran);
        }
        Some(Ticket(self.submitted))
    }

    /// Runs commands until a time. Returns the rest.
    fn run_until<'c>(&mut self, commands: &'c [Command], until: Instant, log: &mut Log) -> &'c [Command] {
        for (i, command) in commands.iter().enumerate() {
            if let Command::Stage(stage) = command {
                log.stages.push(*stage);
                continue;
            }
            let from = self.gpu.now();
            self.perform(command);
            if self.gpu.recorder.is_some() {
                let to = self.gpu.now();
                log.ran.push((command.name(), log.stages.len().checked_sub(1), [from, to]));
                let time = self.times.entry(command.name()).or_default();
                (time.calls, time.seconds) = (time.calls + 1, time.seconds + to - from);
            }
            if Instant::now() > until {
                return &commands[i + 1..];
            }
        }
        &[]
    }

    fn perform(&mut self, command: &Command) {
        match command {
            Command::Dispatch { kernel, size, bind, push, .. } => {
                let groups = match size {
                    Size::Groups(groups) => *groups,
                    Size::Indirect(buffer, offset, _) => {
                        let at = *offset as usize / 4;
                        std::array::from_fn(|axis| self.arena.words(*buffer)[at + axis])
                    }
                };
                if groups.iter().all(|n| *n > 0) {
                    self.dispatch(*kernel, bind, *push);
                }
            }
            Command::Copy { from, from_offset, to, to_offset, bytes } => {
                let [from_at, to_at, count] = [*from_offset, *to_offset, *bytes].map(|n| n as usize / 4);
                if from == to {
                    self.arena.words_mut(*to).copy_within(from_at..from_at + count, to_at);
                    return;
                }
                // Taken out for the time of the copy: both may not be borrowed from one map together.
                let source = self.arena.take(*from);
                if let Cells::Words(words) = &source {
                    self.arena.words_mut(*to)[to_at..to_at + count]
                        .copy_from_slice(&words[from_at..from_at + count]);
                }
                self.arena.put(*from, source);
            }
            Command::Fill { buffer, offset, bytes, value } => {
                let [at, count] = [*offset, *bytes].map(|n| n as usize / 4);
                self.arena.words_mut(*buffer)[at..at + count].fill(*value);
            }
            Command::Stage(_) => {}
        }
    }

    fn dispatch(&mut self, kernel: Kernel, bind: &Binds, push: [u32; PUSH_WORDS]) {
        let HostKernel { code, function, constants } =
            self.kernels.get(&kernel).unwrap_or_else(|| panic!("no kernel `{kernel}` was added"));
        let (bindings, function) = (code.bindings, *function);
        let buffers = &self.arena;
        let call = Call::new(constants, push, |name| {
            let block = bindings.iter().find(|b| b.view == View::Uniform && b.block.name() == name)?;
            Some(buffers.words(bind.buffer_of(block.block)))
        });
        let mut cells = std::mem::take(&mut self.cells);
        let bound = || bindings.iter().filter(|b| b.view != View::Uniform);
        cells.resize(bound().map(|b| b.slot as usize).max().unwrap_or(0), Cells::NONE);
        for b in bound() {
            cells[b.slot as usize - 1] = self.arena.take(bind.buffer_of(b.block));
        }
        function(&call, &mut cells);
        for b in bound() {
            let content = std::mem::replace(&mut cells[b.slot as usize - 1], Cells::NONE);
            self.arena.put(bind.buffer_of(b.block), content);
        }
        self.cells = cells;
    }

    pub fn submitted(&self) -> Ticket {
        Ticket(self.submitted)
    }

    pub fn gpu_seconds(&self) -> f64 {
        self.seconds
    }

    pub fn times(&self) -> &BTreeMap<&'static str, KernelTime> {
        &self.times
    }

    pub fn take_times(&mut self) -> BTreeMap<&'static str, KernelTime> {
        std::mem::take(&mut self.times)
    }

    pub fn spare_schedule(&mut self) -> Schedule {
        std::mem::take(&mut self.spare)
    }

    pub fn keep_schedule(&mut self, mut schedule: Schedule) {
        schedule.clear();
        self.spare = schedule;
    }

    /// Reads items, counted in whole `T`s, in the place of what `into` holds.
    pub fn read_into<T: bytemuck::Pod>(
        &self,
        buffer: Buffer,
        items: impl RangeBounds<usize>,
        into: &mut Vec<T>,
    ) {
        let bytes: &[u8] = bytemuck::cast_slice(self.arena.words(buffer));
        let range = range_of(buffer, items, bytes.len() / size_of::<T>());
        into.clear();
        into.resize(range.len(), T::zeroed());
        let own = &bytes[range.start * size_of::<T>()..range.end * size_of::<T>()];
        bytemuck::cast_slice_mut(into).copy_from_slice(own);
    }

    /// Writes bytes from `offset`.
    pub fn write_at(&mut self, buffer: Buffer, offset: u64, bytes: &[u8]) {
        let to: &mut [u8] = bytemuck::cast_slice_mut(self.arena.words_mut(buffer));
        let end = offset as usize + bytes.len();
        assert!(end <= to.len(), "bytes {offset} to {end} of `{buffer}` are written, which has {}", to.len());
        to[offset as usize..end].copy_from_slice(bytes);
    }
}
