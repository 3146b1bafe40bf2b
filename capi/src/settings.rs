//! Settings of a session, and progress reports.

use std::ffi::{c_char, c_void};
use std::mem::offset_of;
use std::ops::ControlFlow;
use std::time::Duration;

use engine::engine::Progress;
use engine::session::{Feed, FrameId, Hear, SessionOptions};
use engine::surface::Follow;
use engine::{Bins, Error, Result, Settings};

use crate::sized::Versioned;
use crate::text;

/// Handling of frames submitted during a solve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum TbFramePolicy {
    /// Refused with TB_ERROR_OPTIONS.
    TbFramesRefuse = 0,
    /// Waits, replacing a waiting frame.
    TbFramesNewest = 1,
    /// Queued, up to `queue_length` of tb_settings. Each is solved after the previous result was taken.
    TbFramesQueue = 2,
    /// Added to a running sum, multiplied by `sum_decay` of tb_settings before, and solved as soon as possible.
    TbFramesSum = 3,
}

/// Default queue length.
const QUEUE_LENGTH: usize = 16;

/// Progress of a frame.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbProgress {
    /// sizeof(tb_progress) of the library.
    pub size: usize,
    /// Frame number; 0 during the estimates of `tb_session_new`.
    pub frame: u64,
    /// Iterations done, and total iterations of the frame.
    pub iteration: usize,
    pub iterations: usize,
    /// Loss; NaN during a closed form.
    pub loss: f64,
    /// Seconds since the start of the frame.
    pub seconds: f64,
    /// Share of the total iterations of the frame, or of the estimates: 0 to 1, never falling. A fit that converges ends before 1.
    pub fraction: f64,
}

/// Receives progress reports. Returns 0 to continue; any other value cancels the frame.
pub type TbProgressCallback =
    Option<unsafe extern "C" fn(user_data: *mut c_void, progress: *const TbProgress) -> i32>;

/// Settings of a session. Zero-initialise, then set `size`; zero is the default of every field.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbSettings {
    /// sizeof(tb_settings).
    pub size: usize,
    /// "surface", "paper", or a closed-form method such as "lct" or "fbp"; NULL: the default solver.
    pub solver: *const c_char,
    /// Lateral pixels of the maps; 0: the solver's default.
    pub lateral: usize,
    /// Further solver options as "name=value name=value", with names of the command line, including
    /// "model=lambertian"; NULL: none.
    pub options: *const c_char,
    /// Maximum device memory, bytes; 0: all free memory.
    pub memory_limit: u64,
    /// Time after which a frame is cancelled, seconds; 0: none.
    pub time_limit: f64,
    /// Progress callback, called by the session's thread, and by `tb_session_new` during estimates. It may call
    /// `tb_session_cancel` but no other function of this session.
    pub progress: TbProgressCallback,
    /// Passed to `progress`.
    pub user_data: *mut c_void,
    /// 1: frames start from the previous frame's surface, with fewer iterations. For "surface".
    pub warm_start: u32,
    /// 1: frames may be in external buffers (`tb_session_submit_external`).
    pub external_frames: u32,
    /// Time per frame, seconds: as many iterations as fit, always a complete result; 0: no limit. Requires
    /// `warm_start`.
    pub frame_budget: f64,
    /// Number of neighbouring bins summed for the solver; 0: chosen by the resolution of the maps.
    pub sum_bins: usize,
    /// Handling of frames submitted during a solve: a `tb_frame_policy`.
    pub frame_policy: u32,
    /// Reserved: 0.
    pub reserved: u32,
    /// Maximum number of queued frames with TB_FRAMES_QUEUE; 0: 16.
    pub queue_length: usize,
    /// Factor of the sum before the next frame is added, 0 to 1, with TB_FRAMES_SUM.
    pub sum_decay: f64,
    /// Number of solved frames, 5 to 1000 (31 is usual), whose static light is subtracted as an empty room, so that moving objects are
    /// left; 0: nothing is subtracted. The first five frames are solved as measured, with a warning.
    pub moving_frames: usize,
}

// SAFETY: `repr(C)`, begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbSettings {
    const NAME: &'static str = "tb_settings";
    const FIRST: usize = offset_of!(TbSettings, user_data) + size_of::<*mut c_void>();
}

/// The program's pointer, for the session's thread.
struct User(*mut c_void);

// SAFETY: only passed to `progress`, which must be callable from the session's thread.
unsafe impl Send for User {}

impl User {
    fn pointer(&self) -> *mut c_void {
        self.0
    }
}

/// Sets options that are written as "name=value name=value".
///
/// # Errors
/// Another form, an unknown name, an invalid value.
pub fn set_all(settings: &mut Settings, options: &str) -> Result<()> {
    for option in options.split_whitespace() {
        let (name, value) = option.split_once('=').ok_or_else(|| {
            Error::options(
                format!("the option \"{option}\" is not name=value"),
                "write lateral=64, for example",
            )
        })?;
        settings.set(name, value)?;
    }
    Ok(())
}

impl TbSettings {
    /// The settings of the engine.
    ///
    /// # Safety
    /// The strings are NULL or zero-terminated.
    pub unsafe fn settings(&self) -> Result<Settings> {
        // SAFETY: guaranteed by the caller.
        let [solver, options] =
            unsafe { [text::of(self.solver, "solver")?, text::of(self.options, "options")?] };
        let mut settings = Settings::default();
        solver.map_or(Ok(()), |name| settings.set("solver", name))?;
        if self.lateral > 0 {
            settings.set("lateral", &self.lateral.to_string())?;
        }
        set_all(&mut settings, options.unwrap_or_default())?;
        settings.bins = (self.sum_bins > 0).then_some(Bins::Sum(self.sum_bins)).or(settings.bins);
        settings.memory = (self.memory_limit > 0).then_some(self.memory_limit).or(settings.memory);
        settings.check().map(|()| settings)
    }

    /// The callback for progress.
    ///
    /// # Safety
    /// `progress` is callable with `user_data` by another thread.
    pub unsafe fn hear(&self) -> Option<Hear> {
        let user = User(self.user_data);
        self.progress.map(|callback| -> Hear {
            let mut last = (FrameId(u64::MAX), 0.0);
            Box::new(move |id: FrameId, progress: &Progress| {
                let before = if last.0 == id { last.1 } else { 0.0 };
                let report = TbProgress::of(id, progress, before);
                last = (id, report.fraction);
                // SAFETY: guaranteed by the caller.
                match unsafe { callback(user.pointer(), &report) } {
                    0 => ControlFlow::Continue(()),
                    _ => ControlFlow::Break(()),
                }
            })
        })
    }

    /// # Safety
    /// `progress` is callable with `user_data` by another thread.
    pub unsafe fn session_options(&self) -> Result<SessionOptions> {
        let limit = Duration::try_from_secs_f64(self.time_limit).map_err(|_| {
            Error::options(format!("the time limit is {} s", self.time_limit), "give seconds, or 0 for none")
        })?;
        let budget = Duration::try_from_secs_f64(self.frame_budget)
            .ok()
            .filter(|b| b.is_zero() || self.warm_start != 0);
        let Some(budget) = budget else {
            let what =
                format!("the budget is {} s, and `warm_start` is {}", self.frame_budget, self.warm_start);
            return Err(Error::options(what, "give seconds with `warm_start` 1, or 0 for none"));
        };
        let budget = (!budget.is_zero()).then_some(budget);
        Ok(SessionOptions {
            time_limit: (limit > Duration::ZERO).then_some(limit),
            // SAFETY: guaranteed by the caller.
            hear: unsafe { self.hear() },
            follow: (self.warm_start != 0).then(|| Follow { budget, ..Follow::default() }),
            external: self.external_frames != 0,
            moving: (self.moving_frames > 0).then_some(self.moving_frames),
            feed: self.feed()?,
            ..SessionOptions::default()
        })
    }

    /// The selected policy.
    fn feed(&self) -> Result<Feed> {
        const REFUSE: u32 = TbFramePolicy::TbFramesRefuse as u32;
        const NEWEST: u32 = TbFramePolicy::TbFramesNewest as u32;
        const QUEUE: u32 = TbFramePolicy::TbFramesQueue as u32;
        const SUM: u32 = TbFramePolicy::TbFramesSum as u32;
        match self.frame_policy {
            REFUSE => Ok(Feed::One),
            NEWEST => Ok(Feed::Newest),
            QUEUE => {
                Ok(Feed::Every { most: if self.queue_length > 0 { self.queue_length } else { QUEUE_LENGTH } })
            }
            SUM => Ok(Feed::Sum { decay: self.sum_decay }),
            other => Err(Error::options(
                format!("`frame_policy` is {other}"),
                "give TB_FRAMES_REFUSE, TB_FRAMES_NEWEST, TB_FRAMES_QUEUE or TB_FRAMES_SUM",
            )),
        }
    }
}

impl TbProgress {
    fn of(id: FrameId, progress: &Progress, before: f64) -> TbProgress {
        let done = progress.point.iteration as f64 / progress.iterations.max(1) as f64;
        TbProgress {
            size: size_of::<TbProgress>(),
            frame: id.0,
            iteration: progress.point.iteration,
            iterations: progress.iterations,
            loss: progress.point.loss,
            seconds: progress.point.seconds,
            fraction: done.clamp(before, 1.0),
        }
    }
}
