//! The threads of a batch: a reader, solvers, a writer. Each hands its work on through a short queue, so that at most
//! `jobs` captures are read ahead and `jobs` results wait to be written.

use std::any::Any;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use super::super::run::{self, Solved};
use super::record::{Record, check_place};
use super::{Batch, Caller, CaptureEnd, Figures, Listed, Status, names};
use crate::files::atomic::is_full;
use crate::files::claim::{self, Claim};
use crate::files::opened::{self, Stamp};
use crate::files::staging::Staging;
use crate::gpu::{DeviceKind, Gpu, GpuOptions};
use crate::job::{Loaded, Request};
use crate::{Error, Kind, Result, panic_message};

/// The file of a result that is written last.
const WHOLE: &str = "report.json";

/// A device that is opened anew after it was lost.
struct Device {
    options: GpuOptions,
    is_cpu: bool,
    gpu: Mutex<Option<Gpu>>,
}

impl Device {
    fn open(options: &GpuOptions) -> Result<Arc<Device>> {
        let gpu = Gpu::open(options)?;
        let is_cpu = gpu.info.kind == DeviceKind::Cpu;
        Ok(Arc::new(Device { options: options.clone(), is_cpu, gpu: Mutex::new(Some(gpu)) }))
    }

    /// The device of every job: they take turns. Jobs share a GPU's queue, which fills the gaps of one with work of another.
    /// A driver for CPUs works one queue's lists off one by one, so each job opens the device for itself.
    fn of_jobs(all: &[GpuOptions], jobs: usize) -> Result<Vec<Arc<Device>>> {
        let mut devices: Vec<Arc<Device>> = vec![];
        for job in 0..jobs {
            let same = job.checked_sub(all.len()).map(|before| devices[before].clone());
            let shared = same.filter(|device| !device.is_cpu);
            devices.push(shared.map_or_else(|| Device::open(&all[job % all.len()]), Ok)?);
        }
        Ok(devices)
    }

    fn gpu(&self) -> Result<Gpu> {
        let mut slot = self.gpu.lock().unwrap_or_else(PoisonError::into_inner);
        let gpu = match slot.take() {
            Some(gpu) => gpu,
            None => Gpu::open(&self.options)?,
        };
        Ok(slot.insert(gpu).clone())
    }

    fn forget(&self) {
        *self.gpu.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// A capture on its way.
struct Work<T> {
    capture: Listed,
    record: Record,
    /// Seconds that it took so far.
    seconds: f64,
    request: Request,
    notes: Vec<String>,
    /// Held until the result is there.
    claim: Claim,
    /// What the last stage made of it.
    made: T,
}

/// A batch that is ready to run.
pub(super) struct Lines<'b> {
    batch: &'b Batch,
    caller: &'b dyn Caller,
    /// That of each job.
    devices: Vec<Arc<Device>>,
    /// The captures of the shard.
    pub captures: Vec<Listed>,
    /// Whether there is no room for another result.
    full: AtomicBool,
}

impl<'b> Lines<'b> {
    /// Opens the devices.
    ///
    /// # Errors
    /// A device is missing.
    pub fn new(batch: &'b Batch, caller: &'b dyn Caller) -> Result<Lines<'b>> {
        let held = batch.captures.iter().filter(|c| batch.shard.holds(&c.name));
        let captures: Vec<Listed> = held.cloned().collect();
        let devices = Device::of_jobs(&batch.devices, batch.jobs.min(captures.len().max(1)))?;
        Ok(Lines { batch, caller, devices, captures, full: AtomicBool::new(false) })
    }

    /// Runs until all captures are through, or the caller stops.
    pub fn run(&self, tell: &mut dyn FnMut(&CaptureEnd)) {
        let jobs = self.devices.len();
        let (told, all_told) = channel();
        let (read, to_solve) = sync_channel(jobs - 1);
        let (solved, to_write) = sync_channel(jobs);
        let to_solve = Mutex::new(to_solve);
        std::thread::scope(|scope| {
            let (of_reader, of_writer) = (told.clone(), told.clone());
            scope.spawn(move || self.read(&read, &of_reader));
            for device in &self.devices {
                let (solved, told, to_solve) = (solved.clone(), told.clone(), &to_solve);
                scope.spawn(move || self.solve(device, to_solve, &solved, &told));
            }
            scope.spawn(move || self.write(&to_write, &of_writer));
            let (end, ended) = channel::<()>();
            scope.spawn(move || {
                while ended.recv_timeout(claim::EVERY) == Err(RecvTimeoutError::Timeout) {
                    claim::keep(&self.batch.out);
                }
            });
            drop((solved, told));
            all_told.iter().for_each(|one| tell(&one));
            drop(end);
        });
    }

    fn is_stopped(&self) -> bool {
        self.full.load(Ordering::Relaxed) || self.caller.may_continue(None).is_break()
    }

    /// Tells of a capture that failed. For want of room, all others would fail, too: the batch ends.
    fn fail(&self, told: &Sender<CaptureEnd>, capture: &Listed, seconds: f64, mut error: Error) {
        if is_full(&error) {
            self.full.store(true, Ordering::Relaxed);
            error.mend = error.mend.and(", then start the batch again: it ends here, and goes on from here");
        }
        // The receiver lives as long as the threads.
        let _ = told.send(CaptureEnd { status: Status::Failed, error: Some(error), ..of(capture, seconds) });
    }

    /// Claims a capture that is not done. What is told instead of one that is, or that another batch is at.
    fn claim(&self, capture: &Listed, record: &Record) -> Result<std::result::Result<Claim, CaptureEnd>> {
        let folder = self.batch.out.join(&capture.name);
        let skipped = || CaptureEnd { status: Status::Skipped, ..of(capture, 0.0) };
        let done = || {
            record.is_done(&folder, WHOLE).then(|| CaptureEnd { folder: Some(folder.clone()), ..skipped() })
        };
        if let Some(done) = done() {
            return Ok(Err(done));
        }
        // Names may be as long as a file's, so the claim's has its beginning.
        let begin: String = capture.name.chars().take(40).collect();
        let name = format!("{begin}-{:08x}", names::hash(capture.name.as_bytes()));
        Ok(match Claim::take(&self.batch.out, &name)? {
            // Another batch may have ended it meanwhile.
            Ok(claim) => done().map_or(Ok(claim), Err),
            Err(owner) => {
                Err(CaptureEnd { notes: vec![format!("another batch is at it: {owner}")], ..skipped() })
            }
        })
    }

    fn read(&self, next: &SyncSender<Work<Loaded>>, told: &Sender<CaptureEnd>) {
        for capture in &self.captures {
            if self.is_stopped() {
                return;
            }
            let start = Instant::now();
            let record = Record::of(&capture.path, &self.batch.options);
            let folder = self.batch.out.join(&capture.name);
            let claim = match self.claim(capture, &record) {
                Ok(Ok(claim)) => claim,
                Ok(Err(skipped)) => {
                    let _ = told.send(CaptureEnd { seconds: start.elapsed().as_secs_f64(), ..skipped });
                    continue;
                }
                Err(error) => {
                    self.fail(told, capture, start.elapsed().as_secs_f64(), error);
                    continue;
                }
            };
            let (loaded, mut looked) =
                opened::during(|| guarded(|| check_place(&folder).and_then(|()| self.caller.load(capture))));
            let seconds = start.elapsed().as_secs_f64();
            match loaded {
                Ok((loaded, request)) => {
                    let request = Request { preview: false, ..request };
                    looked.extend(request.truth.iter().map(|truth| (truth.clone(), Stamp::of(truth))));
                    let record = record.beside(&looked);
                    let notes = loaded.notes.clone();
                    let capture = capture.clone();
                    // It waits until a solver takes it. No solver left is the end.
                    let work = Work { capture, record, seconds, request, notes, claim, made: loaded };
                    if next.send(work).is_err() {
                        return;
                    }
                }
                Err(error) => self.fail(told, capture, seconds, error),
            }
        }
    }

    fn solve(
        &self,
        device: &Device,
        from: &Mutex<Receiver<Work<Loaded>>>,
        next: &SyncSender<Work<Solved>>,
        told: &Sender<CaptureEnd>,
    ) {
        loop {
            let work = from.lock().unwrap_or_else(PoisonError::into_inner).recv();
            let Ok(Work { capture, record, seconds, request, notes, claim, made: loaded }) = work else {
                return;
            };
            if self.is_stopped() {
                continue;
            }
            let start = Instant::now();
            let mut hear = |p: &_| match self.full.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => self.caller.may_continue(Some((&capture, p))),
            };
            let solved = guarded(|| run::solve(&request, &loaded, &device.gpu()?, &mut hear));
            let seconds = seconds + start.elapsed().as_secs_f64();
            match solved {
                Ok(made) => {
                    let notes = [&notes[..], &made.outcome.notes, &made.outcome.validation].concat();
                    if next.send(Work { capture, record, seconds, request, notes, claim, made }).is_err() {
                        return;
                    }
                }
                // It is left for the next start.
                Err(error) if error.kind == Kind::Cancelled => {}
                Err(error) => {
                    if error.kind == Kind::Device {
                        device.forget();
                    }
                    self.fail(told, &capture, seconds, error);
                }
            }
        }
    }

    fn write(&self, from: &Receiver<Work<Solved>>, told: &Sender<CaptureEnd>) {
        for Work { capture, record, seconds, mut request, notes, claim, made } in from {
            if self.full.load(Ordering::Relaxed) {
                continue;
            }
            let start = Instant::now();
            let figures = Figures::of(&made.outcome);
            let written = guarded(|| {
                let staging = Staging::new(&self.batch.out)?;
                request.out = staging.path().join(&capture.name);
                made.write(&request)?;
                record.commit(staging, &capture.name, WHOLE)
            });
            drop(claim);
            let seconds = seconds + start.elapsed().as_secs_f64();
            match written {
                Ok(folder) => {
                    let _ = told.send(CaptureEnd {
                        folder: Some(folder),
                        figures: Some(figures),
                        notes,
                        ..of(&capture, seconds)
                    });
                }
                Err(error) => self.fail(told, &capture, seconds, error),
            }
        }
    }
}

/// A capture that is done.
fn of(capture: &Listed, seconds: f64) -> CaptureEnd {
    CaptureEnd {
        capture: capture.clone(),
        status: Status::Done,
        seconds,
        error: None,
        folder: None,
        figures: None,
        notes: vec![],
    }
}

/// A panic as an error: one capture must not end the batch.
fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(defect(&*panic)))
}

fn defect(panic: &(dyn Any + Send)) -> Error {
    let text = panic_message(panic).unwrap_or("no message");
    Error::device(format!("internal error: {text}"), "report it with the capture")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_of_one_capture() {
        let error = guarded::<()>(|| panic!("a defect")).unwrap_err();
        assert!(error.what.contains("a defect"), "{error}");
        assert_eq!(guarded(|| Ok(1)).unwrap(), 1);
    }
}
