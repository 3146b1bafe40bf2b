//! Frames that come while one is solved, parts of a scan, and how long frames take.

use std::mem::offset_of;

use engine::Result;
use engine::session::{Feed, Latency};

use crate::error::{TbStatus, guarded, options_error};
use crate::session::{TbSession, TbSettings, no_handle};
use crate::sized::{self, Versioned};

/// What becomes of a frame that is submitted while another one is being solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum TbFeed {
    /// It is refused: TB_OPTIONS.
    TbOne = 0,
    /// It waits, in the place of the one that waited.
    TbNewest = 1,
    /// It waits behind all others, up to `waiting` of tb_settings. Each is solved, once the result before it was taken.
    TbEvery = 2,
    /// It is added to a running sum, which was multiplied by `decay` of tb_settings before, and is solved as soon as that is
    /// possible.
    TbSum = 3,
}

/// Frames that wait if nobody says how many may.
const WAITING: usize = 16;

/// The feed that settings ask for.
pub fn of(settings: &TbSettings) -> Result<Feed> {
    const ONE: u32 = TbFeed::TbOne as u32;
    const NEWEST: u32 = TbFeed::TbNewest as u32;
    const EVERY: u32 = TbFeed::TbEvery as u32;
    const SUM: u32 = TbFeed::TbSum as u32;
    match settings.feed {
        ONE => Ok(Feed::One),
        NEWEST => Ok(Feed::Newest),
        EVERY => Ok(Feed::Every { most: if settings.waiting > 0 { settings.waiting } else { WAITING } }),
        SUM => Ok(Feed::Sum { decay: settings.decay }),
        other => {
            Err(options_error(format!("`feed` is {other}"), "give TB_ONE, TB_NEWEST, TB_EVERY or TB_SUM"))
        }
    }
}

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
            return Err(options_error("`counts` or `measured` is NULL", "give both"));
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
