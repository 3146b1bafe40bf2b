//! Many captures, one after the other on each of a few threads. A result appears whole or not at all; finished ones are
//! skipped. The index of all results is renewed on the way and at the end.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::{Value, json};

use crate::record::{ResultRecord, check_place};
use thirdbounce::engine::Progress;
use thirdbounce::export::index::IndexRow;
use thirdbounce::export::report::Report;
use thirdbounce::export::{index, npz, report};
use thirdbounce::files::atomic;
use thirdbounce::files::atomic::is_full;
use thirdbounce::files::staging::Staging;
use thirdbounce::gpu::{DeviceKind, Gpu, GpuOptions};
use thirdbounce::job::{Loaded, Request, places};
use thirdbounce::maps::Maps;
use thirdbounce::{Error, Kind, Result, job, panic_message};

/// The file of a result that is written last.
const LAST: &str = "report.json";
/// Notes and warnings on a capture and its result.
const LOG: &str = "log.txt";
/// Memory of a job: at least, and as a multiple of its file.
const LEAST_MEMORY: u64 = 1 << 29;
const TIMES_FILE: u64 = 16;
/// Least time between two indices of a batch that runs.
const BETWEEN: Duration = Duration::from_secs(10);

/// A capture of a batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// The file or folder.
    pub path: PathBuf,
    /// The name of its result folder.
    pub name: String,
}

/// Names captures after their files, without the ending; where several files share a name, a hash of the path is appended. A
/// file that is listed twice is one capture.
pub fn named(paths: &[PathBuf]) -> Vec<Listed> {
    let mut seen = BTreeSet::new();
    let whole = |path: &PathBuf| std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
    let all: Vec<_> = paths.iter().map(|path| (path, whole(path), stem(path))).collect();
    let all: Vec<_> = all.into_iter().filter(|(_, whole, _)| seen.insert(whole.clone())).collect();
    let mut times = BTreeMap::new();
    all.iter().for_each(|(_, _, stem)| *times.entry(stem.clone()).or_insert(0) += 1);
    let name = |whole: &Path, stem: &str| match times[stem] {
        1 => stem.to_string(),
        _ => format!("{stem}-{:08x}", hash(whole.as_os_str().as_encoded_bytes())),
    };
    all.iter().map(|(path, whole, stem)| Listed { path: (*path).clone(), name: name(whole, stem) }).collect()
}

/// The name of a file without its ending, in letters that every file system takes.
fn stem(path: &Path) -> String {
    let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
    let name = name.map_or_else(|| "capture".into(), |name| name.to_string_lossy().into_owned());
    let plain = |c: char| if c.is_alphanumeric() || "-_+=.,@".contains(c) { c } else { '_' };
    let name: String = name.trim_start_matches('.').chars().map(plain).collect();
    if name.is_empty() { "capture".into() } else { name }
}

/// FNV-1a.
fn hash(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

/// What to reconstruct.
#[derive(Debug, Clone)]
pub struct Batch {
    /// The captures ([`named`]), of which every `of`-th is reconstructed, beginning with the `part`-th.
    pub captures: Vec<Listed>,
    /// (part, of), part from 1 to of.
    pub shard: (usize, usize),
    /// The folder in which every capture gets a folder of its own.
    pub out: PathBuf,
    /// Every option that changes results, as given: a result with others is made again.
    pub options: Vec<String>,
    /// The device of all threads.
    pub device: GpuOptions,
    /// Captures at once; `None`: on the host as many as there are threads and memory for, else one.
    pub jobs: Option<usize>,
}

/// What happened to a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// It is reconstructed.
    Done,
    /// Its result was there.
    Skipped,
    /// It has no result.
    Failed,
}

/// How a capture ended.
#[derive(Debug, Clone)]
pub struct CaptureEnd {
    /// The capture.
    pub capture: Listed,
    /// What happened.
    pub status: Status,
    /// Seconds of reading, solving and writing.
    pub seconds: f64,
    /// What went wrong.
    pub error: Option<Error>,
    /// Key figures of the result, for a line of a table; else null.
    pub figures: Value,
    /// Captures of the shard that have ended, with this one, and all of them.
    pub number: [usize; 2],
    /// Expected seconds until the end of the batch, from the captures that were reconstructed.
    pub remaining: Option<f64>,
    /// What looks wrong with the capture or the result, as sentences.
    pub warnings: Vec<String>,
}

/// How a batch ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Captures of this shard.
    pub captures: usize,
    /// Those that were reconstructed.
    pub done: usize,
    /// Those whose results were there.
    pub skipped: usize,
    /// Those without a result.
    pub failed: usize,
    /// Whether the caller or a full disk stopped the batch. Captures that are not counted are left.
    pub stopped: bool,
    /// Seconds of the whole batch.
    pub seconds: f64,
}

/// What a batch asks of its caller, from several threads.
pub trait Caller: Sync {
    /// Files besides the capture on which its result depends.
    fn beside(&self, capture: &Listed) -> Vec<PathBuf>;

    /// Reads a capture and the settings of its reconstruction. The folder of its result is set afterwards.
    ///
    /// # Errors
    /// The capture cannot be used: it fails, the batch continues.
    fn load(&self, capture: &Listed) -> Result<(Loaded, Request)>;

    /// Called between captures and during solves. May stop the batch.
    fn may_continue(&self) -> ControlFlow<()>;

    /// Called with the progress of a capture's solve, and the number of captures of the shard.
    fn progress(&self, capture: &Listed, of: usize, progress: &Progress);

    /// The hint of an error in the caller's words.
    fn hint(&self, error: &Error) -> String;
}

/// Reconstructs many captures. `report` is called once for each, by this thread, in the order in which they end.
///
/// # Errors
/// Before anything is computed: no device, or a folder that cannot be written. An error of a capture is reported, and the
/// batch continues, unless the disk is full.
pub fn batch(what: &Batch, caller: &dyn Caller, report: &mut dyn FnMut(&CaptureEnd)) -> Result<Tally> {
    let start = Instant::now();
    places::check_folder(&what.out)?;
    let (part, of) = what.shard;
    let captures: Vec<_> = what.captures.iter().skip(part.max(1) - 1).step_by(of.max(1)).collect();
    let mut first = Some(Gpu::open(&what.device)?);
    // Removes what a killed process left.
    drop(Staging::new(&what.out)?);
    let mut tally = Tally { captures: captures.len(), ..Tally::default() };
    let mut rows = IndexRows::default();
    let (next, full) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (send, ends) = channel();
    let threads = rayon::current_num_threads();
    let is_host = first.as_ref().is_some_and(|gpu| gpu.info.kind == DeviceKind::Host);
    let usual = || if is_host { threads.min(room_for(&captures)) } else { 1 };
    let jobs = what.jobs.unwrap_or_else(usual).clamp(1, captures.len().max(1));
    // Each job has its share of the threads: a solve of few points does not fill many.
    let pool = || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads((threads / jobs).max(1)).build();
        pool.map_err(|e| Error::memory(format!("threads cannot be started: {e}"), "run fewer jobs"))
    };
    let pools = (jobs > 1).then(|| (0..jobs).map(|_| pool()).collect::<Result<Vec<_>>>()).transpose()?;
    if is_host && jobs > 1 {
        // A host counts the threads of the pool in which it is opened.
        first = None;
    }
    std::thread::scope(|scope| {
        for job in 0..jobs {
            let (send, mut gpu) = (send.clone(), first.take());
            let (captures, next, full) = (&captures, &next, &full);
            let pool = pools.as_ref().map(|pools| &pools[job]);
            let mut work = move || {
                let stopped = || full.load(Relaxed) || caller.may_continue().is_break();
                while !stopped() {
                    let Some(capture) = captures.get(next.fetch_add(1, Relaxed)) else { return };
                    let hear = |progress: &Progress| caller.progress(capture, captures.len(), progress);
                    let Some(mut end) = what.one(capture, caller, &mut gpu, &stopped, &hear) else { return };
                    if let Some(error) = end.error.as_mut().filter(|error| is_full(error)) {
                        full.store(true, Relaxed);
                        let more = ", then start the batch again: it continues where it ended";
                        error.hint = error.hint.clone().and(more);
                    }
                    // The receiver lives as long as the threads.
                    let _ = send.send(end);
                }
            };
            scope.spawn(move || match pool {
                Some(pool) => pool.install(work),
                None => work(),
            });
        }
        drop(send);
        for mut end in ends {
            match end.status {
                Status::Done => tally.done += 1,
                Status::Skipped => tally.skipped += 1,
                Status::Failed => tally.failed += 1,
            }
            let ended = tally.done + tally.skipped + tally.failed;
            end.number = [ended, tally.captures];
            let each = start.elapsed().as_secs_f64() / tally.done as f64;
            end.remaining = (tally.done > 0).then(|| each * (tally.captures - ended) as f64);
            report(&end);
            rows.add(&end, caller);
            if rows.written.is_none_or(|at| at.elapsed() > BETWEEN) {
                // A full disk shows in the result of a capture.
                let _ = rows.write(what);
            }
        }
    });
    tally.stopped = tally.done + tally.skipped + tally.failed < tally.captures;
    tally.seconds = start.elapsed().as_secs_f64();
    match rows.write(what) {
        Err(error) if !is_full(&error) => Err(error),
        _ => Ok(tally),
    }
}

/// Captures for which there is memory at once, by the largest file.
fn room_for(captures: &[&Listed]) -> usize {
    let bytes = |capture: &&Listed| std::fs::metadata(&capture.path).map_or(0, |file| file.len());
    let each = LEAST_MEMORY + TIMES_FILE * captures.iter().map(bytes).max().unwrap_or(0);
    (thirdbounce::host::free() / each) as usize
}

/// Rows of the index by name: those of captures that ended, and of results that are there.
#[derive(Default)]
struct IndexRows {
    rows: BTreeMap<String, IndexRow>,
    written: Option<Instant>,
}

impl IndexRows {
    fn add(&mut self, end: &CaptureEnd, caller: &dyn Caller) {
        let row = IndexRow {
            name: end.capture.name.clone(),
            capture: end.capture.path.to_string_lossy().into(),
            status: if end.status == Status::Failed { "failed" } else { "done" },
            figures: end.figures.clone(),
            warnings: end.warnings.clone(),
            error: end.error.as_ref().map(|error| [error.what.clone(), caller.hint(error)]),
        };
        self.rows.insert(row.name.clone(), row);
    }

    /// Writes the index: the captures of the batch, those of other shards, and other results in the folder. Without any result
    /// nothing is written.
    fn write(&mut self, batch: &Batch) -> Result<()> {
        let paths: BTreeMap<&str, &PathBuf> = batch.captures.iter().map(|l| (&*l.name, &l.path)).collect();
        let folders = std::fs::read_dir(&batch.out).into_iter().flatten().flatten();
        let folders = folders.map(|entry| entry.file_name().to_string_lossy().into_owned());
        let names: BTreeSet<String> = folders
            .filter(|name| !name.starts_with('.'))
            .chain(paths.keys().map(|name| name.to_string()))
            .collect();
        let other = |name: String| {
            let path = paths.get(&*name).map_or_else(String::new, |path| path.to_string_lossy().into());
            let found = earlier(&batch.out.join(&name));
            if found.is_none() && path.is_empty() {
                return None;
            }
            let (status, (figures, warnings)) =
                (if found.is_some() { "done" } else { "open" }, found.unwrap_or_default());
            Some(IndexRow { name, capture: path, status, figures, warnings, error: None })
        };
        for name in names {
            let is_known = self.rows.get(&name).is_some_and(|row| row.status != "open");
            if !is_known && let Some(row) = other(name) {
                self.rows.insert(row.name.clone(), row);
            }
        }
        self.written = Some(Instant::now());
        if self.rows.values().all(|row| row.status != "done") {
            return Ok(());
        }
        let settings = format!("thirdbounce {}", env!("CARGO_PKG_VERSION"));
        let all: Vec<IndexRow> = self.rows.values().cloned().collect();
        index::write(&batch.out, &all, &settings)
    }
}

/// Figures and warnings of a result that is there.
fn earlier(folder: &Path) -> Option<(Value, Vec<String>)> {
    let report = report::read(&folder.join(LAST)).ok()?;
    let maps = npz::read_maps(&folder.join("maps.npz")).ok()?;
    Some((figures(&report, &maps), report.warnings))
}

impl Batch {
    /// Reconstructs a capture, unless that is done; `None` if it was stopped. A device that is lost is opened anew by the next.
    fn one(
        &self,
        capture: &Listed,
        caller: &dyn Caller,
        gpu: &mut Option<Gpu>,
        stopped: &dyn Fn() -> bool,
        hear: &dyn Fn(&Progress),
    ) -> Option<CaptureEnd> {
        let start = Instant::now();
        let end = |status, error, (figures, warnings): (Value, Vec<String>)| {
            let (capture, seconds) = (capture.clone(), start.elapsed().as_secs_f64());
            let (number, remaining) = ([0; 2], None);
            Some(CaptureEnd { capture, status, seconds, error, figures, number, remaining, warnings })
        };
        let beside = caller.beside(capture);
        let files = std::iter::once(&capture.path).chain(&beside).map(PathBuf::as_path);
        let record = ResultRecord::of(files, &self.options);
        let folder = self.out.join(&capture.name);
        if record.is_done(&folder, LAST) {
            return end(Status::Skipped, None, earlier(&folder).unwrap_or_default());
        }
        let work = || {
            check_place(&folder)?;
            let (loaded, request) = caller.load(capture)?;
            let open = match gpu.take() {
                Some(gpu) => gpu,
                None => Gpu::open(&self.device)?,
            };
            let gpu = &*gpu.insert(open);
            let mut hear = |progress: &Progress| {
                hear(progress);
                if stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let mut request = Request { preview: false, ..request };
            let solved = job::solve(&request, &loaded, gpu, &mut hear)?;
            let staging = Staging::new(&self.out)?;
            request.out = staging.path().join(&capture.name);
            let outcome = solved.write(&request)?;
            let notes = [&loaded.notes[..], &outcome.notes, &outcome.validation].concat();
            let lines = notes.iter().map(|note| format!("note: {note}\n"));
            let lines = lines.chain(outcome.warnings.iter().map(|warning| format!("warning: {warning}\n")));
            atomic::write(&request.out.join(LOG), lines.collect::<String>().as_bytes())?;
            record.write(&request.out)?;
            staging.commit_folder(&capture.name, LAST)?;
            Ok((figures(&outcome.report, &outcome.maps), outcome.warnings))
        };
        // A defect must not end the batch.
        let done = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
            let text = panic_message(&*panic).unwrap_or("no message");
            Err(Error::device(format!("internal error: {text}"), "report it with the capture"))
        });
        match done {
            Ok(result) => end(Status::Done, None, result),
            Err(error) if error.kind == Kind::Cancelled => None,
            Err(error) => {
                if error.kind == Kind::Device {
                    *gpu = None;
                }
                end(Status::Failed, Some(error), Default::default())
            }
        }
    }
}

fn figures(report: &Report, maps: &Maps) -> Value {
    let (last, metrics) = (report.trace.last(), report.metrics.as_ref());
    json!({
        "verdict": report.verdict.as_ref().map(|verdict| verdict.grade),
        "reasons": report.verdict.as_ref().map(|verdict| verdict.reasons.join("; ")),
        "solver": report.settings["solver"],
        "model": report.settings["model"],
        "iterations": last.map_or(0, |p| p.iteration),
        "residual": last.and_then(|p| p.residual),
        "surface": maps.surface_pixels() as f64 / maps.mask.len().max(1) as f64,
        "depth": maps.median(&maps.depth),
        "depth_error": maps.depth_error.as_deref().and_then(|values| maps.median(values)),
        "solve_s": report.totals.solve_s,
        "iou": metrics.and_then(|m| m.iou),
        "depth_mae": metrics.and_then(|m| m.depth_mae),
        "normal_error_deg": metrics.and_then(|m| m.normal_error_deg),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unlike_and_independent_of_the_order() {
        let named = |all: &[&str]| named(&all.iter().map(PathBuf::from).collect::<Vec<_>>());
        let all = named(&["a/scene.npz", "b/scene.npz", "b/scene.hdf5", "b/other one.npz", "a/scene.npz"]);
        let names: BTreeSet<_> = all.iter().map(|l| l.name.as_str()).collect();
        assert!(all.len() == 4 && names.len() == 4, "{all:?}");
        assert!(names.contains("other_one") && names.iter().filter(|n| n.starts_with("scene-")).count() == 3);
        let back = named(&["b/other one.npz", "b/scene.hdf5", "b/scene.npz", "a/scene.npz"]);
        assert!(all.iter().all(|l| back.contains(l)), "{all:?} {back:?}");
    }
}
