//! Status codes, and the last error of each thread.

use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::mem::offset_of;
use std::panic::{AssertUnwindSafe, catch_unwind};

use engine::advice::Remedy;
use engine::{Error, Kind, Result, panic_message};

use crate::log;
use crate::sized::{self, Versioned};

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

/// What was wrong, for programs. Set `size` before the call.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbProblem {
    /// sizeof(tb_problem).
    pub size: usize,
    /// The status of the call; TB_OK if none failed.
    pub status: TbStatus,
    /// How many of `settings` are there.
    pub setting_count: u32,
    /// The settings that may mend it, by their names in the library ("lateral", "memory"). They live as long as the program.
    pub settings: [*const c_char; TB_PROBLEM_SETTINGS],
    /// What was asked for and what there is, bytes; 0 if unknown or if it is not about memory.
    pub asked: u64,
    pub available: u64,
}

/// Most settings that a `tb_problem` names.
pub const TB_PROBLEM_SETTINGS: usize = 4;

// SAFETY: it is `repr(C)` and begins with its size; zero is TB_OK, and valid for all fields.
unsafe impl Versioned for TbProblem {
    const NAME: &'static str = "tb_problem";
    const FIRST: usize = offset_of!(TbProblem, available) + size_of::<u64>();
}

impl TbProblem {
    fn none() -> TbProblem {
        TbProblem {
            size: size_of::<TbProblem>(),
            status: TbStatus::TbOk,
            setting_count: 0,
            settings: [std::ptr::null(); TB_PROBLEM_SETTINGS],
            asked: 0,
            available: 0,
        }
    }

    fn of(status: TbStatus, error: &Error) -> TbProblem {
        let mut problem = TbProblem { status, ..TbProblem::none() };
        for remedy in error.mend.remedies() {
            match remedy {
                Remedy::Set(setting) => {
                    let at = problem.setting_count as usize;
                    if let Some(place) = problem.settings.get_mut(at) {
                        *place = setting.c_name().as_ptr();
                        problem.setting_count += 1;
                    }
                }
                Remedy::SmallerJob { asked, available } => {
                    (problem.asked, problem.available) = (asked.unwrap_or(0), available.unwrap_or(0));
                }
            }
        }
        problem
    }
}

struct Last {
    what: CString,
    mend: CString,
    problem: TbProblem,
}

impl Default for Last {
    fn default() -> Last {
        Last { what: CString::default(), mend: CString::default(), problem: TbProblem::none() }
    }
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

/// The same in numbers and names: writes it to `problem`. TB_OPTIONS if `problem` is NULL or too small; the last error stays.
///
/// # Safety
/// `problem` begins with its size, and may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_last_problem(problem: *mut TbProblem) -> TbStatus {
    // SAFETY: the caller gives a struct that begins with its size.
    match LAST.with_borrow(|last| unsafe { sized::write(problem, &last.problem) }) {
        Ok(()) => TbStatus::TbOk,
        Err(_) => TbStatus::TbOptions,
    }
}

/// The error of a handle that is NULL.
pub fn no_handle(what: &str) -> Error {
    Error::options(format!("`{what}` is NULL"), "give the handle that was made")
}

/// Runs the body of a call. Keeps its error for the thread, and stops panics.
pub fn guarded(body: impl FnOnce() -> Result<()>) -> TbStatus {
    let done = catch_unwind(AssertUnwindSafe(|| match body() {
        Ok(()) => TbStatus::TbOk,
        Err(error) => keep(status_of(error.kind), &error),
    }));
    done.unwrap_or_else(|panic| {
        let mend = "report it; handles that the call used must not be used again";
        let text = panic_message(&*panic).unwrap_or("a defect");
        keep(TbStatus::TbDefect, &Error::device(text, mend))
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

fn keep(status: TbStatus, error: &Error) -> TbStatus {
    let text = |text: &str| CString::new(text.replace('\0', "")).unwrap_or_default();
    let problem = TbProblem::of(status, error);
    LAST.set(Last { what: text(&error.what), mend: text(&error.mend.to_string()), problem });
    log::error(&error.what);
    status
}
