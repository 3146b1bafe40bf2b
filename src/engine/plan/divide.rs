//! How the work is divided. No dispatch of a pass over pairs has more work than a device may get at once
//! ([`crate::gpu::Limits::work`]), or more turns than a loop may have, and no buffer more values than kernels index.

use super::domain::DomainCapacity;
use super::level::Level;
use super::levels::Levels;
use super::needs::Demand;
use super::tuning::{Accumulation, Tuning};
use crate::advice::advice;
use crate::engine::plan::Plan;
use crate::gpu::{Abilities, Accumulations};
use crate::transport::kernels::PAIR_CHUNK;
use crate::transport::{Model, cells};
use crate::{Error, Result};

/// Fewer pairs than this are no dispatch of a gather, however many voxels there are.
const LEAST_GATHERED: u32 = 64;

/// The most additions to one fp32 sum: more may lose 1e-4 of it, as equal addends round alike (docs/devices.md).
const VOXELS_PER_BIN: usize = 16_384;

/// The most values of histograms that kernels index: they count three words of noise for a bin.
const MOST_VALUES: u64 = 1 << 30;

/// How the work of a plan is divided: over invocations and over dispatches.
#[derive(Debug, Clone, PartialEq)]
pub struct WorkDivision {
    /// How rendered values are added up; never `Auto`.
    pub accumulation: Accumulation,
    /// Voxels are summed in runs before they are added to a bin: more of them go into one bin than an fp32 sum bears.
    pub runs: bool,
    /// Workgroup and chunk sizes.
    pub tuning: Tuning,
    /// Voxel-pair evaluations of a dispatch at most: see [`crate::gpu::Limits::work`].
    pub work: u64,
    /// The most workgroups of a dispatch along x.
    pub tiles: u32,
}

impl WorkDivision {
    /// All pairs at once on one device, as it adds and as large as it may.
    ///
    /// # Errors
    /// The device does not offer the accumulation, or a kernel would loop longer than drivers allow.
    pub(crate) fn of(
        model: &Model,
        levels: &Levels,
        domain: &DomainCapacity,
        demand: &Demand,
        device: &Abilities,
    ) -> Result<WorkDivision> {
        let accumulation = choose(demand.accumulation, device.accumulations)?;
        let tuning = Tuning::new(model, domain.capacity, accumulation, device)?;
        // Fixed point adds without rounding, and a window already sums in two levels.
        let crowded = |l: &Level| domain.capacity.min(l.grid.storage()) / model.bins > VOXELS_PER_BIN;
        let runs = !accumulation.is_fixed() && tuning.window == 0 && levels.volume.iter().any(crowded);
        let (work, tiles) = (device.limits.work, device.limits.groups[0]);
        Ok(WorkDivision { accumulation, runs, tuning, work, tiles })
    }
}

impl Plan {
    /// Checks that kernels can index all pairs.
    ///
    /// # Errors
    /// There are too many.
    pub(crate) fn check_pairs(&self, model: &Model) -> Result<()> {
        let (rendered, bins) = (model.rendered_wall(), model.bins);
        let pairs = model.pairs().max(rendered.pairs());
        if (pairs as u64 * bins as u64) > MOST_VALUES || cells(pairs, bins) as u64 >= 1 << 31 {
            return Err(Error::memory(
                format!("{pairs} pairs of {bins} bins are beyond 2^30 values"),
                advice!["use a larger " Stride " or a narrower " Gate],
            ));
        }
        let points = [pairs, rendered.scanned.len(), rendered.others.len()];
        if self.division.tuning.tiles(self.scene.geometry, points) > u64::from(self.division.tiles) {
            return Err(Error::memory(
                format!("{pairs} pairs are more than this device's workgroup counts reach"),
                advice!["use a larger " Stride],
            ));
        }
        Ok(())
    }

    /// Dispatches that one forward pass over all pairs takes at `level`.
    pub fn forward_sets(&self, level: &Level) -> u32 {
        let chunks = self.voxels_at(level).div_ceil(self.division.tuning.chunk as usize);
        chunks.div_ceil(self.set_chunks(level.rendered.count) as usize) as u32
    }

    /// Chunks of voxels in one dispatch of a forward pass over `pairs` pairs: one where every histogram belongs to an
    /// invocation, else as many as a dispatch may have work for.
    pub(crate) fn set_chunks(&self, pairs: usize) -> u32 {
        (self.set_cells() / u32::try_from(pairs.max(1)).unwrap_or(u32::MAX)).max(1)
    }

    /// Chunks times pairs of one dispatch, as [`Plan::set_chunks`] and `arguments.comp` divide them.
    pub(crate) fn set_cells(&self) -> u32 {
        match self.division.accumulation {
            Accumulation::Owned => 0,
            _ => {
                u32::try_from(self.division.work / u64::from(self.division.tuning.chunk)).unwrap_or(u32::MAX)
            }
        }
    }

    /// The most dispatches that a forward pass takes at any level.
    pub(crate) fn most_sets(&self) -> u32 {
        self.levels.volume.iter().map(|l| self.forward_sets(l)).max().unwrap_or(1)
    }

    /// Voxels or points that may be active at `level`.
    pub fn voxels_at(&self, level: &Level) -> usize {
        level.grid.storage().min(self.domain.capacity)
    }

    /// Pairs of one dispatch that gathers them for `voxels` voxels.
    pub fn gathered_pairs(&self, voxels: usize) -> u32 {
        // Lanes that share a voxel take every few pairs.
        let most = (self.division.work / voxels.max(1) as u64).min(u64::from(PAIR_CHUNK)) as u32;
        (most / LEAST_GATHERED * LEAST_GATHERED).max(LEAST_GATHERED)
    }
}

/// How a device adds that offers these atomics.
fn choose(wanted: Accumulation, offered: Accumulations) -> Result<Accumulation> {
    let lacks = |what: &str| {
        Err(Error::options(
            format!("this device has no {what}"),
            advice!["leave " Accumulation " out, or choose repeatable"],
        ))
    };
    match wanted {
        Accumulation::Float if !offered.float => lacks("fp32 atomics (VK_EXT_shader_atomic_float)"),
        Accumulation::Fixed if !offered.int64 => lacks("64-bit atomics (VK_KHR_shader_atomic_int64)"),
        Accumulation::Auto if offered.float => Ok(Accumulation::Float),
        Accumulation::Auto | Accumulation::Repeatable if offered.int64 => Ok(Accumulation::Fixed),
        Accumulation::Auto | Accumulation::Repeatable => Ok(Accumulation::Owned),
        other => Ok(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_adds_as_it_can() {
        use Accumulation::{Auto, Fixed, Float, Owned, Repeatable};
        let of = |wanted, [float, int64]: [bool; 2]| choose(wanted, Accumulations { float, int64 });
        let auto = [[true, true], [true, false], [false, true], [false, false]].map(|o| of(Auto, o).unwrap());
        assert_eq!(auto, [Float, Float, Fixed, Owned]);
        let repeatable = [[true, true], [true, false]].map(|o| of(Repeatable, o).unwrap());
        assert_eq!(repeatable, [Fixed, Owned]);
        let error = of(Fixed, [true, false]).unwrap_err();
        assert!(error.what.contains("no 64-bit atomics"), "{error}");
        assert!(of(Float, [false, true]).is_err() && of(Owned, [false, false]).is_ok());
    }
}
