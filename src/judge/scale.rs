//! A wall size or a bin width that is wrong by a factor. Paths of points that are too far apart, or of bins that are too narrow, meet
//! in no surface: a light-cone transform (O'Toole and others 2018) is sharp at the true scale alone.

use std::borrow::Cow;

use super::job::Job;
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::maps::Maps;
use crate::options::SceneTraits;

/// Factors of the distances between points that are tried, and what each may come from: feet, a half, a double.
const FACTORS: [(f64, &str); 3] = [
    (0.3048, "as of points in feet"),
    (0.5, "as of a wall given twice as wide, or of paths one way"),
    (2.0, "as of half the wall given as its size"),
];

/// Another scale is right if its image is this many times as sharp. Evidence: benches/NOTES.md, "Verdict".
const SHARPER: f64 = 2.5;

/// Later or earlier records that are tried, in widths of the wall: how many each way, and the step.
const RECORDS: usize = 5;
const STEP: f64 = 0.3;

/// Pixels of the images on a side.
const PIXELS: usize = 64;

/// A scale at which a capture is sharper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rescaled {
    /// The factor of the distances between points, or of the reciprocal of the bin width.
    pub factor: f64,
    /// What it may come from.
    what: &'static str,
    /// How many times as sharp the image is.
    pub sharper: f64,
}

impl Rescaled {
    /// The scale as a sentence.
    pub fn sentence(&self) -> String {
        let Rescaled { factor, what, sharper } = self;
        format!(
            "the wall's size or the bin width is wrong by a factor: with points {factor} times as far apart, or bins {:.2} times as wide, \
             a light-cone transform is {sharper:.1} times as sharp, {what}: give the wall's size or the bin width",
            1.0 / factor
        )
    }
}

/// Sharpness of the light-cone transform of a capture; `None` if the transform does not take it.
pub fn sharpness_of(job: &Job<'_>, gpu: &Gpu) -> Option<f64> {
    sharpness(&image(job, gpu, 1.0, 0.0).ok()?)
}

/// Scale at which the light-cone transform is clearly sharper than `own`; `None` if there is none.
pub fn rescaled(job: &Job<'_>, gpu: &Gpu, own: f64) -> Option<Rescaled> {
    let images = FACTORS.map(|of| (of, image(job, gpu, of.0, 0.0)));
    let ((factor, what), sharper) = sharpest(images, own)?;
    Some(Rescaled { factor, what, sharper })
}

/// Shift of the record, metres of path, at which the light-cone transform is clearly sharper than `own`; `None` if there is none. A shift
/// resembles a scale, so a fit has to confirm it.
pub fn restarted(job: &Job<'_>, gpu: &Gpu, own: f64) -> Option<f64> {
    let step = STEP * SceneTraits::of(&job.capture).wall;
    let shifts = (1..=RECORDS).flat_map(|number| [1.0, -1.0].map(|side| side * number as f64 * step));
    sharpest(shifts.map(|later| (later, image(job, gpu, 1.0, later))), own).map(|(later, _)| later)
}

/// The change with the sharpest image, and the ratio of its sharpness to `own`, if that is at least [`SHARPER`].
fn sharpest<T>(images: impl IntoIterator<Item = (T, Result<Maps>)>, own: f64) -> Option<(T, f64)> {
    let ratios = images.into_iter().filter_map(|(of, image)| Some((of, sharpness(&image.ok()?)? / own)));
    ratios.filter(|(_, sharper)| *sharper >= SHARPER).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// How few pixels hold the light: mean fourth power of the albedo over the square of its mean square.
fn sharpness(maps: &Maps) -> Option<f64> {
    let [squares, fourths] = maps.albedo.iter().fold([0.0; 2], |[two, four], a| {
        let square = f64::from(a.max(0.0)).powi(2);
        [two + square, four + square * square]
    });
    (squares > 0.0).then(|| maps.albedo.len() as f64 * fourths / (squares * squares))
}

/// A light-cone transform of a capture whose points lie `factor` times as far apart, and whose record begins `later`. A box that is set is
/// for the capture as it is.
fn image(job: &Job<'_>, gpu: &Gpu, factor: f64, later: f64) -> Result<Maps> {
    let scaled = Capture::clone(&job.capture).with(|c| {
        c.t_start += later;
        c.laser.iter_mut().chain(&mut c.sensor).for_each(|point| *point *= factor);
    });
    let mut job = job.with_capture(Cow::Owned(scaled));
    job.settings.volume = None;
    job.closed_form(job.light_cone(PIXELS).into(), gpu)
}
