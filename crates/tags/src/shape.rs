//! The shape of a wall from its own returns.
//!
//! A point's direct light takes the path laser, wall, sensor. Where both stand is known, and the direction in which the scanner
//! points is that of the point that was given. So the length of the path says how far away the wall is in that direction. A delay of
//! cables and electronics is in all lengths alike: it is chosen so that half of the points come nearer and half go farther, and the
//! mean distance of the wall stays that of the points that were given.

use glam::DVec3;

use super::Scan;
use crate::capture::median::median;
use crate::error::{Error, Result};

/// Points of a wall as their own returns say.
#[derive(Debug)]
pub(super) struct MeasuredWall {
    /// In the order of the scan; those without a return stay as they are given.
    pub points: Vec<DVec3>,
    /// How far points have moved away from laser and sensor: the least and the most, and the root of the mean square; metres.
    pub moved: [f64; 3],
}

/// The shape of a confocal scan's wall. `path` is the length of each point's direct light after any delay, metres, NaN where it is not
/// known; `[laser, sensor]` are where these stand.
///
/// # Errors
/// `Kind::Options` if laser or sensor stand in the wall or behind it, or a return comes from behind them.
pub(super) fn of(scan: &Scan, [laser, sensor]: [DVec3; 2], path: &[f64]) -> Result<MeasuredWall> {
    let wrong = |what: String| {
        Err(Error::options(
            what,
            "give the places of laser and sensor in the coordinates of the scan, metres",
        ))
    };
    let given = |p: &DVec3| p.distance(laser) + p.distance(sensor);
    if let Some(point) = scan.laser.iter().position(|p| p.distance(laser).min(p.distance(sensor)) < 1e-3) {
        return wrong(format!("laser or sensor stand at point {point} of the wall"));
    }
    let depth = scan.laser.iter().map(|p| p.z).sum::<f64>() / scan.points() as f64;
    if laser.z.min(sensor.z) <= depth {
        return Err(Error::options(
            format!(
                "laser or sensor stand behind the wall: at z = {}, the wall at z = {depth:.3}",
                laser.z.min(sensor.z)
            ),
            "give places in front of the wall, with a larger z, as the hidden scene is",
        ));
    }
    let offsets: Vec<f64> =
        scan.laser.iter().zip(path).filter(|(_, d)| d.is_finite()).map(|(p, d)| d - given(p)).collect();
    let Some(delay) = median(offsets.iter().copied()) else { return wrong("no point has a return".into()) };
    let apart = laser - sensor;
    let mut points = scan.laser.clone();
    let (mut least, mut most, mut squares) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
    for (at, (point, path)) in points.iter_mut().zip(path).enumerate().filter(|(_, (_, d))| d.is_finite()) {
        // s along the beam: s + |laser + s u - sensor| = length.
        let (length, u) = (path - delay, (*point - laser).normalize());
        let s = (length * length - apart.length_squared()) / (2.0 * (length + u.dot(apart)));
        if !(s.is_finite() && s > 0.0 && length > apart.length()) {
            return wrong(format!("the return of point {at} comes from behind laser or sensor"));
        }
        let moved = s - point.distance(laser);
        (least, most, squares) = (least.min(moved), most.max(moved), squares + moved * moved);
        *point = laser + u * s;
    }
    Ok(MeasuredWall { points, moved: [least, most, (squares / offsets.len() as f64).sqrt()] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn a_bumped_wall_comes_out_of_its_paths() {
        let scan = Scan::grid([9, 7], 1.0, false).unwrap();
        let [laser, sensor] = [dvec3(0.3, -0.2, 1.4), dvec3(0.1, -0.1, 1.5)];
        // Along the beam of each point: a bump over a corner of the wall. Most points stay, so that the delay is exact.
        let bump = |p: DVec3| if p.x > 0.1 && p.y > 0.0 { 0.1 * (p.x - 0.1) * p.y } else { 0.0 };
        let wanted: Vec<DVec3> =
            scan.laser.iter().map(|p| *p + (*p - laser).normalize() * bump(*p)).collect();
        let mut path: Vec<f64> =
            wanted.iter().map(|p| p.distance(laser) + p.distance(sensor) + 12.34).collect();
        path[5] = f64::NAN;
        let shape = of(&scan, [laser, sensor], &path).unwrap();
        for (found, wanted) in shape.points.iter().zip(&wanted) {
            assert!(found.distance(*wanted) < 1e-12, "{found} {wanted}");
        }
        let [least, most, rms] = shape.moved;
        assert!(least.abs() < 1e-12 && (most - 0.1 * 0.4 * 0.375).abs() < 1e-12 && rms > 1e-3);
        assert!(of(&scan, [scan.laser[3], sensor], &path).unwrap_err().what.contains("point 3"));
        assert!(of(&scan, [laser, -sensor], &path).unwrap_err().what.contains("behind the wall"));
        path[9] -= 20.0;
        assert!(of(&scan, [laser, sensor], &path).unwrap_err().what.contains("point 9"));
        assert!(of(&scan, [laser, sensor], &[f64::NAN; 63]).unwrap_err().what.contains("no point"));
    }
}
