//! How many blobs there are, where, and with which error.

use glam::{DMat3, DVec3};

use crate::blob::{Blob, BlobShape, NUMBERS};
use crate::constants::{CENTRE_ERROR, ITERATIONS, KNOWN, MOST_BLOBS, STARTS};
use crate::error::{Error, Result};
use crate::fit::{Expected, FittedBlobs, fit};
use crate::information::Blobs;
use crate::sight::Sight;
use crate::start::starts;
use crate::symmetric::{axes, block};
use crate::unmeasured::spread;

/// What is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LocateOptions {
    /// Blobs, 1 to 3; `None`: as many as the counts prove and as do not overlap.
    pub blobs: Option<usize>,
    /// What is known of their shape.
    pub shape: BlobShape,
    /// Lowest and highest corner of the box that holds them, metres; `None`: in front of the scanned part of the wall and half its side
    /// around, as deep as the paths reach; of upright objects as far around as the paths reach, and half as high.
    pub volume: Option<[DVec3; 2]>,
}

/// The position of a blob.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Position {
    /// Its centre, metres.
    pub at: DVec3,
    /// Covariance, squared metres: that of the counts, of what is not known of its shape, and of what a blob does not describe.
    pub covariance: DMat3,
    /// Covariance by the counts alone.
    pub counted: DMat3,
    /// Distance from the middle of the wall points, metres, and its standard deviation.
    pub distance: [f64; 2],
    /// Counts that a pair at a distance of one unit of length gets, and the standard deviation of its logarithm.
    pub light: [f64; 2],
    /// Radius, metres, and the standard deviation of its logarithm.
    pub extent: [f64; 2],
    /// Drop of χ² by this blob, beside the others, as a share of that by all.
    pub share: f64,
    /// The direction that the pairs do not measure, if there is one: what is said along it is the box.
    pub unmeasured: Option<DVec3>,
}

impl Position {
    /// Standard deviations of x, y and z, metres.
    pub fn deviations(&self) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|k| self.covariance.col(k)[k].max(0.0).sqrt()))
    }
}

/// What was found in a capture.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Finding {
    /// Positions, that with the most light first; none if the counts prove none.
    pub positions: Vec<Position>,
    /// Counts of a bin without light.
    pub background: f64,
    /// Squared residuals over those to expect; at least 1.
    pub excess: f64,
    /// Drop of χ² by the first, the second, ... blob that was tried, over the excess.
    pub drops: Vec<f64>,
    /// The least drop that proves a blob.
    pub needed: f64,
    /// The box.
    pub volume: [DVec3; 2],
}

/// Numbers of a blob that the counts determine: position, light, extent.
const PROVED: f64 = 5.0;
/// A further blob explains at least this share of what the first one did: less is light that a blob does not describe.
const FAINT: f64 = 0.05;
/// A position is not measured along a direction where its standard deviation is more than this share of that of the box, or of the
/// distance: a hemisphere has 0.58.
const UNMEASURED: f64 = 0.4;
/// Iterations of each start.
const SHORT: usize = 8;
/// Least depth of the box, in units of length.
const LEAST_DEPTH: f64 = 0.05;

/// Finds one to three blobs. `before`: places where they were in the frame before, which are starts, too.
///
/// # Errors
/// A box that is empty or that no path reaches; no pairs; a number of blobs out of range.
pub fn locate(sight: &Sight, options: &LocateOptions, before: &[DVec3]) -> Result<Finding> {
    if options.blobs.is_some_and(|n| !(1..=MOST_BLOBS).contains(&n)) {
        return Err(Error::options("the number of blobs is out of range", "give 1, 2 or 3"));
    }
    let upright = (options.shape == BlobShape::Upright).then(|| sight.upright());
    let sight = upright.as_ref().unwrap_or(sight);
    let volume = options.volume.unwrap_or_else(|| volume_of(sight));
    check(sight, volume)?;
    let known = |blobs: usize| Expected::within(volume, blobs, options.shape, sight.unit);
    let dark = Blobs { blobs: vec![], background: sight.background };
    let mut best = fit(sight, dark, &known(0), ITERATIONS);
    let needed = needed(sight.pairs(), sight.bins);
    let mut drops = vec![];
    for blobs in 1..=options.blobs.unwrap_or(MOST_BLOBS) {
        let known = known(blobs);
        let Some(next) = with_another(sight, &best, &known, volume, before) else { break };
        let drop = (best.objective - next.objective) / next.excess();
        drops.push(drop);
        if options.blobs.is_none()
            && (drop < needed.max(FAINT * drops[0]) || !are_apart(sight, &next.guess.blobs))
        {
            break;
        }
        best = next;
    }
    let blobs = best.guess.blobs.len();
    let known = known(blobs);
    let mut positions = (0..blobs)
        .map(|which| position(sight, &best, which, &known, volume))
        .collect::<Option<Vec<_>>>()
        .ok_or_else(|| Error::input("the counts determine no position", "measure longer, or more points"))?;
    shares(sight, &best, &known, &mut positions);
    positions.sort_by(|a, b| b.light[0].total_cmp(&a.light[0]));
    Ok(Finding { positions, background: best.guess.background, excess: best.excess(), drops, needed, volume })
}

/// The least drop of χ² that proves a blob.
pub(crate) fn needed(pairs: usize, bins: usize) -> f64 {
    PROVED * ((pairs * bins) as f64).ln()
}

/// The direction along which a position is not measured, in a box of this size at this distance.
pub(crate) fn unmeasured(covariance: DMat3, size: DVec3, distance: f64) -> Option<DVec3> {
    let (variance, axis) = axes(covariance)[0];
    let of_box = size / 12f64.sqrt();
    let is_measured = variance.sqrt() < UNMEASURED * (axis * of_box).length().min(distance);
    (!is_measured).then_some(axis)
}

/// The box without options.
fn volume_of(sight: &Sight) -> [DVec3; 2] {
    let [x0, x1, y0, y1] = sight.wall;
    let deep = (0.5 * sight.end()).max(2.0 * LEAST_DEPTH * sight.unit);
    // Upright objects are beside the surface, not in front of it.
    let (around, deep) =
        if sight.parts > 1 { (deep, 0.5 * deep) } else { (0.5 * (x1 - x0).max(y1 - y0), deep) };
    [
        DVec3::new(x0 - around, y0 - around, LEAST_DEPTH * sight.unit),
        DVec3::new(x1 + around, y1 + around, deep),
    ]
}

fn check(sight: &Sight, [low, high]: [DVec3; 2]) -> Result<()> {
    let size = high - low;
    if !(low.is_finite() && size.is_finite() && size.min_element() > 0.0 && low.z >= 0.0) {
        return Err(Error::options(
            format!("the box of the positions is empty or behind the wall: from {low} to {high} m"),
            "give three ranges of metres, each from small to large, z above 0",
        ));
    }
    let nearest = |point: &DVec3| point.clamp(low, high).distance(*point);
    let paths = sight.laser.iter().zip(&sight.sensor).map(|(l, s)| nearest(l) + nearest(s));
    let shortest = paths.fold(f64::INFINITY, f64::min);
    if shortest >= sight.end() {
        return Err(Error::options(
            format!(
                "paths end at {:.3} m, before the box of the positions: the shortest to it is {shortest:.3} m",
                sight.end()
            ),
            "give a nearer box, or leave it out",
        ));
    }
    Ok(())
}

/// The best fit with one more blob.
fn with_another(
    sight: &Sight,
    best: &FittedBlobs,
    known: &Expected,
    volume: [DVec3; 2],
    before: &[DVec3],
) -> Option<FittedBlobs> {
    let mut tried = starts(sight, &best.guess, volume);
    if let Some(first) = tried.first().copied() {
        tried.extend(before.iter().map(|at| Blob { at: *at, ..first }));
    }
    let short = tried.into_iter().take(STARTS + before.len()).map(|blob| {
        let mut guess = best.guess.clone();
        guess.blobs.push(Blob { roundness: known.roundness[0], ..blob });
        fit(sight, guess, known, SHORT)
    });
    let found = short.min_by(|a, b| a.objective.total_cmp(&b.objective))?;
    let found = fit(sight, found.guess, known, ITERATIONS);
    found.objective.is_finite().then_some(found)
}

/// Whether each two blobs are resolved by a pair: paths that differ by less than their radii are the profile of one object.
fn are_apart(sight: &Sight, blobs: &[Blob]) -> bool {
    let path =
        |pair: usize, blob: &Blob| blob.at.distance(sight.laser[pair]) + blob.at.distance(sight.sensor[pair]);
    let apart = |a: &Blob, b: &Blob| {
        let radius = a.extent.max(b.extent).exp();
        (0..sight.pairs()).any(|pair| (path(pair, a) - path(pair, b)).abs() > 2.0 * radius)
    };
    blobs.iter().enumerate().all(|(i, a)| blobs[..i].iter().all(|b| apart(a, b)))
}

/// A blob of a fit with its errors.
fn position(
    sight: &Sight,
    fitted: &FittedBlobs,
    which: usize,
    known: &Expected,
    volume: [DVec3; 2],
) -> Option<Position> {
    let (first, blob) = (NUMBERS * which, fitted.guess.blobs[which]);
    let all = fitted.covariance()?;
    let linear = block(&all, first);
    let (at, covariance) = spread(sight, fitted, which, linear, known, volume).unwrap_or((blob.at, linear));
    let way = blob.at - sight.middle();
    let off = (CENTRE_ERROR * (2.0 * blob.extent).exp() / way.length().max(1e-6 * sight.unit)).powi(2);
    let (linear, covariance) = (linear + DMat3::IDENTITY * off, covariance + DMat3::IDENTITY * off);
    let toward = way.normalize_or(DVec3::Z);
    // Shape and what a blob does not describe are the same in the next frame.
    let shape =
        Expected { extent: [blob.extent, KNOWN], roundness: [blob.roundness, KNOWN], ..known.clone() };
    let counted = FittedBlobs::at(sight, fitted.guess.clone(), &shape, false).covariance()?;
    Some(Position {
        at,
        covariance,
        counted: block(&counted, first),
        distance: [way.length(), toward.dot(linear * toward).max(0.0).sqrt()],
        light: [blob.light.exp(), all[first + 3][first + 3].sqrt()],
        extent: [blob.extent.exp(), all[first + 4][first + 4].sqrt()],
        share: 1.0,
        unmeasured: unmeasured(covariance, volume[1] - volume[0], way.length()),
    })
}

/// Sets the shares of several blobs.
fn shares(sight: &Sight, best: &FittedBlobs, known: &Expected, positions: &mut [Position]) {
    if positions.len() < 2 {
        return;
    }
    let fewer = Expected { places: known.places[1..].to_vec(), ..known.clone() };
    let without = |which: usize| {
        let mut guess = best.guess.clone();
        guess.blobs.remove(which);
        (FittedBlobs::at(sight, guess, &fewer, true).objective - best.objective).max(0.0)
    };
    let drops: Vec<f64> = (0..positions.len()).map(without).collect();
    let all = drops.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    positions.iter_mut().zip(drops).for_each(|(position, drop)| position.share = drop / all);
}
