//! Status codes, and the last error of each thread.

use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::mem::offset_of;
use std::panic::{AssertUnwindSafe, catch_unwind};

use engine::advice::Remedy;
use engine::{Error, Kind, Result, panic_message};

use crate::log;
use crate::sized::{self, Versioned};

/// Status code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum TbStatus {
    /// Success.
    TbOk = 0,
    /// Invalid scan or counts.
    TbErrorInput = 1,
    /// Invalid argument or setting, or a call not allowed in the session's state.
    TbErrorOptions = 2,
    /// No such device, a missing feature, or a lost device.
    TbErrorDevice = 3,
    /// Out of host or device memory.
    TbErrorMemory = 4,
    /// A result could not be written.
    TbErrorOutput = 5,
    /// The frame was cancelled.
    TbErrorCancelled = 6,
    /// A defect of the library.
    TbErrorDefect = 7,
    /// No result yet.
    TbNotReady = 8,
}

/// Machine-readable details of an error. Set `size` before the call.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbErrorInfo {
    /// sizeof(tb_error_info).
    pub size: usize,
    /// Status of the call; TB_OK if none failed.
    pub status: TbStatus,
    /// Number of `settings`.
    pub setting_count: u32,
    /// Names of settings that may fix the error ("lateral", "memory"), with static lifetime.
    pub settings: [*const c_char; TB_ERROR_INFO_SETTINGS],
    /// Bytes requested and bytes available; 0 if unknown or not a memory error.
    pub requested_bytes: u64,
    pub available_bytes: u64,
}

/// Maximum number of settings in `tb_error_info`.
pub const TB_ERROR_INFO_SETTINGS: usize = 4;

// SAFETY: `repr(C)`, begins with its size; zero is TB_OK and valid for all fields.
unsafe impl Versioned for TbErrorInfo {
    const NAME: &'static str = "tb_error_info";
    const FIRST: usize = offset_of!(TbErrorInfo, available_bytes) + size_of::<u64>();
}

impl TbErrorInfo {
    fn none() -> TbErrorInfo {
        TbErrorInfo {
            size: size_of::<TbErrorInfo>(),
            status: TbStatus::TbOk,
            setting_count: 0,
            settings: [std::ptr::null(); TB_ERROR_INFO_SETTINGS],
            requested_bytes: 0,
            available_bytes: 0,
        }
    }

    fn of(status: TbStatus, error: &Error) -> TbErrorInfo {
        let mut info = TbErrorInfo { status, ..TbErrorInfo::none() };
        for remedy in error.hint.remedies() {
            match remedy {
                Remedy::Set(setting) => {
                    let at = info.setting_count as usize;
                    if let Some(place) = info.settings.get_mut(at) {
                        *place = setting.c_name().as_ptr();
                        info.setting_count += 1;
                    }
                }
                Remedy::SmallerJob { asked, available } => {
                    (info.requested_bytes, info.available_bytes) =
                        (asked.unwrap_or(0), available.unwrap_or(0));
                }
            }
        }
        info
    }
}

struct LastError {
    what: CString,
    hint: CString,
    info: TbErrorInfo,
}

impl Default for LastError {
    fn default() -> LastError {
        LastError { what: CString::default(), hint: CString::default(), info: TbErrorInfo::none() }
    }
}

thread_local! {
    static LAST: RefCell<LastError> = RefCell::default();
}

/// Message of this thread's last failed call; empty without one. Valid until this thread's next failed call.
#[unsafe(no_mangle)]
pub extern "C" fn tb_last_error() -> *const c_char {
    LAST.with_borrow(|last| last.what.as_ptr())
}

/// Hint for fixing that error. Lifetime as for `tb_last_error`.
#[unsafe(no_mangle)]
pub extern "C" fn tb_last_hint() -> *const c_char {
    LAST.with_borrow(|last| last.hint.as_ptr())
}

/// Writes the details of that error to `info`. Returns TB_ERROR_OPTIONS if `info` is NULL or too small; the last
/// error is unchanged.
///
/// # Safety
/// `info` begins with its size and is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_last_error_info(info: *mut TbErrorInfo) -> TbStatus {
    // SAFETY: the caller provides a struct that begins with its size.
    match LAST.with_borrow(|last| unsafe { sized::write(info, &last.info) }) {
        Ok(()) => TbStatus::TbOk,
        Err(_) => TbStatus::TbErrorOptions,
    }
}

/// Error for a NULL handle.
pub fn no_handle(what: &str) -> Error {
    Error::options(format!("`{what}` is NULL"), "give a valid handle")
}

/// Names what is NULL, with its verb; `None` if nothing is.
pub fn null_of<const N: usize>(all: [(bool, &str); N]) -> Option<String> {
    let names: Vec<String> =
        all.iter().filter(|(null, _)| *null).map(|(_, name)| format!("`{name}`")).collect();
    let verb = if names.len() > 1 { "are" } else { "is" };
    (!names.is_empty()).then(|| format!("{} {verb}", names.join(" and ")))
}

/// Runs the body of a call, records its error for the thread, and converts panics.
pub fn guarded(body: impl FnOnce() -> Result<()>) -> TbStatus {
    let done = catch_unwind(AssertUnwindSafe(|| match body() {
        Ok(()) => TbStatus::TbOk,
        Err(error) => keep(status_of(error.kind), &error),
    }));
    done.unwrap_or_else(|panic| {
        let hint = "report it; handles that the call used must not be used again";
        let text = panic_message(&*panic).unwrap_or("a defect");
        keep(TbStatus::TbErrorDefect, &Error::device(text, hint))
    })
}

/// Frees a handle; NULL is ignored.
///
/// # Safety
/// `handle` is NULL, or comes from [`sized::give_handle`] and is not used concurrently or afterwards.
pub unsafe fn free_handle<T>(handle: *mut T) {
    let _ = guarded(|| {
        if !handle.is_null() {
            // SAFETY: guaranteed by the caller.
            drop(unsafe { Box::from_raw(handle) });
        }
        Ok(())
    });
}

fn status_of(kind: Kind) -> TbStatus {
    match kind {
        Kind::Input => TbStatus::TbErrorInput,
        Kind::Options => TbStatus::TbErrorOptions,
        Kind::Device => TbStatus::TbErrorDevice,
        Kind::Memory => TbStatus::TbErrorMemory,
        Kind::Output => TbStatus::TbErrorOutput,
        Kind::Cancelled => TbStatus::TbErrorCancelled,
    }
}

fn keep(status: TbStatus, error: &Error) -> TbStatus {
    let text = |text: &str| CString::new(text.replace('\0', "")).unwrap_or_default();
    let info = TbErrorInfo::of(status, error);
    LAST.set(LastError { what: text(&error.what), hint: text(&error.hint.to_string()), info });
    log::error(&error.what);
    status
}
