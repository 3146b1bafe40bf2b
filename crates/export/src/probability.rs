//! The probability of surface as a picture.

use std::path::Path;

use super::depth_error::with_bar;
use super::png;
use crate::error::Result;
use crate::maps::Maps;

/// Writes the probability of every pixel in colour, from 0 (purple) to 1 (yellow), with a colour bar. The picture is empty where no
/// network concluded.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, bytes)
}

/// The file of [`write`].
pub(super) fn bytes(maps: &Maps) -> Result<Vec<u8>> {
    let labels = maps.probability.is_some().then(|| ["1", "0.5", "0"].map(String::from));
    png::packed(&with_bar(maps, |p| of(maps, p), labels))
}

/// The probability of a pixel.
pub(super) fn of(maps: &Maps, pixel: usize) -> Option<f64> {
    maps.probability.as_ref().map(|all| f64::from(all[pixel])).filter(|p| p.is_finite())
}
