//! A MATLAB file with nothing but one array of counts (y, x, t), rows from the top: a confocal scan of a flat
//! wall. Neither the wall's size nor the bin width is in it.
//!
//! Axes: nobody can know; `--flip` and `--rotate` turn the scan over. Rows from the top and columns from the left are
//! as the f-k migration of the ABP publication (Zhang and others) shows its `tof_data`.

use super::frame::{self, Axes, Run};
use super::given::Given;
use super::variables::Variables;
use crate::capture::Capture;
use crate::error::{Error, Result};

/// Rows from the top, columns from the left.
const AXES: Axes = Axes { d1: Run::Down, d2: Run::Right };

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Options` without a wall size and a bin width, `Kind::Input` if there is not exactly one array of three
/// axes.
pub fn read(file: &Variables, given: &Given, notes: &mut Vec<String>) -> Result<Capture> {
    let mut found = Vec::new();
    for name in file.names() {
        if let Some(shape) =
            file.shape(&name)?.filter(|s| s.len() == 3 && s.iter().filter(|d| **d > 1).count() > 1)
        {
            found.push((name, shape));
        }
    }
    let [(name, shape)] = &found[..] else {
        let there = file.names();
        let there = if there.is_empty() { "nothing".to_string() } else { there.join(", ") };
        return Err(Error::input(
            format!("is no known format: it holds {there}"),
            "known are y-tal, Z-NLOS, NeTF, Stanford f-k, LCT, CC-SOCR, General-NLOS, phasor-field files, and a \
             file with a single array of counts (y, x, t)",
        ));
    };
    let what = format!("a file with the one array {name}");
    let (wall, bin_width) = (given.wall(&what)?, given.bin_width(&what, None, notes)?);
    notes.push(format!(
        "{name} is taken as {} bins over {} columns and {} rows from the top, laser and sensor at one point, t = 0 at the wall",
        shape[0], shape[1], shape[2]
    ));
    frame::scanned(name, file.counts(name)?, AXES, wall, bin_width)
}
