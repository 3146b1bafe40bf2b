//! What the library tells the program beside statuses.

use std::ffi::{CString, c_char, c_void};
use std::sync::{Mutex, PoisonError};

/// What a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum TbLevel {
    /// What the library did.
    TbNote = 0,
    /// Why a call failed.
    TbError = 1,
    /// What looks wrong with a result.
    TbWarning = 2,
}

/// Receives messages. `text` is valid during the call.
pub type TbLog = Option<unsafe extern "C" fn(user: *mut c_void, level: TbLevel, text: *const c_char)>;

struct Sink {
    log: TbLog,
    user: *mut c_void,
}

// SAFETY: the pointer is only handed to `log`, which `tb_set_log` asks to be callable from any thread.
unsafe impl Send for Sink {}

static SINK: Mutex<Sink> = Mutex::new(Sink { log: None, user: std::ptr::null_mut() });

/// Sends messages to `log` from now on, with `user`; NULL sends none. Any thread. `log` is called by any thread that calls
/// the library, one at a time, and must not call the library itself.
///
/// # Safety
/// `log` may be called with `user` until another one is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_set_log(log: TbLog, user: *mut c_void) {
    *SINK.lock().unwrap_or_else(PoisonError::into_inner) = Sink { log, user };
}

pub fn note(text: &str) {
    tell(TbLevel::TbNote, text);
}

pub fn warning(text: &str) {
    tell(TbLevel::TbWarning, text);
}

pub fn error(text: &str) {
    tell(TbLevel::TbError, text);
}

fn tell(level: TbLevel, text: &str) {
    let sink = SINK.lock().unwrap_or_else(PoisonError::into_inner);
    if let (Some(log), Ok(text)) = (sink.log, CString::new(text.replace('\0', ""))) {
        // SAFETY: `tb_set_log` was told that it may be called so.
        unsafe { log(sink.user, level, text.as_ptr()) };
    }
}
