//! Strings of the caller.

use std::ffi::{CStr, c_char};

use engine::{Error, Result};

/// The string at `text`; `None` for NULL.
///
/// # Safety
/// `text` is NULL or ends with a zero, and lives through `'a`.
pub unsafe fn of<'a>(text: *const c_char, what: &str) -> Result<Option<&'a str>> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: as the caller states.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(Some).map_err(|_| Error::options(format!("`{what}` is not UTF-8"), "give UTF-8 text"))
}
