//! What a file of time tags holds.

use std::path::{Path, PathBuf};

use serde::Serialize;

use thirdbounce::Result;
use thirdbounce_tags::{Division, Guess, Inputs, Survey, Tags};

/// What a file of time tags holds, and what its scan is likely to be.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Instrument {
    /// The file.
    pub path: PathBuf,
    /// What wrote the file, and its mode.
    pub instrument: String,
    /// Records, those of overflow included.
    pub records: u64,
    /// Detectors and their photons.
    pub channels: Vec<(i32, u64)>,
    /// Markers, from 1, and their numbers.
    pub markers: Vec<(u32, usize)>,
    /// Laser pulses.
    pub pulses: i64,
    /// Rate of the laser, Hz, if known.
    pub laser_hz: Option<f64>,
    /// Seconds of the measurement, if known.
    pub duration_s: Option<f64>,
    /// What was assumed, and what is odd.
    pub notes: Vec<String>,
    /// Whether the header of an image says which markers begin lines.
    pub in_lines: bool,
    /// How the file was read: channels that were not given are a guess.
    #[serde(skip)]
    pub inputs: Inputs,
    /// What the scan is likely to be.
    #[serde(skip)]
    pub guess: Guess,
}

/// Reads all of a file of time tags.
///
/// # Errors
/// Those of [`Tags::open`] and [`Survey::of`].
pub fn instrument(path: &Path, inputs: Inputs) -> Result<Instrument> {
    let inputs = inputs.guessed(path)?;
    let tags = Tags::open(path, &inputs)?;
    let survey = Survey::of(&tags)?;
    Ok(Instrument {
        path: path.into(),
        instrument: tags.instrument.clone(),
        records: survey.passed.records,
        channels: survey.channels.iter().map(|c| (c.channel, c.photons)).collect(),
        markers: survey.markers(),
        pulses: survey.pulses,
        laser_hz: survey.period.map(|period| 1.0 / period),
        duration_s: survey.period.map(|period| period * survey.pulses as f64),
        notes: survey.passed.notes.clone(),
        in_lines: Division::of_image(&tags.image).is_some(),
        guess: Guess::of(&survey, &tags),
        inputs,
    })
}
