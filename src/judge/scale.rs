//! A wall size or a bin width that is wrong by a factor. Paths of points that are too far apart, or of bins that are too narrow, meet
//! in no surface: a light-cone transform (O'Toole and others 2018) is sharp at the true scale alone.

use std::borrow::Cow;

use super::job::Job;
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::maps::Maps;

/// Factors of the distances between points that are tried, and what each may come from: feet, a half, a double.
const FACTORS: [(f64, &str); 3] = [
    (0.3048, "as of points in feet"),
    (0.5, "as of a wall given twice as wide, or of paths one way"),
    (2.0, "as of half the wall given as its size"),
];

/// Another scale is right if its image is this many times as sharp. Evidence: benches/NOTES.md, "Verdict".
const SHARPER: f64 = 2.5;

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

/// The scale at which a light-cone transform of a capture is clearly sharper than at its own; `None` if there is none, or the transform
/// does not take the capture.
pub fn rescaled(job: &Job<'_>, gpu: &Gpu) -> Option<Rescaled> {
    let own = sharpness(&image(job, gpu, 1.0).ok()?)?;
    let tried = FACTORS.into_iter().filter_map(|(factor, what)| {
        let there = sharpness(&image(job, gpu, factor).ok()?)?;
        Some(Rescaled { factor, what, sharper: there / own })
    });
    tried.filter(|scale| scale.sharper >= SHARPER).max_by(|a, b| a.sharper.total_cmp(&b.sharper))
}

/// How few pixels hold the light: mean fourth power of the albedo over the square of its mean square.
fn sharpness(maps: &Maps) -> Option<f64> {
    let [squares, fourths] = maps.albedo.iter().fold([0.0; 2], |[two, four], a| {
        let square = f64::from(a.max(0.0)).powi(2);
        [two + square, four + square * square]
    });
    (squares > 0.0).then(|| maps.albedo.len() as f64 * fourths / (squares * squares))
}

/// A light-cone transform of a capture whose points lie `factor` times as far apart. A box that is set is for points as they are.
fn image(job: &Job<'_>, gpu: &Gpu, factor: f64) -> Result<Maps> {
    let scaled = Capture::clone(&job.capture).with(|c| {
        c.laser.iter_mut().chain(&mut c.sensor).for_each(|point| *point *= factor);
    });
    let mut job = job.with_capture(Cow::Owned(scaled));
    job.settings.volume = None;
    job.closed_form(job.light_cone(PIXELS).into(), gpu)
}
