//! How a session solves, and what it tells of its progress.

use std::ffi::{c_char, c_void};
use std::mem::offset_of;
use std::ops::ControlFlow;
use std::time::Duration;

use engine::session::{Feed, FrameId, Hear, SessionOptions};
use engine::solve::{Follow, Progress};
use engine::{Error, Result, Settings};

use crate::sized::Versioned;
use crate::text;

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

/// What a progress function is told.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbProgress {
    /// sizeof(tb_progress) of the library.
    pub size: usize,
    /// The frame; 0 while `tb_session_new` looks for the model and the pulse.
    pub frame: u64,
    /// Iterations done, and iterations of the whole frame.
    pub iteration: usize,
    pub iterations: usize,
    /// The loss; NaN while a closed form is computed.
    pub loss: f64,
    /// Seconds since the frame began.
    pub seconds: f64,
}

/// Hears of the progress. Returns 0 to go on; anything else stops the frame.
pub type TbHear = Option<unsafe extern "C" fn(user: *mut c_void, progress: *const TbProgress) -> i32>;

/// How a session solves. Zero everything, then set `size`; zero is the default of every field.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbSettings {
    /// sizeof(tb_settings).
    pub size: usize,
    /// "surface", "paper", or a closed-form method such as "lct" or "fbp"; NULL: the default solver.
    pub solver: *const c_char,
    /// Lateral pixels of the maps; 0: the solver's default.
    pub lateral: usize,
    /// Further options of the solver as "name=value name=value", by their names on the command line, "model=lambertian" among
    /// them; NULL: none.
    pub options: *const c_char,
    /// Most device memory to use, bytes; 0: what is free.
    pub memory: u64,
    /// A frame that takes longer is stopped, seconds; 0: none is.
    pub time_limit: f64,
    /// Hears of the progress. Called by the session's own thread, and by `tb_session_new` while it looks for model and pulse; it must not call functions of this session but
    /// `tb_session_cancel`.
    pub hear: TbHear,
    /// Given to `hear`.
    pub user: *mut c_void,
    /// 1: a frame begins with the surface of the frame before, with fewer iterations. For "surface".
    pub follow: u32,
    /// 1: frames may be in buffers of the program (`tb_session_submit_lent`).
    pub lent: u32,
    /// Time for a frame, seconds: as many iterations as fit, and always a whole picture; 0: no limit. It needs `follow`.
    pub budget: f64,
    /// How many neighbouring bins are one for the solver; 0: as many as the maps' pixels do not tell apart.
    pub sum: usize,
    /// What becomes of frames that are submitted while one is solved: a `tb_feed`.
    pub feed: u32,
    /// Not used: 0.
    pub reserved: u32,
    /// Most frames that wait with TB_EVERY; 0: 16.
    pub waiting: usize,
    /// What a sum is multiplied by before the next frame, from 0 to 1, with TB_SUM.
    pub decay: f64,
}

// SAFETY: it is `repr(C)` and begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbSettings {
    const NAME: &'static str = "tb_settings";
    const FIRST: usize = offset_of!(TbSettings, user) + size_of::<*mut c_void>();
}

/// A pointer of the program's, for the session's thread.
struct User(*mut c_void);

// SAFETY: it is only handed to `hear`, which the header asks to be callable from the session's thread.
unsafe impl Send for User {}

impl User {
    fn pointer(&self) -> *mut c_void {
        self.0
    }
}

impl TbSettings {
    /// The settings that they hold.
    ///
    /// # Safety
    /// The strings are NULL or end with a zero.
    pub unsafe fn settings(&self) -> Result<Settings> {
        // SAFETY: as the caller states.
        let [solver, options] =
            unsafe { [text::of(self.solver, "solver")?, text::of(self.options, "options")?] };
        let mut settings = Settings::default();
        solver.map_or(Ok(()), |name| settings.set("solver", name))?;
        if self.lateral > 0 {
            settings.set("lateral", &self.lateral.to_string())?;
        }
        for option in options.unwrap_or_default().split_whitespace() {
            let (name, value) = option.split_once('=').ok_or_else(|| {
                Error::options(
                    format!("the option \"{option}\" is not name=value"),
                    "write lateral=64, for example",
                )
            })?;
            settings.set(name, value)?;
        }
        settings.memory = (self.memory > 0).then_some(self.memory).or(settings.memory);
        settings.check().map(|()| settings)
    }

    /// # Safety
    /// `hear` may be called with `user` by another thread.
    pub unsafe fn session_options(&self) -> Result<SessionOptions> {
        let limit = Duration::try_from_secs_f64(self.time_limit).map_err(|_| {
            Error::options(format!("the time limit is {} s", self.time_limit), "give seconds, or 0 for none")
        })?;
        let budget =
            Duration::try_from_secs_f64(self.budget).ok().filter(|b| b.is_zero() || self.follow != 0);
        let Some(budget) = budget else {
            let what = format!("the budget is {} s, and `follow` is {}", self.budget, self.follow);
            return Err(Error::options(what, "give seconds with `follow` 1, or 0 for none"));
        };
        let budget = (!budget.is_zero()).then_some(budget);
        let user = User(self.user);
        let hear = self.hear.map(|hear| -> Hear {
            Box::new(move |id: FrameId, progress: &Progress| {
                let told = TbProgress::of(id, progress);
                // SAFETY: as the caller states.
                match unsafe { hear(user.pointer(), &told) } {
                    0 => ControlFlow::Continue(()),
                    _ => ControlFlow::Break(()),
                }
            })
        });
        Ok(SessionOptions {
            time_limit: (limit > Duration::ZERO).then_some(limit),
            hear,
            follow: (self.follow != 0).then(|| Follow { budget, ..Follow::default() }),
            lent: self.lent != 0,
            sum: (self.sum > 0).then_some(self.sum),
            feed: self.feed()?,
            ..SessionOptions::default()
        })
    }

    /// The feed that they ask for.
    fn feed(&self) -> Result<Feed> {
        const ONE: u32 = TbFeed::TbOne as u32;
        const NEWEST: u32 = TbFeed::TbNewest as u32;
        const EVERY: u32 = TbFeed::TbEvery as u32;
        const SUM: u32 = TbFeed::TbSum as u32;
        match self.feed {
            ONE => Ok(Feed::One),
            NEWEST => Ok(Feed::Newest),
            EVERY => Ok(Feed::Every { most: if self.waiting > 0 { self.waiting } else { WAITING } }),
            SUM => Ok(Feed::Sum { decay: self.decay }),
            other => Err(Error::options(
                format!("`feed` is {other}"),
                "give TB_ONE, TB_NEWEST, TB_EVERY or TB_SUM",
            )),
        }
    }
}

impl TbProgress {
    fn of(id: FrameId, progress: &Progress) -> TbProgress {
        TbProgress {
            size: size_of::<TbProgress>(),
            frame: id.0,
            iteration: progress.point.iteration,
            iterations: progress.iterations,
            loss: progress.point.loss,
            seconds: progress.point.seconds,
        }
    }
}
