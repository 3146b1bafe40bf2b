//! Captures from files, and maps to files.

use std::ffi::c_char;

use engine::capture::Capture;
use engine::maps::Maps;
use engine::{Error, Result, Settings};

use crate::error::{TbStatus, guarded, no_handle};
use crate::scan::TbCapture;
use crate::session::TbSession;
use crate::{settings, sized, text};

/// Reads a capture of any format and prepares it as `thirdbounce reconstruct` does. `options` are those of the capture as
/// "name=value name=value", with names of the command line ("wall=2m stride=2"); NULL: none. Any thread.
///
/// # Safety
/// `path` and `options` are NULL or zero-terminated strings; `capture` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_read(
    path: *const c_char,
    options: *const c_char,
    capture: *mut *mut TbCapture,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides NULL or strings.
        let (path, options) = unsafe { (text::required(path, "path")?, text::of(options, "options")?) };
        let mut chosen = Settings::default();
        settings::set_all(&mut chosen, options.unwrap_or_default())?;
        let read = read(path, &chosen)?;
        // SAFETY: the caller provides a writable pointer.
        unsafe { sized::give_handle(capture, TbCapture(read), "capture") }
    })
}

/// Saves the maps of the last frame that `tb_session_wait` returned into `folder`, which is created: maps.npz, maps.mat,
/// maps.exr, pictures, points and mesh. Any thread; calls on one session are serialised.
///
/// # Safety
/// `session` is valid. `folder` is a zero-terminated string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_save(session: *const TbSession, folder: *const c_char) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides a valid session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        // SAFETY: the caller provides a string, or NULL.
        let folder = unsafe { text::required(folder, "folder")? };
        let maps = session.session().last().map(|frame| frame.result.maps.clone());
        let none =
            || Error::options("the session has no maps yet", "save after tb_session_wait returned a frame");
        write(folder, &maps.ok_or_else(none)?)
    })
}

#[cfg(feature = "formats")]
fn read(path: &str, settings: &Settings) -> Result<Capture> {
    let loaded = engine::job::load(path.as_ref(), settings)?;
    loaded.notes.iter().for_each(|note| crate::log::note(note));
    loaded.warnings.iter().for_each(|warning| crate::log::warning(warning));
    Ok(loaded.capture)
}

#[cfg(feature = "formats")]
fn write(folder: &str, maps: &Maps) -> Result<()> {
    engine::write(folder, maps).map(drop)
}

#[cfg(not(feature = "formats"))]
fn read(_: &str, _: &Settings) -> Result<Capture> {
    Err(without_formats())
}

#[cfg(not(feature = "formats"))]
fn write(_: &str, _: &Maps) -> Result<()> {
    Err(without_formats())
}

#[cfg(not(feature = "formats"))]
fn without_formats() -> Error {
    Error::options(
        "this library was built without files",
        "build thirdbounce-capi with its feature `formats`",
    )
}
