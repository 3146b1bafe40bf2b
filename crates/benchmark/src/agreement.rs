//! Captures without truth: what the closed-form methods show together takes its place.

use std::ops::ControlFlow;
use std::path::Path;

use thirdbounce::job::{Request, load, reconstruct};
use thirdbounce::maps::{Maps, Truth, percentile};
use thirdbounce::settings::Settings;
use thirdbounce::{Error, Result};

/// The methods whose mean tells where there is surface.
const CLOSED_FORMS: [&str; 4] = ["lct", "fk", "phasor", "fbp"];

/// What several maps show alike, over the extent and by the pixels of the first: the mean of the albedo maps, each over its 99.5th
/// percentile, above Otsu's threshold, and there their median depth. It has no normals. `None` without maps.
fn consensus(all: &[Maps]) -> Option<Truth> {
    let first = all.first()?;
    let white = |m: &Maps| percentile(&m.albedo, 99.5).unwrap_or(0.0).max(f32::MIN_POSITIVE);
    let whites: Vec<f32> = all.iter().map(white).collect();
    let albedo = |[x, y]: [f64; 2]| {
        let at = |m: &Maps| m.pixel_at(x, y).map_or(0.0, |p| m.albedo[p]);
        let each = all.iter().zip(&whites).map(|(m, white)| (at(m) / white).clamp(0.0, 1.0));
        each.sum::<f32>() / all.len() as f32
    };
    let depth = |[x, y]: [f64; 2]| {
        let depths = all.iter().filter_map(|m| Some(m.depth[m.pixel_at(x, y)?]));
        percentile(&depths.filter(|d| d.is_finite()).collect::<Vec<f32>>(), 50.0).unwrap_or(f32::NAN)
    };
    let albedo: Vec<f32> = centres(first).map(albedo).collect();
    let depth: Vec<f32> = centres(first).map(depth).collect();
    let threshold = otsu(&albedo);
    Some(Truth {
        nx: first.nx,
        ny: first.ny,
        extent: first.extent,
        mask: albedo.iter().zip(&depth).map(|(a, depth)| *a > threshold && depth.is_finite()).collect(),
        normal: vec![[f32::NAN; 3]; depth.len()],
        depth,
        albedo: None,
        behind: None,
    })
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
        let job = request.job(&loaded.capture);
        if job.solver.takes(&loaded.capture).is_ok() {
            let mut on = |_: &_| ControlFlow::Continue(());
            let done = reconstruct::solve(&request, (job, &loaded), &request.open()?, None, None, &mut on)?;
            all.push(done.result.maps);
        }
    }
    consensus(&all).ok_or_else(|| {
        Error::input(
            "no closed-form method takes it, so there is nothing to agree with",
            "give its truth beside it",
        )
    })
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
