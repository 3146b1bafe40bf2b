//! A session: a solver that lives, for programs that capture. It is made once for a scan: planned, compiled and allocated.
//! Then frames of counts are submitted one after the other, and maps come back.
//!
//! A frame is solved by a thread of the session's own. A solve needs the host between its blocks: to read the trace, to
//! choose the surface's pixels, to submit what is next. A caller who had to lend a thread for this would hold the device
//! up whenever a camera or a window keeps that thread busy. So [`Session::submit`] only copies the counts, and
//! [`Session::poll`] only looks.
//!
//! One frame is solved at a time; [`Feed`] says what becomes of others meanwhile. With [`crate::surface::Follow`], a frame begins with the
//! solution of the one before. A session may move between threads. Several sessions may share a device, each with
//! buffers and a thread of its own.

use std::borrow::Cow;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::capture::{Capture, conditioning};
use crate::engine::{Bins, Plan, Prepared, Problem, Reconstruction, room_light};
use crate::gpu::Gpu;
use crate::judge::{self, Estimates, FindingSource, Job};
use crate::methods::SolverOptions;
use crate::settings::Settings;
use crate::transport::Grid;
use crate::{Error, Result, Verdict, surface};

mod external;
mod feed;
mod latency;
mod moving;
mod options;
mod resting;
mod submit;
mod worker;

use external::{Exchange, maps_bytes};
pub use external::{ExternalCounts, ExternalFrame, Format};
pub use feed::Feed;
pub use latency::Latency;
pub use moving::MOVING_FRAMES;
use moving::RunningRoom;
pub use options::{FrameId, Hear, SessionOptions};
pub use submit::Submitter;
use worker::{Shared, Solved, Taken, Worker, host_only};

/// A solved frame.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Which.
    pub id: FrameId,
    /// Its maps, and how they were found.
    pub result: Reconstruction,
    /// Its counts less those of the empty room, or of what rests ([`SessionOptions::moving`]), with their noise; `None` where nothing was
    /// subtracted.
    pub left: Option<Arc<Capture>>,
}

/// A solver with everything that it needs to solve frames of one scan.
pub struct Session {
    gpu: Gpu,
    plan: Arc<Plan>,
    /// See [`SessionOptions::external`].
    external: bool,
    /// See [`Session::subtracts`].
    subtracts: bool,
    submitter: Submitter,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    last: Option<Frame>,
    taken: Option<FrameId>,
}

/// Cancels frames of a session, from any thread.
#[derive(Clone)]
pub struct Canceller(Arc<Shared>);

impl Canceller {
    /// Cancels the frame that is being solved, if there is one. It ends with [`crate::Kind::Cancelled`] after the block of
    /// iterations that the device is at, or with its result if that was the last block.
    pub fn cancel(&self) {
        self.0.cancel();
    }
}

impl Session {
    /// A session for frames of the scan that `scan` describes: points, bins, spots and pulse. It need not have counts. If
    /// it has, the default grid ends where they do, and the mean path of light through spots is theirs. Without a `grid`,
    /// it is that of [`default_grid`].
    ///
    /// Everything is compiled and allocated here. Some drivers finish compiling at the first frame.
    ///
    /// # Errors
    /// Options, scan, memory or device do not allow the solve.
    #[doc(hidden)]
    pub fn new(
        gpu: &Gpu,
        scan: &Capture,
        grid: Option<Grid>,
        solver: &SolverOptions,
        options: SessionOptions,
    ) -> Result<Session> {
        let verdict = judge::verdict(&Estimates::default());
        Session::judged(gpu, scan, grid, solver, options, Arc::new(verdict))
    }

    /// As [`Session::new`], with the verdict on the capture that the estimates are of.
    fn judged(
        gpu: &Gpu,
        scan: &Capture,
        grid: Option<Grid>,
        solver: &SolverOptions,
        options: SessionOptions,
        verdict: Arc<Verdict>,
    ) -> Result<Session> {
        solver.check()?;
        scan.check_scan()?;
        conditioning::check_units(scan)?;
        if !scan.histograms.is_empty() {
            scan.check_counts(&scan.histograms)?;
        }
        let how = Settings { bins: options.sum.map(Bins::Sum), ..Settings::default() };
        let (summed, sum) = how.summed(solver, Cow::Borrowed(scan))?;
        let grid = grid.map_or_else(|| how.grid(solver, &summed), Ok)?;
        options.feed.check()?;
        options.check_moving(scan)?;
        let mut prepared = prepared(gpu, &summed, grid, solver, &options)?;
        prepared.allocate()?;
        let (room, empty) = (room_light(scan), scan.empty.clone());
        let running = options.moving.map(|frames| RunningRoom::new(scan, frames)).transpose()?;
        let (plan, scan) = (prepared.plan().clone(), scan.outline());
        let summed = (sum > 1).then(|| summed.outline());
        let [nx, ny, _] = plan.levels.maps.n;
        let exchange = options
            .external
            .then(|| Exchange::new(gpu, [scan.pair_count() * scan.bins, nx * ny], options.memory));
        let (exchange, external) = (exchange.transpose()?, options.external);
        let shared = Arc::new(Shared::new(scan.pair_count(), scan.bins, options.feed));
        let (feed, subtracts) = (options.feed, room.is_some() || running.is_some());
        let mask_fraction = options.mask_fraction.or(solver.usual_mask());
        let worker = Worker {
            gpu: gpu.clone(),
            shared: shared.clone(),
            prepared,
            scan: scan.clone().with(|c| c.empty = empty),
            summed,
            room,
            running,
            exchange,
            mask_fraction,
            verdict,
            options,
        };
        let thread = std::thread::Builder::new()
            .name("thirdbounce session".into())
            .spawn(move || worker.work())
            .map_err(|e| {
                Error::memory(format!("a session's thread does not start ({e})"), "close programs")
            })?;
        let submitter = Submitter::new(shared.clone(), scan, feed);
        Ok(Session {
            gpu: gpu.clone(),
            plan,
            external,
            subtracts,
            submitter,
            shared,
            thread: Some(thread),
            last: None,
            taken: None,
        })
    }

    /// A session for frames of the scan of `frame`, as `job` resolves it.
    ///
    /// # Errors
    /// Scan, memory or device do not allow the solve.
    #[doc(hidden)]
    pub fn of(gpu: &Gpu, frame: &Capture, job: &Job<'_>, options: SessionOptions) -> Result<Session> {
        let options = SessionOptions {
            sum: Some(job.sum),
            memory: job.settings.memory,
            mask_fraction: job.mask_fraction(),
            with_volume: options.with_volume || job.settings.keep_volume == Some(true),
            ..options
        };
        // The session sums the bins of each frame itself.
        let mut scan = frame.clone();
        scan.pulse.clone_from(&job.capture.pulse);
        if !job.estimates.finding(FindingSource::Empty).is_some_and(|found| found.is_used) {
            scan.empty = None;
        }
        Session::judged(gpu, &scan, Some(job.grid()?), &job.solver, options, job.verdict.clone())
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Pairs, and bins of each, of a frame of counts.
    pub fn size(&self) -> [usize; 2] {
        self.submitter.size()
    }

    /// Levels, passes and buffers.
    #[doc(hidden)]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Begins to solve a frame of counts, `[pair * bins + bin]`, and returns. The counts are copied. What happens while
    /// another frame is being solved, [`SessionOptions::feed`] says. An earlier result that was not taken is
    /// dropped, unless every frame counts.
    ///
    /// # Errors
    /// [`crate::Kind::Input`] if there are too few or too many counts, one is not finite, or there is no signal; single frames of a
    /// sum may be dark, the sum may not. [`crate::Kind::Options`] if the feed refuses another frame. Nothing changes then.
    pub fn submit(&mut self, histograms: &[f32]) -> Result<FrameId> {
        self.submitter.submit(histograms)
    }

    /// As [`Session::submit`], for a partial scan: only the pairs that are `measured` have new counts, `[pair]`. The
    /// others keep those of the frames before, from the first part on; their places in `histograms` are not used. Pairs that
    /// were never measured are dark.
    ///
    /// # Errors
    /// As [`Session::submit`]; [`crate::Kind::Input`] if `measured` does not say so for every pair.
    pub fn submit_part(&mut self, histograms: &[f32], measured: &[bool]) -> Result<FrameId> {
        self.submitter.submit_part(histograms, measured)
    }

    /// Begins to solve a frame whose counts are in a buffer of the caller on the device, and returns. The counts are copied before
    /// the solve. The session needs [`SessionOptions::external`].
    ///
    /// The moments of a frame that fails or is stopped are signalled, too, from the host. Those of a frame that is dropped because
    /// another came are not: the moments of the other are later.
    ///
    /// # Errors
    /// [`crate::Kind::Options`] if the session was not made for external frames, the buffers are too small, sums are fed, or the feed
    /// refuses another frame. Nothing changes then. What is wrong with the counts shows when the frame is taken.
    pub fn submit_external(&mut self, frame: ExternalFrame) -> Result<FrameId> {
        if !self.external {
            return Err(host_only());
        }
        frame.check(&self.gpu, self.size(), self.submitter.feed(), self.external_maps_bytes())?;
        self.shared.submit_external(frame)
    }

    /// Bytes of the maps of a frame in an external buffer: see [`ExternalFrame::maps`].
    pub fn external_maps_bytes(&self) -> u64 {
        let [nx, ny, _] = self.plan.levels.maps.n;
        maps_bytes(nx * ny)
    }

    /// Whether counts of the empty room, or of what rests ([`SessionOptions::moving`]), are subtracted from frames.
    pub fn subtracts(&self) -> bool {
        self.subtracts
    }

    /// Whether no frame is being solved, and none waits. A result may be there.
    pub fn is_idle(&self) -> bool {
        self.shared.is_idle()
    }

    /// How long the last frames took, and how many were dropped.
    pub fn latency(&self) -> Latency {
        self.submitter.latency()
    }

    /// A frame that is solved by now and was not taken before: the last one, or the oldest if every frame counts.
    ///
    /// # Errors
    /// The frame failed, or was stopped ([`crate::Kind::Cancelled`]). The next one can be submitted.
    pub fn poll(&mut self) -> Result<Option<&Frame>> {
        self.wait_until(Some(Instant::now()))
    }

    /// Waits for the next result.
    ///
    /// # Errors
    /// As [`Session::poll`]; [`crate::Kind::Options`] if no frame was submitted, or its result was taken before.
    pub fn wait(&mut self) -> Result<&Frame> {
        self.wait_until(None)?.ok_or_else(|| {
            Error::options("no frame is being solved: there is nothing to wait for", "submit a frame first")
        })
    }

    /// As [`Session::poll`], but waits up to `limit`, also for a frame that a [`Submitter`] submits meanwhile.
    ///
    /// # Errors
    /// As [`Session::poll`].
    pub fn wait_for(&mut self, limit: Duration) -> Result<Option<&Frame>> {
        self.wait_until(Instant::now().checked_add(limit))
    }

    fn wait_until(&mut self, end: Option<Instant>) -> Result<Option<&Frame>> {
        match self.shared.taken(end) {
            Taken::Done(id, result) => {
                self.taken = Some(id);
                let Solved { result, left } = *result?;
                self.last = Some(Frame { id, result, left });
                Ok(self.last.as_ref())
            }
            Taken::NotYet | Taken::Nothing => Ok(None),
        }
    }

    /// The frame that was taken last.
    pub fn last(&self) -> Option<&Frame> {
        self.last.as_ref()
    }

    /// Number of the frame whose result or error was taken last.
    #[doc(hidden)]
    pub fn taken(&self) -> Option<FrameId> {
        self.taken
    }

    /// Cancels the frame that is being solved: [`Canceller::cancel`].
    pub fn cancel(&self) {
        self.shared.cancel();
    }

    /// A handle that submits frames from other threads, while this one waits for results.
    pub fn submitter(&self) -> Submitter {
        self.submitter.clone()
    }

    /// A handle that cancels frames from other threads.
    pub fn canceller(&self) -> Canceller {
        Canceller(self.shared.clone())
    }
}

impl Drop for Session {
    /// Stops the frame that is being solved, and waits for it.
    fn drop(&mut self) {
        self.shared.close();
        if let Some(thread) = self.thread.take() {
            // It catches its panics.
            let _ = thread.join();
        }
    }
}

/// The grid that a session takes if none is given: the default volume of the scan, with voxels of the usual depth
/// ([`SolverOptions::usual_depth_pitch`]).
///
/// # Errors
/// The scan gives no range of depths.
pub fn default_grid(scan: &Capture, solver: &SolverOptions) -> Result<Grid> {
    let (scan, _) = Settings::default().summed(solver, Cow::Borrowed(scan))?;
    Settings::default().grid(solver, &scan)
}

/// The solver, prepared as the options say.
fn prepared(
    gpu: &Gpu,
    scan: &Capture,
    grid: Grid,
    solver: &SolverOptions,
    options: &SessionOptions,
) -> Result<Box<dyn Prepared>> {
    let SessionOptions { memory, with_volume, .. } = *options;
    let problem = Problem { memory, with_volume, ..Problem::new(scan, grid) };
    match solver {
        _ if options.follow.is_none() => solver.prepare(gpu, &problem),
        SolverOptions::Surface(o) => surface::prepare(gpu, &problem, o, options.follow, None),
        _ => Err(Error::options(
            format!("frames of the solver {} do not follow each other", solver.name()),
            "use the surface solver, or leave `follow` out",
        )),
    }
}
