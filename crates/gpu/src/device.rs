//! Opened devices.

use std::ops::Deref;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use ash::{ext, khr, vk};

use super::budget::Kinds;
use super::faults::{Faults, InjectedFaults, Point};
use super::instance::{DeviceInfo, DeviceKind, Instance};
use super::kept::Cache;
use super::limits::{Abilities, Accumulations, Limits, Reported};
use super::offered::Offered;
use super::options::{GpuOptions, choose, compute_family};
use super::owned::{OwnedDevice, Queue, QueueLock};
use super::pace::{dispatch_of, rate_of};
use super::pipelines::Pipelines;
use super::place::BlockSource;
use super::recording::{OpenSpan, Recorder, Recording};
use super::{driver_report, host_device as host};
use crate::advice::{Remedy, advice};
use crate::{Error, Result};

/// A handle of an opened device with one compute queue. Clones are cheap and usable from any thread. Executors and
/// arenas hold one. The device is closed with the last handle.
#[derive(Clone)]
pub struct Gpu(Arc<DeviceState>);

impl Deref for Gpu {
    type Target = DeviceState;

    fn deref(&self) -> &DeviceState {
        &self.0
    }
}

/// Shared state of [`Gpu`] handles.
pub struct DeviceState {
    /// The device as [`super::devices`] lists it.
    pub info: DeviceInfo,
    /// Supported accumulation paths.
    pub accumulations: Accumulations,
    /// Its limits.
    pub limits: Limits,
    /// The timeline, if requested.
    pub(super) recorder: Option<Recorder>,
    /// Maximum loop turns per submission, if specified.
    pub(super) work: Option<u64>,
    pub(super) injected_faults: Option<InjectedFaults>,
    /// Bytes held by arenas.
    pub(super) allocated: AtomicU64,
    /// See [`Gpu::traffic`].
    pub(super) traffic: [AtomicU64; 2],
    /// `None`: the device is the host.
    vulkan: Option<VulkanDevice>,
}

/// An opened Vulkan device.
pub(super) struct VulkanDevice {
    /// Pipeline statistics, if requested and supported.
    pub statistics: Option<khr::pipeline_executable_properties::Device>,
    /// Whether pipeline listings are read as well.
    pub has_listings: bool,
    /// Whether the driver supports declared round-to-nearest for fp32.
    pub has_rounding: bool,
    /// Nanoseconds per timestamp tick; 0 without timestamps.
    pub tick: f64,
    // Queue access is externally synchronised: only through `queue()`.
    queue: Mutex<vk::Queue>,
    /// The application's lock of the queue, held as well.
    lock: Option<Arc<dyn QueueLock>>,
    /// The application's allocator of buffer memory.
    pub blocks: Option<Arc<dyn BlockSource>>,
    /// Import of external memory, if supported.
    pub external_memory: Option<khr::external_memory_fd::Device>,
    /// Fault queries after a loss, if supported.
    pub device_fault: Option<ext::device_fault::Device>,
    pub family: u32,
    pub physical: vk::PhysicalDevice,
    pub has_budget: bool,
    /// Maximum size of one allocation, bytes.
    pub allocation: u64,
    /// Memory types of buffers.
    pub kinds: Kinds,
    pub names: Option<ext::debug_utils::Device>,
    /// Pipelines shared by executors.
    pub pipelines: Pipelines,
    /// Pipeline cache.
    pub cache: Cache,
    pub device: Arc<OwnedDevice>,
    pub instance: Arc<Instance>,
}

/// Constituents of a device.
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
    /// Opens the device named in `options`, or the best one: a GPU, else the host itself.
    ///
    /// # Errors
    /// No device of that name, or a missing required feature; no loader, if a Vulkan device is asked for. The error contains
    /// the fix.
    pub fn open(options: &GpuOptions) -> Result<Gpu> {
        let instance = match Instance::new(options.validation, options.instrumented) {
            Ok(instance) => Arc::new(instance),
            Err(e) if options.needs_vulkan() || !host::is_chosen(options, 0) => return Err(e),
            Err(_) => return Ok(Gpu::host(options, 0)),
        };
        let mut all = instance.list();
        if !options.needs_vulkan() {
            all.push((vk::PhysicalDevice::null(), host::info(all.len())));
        }
        let (physical, info) = choose(&all, options.device.as_deref())?;
        if info.kind == DeviceKind::Host {
            return Ok(Gpu::host(options, info.index));
        }
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

    /// The host as a device, at this index of [`super::devices`].
    fn host(options: &GpuOptions, index: usize) -> Gpu {
        // One thread owns a histogram: no atomics.
        let accumulations = Accumulations { float: false, int64: false };
        Gpu::with(host::info(index), accumulations, host::LIMITS, options, None)
    }

    fn with(
        info: DeviceInfo,
        accumulations: Accumulations,
        limits: Limits,
        options: &GpuOptions,
        vulkan: Option<VulkanDevice>,
    ) -> Gpu {
        Gpu(Arc::new(DeviceState {
            info,
            accumulations,
            limits: limits.binding_at_most(options.binding),
            recorder: options.timings.then(Recorder::new),
            work: options.work,
            injected_faults: options.faults.any().then(|| InjectedFaults::new(options.faults)),
            allocated: AtomicU64::new(0),
            traffic: Default::default(),
            vulkan,
        }))
    }

    /// The device made of these parts.
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
        let accumulations = Accumulations { float: offered.float, int64: offered.int64 };
        let limits = reported.of_plans(work);
        let vulkan = VulkanDevice {
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
            allocation: reported.allocation,
            kinds: Kinds::of(&instance, physical),
            names,
            pipelines: Pipelines::default(),
            cache,
            device,
            instance,
        };
        Gpu::with(info, accumulations, limits, options, Some(vulkan))
    }

    /// The Vulkan device.
    ///
    /// # Panics
    /// The device is the host.
    pub(super) fn vulkan(&self) -> &VulkanDevice {
        self.vulkan.as_ref().expect("only executors of a Vulkan device call this")
    }

    /// Whether the device is the host itself.
    pub fn is_host(&self) -> bool {
        self.vulkan.is_none()
    }

    /// Whether both are handles of one opened device.
    pub fn is(&self, other: &Gpu) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Properties of this device relevant to plans.
    #[doc(hidden)]
    pub fn abilities(&self) -> Abilities {
        Abilities { kind: self.info.kind, accumulations: self.accumulations, limits: self.limits }
    }

    /// Messages of the validation layer since the device was opened; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        let Some(vulkan) = &self.vulkan else { return vec![] };
        vulkan.instance.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Exclusive access to the queue while the guard is held.
    pub(super) fn queue(&self) -> Queue<'_> {
        // A handle cannot be partially modified, so a panicked thread has not damaged it.
        let queue = self.vulkan().queue.lock().unwrap_or_else(PoisonError::into_inner);
        let lock = self.vulkan().lock.as_deref();
        lock.into_iter().for_each(QueueLock::lock);
        Queue { queue, lock }
    }

    /// Sets the debug name of a Vulkan object, for validation messages, RenderDoc and Nsight.
    pub(super) fn name<T: vk::Handle>(&self, object: T, name: &str) {
        let Some(names) = &self.vulkan().names else { return };
        let Ok(text) = std::ffi::CString::new(name) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&text);
        // SAFETY: the object belongs to this device. Failure to set a name has no effect.
        let _ = unsafe { names.set_debug_utils_object_name(&info) };
    }

    pub(super) fn raw(&self) -> &ash::Device {
        &self.vulkan().device.raw
    }

    /// Error of a watchdog timeout during `doing`. Objects that the device may still use are not destroyed
    /// afterwards.
    pub(super) fn timed_out(&self, waited: Duration, doing: &str) -> Error {
        self.vulkan().device.record_timeout();
        let (name, waited) = (&self.info.name, waited.as_secs());
        self.vulkan().device.record_failure(|| {
            Error::device(
                format!("{name} did not finish its work within {waited} s, {doing}"),
                advice!["it or its driver hangs, or it is far slower than devices of its kind: try " {Remedy::SMALLER_JOB} ", or another " Device],
            )
        })
    }

    /// Whether the watchdog timed out.
    pub(super) fn has_hung(&self) -> bool {
        self.vulkan.as_ref().is_some_and(|v| v.device.has_hung())
    }

    /// Error of a failed call: device lost, out of memory, or the Vulkan result. After a loss always that of the
    /// loss.
    pub(super) fn failed(&self, doing: &str, result: vk::Result) -> Error {
        let name = &self.info.name;
        match result {
            vk::Result::ERROR_DEVICE_LOST => self.vulkan().device.record_failure(|| {
                Error::device(
                    format!(
                        "{name} was lost while {doing}{}",
                        driver_report::text(self.faults().fault_address, self.vulkan().device_fault.as_ref())
                    ),
                    advice!["its driver was reset, often by a watchdog timeout; reopen the device and its sessions, and try " {Remedy::SMALLER_JOB} ", or another " Device],
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
    /// Starts a span of host time. No-op without `timings`.
    pub fn span(&self, what: &'static str) -> OpenSpan<'_> {
        OpenSpan::begin(self.recorder.as_ref(), what)
    }

    /// Returns and clears the recording since the last call; empty without `timings`. Kernels are kept.
    pub fn take_recording(&self) -> Recording {
        self.recorder.as_ref().map(Recorder::take).unwrap_or_default()
    }

    /// Whether device time is measured: by timestamps of the queue, or on the host's clock.
    pub fn has_clock(&self) -> bool {
        self.vulkan.as_ref().is_none_or(|v| v.tick > 0.0)
    }

    /// Seconds since the device was opened; 0 without `timings`.
    pub fn now(&self) -> f64 {
        self.recorder.as_ref().map_or(0.0, Recorder::now)
    }

    /// Expected loop turns per second of this kind of device.
    pub fn expected_rate(&self) -> f64 {
        rate_of(if self.faults().discrete { DeviceKind::Discrete } else { self.info.kind })
    }

    /// Whether the driver guarantees round-to-nearest in kernels.
    pub fn promises_rounding(&self) -> bool {
        self.vulkan.as_ref().is_none_or(|v| v.has_rounding)
    }

    /// Called before every fallible call: fails if the device was lost or hung, or if a fault is injected.
    pub(super) fn before_call(&self, point: Point) -> std::result::Result<(), vk::Result> {
        if self.vulkan().device.has_failed() {
            return Err(vk::Result::ERROR_DEVICE_LOST);
        }
        self.injected_faults.as_ref().map_or(Ok(()), |s| s.before_call(point))
    }

    /// Injected faults; none by default.
    pub(super) fn faults(&self) -> Faults {
        self.injected_faults.as_ref().map_or_else(Faults::default, |s| s.faults)
    }

    /// Number of calls of a kind; 0 without [`super::Faults`].
    pub fn reached(&self, point: Point) -> u64 {
        self.injected_faults.as_ref().map_or(0, |s| s.reached(point))
    }

    /// Bytes of device memory currently held by buffers.
    pub fn allocated(&self) -> u64 {
        self.allocated.load(Relaxed)
    }

    /// Submissions so far, and waits of the host for those that were not done.
    pub fn traffic(&self) -> [u64; 2] {
        [0, 1].map(|at| self.traffic[at].load(Relaxed))
    }

    /// Releases this handle and closes the device if it is the last one. Returns all validation messages, including
    /// those on leaked objects; empty without validation.
    pub fn close(self) -> Vec<String> {
        let messages = self.vulkan.as_ref().map(|v| v.instance.messages.clone()).unwrap_or_default();
        drop(self);
        messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
