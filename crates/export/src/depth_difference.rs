//! Depth errors as a picture, with missed and false pixels.

use std::path::Path;

use super::picture::{BACKGROUND, CAPITAL, INK, Picture, SIDE, colour, text_width};
use super::png;
use crate::error::Result;
use crate::maps::{Maps, Truth, percentile};

/// True surface absent from the result.
const MISSED: [u8; 3] = [232, 48, 48];
/// Surface of the result absent from the truth.
const FALSE: [u8; 3] = [110, 110, 122];
const MARGIN: usize = 14;
/// Size of a legend square with its gap.
const SQUARE: usize = 22;

/// Writes the picture on the truth's grid, +x to the left and +y up. Pixels that are surface in both show |depth −
/// true depth| in colour. A pixel of the maps is surface above `fraction` of the brightest albedo, as in
/// [`crate::measure::metrics()`]. Missed and false pixels have distinct colours. A colour bar in millimetres ranges
/// from 0 (purple) to the errors' 99th percentile (yellow).
///
/// # Errors
/// `Kind::Input` if sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps, truth: &Truth) -> Result<()> {
    maps.check()?;
    truth.check()?;
    png::write(path, &picture(maps, truth))
}

/// The state of a pixel of the truth.
#[derive(Clone, Copy)]
enum PixelState {
    Nothing,
    Missed,
    False,
    /// Depth error in metres; NaN where the truth has no depth.
    Hit(f32),
}

pub(super) fn picture(maps: &Maps, truth: &Truth) -> Picture {
    let found = |ix: usize, iy: usize| {
        let [x, y] = truth.centre(ix, iy);
        let pixel = maps.pixel_at(x, y).filter(|&p| maps.mask[p] && maps.depth[p].is_finite());
        let at = ix * truth.ny + iy;
        match (pixel, truth.mask[at]) {
            (None, false) => PixelState::Nothing,
            (None, true) => PixelState::Missed,
            (Some(_), false) => PixelState::False,
            (Some(p), true) => PixelState::Hit((maps.depth[p] - truth.depth[at]).abs()),
        }
    };
    let errors: Vec<f32> = (0..truth.nx)
        .flat_map(|ix| (0..truth.ny).map(move |iy| (ix, iy)))
        .filter_map(|(ix, iy)| match found(ix, iy) {
            PixelState::Hit(error) if error.is_finite() => Some(error),
            _ => None,
        })
        .collect();
    let most = percentile(&errors, 99.0).map(f64::from).filter(|e| *e > 0.0);
    let factor = ((SIDE as f64 / truth.nx.max(truth.ny) as f64).round() as usize).max(1);
    let (width, height) = (truth.nx * factor, (truth.ny * factor).max(SIDE / 4));
    let labels = most.map(|m| [m, 0.5 * m, 0.0].map(|m| format!("{} mm", millimetres(m))));
    let beside = labels.as_ref().map_or(0, |labels| Picture::bar_width(labels) + 2 * MARGIN);
    let legend = [("missed", MISSED), ("false", FALSE)];
    let below: usize = legend.iter().map(|l| SQUARE + text_width(l.0) + 2 * MARGIN).sum();
    let mut picture = Picture::new((width + beside).max(below), height + 3 * MARGIN);
    for ix in 0..truth.nx {
        for iy in 0..truth.ny {
            let ink = match found(ix, iy) {
                PixelState::Nothing => BACKGROUND,
                PixelState::Missed => MISSED,
                PixelState::False => FALSE,
                PixelState::Hit(error) if error.is_nan() => INK,
                PixelState::Hit(error) => shade(most.map_or(0.0, |m| f64::from(error) / m)),
            };
            let [column, row] = [truth.nx - 1 - ix, truth.ny - 1 - iy];
            picture.fill(column * factor, row * factor, factor, factor, ink);
        }
    }
    if let Some(labels) = labels {
        picture.colour_bar(width + MARGIN, [MARGIN, height - MARGIN], 0.0, &labels, INK);
    }
    let (mut x, base) = (MARGIN, picture.height - MARGIN);
    for (label, ink) in legend {
        picture.fill(x, base - CAPITAL, CAPITAL + 2, CAPITAL, ink);
        picture.text(label, [x + SQUARE, base]);
        x += SQUARE + text_width(label) + 2 * MARGIN;
    }
    picture
}

/// Colour of a share of the largest error.
pub(super) fn shade(share: f64) -> [u8; 3] {
    colour(1.0 - share.clamp(0.0, 1.0))
}

/// Metres as millimetres with three digits.
pub(super) fn millimetres(metres: f64) -> String {
    let mm = 1000.0 * metres;
    let digits = if mm == 0.0 { 0 } else { (2.0 - mm.log10().floor()).clamp(0.0, 4.0) as usize };
    format!("{mm:.digits$}")
}
