//! Frames with a part of a scan, and how long frames take.

use std::mem::offset_of;

use engine::Error;
use engine::session::Latency;

use crate::error::{TbStatus, guarded, no_handle};
use crate::session::TbSession;
use crate::sized::{self, Versioned};

/// Times of the last frames, up to 256, from submission to result, seconds: what waits is included.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbLatency {
    /// sizeof(tb_latency): set it before the call.
    pub size: usize,
    /// Frames that were solved.
    pub frames: u64,
    /// Frames that were submitted and never solved, as newer ones replaced them.
    pub dropped: u64,
    /// The last frame's time, and those that half, nine of ten and ninety-nine of a hundred frames do not exceed.
    pub last: f64,
    pub median: f64,
    pub p90: f64,
    pub p99: f64,
    /// Results in a second, while frames came; 0 before the second one.
    pub frames_per_second: f64,
}

// SAFETY: it is `repr(C)` and begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbLatency {
    const NAME: &'static str = "tb_latency";
    const FIRST: usize = offset_of!(TbLatency, frames_per_second) + size_of::<f64>();
}

impl TbLatency {
    fn of(told: Latency) -> TbLatency {
        TbLatency {
            size: size_of::<TbLatency>(),
            frames: told.frames,
            dropped: told.dropped,
            last: told.last.as_secs_f64(),
            median: told.median.as_secs_f64(),
            p90: told.p90.as_secs_f64(),
            p99: told.p99.as_secs_f64(),
            frames_per_second: told.frames_per_second,
        }
    }
}

/// As `tb_session_submit`, for a scan that goes on: only pairs whose byte in `measured`, `pairs` of them, is not 0 have new
/// counts. The others keep those of the frames before; their places in `counts` are not read as counts, but must be finite. Pairs
/// that were never measured are dark.
///
/// # Safety
/// `session` lives. `counts` holds `count` numbers, and `measured` `pairs` bytes. `frame` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_submit_part(
    session: *const TbSession,
    counts: *const f32,
    count: usize,
    measured: *const u8,
    pairs: usize,
    frame: *mut u64,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller gives a living session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        if counts.is_null() || measured.is_null() {
            return Err(Error::options("`counts` or `measured` is NULL", "give both"));
        }
        // SAFETY: so many numbers and bytes are there, as the caller states.
        let (counts, measured) = unsafe {
            (std::slice::from_raw_parts(counts, count), std::slice::from_raw_parts(measured, pairs))
        };
        let measured: Vec<bool> = measured.iter().map(|byte| *byte != 0).collect();
        let id = session.submitter.submit_part(counts, &measured)?;
        // SAFETY: the caller gives a pointer to write to, or NULL.
        unsafe { sized::give(frame, id.0) };
        Ok(())
    })
}

/// How long the last frames took, into `latency`. Any thread, also while another one waits.
///
/// # Safety
/// `session` lives. `latency` begins with its size, and may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_latency(session: *const TbSession, latency: *mut TbLatency) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller gives a living session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        let told = session.submitter.latency();
        // SAFETY: the caller gives a struct that begins with its size.
        unsafe { sized::write(latency, &TbLatency::of(told)) }
    })
}
