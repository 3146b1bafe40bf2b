//! A MATLAB file with a single array of counts (y, x, t), rows from the top: a confocal scan of a flat wall. The file
//! holds neither the wall size nor the bin width.
//!
//! Axes: the file does not say; [`crate::Turn`] mirrors and rotates the scan. Rows from the top and columns
//! from the left are as in the f-k migration of the ABP publication (Zhang and others) for its `tof_data`.

use super::frame::{Axes, Run};
use super::read_options::ReadOptions;
use super::unread::Unread;
use super::variables::Variables;
use crate::error::{Error, Result};

/// Rows from the top, columns from the left.
const AXES: Axes = Axes { d1: Run::Down, d2: Run::Right };

/// Finds a capture without reading its counts; see [`super::read`].
///
/// # Errors
/// `Kind::Options` without a wall size and a bin width, `Kind::Input` if there is not exactly one array of three
/// axes.
pub(super) fn read<'f>(
    file: &'f Variables,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<Unread<'f>> {
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
            format!("is in no known format: it holds {there}"),
            "known formats are y-tal, Z-NLOS, NeTF, Stanford f-k, LCT, CC-SOCR, General-NLOS, phasor-field \
             files, and a file with a single array of counts (y, x, t)",
        ));
    };
    let what = format!("a file with the single array {name}");
    let (wall, bin_width) = (given.wall(&what)?, given.bin_width(&what, None, notes)?);
    notes.push(format!(
        "{name} is read as {} bins of {} columns and {} rows from the top: confocal, t = 0 at the wall",
        shape[0], shape[1], shape[2]
    ));
    Unread::scanned(file, name, AXES, wall, bin_width)
}
