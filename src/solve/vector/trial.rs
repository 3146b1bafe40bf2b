//! Quick solves that tell which of several descriptions of a scene is right: how surfaces reflect, how wide the
//! instrument's pulse is. A surface is fitted to a few pairs. It is judged by other pairs, which it has not seen: a wrong
//! description may fit the noise of the first, but does not predict the others.

use super::{VectorOptions, model, solve_volume};
use crate::Result;
use crate::capture::{Capture, Pulse};
use crate::gpu::{BufferPlan, Gpu, Place, Schedule};
use crate::maps::Maps;
use crate::solve::drive::{Driven, Watch};
use crate::solve::passes::RESIDUAL;
use crate::solve::plan::RESIDUAL_HOST;
use crate::solve::{Level, OnDevice, Plan, surface};
use crate::transport::kernels::buffer;
use crate::transport::{Grid, Model};

/// Pairs that a trial fits; as many others judge it.
pub const PAIRS: usize = 256;

/// Standard errors beyond which a difference is no chance.
const BEYOND_CHANCE: f64 = 2.0;

/// Trials of one capture on one grid.
pub struct Trial<'g> {
    gpu: &'g Gpu,
    sides: Sides,
    grid: Grid,
    options: VectorOptions,
    memory: Option<u64>,
    /// The maps of a volume. Surfaces of all pulses begin with them.
    begun: Option<Maps>,
}

impl<'g> Trial<'g> {
    /// Prepares trials with the reflectance and the iterations of `options`. Half of the capture's pairs are fitted, and
    /// half of them judge, so there must be two at least; a few do not tell a difference from chance.
    pub fn new(
        gpu: &'g Gpu,
        capture: &Capture,
        grid: Grid,
        options: VectorOptions,
        memory: Option<u64>,
    ) -> Trial<'g> {
        let sides = Sides::of(capture, &grid, &options);
        Trial { gpu, sides, grid, options, memory, begun: None }
    }

    /// The maps that surfaces begin with, once there are any.
    pub fn begun(&self) -> Option<&Maps> {
        self.begun.as_ref()
    }

    /// Begins surfaces with these maps, not with those of a volume of its own.
    pub fn begin_with(&mut self, maps: Maps) {
        self.begun = Some(maps);
    }

    /// Fits a surface, with paths spread by `pulse`; `None` if no surface is found.
    ///
    /// # Errors
    /// Those of [`super::reconstruct`], and a pulse without taps.
    pub fn fit(&mut self, pulse: Option<&Pulse>, watch: &mut Watch<'_>) -> Result<Option<Left>> {
        for side in [&mut self.sides.seen, &mut self.sides.held] {
            side.pulse = pulse.map(|p| p.taps(side.bin_width)).transpose()?;
            side.pulse_shape = pulse.cloned();
        }
        let [plan, plan_of_held] = self.sides.plans(self.gpu, self.grid, &self.options, false)?;
        let last = *plan_of_held.pixel_levels.last().expect("a trial has a surface");
        let mut job = OnDevice::new(self.gpu, self.sides.seen.clone(), plan, self.memory)?;
        let driven = match &self.begun {
            Some(maps) => {
                // As the start of a volume does.
                let mut s = Schedule::default();
                for cleared in [buffer::COUNTS, buffer::HISTOGRAMS] {
                    s.fill(cleared, job.plan.bytes_of(cleared), 0);
                }
                job.executor.run(&s)?;
                let level = job.plan.levels.iter().rfind(|l| l.grid.n[0] == maps.nx);
                Driven::begun(maps.clone(), *level.unwrap_or(job.plan.finest()))
            }
            None => solve_volume(self.gpu, &mut job, &self.options, watch, None)?,
        };
        self.begun.get_or_insert_with(|| driven.maps.clone());
        let refined = surface::refine(self.gpu, &mut job, &self.options.surface, watch, driven)?;
        if refined.pixels == 0 {
            return Ok(None);
        }
        let s = surface::render(&plan_of_held, &last, refined.pixels, &RESIDUAL, None);
        self.sides.judge(&mut job, plan_of_held, &last, s).map(Some)
    }
}

/// The pairs of a capture in two halves.
pub(super) struct Sides {
    /// The pairs that are fitted.
    pub seen: Model,
    /// The pairs that judge.
    held: Model,
    /// Points to a side of a scan as dense as half of the pairs.
    scan: [usize; 2],
}

impl Sides {
    pub fn of(capture: &Capture, grid: &Grid, options: &VectorOptions) -> Sides {
        let whole = model(capture, grid, options);
        let [seen, held] = [0, 1].map(|side| whole.half(side));
        let scan = capture.resolution().map(|n| ((n as f64 / 2f64.sqrt()) as usize).max(1));
        Sides { seen, held, scan }
    }

    /// The plan of a fit, with room for all that judges it, and that of the pairs that judge.
    ///
    /// # Errors
    /// Those of [`Plan::new`].
    pub fn plans(
        &self,
        gpu: &Gpu,
        grid: Grid,
        options: &VectorOptions,
        with_volume: bool,
    ) -> Result<[Plan; 2]> {
        let mut plan = Plan::new(&self.seen, grid, self.scan, options, &gpu.abilities(), with_volume)?;
        let plan_of_held = plan.of_other_pairs(&self.held, options);
        plan.make_room(&plan_of_held);
        let residual = plan.bytes_of(buffer::RESIDUAL);
        plan.buffers.push(BufferPlan::new(RESIDUAL_HOST, residual, Place::Readback));
        Ok([plan, plan_of_held])
    }

    /// Puts the pairs that judge in the place of those that were fitted, renders and compares by `compared`, and tells
    /// what is left at `level` of the pairs' plan.
    ///
    /// # Errors
    /// The device fails.
    pub fn judge(
        &self,
        job: &mut OnDevice<'_>,
        plan_of_held: Plan,
        level: &Level,
        mut compared: Schedule,
    ) -> Result<Left> {
        job.summed = plan_of_held.summed().map(|level| self.held.summed(level.sum)).collect();
        (job.plan, job.model) = (plan_of_held, self.held.clone());
        job.upload()?;
        let cells = job.plan.cells_at(level);
        compared.copy(buffer::RESIDUAL, RESIDUAL_HOST, cells as u64 * 4);
        job.executor.run(&compared)?;
        let residual: Vec<f32> = job.executor.read(RESIDUAL_HOST, ..cells);
        Ok(Left::of(job.model_of(level), &residual, &level.grid))
    }
}

/// What a trial's surface leaves of the pairs that it has not seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Left {
    /// For each pair: squared differences, and squared values, summed over bins.
    pub pairs: Vec<[f64; 2]>,
}

impl Left {
    /// From the residual: the derivative of the weighted squares by what is accumulated.
    fn of(held: &Model, residual: &[f32], grid: &Grid) -> Left {
        let elements = held.elements.max(1) as f64;
        let weight: Vec<f64> = (0..held.bins).map(|b| held.bin_weight(b)).collect();
        let unit = elements / (2.0 * f64::from(held.scene(grid).render_scale));
        let of_pair = |(r, m): (&[f32], &[f32])| {
            let mut sums = [0.0; 2];
            for ((r, m), w) in r.iter().zip(m).zip(&weight).filter(|(_, w)| **w > 0.0) {
                sums[0] += (f64::from(*r) * unit / w).powi(2);
                sums[1] += f64::from(*m).powi(2);
            }
            sums
        };
        let rows = held.bins_of(residual);
        Left { pairs: rows.chunks(held.bins).zip(held.measured.chunks(held.bins)).map(of_pair).collect() }
    }

    /// The share of the squares that is left.
    pub fn share(&self) -> f64 {
        let sum = |k: usize| self.pairs.iter().map(|p| p[k]).sum::<f64>();
        sum(0) / sum(1)
    }

    /// Whether this is less than what another trial leaves of the same pairs, beyond chance: the mean difference over
    /// pairs is more than two of its standard errors.
    pub fn is_less(&self, other: &Left) -> bool {
        let differences = || self.pairs.iter().zip(&other.pairs).map(|(own, other)| other[0] - own[0]);
        let count = self.pairs.len().max(2) as f64;
        let mean = differences().sum::<f64>() / count;
        let variance = differences().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0);
        mean > BEYOND_CHANCE * (variance / count).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left of each pair, of squares of 100.
    fn left(pairs: impl IntoIterator<Item = f64>) -> Left {
        Left { pairs: pairs.into_iter().map(|p| [p, 100.0]).collect() }
    }

    #[test]
    fn the_share_is_that_of_all_squares() {
        let of = Left { pairs: vec![[1.0, 10.0], [3.0, 90.0]] };
        assert_eq!(of.share(), 0.04);
    }

    #[test]
    fn less_is_less_only_beyond_chance() {
        // Differences with mean 1 and variance 1 (n - 1 of n): 16 pairs have a standard error of about 1/4.
        let other = left([10.0; 16]);
        let by = |mean: f64| left((0..16).map(|i| 10.0 - mean + if i % 2 == 0 { 1.0 } else { -1.0 }));
        let error = (16.0f64 / 15.0 / 16.0).sqrt();
        assert!(by(2.05 * error).is_less(&other));
        assert!(!by(1.95 * error).is_less(&other), "within two standard errors");
        assert!(!by(-2.05 * error).is_less(&other), "more is not less");
        assert!(other.is_less(&by(-2.05 * error)));
        // The same from every pair is no chance; nothing is.
        assert!(left([9.9; 16]).is_less(&other) && !other.is_less(&other));
        // One pair that says otherwise: the mean is less, but hangs on it.
        let mut one = [10.0; 16];
        one[3] = 2.0;
        assert!(left(one).share() < other.share() && !left(one).is_less(&other));
    }
}
