//! Frames that follow each other: a frame begins with the surface of the frame before.

use std::time::{Duration, Instant};

use super::options::SurfaceOptions;
use super::support::typical_albedo;
use crate::maps::Maps;
use crate::surface::support;
use crate::{Error, Result};

/// Share of a budget after which fits end: reading and concluding the maps takes the rest.
const FITS: f64 = 0.9;

/// How a frame follows the one before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follow {
    /// Iterations of a frame that begins warm and does not change; `None`: a third of those at the resolution of the maps.
    pub iterations: Option<usize>,
    /// A frame begins cold if the surface of the frame before explains less of its light by more than this share.
    pub cut_above: f64,
    /// The time that a frame may take, from the beginning of its solve. Fits end early enough; the closed form, if the frame
    /// changes, and at least one block of iterations are computed in any case, so every frame ends with a whole picture.
    pub budget: Option<Duration>,
}

impl Default for Follow {
    fn default() -> Follow {
        Follow { iterations: None, cut_above: 0.5, budget: None }
    }
}

impl Follow {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub(super) fn check(&self, options: &SurfaceOptions) -> Result<()> {
        if !(self.cut_above.is_finite() && self.cut_above > 0.0) {
            return Err(Error::options(format!("`cut_above` is {}", self.cut_above), "give a share above 0"));
        }
        let wanted = self.wanted(options);
        if wanted == 0 || wanted > options.iterations {
            return Err(Error::options(
                format!("{wanted} iterations of a frame that begins warm"),
                format!("give 1 to {}, the iterations of the solver", options.iterations),
            ));
        }
        Ok(())
    }

    /// When fits end, for a frame that begins at `begun`.
    pub(super) fn fits_until(&self, begun: Instant) -> Option<Instant> {
        self.budget.map(|budget| begun + budget.mul_f64(FITS))
    }

    /// Iterations of a frame that begins warm.
    pub(super) fn wanted(&self, options: &SurfaceOptions) -> usize {
        self.iterations.unwrap_or((options.iterations / 3).max(1))
    }
}

/// Rounds of a frame that changes, at most, and iterations of each.
pub(super) const ROUNDS: [usize; 2] = [3, 8];

/// A frame changes if the surface of the frame before leaves this many times as much of its light as it left of its own, or explains
/// less than this share of what it explained there. Noise alone makes up to 1.3, and .96.
const CHANGED: [f64; 2] = [1.4, 0.93];

/// The share that a surface leaves rises by at most this factor from frame to frame, as far as it is a reference for later ones. So
/// a frame is followed by others that have rounds until the surface fits as well as before, or some time has passed.
const RISES: f64 = 1.15;

/// What a frame leaves for the next.
pub(super) struct PreviousFrame {
    /// The layers of its surface.
    pub layers: Vec<Maps>,
    /// Share of the light that the surface leaves.
    pub left: f64,
    /// The layers of the closed form, if their support is that of the surface.
    pub closed: Option<Vec<Maps>>,
    /// The fits ended before their time.
    pub is_whole: bool,
}

/// How a frame differs from the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FrameChange {
    /// By its noise.
    None,
    /// Objects move, appear or vanish.
    Some,
    /// It shows another scene.
    Cut,
}

impl Follow {
    /// How a frame differs from the one before, whose surface leaves the share `left` of its light.
    pub(super) fn change(&self, last: &PreviousFrame, left: f64) -> FrameChange {
        let [more, less] = CHANGED;
        let explained = (1.0 - left) / (1.0 - last.left).max(f64::MIN_POSITIVE);
        if explained <= 1.0 - self.cut_above {
            FrameChange::Cut
        } else if !last.is_whole || left > more * last.left || explained < less {
            FrameChange::Some
        } else {
            FrameChange::None
        }
    }
}

/// Iterations after the rounds of a frame that changes: fewer where no coarse pixels are needed, as rounds take all of these.
pub(super) fn after_rounds(wanted: usize, is_fine: bool) -> usize {
    if is_fine { wanted } else { (2 * wanted / 3).max(1) }
}

/// The reference for the next frame, of a surface that leaves the share `left`, after the reference `before`.
pub(super) fn reference(left: f64, before: f64) -> f64 {
    left.min(RISES * before)
}

/// Pixels around a surface that grow from it, rather than from the closed form.
const NEAR: isize = 2;

/// Albedo of pixels that are not certain, as a share of what they would have.
const UNCERTAIN: f32 = 0.5;

/// Which pixels are near a pixel with a surface, or have one.
fn near_surface(maps: &Maps) -> Vec<bool> {
    let mut near = vec![false; maps.depth.len()];
    for pixel in (0..maps.depth.len()).filter(|pixel| maps.depth[*pixel].is_finite()) {
        near[pixel] = true;
        support::around(maps, pixel, NEAR).for_each(|(other, _)| near[other] = true);
    }
    near
}

/// Layers with all albedos multiplied by `scale`.
pub(super) fn scaled(mut layers: Vec<Maps>, scale: f64) -> Vec<Maps> {
    layers.iter_mut().flat_map(|maps| &mut maps.albedo).for_each(|albedo| *albedo *= scale as f32);
    layers
}

/// Adds what the closed form shows where the layers have no surface near it, with its relative albedo, and dims pixels near which the
/// closed form shows nothing.
pub(super) fn merge(layers: &mut [Maps], closed: &[Maps]) {
    let fine = support::finer(&closed[0], layers[0].nx / closed[0].nx);
    let seen = near_surface(&fine);
    for maps in &mut *layers {
        maps.albedo.iter_mut().zip(&seen).filter(|(_, seen)| !**seen).for_each(|(a, _)| *a *= UNCERTAIN);
    }
    let near = near_surface(&layers[0]);
    add(layers, closed, &fine, |pixel| !near[pixel]);
}

/// Gives layers the support of the closed form, and the first of them its albedos.
pub(super) fn restrict(layers: &mut [Maps], closed: &[Maps]) {
    let factor = layers[0].nx / closed[0].nx;
    let fine: Vec<Maps> = closed.iter().map(|maps| support::finer(maps, factor)).collect();
    let is_lit = |all: &[Maps], pixel: usize| all.iter().any(|maps| maps.depth[pixel].is_finite());
    let was_dark: Vec<bool> = (0..fine[0].depth.len()).map(|pixel| !is_lit(layers, pixel)).collect();
    for pixel in (0..was_dark.len()).filter(|pixel| !is_lit(&fine, *pixel)) {
        layers.iter_mut().for_each(|maps| support::remove(maps, pixel));
    }
    let scale = add(layers, closed, &fine[0], |pixel| was_dark[pixel]);
    let both = layers[0].albedo.iter_mut().zip(&fine[0].albedo).zip(&fine[0].depth);
    both.filter(|(_, z)| z.is_finite()).for_each(|((own, closed), _)| *own = closed * scale);
}

/// Gives the first layer the pixels of `fine`, the closed form at its resolution, that `wanted` names. Returns the scale of albedos.
fn add(layers: &mut [Maps], closed: &[Maps], fine: &Maps, wanted: impl Fn(usize) -> bool) -> f32 {
    let scale = typical_albedo(layers).unwrap_or(1.0) / typical_albedo(closed).unwrap_or(1.0);
    let first = &mut layers[0];
    for pixel in (0..fine.depth.len()).filter(|pixel| fine.depth[*pixel].is_finite() && wanted(*pixel)) {
        first.depth[pixel] = fine.depth[pixel];
        first.normal[pixel] = fine.normal[pixel];
        first.albedo[pixel] = fine.albedo[pixel] * scale;
    }
    scale
}
