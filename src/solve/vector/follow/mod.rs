//! Frames that follow each other: a frame begins with the volume, the domain and the surface of the frame before.
//!
//! First the last volume is rendered and compared with the new counts. If it explains far less of them than of its own, the
//! scene is another one, and the frame is solved from the beginning. Else the domain changes where the scene moved:
//!
//! - It shrinks by the usual reduction: voxels with little light are left out.
//! - It grows where something is missing. What the volume leaves of the measurement is filtered and back-projected into the
//!   first, coarsest grid, as the measurement itself is at the beginning of a solve. Every voxel above a share of the
//!   brightest value of that first back-projection becomes active, wherever it lies within reach. New voxels are dark.
//!
//! Then a few iterations follow on the finest grid with all pairs. The counts are scaled as in the frame that was solved
//! from the beginning, so that volumes, albedos and losses of all frames after it have one unit.

use std::time::Duration;

use super::hat::taps_of_hat;
use super::passes::*;
use super::schedule::{backproject, bounds, extrapolate, settle};
use super::{VectorOptions, iteration};
use crate::gpu::Schedule;
use crate::solve::Plan;
use crate::solve::domain::{self, Dark};
use crate::solve::over_pairs::{compare, forward, groups, light, over_parts, scene_of_sums, turns_of_finish};
use crate::solve::passes::{FINISH, FORWARD, objective};
use crate::solve::plan::{Level, SEEN};
use crate::transport::Model;
use crate::transport::kernels::*;
use crate::{Error, Result};

mod pace;
pub mod passes;

pub(super) use pace::{Pace, rate};
use passes::{FILTER_LEFT, JOIN};

/// How a frame follows the one before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follow {
    /// Iterations of the volume and of the surface of a frame that begins warm; `None`: a fifteenth and a third of those of
    /// a frame that begins cold, together a fifth with the look at the new counts. The surface's cost less and find more.
    pub iterations: Option<[usize; 2]>,
    /// A voxel becomes active where the back-projection of what the volume leaves is above this share of the brightest
    /// value of the back-projected measurement.
    pub grow_above: f64,
    /// A frame begins cold if the last volume loses more than this share of the light that it explained.
    pub cut_above: f64,
    /// The time that a frame may take. Iterations are planned by the measured time of one, and every frame ends with a whole
    /// picture. The first frame takes a fifth of its iterations, as nothing is measured yet.
    pub budget: Option<Duration>,
}

impl Default for Follow {
    fn default() -> Follow {
        Follow { iterations: None, grow_above: 0.1, cut_above: 0.5, budget: None }
    }
}

impl Follow {
    /// Checks the shares, and the iterations against those that there is room for.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub(super) fn check(&self, options: &VectorOptions) -> Result<()> {
        for (name, share) in [("grow_above", self.grow_above), ("cut_above", self.cut_above)] {
            if !(share.is_finite() && share > 0.0) {
                return Err(Error::options(format!("`{name}` is {share}"), "give a share above 0"));
            }
        }
        let [volume, surface] = self.wanted(options);
        if volume == 0 || volume >= options.iterations || surface > options.surface.iterations {
            return Err(Error::options(
                format!("{volume} iterations of the volume and {surface} of the surface for a warm frame"),
                "give at least one of the volume, and no more than a frame takes that begins cold",
            ));
        }
        Ok(())
    }

    /// Iterations of a warm frame of a solver with these options.
    pub(super) fn wanted(&self, options: &VectorOptions) -> [usize; 2] {
        let usual = [(options.iterations / 15).max(1), (options.surface.iterations / 3).saturating_sub(1)];
        self.iterations.unwrap_or(usual)
    }
}

/// The share of the light that it explained that the last volume loses to a new frame; no number if there was none. `left`:
/// what it leaves of this frame, `before`: what it left of its own, `empty`: what an empty volume leaves of this frame.
pub(super) fn change(left: f64, before: f64, empty: f64) -> f64 {
    match empty - before {
        explained if explained > 0.0 => (left - before) / explained,
        _ => f64::NAN,
    }
}

/// Leaves out voxels with little light, renders the rest and compares it with the new counts: the residual, and row 0 of
/// the trace.
pub fn look(s: &mut Schedule, plan: &Plan, level: &Level, options: &VectorOptions) {
    // A surface may have left sums, and its maxima.
    s.fill(buffer::HISTOGRAMS, plan.bytes_of(buffer::HISTOGRAMS), 0);
    s.set(buffer::COUNTS, COUNT_PEAK_ALBEDO, 0);
    domain::prune(s, plan, level, &GAUSSIAN_X, options.domain.keep_above, plan.domain.capacity, Dark::Goes);
    settle(s, plan, level, &SETTLE);
    extrapolate(s, plan, level, Push::default());
    over_parts(s, plan, level, |s, part| {
        forward(s, plan, level, part, &FORWARD);
        compare(s, plan, level, part, objective(plan), Push::default(), None);
    });
    s.dispatch(&FINISH, [1, 1, 1], turns_of_finish(plan)).bind(buffer::SCENE, scene_of_sums(plan, level));
}

/// Adds the voxels to the domain where something is missing, and renews the bounds. Follows [`look`] at the same level, the
/// finest. `scene` is that of this level.
pub fn grow(
    s: &mut Schedule,
    plan: &Plan,
    level: &Level,
    options: &VectorOptions,
    scene: &SceneData,
    above: f64,
) {
    project_left(s, plan, level, scene);
    domain::remember(s, plan, level);
    let parts: usize = plan.levels.volume.iter().map(|l| l.parts[0] * l.parts[0] * l.parts[1]).product();
    let first = &plan.levels.volume[0];
    domain::keep(s, plan, first, above, (plan.domain.capacity / parts).max(1), None);
    for two in plan.levels.volume.windows(2).filter(|two| two[0].grid != two[1].grid) {
        domain::double_mask(s, &two[0], &two[1]);
    }
    let words = level.grid.storage() / 32;
    s.dispatch(&JOIN, groups(words, WORKGROUP), words as u64).bind(buffer::SCENE, level.scene);
    domain::count(s, level);
    settle(s, plan, level, &SETTLE);
    // The bounds and the roughness go by the albedo again, not by the back-projection.
    domain::smooth(s, plan, level, &GAUSSIAN_X, None);
    s.set(buffer::MOMENTUM, MOMENTUM_SHARE, (options.step_share as f32).to_bits());
    let power = options.bound_power_in(plan);
    bounds(s, plan, level, (power > 0.0).then_some((&EXPECT, power)));
}

/// Back-projects what `level` leaves of the measurement into the first grid, smoothed, into the first
/// volume of [`Plan::domain`]. Its maximum is at least that of the measurement's back-projection.
fn project_left(s: &mut Schedule, plan: &Plan, level: &Level, scene: &SceneData) {
    let first = &plan.levels.volume[0];
    // The filter writes what it reads: it reads a copy. With spots, sums of rendered pairs are fewer than cells.
    let spare = if plan.has_spots() { SEEN } else { buffer::HISTOGRAMS };
    s.copy(buffer::RESIDUAL, spare, (plan.cells_at(level) * 4) as u64);
    let factor = -0.5 / (scene.loss_scale * scene.render_scale);
    // A bin here may hold several there.
    let (cells, each) = (plan.cells_at(first), first.sum.div_ceil(level.sum) + 1);
    s.dispatch(&FILTER_LEFT, groups(cells, WORKGROUP), light(cells * 2 * taps_of_hat(first) * each))
        .bind(buffer::SCENE, first.scene)
        .bind(buffer::SOURCE, spare)
        .with(Push {
            first: level.sum as u32,
            step: first.sum as u32,
            last: level.bins as u32,
            flags: factor.to_bits(),
            ..Default::default()
        });
    s.fill(buffer::HISTOGRAMS, plan.bytes_of(buffer::HISTOGRAMS), 0);
    over_parts(s, plan, first, |s, part| backproject(s, plan, first, part, false));
    domain::smooth(s, plan, first, &GAUSSIAN_X_VOLUME, Some(COUNT_PEAK_PROJECTED));
}

/// Every schedule of a warm frame's volume. The factors in them do not matter.
///
/// # Errors
/// Those of `take`.
pub(super) fn each(
    plan: &Plan,
    options: &VectorOptions,
    model: &Model,
    take: &mut dyn FnMut(&Schedule) -> Result<()>,
) -> Result<()> {
    let Some(level) = plan.levels.volume.last() else { return Ok(()) };
    let scene = model.scene_of(&level.grid, level.pairs);
    let mut all = Schedule::of(|s| look(s, plan, level, options));
    grow(&mut all, plan, level, options, &scene, Follow::default().grow_above);
    iteration(&mut all, plan, level, 0);
    take(&all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_changes_by_the_light_that_the_last_volume_explains_no_more() {
        // Noise that no volume explains is no change.
        assert_eq!(change(9.0, 9.0, 10.0), 0.0);
        assert!((change(9.4, 9.0, 10.0) - 0.4).abs() < 1e-9 && change(20.0, 1.0, 10.0) > 2.0);
        assert!(change(f64::NAN, 1.0, 10.0).is_nan());
        // Darkness: an empty volume leaves less than the last one did of its frame.
        assert!(change(2.0, 1.0, 0.5).is_nan());
    }
}
