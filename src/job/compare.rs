//! A case of a benchmark: several methods on one capture, in one process and in turns, error against run time.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::reconstruct::{self, Finished};
use super::{Loaded, Request, SolverOptions, overview, places, preview, report};
use crate::capture::Capture;
use crate::export::comparison::{self, LeftOut, MethodReport, Reached};
use crate::export::report::TraceEntry;
use crate::export::{self, curves, foreign};
use crate::files::staging;
use crate::gpu::Gpu;
use crate::maps::{Maps, Truth};
use crate::measure::{Metrics, PaperMeasure, Reach, median, metrics, reach};
use crate::solve::{Progress, RunsOn};
use crate::{Error, Result};

/// Files that a comparison writes into its folder, beside a folder for each method.
const FILES: [&str; 3] = ["error_vs_time.png", "pictures.png", WHOLE];

/// The file that is written last.
pub const WHOLE: &str = "case.json";

/// A method of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// Its name in plots and tables. Its folder is named after it.
    pub name: String,
    /// The text that asked for it; only for the report.
    pub spec: String,
    /// What to do. Its folder, volume file and snapshots are ignored. All methods run on the device of the first. With a
    /// preview, its curve begins with that: as soon as it would be shown.
    pub request: Request,
}

/// What another program made of the same capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Foreign {
    /// Its name in plots and tables.
    pub name: String,
    /// Its maps, or its figures only.
    pub result: ForeignResult,
    /// Seconds that it took, as its user says.
    pub seconds: f64,
    /// What it ran on, as its user says.
    pub hardware: String,
}

/// The result of another program.
#[derive(Debug, Clone, PartialEq)]
pub enum ForeignResult {
    /// Maps ([`foreign::read`]): a file, or a folder with a `maps.npz`, `maps.exr` or `maps.mat`.
    Maps(PathBuf),
    /// Printed figures by the paper's measure. They stand in the table only.
    Figures(PaperMeasure),
}

/// What to compare.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Comparison {
    /// All methods. The others are compared with the first.
    pub methods: Vec<Method>,
    /// Results of other programs, for the same table and plot.
    pub foreign: Vec<Foreign>,
    /// Methods that do not take the capture: name, and why.
    pub left_out: Vec<LeftOut>,
    /// The truth chooses the mask of every method: the share of the brightest albedo with the best IoU.
    pub oracle: bool,
    /// How often each method runs. All methods run once, then all run again.
    pub repeats: usize,
    /// Folder for plots, tables and each method's maps.
    pub out: PathBuf,
}

/// The run that a progress belongs to.
#[derive(Debug, Clone, Copy)]
pub struct Turn<'n> {
    /// Index of the turn among all turns, from 0.
    pub number: usize,
    /// Number of all turns.
    pub turns: usize,
    /// Name of the method.
    pub name: &'n str,
}

/// The result of a comparison, besides its files.
#[derive(Debug, Clone)]
pub struct Compared {
    /// The comparison, as `case.json` has it.
    pub report: comparison::Comparison,
    /// Messages of the validation layer, if it was on.
    pub validation: Vec<String>,
    /// Every file and folder that was written.
    pub files: Vec<PathBuf>,
}

/// Runs every method `repeats` times, in turns and after a short warm-up. Writes `error_vs_time.png`, `pictures.png`, each
/// method's maps and report in a folder of its own, and last `case.json`.
///
/// # Errors
/// Before anything is computed: no method, no truth, options out of range, or a place that cannot be written. Later:
/// the errors of a solver, with the method's name. A cancelled comparison writes nothing.
pub fn compare(
    what: &Comparison,
    loaded: &Loaded,
    hear: &mut dyn FnMut(&Turn<'_>, &Progress) -> ControlFlow<()>,
) -> Result<Compared> {
    let (methods, truth) = what.check(&loaded.capture)?;
    let foreign = what.measure_foreign(&truth, same_mask(&methods))?;
    let gpu = methods[0].request.open()?;
    let turns = what.repeats * methods.len();
    for method in &methods {
        reconstruct::warm_up(&method.request, loaded, &gpu)
            .map_err(|e| e.at(format!("method {:?}", method.name)))?;
    }
    let mut runs: Vec<Option<Runs<'_>>> = methods.iter().map(|_| None).collect();
    for number in 0..turns {
        let at = number % methods.len();
        let method = &methods[at];
        let turn = Turn { number, turns, name: &method.name };
        let mut hear = |progress: &Progress| hear(&turn, progress);
        let preview = Shown::first(&method.request, loaded, &gpu, &truth)?;
        let solved = reconstruct::solve(&method.request, loaded, &gpu, Some(&truth), None, &mut hear);
        let mut done = solved.map_err(|e| e.at(format!("method {:?}", method.name)))?;
        if what.oracle {
            done.mask_by(&truth)?;
        }
        match &mut runs[at] {
            Some(runs) => runs.add(&done, preview.as_ref()),
            none => *none = Some(Runs::new(done, preview)),
        }
    }
    let runs: Vec<Runs<'_>> = runs.into_iter().flatten().collect();
    let report = what.report(&methods, loaded, &gpu, &runs, &foreign);

    let json = what.out.join(WHOLE);
    // An older one does not describe the files that are written from here on.
    staging::remove(&json)?;
    let mut files = Vec::new();
    for (method, run) in methods.iter().zip(&runs) {
        let folder = &method.request.out;
        staging::remove(&folder.join("report.json"))?;
        export::write_maps(folder, &run.first.result.maps)?;
        let report = report::report_of(&method.request, loaded, &gpu, &run.first);
        export::report::write(&folder.join("report.json"), &report)?;
        files.push(folder.clone());
    }
    let [png, pictures, _] = FILES.map(|n| what.out.join(n));
    export::png::write(&png, &curves::error_vs_time(&report).picture())?;
    let all =
        runs.iter().map(|run| Some(&run.first.result.maps)).chain(foreign.iter().map(|f| f.maps.as_ref()));
    let named = report.methods.iter().zip(all).filter_map(|(m, maps)| Some((m.name.as_str(), maps?)));
    overview::write_all(&pictures, &named.collect::<Vec<_>>(), &truth)?;
    comparison::write_json(&json, &report)?;
    files.extend([png, pictures, json]);
    Ok(Compared { report, validation: gpu.validation_messages(), files })
}

/// A result of another program: its maps, if there are any, and its figures.
struct Measured<'f> {
    foreign: &'f Foreign,
    maps: Option<Maps>,
    metrics: Metrics,
}

/// What is there to see before the solve.
struct Shown {
    lateral: usize,
    /// Seconds until then, from the beginning.
    seconds: f64,
    metrics: Metrics,
}

impl Shown {
    /// The preview of `request`, if it asks for one and there is one.
    ///
    /// # Errors
    /// Those of [`metrics`].
    fn first(request: &Request, loaded: &Loaded, gpu: &Gpu, truth: &Truth) -> Result<Option<Shown>> {
        let start = Instant::now();
        // The solve itself reports errors, as without a comparison.
        let first = || preview::first_maps(&request.resolved(&loaded.capture), &loaded.capture, gpu).ok();
        let maps = request.preview.then(first).flatten();
        let Some(mut maps) = maps else { return Ok(None) };
        let seconds = start.elapsed().as_secs_f64();
        let mask = request.settings.mask_fraction;
        if mask.is_some() {
            maps.set_mask(mask);
        }
        let metrics = metrics(&maps, truth, mask)?.brief();
        Ok(Some(Shown { lateral: maps.nx, seconds, metrics }))
    }
}

/// The runs of one method. A preview's time is part of them.
struct Runs<'c> {
    first: Finished<'c>,
    /// The preview of the first run.
    preview: Option<Shown>,
    /// Seconds of every run at each iteration of the trace; 0: of the preview.
    at: BTreeMap<usize, Vec<f64>>,
    totals: Vec<f64>,
}

impl<'c> Runs<'c> {
    fn new(first: Finished<'c>, preview: Option<Shown>) -> Runs<'c> {
        let mut runs = Runs { at: BTreeMap::new(), totals: vec![], first, preview };
        let Runs { at, totals, first, preview } = &mut runs;
        add(at, totals, first, preview.as_ref());
        runs
    }

    fn add(&mut self, again: &Finished<'_>, preview: Option<&Shown>) {
        add(&mut self.at, &mut self.totals, again, preview);
    }

    /// The measured points of the first run. Times are medians over all runs that reached the point.
    fn trace(&self) -> Vec<TraceEntry> {
        let preview = self.preview.as_ref().map(|shown| TraceEntry {
            lateral: shown.lateral,
            loss: f64::NAN,
            metrics: Some(shown.metrics.clone()),
            ..TraceEntry::default()
        });
        let measured = self.first.trace().into_iter().filter(|entry| entry.metrics.is_some());
        let mut trace: Vec<TraceEntry> = preview.into_iter().chain(measured).collect();
        for entry in &mut trace {
            let seconds = self.at.get(&entry.iteration).and_then(|all| median(all));
            entry.seconds = seconds.unwrap_or(entry.seconds);
        }
        trace
    }
}

/// Adds the times of a run.
fn add(
    at: &mut BTreeMap<usize, Vec<f64>>,
    totals: &mut Vec<f64>,
    done: &Finished<'_>,
    preview: Option<&Shown>,
) {
    let before = preview.map_or(0.0, |shown| shown.seconds);
    let of_preview = preview.map(|shown| (0, shown.seconds));
    let of_trace = done.result.trace.iter().map(|p| (p.iteration, before + p.seconds));
    for (iteration, seconds) in of_preview.into_iter().chain(of_trace) {
        at.entry(iteration).or_default().push(seconds);
    }
    totals.push(before + done.result.solve_seconds);
}

impl Comparison {
    /// Checks how often every method is to run.
    ///
    /// # Errors
    /// `Kind::Options`: never, or more often than anybody waits for.
    pub fn check_repeats(repeats: usize) -> Result<()> {
        if (1..=1000).contains(&repeats) {
            return Ok(());
        }
        Err(Error::options(
            format!("the number of repeats is {repeats}"),
            "give a whole number from 1 to 1000, usually 3",
        ))
    }

    /// Checks everything before anything is computed. Returns the methods with their folders, and the truth.
    pub(super) fn check(&self, capture: &Capture) -> Result<(Vec<Method>, Truth)> {
        if self.methods.is_empty() {
            return Err(Error::options(
                "there is no method to compare",
                "name at least one, for example surface",
            ));
        }
        Comparison::check_repeats(self.repeats)?;
        for name in FILES {
            places::check_file(&self.out.join(name))?;
        }
        let mut methods = self.methods.clone();
        let mut truth = None;
        let mut taken: Vec<String> = FILES.map(String::from).into();
        for method in &mut methods {
            let folder = unused(&folder_name(&method.name), &taken, "-");
            method.request.out = self.out.join(&folder);
            taken.push(folder);
            (method.request.volume_file, method.request.snapshots) = (None, vec![]);
            let found = method
                .request
                .check(&method.request.resolved(capture))
                .and_then(|found| method.request.check_places().map(|()| found));
            let found = found.map_err(|e| e.at(format!("method {:?}", method.name)))?;
            truth = truth.or(found);
        }
        for foreign in &self.foreign {
            if !(foreign.seconds.is_finite() && foreign.seconds > 0.0) {
                return Err(Error::options(
                    format!("foreign {:?} took {} s", foreign.name, foreign.seconds),
                    "give the seconds that the other program took, a positive number",
                ));
            }
        }
        for at in 1..methods.len() {
            let before: Vec<String> = methods[..at].iter().map(|m| m.name.clone()).collect();
            methods[at].name = unused(&methods[at].name, &before, " #");
        }
        let missing = || Error::options("a comparison needs truth", "give the file of the true maps");
        Ok((methods, truth.ok_or_else(missing)?))
    }

    /// Reads the maps of other programs and measures them; figures stay as they are. The maps' own mask counts, or pixels
    /// above `fraction` of the brightest albedo, or what the truth chooses.
    ///
    /// # Errors
    /// Maps that cannot be read, with the name of the program.
    fn measure_foreign(&self, truth: &Truth, fraction: Option<f64>) -> Result<Vec<Measured<'_>>> {
        let mut all = vec![];
        for foreign in &self.foreign {
            let measured = || -> Result<Measured<'_>> {
                let file = match &foreign.result {
                    ForeignResult::Maps(file) => file,
                    ForeignResult::Figures(paper) => {
                        let metrics = Metrics { paper: *paper, ..Metrics::default() };
                        return Ok(Measured { foreign, maps: None, metrics });
                    }
                };
                let mut maps = foreign::read(file, truth.extent)?;
                let mut found = metrics(&maps, truth, fraction)?;
                if let Some(best) = found.best_fraction.filter(|_| self.oracle) {
                    maps.set_mask(best);
                    found = metrics(&maps, truth, best)?;
                }
                Ok(Measured { foreign, maps: Some(maps), metrics: found })
            };
            all.push(measured().map_err(|e| e.at(format!("foreign {:?}", foreign.name)))?);
        }
        Ok(all)
    }

    fn report(
        &self,
        methods: &[Method],
        loaded: &Loaded,
        gpu: &Gpu,
        runs: &[Runs<'_>],
        foreign: &[Measured<'_>],
    ) -> comparison::Comparison {
        let goal = runs[0].first.metrics.clone().unwrap_or_default();
        let whole = report::report_of(&methods[0].request, loaded, gpu, &runs[0].first);
        let report = |(method, run): (&Method, &Runs<'_>)| {
            let last = run.first.result.trace.last();
            let trace = run.trace();
            MethodReport {
                name: method.name.clone(),
                method: method.spec.clone(),
                foreign: false,
                runs_on: runs_on(&run.first.job.solver, gpu),
                folder: name_of(&method.request.out),
                mask_fraction: run.first.result.maps.mask_fraction,
                settings: report::settings(&method.request, loaded, &run.first),
                trace_every: method.request.trace_step(),
                iterations: last.map_or(0, |p| p.iteration),
                seconds: median(&run.totals).unwrap_or(0.0),
                repeats_s: run.totals.clone(),
                preview_s: run.preview.as_ref().and_then(|_| median(run.at.get(&0)?)),
                active: last.map_or(0, |p| p.active),
                active_ratio: last.map_or(0.0, |p| p.active_ratio),
                metrics: run.first.metrics.clone().unwrap_or_default(),
                reach: reached(&goal, &trace),
                trace,
            }
        };
        let other = |Measured { foreign, maps, metrics }: &Measured<'_>| {
            let point = maps.as_ref().map(|_| TraceEntry {
                seconds: foreign.seconds,
                loss: f64::NAN,
                metrics: Some(metrics.clone().brief()),
                ..TraceEntry::default()
            });
            let trace: Vec<_> = point.into_iter().collect();
            MethodReport {
                name: foreign.name.clone(),
                method: match &foreign.result {
                    ForeignResult::Maps(file) => file.display().to_string(),
                    ForeignResult::Figures(_) => String::new(),
                },
                foreign: true,
                runs_on: foreign.hardware.clone(),
                folder: String::new(),
                mask_fraction: maps.as_ref().and_then(|maps| maps.mask_fraction),
                settings: serde_json::Value::Null,
                trace_every: 0,
                iterations: 0,
                seconds: foreign.seconds,
                repeats_s: vec![foreign.seconds],
                preview_s: None,
                active: 0,
                active_ratio: 0.0,
                reach: reached(&goal, &trace),
                metrics: metrics.clone(),
                trace,
            }
        };
        comparison::Comparison {
            version: whole.version,
            device: whole.device,
            capture: whole.capture,
            capture_file: loaded.path.clone(),
            truth: methods[0].request.truth.clone(),
            mask_fraction: same_mask(methods),
            oracle: self.oracle,
            repeats: self.repeats,
            methods: methods.iter().zip(runs).map(report).chain(foreign.iter().map(other)).collect(),
            left_out: self.left_out.clone(),
        }
    }
}

/// The share of the brightest albedo that tells all methods' masks, if there is one.
fn same_mask(methods: &[Method]) -> Option<f64> {
    let mut all = methods.iter().map(|m| m.request.settings.mask_fraction);
    let first = all.next().flatten();
    first.filter(|_| all.all(|other| other == first))
}

/// What a method runs on, in words.
fn runs_on(solver: &SolverOptions, gpu: &Gpu) -> String {
    match solver.common().runs_on {
        RunsOn::Device => gpu.info.name.trim().into(),
        RunsOn::Host => format!("host, {} threads", rayon::current_num_threads()),
    }
}

/// When the trace was as good as `goal`.
fn reached(goal: &Metrics, trace: &[TraceEntry]) -> Reached {
    type Figure = fn(&Metrics) -> Option<f64>;
    // Smaller is better for all of them.
    let figures: [Figure; 3] =
        [|m| m.at_best?.depth_mae, |m| m.at_best?.normal_error_deg, |m| m.best_iou.map(|iou| -iou)];
    let good = |entry: &TraceEntry, figure: Figure| {
        let found = entry.metrics.as_ref().and_then(figure);
        found.zip(figure(goal)).is_some_and(|(found, goal)| found <= goal)
    };
    let of = |target: Option<f64>, figures: &[Figure]| -> Reach {
        let trace: Vec<_> = trace.iter().map(|e| (e.seconds, figures.iter().all(|f| good(e, *f)))).collect();
        reach(target, &trace)
    };
    Reached {
        depth_mae: of(figures[0](goal), &figures[..1]),
        normal_error_deg: of(figures[1](goal), &figures[1..2]),
        best_iou: of(goal.best_iou, &figures[2..]),
        all: of(None, &figures),
    }
}

/// The last part of a path.
fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// A name that any file system accepts.
fn folder_name(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || "-_=+.,".contains(c) { c } else { '_' };
    let name: String = name.chars().map(plain).take(100).collect();
    if name.is_empty() || name.starts_with('.') { format!("_{name}") } else { name }
}

/// `name`, with a number after it if it is taken.
fn unused(name: &str, taken: &[String], between: &str) -> String {
    let free = |name: &String| !taken.iter().any(|t| t.eq_ignore_ascii_case(name));
    let numbered = (2..).map(|i| format!("{name}{between}{i}"));
    std::iter::once(name.to_string()).chain(numbered).find(free).unwrap_or_else(|| name.to_string())
}
