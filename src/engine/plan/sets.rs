//! Passes over pairs as dispatches: what kernels can index, and how many of them one pass takes.

use super::level::Level;
use super::tuning::Accumulation;
use super::whole::Plan;
use crate::advice::advice;
use crate::transport::kernels::PAIR_CHUNK;
use crate::transport::{Model, cells};
use crate::{Error, Result};

/// Fewer pairs than this are no dispatch of a gather, however many voxels there are.
const LEAST_GATHERED: u32 = 64;

/// The most values of histograms that kernels index: they count three words of noise for a bin.
const MOST_VALUES: u64 = 1 << 30;

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
