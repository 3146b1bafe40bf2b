//! Frames that follow each other: a frame begins with the surface of the frame before.

use std::time::{Duration, Instant};

use super::SurfaceOptions;
use super::support::{self, typical_albedo};
use crate::maps::Maps;
use crate::{Error, Result};

/// Share of a budget after which fits end: reading and concluding the maps takes the rest.
const FITS: f64 = 0.9;

/// How a frame follows the one before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follow {
    /// Iterations of a frame that begins warm; `None`: a third of those at the resolution of the maps.
    pub iterations: Option<usize>,
    /// A frame begins cold if the surface of the frame before explains less of its light by more than this share.
    pub cut_above: f64,
    /// The time that a frame may take, from the beginning of its solve. Fits end early enough; the closed form and at least one
    /// block of iterations are computed in any case, so every frame ends with a whole picture.
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

/// What a frame leaves for the next.
pub(super) struct Last {
    /// The layers of its surface.
    pub layers: Vec<Maps>,
    /// Share of the light that the surface explains.
    pub explained: f64,
}

/// Pixels around a surface that grow from it, rather than from the closed form.
const NEAR: usize = 2;

/// Which pixels are near a pixel with a surface, or have one.
fn near_surface(maps: &Maps) -> Vec<bool> {
    let mut near = vec![false; maps.depth.len()];
    for pixel in (0..maps.depth.len()).filter(|pixel| maps.depth[*pixel].is_finite()) {
        let [x, y] = [pixel / maps.ny, pixel % maps.ny];
        for x in x.saturating_sub(NEAR)..(x + NEAR + 1).min(maps.nx) {
            let row = x * maps.ny;
            near[row + y.saturating_sub(NEAR)..row + (y + NEAR + 1).min(maps.ny)].fill(true);
        }
    }
    near
}

/// Layers to begin a frame with: those of the frame before, and the closed form's where these have no surface near it. New
/// pixels begin with a typical albedo.
pub(super) fn merged(last: &[Maps], closed: &[Maps]) -> Vec<Maps> {
    let mut layers = last.to_vec();
    let typical = typical_albedo(last).unwrap_or(1.0);
    let closed_typical = typical_albedo(closed).unwrap_or(1.0);
    let (first, from) = (&mut layers[0], &closed[0]);
    let factor = first.nx / from.nx;
    let fine = support::finer(from, factor);
    let near = near_surface(first);
    for (pixel, near) in near.into_iter().enumerate() {
        if !near && fine.depth[pixel].is_finite() {
            first.depth[pixel] = fine.depth[pixel];
            first.normal[pixel] = fine.normal[pixel];
            first.albedo[pixel] = fine.albedo[pixel] / closed_typical * typical;
        }
    }
    layers
}
