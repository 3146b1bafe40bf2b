//! Captures without truth: what the closed-form methods show together takes its place.

use std::ops::ControlFlow;
use std::path::Path;

use super::super::{Request, load, reconstruct};
use crate::maps::{Maps, Truth, percentile};
use crate::settings::Settings;
use crate::{Error, Result};

/// The methods whose mean tells where there is surface.
const CLOSED_FORMS: [&str; 4] = ["lct", "fk", "phasor", "fbp"];

/// What several maps show alike, over the extent and by the pixels of the first.
struct Consensus {
    /// The first map, with the consensus as mask.
    maps: Maps,
}

impl Consensus {
    /// The mean of the albedo maps, each over its 99.5th percentile, above Otsu's threshold. `None` without maps.
    fn of(all: &[Maps]) -> Option<Consensus> {
        let mut maps = all.first()?.clone();
        let white = |m: &Maps| percentile(&m.albedo, 99.5).unwrap_or(0.0).max(f32::MIN_POSITIVE);
        let whites: Vec<f32> = all.iter().map(white).collect();
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
}

/// What the closed-form methods that take a capture, read with these settings, show together: in place of its truth.
///
/// # Errors
/// A capture that cannot be read or solved; none of the methods takes it.
pub fn agreed(file: &Path, settings: &Settings) -> Result<Truth> {
    let loaded = load(file, settings)?;
    let mut all = vec![];
    for name in CLOSED_FORMS {
        let mut settings = settings.clone();
        settings.set("solver", name)?;
        let request = Request::new(settings, "");
        if request.resolved(&loaded.capture).solver.takes(&loaded.capture).is_ok() {
            let mut on = |_: &_| ControlFlow::Continue(());
            let done = reconstruct::solve(&request, &loaded, &request.open()?, None, None, &mut on)?;
            all.push(done.result.maps);
        }
    }
    let consensus = Consensus::of(&all).ok_or_else(|| {
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
