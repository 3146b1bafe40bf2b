//! The C interface: devices and sessions behind opaque handles. `include/thirdbounce.h` is made from this by `make header`.
//!
//! Every function returns a status, or cannot fail. After a status that is not `TB_OK`, `tb_last_error` and
//! `tb_last_remedy` tell this thread what was wrong and how to mend it. No panic crosses: it becomes `TB_DEFECT`.
//!
//! `unsafe` is here because C gives pointers; each block states what the header asks of the caller.

mod error;
mod frames;
mod log;
mod scan;
mod session;
mod settings;
mod sized;
mod text;
mod vulkan;

pub use error::{TB_PROBLEM_SETTINGS, TbProblem, TbStatus};
pub use frames::TbLatency;
pub use log::{TbLevel, TbLog};
pub use scan::TbScan;
pub use session::{TbFrame, TbSession};
pub use settings::{TbFeed, TbHear, TbProgress, TbSettings};
pub use vulkan::{
    TB_EXTENSIONS, TB_FEATURE_DEBUG_UTILS, TB_FEATURE_EXTERNAL_MEMORY_FD, TB_FEATURE_FLOAT_ATOMICS,
    TB_FEATURE_INT64_ATOMICS, TB_FEATURE_MEMORY_BUDGET, TB_FEATURE_PORTABILITY_SUBSET,
    TB_FEATURE_TIMELINE_SEMAPHORE, TbBuffer, TbFormat, TbFunction, TbLentFrame, TbMoment, TbPart,
    TbRequirements, TbVulkan,
};

use std::ffi::{CStr, CString, c_char};

use engine::Error;
use engine::gpu::{Gpu, GpuOptions};
use error::guarded;

/// Version of this interface. Structs may grow within a version: they begin with their size.
pub const TB_API_VERSION: u32 = 1;

/// An opened Vulkan device. Any thread may use it, and any number of sessions at once.
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

/// Opens a device into `device`. `api_version` is `TB_API_VERSION`: a library of another version refuses it. `name` is a
/// part of the device's name, its index or its UUID, or NULL for the best one. Any thread.
///
/// # Safety
/// `name` is NULL or a string that ends with a zero; `device` points to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_open(
    api_version: u32,
    name: *const c_char,
    device: *mut *mut TbDevice,
) -> TbStatus {
    guarded(|| {
        check_version(api_version)?;
        // SAFETY: the caller gives NULL or a string.
        let name = unsafe { text::of(name, "name")? };
        let gpu = Gpu::open(&GpuOptions { device: name.map(str::to_string), ..GpuOptions::default() })?;
        // SAFETY: the caller gives a pointer to write to.
        unsafe { sized::give_handle(device, TbDevice::of(gpu), "device") }
    })
}

/// The device's name; it lives as long as `device`. Any thread.
///
/// # Safety
/// `device` is open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_name(device: *const TbDevice) -> *const c_char {
    // SAFETY: the caller gives an open device, or NULL.
    unsafe { device.as_ref() }.map_or(c"".as_ptr(), |device| CStr::as_ptr(&device.name))
}

/// Gives a device back; NULL does nothing. Sessions keep what they need of it. Any thread, once.
///
/// # Safety
/// `device` is open, and nobody uses the handle meanwhile or afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_close(device: *mut TbDevice) {
    let _ = guarded(|| {
        if !device.is_null() {
            // SAFETY: `tb_device_open` made it, and the caller gives it back once.
            drop(unsafe { Box::from_raw(device) });
        }
        Ok(())
    });
}
