//! Log messages.

use std::ffi::{CString, c_char, c_void};
use std::sync::{Mutex, PoisonError};

/// Level of a log message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum TbLevel {
    /// Information on the library's actions.
    TbLevelNote = 0,
    /// Reason of a failed call.
    TbLevelError = 1,
    /// Warning about a result.
    TbLevelWarning = 2,
}

/// Receives log messages. `text` is valid during the call.
pub type TbLogCallback =
    Option<unsafe extern "C" fn(user_data: *mut c_void, level: TbLevel, text: *const c_char)>;

struct Sink {
    log: TbLogCallback,
    user_data: *mut c_void,
}

// SAFETY: the pointer is only passed to `log`, which must be callable from any thread.
unsafe impl Send for Sink {}

static SINK: Mutex<Sink> = Mutex::new(Sink { log: None, user_data: std::ptr::null_mut() });

/// Sets the receiver of log messages; NULL disables logging. Any thread. `log` is called by any thread that calls the
/// library, one at a time, and must not call the library.
///
/// # Safety
/// `log` remains callable with `user_data` until it is replaced.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_set_log_callback(log: TbLogCallback, user_data: *mut c_void) {
    *SINK.lock().unwrap_or_else(PoisonError::into_inner) = Sink { log, user_data };
}

pub fn note(text: &str) {
    send(TbLevel::TbLevelNote, text);
}

pub fn warning(text: &str) {
    send(TbLevel::TbLevelWarning, text);
}

pub fn error(text: &str) {
    send(TbLevel::TbLevelError, text);
}

fn send(level: TbLevel, text: &str) {
    let sink = SINK.lock().unwrap_or_else(PoisonError::into_inner);
    if let (Some(log), Ok(text)) = (sink.log, CString::new(text.replace('\0', ""))) {
        // SAFETY: guaranteed by the caller of `tb_set_log_callback`.
        unsafe { log(sink.user_data, level, text.as_ptr()) };
    }
}
