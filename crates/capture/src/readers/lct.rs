//! Captures of the light-cone transform (O'Toole, Lindell, Wetzstein 2018), MATLAB v5 or v7.3.
//!
//! `rect_data` (d1, d2, t) counts; `width` is **half** the wall in metres, the distance of the outermost points from
//! the middle. The bin width, 4 ps, is not in the published files; one that a file states is used. The file holds the direct light: their code sets the first 600
//! bins to zero, here the automatic gate leaves it out.
//!
//! Axes: d1 runs to the left and d2 down. The front view of their `cnlos_reconstruction.m` has d2 as rows from the top
//! and d1 as columns from the right. This way the letters S and U and the word EXIT are readable.

use super::frame::{Axes, WallDirection};
use super::read_options::ReadOptions;
use super::stated;
use super::unread::Unread;
use super::variables::Variables;
use crate::error::{Error, Result};

const PICOSECONDS: f64 = 4.0;
const AXES: Axes = Axes { d1: WallDirection::Left, d2: WallDirection::Down };

/// Finds a capture without reading its counts; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays or shapes that do not fit.
pub(super) fn read<'f>(
    file: &'f Variables,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<Unread<'f>> {
    let half = file.number("width")?.ok_or_else(|| file.missing("width"))?;
    if !(half.is_finite() && half > 0.0) {
        return Err(Error::input(
            format!("width is {half}"),
            "width is half the wall in metres, the distance of the outermost scan points from the middle",
        ));
    }
    notes.push(format!(
        "width is half the wall, as in its publication: the outermost points are {} m apart",
        2.0 * half
    ));
    let bin_width = stated::with_bin_width(file, given.clone(), notes).bin_width(
        "an LCT capture",
        Some(PICOSECONDS),
        notes,
    )?;
    Unread::scanned(file, "rect_data", AXES, 2.0 * half, bin_width)
}
