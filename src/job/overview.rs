//! One picture of a result beside its truth.

use std::path::Path;

use crate::Result;
use crate::capture::scan::decimals;
use crate::export::picture::{BACKGROUND, CAPITAL, INK, Picture, colour};
use crate::export::png;
use crate::maps::{Maps, Truth, percentile};

const GAP: usize = 16;
/// Height of a line of text above a panel.
const LINE: usize = 20;
/// Side of a panel.
const PANEL: usize = 288;

/// Writes albedo, normals, true normals, depth and true depth side by side. Both depths share one scale and a colour
/// bar.
pub fn write(path: &Path, maps: &Maps, truth: &Truth) -> Result<()> {
    maps.check()?;
    truth.check()?;
    let real = as_maps(truth);
    let depths: Vec<f32> = [maps, &real].iter().flat_map(|m| shown_depths(m)).collect();
    let range = percentile(&depths, 1.0).zip(percentile(&depths, 99.0));
    let (near, far) = range.map_or((0.0, 1.0), |(a, b)| (a, b.max(1.001 * a)));
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

    let labels = [far, near].map(|depth| format!("{depth:.*} m", decimals(2, far.into())));
    let bar = GAP + panels.len() * (PANEL + GAP);
    let mut picture = Picture::new(bar + Picture::bar_width(&labels) + GAP, GAP + LINE + PANEL + GAP);
    let top = GAP + LINE;
    for (i, (label, panel)) in panels.iter().enumerate() {
        let x = GAP + i * (PANEL + GAP);
        picture.text(label, [x, GAP + CAPITAL]);
        picture.fill(x - 1, top - 1, PANEL + 2, PANEL + 2, [70, 70, 78]);
        picture.paste(panel, x, top);
    }
    picture.colour_bar(bar, [top, top + PANEL], 1.0, &labels, INK);
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

/// Truth in the form of maps, so that the same code draws both.
fn as_maps(truth: &Truth) -> Maps {
    Maps {
        nx: truth.nx,
        ny: truth.ny,
        extent: truth.extent,
        albedo: truth.mask.iter().map(|m| f32::from(u8::from(*m))).collect(),
        depth: truth.depth.clone(),
        normal: truth.normal.clone(),
        mask: truth.mask.clone(),
        mask_fraction: None,
        confidence: None,
        behind: None,
    }
}
