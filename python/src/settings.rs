//! Settings as keyword arguments.

use engine::capture::{Gate, Pulse};
use engine::job::{Choice, FindPulse, GivenPulse, Input, Request, memory_bytes};
use engine::solve::option::{OptionValue, Range, Suit};
use engine::solve::{Preset, SolverOptions};
use engine::transport::Volume;
use engine::{Error, Result};
use pyo3::prelude::*;

/// The value of an option, in the order in which types are tried.
#[derive(FromPyObject)]
pub enum PythonValue {
    Flag(bool),
    Count(usize),
    Number(f64),
    Word(String),
}

/// How the instrument spreads a path.
#[derive(FromPyObject)]
pub enum PulseGiven {
    /// `none` or `auto`.
    Word(String),
    /// Full width at half maximum, metres of path.
    Width(f64),
    /// The same, and the length over which the tail falls to 1/e.
    Tailed(f64, f64),
}

/// An amount of device memory.
#[derive(FromPyObject)]
pub enum Memory {
    Bytes(u64),
    Text(String),
}

/// What `reconstruct` is asked for.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Settings {
    solver: Option<String>,
    model: Option<String>,
    preset: Option<String>,
    options: Vec<(String, PythonValue)>,
    wall: Option<f64>,
    stride: Option<usize>,
    subset: Option<usize>,
    /// Paths from, to.
    gate: Option<(Option<f64>, Option<f64>)>,
    auto_gate: bool,
    keep_empty: bool,
    pulse: Option<PulseGiven>,
    spot: Option<[f64; 2]>,
    bins: Option<String>,
    depth_pitch: Option<f64>,
    /// x, y and z, each from, to.
    volume: Option<[[f64; 2]; 3]>,
    mask_fraction: Option<f64>,
    memory: Option<Memory>,
    pub device: Option<String>,
}

impl Settings {
    /// The solver and its options.
    ///
    /// # Errors
    /// An unknown name, or a value out of range.
    pub fn choice(&self) -> Result<Choice> {
        let preset = match self.preset.as_deref() {
            None => None,
            Some("synthetic") => Some(Preset::Synthetic),
            Some("captured") => Some(Preset::Captured),
            Some(other) => {
                return Err(Error::options(
                    format!("preset is {other:?}"),
                    "give synthetic or captured, or None",
                ));
            }
        };
        let (solver, model) = (self.solver.clone(), self.model.clone());
        let mut choice = Choice { solver, model, preset, options: vec![] };
        choice.check()?;
        for (key, given) in &self.options {
            choice.options.push(option(choice.solver_name(), key, given)?);
        }
        choice.check().map(|()| choice)
    }

    /// The part of the capture that is used, and how.
    pub fn input(&self, choice: &Choice) -> Result<Input> {
        let open = |(from, to): (Option<f64>, Option<f64>)| Gate {
            from: from.unwrap_or(f64::NEG_INFINITY),
            to: to.unwrap_or(f64::INFINITY),
        };
        Ok(Input {
            wall: self.wall,
            stride: self.stride,
            subset: self.subset,
            subset_seed: choice.seed(),
            gate: self.gate.map(open),
            no_auto_gate: !self.auto_gate,
            keep_empty: self.keep_empty,
            pulse: self.pulse.as_ref().map(PulseGiven::pulse).transpose()?,
            spots: self.spot,
            preset: choice.preset,
            ..Input::default()
        })
    }

    /// What is left of the request for a capture.
    pub fn request(&self, request: Request) -> Result<Request> {
        let find_pulse = match &self.pulse {
            None => request.find_pulse,
            Some(PulseGiven::Word(word)) if word == "auto" => FindPulse::Always,
            Some(_) => FindPulse::Never,
        };
        let volume = self.volume.map(|[x, y, z]| Volume {
            min: glam::dvec3(x[0], y[0], z[0]),
            max: glam::dvec3(x[1], y[1], z[1]),
        });
        Ok(Request {
            bins: self.bins.as_deref().map_or(Ok(request.bins), str::parse)?,
            depth_pitch: self.depth_pitch,
            volume,
            memory: self.memory()?,
            device: self.device.clone(),
            mask_fraction: self.mask_fraction.or(request.mask_fraction),
            find_pulse,
            ..request
        })
    }

    /// The most device memory to use, bytes.
    pub fn memory(&self) -> Result<Option<u64>> {
        match &self.memory {
            None => Ok(None),
            Some(Memory::Bytes(bytes)) => Ok(Some(*bytes)),
            Some(Memory::Text(text)) => memory_bytes(text).map(Some),
        }
    }
}

impl PulseGiven {
    fn pulse(&self) -> Result<GivenPulse> {
        match self {
            PulseGiven::Word(word) if ["none", "auto"].contains(&word.as_str()) => Ok(GivenPulse::Sharp),
            PulseGiven::Word(word) => Err(Error::options(
                format!("pulse is {word:?}"),
                "give none, auto, a width in metres of path, or a width and the length of the tail",
            )),
            PulseGiven::Width(width) => Pulse::gaussian(*width).map(GivenPulse::Shape),
            PulseGiven::Tailed(width, tail) => {
                Pulse::gaussian(*width)?.with_tail(*tail).map(GivenPulse::Shape)
            }
        }
    }
}

/// An option by its key, if the solver has it and takes the value.
fn option(solver: &str, key: &str, given: &PythonValue) -> Result<(&'static str, OptionValue)> {
    let mut options = SolverOptions::suited_to(solver, &Suit::USUAL).ok_or_else(|| {
        let all = format!("use {}", SolverOptions::NAMES.join(" or "));
        Error::options(format!("there is no solver {solver:?}"), all)
    })?;
    if key == "deterministic" && matches!(given, PythonValue::Flag(true)) {
        return Ok(("accumulation", OptionValue::Word("repeatable".into())));
    }
    let rows = options.rows();
    let Some(row) = rows.iter().find(|row| row.key == key) else {
        return Err(Error::options(
            format!("{key} is no option of the {solver} solver"),
            "help(thirdbounce.reconstruct) and thirdbounce.options() list them",
        ));
    };
    let values = match given {
        PythonValue::Flag(on) => vec![OptionValue::Flag(*on)],
        PythonValue::Count(n) => vec![OptionValue::Count(*n), OptionValue::Number(*n as f64)],
        PythonValue::Number(v) => vec![OptionValue::Number(*v)],
        PythonValue::Word(word) => vec![OptionValue::Word(word.clone()), flag_of(row.range, word)],
    };
    let taken = options.set_first(key, values.into_iter().filter(|value| *value != OptionValue::Unset));
    let wrong =
        || Error::options(format!("{key} does not take this value"), format!("it is: {}", row.text()));
    Ok((row.key, taken.ok_or_else(wrong)?))
}

/// The value of an option that is on or off and has words for both.
fn flag_of(range: Range, word: &str) -> OptionValue {
    match range {
        Range::Words(&[off, on]) if [off, on].contains(&word) => OptionValue::Flag(word == on),
        _ => OptionValue::Unset,
    }
}

/// The options of a solver, with their texts.
#[pyfunction]
pub fn options(solver: &str) -> Vec<(&'static str, String)> {
    let usual = SolverOptions::suited_to(solver, &Suit::USUAL);
    let rows = usual.map_or(vec![], |options| options.rows());
    let texts = SolverOptions::all_rows();
    let text = |key: &str| texts.iter().find(|(row, _)| row.key == key).map(|(_, text)| text.clone());
    rows.into_iter().map(|row| (row.key, text(row.key).unwrap_or_default())).collect()
}
