//! The expected depth error as a picture.

use std::path::Path;

use super::depth_difference::{millimetres, shade};
use super::picture::{BACKGROUND, INK, Picture, SIDE, enlargement};
use super::png;
use crate::error::Result;
use crate::maps::{Maps, percentile};

const MARGIN: usize = 12;

/// Writes the expected depth error of the masked pixels in colour on a logarithmic scale, from its 1st (purple) to
/// its 99th percentile (yellow), with a colour bar in millimetres. The picture is empty without expected errors.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, bytes)
}

/// The file of [`write`].
pub(super) fn bytes(maps: &Maps) -> Result<Vec<u8>> {
    png::packed(&picture(maps))
}

/// The expected depth error of a masked pixel.
pub(super) fn of(maps: &Maps, pixel: usize) -> Option<f32> {
    maps.depth_error.as_ref().map(|all| all[pixel]).filter(|error| maps.mask[pixel] && error.is_finite())
}

/// 1st and 99th percentile of the errors shown.
pub(super) fn range(maps: &Maps) -> Option<(f64, f64)> {
    let all: Vec<f32> = (0..maps.depth.len()).filter_map(|p| of(maps, p)).collect();
    let ends = percentile(&all, 1.0).zip(percentile(&all, 99.0)).filter(|(least, _)| *least > 0.0);
    ends.map(|(least, most)| (f64::from(least), f64::from(most)))
}

fn picture(maps: &Maps) -> Picture {
    let ends = range(maps);
    let share = |c: f32| match ends {
        Some((least, most)) if most > least => (f64::from(c) / least).ln() / (most / least).ln(),
        _ => 0.0,
    };
    let labels = ends
        .map(|(least, most)| [most, (least * most).sqrt(), least].map(|m| format!("{} mm", millimetres(m))));
    with_bar(maps, |p| of(maps, p).map(share), labels)
}

/// Shares of pixels in colour, with a colour bar that has these labels from one (yellow) to zero (purple).
pub(super) fn with_bar(
    maps: &Maps,
    share: impl Fn(usize) -> Option<f64>,
    labels: Option<[String; 3]>,
) -> Picture {
    let map = Picture::of_maps(maps, enlargement(maps), |p| share(p).map_or(BACKGROUND, shade));
    let map = png::with_axes(&map, maps);
    let Some(labels) = labels else { return map };
    let height = map.height.max(SIDE / 4);
    let mut picture = Picture::new(map.width + 2 * MARGIN + Picture::bar_width(&labels), height);
    picture.paste(&map, 0, 0);
    picture.colour_bar(map.width + MARGIN, [MARGIN, height - MARGIN], 0.0, &labels, INK);
    picture
}
