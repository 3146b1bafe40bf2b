//! Status codes, and the last error of each thread.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use engine::{Error, Kind, Result};

use crate::log;

/// How a call went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum TbStatus {
    /// It went well.
    TbOk = 0,
    /// The scan or the counts cannot be used.
    TbInput = 1,
    /// An argument or a setting is not valid, or does not fit what the session is doing.
    TbOptions = 2,
    /// No Vulkan device, a missing feature, a lost device.
    TbDevice = 3,
    /// Not enough memory.
    TbMemory = 4,
    /// Something could not be written.
    TbOutput = 5,
    /// The frame was stopped.
    TbCancelled = 6,
    /// A defect of the library.
    TbDefect = 7,
    /// No result yet.
    TbNotYet = 8,
}

#[derive(Default)]
struct Last {
    what: CString,
    mend: CString,
}

thread_local! {
    static LAST: RefCell<Last> = RefCell::default();
}

/// What was wrong at this thread's last call that failed; empty if none did. Valid until this thread's next call that
/// fails.
#[unsafe(no_mangle)]
pub extern "C" fn tb_last_error() -> *const c_char {
    LAST.with_borrow(|last| last.what.as_ptr())
}

/// How to mend it. As `tb_last_error`.
#[unsafe(no_mangle)]
pub extern "C" fn tb_last_remedy() -> *const c_char {
    LAST.with_borrow(|last| last.mend.as_ptr())
}

pub fn options_error(what: impl Into<String>, mend: &'static str) -> Error {
    Error::options(what, mend)
}

/// Runs the body of a call. Keeps its error for the thread, and stops panics.
pub fn guarded(body: impl FnOnce() -> Result<()>) -> TbStatus {
    let done = catch_unwind(AssertUnwindSafe(|| match body() {
        Ok(()) => TbStatus::TbOk,
        Err(error) => keep(status_of(error.kind), &error.what, &error.mend.to_string()),
    }));
    done.unwrap_or_else(|panic| {
        keep(
            TbStatus::TbDefect,
            &text_of(&*panic),
            "report it; handles that the call used must not be used again",
        )
    })
}

fn status_of(kind: Kind) -> TbStatus {
    match kind {
        Kind::Input => TbStatus::TbInput,
        Kind::Options => TbStatus::TbOptions,
        Kind::Device => TbStatus::TbDevice,
        Kind::Memory => TbStatus::TbMemory,
        Kind::Output => TbStatus::TbOutput,
        Kind::Cancelled => TbStatus::TbCancelled,
    }
}

fn keep(status: TbStatus, what: &str, mend: &str) -> TbStatus {
    let text = |text: &str| CString::new(text.replace('\0', "")).unwrap_or_default();
    LAST.set(Last { what: text(what), mend: text(mend) });
    log::error(what);
    status
}

fn text_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(|t| t.to_string())).unwrap_or("a defect".into())
}
