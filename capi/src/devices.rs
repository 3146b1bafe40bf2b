//! The list of devices.

use std::ffi::c_char;
use std::mem::offset_of;

use engine::gpu::{DeviceInfo, devices};
use engine::{Error, Result};

use crate::error::{TbStatus, guarded};
use crate::sized::{self, Versioned};

/// A device of this machine: of Vulkan, or the host. Texts end with a zero byte; longer ones are cut.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbDeviceInfo {
    /// sizeof(tb_device_info): set it before the call.
    pub size: usize,
    /// Bytes of the largest device-local heap; of the host, bytes that are available.
    pub memory_bytes: u64,
    /// Name, a part of which `tb_device_open` accepts.
    pub name: [c_char; 256],
    /// Name and version of the driver.
    pub driver: [c_char; 256],
    /// "discrete GPU", "integrated GPU", "virtual GPU", "host", "CPU" or "other".
    pub kind: [c_char; 16],
    /// UUID as 32 hexadecimal digits, which `tb_device_open` accepts, identical in CUDA.
    pub uuid: [c_char; 40],
}

// SAFETY: `repr(C)`, begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbDeviceInfo {
    const NAME: &'static str = "tb_device_info";
    const FIRST: usize = offset_of!(TbDeviceInfo, uuid) + size_of::<[c_char; 40]>();
}

impl TbDeviceInfo {
    fn of(info: &DeviceInfo) -> TbDeviceInfo {
        TbDeviceInfo {
            size: size_of::<TbDeviceInfo>(),
            memory_bytes: info.memory,
            name: chars(info.name.trim()),
            driver: chars(info.driver.trim()),
            kind: chars(&info.kind.to_string()),
            uuid: chars(&info.uuid),
        }
    }
}

/// A text with a zero byte at its end, cut between two characters.
fn chars<const N: usize>(text: &str) -> [c_char; N] {
    let mut out = [0; N];
    let end = (0..text.len().min(N - 1) + 1).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
    for (to, byte) in out.iter_mut().zip(&text.as_bytes()[..end]) {
        *to = *byte as c_char;
    }
    out
}

/// Writes the number of devices to `count`. Any thread.
///
/// # Safety
/// `count` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_count(count: *mut u32) -> TbStatus {
    guarded(|| {
        let all = devices();
        // SAFETY: the caller provides a writable pointer, or NULL.
        match unsafe { count.as_mut() } {
            Some(count) => *count = u32::try_from(all.len()).unwrap_or(u32::MAX),
            None => return Err(Error::options("count is NULL", "give a pointer to a number")),
        }
        Ok(())
    })
}

/// Writes the device of this index, from 0, to `info`. The index as text opens it. Any thread.
///
/// # Safety
/// `info` begins with its size and is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_device_info_at(index: u32, info: *mut TbDeviceInfo) -> TbStatus {
    guarded(|| {
        let all = devices();
        let found: Result<&DeviceInfo> = all.iter().find(|d| d.index == index as usize).ok_or_else(|| {
            Error::options(
                format!("there is no device {index}, there are {}", all.len()),
                "give an index below that of tb_device_count",
            )
        });
        // SAFETY: guaranteed by the caller.
        unsafe { sized::write(info, &TbDeviceInfo::of(found?)) }
    })
}
