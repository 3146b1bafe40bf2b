//! Depth errors as a picture: how far off, what is missed, what is false.

use std::path::Path;

use super::drawing::{Anchor, Shape, draw};
use super::picture::{BACKGROUND, INK, Picture, SIDE, colour};
use super::{png, strokes};
use crate::error::Result;
use crate::maps::{Maps, Truth, percentile};

/// True surface that was not found.
const MISSED: [u8; 3] = [232, 48, 48];
/// Found where nothing is.
const FALSE: [u8; 3] = [110, 110, 122];
const MARGIN: usize = 14;
const BAR: usize = 20;
/// Height of a capital.
const SIZE: f64 = 12.0;

/// Writes, on the truth's grid, |depth − true depth| of the pixels that are surface in both (above `fraction` of
/// the brightest albedo, as [`crate::measure::metrics()`] has it) in colour beside a bar in millimetres, missed and
/// false pixels in colours of their own. The bar goes from 0 (purple) to the errors' 99th percentile (yellow).
///
/// # Errors
/// `Kind::Input` if sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps, truth: &Truth, fraction: f64) -> Result<()> {
    maps.check()?;
    truth.check()?;
    png::write(path, &picture(maps, truth, fraction))
}

/// What a pixel of the truth is.
#[derive(Clone, Copy)]
enum Found {
    Nothing,
    Missed,
    False,
    /// Metres off; NaN where the truth has no depth.
    Hit(f32),
}

fn picture(maps: &Maps, truth: &Truth, fraction: f64) -> Picture {
    let mask = Maps::mask_of(&maps.albedo, fraction);
    let found = |ix: usize, iy: usize| {
        let [x, y] = truth.centre(ix, iy);
        let pixel = maps.pixel_at(x, y).filter(|&p| mask[p] && maps.depth[p].is_finite());
        let at = ix * truth.ny + iy;
        match (pixel, truth.mask[at]) {
            (None, false) => Found::Nothing,
            (None, true) => Found::Missed,
            (Some(_), false) => Found::False,
            (Some(p), true) => Found::Hit((maps.depth[p] - truth.depth[at]).abs()),
        }
    };
    let errors: Vec<f32> = (0..truth.nx)
        .flat_map(|ix| (0..truth.ny).map(move |iy| (ix, iy)))
        .filter_map(|(ix, iy)| match found(ix, iy) {
            Found::Hit(error) if error.is_finite() => Some(error),
            _ => None,
        })
        .collect();
    let most = percentile(&errors, 99.0).map(f64::from).filter(|e| *e > 0.0);
    let factor = ((SIDE as f64 / truth.nx.max(truth.ny) as f64).round() as usize).max(1);
    let (width, height) = (truth.nx * factor, truth.ny * factor);
    let labels = most.map(|m| [m, 0.5 * m, 0.0].map(|m| format!("{} mm", millimetres(m))));
    let text = labels.iter().flatten().map(|l| strokes::width(l, SIZE)).fold(0.0, f64::max) as usize;
    let side = if labels.is_some() { BAR + text + 3 * MARGIN } else { 0 };
    let legend = ["missed", "false"];
    let legend_width = strokes::width(&legend.concat(), SIZE) + 120.0;
    let full = (width + side).max(legend_width as usize + 2 * MARGIN);
    let mut picture = Picture::new(full, height.max(SIDE / 4) + 3 * MARGIN);
    for ix in 0..truth.nx {
        for iy in 0..truth.ny {
            let ink = match found(ix, iy) {
                Found::Nothing => BACKGROUND,
                Found::Missed => MISSED,
                Found::False => FALSE,
                Found::Hit(error) if error.is_nan() => INK,
                Found::Hit(error) => shade(most.map_or(0.0, |m| f64::from(error) / m)),
            };
            picture.fill(ix * factor, (truth.ny - 1 - iy) * factor, factor, factor, ink);
        }
    }
    if let Some(labels) = labels {
        let (x, top, bottom) = (width + MARGIN, MARGIN, height.max(SIDE / 4) - MARGIN);
        picture.fill(x - 1, top - 1, BAR + 2, bottom - top + 2, INK);
        for y in top..bottom {
            picture.fill(x, y, BAR, 1, shade((bottom - 1 - y) as f64 / (bottom - top - 1).max(1) as f64));
        }
        let rows = [top as f64 + SIZE, 0.5 * (top + bottom) as f64 + 0.5 * SIZE, bottom as f64];
        for (label, y) in labels.iter().zip(rows) {
            write_text(&mut picture, label, [(x + BAR + MARGIN) as f64, y]);
        }
    }
    let base = picture.height as f64 - MARGIN as f64;
    let mut x = MARGIN;
    for (label, ink) in legend.iter().zip([MISSED, FALSE]) {
        picture.fill(x, base as usize - SIZE as usize, SIZE as usize + 2, SIZE as usize, ink);
        write_text(&mut picture, label, [(x + 22) as f64, base]);
        x += 22 + strokes::width(label, SIZE) as usize + 2 * MARGIN;
    }
    picture
}

fn write_text(picture: &mut Picture, text: &str, at: [f64; 2]) {
    let text = text.to_string();
    draw(picture, &Shape::Text { text, at, size: SIZE, anchor: Anchor::Start, colour: INK, bold: false });
}

/// The colour of a share of the largest error.
fn shade(share: f64) -> [u8; 3] {
    colour(1.0 - share.clamp(0.0, 1.0))
}

/// Metres as millimetres with three figures.
fn millimetres(metres: f64) -> String {
    let mm = 1000.0 * metres;
    let digits = if mm == 0.0 { 0 } else { (2.0 - mm.log10().floor()).clamp(0.0, 4.0) as usize };
    format!("{mm:.digits$}")
}
