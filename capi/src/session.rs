//! Sessions: solves of frames of one scan.

use std::mem::offset_of;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use engine::engine::Progress;
use engine::session::{Canceller, Frame, FrameId, Session, SessionOptions, Submitter};
use engine::{Error, Settings};

use crate::error::{TbStatus, free_handle, guarded, no_handle};
use crate::scan::TbScan;
use crate::settings::TbSettings;
use crate::sized::{self, Versioned};
use crate::{TbDevice, log};

/// A solved frame. All arrays belong to the session and remain valid until the next `tb_session_wait` that returns a
/// frame, and until the session is freed. Pixel [ix * ny + iy] is at ix along +x and iy along +y.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbFrame {
    /// sizeof(tb_frame): set it before the call.
    pub size: usize,
    /// Frame number.
    pub id: u64,
    /// Pixels along x and y.
    pub nx: usize,
    pub ny: usize,
    /// Outer edges of the pixels, metres: x min, x max, y min, y max.
    pub extent: [f64; 4],
    /// Albedo, in units of the scaled counts.
    pub albedo: *const f32,
    /// Depth, metres; NaN without surface.
    pub depth: *const f32,
    /// Unit normals toward the wall, x, y, z per pixel; NaN without surface.
    pub normal: *const f32,
    /// 1 where there is surface.
    pub mask: *const u8,
    /// Number of iterations.
    pub iterations: usize,
    /// Solve time, seconds.
    pub seconds: f64,
    /// Expected depth error, metres: two of three pixels with a given value have a smaller error; NaN without
    /// surface. NULL if unknown.
    pub depth_error: *const f32,
    /// The second layer behind the first, as above; NULL if no pixel has two surfaces.
    pub behind_albedo: *const f32,
    pub behind_depth: *const f32,
    pub behind_normal: *const f32,
    pub behind_mask: *const u8,
    pub behind_depth_error: *const f32,
    /// The reconstructed volume: corners x, y, z in metres, and voxels of the finest grid along each axis.
    pub volume_min: [f64; 3],
    pub volume_max: [f64; 3],
    pub voxels: [usize; 3],
    /// 1 if started from the previous frame's solution.
    pub warm_started: u32,
    /// The verdict on the result: 1 good, 2 fair, 3 poor. The reasons of a poor one are warnings of the log.
    pub verdict: u32,
}

// SAFETY: `repr(C)`, begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbFrame {
    const NAME: &'static str = "tb_frame";
    const FIRST: usize = offset_of!(TbFrame, seconds) + size_of::<f64>();
}

/// A solver prepared for the frames of one scan.
pub struct TbSession {
    session: Mutex<Session>,
    /// Submits frames while another thread waits.
    pub submitter: Submitter,
    canceller: Canceller,
}

impl TbSession {
    pub fn session(&self) -> MutexGuard<'_, Session> {
        // A session is intact after a panic: its state belongs to its thread.
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Creates a session, including compilation and allocation. Any thread.
///
/// # Safety
/// `device` is open. `scan` and `settings` begin with their sizes; `settings` may be NULL. Strings are
/// zero-terminated, arrays have the lengths in `tb_scan`, and `session` is writable. `progress` remains callable with
/// `user_data` by another thread until the session is freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_new(
    device: *const TbDevice,
    scan: *const TbScan,
    settings: *const TbSettings,
    session: *mut *mut TbSession,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides an open device, or NULL.
        let device = unsafe { device.as_ref() }.ok_or_else(|| no_handle("device"))?;
        // SAFETY: the caller provides structs that begin with their sizes, with valid arrays and strings.
        let (capture, settings) = unsafe {
            let settings = if settings.is_null() { None } else { Some(sized::read(settings)?) };
            (sized::read(scan)?.capture()?, settings)
        };
        // SAFETY: as above.
        let (chosen, options, mut hear) = match &settings {
            Some(settings) => unsafe { (settings.settings()?, settings.session_options()?, settings.hear()) },
            None => (Settings::default(), SessionOptions::default(), None),
        };
        // Frame number 0 denotes the estimates.
        let mut on_progress = |p: &Progress| match &mut hear {
            Some(hear) => hear(FrameId(0), p),
            None => ControlFlow::Continue(()),
        };
        let (made, notes) = engine::session_with(&device.gpu, &capture, &chosen, options, &mut on_progress)?;
        notes.iter().for_each(|note| log::note(note));
        let megabytes = made.plan().buffers.iter().map(|b| b.bytes).sum::<u64>() / 1_000_000;
        log::note(&format!("a session of {} pairs, {megabytes} MB of buffers", made.plan().scene.pairs));
        let (submitter, canceller) = (made.submitter(), made.canceller());
        let made = TbSession { session: Mutex::new(made), submitter, canceller };
        // SAFETY: the caller provides a writable pointer.
        unsafe { sized::give_handle(session, made, "session") }
    })
}

/// Submits a frame without waiting. `counts` has `count` values, bin b of pair p at [p * bins + b], and is copied.
/// `frame` receives the frame number, or is NULL. Returns TB_ERROR_INPUT for invalid counts, and TB_ERROR_OPTIONS
/// during a solve unless `frame_policy` of tb_settings allows queueing, without side effects. Any thread, also during
/// a wait of another one.
///
/// # Safety
/// `session` is valid. `counts` has `count` values. `frame` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_submit(
    session: *const TbSession,
    counts: *const f32,
    count: usize,
    frame: *mut u64,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides a valid session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        if counts.is_null() {
            return Err(Error::options("`counts` is NULL", "give the frame's counts"));
        }
        // SAFETY: the array has this length, as the caller guarantees.
        let id = session.submitter.submit(unsafe { std::slice::from_raw_parts(counts, count) })?;
        // SAFETY: the caller provides a writable pointer, or NULL.
        unsafe { sized::give(frame, id.0) };
        Ok(())
    })
}

/// Waits up to `seconds` for the next result: that of the frame submitted last, unless the policy is TB_FRAMES_QUEUE.
/// 0 polls; a negative value waits without limit. Returns TB_OK with the frame, TB_NOT_READY without a result in time
/// or without a frame, otherwise the frame's error or TB_ERROR_CANCELLED, after which the next frame can be
/// submitted. A positive value also waits for a frame submitted concurrently; a negative value without a frame
/// returns TB_ERROR_OPTIONS. Any thread; calls on one session are serialised.
///
/// # Safety
/// `session` is valid. `frame` begins with its size and is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_wait(
    session: *const TbSession,
    seconds: f64,
    frame: *mut TbFrame,
) -> TbStatus {
    let mut there = false;
    let status = guarded(|| {
        // SAFETY: the caller provides a valid session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        // SAFETY: the caller provides a struct that begins with its size. Checked first, so that no result is lost.
        unsafe { sized::size_of_target(frame)? };
        let mut session = session.session();
        let limit = Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX);
        let found = if seconds < 0.0 { Some(session.wait()?) } else { session.wait_for(limit)? };
        there = found.is_some();
        if let Some(found) = &found {
            found.result.warnings.iter().for_each(|warning| log::warning(warning));
            let poor = found.result.verdict.iter().filter(|verdict| verdict.grade == engine::Grade::Poor);
            poor.for_each(|verdict| log::warning(&format!("verdict {verdict}")));
        }
        match found {
            // SAFETY: the caller provides a struct that begins with its size.
            Some(found) => unsafe { sized::write(frame, &TbFrame::of(found)) },
            None => Ok(()),
        }
    });
    if status == TbStatus::TbOk && !there { TbStatus::TbNotReady } else { status }
}

/// Cancels the current frame, if any; its `tb_session_wait` returns TB_ERROR_CANCELLED. Does not block. Any thread,
/// also during a wait of another one, and from `progress`; not from a signal handler.
///
/// # Safety
/// `session` is valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_cancel(session: *const TbSession) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides a valid session, or NULL.
        unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?.canceller.cancel();
        Ok(())
    })
}

/// Cancels all work of the session and frees it with its last frame; NULL is ignored. Any thread, once; not from
/// `progress`.
///
/// # Safety
/// `session` is valid and not used concurrently or afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_free(session: *mut TbSession) {
    // SAFETY: created by `tb_session_new` and freed once.
    unsafe { free_handle(session) };
}

impl TbFrame {
    fn of(frame: &Frame) -> TbFrame {
        let (maps, result) = (&frame.result.maps, &frame.result);
        let grid = result.plan.finest().grid;
        let ([x0, x1, y0, y1], [z0, z1]) = (grid.extent(), grid.depth_range());
        let (none, behind) = (std::ptr::null(), maps.behind.as_ref());
        let of = |values: Option<&Vec<f32>>| values.map_or(none, |v| v.as_ptr());
        TbFrame {
            size: size_of::<TbFrame>(),
            id: frame.id.0,
            nx: maps.nx,
            ny: maps.ny,
            extent: maps.extent,
            albedo: maps.albedo.as_ptr(),
            depth: maps.depth.as_ptr(),
            normal: maps.normal.as_ptr().cast(),
            mask: maps.mask.as_ptr().cast(),
            iterations: result.trace.last().map_or(0, |p| p.iteration),
            seconds: result.solve_seconds,
            depth_error: of(maps.depth_error.as_ref()),
            behind_albedo: of(behind.map(|l| &l.albedo)),
            behind_depth: of(behind.map(|l| &l.depth)),
            behind_normal: behind.map_or(none, |l| l.normal.as_ptr().cast()),
            behind_mask: behind.map_or(std::ptr::null(), |l| l.mask.as_ptr().cast()),
            behind_depth_error: of(behind.and_then(|l| l.depth_error.as_ref())),
            volume_min: [x0, y0, z0],
            volume_max: [x1, y1, z1],
            voxels: grid.n,
            warm_started: result.is_warm.into(),
            verdict: result.verdict.as_ref().map_or(0, |verdict| verdict.grade as u32 + 1),
        }
    }
}
