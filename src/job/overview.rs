//! One picture of a result beside its truth.

use std::path::Path;

use crate::Result;
use crate::export::picture::{BACKGROUND, Picture, colour};
use crate::export::png;
use crate::maps::{Maps, Truth, percentile};

const GAP: usize = 16;
const DOT: usize = 2;
/// Height of a line of text above a panel.
const LINE: usize = 7 * DOT + GAP / 2;
/// Side of a panel.
const PANEL: usize = 288;
const BAR: usize = 14;

/// Writes albedo, normals, true normals, depth and true depth side by side, the depths in one scale with a
/// colour bar.
pub fn write(path: &Path, maps: &Maps, truth: &Truth) -> Result<()> {
    maps.check()?;
    truth.check()?;
    let real = as_maps(truth);
    let depths: Vec<f32> = [maps, &real].iter().flat_map(|m| shown_depths(m)).collect();
    let range = percentile(&depths, 1.0).zip(percentile(&depths, 99.0));
    let (near, far) = range.map_or((0.0, 1.0), |(a, b)| (a, b.max(a + 1e-3)));
    let depth = |maps: &Maps| {
        panel(maps, |p| if maps.mask[p] { depth_colour(maps.depth[p], near, far) } else { BACKGROUND })
    };
    let white = Maps::white(&maps.albedo);
    let albedo = panel(maps, |p| {
        let share = if white > 0.0 { maps.albedo[p] / white } else { 0.0 };
        [(255.0 * share.clamp(0.0, 1.0)).round() as u8; 3]
    });
    let normal = |maps: &Maps| panel(maps, |p| normal_colour(maps, p));
    let panels = [
        ("albedo", albedo),
        ("normal", normal(maps)),
        ("true normal", normal(&real)),
        ("depth", depth(maps)),
        ("true depth", depth(&real)),
    ];

    let labels = [format!("{far:.2} m"), format!("{near:.2} m")];
    let text = labels.iter().map(|l| l.len()).max().unwrap_or(0) * 6 * DOT;
    let width = panels.len() * (PANEL + GAP) + GAP + BAR + GAP / 2 + text + GAP;
    let mut picture = Picture::new(width, GAP + LINE + PANEL + GAP);
    let top = GAP + LINE;
    for (i, (label, panel)) in panels.iter().enumerate() {
        let x = GAP + i * (PANEL + GAP);
        picture.text_by(letter, label, x, GAP, DOT);
        picture.fill(x - 1, top - 1, PANEL + 2, PANEL + 2, [70, 70, 78]);
        picture.paste(panel, x, top);
    }
    let x = GAP + panels.len() * (PANEL + GAP);
    for y in 0..PANEL {
        picture.fill(x, top + y, BAR, 1, colour(1.0 - y as f64 / (PANEL - 1) as f64));
    }
    picture.text(&labels[0], x + BAR + GAP / 2, top, DOT);
    picture.text(&labels[1], x + BAR + GAP / 2, top + PANEL - 7 * DOT, DOT);
    png::write(path, &picture)
}

/// The maps as a square of [`PANEL`] pixels, nearest pixel, +x to the right and +y up.
fn panel(maps: &Maps, colour: impl Fn(usize) -> [u8; 3]) -> Picture {
    let mut picture = Picture::new(PANEL, PANEL);
    for row in 0..PANEL {
        for column in 0..PANEL {
            let (ix, iy) = (column * maps.nx / PANEL, (PANEL - 1 - row) * maps.ny / PANEL);
            picture.fill(column, row, 1, 1, colour(ix * maps.ny + iy));
        }
    }
    picture
}

fn depth_colour(depth: f32, near: f32, far: f32) -> [u8; 3] {
    if depth.is_finite() { colour(f64::from((depth - near) / (far - near))) } else { BACKGROUND }
}

fn normal_colour(maps: &Maps, p: usize) -> [u8; 3] {
    let [x, y, z] = maps.normal[p];
    if !maps.mask[p] || !(x + y + z).is_finite() {
        return BACKGROUND;
    }
    [x, y, -z].map(|v| (255.0 * ((v + 1.0) / 2.0).clamp(0.0, 1.0)).round() as u8)
}

fn shown_depths(maps: &Maps) -> Vec<f32> {
    let shown = maps.mask.iter().zip(&maps.depth).filter(|(m, d)| **m && d.is_finite());
    shown.map(|(_, d)| *d).collect()
}

/// Truth in the form of maps, so that both are drawn by the same hand.
fn as_maps(truth: &Truth) -> Maps {
    Maps {
        nx: truth.nx,
        ny: truth.ny,
        extent: truth.extent,
        albedo: truth.mask.iter().map(|m| f32::from(u8::from(*m))).collect(),
        depth: truth.depth.clone(),
        normal: truth.normal.clone(),
        mask: truth.mask.clone(),
        mask_fraction: Maps::MASK_FRACTION,
    }
}

/// The letters of the labels, of 5 x 7 dots, one number per row; [`Picture::text`] has figures only.
fn letter(character: char) -> [u8; 7] {
    match character {
        'a' => [0, 0, 0b01110, 0b00001, 0b01111, 0b10001, 0b01111],
        'b' => [0b10000, 0b10000, 0b10110, 0b11001, 0b10001, 0b10001, 0b11110],
        'd' => [0b00001, 0b00001, 0b01101, 0b10011, 0b10001, 0b10001, 0b01111],
        'e' => [0, 0, 0b01110, 0b10001, 0b11111, 0b10000, 0b01110],
        'h' => [0b10000, 0b10000, 0b10110, 0b11001, 0b10001, 0b10001, 0b10001],
        'l' => [0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        'm' => [0, 0, 0b11010, 0b10101, 0b10101, 0b10001, 0b10001],
        'n' => [0, 0, 0b10110, 0b11001, 0b10001, 0b10001, 0b10001],
        'o' => [0, 0, 0b01110, 0b10001, 0b10001, 0b10001, 0b01110],
        'p' => [0, 0, 0b11110, 0b10001, 0b11110, 0b10000, 0b10000],
        'r' => [0, 0, 0b10110, 0b11001, 0b10000, 0b10000, 0b10000],
        't' => [0b01000, 0b01000, 0b11100, 0b01000, 0b01000, 0b01001, 0b00110],
        'u' => [0, 0, 0b10001, 0b10001, 0b10001, 0b10011, 0b01101],
        _ => [0; 7],
    }
}
