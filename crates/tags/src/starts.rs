//! A file that says when each point of a scan began.

use std::path::Path;

use crate::error::{Error, Result};

/// A place in a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start {
    /// The number of a laser pulse.
    Pulse(i64),
    /// Seconds since the first laser pulse.
    Seconds(f64),
}

/// Reads when each point began: a line for each, with the number of a laser pulse or a time with its unit (`1.25s`, `12ms`,
/// `7us`, `3ns`, `5ps`). After comma or space the line may tell the end, too. One more line than points ends the last one.
///
/// # Errors
/// `Kind::Input`, beginning with the path: no such file, or a line that is not one.
pub fn starts(path: &Path) -> Result<Vec<(Start, Option<Start>)>> {
    let text = std::fs::read_to_string(path).map_err(super::unreadable).map_err(|e| e.at(path.display()))?;
    let mut all = vec![];
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let parts: Vec<_> =
            line.split([',', ';', '\t', ' ']).filter(|part| !part.is_empty()).map(parse).collect();
        match parts[..] {
            [Some(from)] => all.push((from, None)),
            [Some(from), Some(to)] => all.push((from, Some(to))),
            // A line of names.
            [None, ..] if all.is_empty() && line.chars().all(|c| !c.is_ascii_digit()) => {}
            _ => {
                return Err(Error::input(
                    format!("{}: line {} is {line:?}", path.display(), number + 1),
                    "write when each point began, and if you like when it ended: numbers of laser pulses, or times such as 1.25s",
                ));
            }
        }
    }
    Ok(all)
}

fn parse(text: &str) -> Option<Start> {
    if let Ok(pulse) = text.parse() {
        return Some(Start::Pulse(pulse));
    }
    let units = [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("ps", 1e-12), ("s", 1.0)];
    let (number, unit) = units.into_iter().find_map(|(unit, size)| Some((text.strip_suffix(unit)?, size)))?;
    let number: f64 = number.trim().parse().ok()?;
    number.is_finite().then_some(Start::Seconds(number * unit))
}
