//! Captures without truth: what the closed-form methods show together takes its place.

use std::ops::ControlFlow;
use std::path::Path;

use super::super::{Request, load, reconstruct};
use crate::maps::{Maps, Truth, percentile};
use crate::settings::Settings;
use crate::{Error, Result};

/// The methods whose mean tells where there is surface.
pub const CLOSED_FORMS: [&str; 4] = ["lct", "fk", "phasor", "fbp"];

/// Light farther than this from the consensus is beside it, in 64ths of the picture.
const NEAR: f64 = 3.0;

/// What several maps show alike, over the extent and by the pixels of the first.
#[derive(Debug, Clone)]
pub struct Consensus {
    /// The first map, with the consensus as mask.
    maps: Maps,
}

impl Consensus {
    /// The mean of the albedo maps, each over its 99.5th percentile, above Otsu's threshold. `None` without maps.
    pub fn of(all: &[&Maps]) -> Option<Consensus> {
        let mut maps = Maps::clone(all.first()?);
        let white = |m: &Maps| percentile(&m.albedo, 99.5).unwrap_or(0.0).max(f32::MIN_POSITIVE);
        let whites: Vec<f32> = all.iter().map(|m| white(m)).collect();
        maps.albedo = centres(&maps)
            .map(|[x, y]| {
                let at = |m: &Maps| m.pixel_at(x, y).map_or(0.0, |p| m.albedo[p]);
                let each = all.iter().zip(&whites).map(|(m, white)| (at(m) / white).clamp(0.0, 1.0));
                each.sum::<f32>() / all.len() as f32
            })
            .collect();
        let threshold = otsu(&maps.albedo);
        maps.mask = maps.albedo.iter().map(|a| *a > threshold).collect();
        Some(Consensus { maps })
    }

    /// The consensus as truth: its mask, and there the median depth of `all`. It has no normals.
    fn as_truth(&self, all: &[Maps]) -> Truth {
        let Maps { nx, ny, extent, mask, .. } = &self.maps;
        let depth = |[x, y]: [f64; 2]| {
            let depths: Vec<f32> = all
                .iter()
                .filter_map(|m| Some(m.depth[m.pixel_at(x, y)?]))
                .filter(|d| d.is_finite())
                .collect();
            percentile(&depths, 50.0).unwrap_or(f32::NAN)
        };
        let depth: Vec<f32> = centres(&self.maps).map(depth).collect();
        Truth {
            nx: *nx,
            ny: *ny,
            extent: *extent,
            mask: mask.iter().zip(&depth).map(|(lit, depth)| *lit && depth.is_finite()).collect(),
            normal: vec![[f32::NAN; 3]; depth.len()],
            depth,
            behind: None,
        }
    }

    /// Intersection over union of a mask with the consensus, which is dark beyond its extent.
    pub fn agreement(&self, other: &Maps) -> f64 {
        let (mut both, mut either) = (0.0, 0.0);
        for (pixel, [x, y]) in centres(&self.maps).enumerate() {
            let (here, there) = (self.maps.mask[pixel], other.pixel_at(x, y).is_some_and(|p| other.mask[p]));
            both += f64::from(u8::from(here && there));
            either += f64::from(u8::from(here || there));
        }
        let beyond =
            |(pixel, [x, y]): (usize, [f64; 2])| other.mask[pixel] && self.maps.pixel_at(x, y).is_none();
        let outside = centres(other).enumerate().filter(|at| beyond(*at)).count();
        both / (either + outside as f64 * area(other) / area(&self.maps)).max(1.0)
    }

    /// Share of a mask's albedo that is not near the consensus; 1 without any.
    pub fn beside(&self, other: &Maps) -> f64 {
        let [x0, x1, ..] = self.maps.extent;
        let near = NEAR * (x1 - x0) / 64.0;
        let bright: Vec<[f64; 2]> =
            centres(&self.maps).zip(&self.maps.mask).filter(|(_, mask)| **mask).map(|(at, _)| at).collect();
        let (mut all, mut beside) = (0.0, 0.0);
        for (pixel, [x, y]) in centres(other).enumerate().filter(|(pixel, _)| other.mask[*pixel]) {
            let light = f64::from(other.albedo[pixel]);
            all += light;
            if !bright.iter().any(|[u, v]| (u - x).hypot(v - y) <= near) {
                beside += light;
            }
        }
        if all > 0.0 { beside / all } else { 1.0 }
    }
}

/// What the closed-form methods that take a capture show together, in place of its truth.
///
/// # Errors
/// A capture that cannot be read or solved; none of the methods takes it.
pub fn agreed(file: &Path) -> Result<Truth> {
    let loaded = load(file, &Settings::default())?;
    let mut all = vec![];
    for name in CLOSED_FORMS {
        let request = Request::new(Settings::from_texts([("solver", name)])?, "");
        if request.resolved(&loaded.capture).solver.takes(&loaded.capture).is_ok() {
            let mut on = |_: &_| ControlFlow::Continue(());
            let done = reconstruct::solve(&request, &loaded, &request.open()?, None, None, &mut on)?;
            all.push(done.result.maps);
        }
    }
    let consensus = Consensus::of(&all.iter().collect::<Vec<_>>()).ok_or_else(|| {
        Error::input(
            "no closed-form method takes it, so there is nothing to agree with",
            "give its truth beside it",
        )
    })?;
    Ok(consensus.as_truth(&all))
}

/// Centres of all pixels, in the order of maps.
fn centres(maps: &Maps) -> impl Iterator<Item = [f64; 2]> + '_ {
    (0..maps.nx * maps.ny).map(|i| maps.centre(i / maps.ny, i % maps.ny))
}

/// Area of a pixel.
fn area(maps: &Maps) -> f64 {
    let [x0, x1, y0, y1] = maps.extent;
    (x1 - x0) * (y1 - y0) / (maps.nx * maps.ny) as f64
}

/// The threshold between two classes of values from 0 to 1 that are farthest apart (Otsu 1979).
fn otsu(values: &[f32]) -> f32 {
    const STEPS: usize = 256;
    let step = |i: usize| (i as f64 + 0.5) / STEPS as f64;
    let mut counts = [0.0; STEPS];
    values.iter().for_each(|v| counts[((v * STEPS as f32) as usize).min(STEPS - 1)] += 1.0);
    let total: f64 = counts.iter().sum();
    let sum: f64 = counts.iter().enumerate().map(|(i, c)| c * step(i)).sum();
    let (mut below, mut sum_below, mut best) = (0.0, 0.0, (0.0, 0));
    for (i, count) in counts.iter().enumerate() {
        below += count;
        sum_below += count * step(i);
        let above = total - below;
        let apart = below * above * (sum_below / below - (sum - sum_below) / above).powi(2);
        if apart > best.0 {
            best = (apart, i + 1);
        }
    }
    best.1 as f32 / STEPS as f32
}
