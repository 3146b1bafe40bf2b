//! An application's own Vulkan: requirements, devices from its handles, frames in its buffers.

use std::ffi::{c_char, c_void};
use std::mem::offset_of;
use std::sync::Arc;

use ash::vk::{self, Handle};
use engine::gpu::Gpu;
use engine::gpu::external::{
    ExternalBuffer, Features, Imported, QueueLock, TimelinePoint, Vulkan, requirements,
};
use engine::session::{ExternalCounts, ExternalFrame, Format};
use engine::{Error, Result};

use crate::error::{TbStatus, free_handle, guarded, no_handle, null_of};
use crate::sized::{self, Versioned};
use crate::{TbDevice, TbSession};

/// Generic function pointer: PFN_vkVoidFunction.
pub type TbVoidFunction = Option<unsafe extern "C" fn()>;

/// Maximum number of extensions in `tb_requirements`.
pub const TB_EXTENSIONS: usize = 8;

/// VkPhysicalDeviceVulkan12Features::timelineSemaphore. Required.
pub const TB_FEATURE_TIMELINE_SEMAPHORE: u32 = 1;
/// VkPhysicalDeviceFeatures::shaderInt64 and VkPhysicalDeviceVulkan12Features::shaderBufferInt64Atomics.
pub const TB_FEATURE_INT64_ATOMICS: u32 = 2;
/// VK_EXT_shader_atomic_float with shaderBufferFloat32AtomicAdd.
pub const TB_FEATURE_FLOAT_ATOMICS: u32 = 4;
/// VK_EXT_memory_budget.
pub const TB_FEATURE_MEMORY_BUDGET: u32 = 8;
/// VK_KHR_portability_subset.
pub const TB_FEATURE_PORTABILITY_SUBSET: u32 = 16;
/// VK_KHR_external_memory_fd.
pub const TB_FEATURE_EXTERNAL_MEMORY_FD: u32 = 32;
/// VK_EXT_debug_utils of the instance.
pub const TB_FEATURE_DEBUG_UTILS: u32 = 64;

/// Handles of an application's Vulkan. Zero-initialise, then set `size`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbVulkan {
    /// sizeof(tb_vulkan).
    pub size: usize,
    /// vkGetInstanceProcAddr of the loader that created the instance.
    pub get_instance_proc_addr: TbVoidFunction,
    /// VkInstance, and its VkApplicationInfo::apiVersion: at least 1.2.
    pub instance: *mut c_void,
    pub api_version: u32,
    /// Family of `queue`. This and the following fields are not used by `tb_vulkan_requirements`, except as noted.
    pub queue_family: u32,
    /// VkPhysicalDevice. Used by `tb_vulkan_requirements` as well.
    pub physical_device: *mut c_void,
    /// VkDevice, and a compute-capable VkQueue of it.
    pub device: *mut c_void,
    pub queue: *mut c_void,
    /// TB_FEATURE_ bits of the enabled features.
    pub enabled_features: u32,
    /// Reserved: 0.
    pub reserved: u32,
    /// Called around submissions to the queue, by any thread; both NULL if the queue is not used otherwise.
    pub lock: Option<unsafe extern "C" fn(user_data: *mut c_void)>,
    pub unlock: Option<unsafe extern "C" fn(user_data: *mut c_void)>,
    /// Passed to both.
    pub user_data: *mut c_void,
    /// VkPipelineCache for the library's kernels; 0: a cache of the library.
    pub pipeline_cache: u64,
}

/// Requirements for creating a device. Set `size` before the call.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbRequirements {
    /// sizeof(tb_requirements).
    pub size: usize,
    /// Minimum VkApplicationInfo::apiVersion.
    pub api_version: u32,
    /// A compute queue family; any other compute family is suitable.
    pub queue_family: u32,
    /// TB_FEATURE_ bits that the device offers and the library uses; any subset may be enabled.
    pub features: u32,
    /// Device extensions for these features, with static lifetime.
    pub extension_count: u32,
    pub extensions: [*const c_char; TB_EXTENSIONS],
}

/// Type of counts in a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum TbFormat {
    /// 32-bit floats.
    TbFormatF32 = 0,
    /// 32-bit unsigned integers.
    TbFormatU32 = 1,
    /// 16-bit unsigned integers, two per word.
    TbFormatU16 = 2,
}

/// A range of a VkBuffer, in whole words of 4 bytes.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbBufferRange {
    /// VkBuffer; 0: none.
    pub buffer: u64,
    /// Offset and size in bytes.
    pub offset: u64,
    pub bytes: u64,
}

/// A value of a timeline semaphore.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbTimelinePoint {
    /// VkSemaphore; 0: none.
    pub semaphore: u64,
    /// Semaphore value.
    pub value: u64,
}

/// A frame with counts, and optionally maps, in external buffers. Zero-initialise, then set `size`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbExternalFrame {
    /// sizeof(tb_external_frame).
    pub size: usize,
    /// Counts, bin b of pair p at element p * bins + b. The buffer has VK_BUFFER_USAGE_TRANSFER_SRC_BIT.
    pub counts: TbBufferRange,
    /// Imported memory instead of `counts`; NULL: none.
    pub imported: *const TbBuffer,
    /// Type of the counts: a tb_format.
    pub format: u32,
    /// Reserved: 0.
    pub reserved: u32,
    /// Point at which the counts are available; without a semaphore: immediately.
    pub counts_ready: TbTimelinePoint,
    /// Signalled once the counts are copied.
    pub counts_copied: TbTimelinePoint,
    /// Destination of the maps, as float planes of n pixels: albedo, depth, normals (x, y, z of each), mask (1 or 0),
    /// expected depth error; `tb_session_maps_bytes` bytes. The buffer has VK_BUFFER_USAGE_TRANSFER_DST_BIT.
    pub maps: TbBufferRange,
    /// Signalled once the maps are available.
    pub maps_ready: TbTimelinePoint,
}

/// A buffer over imported external memory.
pub struct TbBuffer(Imported);

// SAFETY: all are `repr(C)` and begin with their size; zero is valid for all fields.
unsafe impl Versioned for TbVulkan {
    const NAME: &'static str = "tb_vulkan";
    const FIRST: usize = offset_of!(TbVulkan, pipeline_cache) + size_of::<u64>();
}

// SAFETY: as above.
unsafe impl Versioned for TbRequirements {
    const NAME: &'static str = "tb_requirements";
    const FIRST: usize = offset_of!(TbRequirements, extensions) + size_of::<[*const c_char; TB_EXTENSIONS]>();
}

// SAFETY: as above.
unsafe impl Versioned for TbExternalFrame {
    const NAME: &'static str = "tb_external_frame";
    const FIRST: usize = offset_of!(TbExternalFrame, maps_ready) + size_of::<TbTimelinePoint>();
}

/// Writes the requirements for creating a device; only instance and physical device of `vulkan` are used. Any thread.
///
/// # Safety
/// `vulkan` and `out` begin with their sizes. The handles are valid and belong together.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_vulkan_requirements(
    vulkan: *const TbVulkan,
    out: *mut TbRequirements,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides structs that begin with their sizes.
        let vulkan = unsafe {
            sized::size_of_target(out)?;
            sized::read(vulkan)?
        };
        let (load, instance) = vulkan.loader()?;
        let physical = vk::PhysicalDevice::from_raw(vulkan.physical_device as u64);
        // SAFETY: the caller provides valid handles that belong together.
        let found = unsafe { requirements(load, instance, vulkan.api_version, physical)? };
        let mut extensions = [std::ptr::null(); TB_EXTENSIONS];
        let names = found.extensions();
        names.iter().zip(&mut extensions).for_each(|(name, to)| *to = name.as_ptr());
        let requirements = TbRequirements {
            size: size_of::<TbRequirements>(),
            api_version: found.api_version,
            queue_family: found.family,
            features: bits_of(&found.features),
            extension_count: names.len() as u32,
            extensions,
        };
        // SAFETY: the caller provides a struct that begins with its size.
        unsafe { sized::write(out, &requirements) }
    })
}

/// Creates a device from an application's handles: see `tb_device_open`. `tb_device_close` destroys none of them. Any
/// thread.
///
/// # Safety
/// `vulkan` begins with its size. The handles are valid, belong together, and outlive the device and all its
/// sessions; `enabled_features` has only enabled features; `lock` and `unlock` are callable by any thread meanwhile.
/// `device` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_from_vulkan(
    api_version: u32,
    vulkan: *const TbVulkan,
    device: *mut *mut TbDevice,
) -> TbStatus {
    guarded(|| {
        crate::check_version(api_version)?;
        // SAFETY: the caller provides a struct that begins with its size.
        let vulkan = unsafe { sized::read(vulkan)? };
        let (load, instance) = vulkan.loader()?;
        let handles = [
            (vulkan.physical_device.is_null(), "physical_device"),
            (vulkan.device.is_null(), "device"),
            (vulkan.queue.is_null(), "queue"),
        ];
        if let Some(what) = null_of(handles) {
            let hint = "give physical device, device and queue";
            return Err(Error::options(format!("{what} NULL in tb_vulkan"), hint));
        }
        let lock = vulkan.lock()?;
        let vulkan = Vulkan {
            get_instance_proc_addr: load,
            instance,
            api_version: vulkan.api_version,
            physical_device: vk::PhysicalDevice::from_raw(vulkan.physical_device as u64),
            device: vk::Device::from_raw(vulkan.device as u64),
            queue: vk::Queue::from_raw(vulkan.queue as u64),
            family: vulkan.queue_family,
            enabled: features_of(vulkan.enabled_features),
            lock,
            blocks: None,
            pipeline_cache: vk::PipelineCache::from_raw(vulkan.pipeline_cache),
        };
        // SAFETY: guaranteed by the caller.
        let gpu = unsafe { Gpu::of_external(&vulkan)? };
        // SAFETY: the caller provides a writable pointer.
        unsafe { sized::give_handle(device, TbDevice::of(gpu), "device") }
    })
}

/// Submits a frame in external buffers without waiting: see `tb_session_submit`. Requires `external_frames` in the
/// session's settings. Failed and cancelled frames signal their timeline points as well. Any thread; calls on one
/// session are serialised.
///
/// # Safety
/// `session` is valid. `external` begins with its size. Buffers and semaphores belong to the session's device and
/// live until the frame is finished; the counts are not written between `counts_ready` and `counts_copied`, and the
/// maps' buffer is not used before `maps_ready`. `frame` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_submit_external(
    session: *const TbSession,
    external: *const TbExternalFrame,
    frame: *mut u64,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides a valid session, or NULL, and a struct that begins with its size.
        let (session, external) =
            unsafe { (session.as_ref().ok_or_else(|| no_handle("session"))?, sized::read(external)?) };
        // SAFETY: guaranteed by the caller.
        let external = unsafe { external.frame()? };
        let id = session.session().submit_external(external)?;
        // SAFETY: the caller provides a writable pointer, or NULL.
        unsafe { sized::give(frame, id.0) };
        Ok(())
    })
}

/// Size of a frame's maps in an external buffer, bytes; 0 without a session. Any thread.
///
/// # Safety
/// `session` is valid or NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_maps_bytes(session: *const TbSession) -> u64 {
    // SAFETY: the caller provides a valid session, or NULL.
    unsafe { session.as_ref() }.map_or(0, |session| session.session().external_maps_bytes())
}

/// Imports external memory (of CUDA, or of another device on the same GPU): the first `bytes` bytes of the memory
/// behind the opaque file descriptor `fd`, whose allocation has `memory_bytes` bytes. On success the library owns the
/// descriptor. Assumes the lowest suitable memory type; otherwise use `tb_buffer_import_fd_of_type`. Any thread.
///
/// # Safety
/// `device` is open. `fd` refers to memory of this GPU of the given size. `buffer` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_buffer_import_fd(
    device: *const TbDevice,
    fd: i32,
    memory_bytes: u64,
    bytes: u64,
    buffer: *mut *mut TbBuffer,
) -> TbStatus {
    // SAFETY: guaranteed by the caller.
    unsafe { import(device, fd, memory_bytes, None, bytes, buffer) }
}

/// As `tb_buffer_import_fd`, for memory allocated with this VkMemoryAllocateInfo::memoryTypeIndex, which Vulkan
/// requires to match. Any thread.
///
/// # Safety
/// As `tb_buffer_import_fd`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_buffer_import_fd_of_type(
    device: *const TbDevice,
    fd: i32,
    memory_bytes: u64,
    memory_type: u32,
    bytes: u64,
    buffer: *mut *mut TbBuffer,
) -> TbStatus {
    // SAFETY: guaranteed by the caller.
    unsafe { import(device, fd, memory_bytes, Some(memory_type), bytes, buffer) }
}

unsafe fn import(
    device: *const TbDevice,
    fd: i32,
    memory_bytes: u64,
    memory_type: Option<u32>,
    bytes: u64,
    buffer: *mut *mut TbBuffer,
) -> TbStatus {
    guarded(|| {
        if buffer.is_null() {
            return Err(Error::options("`buffer` is NULL", "give a pointer to write to"));
        }
        // SAFETY: the caller provides an open device, or NULL.
        let device = unsafe { device.as_ref() }.ok_or_else(|| no_handle("device"))?;
        // SAFETY: guaranteed by the caller.
        let made = unsafe { Imported::by_fd(&device.gpu, fd, [memory_bytes, bytes], memory_type)? };
        // SAFETY: the caller provides a writable pointer.
        unsafe { sized::give_handle(buffer, TbBuffer(made), "buffer") }
    })
}

/// Frees imported memory; NULL is ignored. Frames that use it keep it alive. Any thread, once.
///
/// # Safety
/// `buffer` is valid and not used concurrently or afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_buffer_free(buffer: *mut TbBuffer) {
    // SAFETY: created by `tb_buffer_import_fd` and freed once.
    unsafe { free_handle(buffer) };
}

/// Features and their bits.
fn bits(features: &mut Features) -> [(&mut bool, u32); 7] {
    [
        (&mut features.timeline_semaphore, TB_FEATURE_TIMELINE_SEMAPHORE),
        (&mut features.int64_atomics, TB_FEATURE_INT64_ATOMICS),
        (&mut features.float_atomics, TB_FEATURE_FLOAT_ATOMICS),
        (&mut features.memory_budget, TB_FEATURE_MEMORY_BUDGET),
        (&mut features.portability_subset, TB_FEATURE_PORTABILITY_SUBSET),
        (&mut features.external_memory_fd, TB_FEATURE_EXTERNAL_MEMORY_FD),
        (&mut features.debug_utils, TB_FEATURE_DEBUG_UTILS),
    ]
}

fn bits_of(features: &Features) -> u32 {
    let mut features = *features;
    bits(&mut features).iter().filter(|(on, _)| **on).map(|(_, bit)| bit).sum()
}

fn features_of(all: u32) -> Features {
    let mut features = Features::default();
    bits(&mut features).into_iter().for_each(|(on, bit)| *on = all & bit != 0);
    features
}

impl TbVulkan {
    fn loader(&self) -> Result<(vk::PFN_vkGetInstanceProcAddr, vk::Instance)> {
        let load = self.get_instance_proc_addr;
        let given = [(self.instance.is_null(), "instance"), (load.is_none(), "get_instance_proc_addr")];
        let (None, Some(load)) = (null_of(given), load) else {
            let what = null_of(given).unwrap_or_default();
            return Err(Error::options(
                format!("{what} NULL in tb_vulkan"),
                "give both: vkGetInstanceProcAddr as a function of the loader",
            ));
        };
        // SAFETY: both are function pointers; the header specifies the type.
        let load =
            unsafe { std::mem::transmute::<unsafe extern "C" fn(), vk::PFN_vkGetInstanceProcAddr>(load) };
        Ok((load, vk::Instance::from_raw(self.instance as u64)))
    }

    fn lock(&self) -> Result<Option<Arc<dyn QueueLock>>> {
        match (self.lock, self.unlock) {
            (None, None) => Ok(None),
            (Some(lock), Some(unlock)) => Ok(Some(Arc::new(Lock { lock, unlock, user: self.user_data }))),
            _ => Err(Error::options("`tb_vulkan` has one of `lock` and `unlock`", "give both, or none")),
        }
    }
}

struct Lock {
    lock: unsafe extern "C" fn(*mut c_void),
    unlock: unsafe extern "C" fn(*mut c_void),
    user: *mut c_void,
}

// SAFETY: the header requires functions callable by any thread with `user_data`.
unsafe impl Send for Lock {}
// SAFETY: as above.
unsafe impl Sync for Lock {}

impl QueueLock for Lock {
    fn lock(&self) {
        // SAFETY: required by the header.
        unsafe { (self.lock)(self.user) };
    }

    fn unlock(&self) {
        // SAFETY: required by the header.
        unsafe { (self.unlock)(self.user) };
    }
}

impl TbBufferRange {
    /// # Safety
    /// As [`ExternalBuffer::new`].
    unsafe fn external(&self) -> Result<Option<ExternalBuffer>> {
        if self.buffer == 0 {
            return Ok(None);
        }
        // SAFETY: guaranteed by the caller.
        unsafe { ExternalBuffer::new(vk::Buffer::from_raw(self.buffer), self.offset, self.bytes) }.map(Some)
    }
}

impl TbTimelinePoint {
    /// # Safety
    /// As [`TimelinePoint::new`].
    unsafe fn moment(&self) -> Option<TimelinePoint> {
        // SAFETY: guaranteed by the caller.
        (self.semaphore != 0)
            .then(|| unsafe { TimelinePoint::new(vk::Semaphore::from_raw(self.semaphore), self.value) })
    }
}

impl TbExternalFrame {
    /// # Safety
    /// As `tb_session_submit_external`.
    unsafe fn frame(&self) -> Result<ExternalFrame> {
        let format = match self.format {
            0 => Format::F32,
            1 => Format::U32,
            2 => Format::U16,
            other => {
                return Err(Error::options(
                    format!("{other} is not a tb_format"),
                    "give TB_FORMAT_F32, TB_FORMAT_U32 or TB_FORMAT_U16",
                ));
            }
        };
        // SAFETY: guaranteed by the caller.
        unsafe {
            let counts = match self.imported.as_ref() {
                Some(TbBuffer(imported)) => Some(imported.lend()?),
                None => self.counts.external()?,
            };
            let counts = counts.ok_or_else(|| {
                Error::options("`tb_external_frame` has no counts", "give `counts`, or `imported` memory")
            })?;
            let (after, taken) = (self.counts_ready.moment(), self.counts_copied.moment());
            Ok(ExternalFrame {
                counts: ExternalCounts { counts, format, after, taken },
                maps: self.maps.external()?,
                done: self.maps_ready.moment(),
            })
        }
    }
}
