//! Captures of *Convolutional Approximations to the General Non-Line-of-Sight Imaging Operator* (Ahn and others 2019): a struct
//! `NLOSDATA`, MATLAB v5 or v7.3.
//!
//! `transient` (d1, d2, t) if `is_confocal`, else (laser points, sensor points, t); `l` and `s` (n, 3), metres; in a confocal
//! scan d2 runs faster through them. `times` (1, t) and `delta`, metres of path. Legs are removed: direct light is at path 0.
//! `target_dist` is the distance of the wall from the origin, where the object is; the grids of their solver are not read.
//!
//! A bin of `delta` is the sum of narrower ones, and `times` names the end of the first of those, whatever `delta` is. Bins
//! therefore begin at whole multiples of `delta`: in their rendered bunny, whose mesh is known (Tsai and others 2019), the first
//! light of all pairs lies in the bin that this gives, and a quarter of a bin off otherwise.
//!
//! Axes: y of the file is kept, x is turned round, and depth is measured from the wall, at z = `target_dist`, towards the
//! origin. Their `imslice.m` draws the front view with x to the right and y up, so their frame is right-handed, too.

use glam::DVec3;

use super::frame;
use super::unread::Unread;
use super::variables::Variables;
use crate::Capture;
use crate::error::{Error, Result};

/// Bins begin at a multiple of their width that is at most so much after their time, in bins.
const ROUNDING: f64 = 1e-6;

/// Whether the file holds such a capture.
pub(super) fn is_one(file: &Variables) -> bool {
    file.have(&["NLOSDATA/transient"])
}

/// Finds a capture without reading its counts; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays or shapes that do not agree.
pub(super) fn read<'f>(file: &'f Variables, notes: &mut Vec<String>) -> Result<Unread<'f>> {
    const COUNTS: &str = "NLOSDATA/transient";
    let name = |field: &str| format!("NLOSDATA/{field}");
    let points = |field: &str| -> Result<Option<Vec<DVec3>>> {
        let Some((shape, v)) = file.numbers(&name(field))? else { return Ok(None) };
        let found = frame::points(&shape, &v).ok_or_else(|| {
            Error::input(
                format!(
                    "{field} has shape {shape:?} (MATLAB order reversed), not three coordinates of each point"
                ),
                format!("{field} is (n, 3), metres"),
            )
        });
        found.map(Some)
    };
    let laser = points("l")?.ok_or_else(|| file.missing(&name("l")))?;
    let sensor = points("s")?;
    let confocal = match file.number(&name("is_confocal"))? {
        Some(flag) => flag != 0.0,
        None => sensor.as_ref().is_none_or(|s| *s == laser),
    };
    let shape = file.counts_shape(COUNTS)?;
    let disagree = || {
        Error::input(
            format!(
                "transient has shape {shape:?} (MATLAB order reversed) for {} points l and {} points s",
                laser.len(),
                sensor.as_ref().map_or(laser.len(), Vec::len)
            ),
            "transient is (d1, d2, t) with a point for each of d1 x d2 if is_confocal, else (points l, points s, t)",
        )
    };
    let &[bins, n2, n1] = &shape[..] else { return Err(disagree()) };
    let (lasers, sensors) = match (confocal, &sensor) {
        (true, _) if laser.len() == n1 * n2 => (laser.clone(), laser.clone()),
        (false, Some(sensor)) if [laser.len(), sensor.len()] == [n1, n2] => {
            ((0..n1 * n2).map(|p| laser[p / n2]).collect(), (0..n1 * n2).map(|p| sensor[p % n2]).collect())
        }
        (false, None) => return Err(file.missing(&name("s"))),
        _ => return Err(disagree()),
    };
    let wall = match file.number(&name("target_dist"))? {
        Some(distance) => distance,
        None => lasers.first().map_or(0.0, |p| p.z),
    };
    let from_wall = |p: DVec3| DVec3::new(-p.x, p.y, wall - p.z);
    let turned = |points: Vec<DVec3>| points.into_iter().map(from_wall).collect();
    let (delta, start) = times(file, bins)?;
    notes.push(format!(
        "depth is measured from the wall, at z = {wall} m of the file, towards the origin; bins begin at {start} m of path"
    ));
    let scan = if !confocal && n1 == 1 { [n2, 1] } else { [n1, n2] };
    let outline = Capture {
        t_start: start,
        ..Capture::new(scan, turned(lasers), turned(sensors), bins, delta, vec![])
    };
    // Pair d1 * n2 + d2 is stored at d2 * n1 + d1.
    let from: Vec<usize> = (0..n1 * n2).map(|pair| pair % n2 * n1 + pair / n2).collect();
    let unread = Unread { from, ..Unread::in_order(outline, file, COUNTS) };
    Ok(if confocal { unread.in_our_order() } else { unread })
}

/// The bin width and where the first bin begins, metres of path.
fn times(file: &Variables, bins: usize) -> Result<(f64, f64)> {
    let (_, times) = file.numbers("NLOSDATA/times")?.ok_or_else(|| file.missing("NLOSDATA/times"))?;
    let delta = file.number("NLOSDATA/delta")?.ok_or_else(|| file.missing("NLOSDATA/delta"))?;
    if times.len() != bins || !(delta.is_finite() && delta > 0.0 && times[0].is_finite()) {
        return Err(Error::input(
            format!("times holds {} values for {bins} bins of {delta} m", times.len()),
            "times holds the path of each bin of transient, and delta their distance, in metres",
        ));
    }
    Ok((delta, delta * ((times[0] / delta - ROUNDING).ceil() - 1.0).max(0.0)))
}
