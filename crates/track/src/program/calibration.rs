//! Calibrations of `track`: by captures with known positions, as a JSON file.

use std::path::{Path, PathBuf};

use serde_json::json;
use thirdbounce::capture::Capture;
use thirdbounce::glam::DVec3;
use thirdbounce::settings::Settings;
use thirdbounce::{files::atomic, job};

use crate::Calibration;
use crate::error::{Error, Result};

/// Name of the file of a calibration.
pub const FILE: &str = "calibration.json";

/// Positions that check a calibration, at most.
const CHECKED: usize = 60;

/// A calibration with its file.
pub struct Calibrated {
    /// What was found.
    pub calibration: Calibration,
    /// Root mean square of a coordinate of its own positions as it finds them, and of always their middle, metres.
    pub errors: [f64; 2],
    /// The file that was written.
    pub file: PathBuf,
}

/// Calibrates the pairs of captures of one scan by the positions of an object, a line `x,y,z` in metres per capture; writes
/// [`FILE`] into a folder. `hear` gets the number of captures that are read.
///
/// # Errors
/// Captures and positions that cannot be read or differ in number; those of [`Calibration::of`]; a file that cannot be written.
pub fn calibrate(
    frames: &[PathBuf],
    positions: &Path,
    settings: &Settings,
    out: &Path,
    hear: &mut dyn FnMut(usize) -> Result<()>,
) -> Result<Calibrated> {
    let file = out.join(FILE);
    job::check_not_input(&file, frames.iter().map(PathBuf::as_path).chain([positions]))?;
    let at = read_positions(positions)?;
    if at.len() != frames.len() {
        return Err(Error::input(
            format!("{}: {} positions of {} captures", positions.display(), at.len(), frames.len()),
            "give a line x,y,z for each capture, in their order",
        ));
    }
    let mut captures = Vec::with_capacity(frames.len());
    for (number, path) in frames.iter().enumerate() {
        captures.push(job::load(path, settings)?.capture);
        hear(number + 1)?;
    }
    let found = Calibration::of(&captures, &at, settings.gate.is_none())?;
    let errors = errors(&found, &captures, &at)?;
    let report = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "positions": at.len(),
        "error_m": errors[0],
        "error_of_middle_m": errors[1],
        "calibration": found,
    });
    let text = serde_json::to_string_pretty(&report).map_err(|e| {
        Error::output(format!("cannot be written as JSON: {e}"), "please report this as a bug")
    })?;
    std::fs::create_dir_all(out)
        .map_err(|e| Error::output(format!("{}: {e}", out.display()), "give a folder that can be written"))?;
    atomic::write(&file, (text + "\n").as_bytes())?;
    Ok(Calibrated { calibration: found, errors, file })
}

/// Errors of some positions as the calibration finds them, and of their middle.
fn errors(found: &Calibration, captures: &[Capture], at: &[DVec3]) -> Result<[f64; 2]> {
    let middle = at.iter().sum::<DVec3>() / at.len() as f64;
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for (capture, at) in captures.iter().zip(at).step_by(at.len().div_ceil(CHECKED)) {
        let positions = found.locate(capture, None, true)?.positions;
        let off = [positions[0].at, middle].map(|place| place.distance_squared(*at));
        squares = [squares[0] + off[0], squares[1] + off[1]];
        count += 3.0;
    }
    Ok(squares.map(|sum| (sum / count).sqrt()))
}

/// Positions, a line each.
fn read_positions(path: &Path) -> Result<Vec<DVec3>> {
    let wrong =
        |what: String| Error::input(format!("{}: {what}", path.display()), "give lines x,y,z in metres");
    let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    let lines =
        text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    lines
        .map(|(at, line)| {
            let numbers: Option<Vec<f64>> = line.split(',').map(|n| n.trim().parse().ok()).collect();
            match numbers.as_deref() {
                Some(&[x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Ok(DVec3::new(x, y, z)),
                _ => Err(wrong(format!("line {} is {line:?}", at + 1))),
            }
        })
        .collect()
}

/// The calibration of a file.
///
/// # Errors
/// A file that cannot be read or is none that [`calibrate`] wrote.
pub fn read(path: &Path) -> Result<Calibration> {
    let wrong = |e: String| {
        Error::input(
            format!("{}: {e}", path.display()),
            format!("give the {FILE} that track --calibrate wrote"),
        )
    };
    let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    let mut all: serde_json::Value = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
    let found: Calibration =
        serde_json::from_value(all["calibration"].take()).map_err(|e| wrong(e.to_string()))?;
    found.is_sound().then_some(found).ok_or_else(|| wrong("its numbers make no calibration".into()))
}
