//! A program's own Vulkan: what to enable, a device of its handles, frames in its buffers.

use std::ffi::{c_char, c_void};
use std::mem::offset_of;
use std::sync::Arc;

use ash::vk::{self, Handle};
use engine::gpu::Gpu;
use engine::gpu::caller::{Features, Imported, Lent, Moment, QueueLock, Vulkan, requirements};
use engine::session::{Format, LentCounts, LentFrame};
use engine::{Error, Result};

use crate::error::{TbStatus, guarded, no_handle};
use crate::sized::{self, Versioned};
use crate::{TbDevice, TbSession};

/// A function of any kind: PFN_vkVoidFunction.
pub type TbFunction = Option<unsafe extern "C" fn()>;

/// Most extensions that `tb_requirements` names.
pub const TB_EXTENSIONS: usize = 8;

/// VkPhysicalDeviceVulkan12Features::timelineSemaphore. It must be enabled.
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
/// VK_EXT_debug_utils, of the instance.
pub const TB_FEATURE_DEBUG_UTILS: u32 = 64;

/// Handles of a program's own Vulkan. Zero everything, then set `size`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbVulkan {
    /// sizeof(tb_vulkan).
    pub size: usize,
    /// vkGetInstanceProcAddr of the loader that made the instance.
    pub get_instance_proc_addr: TbFunction,
    /// VkInstance, and VkApplicationInfo::apiVersion that it was made with: at least 1.2.
    pub instance: *mut c_void,
    pub api_version: u32,
    /// Family of `queue`. Not used by `tb_vulkan_requirements`, as all that follows.
    pub queue_family: u32,
    /// VkPhysicalDevice. `tb_vulkan_requirements` uses it, too.
    pub physical_device: *mut c_void,
    /// VkDevice, and a VkQueue of it that computes.
    pub device: *mut c_void,
    pub queue: *mut c_void,
    /// TB_FEATURE_ bits of what was enabled.
    pub enabled: u32,
    /// Not used: 0.
    pub reserved: u32,
    /// Called around submissions to the queue, by any thread; both NULL if nobody else uses the queue.
    pub lock: Option<unsafe extern "C" fn(user: *mut c_void)>,
    pub unlock: Option<unsafe extern "C" fn(user: *mut c_void)>,
    /// Given to both.
    pub user: *mut c_void,
    /// VkPipelineCache for the library's kernels; 0: one of its own.
    pub pipeline_cache: u64,
}

/// What a device is to be made with. Set `size` before the call.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbRequirements {
    /// sizeof(tb_requirements).
    pub size: usize,
    /// Least VkApplicationInfo::apiVersion.
    pub api_version: u32,
    /// A family whose queues compute; any other that computes will do.
    pub queue_family: u32,
    /// TB_FEATURE_ bits of what the device offers of that which the library uses: enable all, or less.
    pub features: u32,
    /// The extensions of the device for them; they live as long as the program.
    pub extension_count: u32,
    pub extensions: [*const c_char; TB_EXTENSIONS],
}

/// What counts in a buffer are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum TbFormat {
    /// 32-bit floats.
    TbF32 = 0,
    /// 32-bit unsigned integers.
    TbU32 = 1,
    /// 16-bit unsigned integers, two to a word.
    TbU16 = 2,
}

/// A part of a program's VkBuffer: whole words of 4 bytes.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbPart {
    /// VkBuffer; 0: none.
    pub buffer: u64,
    /// First byte, and how many.
    pub offset: u64,
    pub bytes: u64,
}

/// A value of a program's timeline semaphore.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbMoment {
    /// VkSemaphore; 0: none.
    pub semaphore: u64,
    /// Its value.
    pub value: u64,
}

/// A frame whose counts lie in a program's buffer, and whose maps go into one. Zero everything, then set `size`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbLentFrame {
    /// sizeof(tb_lent_frame).
    pub size: usize,
    /// The counts, those of bin b of pair p as number p * bins + b. The buffer has VK_BUFFER_USAGE_TRANSFER_SRC_BIT.
    pub counts: TbPart,
    /// Imported memory in place of `counts`; NULL: none.
    pub imported: *const TbBuffer,
    /// What they are: a tb_format.
    pub format: u32,
    /// Not used: 0.
    pub reserved: u32,
    /// The counts are there from then on; without a semaphore: now.
    pub after: TbMoment,
    /// Brought about when the counts were copied.
    pub taken: TbMoment,
    /// Where the maps go, as floats one after the other for n pixels: albedo, depth, normals (x, y, z of each), mask (1 or 0),
    /// confidence; `tb_session_maps_bytes` bytes. The buffer has VK_BUFFER_USAGE_TRANSFER_DST_BIT.
    pub maps: TbPart,
    /// Brought about when the maps are there.
    pub done: TbMoment,
}

/// A buffer over memory that another program or interface shares.
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
unsafe impl Versioned for TbLentFrame {
    const NAME: &'static str = "tb_lent_frame";
    const FIRST: usize = offset_of!(TbLentFrame, done) + size_of::<TbMoment>();
}

/// Says what a device of the program's own is to be made with: `vulkan` needs no more than an instance and a physical device.
/// Any thread.
///
/// # Safety
/// `vulkan` and `out` begin with their sizes. The handles are valid and belong together.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_vulkan_requirements(
    vulkan: *const TbVulkan,
    out: *mut TbRequirements,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller gives structs that begin with their sizes.
        let vulkan = unsafe {
            sized::size_of_target(out)?;
            sized::read(vulkan)?
        };
        let (load, instance) = vulkan.loader()?;
        let physical = vk::PhysicalDevice::from_raw(vulkan.physical_device as u64);
        // SAFETY: the caller gives handles that are valid and belong together.
        let found = unsafe { requirements(load, instance, vulkan.api_version, physical)? };
        let mut extensions = [std::ptr::null(); TB_EXTENSIONS];
        let names = found.extensions();
        names.iter().zip(&mut extensions).for_each(|(name, to)| *to = name.as_ptr());
        let told = TbRequirements {
            size: size_of::<TbRequirements>(),
            api_version: found.api_version,
            queue_family: found.family,
            features: bits_of(&found.features),
            extension_count: names.len() as u32,
            extensions,
        };
        // SAFETY: the caller gives a struct that begins with its size.
        unsafe { sized::write(out, &told) }
    })
}

/// Makes a device of a program's own handles into `device`: see `tb_device_open`. Nothing of them is destroyed by
/// `tb_device_close`. Any thread.
///
/// # Safety
/// `vulkan` begins with its size. The handles are valid, belong together, and live until the device and all sessions of it are
/// gone; `enabled` says no more than was enabled; `lock` and `unlock` may be called by any thread meanwhile. `device` points to a
/// pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_of_vulkan(
    api_version: u32,
    vulkan: *const TbVulkan,
    device: *mut *mut TbDevice,
) -> TbStatus {
    guarded(|| {
        crate::check_version(api_version)?;
        // SAFETY: the caller gives a struct that begins with its size.
        let vulkan = unsafe { sized::read(vulkan)? };
        let (load, instance) = vulkan.loader()?;
        if vulkan.device.is_null() || vulkan.queue.is_null() || vulkan.physical_device.is_null() {
            return Err(Error::options(
                "a handle of `tb_vulkan` is NULL",
                "give physical device, device and queue",
            ));
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
            enabled: features_of(vulkan.enabled),
            lock,
            blocks: None,
            pipeline_cache: vk::PipelineCache::from_raw(vulkan.pipeline_cache),
        };
        // SAFETY: as the caller states.
        let gpu = unsafe { Gpu::of_caller(&vulkan)? };
        // SAFETY: the caller gives a pointer to write to.
        unsafe { sized::give_handle(device, TbDevice::of(gpu), "device") }
    })
}

/// Begins to solve a frame in buffers of the program's, and returns: see `tb_session_submit`. The session was made with `lent`
/// in its settings. A frame that fails or is stopped brings its moments about, too. Any thread; calls for one session wait for each
/// other.
///
/// # Safety
/// `session` lives. `lent` begins with its size. Buffers and semaphores are of the session's device and live until the frame is
/// over; nobody writes the counts from `after` to `taken`, or uses the maps' buffer before `done`. `frame` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_submit_lent(
    session: *const TbSession,
    lent: *const TbLentFrame,
    frame: *mut u64,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller gives a living session, or NULL, and a struct that begins with its size.
        let (session, lent) =
            unsafe { (session.as_ref().ok_or_else(|| no_handle("session"))?, sized::read(lent)?) };
        // SAFETY: as the caller states.
        let lent = unsafe { lent.frame()? };
        let id = session.session().submit_lent(lent)?;
        // SAFETY: the caller gives a pointer to write to, or NULL.
        unsafe { sized::give(frame, id.0) };
        Ok(())
    })
}

/// Bytes of a frame's maps in a program's buffer; 0 without a session. Any thread.
///
/// # Safety
/// `session` lives, or is NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_maps_bytes(session: *const TbSession) -> u64 {
    // SAFETY: the caller gives a living session, or NULL.
    unsafe { session.as_ref() }.map_or(0, |session| session.session().lent_maps_bytes())
}

/// Imports memory of another program or interface (CUDA, another device of the same GPU) into `buffer`: the first `bytes` bytes
/// of the memory behind the opaque file descriptor `fd`, which has `memory_bytes` in all. The descriptor belongs to the library
/// afterwards, if this succeeds. The memory's type is taken to be the lowest that fits: where the exporter had a choice, use
/// `tb_buffer_import_fd_of_type`. Any thread.
///
/// # Safety
/// `device` is open. `fd` is one of memory of this GPU, of so many bytes. `buffer` points to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_buffer_import_fd(
    device: *const TbDevice,
    fd: i32,
    memory_bytes: u64,
    bytes: u64,
    buffer: *mut *mut TbBuffer,
) -> TbStatus {
    // SAFETY: as the caller states.
    unsafe { import(device, fd, memory_bytes, None, bytes, buffer) }
}

/// As `tb_buffer_import_fd`, for memory that was allocated with this VkMemoryAllocateInfo::memoryTypeIndex, which Vulkan asks to
/// be the same. Any thread.
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
    // SAFETY: as the caller states.
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
        // SAFETY: the caller gives an open device, or NULL.
        let device = unsafe { device.as_ref() }.ok_or_else(|| no_handle("device"))?;
        // SAFETY: as the caller states.
        let made = unsafe { Imported::by_fd(&device.gpu, fd, [memory_bytes, bytes], memory_type)? };
        // SAFETY: the caller gives a pointer to write to.
        unsafe { sized::give_handle(buffer, TbBuffer(made), "buffer") }
    })
}

/// Gives imported memory back; NULL does nothing. Frames that use it keep it. Any thread, once.
///
/// # Safety
/// `buffer` lives, and nobody uses the handle meanwhile or afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_buffer_free(buffer: *mut TbBuffer) {
    let _ = guarded(|| {
        if !buffer.is_null() {
            // SAFETY: `tb_buffer_import_fd` made it, and the caller gives it back once.
            drop(unsafe { Box::from_raw(buffer) });
        }
        Ok(())
    });
}

/// The features with their bits.
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
        let Some(load) = self.get_instance_proc_addr.filter(|_| !self.instance.is_null()) else {
            return Err(Error::options(
                "`tb_vulkan` has no instance, or no vkGetInstanceProcAddr",
                "give both: vkGetInstanceProcAddr as a function of the loader",
            ));
        };
        // SAFETY: both are functions; the header says which one this is.
        let load =
            unsafe { std::mem::transmute::<unsafe extern "C" fn(), vk::PFN_vkGetInstanceProcAddr>(load) };
        Ok((load, vk::Instance::from_raw(self.instance as u64)))
    }

    fn lock(&self) -> Result<Option<Arc<dyn QueueLock>>> {
        match (self.lock, self.unlock) {
            (None, None) => Ok(None),
            (Some(lock), Some(unlock)) => Ok(Some(Arc::new(Lock { lock, unlock, user: self.user }))),
            _ => Err(Error::options("`tb_vulkan` has one of `lock` and `unlock`", "give both, or none")),
        }
    }
}

struct Lock {
    lock: unsafe extern "C" fn(*mut c_void),
    unlock: unsafe extern "C" fn(*mut c_void),
    user: *mut c_void,
}

// SAFETY: the header asks for functions that any thread may call with `user`.
unsafe impl Send for Lock {}
// SAFETY: as above.
unsafe impl Sync for Lock {}

impl QueueLock for Lock {
    fn lock(&self) {
        // SAFETY: as the header asks.
        unsafe { (self.lock)(self.user) };
    }

    fn unlock(&self) {
        // SAFETY: as the header asks.
        unsafe { (self.unlock)(self.user) };
    }
}

impl TbPart {
    /// # Safety
    /// As [`Lent::new`].
    unsafe fn lent(&self) -> Result<Option<Lent>> {
        if self.buffer == 0 {
            return Ok(None);
        }
        // SAFETY: as the caller states.
        unsafe { Lent::new(vk::Buffer::from_raw(self.buffer), self.offset, self.bytes) }.map(Some)
    }
}

impl TbMoment {
    /// # Safety
    /// As [`Moment::new`].
    unsafe fn moment(&self) -> Option<Moment> {
        // SAFETY: as the caller states.
        (self.semaphore != 0)
            .then(|| unsafe { Moment::new(vk::Semaphore::from_raw(self.semaphore), self.value) })
    }
}

impl TbLentFrame {
    /// # Safety
    /// As `tb_session_submit_lent`.
    unsafe fn frame(&self) -> Result<LentFrame> {
        let format = match self.format {
            0 => Format::F32,
            1 => Format::U32,
            2 => Format::U16,
            other => {
                return Err(Error::options(
                    format!("{other} is no tb_format"),
                    "give TB_F32, TB_U32 or TB_U16",
                ));
            }
        };
        // SAFETY: as the caller states.
        unsafe {
            let counts = match self.imported.as_ref() {
                Some(TbBuffer(imported)) => Some(imported.lend()?),
                None => self.counts.lent()?,
            };
            let counts = counts.ok_or_else(|| {
                Error::options("`tb_lent_frame` has no counts", "give `counts`, or `imported` memory")
            })?;
            let (after, taken) = (self.after.moment(), self.taken.moment());
            Ok(LentFrame {
                counts: LentCounts { counts, format, after, taken },
                maps: self.maps.lent()?,
                done: self.done.moment(),
            })
        }
    }
}
