//! What a file of time tags holds.

use std::path::{Path, PathBuf};

use serde::Serialize;

use thirdbounce_command::cli::tables;

use crate::error::Result;
use crate::{Division, Guess, Inputs, Survey, Tags};

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

/// What a file of time tags holds, and the command that makes a capture of it.
pub fn about(found: &Instrument) -> String {
    let mut out = format!("tags      {}, {} records\n", found.instrument, found.records);
    let rate = found.laser_hz.map_or_else(String::new, |hz| format!(", {:.4} MHz", 1e-6 * hz));
    out += &format!("pulses    {} of the laser{rate}\n", found.pulses);
    out += &found.duration_s.map_or_else(String::new, |s| format!("duration  {}\n", tables::seconds(s)));
    found
        .channels
        .iter()
        .for_each(|(channel, photons)| out += &format!("channel   {channel}: {photons} photons\n"));
    found.markers.iter().for_each(|(marker, count)| out += &format!("marker    {marker}: {count}\n"));
    found.notes.iter().for_each(|note| out += &format!("note      {note}\n"));
    out + &format!("\na capture needs the points of the scan:\n  {}\n", command(found))
}

/// The command that makes a capture of a file, as far as its numbers say.
fn command(found: &Instrument) -> String {
    let side =
        |size: Option<usize>, unknown: &str| size.map_or_else(|| unknown.to_string(), |n| n.to_string());
    let [columns, rows] = found.guess.size;
    let mut out = format!(
        "thirdbounce histogram {} --scan {}x{} --wall SIZE",
        found.path.display(),
        side(columns, "COLUMNS"),
        side(rows, "ROWS")
    );
    out += &match found.guess.division {
        Some(Division::Pixels { marker, .. }) => format!(" --pixels {marker}"),
        Some(Division::Lines { start, stop: Some(stop), .. }) => format!(" --lines {start},{stop}"),
        Some(Division::Lines { start, .. }) => format!(" --lines {start}"),
        _ if found.in_lines => String::new(),
        _ => " --pulses-per-point N".into(),
    };
    if found.inputs.sync != 0 {
        out += &format!(" --sync-channel {}", found.inputs.sync);
    }
    if !found.inputs.markers.is_empty() {
        let all: Vec<_> = found.inputs.markers.iter().map(i32::to_string).collect();
        out += &format!(" --marker-channels {}", all.join(","));
    }
    if let Some(channel) = found.guess.channel {
        out += &format!(" --channel {channel}");
    }
    out + " --out capture.npz"
}
