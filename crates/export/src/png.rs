//! Maps as PNG pictures, as seen from the wall: +x to the left, +y up. Enlarged by an integer factor to about 512
//! pixels, dark without surface.

use std::path::Path;

use super::axis::{Axis, plain};
use super::picture::{
    BACKGROUND, CAPITAL, INK, Picture, SIDE, colour, enlargement, normal_colour, text_width,
};
use crate::capture::scan::decimals;
use crate::error::{Error, Result};
use crate::files::atomic;
use crate::maps::{Maps, percentile};

/// Writes the albedo in grey, linear, white at its 99.9th percentile, with axes in metres.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write_albedo(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, albedo_bytes)
}

/// The file of [`write_albedo`].
pub(super) fn albedo_bytes(maps: &Maps) -> Result<Vec<u8>> {
    packed(&with_axes(&albedo_of(maps), maps))
}

/// The picture of [`write_albedo`] without axes.
pub fn albedo_of(maps: &Maps) -> Picture {
    let white = Maps::white(&maps.albedo);
    Picture::of_maps(maps, enlargement(maps), |p| {
        let albedo = maps.albedo[p];
        if albedo.is_nan() || white <= 0.0 {
            return BACKGROUND;
        }
        [(255.0 * (albedo / white).clamp(0.0, 1.0)).round() as u8; 3]
    })
}

/// Writes the depth of the masked pixels in colour (near is yellow, far is purple) with axes and a colour bar in metres
/// between the 1st and 99th percentile.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write_depth(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, depth_bytes)
}

/// The file of [`write_depth`].
pub(super) fn depth_bytes(maps: &Maps) -> Result<Vec<u8>> {
    let range = shown_range(maps);
    let map = with_axes(&depth_map(maps, range.unwrap_or_default()), maps);
    packed(&with_bar(&map, range))
}

/// Writes albedo and depth side by side, each as in its own picture.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write_preview(path: &Path, maps: &Maps) -> Result<()> {
    maps.check()?;
    write(path, &preview_of(maps))
}

/// The bytes of the picture that [`write_preview`] writes.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the maps are too large for a picture.
pub fn preview(maps: &Maps) -> Result<Vec<u8>> {
    maps.check()?;
    packed(&preview_of(maps))
}

fn preview_of(maps: &Maps) -> Picture {
    const BETWEEN: usize = 8;
    let (albedo, depth) = (albedo_of(maps), depth_of(maps));
    let mut both = Picture::new(albedo.width + BETWEEN + depth.width, albedo.height.max(depth.height));
    both.paste(&albedo, 0, 0);
    both.paste(&depth, albedo.width + BETWEEN, 0);
    both
}

/// The picture of [`write_depth`] without axes.
pub fn depth_of(maps: &Maps) -> Picture {
    let range = shown_range(maps);
    with_bar(&depth_map(maps, range.unwrap_or_default()), range)
}

/// 1st and 99th percentile of the depths shown; `None` without any.
pub(super) fn shown_range(maps: &Maps) -> Option<[f64; 2]> {
    let depths: Vec<f32> = (0..maps.depth.len()).filter(|&p| shows(maps, p)).map(|p| maps.depth[p]).collect();
    let range = percentile(&depths, 1.0).zip(percentile(&depths, 99.0));
    range.map(|(near, far)| [f64::from(near), f64::from(far)])
}

/// The depth with axes in metres, its colours and colour bar from `near` to `far` in metres whatever the maps hold: pictures of
/// several frames are comparable.
pub fn depth_between(maps: &Maps, [near, far]: [f64; 2]) -> Picture {
    with_bar(&with_axes(&depth_map(maps, [near, far]), maps), Some([near, far]))
}

/// Whether a pixel has a depth to show.
pub(super) fn shows(maps: &Maps, pixel: usize) -> bool {
    maps.mask[pixel] && maps.depth[pixel].is_finite()
}

fn depth_map(maps: &Maps, [near, far]: [f64; 2]) -> Picture {
    let share = |depth: f64| if far > near { (depth - near) / (far - near) } else { 0.0 };
    Picture::of_maps(maps, enlargement(maps), |p| {
        if shows(maps, p) { colour(share(f64::from(maps.depth[p]))) } else { BACKGROUND }
    })
}

/// A picture of maps with ticks in metres below it and to its left: x grows to the left, y upwards.
pub fn with_axes(map: &Picture, maps: &Maps) -> Picture {
    const TICK: usize = 5;
    const GAP: usize = 6;
    let [x0, x1, y0, y1] = maps.extent;
    let ticks = |low: f64, high: f64| Axis::new([low, high].into_iter(), false).over([low, high]).even();
    let up: Vec<(f64, String)> = ticks(y0, y1).into_iter().map(|y| (y, plain(y))).collect();
    let left = up.iter().map(|(_, label)| text_width(label)).max().unwrap_or(0) + TICK + 2 * GAP;
    let top = CAPITAL / 2 + 1;
    let below = TICK + CAPITAL + 2 * GAP;
    let mut picture = Picture::new(left + map.width + GAP, top + map.height + below);
    picture.fill(left - 1, top - 1, map.width + 2, map.height + 2, INK);
    picture.paste(map, left, top);
    for (y, label) in up {
        let row = top + ((y1 - y) / (y1 - y0) * (map.height - 1) as f64).round() as usize;
        picture.fill(left - TICK, row, TICK, 1, INK);
        picture.text(&label, [left - TICK - GAP - text_width(&label), row + CAPITAL / 2]);
    }
    let bottom = top + map.height;
    for x in ticks(x0, x1) {
        let column = left + ((x1 - x) / (x1 - x0) * (map.width - 1) as f64).round() as usize;
        let label = if x == 0.0 { "0 m".into() } else { plain(x) };
        picture.fill(column, bottom, 1, TICK, INK);
        let begin = column.saturating_sub(text_width(&label) / 2);
        let begin = begin.min((picture.width).saturating_sub(text_width(&label)));
        picture.text(&label, [begin, bottom + TICK + GAP + CAPITAL]);
    }
    picture
}

/// Writes the normals of the masked pixels in the colours of [`normal_colour`], with axes in metres.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write_normal(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, normal_bytes)
}

/// The file of [`write_normal`].
pub(super) fn normal_bytes(maps: &Maps) -> Result<Vec<u8>> {
    packed(&with_axes(&normal_of(maps), maps))
}

/// The picture of [`write_normal`] without axes.
pub fn normal_of(maps: &Maps) -> Picture {
    Picture::of_maps(maps, enlargement(maps), |p| {
        normal_colour(maps.normal[p]).filter(|_| maps.mask[p]).unwrap_or(BACKGROUND)
    })
}

/// The picture with a colour bar to its right: far at the top, near at the bottom.
fn with_bar(map: &Picture, range: Option<[f64; 2]>) -> Picture {
    const MARGIN: usize = 12;
    let Some([near, far]) = range else { return map.clone() };
    let labels = [far, near].map(|depth| format!("{depth:.*} m", decimals(3, far)));
    let height = map.height.max(SIDE / 4);
    let mut picture = Picture::new(map.width + 2 * MARGIN + Picture::bar_width(&labels), height);
    picture.paste(map, 0, 0);
    picture.colour_bar(map.width + MARGIN, [MARGIN, height - MARGIN], 1.0, &labels, INK);
    picture
}

/// Writes a picture as an 8-bit RGB PNG.
///
/// # Errors
/// `Kind::Output` if it cannot be written.
pub fn write(path: &Path, picture: &Picture) -> Result<()> {
    atomic::write(path, &packed(picture).map_err(|e| e.at(path.display()))?)
}

/// A picture as the bytes of an 8-bit RGB PNG.
///
/// # Errors
/// `Kind::Output` if it cannot be encoded.
pub fn packed(picture: &Picture) -> Result<Vec<u8>> {
    let failed =
        |e: png::EncodingError| Error::output(format!("cannot be packed as PNG: {e}"), "use smaller maps");
    let mut bytes = Vec::new();
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let mut encoder = png::Encoder::new(&mut bytes, size(picture.width), size(picture.height));
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&picture.rgb).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}
