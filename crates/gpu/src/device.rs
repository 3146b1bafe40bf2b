//! Choosing and opening a device.

use std::ops::Deref;
use std::path::PathBuf;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use ash::{ext, khr, vk};

use super::budget::Kinds;
use super::caller::{BlockSource, QueueLock};
use super::faults::{Faults, Struck};
use super::instance::{DeviceInfo, DeviceKind, Instance};
use super::kept::Cache;
use super::offered::Offered;
use super::owned::{OwnedDevice, Queue};
use super::pace::dispatch_of;
use super::recording::Recorder;
use crate::advice::{Remedy, advice};
use crate::{Error, Result};

/// The most storage buffers that a kernel binds. Vulkan promises 4; nearly all GPUs have 16 or more.
pub const MOST_STORAGE: u32 = 12;

/// How to open a device.
#[derive(Debug, Clone, Default)]
pub struct GpuOptions {
    /// Index in [`super::devices`], part of a name in any case, or a UUID; otherwise the best kind there is.
    pub device: Option<String>,
    /// Turn on the Khronos validation layer with synchronisation checks.
    pub validation: bool,
    /// Turn on the validation layer with checks of every access inside kernels (GPU-assisted validation) instead of
    /// synchronisation checks. Slow. Needs kernels that were compiled without optimisation (`build.rs`).
    #[doc(hidden)]
    pub instrumented: bool,
    /// Have the device check the bounds of buffers where it can (`robustBufferAccess`). Costs time.
    #[doc(hidden)]
    pub robust: bool,
    /// Time every command by itself and record the timeline of host and device: [`Gpu::take_recording`].
    pub timings: bool,
    /// Ask the driver for statistics of the kernels that it compiles: [`Gpu::compile`].
    #[doc(hidden)]
    pub statistics: bool,
    /// Ask it for their listings, too. Some drivers then compile every kernel anew, whatever a cache holds.
    #[doc(hidden)]
    pub listings: bool,
    /// Turns of kernels' main loops in a dispatch and in a submission at most, for a device whose driver has a shorter
    /// time limit than others; otherwise by its kind, and submissions by how fast it is.
    #[doc(hidden)]
    pub work: Option<u64>,
    /// Bytes of a buffer at most that kernels bind, to plan as for a device that binds less than this one; otherwise what it
    /// offers.
    #[doc(hidden)]
    pub binding: Option<u64>,
    /// Keep compiled kernels in this folder, in a file for each device and driver, and begin with those of earlier runs.
    pub pipeline_cache: Option<PathBuf>,
    /// Faults to produce, for tests.
    #[doc(hidden)]
    pub faults: Faults,
}

/// Optional ways to add to memory that a device offers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Accumulations {
    /// fp32 atomic add on buffers.
    pub float: bool,
    /// 64-bit integer atomic add on buffers.
    pub int64: bool,
}

/// Limits that plans are made against.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Largest binding of one buffer in bytes, which is no larger than one allocation.
    pub storage_range: u64,
    /// Largest binding of one buffer as texels, in texels.
    pub texels: u64,
    /// Invocations in a workgroup at most, however they are shared among x and y.
    pub workgroup_invocations: u32,
    /// Shared memory of a workgroup, bytes.
    pub shared_memory: u32,
    /// Workgroups in a dispatch at most, along x, y and z.
    pub groups: [u32; 3],
    /// Invocations in a subgroup.
    pub subgroup: u32,
    /// Turns of a kernel's main loop in a dispatch at most, over all invocations, so that it ends well before a driver
    /// takes the device for hung.
    pub work: u64,
}

impl Limits {
    fn binding_at_most(self, bytes: Option<u64>) -> Limits {
        Limits {
            storage_range: bytes.map_or(self.storage_range, |most| most.min(self.storage_range)),
            ..self
        }
    }
}

/// What a plan must know of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Abilities {
    /// What kind of device it is.
    pub kind: DeviceKind,
    /// How it adds to memory.
    pub accumulations: Accumulations,
    /// Its limits.
    pub limits: Limits,
}

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
    pub(super) struck: Option<Struck>,
    /// Bytes of one allocation at most.
    pub(super) allocation: u64,
    /// Where buffers lie.
    pub(super) kinds: Kinds,
    /// Bytes that arenas hold.
    pub(super) allocated: AtomicU64,
    pub(super) names: Option<ext::debug_utils::Device>,
    /// Compiled kernels.
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

/// What a driver reports of a device's limits.
pub(super) struct Reported {
    pub limits: vk::PhysicalDeviceLimits,
    /// Invocations in a subgroup.
    pub subgroup: u32,
    /// Bytes of one allocation at most.
    pub allocation: u64,
}

impl Reported {
    pub fn by(instance: &Instance, physical: vk::PhysicalDevice) -> Reported {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut memory = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut properties =
            vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup).push_next(&mut memory);
        // SAFETY: the physical device is the instance's; the chained structs, of Vulkan 1.1, outlive the call.
        unsafe { instance.raw.get_physical_device_properties2(physical, &mut properties) };
        let limits = properties.properties.limits;
        Reported { limits, subgroup: subgroup.subgroup_size, allocation: memory.max_memory_allocation_size }
    }

    /// Checks what no plan can do without, for the device of this name.
    ///
    /// # Errors
    /// Kernels bind more than it takes.
    pub fn check(&self, name: &str) -> Result<()> {
        let l = &self.limits;
        let of_set = l.max_descriptor_set_storage_buffers;
        let most = l.max_per_stage_descriptor_storage_buffers.min(of_set);
        if most >= MOST_STORAGE {
            return Ok(());
        }
        Err(Error::device(
            format!("{name} binds at most {most} storage buffers to a kernel, {MOST_STORAGE} are needed"),
            advice!["choose another device with " Device " (" [Devices] " lists them)"],
        ))
    }

    /// The limits of plans, for dispatches of so many turns.
    fn of_plans(&self, work: u64) -> Limits {
        let l = &self.limits;
        let [x, y, _] = l.max_compute_work_group_size;
        Limits {
            storage_range: u64::from(l.max_storage_buffer_range).min(self.allocation),
            texels: u64::from(l.max_texel_buffer_elements),
            workgroup_invocations: l.max_compute_work_group_invocations.min(x).min(y),
            shared_memory: l.max_compute_shared_memory_size,
            groups: l.max_compute_work_group_count,
            subgroup: self.subgroup,
            work,
        }
    }
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

    /// Opens every device that `options` name, with commas between them: each by itself, the same one as often as it is
    /// named.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_all(options: &GpuOptions) -> Result<Vec<Gpu>> {
        let open =
            |name: &str| Gpu::open(&GpuOptions { device: Some(name.trim().into()), ..options.clone() });
        match (Gpu::open(options), &options.device) {
            // A name may have a comma of its own.
            (Err(_), Some(names)) if names.contains(',') => names.split(',').map(open).collect(),
            (one, _) => one.map(|gpu| vec![gpu]),
        }
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
            struck: options.faults.any().then(|| Struck::new(options.faults)),
            kinds: Kinds::of(&instance, physical),
            allocated: AtomicU64::new(0),
            names,
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
                    format!("{name} was lost while {doing}{}", self.told()),
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

/// Whether a device has this UUID, with or without hyphens, or a name with this in it.
fn is_called(device: &DeviceInfo, text: &str) -> bool {
    let text = text.to_lowercase();
    device.uuid == text.replace('-', "") || device.name.to_lowercase().contains(&text)
}

fn choose(
    all: &[(vk::PhysicalDevice, DeviceInfo)],
    wanted: Option<&str>,
) -> Result<(vk::PhysicalDevice, DeviceInfo)> {
    let list = || all.iter().map(|(_, d)| format!("{}: {}", d.index, d.name)).collect::<Vec<_>>().join(", ");
    let found = match wanted {
        _ if all.is_empty() => {
            return Err(Error::device(
                "no Vulkan device on this machine",
                "install a driver: on Debian `apt-get install mesa-vulkan-drivers` (lavapipe runs on any CPU), or the vendor's driver",
            ));
        }
        // The first of several minima is taken: the loader's order decides among devices of a kind.
        None => all.iter().min_by_key(|(_, d)| d.kind),
        Some(text) => match text.parse::<usize>() {
            Ok(index) => all.get(index),
            Err(_) => all.iter().find(|(_, d)| is_called(d, text)),
        },
    };
    found.cloned().ok_or_else(|| {
        Error::options(
            format!("no device is called {:?}", wanted.unwrap_or_default()),
            advice!["give " Device " an index, part of a name or a UUID out of: " (list())],
        )
    })
}

/// A queue family that computes, one without graphics preferred, and whether it has timestamps.
pub(super) fn compute_family(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    info: &DeviceInfo,
) -> Result<(u32, bool)> {
    // SAFETY: the handle comes from this instance.
    let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
    (0u32..)
        .zip(&families)
        .filter(|(_, f)| f.queue_flags.contains(vk::QueueFlags::COMPUTE) && f.queue_count > 0)
        .min_by_key(|(_, f)| f.queue_flags.contains(vk::QueueFlags::GRAPHICS))
        .map(|(i, f)| (i, f.timestamp_valid_bits > 0))
        .ok_or_else(|| {
            Error::device(
                format!("{} has no compute queue", info.name),
                advice!["choose another device with " Device],
            )
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::advice::Setting;

    /// A device with no more than Vulkan promises, but so many storage buffers.
    fn least(storage: u32) -> Reported {
        let limits = vk::PhysicalDeviceLimits {
            max_storage_buffer_range: 1 << 27,
            max_texel_buffer_elements: 1 << 16,
            max_compute_work_group_invocations: 128,
            max_compute_work_group_size: [128, 128, 64],
            max_compute_shared_memory_size: 16_384,
            max_compute_work_group_count: [65_535; 3],
            max_per_stage_descriptor_storage_buffers: storage,
            max_descriptor_set_storage_buffers: 24,
            ..Default::default()
        };
        Reported { limits, subgroup: 32, allocation: 1 << 30 }
    }

    #[test]
    fn a_device_that_binds_too_little_is_refused() {
        least(MOST_STORAGE).check("a card").expect("just enough");
        let error = least(8).check("a card").expect_err("too few");
        assert!(
            error.what.contains("a card binds at most 8") && error.mend.names(Setting::Device),
            "{error}"
        );
        let mut reported = least(64);
        reported.limits.max_descriptor_set_storage_buffers = 11;
        assert!(reported.check("a card").is_err());
    }

    #[test]
    fn limits_are_the_least_of_those_that_hold() {
        let mut reported = least(16);
        let limits = |r: &Reported| r.of_plans(7);
        assert_eq!((limits(&reported).storage_range, limits(&reported).work), (1 << 27, 7));
        // A binding of 4 GiB is no use where an allocation has 1 GiB at most.
        reported.limits.max_storage_buffer_range = u32::MAX;
        assert_eq!(limits(&reported).storage_range, 1 << 30);
        assert_eq!(limits(&reported).binding_at_most(Some(1 << 40)).storage_range, 1 << 30);
        // Workgroups that gather are as high as lanes share a voxel.
        for size in [[128, 1024, 64], [1024, 128, 64], [1024, 1024, 64]] {
            reported.limits.max_compute_work_group_size = size;
            assert_eq!(limits(&reported).workgroup_invocations, 128, "{size:?}");
        }
    }

    #[test]
    fn the_fastest_kind_of_device_is_taken() {
        use DeviceKind::{Cpu, Discrete, Integrated, Other, Virtual};
        let info = |index, kind| DeviceInfo {
            index,
            name: format!("{kind}"),
            kind,
            driver: String::new(),
            api: String::new(),
            uuid: String::new(),
            memory: 0,
        };
        let taken = |kinds: &[DeviceKind]| {
            let all: Vec<_> =
                kinds.iter().enumerate().map(|(i, k)| (vk::PhysicalDevice::null(), info(i, *k))).collect();
            choose(&all, None).expect("a device").1.index
        };
        assert_eq!(taken(&[Other, Cpu, Integrated, Virtual, Discrete, Discrete]), 4);
        assert_eq!(taken(&[Other, Cpu, Integrated, Virtual]), 3, "a part of a card is faster than a chip");
        assert_eq!(taken(&[Other, Cpu, Integrated]), 2);
        assert_eq!(taken(&[Other, Cpu]), 1);
    }
}
