//! The hidden volume that a capture can tell of.

use glam::dvec3;

use crate::capture::Capture;
use crate::transport::Volume;
use crate::{Error, Result};

/// The wall's lateral extent, and the depths from which a confocal pair's path falls into the gated bins, up
/// to the last bin in which anything was measured; not nearer than `min_depth`. Metres.
///
/// Errors: no such depth.
pub fn default_volume(capture: &Capture, min_depth: f64) -> Result<Volume> {
    let [x0, x1, y0, y1] = capture.wall_extent();
    let last = (0..capture.histograms.len())
        .filter(|i| capture.histograms[*i] > 0.0)
        .map(|i| i % capture.bins)
        .max();
    let t_last = capture.t_start + (last.unwrap_or(0) + 1) as f64 * capture.bin_width;
    // A voxel over a far corner of the wall still reaches the first bin.
    let diagonal = (x1 - x0).hypot(y1 - y0);
    let nearest = (0.25 * capture.t_start.max(0.0).powi(2) - diagonal.powi(2)).max(0.0).sqrt();
    let low = nearest.max(min_depth);
    let high = 0.5 * t_last;
    if high <= low {
        return Err(Error::options(
            format!(
                "the last signal is at a path of {t_last:.3} m, a depth of {high:.3} m, and nothing nearer than {low:.3} m is reconstructed"
            ),
            "give a smaller --min-depth, or check the capture's bin width and time zero (`thirdbounce info`)",
        ));
    }
    Ok(Volume { min: dvec3(x0, y0, low), max: dvec3(x1, y1, high) })
}
