//! A scene that moved once while it was scanned: if it moves all the time, points seem to be sheared, or a wall to lean. Fits of the first
//! and of the last third of the lines of a scan, each from the start, explain their own pairs far better than one surface of all does, and
//! lie apart by about how far it moved.

use glam::DVec3;

use super::constants::OF_CHANGE;
use super::correction::named;
use super::trial::From;
use super::trials::{Proposal, Trials};
use crate::Result;
use crate::maps::Maps;

/// Of these parts of the lines, the first and the last one are fitted.
const PARTS: usize = 3;
/// Lines of a part at least.
const LEAST: usize = 4;
/// They leave these shares at most of what the ends of the other lines leave, by fits that go on from the surface of all, and by those from
/// the start: where all fits of few pairs explain these better, nothing moved. And standard errors by which one of them leaves less.
const LESS: [f64; 2] = [0.9, 0.75];
const BEYOND: f64 = 4.0;
/// The laws of motions between columns, and between rows. Each end of a scan sees most of what is near it, which seems to be a motion along
/// that: these parts of it are tried.
const ALONG: [&str; 2] = ["moved along x", "moved along y"];
const PARTS_ALONG: [f64; 3] = [0.0, 0.5, 1.0];
/// Both parts begin with one start, and keep something of it: the scene moved farther, by this factor.
const FARTHER: f64 = 1.4;

/// Starting numbers of a motion of the scene between the ends of a scan; `None` unless fits of the ends suggest one.
///
/// # Errors
/// The device fails, or the caller cancels.
pub fn proposed(trials: &mut Trials<'_>) -> Result<Option<Proposal>> {
    if !ALONG.into_iter().all(|name| (named(name).applies)(&trials.scan)) {
        return Ok(None);
    }
    let layers = trials.base.surface.layers.clone();
    // Short fits rule most captures out.
    let mut last = None;
    for (from, most) in [From::Fit(&layers, OF_CHANGE), From::Start].into_iter().zip(LESS) {
        let [Some(columns), Some(rows)] = [ends(trials, 0, from)?, ends(trials, 1, from)?] else {
            return Ok(None);
        };
        let each = [columns, rows];
        let along = usize::from(rows.share < columns.share);
        if each[along].share > most * each[1 - along].share {
            return Ok(None);
        }
        last = Some((along, each[along]));
    }
    let Some((along, moved)) = last.filter(|(_, moved)| moved.errors >= BEYOND) else { return Ok(None) };
    let apart = FARTHER * moved.apart / trials.scan.frame.half;
    let starts = PARTS_ALONG.map(|part| {
        let mut start = apart.to_array();
        start[along] *= part;
        vec![start[0], start[1], start[2], 0.0]
    });
    Ok(Some(Proposal { law: named(ALONG[along]), starts: starts.to_vec(), is_far: true }))
}

/// Fits of the first and the last lines of a scan.
#[derive(Debug, Clone, Copy)]
struct EndFits {
    /// What both leave of what the surface of all leaves of their pairs.
    share: f64,
    /// Standard errors by which one of them leaves less, at most.
    errors: f64,
    /// How far the last one lies from the first one, metres.
    apart: DVec3,
}

/// `None` where one of them finds nothing, or there are too few lines along this axis.
fn ends(trials: &mut Trials<'_>, axis: usize, from: From<'_>) -> Result<Option<EndFits>> {
    let trial = trials.trial.clone();
    let capture = trial.capture();
    let count = capture.scan[axis];
    if count < LEAST * PARTS || capture.pair_count() < LEAST * PARTS * count {
        return Ok(None);
    }
    let ends = [0, PARTS - 1].map(|part| {
        let line = |pair: usize| if axis == 0 { pair / capture.scan[1] } else { pair % capture.scan[1] };
        let is_kept = |pair: &usize| line(*pair) * PARTS / count == part;
        let kept: Vec<usize> = (0..capture.pair_count()).filter(is_kept).collect();
        let mut scan = capture.scan;
        scan[axis] = kept.len() / (capture.pair_count() / count);
        trial.with_capture(capture.keep(&kept, scan))
    });
    let (mut sums, mut errors, mut centres) = ([0.0; 2], f64::NEG_INFINITY, vec![]);
    let (layers, step) = (trials.base.surface.layers.clone(), trials.base.surface.step);
    let fits = trials.fits(&ends, from, step)?;
    for (end, own) in ends.iter().zip(fits) {
        let Some((own, all)) = own.zip(end.ideal(&layers)?) else { return Ok(None) };
        let [left, before] = [own.held.left(), all.left()];
        sums = [sums[0] + left.excess(), sums[1] + before.excess()];
        errors = errors.max(left.errors_below(&before));
        centres.push(centre(&own.surface.layers));
    }
    Ok(Some(EndFits { share: sums[0] / sums[1], errors, apart: centres[1] - centres[0] }))
}

/// The centre of surfaces, weighed by their albedos, metres.
fn centre(layers: &[Maps]) -> DVec3 {
    let (mut sum, mut weights) = (DVec3::ZERO, f64::MIN_POSITIVE);
    for maps in layers {
        for pixel in (0..maps.depth.len()).filter(|pixel| maps.depth[*pixel].is_finite()) {
            let [x, y] = maps.centre(pixel / maps.ny, pixel % maps.ny);
            let weight = f64::from(maps.albedo[pixel].max(0.0));
            sum += weight * DVec3::new(x, y, f64::from(maps.depth[pixel]));
            weights += weight;
        }
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_weighs_albedos_and_leaves_out_what_has_no_surface() {
        let mut maps = Maps::empty([2, 2], [0.0, 2.0, 0.0, 2.0]);
        maps.depth = vec![1.0, f32::NAN, f32::NAN, 2.0];
        maps.albedo = vec![1.0, 9.0, 9.0, 3.0];
        let all = centre(&[maps]);
        assert!(all.distance(DVec3::new(1.25, 1.25, 1.75)) < 1e-12, "{all}");
    }
}
