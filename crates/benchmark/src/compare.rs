//! A case of a benchmark: several methods on one capture, in one process and in turns, error against run time.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::cases::Case;
use crate::foreign;
use crate::pages::{self, CurvePoint, SOLVE, SideResults, values_of};
use crate::run::{WHOLE, finish};
use thirdbounce::engine::{Progress, RunsOn};
use thirdbounce::files::staging;
use thirdbounce::gpu::Gpu;
use thirdbounce::job::reconstruct::{self, Iterates, Measure};
use thirdbounce::job::{Loaded, Request, SolverOptions, places, report};
use thirdbounce::maps::{Maps, Truth};
use thirdbounce::measure::{Metrics, PaperMeasure, median, metrics};
use thirdbounce::{Error, Kind, Result, export};

/// Files that a comparison writes into its folder, beside a folder for each method.
const FILES: [&str; 2] = ["pictures.png", WHOLE];

/// Smallest ratio of the times of two stored samples.
const APART: f64 = 1.1;

/// A method of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedMethod {
    /// Its name in plots and tables. Its folder is named after it.
    pub name: String,
    /// The text that asked for it; only for the report.
    pub spec: String,
    /// Its settings. Folder and volume file are ignored. All methods run on the device of the first. With a
    /// preview, its curve begins with that: as soon as it would be shown.
    pub request: Request,
    /// Seconds after which it is stopped at the next measured iterate, which is then its result.
    pub limit: Option<f64>,
}

/// The result of another program for the same capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Foreign {
    /// Its name in plots and tables.
    pub name: String,
    /// Its maps, or its figures only.
    pub result: ForeignResult,
    /// Its run time in seconds, user-supplied.
    pub seconds: f64,
    /// Its hardware, user-supplied.
    pub hardware: String,
}

/// The result of another program.
#[derive(Debug, Clone, PartialEq)]
pub enum ForeignResult {
    /// Maps ([`foreign::read`]): a file, or a folder with a `maps.npz`, `maps.exr` or `maps.mat`.
    Maps(PathBuf),
    /// Printed figures by the paper's measure, for the table only.
    Figures(PaperMeasure),
}

/// A comparison on one capture.
#[derive(Debug, Clone, Default)]
pub struct Comparison {
    /// The case; `None`: a capture without a name.
    pub case: Option<Case>,
    /// All methods. Changes are relative to the first.
    pub methods: Vec<ComparedMethod>,
    /// Results of other programs, for the same table and plot.
    pub foreign: Vec<Foreign>,
    /// Methods not applicable to the capture: name and violated assumption.
    pub left_out: Vec<(String, String)>,
    /// Whether the truth chooses the mask of every method: the share of the brightest albedo with the best IoU.
    pub oracle: bool,
    /// Runs of each method. All methods run once, then all run again.
    pub repeats: usize,
    /// Folder for pictures, the case's file and each method's maps.
    pub out: PathBuf,
}

/// The run that a progress belongs to.
#[derive(Debug, Clone, Copy)]
pub struct MethodRun<'n> {
    /// Index of the turn among all turns, from 0.
    pub number: usize,
    /// Number of all turns.
    pub turns: usize,
    /// Name of the method.
    pub name: &'n str,
}

/// The first run of a method.
struct MeasuredRun {
    maps: Maps,
    metrics: Metrics,
    /// Metrics and seconds of measured iterates by iteration, the result included.
    along: BTreeMap<usize, (f64, Metrics)>,
    seconds: f64,
    limited: bool,
    runs_on: String,
    report: Option<export::report::Report>,
    /// Seconds until what the surface begins with, and its figures, if the curve begins with that.
    preview: Option<(f64, Metrics)>,
}

/// Runs every method `repeats` times, in turns and after a short warm-up. Writes `pictures.png`, each method's maps and report in
/// a folder of its own, and last `case.json`.
///
/// # Errors
/// Before anything is computed: no method, no truth, options out of range, or a place that cannot be written. Later:
/// the errors of a solver, with the method's name. A cancelled comparison writes nothing.
pub fn compare(
    what: &Comparison,
    loaded: &Loaded,
    hear: &mut dyn FnMut(&MethodRun<'_>, &Progress) -> ControlFlow<()>,
) -> Result<pages::CaseResults> {
    let start = Instant::now();
    let (methods, truth) = what.check()?;
    let wall = what.case.as_ref().map_or(f64::NAN, |case| case.wall);
    let wall = if wall.is_nan() { truth.extent[1] - truth.extent[0] } else { wall };
    let measured = |maps: &Maps, fraction: Option<f64>| match &what.case {
        None => metrics(maps, &truth, fraction),
        Some(case) => {
            let mut maps = maps.clone();
            case.without_back(&mut maps);
            metrics(&maps, &truth, fraction)
        }
    };
    let measure: Measure<'_> = &measured;
    let mut others = what.measure_foreign(&truth, measure, same_mask(&methods), wall)?;
    let gpu = methods[0].request.open()?;
    let turns = what.repeats * methods.len();
    for method in &methods {
        reconstruct::warm_up(&method.request, loaded, &gpu)
            .map_err(|e| e.at(format!("method {:?}", method.name)))?;
    }
    let mut runs: Vec<Runs> = methods.iter().map(|_| Runs::default()).collect();
    for number in 0..turns {
        let at = number % methods.len();
        let method = &methods[at];
        let turn = MethodRun { number, turns, name: &method.name };
        let mut hear = |progress: &Progress| hear(&turn, progress);
        let done = what.run(method, loaded, &gpu, measure, &mut hear);
        runs[at].add(done.map_err(|e| e.at(format!("method {:?}", method.name)))?);
    }
    // An older one does not describe the files that are written from here on.
    staging::remove(&what.out.join(WHOLE))?;
    let mut sides = vec![];
    for (method, run) in methods.iter().zip(runs) {
        let Some(outcome) = &run.first else { continue };
        let folder = &method.request.out;
        staging::remove(&folder.join("report.json"))?;
        export::write_maps(folder, &outcome.maps)?;
        if let Some(report) = &outcome.report {
            export::report::write(&folder.join("report.json"), report)?;
        }
        let side = run.side(method, outcome, wall);
        sides.push((side, run.first.map(|first| first.maps)));
    }
    sides.append(&mut others);
    let case = pages::CaseResults {
        seconds: start.elapsed().as_secs_f64(),
        device: format!("{}, driver {}", gpu.info.name.trim(), gpu.info.driver.trim()),
        left_out: what.left_out.clone(),
        oracle: what.oracle,
        ..what.case.as_ref().map(Case::reported).unwrap_or_default()
    };
    finish(&what.out, case, sides, &truth)
}

/// The runs of one method.
#[derive(Default)]
struct Runs {
    first: Option<MeasuredRun>,
    /// Seconds of every run at each measured iteration; 0: of the preview.
    at: BTreeMap<usize, Vec<f64>>,
    totals: Vec<f64>,
}

impl Runs {
    fn add(&mut self, done: MeasuredRun) {
        done.preview.iter().for_each(|(seconds, _)| self.at.entry(0).or_default().push(*seconds));
        for (iteration, (seconds, _)) in &done.along {
            self.at.entry(*iteration).or_default().push(*seconds);
        }
        self.totals.push(done.seconds);
        self.first.get_or_insert(done);
    }

    /// The results of the first run, with medians of the times of all that reached a point.
    fn side(&self, method: &ComparedMethod, first: &MeasuredRun, wall: f64) -> SideResults {
        let point = |iteration: &usize, metrics: &Metrics| {
            let seconds = self.at.get(iteration).and_then(|all| median(all)).unwrap_or(f64::NAN);
            CurvePoint::new(seconds, &values_of(metrics, wall))
        };
        let shown = first.preview.iter().map(|(_, metrics)| point(&0, metrics));
        let points = shown.chain(first.along.iter().map(|(iteration, (_, m))| point(iteration, m)));
        let mut values = values_of(&first.metrics, wall);
        values[SOLVE] = median(&self.totals).unwrap_or(f64::NAN);
        let found = first.report.as_ref().and_then(|r| r.settings["model_found"]["reflectance"].as_str());
        SideResults {
            name: method.name.clone(),
            spec: method.spec.clone(),
            runs_on: first.runs_on.clone(),
            model: found.map(String::from),
            folder: name_of(&method.request.out),
            iterations: first.along.keys().last().copied().unwrap_or(0),
            limited: first.limited,
            repeats_s: self.totals.clone(),
            values,
            preview: first.preview.is_some(),
            points: thinned(points.collect()),
            ..SideResults::default()
        }
    }
}

/// Points whose times differ by a ratio of at least [`APART`], the last among them.
fn thinned(points: Vec<CurvePoint>) -> Vec<CurvePoint> {
    let mut kept: Vec<CurvePoint> = vec![];
    let last = points.len().saturating_sub(1);
    for (i, point) in points.into_iter().enumerate() {
        let is_apart = kept.last().is_none_or(|before| point.seconds >= APART * before.seconds);
        if i == last && !is_apart && kept.len() > 1 {
            kept.pop();
        }
        if is_apart || i == last {
            kept.push(point);
        }
    }
    kept
}

impl Comparison {
    /// Checks the number of repeats.
    ///
    /// # Errors
    /// `Kind::Options`: none, or more than 1,000.
    pub fn check_repeats(repeats: usize) -> Result<()> {
        if (1..=1000).contains(&repeats) {
            return Ok(());
        }
        Err(Error::options(
            format!("the number of repeats is {repeats}"),
            "give a whole number from 1 to 1000, usually 3",
        ))
    }

    /// Checks everything before anything is computed, and that there is a device. Returns the methods with their folders, and the
    /// truth.
    ///
    /// # Errors
    /// Those of [`compare`] before anything is computed.
    pub fn check(&self) -> Result<(Vec<ComparedMethod>, Truth)> {
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
            method.request.volume_file = None;
            let found =
                method.request.check().and_then(|found| method.request.check_places().map(|()| found));
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
        let truth = truth.ok_or_else(missing)?;
        drop(methods[0].request.open()?);
        Ok((methods, truth))
    }

    /// Runs a method, to its end or its time limit.
    fn run(
        &self,
        method: &ComparedMethod,
        loaded: &Loaded,
        gpu: &Gpu,
        measure: Measure<'_>,
        hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<MeasuredRun> {
        let mut iterates = Iterates { limit: method.limit, ..Iterates::default() };
        // A time limit needs samples.
        let step = Some(method.request.trace_step()).filter(|step| *step > 0 || method.limit.is_none());
        let request = &Request { trace_every: step.or(Some(10)), ..method.request.clone() };
        let done = reconstruct::solve_measured(
            request,
            (request.job(&loaded.capture), loaded),
            gpu,
            Some(measure),
            None,
            &mut iterates,
            hear,
        );
        let Iterates { limited, mut along, last, first, .. } = iterates;
        let preview = first.filter(|_| request.preview);
        Ok(match (done, last) {
            (Err(e), Some(maps)) if limited && e.kind == Kind::Cancelled => {
                let (seconds, metrics) =
                    along.last_key_value().map(|(_, found)| found.clone()).unwrap_or_default();
                let solver = request.job(&loaded.capture).solver;
                let runs_on = runs_on(&solver, gpu);
                MeasuredRun { maps, metrics, along, seconds, limited, runs_on, report: None, preview }
            }
            (done, _) => {
                let mut done = done?;
                if self.oracle {
                    done.mask_by(measure)?;
                }
                let report = Some(report::report_of(request, loaded, gpu, &done));
                let metrics = done.metrics.clone().unwrap_or_default();
                let seconds = done.result.solve_seconds;
                if let Some(last) = done.result.trace.last() {
                    // Until the maps are there.
                    along.insert(last.iteration, (seconds, metrics.clone()));
                }
                let runs_on = runs_on(&done.job.solver, gpu);
                MeasuredRun {
                    maps: done.result.maps,
                    metrics,
                    along,
                    seconds,
                    limited: false,
                    runs_on,
                    report,
                    preview,
                }
            }
        })
    }

    /// Reads the maps of other programs and measures them; figures are used unchanged. The maps' own mask counts, or pixels
    /// above `fraction` of the brightest albedo, or what the truth chooses.
    ///
    /// # Errors
    /// Maps that cannot be read, with the name of the program.
    fn measure_foreign(
        &self,
        truth: &Truth,
        measure: Measure<'_>,
        fraction: Option<f64>,
        wall: f64,
    ) -> Result<Vec<(SideResults, Option<Maps>)>> {
        let measured = |other: &Foreign| -> Result<(SideResults, Option<Maps>)> {
            let mut side = SideResults {
                name: other.name.clone(),
                foreign: true,
                runs_on: other.hardware.clone(),
                repeats_s: vec![other.seconds],
                ..SideResults::default()
            };
            let (metrics, maps) = match &other.result {
                ForeignResult::Figures(paper) => (Metrics { paper: *paper, ..Metrics::default() }, None),
                ForeignResult::Maps(file) => {
                    side.spec = file.display().to_string();
                    let mut maps = foreign::read(file, truth.extent)?;
                    let mut found = measure(&maps, fraction)?;
                    if let Some(best) = found.best_fraction.filter(|_| self.oracle) {
                        maps.set_mask(best);
                        found = measure(&maps, Some(best))?;
                    }
                    (found, Some(maps))
                }
            };
            side.values = values_of(&metrics, wall);
            side.values[SOLVE] = other.seconds;
            side.points.extend(maps.iter().map(|_| CurvePoint::new(other.seconds, &side.values)));
            Ok((side, maps))
        };
        let named = |other: &Foreign| measured(other).map_err(|e| e.at(format!("foreign {:?}", other.name)));
        self.foreign.iter().map(named).collect()
    }
}

/// The mask fraction common to all methods, if there is one.
fn same_mask(methods: &[ComparedMethod]) -> Option<f64> {
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
