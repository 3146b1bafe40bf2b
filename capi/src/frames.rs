//! Frames of partial scans, and latency.

use std::mem::offset_of;

use engine::Error;
use engine::session::Latency;

use crate::error::{TbStatus, guarded, no_handle, null_of};
use crate::session::TbSession;
use crate::sized::{self, Versioned};

/// Latency of the last frames (at most 256) from submission to result, seconds, including queueing.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbLatency {
    /// sizeof(tb_latency): set it before the call.
    pub size: usize,
    /// Solved frames.
    pub frames: u64,
    /// Frames replaced by newer ones before they were solved.
    pub dropped: u64,
    /// Last frame, median, 90th and 99th percentile.
    pub last: f64,
    pub median: f64,
    pub p90: f64,
    pub p99: f64,
    /// Results per second while frames arrive; 0 before the second result.
    pub frames_per_second: f64,
}

// SAFETY: `repr(C)`, begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbLatency {
    const NAME: &'static str = "tb_latency";
    const FIRST: usize = offset_of!(TbLatency, frames_per_second) + size_of::<f64>();
}

impl TbLatency {
    fn of(measured: Latency) -> TbLatency {
        TbLatency {
            size: size_of::<TbLatency>(),
            frames: measured.frames,
            dropped: measured.dropped,
            last: measured.last.as_secs_f64(),
            median: measured.median.as_secs_f64(),
            p90: measured.p90.as_secs_f64(),
            p99: measured.p99.as_secs_f64(),
            frames_per_second: measured.frames_per_second,
        }
    }
}

/// As `tb_session_submit`, for a partial scan: only pairs whose byte in `measured` (`pairs` bytes) is nonzero have
/// new counts. Other pairs keep their previous counts; their values in `counts` are ignored but must be finite. Pairs
/// never measured are dark.
///
/// # Safety
/// `session` is valid. `counts` has `count` values and `measured` `pairs` bytes. `frame` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_submit_partial(
    session: *const TbSession,
    counts: *const f32,
    count: usize,
    measured: *const u8,
    pairs: usize,
    frame: *mut u64,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides a valid session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        if let Some(what) = null_of([(counts.is_null(), "counts"), (measured.is_null(), "measured")]) {
            return Err(Error::options(format!("{what} NULL"), "give the counts, and a byte for every pair"));
        }
        // SAFETY: the arrays have these lengths, as the caller guarantees.
        let (counts, measured) = unsafe {
            (std::slice::from_raw_parts(counts, count), std::slice::from_raw_parts(measured, pairs))
        };
        let measured: Vec<bool> = measured.iter().map(|byte| *byte != 0).collect();
        let id = session.submitter.submit_part(counts, &measured)?;
        // SAFETY: the caller provides a writable pointer, or NULL.
        unsafe { sized::give(frame, id.0) };
        Ok(())
    })
}

/// Writes the latency statistics to `latency`. Any thread, also during a wait of another one.
///
/// # Safety
/// `session` is valid. `latency` begins with its size and is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_latency(session: *const TbSession, latency: *mut TbLatency) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides a valid session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        let measured = session.submitter.latency();
        // SAFETY: the caller provides a struct that begins with its size.
        unsafe { sized::write(latency, &TbLatency::of(measured)) }
    })
}
