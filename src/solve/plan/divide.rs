//! How the work is divided. No dispatch of a pass over pairs has more work than a device may get at once
//! ([`crate::gpu::Limits::work`]), or more turns than a loop may have, and no buffer more values than kernels index.

use super::{Accumulation, Demand, DomainCapacity, Level, Levels, Plan, Tuning};
use crate::advice::advice;
use crate::gpu::{Abilities, Accumulations, DeviceKind};
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
    /// The device does not offer the accumulation, or does not take the sizes.
    pub(super) fn of(
        model: &Model,
        levels: &Levels,
        domain: &DomainCapacity,
        demand: &Demand,
        device: &Abilities,
    ) -> Result<WorkDivision> {
        let accumulation = choose(demand.accumulation, device.kind, device.accumulations)?;
        let scanned = match levels.batches.first() {
            Some(batch) => batch.rendered.scanned,
            None => model.rendered_wall().scanned.len(),
        };
        let mut tuning = Tuning::new(model, [domain.capacity, scanned], accumulation, device, &demand.sizes)?;
        let texels = if tuning.texels && !demand.general { device.limits.texels } else { 0 };
        tuning.texels = texels_at_most(model, texels_of(levels, domain)) <= texels;
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
    pub(super) fn check_pairs(&self, model: &Model) -> Result<()> {
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
    pub(in crate::solve) fn set_chunks(&self, pairs: usize) -> u32 {
        (self.set_cells() / u32::try_from(pairs.max(1)).unwrap_or(u32::MAX)).max(1)
    }

    /// Chunks times pairs of one dispatch, as [`Plan::set_chunks`] and `arguments.comp` divide them.
    pub(super) fn set_cells(&self) -> u32 {
        match self.division.accumulation {
            Accumulation::Owned => 0,
            _ => {
                u32::try_from(self.division.work / u64::from(self.division.tuning.chunk)).unwrap_or(u32::MAX)
            }
        }
    }

    /// The most dispatches that a forward pass takes at any level.
    pub(super) fn most_sets(&self) -> u32 {
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

/// Texels of what a solver keeps by voxels or pixels: the slopes of a pixel have four, and it has a point at least.
pub(super) fn texels_of(levels: &Levels, domain: &DomainCapacity) -> usize {
    domain.touched_capacity * if levels.pixels.is_some() { 4 } else { 1 }
}

/// The most texels that a buffer has as kernels see it; `own` of them are the solver's.
fn texels_at_most(model: &Model, own: usize) -> u64 {
    let wall = model.rendered_wall();
    let points = wall.scanned.len() + wall.others.len();
    let normals = wall.normals.as_ref().map_or(0, Vec::len);
    // Half as many again: levels with a part of the pairs may render for more points than all have.
    let rendered = if model.rendered.is_some() { cells(wall.pairs(), model.bins) / 2 * 3 } else { 0 };
    model.cells().max(rendered).max(own).max(points + normals) as u64
}

fn choose(wanted: Accumulation, kind: DeviceKind, offered: Accumulations) -> Result<Accumulation> {
    Ok(match wanted {
        // A task owns a histogram there.
        _ if kind == DeviceKind::Host => Accumulation::Owned,
        Accumulation::Auto | Accumulation::Repeatable if kind == DeviceKind::Cpu => Accumulation::Owned,
        Accumulation::Repeatable if !offered.int64 => Accumulation::Owned,
        Accumulation::Auto if offered.float => Accumulation::Float,
        // Lanes that meet at one bin cost an integer atomic once each; compare-and-swap turns again for each of them.
        Accumulation::Auto if offered.int64 => Accumulation::Fixed,
        Accumulation::Auto => Accumulation::Cas,
        Accumulation::Repeatable => Accumulation::Fixed,
        Accumulation::Float if !offered.float => {
            return Err(Error::options(
                "float accumulation was asked for: this device has no fp32 atomics (VK_EXT_shader_atomic_float)",
                advice!["leave " Accumulation " out, or choose fixed or cas"],
            ));
        }
        Accumulation::Fixed if !offered.int64 => {
            return Err(Error::options(
                "fixed accumulation was asked for: this device has no 64-bit atomics (VK_KHR_shader_atomic_int64)",
                advice!["leave " Accumulation " out, or choose cas or owned"],
            ));
        }
        other => other,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_adds_as_it_can() {
        let gpu =
            |float, int64| choose(Accumulation::Auto, DeviceKind::Discrete, Accumulations { float, int64 });
        assert_eq!(gpu(true, true).unwrap(), Accumulation::Float);
        assert_eq!(gpu(false, true).unwrap(), Accumulation::Fixed);
        assert_eq!(gpu(false, false).unwrap(), Accumulation::Cas);
        let repeatable = |kind, int64| {
            choose(Accumulation::Repeatable, kind, Accumulations { float: true, int64 }).unwrap()
        };
        assert_eq!(repeatable(DeviceKind::Discrete, true), Accumulation::Fixed);
        assert_eq!(repeatable(DeviceKind::Integrated, false), Accumulation::Owned);
        let without = Accumulations { float: true, int64: false };
        let error = choose(Accumulation::Fixed, DeviceKind::Integrated, without).unwrap_err();
        assert!(error.what.contains("no 64-bit atomics"), "{error}");
        assert_eq!(repeatable(DeviceKind::Cpu, true), Accumulation::Owned);
        let cpu = choose(Accumulation::Auto, DeviceKind::Cpu, Accumulations { float: true, int64: true });
        assert_eq!(cpu.unwrap(), Accumulation::Owned);
    }
}
