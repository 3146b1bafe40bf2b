//! A device's limits, measured by kernels that do one thing each (`glsl/limit_*.comp`).

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::on_host;
use thirdbounce::gpu::{Arena, Buffer, BufferPlan, DeviceKind, Executor, Gpu, KernelCode, Place, Schedule};
use thirdbounce::transport::kernels::{buffer, kernel};
use thirdbounce::{Error, Result};

/// The highest rates of a device; 0 if not measured. A fused multiply-add counts once.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct DeviceLimits {
    /// Fused multiply-adds per second.
    pub fma_per_s: f64,
    /// Additions to histograms per second: atomic ones in global memory with lanes in histograms of their own, fp32 if the device has
    /// such; on the host plain ones with threads in histograms of their own.
    #[serde(default)]
    pub scattered_atomic_per_s: f64,
    /// Bytes per second, read and written, of a copy from buffer to buffer; on the host of reads.
    pub copy_bytes_per_s: f64,
    /// The same of copies within sets of [`SETS`] bytes, which caches may hold.
    #[serde(default)]
    pub set_bytes_per_s: [f64; SETS.len()],
    /// Seconds of a dispatch with almost no work; with the barrier before it where dispatches have no time stamps.
    pub dispatch_s: f64,
}

/// Working sets that caches may hold, bytes.
pub const SETS: [u64; 4] = [1 << 16, 1 << 20, 8 << 20, 64 << 20];

impl DeviceLimits {
    /// Returns the limit of a dispatch that reads and writes `bytes` bytes, bytes per second: the highest of the measured working sets
    /// of at least an eighth of them, and of device memory.
    pub fn bytes_per_s(&self, bytes: u64) -> f64 {
        let in_caches = SETS.iter().zip(self.set_bytes_per_s).filter(|(set, _)| bytes < 8 * **set);
        in_caches.map(|(_, rate)| rate).fold(self.copy_bytes_per_s, f64::max)
    }
}

/// A kernel that measures one limit.
struct Probe {
    kernel: &'static KernelCode,
    /// Loop turns of an invocation, far below the limits of drivers.
    turns: u32,
    /// Measured operations per turn of an invocation.
    per_turn: u32,
    /// Whether word `i` of the result is right. `did` holds turns, workgroups per dispatch, and dispatches.
    right: fn(word: u32, i: u32, did: [u32; 3]) -> bool,
}

const LANES: u32 = 64;
/// Most workgroups of one dispatch.
const GROUPS: u32 = 32_768;
/// Words that the atomic kernels add to. They have the same number.
const ATOMIC_WORDS: u32 = 65_536;

const FMA: Probe = Probe { kernel: &kernel::LIMIT_FMA, turns: 1024, per_turn: 32, right: fma_right };
const SCATTERED: Probe =
    Probe { kernel: &kernel::LIMIT_SCATTERED_ATOMIC, turns: 64, per_turn: 4, right: scattered_right };
const SCATTERED_FLOAT: Probe = Probe {
    kernel: &kernel::LIMIT_SCATTERED_ATOMIC_FLOAT,
    turns: 64,
    per_turn: 4,
    right: scattered_float_right,
};

fn fma_right(word: u32, _: u32, [turns, ..]: [u32; 3]) -> bool {
    // 16 chains add 2 per turn. Eight start at 0 to 7, four at 0 and four at 1: 32 in all.
    f32::from_bits(word) == (32 * turns + 32) as f32
}

/// Number of additions to a word of histograms of 512 words, of which workgroups own 64 each: one from every workgroup
/// that owns it, from the 256th word down.
fn scattered(i: u32, [turns, groups, dispatches]: [u32; 3]) -> u32 {
    let owners = ATOMIC_WORDS / 512 / LANES;
    let mine = groups / owners + u32::from(i / 512 / LANES < groups % owners);
    let reached = (256 - 4 * turns..256).contains(&(i % 512));
    u32::from(reached) * mine * dispatches
}

fn scattered_right(word: u32, i: u32, did: [u32; 3]) -> bool {
    word == scattered(i, did)
}

fn scattered_float_right(word: u32, i: u32, did: [u32; 3]) -> bool {
    f32::from_bits(word) == scattered(i, did) as f32
}

/// Measures all limits: each is the best of several runs of some tens of milliseconds.
///
/// # Errors
/// The device fails, or its results are wrong.
pub fn measure(gpu: &Gpu) -> Result<DeviceLimits> {
    let mut bench = Bench::new(gpu)?;
    if gpu.is_host() {
        return Ok(DeviceLimits {
            fma_per_s: on_host::multiply_adds(),
            scattered_atomic_per_s: on_host::additions(),
            copy_bytes_per_s: on_host::loads(on_host::BEYOND),
            set_bytes_per_s: SETS.map(on_host::loads),
            dispatch_s: bench.command()?,
        });
    }
    let float = gpu.accumulations.float;
    let copy = bench.copy()?;
    Ok(DeviceLimits {
        fma_per_s: bench.rate(&FMA)?,
        scattered_atomic_per_s: bench.rate(if float { &SCATTERED_FLOAT } else { &SCATTERED })?,
        copy_bytes_per_s: copy.max(bench.copy_within(u64::MAX)?),
        set_bytes_per_s: {
            let mut rates = [0.0; SETS.len()];
            for (rate, bytes) in rates.iter_mut().zip(SETS) {
                *rate = bench.copy_within(bytes)?;
            }
            rates
        },
        dispatch_s: bench.dispatch()?,
    })
}

/// Runs of a measurement, and the least seconds that a run takes.
const RUNS: usize = 4;
const LONG_ENOUGH: f64 = 0.02;

/// Word that copies move.
const PATTERN: u32 = 0x600d_c0de;

/// Workgroups of a dispatch that copies, and least turns of an invocation.
const COPY_GROUPS: u32 = 4096;
const COPY_TURNS: u64 = 32;

const FROM: Buffer = Buffer::named("from");
const TO: Buffer = Buffer::named("to");
const BACK: Buffer = Buffer::named("back");

struct Bench {
    gpu: Gpu,
    executor: Executor,
    copied: u64,
}

impl Bench {
    fn new(gpu: &Gpu) -> Result<Bench> {
        let result = u64::from(GROUPS * LANES) * 4;
        // Larger than the caches of a GPU, but within free memory and the largest binding.
        let most = if gpu.info.kind == DeviceKind::Cpu { 32 << 20 } else { 512 << 20 };
        let copied = (gpu.memory().free[0] / 8).min(most).min(gpu.limits.storage_range) / 4096 * 4096;
        let copied = copied.max(4096);
        let plan = [
            BufferPlan::new(buffer::RESULT, result, Place::Device),
            BufferPlan::new(FROM, copied, Place::Device),
            BufferPlan::new(TO, copied, Place::Device),
            BufferPlan::new(BACK, result, Place::Readback),
        ];
        let executor = Executor::new(gpu, Arena::new(gpu, &plan, None)?)?;
        Ok(Bench { gpu: gpu.clone(), executor, copied })
    }

    /// Seconds of a command of the host that does next to nothing.
    fn command(&mut self) -> Result<f64> {
        let (commands, seconds) =
            self.best(1024, &|n| Schedule::of(|s| (0..n).for_each(|_| s.fill(TO, 4, 0))))?;
        Ok(seconds / commands as f64)
    }

    fn add(&mut self, code: &'static KernelCode) -> Result<()> {
        self.executor.add_kernel(code, code, &[])
    }

    /// Device seconds of a schedule; host seconds if the device has no clock.
    fn seconds(&mut self, schedule: &Schedule) -> Result<f64> {
        let (before, start) = (self.executor.gpu_seconds(), Instant::now());
        self.executor.run(schedule)?;
        let device = self.executor.gpu_seconds() - before;
        Ok(if device > 0.0 { device } else { start.elapsed().as_secs_f64() })
    }

    /// Grows `units` until a run takes long enough. Returns the units, and the seconds of the best of several runs.
    fn best(&mut self, mut units: u64, schedule: &dyn Fn(u64) -> Schedule) -> Result<(u64, f64)> {
        // The first run may compile.
        self.seconds(&schedule(1))?;
        let mut taken = self.seconds(&schedule(units))?;
        while taken < LONG_ENOUGH {
            let factor = (1.3 * LONG_ENOUGH / taken.max(1e-6)).clamp(1.5, 64.0);
            units = (units as f64 * factor).ceil() as u64;
            taken = self.seconds(&schedule(units))?;
        }
        for _ in 1..RUNS {
            taken = taken.min(self.seconds(&schedule(units))?);
        }
        Ok((units, taken))
    }

    fn rate(&mut self, probe: &Probe) -> Result<f64> {
        self.add(probe.kernel)?;
        let (groups, seconds) = self.best(64, &|groups| Schedule::of(|s| passes(s, probe, groups)))?;
        self.check(probe, groups)?;
        let (x, dispatches) = split(groups);
        let invocations = u64::from(x) * u64::from(dispatches) * u64::from(LANES);
        Ok((invocations * u64::from(probe.turns) * u64::from(probe.per_turn)) as f64 / seconds)
    }

    /// Checks the result of a run of the kernel.
    fn check(&mut self, probe: &Probe, groups: u64) -> Result<()> {
        let (x, dispatches) = split(groups);
        let words = x * LANES;
        let mut s = Schedule::default();
        s.fill(buffer::RESULT, u64::from(GROUPS * LANES) * 4, 0);
        passes(&mut s, probe, groups);
        s.copy(buffer::RESULT, BACK, u64::from(words) * 4);
        self.executor.run(&s)?;
        let got: Vec<u32> = self.executor.read(BACK, ..words as usize);
        let did = [probe.turns, x, dispatches];
        // Number of words that atomic kernels add to, for any number of invocations. The step is prime, so that every lane
        // is checked.
        let owned = if probe.per_turn == 4 && probe.turns == 64 { words.min(ATOMIC_WORDS) } else { words };
        match (0..owned).step_by(61).find(|i| !(probe.right)(got[*i as usize], *i, did)) {
            Some(i) => {
                Err(self.wrong(&format!("{} gives {:#x} in word {i}", probe.kernel.name, got[i as usize])))
            }
            None => Ok(()),
        }
    }

    fn wrong(&self, what: &str) -> Error {
        Error::device(
            format!("{} computes wrong results: {what}", self.gpu.info.name),
            "update its driver, or choose another device",
        )
    }

    fn copy(&mut self) -> Result<f64> {
        let bytes = self.copied;
        let mut before = Schedule::default();
        before.fill(FROM, bytes, PATTERN);
        before.fill(TO, bytes, 0);
        self.executor.run(&before)?;
        let (copies, seconds) = self.best(1, &|n| {
            let mut s = Schedule::default();
            (0..n).for_each(|_| s.copy(FROM, TO, bytes));
            s
        })?;
        self.check_copied(bytes)?;
        Ok((2 * bytes * copies) as f64 / seconds)
    }

    /// Measures a kernel that copies within a working set of `bytes` bytes, at most the probe's buffers: bytes per second, read and
    /// written.
    fn copy_within(&mut self, bytes: u64) -> Result<f64> {
        self.add(&kernel::LIMIT_COPY)?;
        let elements = (bytes / 32).min(self.copied / 16).max(1);
        let elements = 1u64 << elements.ilog2();
        let lanes = u64::from(COPY_GROUPS * LANES);
        let turns = elements.div_ceil(lanes).max(COPY_TURNS);
        let push = [turns, elements - 1, lanes, 0].map(|v| v as u32);
        let copies = |n: u64| {
            Schedule::of(|s| {
                for _ in 0..n {
                    s.dispatch(&kernel::LIMIT_COPY, [COPY_GROUPS, 1, 1], lanes * turns).with(push);
                }
            })
        };
        let mut before = Schedule::default();
        before.fill(FROM, self.copied, PATTERN);
        before.fill(TO, self.copied, 0);
        self.executor.run(&before)?;
        let (runs, seconds) = self.best(1, &copies)?;
        self.check_copied(16 * elements)?;
        Ok((32 * runs * turns * lanes) as f64 / seconds)
    }

    /// Checks the first `bytes` bytes of a copy, at most those that the host can read.
    fn check_copied(&mut self, bytes: u64) -> Result<()> {
        let seen = bytes.min(u64::from(GROUPS * LANES) * 4);
        let mut after = Schedule::default();
        after.copy(TO, BACK, seen);
        self.executor.run(&after)?;
        let back: Vec<u32> = self.executor.read(BACK, ..seen as usize / 4);
        match back.iter().all(|w| *w == PATTERN) {
            true => Ok(()),
            false => Err(self.wrong("a copy leaves other bytes")),
        }
    }

    /// Seconds of a dispatch of one workgroup: by its own time stamps if it has any.
    fn dispatch(&mut self) -> Result<f64> {
        const COUNT: u32 = 500;
        let short = Probe { turns: 1, ..FMA };
        self.add(short.kernel)?;
        let all = Schedule::of(|s| (0..COUNT).for_each(|_| passes(s, &short, 1)));
        self.seconds(&all)?;
        let mut best = f64::INFINITY;
        for _ in 0..RUNS {
            self.executor.take_times();
            let seconds = self.seconds(&all)?;
            let stamped = self.executor.take_times().remove(short.kernel.name);
            best = best.min(stamped.map_or(seconds, |t| t.seconds));
        }
        Ok(best / f64::from(COUNT))
    }
}

/// Workgroups per dispatch, and dispatches, for at least this many workgroups in all.
fn split(groups: u64) -> (u32, u32) {
    let dispatches = groups.div_ceil(u64::from(GROUPS)).max(1);
    (groups.div_ceil(dispatches) as u32, dispatches as u32)
}

fn passes(s: &mut Schedule, probe: &Probe, groups: u64) {
    let (x, dispatches) = split(groups);
    for _ in 0..dispatches {
        let turns = u64::from(x) * u64::from(LANES) * u64::from(probe.turns);
        s.dispatch(probe.kernel, [x, 1, 1], turns).with([probe.turns, 1f32.to_bits(), 1f32.to_bits(), 0]);
    }
}

#[cfg(test)]
mod tests {
    use fixtures::device::alone;
    use thirdbounce::gpu::GpuOptions;

    use super::*;

    fn gpu() -> Gpu {
        let open = |validation| Gpu::open(&GpuOptions { validation, ..GpuOptions::default() });
        open(true).or_else(|_| open(false)).expect("a Vulkan device: `make setup` installs lavapipe")
    }

    #[test]
    fn every_limit_kernel_computes_what_it_says() {
        let _alone = alone();
        let gpu = gpu();
        let mut bench = Bench::new(&gpu).unwrap();
        let float = gpu.accumulations.float.then_some(&SCATTERED_FLOAT);
        for probe in [&FMA, &SCATTERED].into_iter().chain(float) {
            bench.add(probe.kernel).unwrap();
            // More groups than there are sets of atomic words, and not a multiple of them.
            bench.check(probe, 1100).unwrap();
            // The right result of other work must not pass.
            let off = Probe { turns: probe.turns - 1, ..*probe };
            let mut s = Schedule::default();
            s.fill(buffer::RESULT, u64::from(GROUPS * LANES) * 4, 0);
            passes(&mut s, &off, 4);
            s.copy(buffer::RESULT, BACK, 4);
            bench.executor.run(&s).unwrap();
            let word = bench.executor.read::<u32>(BACK, ..1)[0];
            assert!((probe.right)(word, 0, [off.turns, 4, 1]), "{}", probe.kernel.name);
            assert!(
                !(probe.right)(word, 0, [probe.turns, 4, 1]),
                "{}: a missing turn is not noticed",
                probe.kernel.name
            );
        }
        assert!(gpu.validation_messages().is_empty(), "{:?}", gpu.validation_messages());
    }

    #[test]
    fn work_is_split_into_dispatches_that_devices_take() {
        assert_eq!(split(1), (1, 1));
        assert_eq!(split(u64::from(GROUPS)), (GROUPS, 1));
        assert_eq!(split(u64::from(GROUPS) + 1), (GROUPS / 2 + 1, 2));
        let (x, n) = split(1_000_000);
        assert!(x <= GROUPS && u64::from(x) * u64::from(n) >= 1_000_000);
    }

    #[test]
    fn all_limits_are_found_in_seconds() {
        let _alone = alone();
        let gpu = gpu();
        let start = Instant::now();
        let l = measure(&gpu).unwrap();
        println!("{l:?} in {:?}", start.elapsed());
        assert!([l.fma_per_s, l.scattered_atomic_per_s].iter().all(|r| *r > 1e6 && r.is_finite()), "{l:?}");
        assert!(l.copy_bytes_per_s > 1e7 && l.dispatch_s > 1e-8 && l.dispatch_s < 0.1, "{l:?}");
    }
}
