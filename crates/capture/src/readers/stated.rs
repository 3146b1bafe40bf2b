//! Wall size and bin width that a file states beside its counts, under the names that programs give them.

use super::read_options::ReadOptions;
use super::variables::Variables;
use crate::METRES_PER_PICOSECOND;

/// Names of a bin width.
const BIN_WIDTHS: [&str; 8] =
    ["bin_resolution", "bin_width", "binWidth", "time_resolution", "timeRes", "dt", "delta_t", "deltaT"];
/// Names of the wall's size in metres.
const WALLS: [&str; 3] = ["wall_size", "wallSize", "wall_width"];
/// Names of a length that is the wall in some programs and half of it in others.
const UNCLEAR: [&str; 2] = ["width", "aperture"];
/// Bin widths from 0.01 ps to 100 ns can only be seconds: as metres of path they were below the wavelength or beyond a room.
const SECONDS: std::ops::Range<f64> = 1e-14..1e-7;
/// Sizes of walls, metres.
const METRES: std::ops::Range<f64> = 0.01..1e4;

/// The options with the wall's size that the file states, if the user gives none; a note says what is taken.
pub(super) fn with_wall(file: &Variables, given: ReadOptions, notes: &mut Vec<String>) -> ReadOptions {
    let Some((name, value)) = first_of(file, &WALLS, METRES).filter(|_| given.wall.is_none()) else {
        return given;
    };
    notes.push(format!(
        "{name} {value} is taken as the wall's size in metres (a given wall size goes before it)"
    ));
    given.with_wall(value)
}

/// The options with the bin width that the file states in seconds, if the user gives none; a note says what is taken.
pub(super) fn with_bin_width(file: &Variables, given: ReadOptions, notes: &mut Vec<String>) -> ReadOptions {
    let Some((name, value)) = first_of(file, &BIN_WIDTHS, SECONDS).filter(|_| given.bin_width.is_none())
    else {
        return given;
    };
    let ps = 1e12 * value;
    notes.push(format!(
        "{name} {value:e} is taken as seconds: bins of {ps:.2} ps (a given bin width goes before it)"
    ));
    given.with_bin_width(ps * METRES_PER_PICOSECOND)
}

/// Numbers of the file that may be a bin width or a wall size, for an error that asks for these; empty without any.
pub(super) fn quoted(file: &Variables) -> String {
    let names = BIN_WIDTHS.iter().chain(&WALLS).chain(&UNCLEAR);
    let all: Vec<_> = names.filter_map(|n| Some(format!("{n} = {}", number(file, n)?))).collect();
    if all.is_empty() { String::new() } else { format!(" (beside it: {})", all.join(", ")) }
}

fn first_of(
    file: &Variables,
    names: &[&'static str],
    range: std::ops::Range<f64>,
) -> Option<(&'static str, f64)> {
    names.iter().find_map(|name| Some((*name, number(file, name).filter(|v| range.contains(v))?)))
}

/// A single number; `None` where the array is missing, damaged or longer.
fn number(file: &Variables, name: &str) -> Option<f64> {
    file.number(name).ok().flatten()
}
