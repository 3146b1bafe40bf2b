//! `thirdbounce compare CAPTURE --truth TRUTH --out DIR`.

use std::path::PathBuf;

use thirdbounce::export::comparison::LeftOut;
use thirdbounce::job::{self, Comparison, Foreign, Method, Request, SolverOptions, Turn};
use thirdbounce::solve::Progress;
use thirdbounce::{Error, Result};

use super::input::{CaptureArgs, DeviceArgs, VolumeArgs};
use super::methods;
use super::progress::{Meter, say};
use super::solver::SolverArgs;
use super::{interrupt, print};

const METHODS: &str = "\
Methods:
  A method is a solver, or solver:key=value,key=value,... Keys are the solver options, depth-pitch and
  trace-every of reconstruct. name=... sets the name in plots and folders. Options that a method does not set are
  taken from the options given here. The other methods are compared with the first.
  all stands for every method of this version; those whose assumptions the capture breaks are left out.
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
    /// Maps that another program made of the same capture: a folder with maps.npz or the file itself, the seconds that it
    /// took and what it ran on. They are measured and drawn beside the methods. May be repeated
    #[arg(long, value_name = "NAME=FOLDER,seconds=S,hardware=WORDS")]
    foreign: Vec<String>,
    /// Run every method R times, in turns; times are medians
    #[arg(long, value_name = "R", default_value_t = 3)]
    repeats: usize,
    /// Measure after every Nth iteration; measuring does not count as solving
    #[arg(long, value_name = "N", default_value_t = 10)]
    trace_every: usize,
    /// A pixel is surface above this share of the brightest albedo [default: the albedo's edges tell; paper 0.3]
    #[arg(long, value_name = "X")]
    mask_fraction: Option<f64>,
    /// No progress and no notes, errors only
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    solver: SolverArgs,
    #[command(flatten)]
    grid: VolumeArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub fn run(args: &Args) -> Result<()> {
    args.solver.choice().check()?;
    let specs = specs(args)?;
    let foreign = args.foreign.iter().map(|text| foreign(text)).collect::<Result<Vec<_>>>()?;
    let (input, memory, volume) =
        (args.capture.input(&args.solver)?, args.device.memory()?, args.grid.volume_only()?);
    let loaded = job::load(&input)?;
    if !args.quiet {
        loaded.notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    let bins = args.grid.bins()?;
    let method = |spec: &methods::Spec| {
        let usual = spec.choice.resolve(&loaded.capture).request();
        let request = Request {
            tuned: false,
            bins,
            depth_pitch: spec.depth_pitch.or(args.grid.depth_pitch),
            volume,
            memory,
            device: args.device.device.clone(),
            pipeline_cache: args.device.pipeline_cache(),
            validation: args.device.validation,
            truth: Some(args.truth.clone()),
            mask_fraction: args.mask_fraction.or(usual.mask_fraction),
            trace_every: spec.trace_every.or(Some(args.trace_every)),
            find_pulse: args.capture.find_pulse(usual.find_pulse),
            ..usual
        };
        Method { name: spec.name.clone(), spec: spec.text.clone(), request }
    };
    let mut left_out = vec![];
    let mut methods = vec![];
    for spec in &specs {
        let method = method(spec);
        match method.request.solver.takes(&loaded.capture) {
            Err(e) if spec.is_optional => left_out.push(LeftOut { name: method.name, why: e.what }),
            _ => methods.push(method),
        }
    }
    if !args.quiet {
        left_out.iter().for_each(|m| say(&format!("note: {} is left out: {}", m.name, m.why)));
    }
    let comparison = Comparison { methods, foreign, left_out, repeats: args.repeats, out: args.out.clone() };
    interrupt::take_care();
    let mut meters: Vec<Meter> = vec![];
    let mut turns = 0;
    let compared = job::compare(&comparison, &loaded, &mut |turn: &Turn<'_>, progress: &Progress| {
        if turn.number >= turns {
            meters.iter().for_each(Meter::end);
            turns = turn.number + 1;
            meters = vec![Meter::new(args.quiet)];
            if !args.quiet {
                say(&format!("{} of {}: {}", turn.number + 1, turn.turns, turn.name));
            }
        }
        meters.last_mut().map_or(std::ops::ControlFlow::Continue(()), |meter| meter.hear(progress))
    });
    meters.iter().for_each(Meter::end);
    let compared = compared?;
    compared.validation.iter().for_each(|message| say(&format!("validation: {message}")));
    print(&compared.report.table());
    let files: Vec<_> = compared.files.iter().map(|f| f.display().to_string()).collect();
    print(&format!("\nwrote     {}", files.join("\n          ")));
    Ok(())
}

/// The methods that are asked for, all of them checked.
fn specs(args: &Args) -> Result<Vec<methods::Spec>> {
    let asked: Vec<&str> = args.method.iter().map(|m| m.trim()).filter(|m| !m.is_empty()).collect();
    if asked.is_empty() && !args.method.is_empty() {
        return Err(Error::options("--method is empty", "name a solver: --method paper"));
    }
    let base = args.solver.choice();
    let all = match &base.solver {
        Some(name) => vec![name.as_str()],
        None => SolverOptions::ITERATIVE.to_vec(),
    };
    let asked = if asked.is_empty() { all } else { asked };
    let mut specs = vec![];
    for text in asked {
        if text != "all" {
            specs.push(methods::parse(text, &base)?);
            continue;
        }
        for name in every() {
            specs.push(methods::Spec { is_optional: true, ..methods::parse(name, &base)? });
        }
    }
    Ok(specs)
}

/// All methods, the default solver first: the others are compared with it.
fn every() -> impl Iterator<Item = &'static str> {
    let others = SolverOptions::NAMES.iter().copied().filter(|name| *name != SolverOptions::DEFAULT);
    std::iter::once(SolverOptions::DEFAULT).chain(others)
}

/// Reads the maps of another program: NAME=FOLDER,seconds=S,hardware=WORDS.
fn foreign(text: &str) -> Result<Foreign> {
    let wrong = |what: &str| {
        Error::options(
            format!("--foreign {text:?} {what}"),
            "write NAME=FOLDER,seconds=S,hardware=WORDS: the folder of its maps.npz, and what it took and ran on",
        )
    };
    let mut parts = text.split(',');
    let first = parts.next().and_then(|part| part.split_once('='));
    let (name, maps) = first.ok_or_else(|| wrong("names no folder"))?;
    let (mut seconds, mut hardware) = (None, None);
    for part in parts {
        match part.split_once('=').map(|(key, value)| (key.trim(), value.trim())) {
            Some(("seconds", value)) => seconds = value.parse::<f64>().ok(),
            Some(("hardware", value)) => hardware = Some(value.to_string()),
            _ => return Err(wrong(&format!("has the part {part:?}"))),
        }
    }
    Ok(Foreign {
        name: name.trim().into(),
        maps: maps.trim().into(),
        seconds: seconds.ok_or_else(|| wrong("gives no seconds"))?,
        hardware: hardware.ok_or_else(|| wrong("gives no hardware"))?,
    })
}
