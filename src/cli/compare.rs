//! `thirdbounce compare CAPTURE --truth TRUTH --out DIR`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use thirdbounce::export::comparison::LeftOut;
use thirdbounce::job::{
    self, Comparison, FindPulse, Foreign, ForeignResult, Loaded, Method, Request, SolverOptions, Turn,
};
use thirdbounce::maps::Maps;
use thirdbounce::measure::PaperMeasure;
use thirdbounce::solve::Progress;
use thirdbounce::{Error, Result};

use super::input::{CaptureArgs, DeviceArgs, VolumeArgs};
use super::methods;
use super::progress::Meter;
use super::solver::SolverArgs;
use super::terminal::{print, say};
use super::{interrupt, units};

pub const METHODS: &str = "\
Methods:
  A method is a solver, or solver:key=value,key=value,... Keys are the solver options, depth-pitch,
  trace-every and no-preview of reconstruct. name=... sets the name in plots and folders. Options that a method does
  not set are taken from the options given here. The other methods are compared with the first. The curve of vector
  begins with the preview that reconstruct shows first, unless no-preview says otherwise.
  all stands for every method of this version that does not stand beside it; those whose assumptions the capture breaks
  are left out.
    --method paper --method paper:learning-rate=0.3,name=slow --method paper:sampling=fixed,no-reduce
    --method 'paper;paper:iterations=300,double-every=50'";

#[derive(clap::Args)]
#[command(after_help = METHODS)]
pub struct Args {
    #[command(flatten)]
    capture: CaptureArgs,
    /// True maps to measure against
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Folder for plots, tables and each method's maps
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A method (see below). May be repeated, or separate several with ; all: every method [default: the
    /// iterative solvers, or --solver]
    #[arg(long, visible_alias = "methods", value_name = "METHOD", value_delimiter = ';')]
    method: Vec<String>,
    /// Maps that another program made of the same capture: a file (npz, EXR or MATLAB) or a folder with maps.npz,
    /// maps.exr or maps.mat, the seconds that it took and what it ran on. They are measured and drawn beside the methods.
    /// A row of a published table has figures in place of the folder, as evaluate prints them in the line paper:
    /// NAME,depth=MAE/RMSE,normals=MAE/RMSE,seconds=S,hardware=WORDS, one of depth and normals or both, RMSE or not.
    /// May be repeated
    #[arg(long, value_name = "NAME=FOLDER,seconds=S,hardware=WORDS")]
    foreign: Vec<String>,
    /// Run every method R times, in turns; times are medians
    #[arg(long, value_name = "R", default_value_t = 3)]
    repeats: usize,
    #[command(flatten)]
    how: HowArgs,
}

/// How methods are run and measured.
#[derive(clap::Args)]
pub struct HowArgs {
    /// Measure after every Nth iteration; measuring does not count as solving
    #[arg(long, value_name = "N", default_value_t = 10)]
    trace_every: usize,
    /// A pixel is surface above this share of the brightest albedo [default: the usual mask of each method]
    #[arg(long, value_name = "X", value_parser = units::number)]
    mask_fraction: Option<f64>,
    /// Let the truth choose the mask of every method: the share of the brightest albedo with the best IoU. Tables say so
    #[arg(long, conflicts_with = "mask_fraction")]
    oracle: bool,
    /// No progress and no notes, errors only
    #[arg(long, short)]
    pub quiet: bool,
    #[command(flatten)]
    pub solver: SolverArgs,
    #[command(flatten)]
    grid: VolumeArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub fn run(args: &Args) -> Result<()> {
    let how = &args.how;
    let choice = how.solver.choice();
    let all = match &choice.solver {
        Some(name) => vec![name.as_str()],
        None => SolverOptions::ITERATIVE.to_vec(),
    };
    let specs = how.specs(&args.method, &all)?;
    let foreign = args.foreign.iter().map(|text| foreign(text)).collect::<Result<Vec<_>>>()?;
    let input = args.capture.input(&how.solver)?;
    how.check()?;
    let loaded = job::load(&input)?;
    how.say(&loaded.notes);
    let find_pulse = |usual| args.capture.find_pulse(usual);
    let comparison = Comparison {
        foreign,
        repeats: args.repeats,
        out: args.out.clone(),
        ..how.comparison(&specs, &loaded, &args.truth, &find_pulse)?
    };
    interrupt::stop_in_order();
    let mut meter = Turns::new(how.quiet);
    let compared = job::compare(&comparison, &loaded, &mut |turn, progress| meter.hear(turn, progress));
    meter.end();
    let compared = compared?;
    compared.validation.iter().for_each(|message| say(&format!("validation: {message}")));
    print(&compared.report.table());
    let files: Vec<_> = compared.files.iter().map(|f| f.display().to_string()).collect();
    print(&format!("\nwrote     {}", files.join("\n          ")));
    Ok(())
}

impl HowArgs {
    /// Refuses what no capture makes good.
    pub fn check(&self) -> Result<()> {
        Maps::check_mask_fraction(self.mask_fraction)?;
        self.device.memory()?;
        self.grid.volume_only()?;
        self.grid.bins().map(|_| ())
    }

    /// Says notes, unless it is to be quiet.
    pub fn say(&self, notes: &[String]) {
        if !self.quiet {
            notes.iter().for_each(|note| say(&format!("note: {note}")));
        }
    }

    /// The methods that are asked for, else `usual`, all of them checked.
    pub fn specs(&self, asked: &[String], usual: &[&str]) -> Result<Vec<methods::Spec>> {
        self.solver.choice().check()?;
        let named: Vec<&str> = asked.iter().map(|m| m.trim()).filter(|m| !m.is_empty()).collect();
        if named.is_empty() && !asked.is_empty() {
            return Err(Error::options("--method is empty", "name a solver: --method paper"));
        }
        let base = self.solver.choice();
        let mut specs = vec![];
        let asked_for = if named.is_empty() { usual.to_vec() } else { named };
        for &text in &asked_for {
            if text != "all" {
                specs.push(methods::parse(text, &base)?);
                continue;
            }
            // What stands beside all by itself is not run twice.
            let alone = |name: &&str| !asked_for.iter().any(|text| text.split(':').next() == Some(*name));
            for name in every().filter(alone) {
                specs.push(methods::Spec { is_optional: true, ..methods::parse(name, &base)? });
            }
        }
        Ok(specs)
    }

    /// Every option that changes results, as texts.
    pub fn told(&self, specs: &[methods::Spec]) -> Result<Vec<String>> {
        let mut all: Vec<String> =
            specs.iter().map(|s| format!("method {} {:?} {}", s.name, s.choice, s.no_preview)).collect();
        all.push(format!(
            "trace {} mask {:?} oracle {} bins {:?} depth {:?} volume {:?}",
            self.trace_every,
            self.mask_fraction,
            self.oracle,
            self.grid.bins()?,
            self.grid.depth_pitch,
            self.grid.volume_only()?
        ));
        Ok(all)
    }

    /// What is compared on a capture: once, without a folder.
    pub fn comparison(
        &self,
        specs: &[methods::Spec],
        loaded: &Loaded,
        truth: &Path,
        find_pulse: &dyn Fn(FindPulse) -> FindPulse,
    ) -> Result<Comparison> {
        let (memory, volume, bins) = (self.device.memory()?, self.grid.volume_only()?, self.grid.bins()?);
        let method = |spec: &methods::Spec| {
            let usual = spec.choice.resolve(&loaded.capture).request();
            let request = Request {
                preview: !spec.no_preview && matches!(usual.solver, SolverOptions::Surface(_)),
                tuned: false,
                bins,
                depth_pitch: spec.depth_pitch.or(self.grid.depth_pitch),
                volume,
                memory,
                device: self.device.device.clone(),
                pipeline_cache: self.device.pipeline_cache(),
                validation: self.device.validation,
                truth: Some(truth.into()),
                mask_fraction: self.mask_fraction.or(usual.mask_fraction),
                trace_every: spec.trace_every.or(Some(self.trace_every)),
                find_pulse: find_pulse(usual.find_pulse),
                ..usual
            };
            Method { name: spec.name.clone(), spec: spec.text.clone(), request }
        };
        let mut comparison = Comparison { oracle: self.oracle, repeats: 1, ..Comparison::default() };
        for spec in specs {
            let method = method(spec);
            match method.request.solver.takes(&loaded.capture) {
                Err(e) if spec.is_optional => {
                    comparison.left_out.push(LeftOut { name: method.name, why: e.what });
                }
                _ => comparison.methods.push(method),
            }
        }
        let missing = comparison.left_out.iter().map(|m| format!("{} is left out: {}", m.name, m.why));
        self.say(&missing.collect::<Vec<_>>());
        Ok(comparison)
    }
}

/// The progress of the turns of a comparison.
pub struct Turns {
    quiet: bool,
    shown: Option<(String, usize, Meter)>,
}

impl Turns {
    pub fn new(quiet: bool) -> Turns {
        Turns { quiet, shown: None }
    }

    pub fn hear(&mut self, turn: &Turn<'_>, progress: &Progress) -> ControlFlow<()> {
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

    pub fn end(&mut self) {
        if let Some((_, _, meter)) = self.shown.take() {
            meter.end();
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
