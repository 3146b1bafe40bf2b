//! Sessions: frames of counts in, maps out.

use std::mem::offset_of;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use engine::Error;
use engine::session::{Canceller, Frame, FrameId, Session, SessionOptions, Submitter};
use engine::solve::Progress;

use crate::error::{TbStatus, guarded, no_handle};
use crate::scan::TbScan;
use crate::settings::TbSettings;
use crate::sized::{self, Versioned};
use crate::{TbDevice, log};

/// A solved frame. All arrays belong to the session. They stay valid until the next `tb_session_wait` that returns a frame,
/// and until the session is freed. Pixel [ix * ny + iy] of each is at ix along +x and iy along +y.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbFrame {
    /// sizeof(tb_frame): set it before the call.
    pub size: usize,
    /// The frame's number.
    pub id: u64,
    /// Pixels along x and y.
    pub nx: usize,
    pub ny: usize,
    /// Outer edges of the pixels, metres: x min, x max, y min, y max.
    pub extent: [f64; 4],
    /// Albedo; its unit is that of the scaled counts.
    pub albedo: *const f32,
    /// Depth, metres; NaN where nothing is.
    pub depth: *const f32,
    /// Unit normals toward the wall, x, y, z of each pixel; NaN where nothing is.
    pub normal: *const f32,
    /// 1 where there is surface.
    pub mask: *const u8,
    /// Iterations that were done.
    pub iterations: usize,
    /// Seconds that solving took.
    pub seconds: f64,
    /// The depth error that two of three pixels with this value do not exceed, metres; NaN where nothing is. NULL without.
    pub confidence: *const f32,
    /// The surfaces behind the first ones, as above; NULL where no pixel has two.
    pub behind_albedo: *const f32,
    pub behind_depth: *const f32,
    pub behind_normal: *const f32,
    pub behind_mask: *const u8,
    pub behind_confidence: *const f32,
    /// The box that is reconstructed: its corners x, y, z, metres, and the voxels of the finest volume along each.
    pub box_min: [f64; 3],
    pub box_max: [f64; 3],
    pub voxels: [usize; 3],
    /// 1 if it began with the solution of the frame before.
    pub warm: u32,
    /// Not used: 0.
    pub reserved: u32,
}

// SAFETY: it is `repr(C)` and begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbFrame {
    const NAME: &'static str = "tb_frame";
    const FIRST: usize = offset_of!(TbFrame, seconds) + size_of::<f64>();
}

/// A solver with everything that it needs for frames of one scan.
pub struct TbSession {
    session: Mutex<Session>,
    /// Frames are submitted while another thread waits.
    pub submitter: Submitter,
    canceller: Canceller,
}

impl TbSession {
    pub fn session(&self) -> MutexGuard<'_, Session> {
        // A session is whole after a panic: its thread has the rest.
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Makes a session into `session`: everything is compiled and allocated here. Any thread.
///
/// # Safety
/// `device` is open. `scan` and `settings` begin with their sizes; `settings` may be NULL. Strings end with a zero, arrays
/// are as long as `tb_scan` says, and `session` points to a pointer. `hear` may be called with `user` by another thread
/// until the session is freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_new(
    device: *const TbDevice,
    scan: *const TbScan,
    settings: *const TbSettings,
    session: *mut *mut TbSession,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller gives an open device, or NULL.
        let device = unsafe { device.as_ref() }.ok_or_else(|| no_handle("device"))?;
        // SAFETY: the caller gives structs that begin with their sizes, and arrays and strings as they say.
        let (capture, settings) = unsafe {
            let settings = if settings.is_null() { None } else { Some(sized::read(settings)?) };
            (sized::read(scan)?.capture()?, settings)
        };
        capture.check_scan()?;
        // SAFETY: as above.
        let chosen = unsafe { settings.as_ref().map(|s| s.settings()).transpose()?.unwrap_or_default() };
        let mut options = match &settings {
            // SAFETY: as above.
            Some(settings) => unsafe { settings.session_options()? },
            None => SessionOptions::default(),
        };
        // No frame has the number 0. The session calls it again, from its thread.
        let mut of_session = options.hear.take();
        let mut on_progress = |p: &Progress| match &mut of_session {
            Some(hear) => hear(FrameId(0), p),
            None => ControlFlow::Continue(()),
        };
        let job = engine::resolve::Job::resolve(&chosen, &capture, &device.gpu, &mut on_progress)?;
        job.estimates.notes().iter().for_each(|note| log::note(note));
        options.hear = of_session;
        let made = Session::of(&device.gpu, &capture, &job, options)?;
        let megabytes = made.plan().buffers.iter().map(|b| b.bytes).sum::<u64>() / 1_000_000;
        log::note(&format!("a session of {} pairs, {megabytes} MB of buffers", made.plan().scene.pairs));
        let (submitter, canceller) = (made.submitter(), made.canceller());
        let made = TbSession { session: Mutex::new(made), submitter, canceller };
        // SAFETY: the caller gives a pointer to write to.
        unsafe { sized::give_handle(session, made, "session") }
    })
}

/// Begins to solve a frame and returns. `counts` are those of bin b of pair p at [p * bins + b], `count` of them; they are
/// copied. `frame` receives the frame's number; it may be NULL. TB_INPUT if the counts cannot be used, TB_OPTIONS while a
/// frame is being solved, unless `feed` of tb_settings lets it wait: nothing changes then. Any thread, also while another
/// one waits.
///
/// # Safety
/// `session` lives. `counts` holds `count` numbers. `frame` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_submit(
    session: *const TbSession,
    counts: *const f32,
    count: usize,
    frame: *mut u64,
) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller gives a living session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        if counts.is_null() {
            return Err(Error::options("`counts` is NULL", "give the frame's counts"));
        }
        // SAFETY: so many numbers are there, as the caller states.
        let id = session.submitter.submit(unsafe { std::slice::from_raw_parts(counts, count) })?;
        // SAFETY: the caller gives a pointer to write to, or NULL.
        unsafe { sized::give(frame, id.0) };
        Ok(())
    })
}

/// Waits up to `seconds` for the next result, that of the frame that was submitted last unless every frame counts: 0 only looks, below 0 waits as long as it takes. TB_OK with
/// the frame; TB_NOT_YET if it is not solved by then, or there is none; else why it failed or that it was stopped
/// (TB_CANCELLED). The next one can be submitted then. Above 0 it also waits for a frame that another thread submits meanwhile. Below 0 without a frame is TB_OPTIONS. Any thread; calls for one
/// session wait for each other.
///
/// # Safety
/// `session` lives. `frame` begins with its size, and may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_wait(
    session: *const TbSession,
    seconds: f64,
    frame: *mut TbFrame,
) -> TbStatus {
    let mut there = false;
    let status = guarded(|| {
        // SAFETY: the caller gives a living session, or NULL.
        let session = unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?;
        // SAFETY: the caller gives a struct that begins with its size. A result must not be lost if it does not.
        unsafe { sized::size_of_target(frame)? };
        let mut session = session.session();
        let limit = Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX);
        let found = if seconds < 0.0 { Some(session.wait()?) } else { session.wait_for(limit)? };
        there = found.is_some();
        found.iter().flat_map(|found| &found.result.warnings).for_each(|warning| log::warning(warning));
        match found {
            // SAFETY: the caller gives a struct that begins with its size.
            Some(found) => unsafe { sized::write(frame, &TbFrame::of(found)) },
            None => Ok(()),
        }
    });
    if status == TbStatus::TbOk && !there { TbStatus::TbNotYet } else { status }
}

/// Stops the frame that is being solved, if there is one; its `tb_session_wait` then returns TB_CANCELLED. Returns at once.
/// Any thread, also while another one waits, and from `hear`; not from a signal handler.
///
/// # Safety
/// `session` lives.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_cancel(session: *const TbSession) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller gives a living session, or NULL.
        unsafe { session.as_ref() }.ok_or_else(|| no_handle("session"))?.canceller.cancel();
        Ok(())
    })
}

/// Stops what the session does, and frees it with its last frame; NULL does nothing. Any thread, once; not from `hear`.
///
/// # Safety
/// `session` lives, and nobody uses the handle meanwhile or afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_session_free(session: *mut TbSession) {
    let _ = guarded(|| {
        if !session.is_null() {
            // SAFETY: `tb_session_new` made it, and the caller gives it back once.
            drop(unsafe { Box::from_raw(session) });
        }
        Ok(())
    });
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
            confidence: of(maps.confidence.as_ref()),
            behind_albedo: of(behind.map(|l| &l.albedo)),
            behind_depth: of(behind.map(|l| &l.depth)),
            behind_normal: behind.map_or(none, |l| l.normal.as_ptr().cast()),
            behind_mask: behind.map_or(std::ptr::null(), |l| l.mask.as_ptr().cast()),
            behind_confidence: of(behind.and_then(|l| l.confidence.as_ref())),
            box_min: [x0, y0, z0],
            box_max: [x1, y1, z1],
            voxels: grid.n,
            warm: result.is_warm.into(),
            reserved: 0,
        }
    }
}
