//! An opened device.

use std::ops::Deref;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use ash::{ext, khr, vk};

use super::budget::Kinds;
use super::driver_report;
use super::faults::{Faults, InjectedFaults, Point};
use super::instance::{DeviceInfo, Instance};
use super::kept::Cache;
use super::limits::{Abilities, Accumulations, Limits, Reported};
use super::offered::Offered;
use super::options::{GpuOptions, choose, compute_family};
use super::owned::{OwnedDevice, Queue, QueueLock};
use super::pace::{dispatch_of, rate_of};
use super::pipelines::Pipelines;
use super::place::BlockSource;
use super::recording::{OpenSpan, Recorder, Recording};
use crate::advice::{Remedy, advice};
use crate::{Error, Result};

/// A handle of an opened device with one compute queue. Clones are cheap, and any thread may use them. Executors and
/// arenas hold one. The device closes when the last handle is gone.
#[derive(Clone)]
pub struct Gpu(Arc<Opened>);

impl Deref for Gpu {
    type Target = Opened;

    fn deref(&self) -> &Opened {
        &self.0
    }
}

/// What a [`Gpu`] is a handle of.
pub struct Opened {
    /// The device as the loader lists it.
    pub info: DeviceInfo,
    /// How it adds to memory.
    pub accumulations: Accumulations,
    /// Its limits.
    pub limits: Limits,
    /// The timeline, if it was asked for.
    pub(super) recorder: Option<Recorder>,
    /// Reads statistics of pipelines, if they were asked for and the device has them.
    pub(super) statistics: Option<khr::pipeline_executable_properties::Device>,
    /// Reads listings of pipelines, too.
    pub(super) has_listings: bool,
    /// The driver rounds fp32 to nearest where a kernel asks for it.
    pub(super) has_rounding: bool,
    /// Nanoseconds per timestamp tick; 0 where the queue has no timestamps.
    pub(super) tick: f64,
    // Vulkan lets one thread at a time use a queue: only `queue()` gives access.
    queue: Mutex<vk::Queue>,
    /// A caller's lock of the queue, taken as well.
    lock: Option<Arc<dyn QueueLock>>,
    /// A caller's memory for buffers.
    pub(super) blocks: Option<Arc<dyn BlockSource>>,
    /// Imports memory of other programs, where the device does.
    pub(super) external_memory: Option<khr::external_memory_fd::Device>,
    /// Asks the driver about a loss, where it tells.
    pub(super) device_fault: Option<ext::device_fault::Device>,
    pub(super) family: u32,
    pub(super) physical: vk::PhysicalDevice,
    pub(super) has_budget: bool,
    /// Turns of a submission at most, if they were given.
    pub(super) work: Option<u64>,
    pub(super) injected_faults: Option<InjectedFaults>,
    /// Bytes of one allocation at most.
    pub(super) allocation: u64,
    /// Where buffers lie.
    pub(super) kinds: Kinds,
    /// Bytes that arenas hold.
    pub(super) allocated: AtomicU64,
    pub(super) names: Option<ext::debug_utils::Device>,
    /// Kernels as executors run them.
    pub(super) pipelines: Pipelines,
    /// What the driver keeps of compiled kernels.
    pub(super) cache: Cache,
    pub(super) device: Arc<OwnedDevice>,
    pub(super) instance: Arc<Instance>,
}

/// What a device is made of.
pub(super) struct Parts {
    pub instance: Arc<Instance>,
    pub device: Arc<OwnedDevice>,
    pub physical: vk::PhysicalDevice,
    pub info: DeviceInfo,
    pub queue: vk::Queue,
    pub family: u32,
    pub offered: Offered,
    pub cache: Cache,
    pub lock: Option<Arc<dyn QueueLock>>,
    pub blocks: Option<Arc<dyn BlockSource>>,
}

impl Gpu {
    /// Opens the device that `options` name, or the best one.
    ///
    /// # Errors
    /// There is no loader, no device or no device of that name, or a required feature is missing. Each error says what
    /// to do.
    pub fn open(options: &GpuOptions) -> Result<Gpu> {
        let instance = Arc::new(Instance::new(options.validation, options.instrumented)?);
        let all = instance.list();
        let (physical, info) = choose(&all, options.device.as_deref())?;
        let properties = unsafe { instance.raw.get_physical_device_properties(physical) };
        let (family, _) = compute_family(&instance, physical, &info)?;
        let offered = Offered::by(&instance, physical, &info, options)?;
        let raw = offered.create(&instance, physical, &info, family)?;
        // SAFETY: the family was asked for with one queue.
        let queue = unsafe { raw.get_device_queue(family, 0) };
        let device = Arc::new(OwnedDevice::new(raw, instance.clone(), false));
        let cache = Cache::open(device.clone(), options.pipeline_cache.as_deref(), &properties);
        let parts = Parts {
            instance,
            device,
            physical,
            info,
            queue,
            family,
            offered,
            cache,
            lock: None,
            blocks: None,
        };
        let gpu = Gpu::of(parts, options);
        gpu.name(queue, "compute queue");
        Ok(gpu)
    }

    /// The device that is made of these parts.
    pub(super) fn of(parts: Parts, options: &GpuOptions) -> Gpu {
        let Parts { instance, device, physical, info, queue, family, offered, cache, lock, blocks } = parts;
        // SAFETY: the physical device is the instance's.
        let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
        let has_timestamps = families.get(family as usize).is_some_and(|f| f.timestamp_valid_bits > 0);
        let names = instance.debug_names.then(|| ext::debug_utils::Device::new(&instance.raw, &device.raw));
        let statistics = offered
            .has_statistics
            .then(|| khr::pipeline_executable_properties::Device::new(&instance.raw, &device.raw));
        let external_memory = offered
            .has_external_memory
            .then(|| khr::external_memory_fd::Device::new(&instance.raw, &device.raw));
        let device_fault =
            offered.has_device_fault.then(|| ext::device_fault::Device::new(&instance.raw, &device.raw));
        let work = options.work.unwrap_or_else(|| dispatch_of(info.kind));
        let reported = Reported::by(&instance, physical);
        Gpu(Arc::new(Opened {
            info,
            accumulations: Accumulations { float: offered.float, int64: offered.int64 },
            limits: reported.of_plans(work).binding_at_most(options.binding),
            allocation: reported.allocation,
            work: options.work,
            recorder: options.timings.then(Recorder::new),
            has_listings: options.listings && statistics.is_some(),
            has_rounding: offered.rounding,
            statistics,
            tick: if has_timestamps { f64::from(reported.limits.timestamp_period) } else { 0.0 },
            queue: Mutex::new(queue),
            lock,
            blocks,
            external_memory,
            device_fault,
            family,
            physical,
            has_budget: offered.has_budget,
            injected_faults: options.faults.any().then(|| InjectedFaults::new(options.faults)),
            kinds: Kinds::of(&instance, physical),
            allocated: AtomicU64::new(0),
            names,
            pipelines: Pipelines::default(),
            cache,
            device,
            instance,
        }))
    }

    /// Whether both are handles of one opened device.
    pub fn is(&self, other: &Gpu) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// What a plan must know of this device.
    #[doc(hidden)]
    pub fn abilities(&self) -> Abilities {
        Abilities { kind: self.info.kind, accumulations: self.accumulations, limits: self.limits }
    }

    /// Messages of the validation layer since the device was opened; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.instance.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The queue, for this thread alone as long as the guard is held.
    pub(super) fn queue(&self) -> Queue<'_> {
        // A handle cannot be left half-changed, so a thread that panicked has damaged nothing.
        let queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        let lock = self.lock.as_deref();
        lock.into_iter().for_each(QueueLock::lock);
        Queue { queue, lock }
    }

    /// Gives a Vulkan object the name that the plan uses, for validation messages, RenderDoc and Nsight.
    pub(super) fn name<T: vk::Handle>(&self, object: T, name: &str) {
        let Some(names) = &self.names else { return };
        let Ok(text) = std::ffi::CString::new(name) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&text);
        // SAFETY: the object belongs to this device. A name that is not taken changes nothing.
        let _ = unsafe { names.set_debug_utils_object_name(&info) };
    }

    pub(super) fn raw(&self) -> &ash::Device {
        &self.device.raw
    }

    /// The error of a device that did not come back in time from what it was `doing`. Nothing that it may still use is
    /// destroyed after this.
    pub(super) fn hangs(&self, waited: Duration, doing: &str) -> Error {
        self.device.note_hung();
        let (name, waited) = (&self.info.name, waited.as_secs());
        self.device.note_down(|| {
            Error::device(
                format!("{name} did not finish its work within {waited} s, {doing}"),
                advice!["it or its driver hangs, or it is far slower than devices of its kind: try " {Remedy::SMALLER_JOB} ", or another " Device],
            )
        })
    }

    /// Whether the device did not come back from work in time.
    pub(super) fn has_hung(&self) -> bool {
        self.device.has_hung()
    }

    /// The error of a failed call: device lost, out of memory, or the Vulkan result. After a loss it is always that of the
    /// loss.
    pub(super) fn failed(&self, doing: &str, result: vk::Result) -> Error {
        let name = &self.info.name;
        match result {
            vk::Result::ERROR_DEVICE_LOST => self.device.note_down(|| {
                Error::device(
                    format!(
                        "{name} was lost while {doing}{}",
                        driver_report::text(self.faults().told, self.device_fault.as_ref())
                    ),
                    advice!["its driver was reset, often by a time limit for displays; what is open on it, sessions too, must be opened anew: try " {Remedy::SMALLER_JOB} ", or another " Device],
                )
            }),
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => Error::memory(
                format!("{name} ran out of memory while {doing}"),
                advice!["close other programs that use it, or use " {Remedy::SMALLER_JOB}],
            ),
            other => Error::device(
                format!("{name} failed while {doing} ({other})"),
                advice!["update its driver, or choose another device with " Device],
            ),
        }
    }
}

#[doc(hidden)]
impl Gpu {
    /// Begins a span of the host's time. Costs nothing without `timings`.
    pub fn span(&self, what: &'static str) -> OpenSpan<'_> {
        OpenSpan::begin(self.recorder.as_ref(), what)
    }

    /// Takes what was recorded since the device was opened or since the last call; empty without `timings`. Kernels
    /// stay in the recording.
    pub fn take_recording(&self) -> Recording {
        self.recorder.as_ref().map(Recorder::take).unwrap_or_default()
    }

    /// Whether the device's queue has time stamps.
    pub fn has_clock(&self) -> bool {
        self.tick > 0.0
    }

    /// Seconds since the device was opened; 0 without `timings`.
    pub fn now(&self) -> f64 {
        self.recorder.as_ref().map_or(0.0, Recorder::now)
    }

    /// Turns of kernels' main loops a second that a device of this kind may be expected to reach.
    pub fn expected_rate(&self) -> f64 {
        rate_of(self.info.kind)
    }

    /// Whether the driver promises that kernels round to nearest.
    pub fn promises_rounding(&self) -> bool {
        self.has_rounding
    }

    /// Called before every call that may fail: fails if the device was lost or hangs, or if the call is to fail.
    pub(super) fn before_call(&self, point: Point) -> std::result::Result<(), vk::Result> {
        if self.device.is_down() {
            return Err(vk::Result::ERROR_DEVICE_LOST);
        }
        self.injected_faults.as_ref().map_or(Ok(()), |s| s.before_call(point))
    }

    /// Faults to produce; none on a device that was opened without.
    pub(super) fn faults(&self) -> Faults {
        self.injected_faults.as_ref().map_or_else(Faults::default, |s| s.faults)
    }

    /// How many calls of a kind there were; 0 on a device that was opened with no [`super::Faults`].
    pub fn reached(&self, point: Point) -> u64 {
        self.injected_faults.as_ref().map_or(0, |s| s.reached(point))
    }

    /// Bytes of device memory that buffers hold at the moment.
    pub fn allocated(&self) -> u64 {
        self.allocated.load(Relaxed)
    }

    /// Gives this handle back. If it is the last one, the device closes. Returns all messages of the validation layer,
    /// those about objects left behind included; empty without validation.
    pub fn close(self) -> Vec<String> {
        let messages = self.instance.messages.clone();
        drop(self);
        messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
