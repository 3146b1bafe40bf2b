//! The hidden volume that a capture can show.

use glam::{DVec3, dvec3};

use crate::advice::advice;
use crate::capture::Capture;
use crate::capture::scan::decimals;
use crate::transport::Volume;
use crate::{Error, Result};

/// A wall that faces a direction of a smaller z has no depths along z.
const SIDEWAYS: f64 = 0.3;

/// Width of a pixel of maps with `lateral` pixels side by side, metres; of pixels that are not square, the shorter side.
/// `volume` is the box if it is not the default one, which is as wide as the wall. Counts do not matter.
pub fn pixel_of(capture: &Capture, volume: Option<Volume>, lateral: usize) -> f64 {
    let [x0, x1, y0, y1] = match volume {
        Some(Volume { min, max }) => [min.x, max.x, min.y, max.y],
        None => capture.wall_extent(),
    };
    (x1 - x0).min(y1 - y0) / lateral as f64
}

/// The default volume, metres: the lateral extent of the wall's scanned part (see [`Capture::wall_extent`]), and the
/// depths whose light can reach the gated bins. For any pairs and any wall.
///
/// The far end is the deepest point of any pair's longest path. A hidden point of path t lies on the ellipsoid with
/// laser and sensor point as foci, and t is the end of the last bin in which that pair has signal: the last bin of all if
/// the capture has no counts. In a confocal scan
/// of a flat wall that is half the longest path. At the near end no path is too short for the gate. It is at least
/// `min_depth` in front of the wall's frontmost point: nothing between the bumps of a curved wall, or behind it, is
/// reconstructed.
///
/// # Errors
/// `Kind::Options` if no depth is left between the two. `Kind::Input` if the wall faces along x or y, or away from +z.
pub fn default_volume(capture: &Capture, min_depth: f64) -> Result<Volume> {
    if let Some(facing) = capture.facing().filter(|facing| facing.z < SIDEWAYS) {
        return Err(Error::input(
            format!("the wall faces ({:.2}, {:.2}, {:.2})", facing.x, facing.y, facing.z),
            "give points and normals in coordinates in which it lies near z = 0 and faces +z",
        ));
    }
    let [x0, x1, y0, y1] = capture.wall_extent();
    let points = || capture.laser.iter().chain(&capture.sensor);
    let front = points().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    // No voxel at depth z has a path below t if every wall point is nearer to the farthest corner.
    let corners = [dvec3(x0, y0, 0.0), dvec3(x0, y1, 0.0), dvec3(x1, y0, 0.0), dvec3(x1, y1, 0.0)];
    let aside = points().flat_map(|p| corners.map(|c| (p.x - c.x).hypot(p.y - c.y))).fold(0.0, f64::max);
    let back = points().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let nearest = back + (0.25 * capture.t_start.max(0.0).powi(2) - aside.powi(2)).max(0.0).sqrt();
    let low = nearest.max(front + min_depth);
    let (high, t_last) = deepest(capture);
    if high <= low {
        let d = decimals(3, capture.unit());
        return Err(Error::options(
            format!(
                "the last signal is at a path of {t_last:.d$} m, a depth of {high:.d$} m, and nothing nearer than {low:.d$} m is reconstructed"
            ),
            advice!["check the capture's bin width, time zero and unit of length (" [Capture] "), or give the box as " Volume],
        ));
    }
    Ok(Volume { min: dvec3(x0, y0, low), max: dvec3(x1, y1, high) })
}

/// The largest z that any pair's last signal can come from, and the longest path with signal.
fn deepest(capture: &Capture) -> (f64, f64) {
    let mut longest = capture.t_start + capture.bin_width;
    let mut deepest = f64::NEG_INFINITY;
    let lasts = match capture.histograms.is_empty() {
        true => vec![capture.bins.checked_sub(1); capture.pair_count()],
        false => capture.of_rows(|counts| counts.iter().rposition(|v| *v > 0.0)),
    };
    for (pair, last) in lasts.into_iter().enumerate() {
        let Some(last) = last else { continue };
        let t = capture.t_start + (last + 1) as f64 * capture.bin_width;
        longest = longest.max(t);
        deepest = deepest.max(ellipsoid_top(capture.laser[pair], capture.sensor[pair], t));
    }
    // Without any signal the error names the first bin.
    (if deepest.is_finite() { deepest } else { 0.5 * longest }, longest)
}

/// The largest z of the points x with |x - a| + |x - b| = t; -∞ if t is shorter than |a - b|.
fn ellipsoid_top(a: DVec3, b: DVec3, t: f64) -> f64 {
    let between = b - a;
    let d2 = between.length_squared();
    if t * t < d2 {
        return f64::NEG_INFINITY;
    }
    // Half axes t/2 along the line of the foci and sqrt(t² - d²)/2 across; the line's own z adds to both.
    let across = 0.25 * (t * t - d2);
    0.5 * (a.z + b.z) + (across + 0.25 * between.z * between.z).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_of_an_ellipsoid() {
        let a = dvec3(0.1, 0.2, 0.0);
        assert!((ellipsoid_top(a, a, 2.0) - 1.0).abs() < 1e-12);
        // Foci 0.6 m apart on the wall, path 1 m: half axes 0.5 and 0.4 m.
        assert!((ellipsoid_top(dvec3(-0.3, 0.0, 0.0), dvec3(0.3, 0.0, 0.0), 1.0) - 0.4).abs() < 1e-12);
        // Foci above each other: the long half axis is z's.
        assert!((ellipsoid_top(dvec3(0.0, 0.0, 0.1), dvec3(0.0, 0.0, 0.5), 1.0) - 0.8).abs() < 1e-12);
        assert_eq!(ellipsoid_top(DVec3::ZERO, DVec3::X, 0.9), f64::NEG_INFINITY);
        // A tilted pair against a search along the surface.
        let (a, b, t) = (dvec3(0.2, -0.1, 0.05), dvec3(-0.3, 0.4, 0.3), 1.1);
        let centre = 0.5 * (a + b);
        let mut best = f64::NEG_INFINITY;
        for i in 0..400 {
            for j in 0..400 {
                let (u, v) = ((i as f64 / 400.0) * std::f64::consts::TAU, j as f64 / 400.0 * 1.6);
                let direction = dvec3(v.sin() * u.cos(), v.sin() * u.sin(), v.cos());
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..40 {
                    let middle = 0.5 * (low + high);
                    let x = centre + direction * middle;
                    if x.distance(a) + x.distance(b) < t { low = middle } else { high = middle }
                }
                best = best.max((centre + direction * low).z);
            }
        }
        assert!((ellipsoid_top(a, b, t) - best).abs() < 1e-4, "{best}");
    }
}
