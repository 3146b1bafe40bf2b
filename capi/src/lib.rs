//! The C interface: devices and sessions as opaque handles. `make header` generates `include/thirdbounce.h` from it.
//!
//! Every function returns a status or cannot fail. After a status other than `TB_OK`, `tb_last_error` and
//! `tb_last_hint` return this thread's message and hint. Panics are converted to `TB_ERROR_DEFECT`.
//!
//! `unsafe` is required for C pointers; each block states the header's precondition.

mod devices;
mod error;
mod files;
mod frames;
mod log;
mod scan;
mod session;
mod settings;
mod sized;
mod text;
mod vulkan;

pub use devices::TbDeviceInfo;
pub use error::{TB_ERROR_INFO_SETTINGS, TbErrorInfo, TbStatus};
pub use frames::TbLatency;
pub use log::{TbLevel, TbLogCallback};
pub use scan::{TbCapture, TbScan};
pub use session::{TbFrame, TbSession};
pub use settings::{TbFramePolicy, TbProgress, TbProgressCallback, TbSettings};
pub use vulkan::{
    TB_EXTENSIONS, TB_FEATURE_DEBUG_UTILS, TB_FEATURE_EXTERNAL_MEMORY_FD, TB_FEATURE_FLOAT_ATOMICS,
    TB_FEATURE_INT64_ATOMICS, TB_FEATURE_MEMORY_BUDGET, TB_FEATURE_PORTABILITY_SUBSET,
    TB_FEATURE_TIMELINE_SEMAPHORE, TbBuffer, TbBufferRange, TbExternalFrame, TbFormat, TbRequirements,
    TbTimelinePoint, TbVoidFunction, TbVulkan,
};

use std::ffi::{CStr, CString, c_char};

use engine::Error;
use engine::gpu::{Gpu, GpuOptions};
use error::{free_handle, guarded};

/// Version of this interface. Structs may grow at their end within a version: they begin with their size.
pub const TB_API_VERSION: u32 = 1;

/// An opened device (of Vulkan, or the host), usable from any thread and by any number of sessions.
pub struct TbDevice {
    gpu: Gpu,
    name: CString,
}

impl TbDevice {
    fn of(gpu: Gpu) -> TbDevice {
        log::note(&format!("opened {}", gpu.info.name.trim()));
        let name = CString::new(gpu.info.name.trim().replace('\0', "")).unwrap_or_default();
        TbDevice { gpu, name }
    }
}

/// # Errors
/// The program was compiled for another version of this interface.
fn check_version(api_version: u32) -> engine::Result<()> {
    if api_version == TB_API_VERSION {
        return Ok(());
    }
    Err(Error::options(
        format!(
            "the program was compiled for version {api_version} of the interface, this library has {TB_API_VERSION}"
        ),
        "compile the program with this library's header",
    ))
}

/// Version of the library, "0.1.0". Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn tb_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Opens a device. `api_version` is `TB_API_VERSION`; a library of another version refuses it. `name` is a part of
/// the device's name, its index or its UUID, or NULL for the best device. Any thread.
///
/// # Safety
/// `name` is NULL or a zero-terminated string; `device` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_open(
    api_version: u32,
    name: *const c_char,
    device: *mut *mut TbDevice,
) -> TbStatus {
    guarded(|| {
        check_version(api_version)?;
        // SAFETY: the caller provides NULL or a string.
        let name = unsafe { text::of(name, "name")? };
        let gpu = Gpu::open(&GpuOptions { device: name.map(str::to_string), ..GpuOptions::default() })?;
        // SAFETY: the caller provides a writable pointer.
        unsafe { sized::give_handle(device, TbDevice::of(gpu), "device") }
    })
}

/// Name of the device, with the lifetime of `device`. Any thread.
///
/// # Safety
/// `device` is open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_name(device: *const TbDevice) -> *const c_char {
    // SAFETY: the caller provides an open device, or NULL.
    unsafe { device.as_ref() }.map_or(c"".as_ptr(), |device| CStr::as_ptr(&device.name))
}

/// Closes a device handle; NULL is ignored. Sessions keep the device alive. Any thread, once.
///
/// # Safety
/// `device` is open and not used concurrently or afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_close(device: *mut TbDevice) {
    // SAFETY: created by `tb_device_open` and closed once.
    unsafe { free_handle(device) };
}
