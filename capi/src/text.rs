//! Strings of the program.

use std::ffi::{CStr, c_char};

use engine::{Error, Result};

/// The string at `text`.
///
/// # Safety
/// As [`of`].
pub unsafe fn required<'a>(text: *const c_char, what: &str) -> Result<&'a str> {
    // SAFETY: guaranteed by the caller.
    unsafe { of(text, what)? }.ok_or_else(|| Error::options(format!("`{what}` is NULL"), "give a string"))
}

/// The string at `text`; `None` for NULL.
///
/// # Safety
/// `text` is NULL or zero-terminated, and lives for `'a`.
pub unsafe fn of<'a>(text: *const c_char, what: &str) -> Result<Option<&'a str>> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: guaranteed by the caller.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(Some).map_err(|_| Error::options(format!("`{what}` is not UTF-8"), "give UTF-8 text"))
}
