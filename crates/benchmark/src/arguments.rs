//! `thirdbounce benchmark [CAPTURE|DIR]..`: captures × methods × photon counts.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use thirdbounce::engine::Progress;
use thirdbounce::export::npz::write_maps;
use thirdbounce::job::{self, Loaded, Request, SolverOptions};
use thirdbounce::learned::LearnedStart;
use thirdbounce::measure::PaperMeasure;
use thirdbounce::methods::PaperOptions;
use thirdbounce::{Capture, Error, Maps, Result};
use thirdbounce_simulate::DEFAULT_RESOLUTION;

use thirdbounce_command::cli::progress::Meter;
use thirdbounce_command::cli::settings::{ALL, DeviceArgs, SettingsArgs};
use thirdbounce_command::cli::simulate;
use thirdbounce_command::cli::terminal::{print, say, say_error};
use thirdbounce_command::cli::{advice, interrupt};
use thirdbounce_command::family::FamilyCase;

use crate::cases::{self, Case, Files, GROUPS, Source, found_in, truth_of};
use crate::compare::{ComparedMethod, Comparison, Foreign, ForeignResult, MethodRun, compare};
use crate::run::{Benchmark, Mark, Sides, benchmark};
use crate::{methods, pages};

/// Exit code after Ctrl-C, as for the other verbs.
const STOPPED: u8 = 130;

const METHODS: &str = "\
Methods:
  A method is a solver, or solver:key=value,key=value,... Keys are the solver options, depth-pitch,
  trace-every and no-preview of reconstruct. name=... sets the name in plots and folders. time-limit=S stops it at its
  first sample after S seconds. Options that a method does not set are taken from the options given here. The other methods are compared with the first. The curve of surface
  begins with the preview that reconstruct shows first, unless no-preview says otherwise.
  all stands for every method of this version that does not stand beside it, fast for all but paper; those whose
  assumptions the capture breaks are left out.
    --method paper --method paper:learning-rate=0.3,name=slow --method paper:sampling=fixed,no-reduce
    --method 'paper;paper:iterations=300,double-every=50'";

#[derive(clap::Args)]
#[command(after_help = METHODS)]
pub struct BenchmarkArgs {
    /// Captures, and folders of captures and scenes. The truth of NAME.npz is NAME_truth.npz, truth_NAME.npz or
    /// truth/NAME.npz; without one, methods are judged by what closed-form methods agree on. NAME.scene has the arguments of
    /// simulate, or family and the seed of a random scene, whose captures are made
    #[arg(value_name = "CAPTURE|DIR")]
    captures: Vec<PathBuf>,
    /// True maps of the only capture
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Groups of simulated scenes, beside the captures: standard (six cases in five minutes), scenes, points, photons, meshes,
    /// models, or random ones of the family, each also without room and noise [default: standard without captures]
    #[arg(long, value_name = "GROUP,...", value_delimiter = ',', value_parser = GROUPS)]
    set: Vec<String>,
    /// Folder for the page, a folder for each case, and the captures that are made [default: benchmark, in DIR if there is
    /// one]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// A method (see below). May be repeated, or separate several with ; [default: --solver, or fast, with
    /// paper:time-limit=15 for groups of simulated scenes]
    #[arg(long, visible_alias = "methods", value_name = "METHOD", value_delimiter = ';')]
    method: Vec<String>,
    /// Maps that another program made of the same capture: a file (npz, EXR or MATLAB) or a folder with maps.npz,
    /// maps.exr or maps.mat, the seconds that it took and what it ran on. They are measured and drawn beside the methods.
    /// A row of a published table has figures in place of the folder, as evaluate prints them in the line paper:
    /// NAME,depth=MAE/RMSE,normals=MAE/RMSE,seconds=S,hardware=WORDS, one of depth and normals or both, RMSE or not.
    /// May be repeated
    #[arg(long, value_name = "NAME=FOLDER,seconds=S,hardware=WORDS")]
    foreign: Vec<String>,
    /// Draw photon counts from every capture that has exact values, with a mean of P in the strongest bin; one case for
    /// each P
    #[arg(long, value_name = "P,...", value_delimiter = ',')]
    photons: Vec<f64>,
    /// Run every method R times, in turns; times are medians
    #[arg(long, value_name = "R", default_value_t = 1)]
    repeats: usize,
    /// Measure after every Nth iteration; measuring does not count as solving
    #[arg(long, value_name = "N", default_value_t = 10)]
    trace_every: usize,
    /// Let the truth choose the mask of every method: the share of the brightest albedo with the best IoU. Tables say so
    #[arg(long, conflicts_with = "mask_fraction")]
    oracle: bool,
    /// No progress and no notes, errors only
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    settings: SettingsArgs<ALL>,
    #[command(flatten)]
    device: DeviceArgs,
}

/// The method that takes minutes.
const SLOW: &str = PaperOptions::NAME;

/// Seeds of the family that nothing was tuned to.
const SEEDS: std::ops::Range<u64> = 40..60;

/// The case of a file that describes a scene.
fn scene_of(name: String, file: &Path) -> Result<Case> {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let words: Vec<&str> = text.split_whitespace().collect();
    if let ["family", seed] = words[..]
        && let Ok(seed) = seed.parse()
    {
        return Ok(Case::of_scene("", name, FamilyCase::of(seed)));
    }
    let what = simulate::scene_of(file)?;
    let (hide_pulse, render) = (what.hide_pulse, what.render);
    Ok(Case::of_scene("", name, FamilyCase { hide_pulse, render, ..FamilyCase::plain(what.scene) }))
}

/// The case of a capture.
fn case_of(capture: &Path, truth: Option<PathBuf>) -> Case {
    let name = if capture.is_dir() { capture.file_name() } else { capture.file_stem() };
    let name = name.map_or_else(|| "capture".into(), |name| name.to_string_lossy().into_owned());
    Case::of_file(name, capture.into(), truth.or_else(|| truth_of(capture)))
}

impl BenchmarkArgs {
    /// The cases that the arguments name, without those of groups.
    fn cases(&self) -> Result<Vec<Case>> {
        let alone = |what: &str| {
            Error::options(
                format!("{what} belongs to one capture"),
                "give that capture alone, without folders and photons",
            )
        };
        match (&self.captures[..], &self.truth) {
            ([capture], Some(truth)) => return Ok(vec![case_of(capture, Some(truth.clone()))]),
            (_, Some(_)) => return Err(alone("--truth")),
            _ => {}
        }
        let is_one = matches!(&self.captures[..], [only] if !only.is_dir()) && self.photons.is_empty();
        if !is_one && !self.foreign.is_empty() {
            return Err(alone("--foreign"));
        }
        let mut cases = vec![];
        for path in &self.captures {
            match path.is_dir() {
                true => cases.extend(found_in(path, &scene_of)?),
                false => cases.push(case_of(path, None)),
            }
        }
        Ok(cases)
    }
}

pub fn run(args: &BenchmarkArgs) -> Result<ExitCode> {
    let mut sets: Vec<&str> = args.set.iter().map(String::as_str).collect();
    if args.captures.is_empty() && sets.is_empty() {
        sets.push("standard");
    }
    let solver = args.settings.solver();
    // A thousand iterations of every scene would take hours.
    let usual: &[&str] = match solver {
        Some(name) => &[name],
        None if !sets.is_empty() => &["all", "paper:time-limit=15,trace-every=1,name=paper"],
        None => &["fast"],
    };
    let specs = args.specs(&args.method, usual)?;
    let settings = args.settings.of_all_methods()?;
    let mut cases = args.cases()?;
    let groups: Vec<&str> = GROUPS.into_iter().filter(|group| sets.contains(group)).collect();
    cases.extend(cases::all(&groups, SEEDS, None)?.into_iter().flat_map(Case::with_ideal));
    if let Some(wrong) = args.photons.iter().find(|p| !(1e-6..=1e12).contains(*p)) {
        return Err(Error::options(
            format!("the photons of the strongest bin are {wrong}"),
            "give numbers from 1e-6 to 1e12, for example 1000,100,10",
        ));
    }
    let seed = u64::from(settings.seed());
    let with_photons = |case: Case| {
        let counted: Vec<Case> = args.photons.iter().filter_map(|p| case.with_photons(*p, seed)).collect();
        std::iter::once(case).chain(counted)
    };
    let cases: Vec<Case> = cases.into_iter().flat_map(with_photons).collect();
    let repeats = args.repeats;
    Comparison::check_repeats(repeats)?;
    let foreign = args.foreign.iter().map(|text| foreign(text)).collect::<Result<Vec<_>>>()?;
    let maps = |foreign: &Foreign| match &foreign.result {
        ForeignResult::Maps(path) => Some(path.clone()),
        ForeignResult::Figures(_) => None,
    };
    let folder = args.captures.iter().find(|path| path.is_dir() && args.truth.is_none());
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| folder.map_or_else(|| "benchmark".into(), |folder| folder.join("benchmark")));
    let mut options = args.reported(&specs);
    options.push(format!("repeats {repeats} foreign {:?}", args.foreign));
    let count = cases.len();
    let what = Benchmark { cases, out, options, beside: foreign.iter().filter_map(maps).collect() };
    interrupt::stop_in_order();
    let mut running =
        RunningBenchmark { args, specs, repeats, begun: 0, count, turns: Turns::new(args.quiet) };
    let done = benchmark(&what, &mut running);
    running.turns.end();
    let done = done?;
    print(&done.page.brief());
    let files: Vec<_> = done.files.iter().map(|f| f.display().to_string()).collect();
    print(&format!("\nwrote     {}", files.join("\n          ")));
    Ok(match done.page.cases.iter().any(|case| case.why.as_ref().is_some_and(|(_, failed)| *failed)) {
        _ if done.stopped => ExitCode::from(STOPPED),
        true => ExitCode::from(1),
        false => ExitCode::SUCCESS,
    })
}

/// Typical seconds of a method on two cores, for forecasts.
fn typical(spec: &methods::Spec) -> f64 {
    let seconds: f64 = match spec.text.split(':').next().unwrap_or_default() {
        "surface" => 4.0,
        "paper" => 120.0,
        "phasor-bp" | "fbp" | "bp" => 2.5,
        _ => 0.5,
    };
    seconds.min(1.1 * spec.limit.unwrap_or(f64::INFINITY))
}

impl BenchmarkArgs {
    /// Says notes, unless it is to be quiet.
    fn say(&self, notes: &[String]) {
        if !self.quiet {
            notes.iter().for_each(|note| say(&format!("note: {note}")));
        }
    }

    /// The methods that are asked for, else `usual`, all of them checked.
    fn specs(&self, asked: &[String], usual: &[&str]) -> Result<Vec<methods::Spec>> {
        let named: Vec<&str> = asked.iter().map(|m| m.trim()).filter(|m| !m.is_empty()).collect();
        if named.is_empty() && !asked.is_empty() {
            return Err(Error::options("--method is empty", "name a solver: --method paper"));
        }
        let base = &self.settings;
        let mut specs = vec![];
        let asked_for = if named.is_empty() { usual.to_vec() } else { named };
        for &text in &asked_for {
            if !matches!(text, "all" | "fast") {
                specs.push(methods::parse(text, base)?);
                continue;
            }
            // What stands beside all by itself is not run twice.
            let alone = |name: &&str| {
                let is_slow = text == "fast" && *name == SLOW;
                !is_slow && !asked_for.iter().any(|text| text.split(':').next() == Some(*name))
            };
            for name in every().filter(alone) {
                specs.push(methods::Spec { is_optional: true, ..methods::parse(name, base)? });
            }
        }
        Ok(specs)
    }

    /// Every option that changes results, as texts.
    fn reported(&self, specs: &[methods::Spec]) -> Vec<String> {
        let of =
            |s: &methods::Spec| format!("method {} {:?} {} {:?}", s.name, s.settings, s.no_preview, s.limit);
        let mut all: Vec<String> = specs.iter().map(of).collect();
        all.push(format!("trace {} oracle {}", self.trace_every, self.oracle));
        all
    }

    /// What is compared on a capture: once, without a folder.
    fn comparison(
        &self,
        specs: &[methods::Spec],
        case: &Case,
        loaded: &Loaded,
        truth: &Path,
    ) -> Result<Comparison> {
        let method = |spec: &methods::Spec| -> Result<ComparedMethod> {
            let settings = spec.settings.settings()?;
            let request = Request {
                preview: !spec.no_preview && settings.method.name() == SolverOptions::DEFAULT,
                pipeline_cache: self.device.pipeline_cache(),
                validation: self.device.validation,
                truth: Some(truth.into()),
                trace_every: spec.trace_every.or(Some(self.trace_every)),
                ..Request::new(settings, "")
            };
            Ok(ComparedMethod {
                name: spec.name.clone(),
                spec: spec.text.clone(),
                request,
                limit: spec.limit,
            })
        };
        let mut comparison = Comparison {
            case: Some(case.clone()),
            foreign: self.foreign.iter().map(|text| foreign(text)).collect::<Result<_>>()?,
            oracle: self.oracle,
            ..Comparison::default()
        };
        for spec in specs {
            let method = method(spec)?;
            match method.request.job(&loaded.capture).solver.takes(&loaded.capture) {
                Err(e) if spec.is_optional => {
                    comparison.left_out.push((method.name, e.what));
                }
                _ => comparison.methods.push(method),
            }
        }
        let missing = comparison.left_out.iter().map(|(name, why)| format!("{name} is left out: {why}"));
        self.say(&missing.collect::<Vec<_>>());
        Ok(comparison)
    }
}

struct RunningBenchmark<'a> {
    args: &'a BenchmarkArgs,
    specs: Vec<methods::Spec>,
    repeats: usize,
    /// Cases that have begun, and all.
    begun: usize,
    count: usize,
    turns: Turns,
}

impl Sides for RunningBenchmark<'_> {
    fn run(
        &mut self,
        case: &Case,
        files: &Files,
        folder: &Path,
        mark: Mark<'_>,
    ) -> Result<pages::CaseResults> {
        let loaded = job::load(&files.capture, &self.args.settings.of_all_methods()?)?;
        self.args.say(&loaded.notes);
        let comparison = self.args.comparison(&self.specs, case, &loaded, &files.truth)?;
        let mut comparison = Comparison { repeats: self.repeats, out: folder.into(), ..comparison };
        if let (Source::Scene(scene), "family") = (&case.source, case.group) {
            comparison.foreign.extend(network_alone(&loaded.capture, scene.scene.extent(), &files.capture)?);
        }
        comparison.check()?;
        mark()?;
        compare(&comparison, &loaded, &mut |turn, progress| self.turns.hear(turn, progress))
    }

    fn expected(&self, _: &Case) -> f64 {
        3.0 + self.repeats as f64 * self.specs.iter().map(typical).sum::<f64>()
    }

    fn begin(&mut self, case: &Case, remaining: f64) -> ControlFlow<()> {
        self.turns.end();
        self.begun += 1;
        if !self.args.quiet {
            let (at, of, name) = (self.begun, self.count, &case.name);
            say(&format!("case {at} of {of}: {name}; about {remaining:.0} s remain"));
        }
        interrupt::asked()
    }

    fn end(&mut self, case: &pages::CaseResults) {
        self.turns.end();
        let quiet = self.args.quiet;
        match &case.why {
            Some((why, true)) => {
                let hint = case.hint.as_ref().map_or_else(String::new, advice::text);
                say_error(&format!("{}: ", case.name), why, &hint);
            }
            Some((why, false)) if !quiet => say(&format!("note: {} is left out: {why}", case.name)),
            None if !quiet && case.was_there => say(&format!("{} is done already", case.name)),
            None if !quiet => say(&format!("{} is done after {:.1} s", case.name, case.seconds)),
            _ => {}
        }
    }
}

/// What the network of the learned start says alone, beside the capture that was made. `None`: too few pairs.
fn network_alone(capture: &Capture, extent: [f64; 4], file: &Path) -> Result<Option<Foreign>> {
    let start = Instant::now();
    let Some(seen) = LearnedStart::on_host(capture, None)? else { return Ok(None) };
    let maps = seen.maps_like(&Maps::empty([DEFAULT_RESOLUTION; 2], extent));
    let folder = file.with_extension("network");
    write_maps(&folder.join("maps.npz"), &maps)?;
    Ok(Some(Foreign {
        name: "network".into(),
        result: ForeignResult::Maps(folder),
        seconds: start.elapsed().as_secs_f64(),
        hardware: "host".into(),
    }))
}

/// The progress of the turns of a comparison.
struct Turns {
    quiet: bool,
    shown: Option<(String, usize, Meter)>,
}

impl Turns {
    fn new(quiet: bool) -> Turns {
        Turns { quiet, shown: None }
    }

    fn hear(&mut self, turn: &MethodRun<'_>, progress: &Progress) -> ControlFlow<()> {
        let is_shown =
            |(name, number, _): &(String, usize, Meter)| name == turn.name && *number == turn.number;
        if !self.shown.as_ref().is_some_and(is_shown) {
            self.end();
            if !self.quiet {
                say(&format!("{} of {}: {}", turn.number + 1, turn.turns, turn.name));
            }
            self.shown = Some((turn.name.into(), turn.number, Meter::new(self.quiet)));
        }
        self.shown.as_mut().map_or(ControlFlow::Continue(()), |(_, _, meter)| meter.hear(progress))
    }

    fn end(&mut self) {
        if let Some((_, _, mut meter)) = self.shown.take() {
            meter.end(false);
        }
    }
}

/// All methods, the default solver first: the others are compared with it.
fn every() -> impl Iterator<Item = &'static str> {
    let others = SolverOptions::NAMES.iter().copied().filter(|name| *name != SolverOptions::DEFAULT);
    std::iter::once(SolverOptions::DEFAULT).chain(others)
}

/// Reads a result of another program: NAME=FOLDER,seconds=S,hardware=WORDS, or figures in place of the folder.
fn foreign(text: &str) -> Result<Foreign> {
    let wrong = |what: &str| {
        Error::options(
            format!("--foreign {text:?} {what}"),
            "write NAME=FOLDER,seconds=S,hardware=WORDS: the folder of its maps.npz, and what it took and ran on; without \
             maps NAME,depth=MAE/RMSE,normals=MAE/RMSE,seconds=S,hardware=WORDS",
        )
    };
    let mut parts = text.split(',');
    let first = parts.next().unwrap_or_default();
    let (name, maps) = first.split_once('=').map_or((first, None), |(name, maps)| (name, Some(maps)));
    let (mut seconds, mut hardware, mut figures) = (None, None, PaperMeasure::default());
    for part in parts {
        let both = |value: &str| -> Result<[Option<f64>; 2]> {
            let known = |text: &str| text.trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
            let all: Option<Vec<f64>> = value.split('/').map(known).collect();
            match all.as_deref() {
                Some([mae]) => Ok([Some(*mae), None]),
                Some([mae, rmse]) => Ok([Some(*mae), Some(*rmse)]),
                _ => Err(wrong(&format!("has {part:?}, which is not MAE or MAE/RMSE"))),
            }
        };
        match part.split_once('=').map(|(key, value)| (key.trim(), value.trim())) {
            Some(("seconds", value)) => seconds = value.parse::<f64>().ok().filter(|s| s.is_finite()),
            Some(("hardware", value)) => hardware = Some(value.to_string()),
            Some(("depth", value)) => [figures.depth_mae, figures.depth_rmse] = both(value)?,
            Some(("normals", value)) => [figures.normal_mae, figures.normal_rmse] = both(value)?,
            _ => return Err(wrong(&format!("has the part {part:?}"))),
        }
    }
    let result = match (maps, figures == PaperMeasure::default()) {
        (Some(maps), true) => ForeignResult::Maps(maps.trim().into()),
        (None, false) => ForeignResult::Figures(figures),
        (None, true) => return Err(wrong("names no folder")),
        (Some(_), false) => return Err(wrong("has both maps and figures")),
    };
    Ok(Foreign {
        name: name.trim().into(),
        result,
        seconds: seconds.ok_or_else(|| wrong("gives no seconds"))?,
        hardware: hardware.ok_or_else(|| wrong("gives no hardware"))?,
    })
}
