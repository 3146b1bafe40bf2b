//! How passes over pairs are divided into dispatches: none has more work than a device may get at once
//! ([`crate::gpu::Limits::work`]), or more turns than a loop may have.

use super::{Accumulation, Level, Plan};
use crate::transport::kernels::PAIR_CHUNK;

/// Fewer pairs than this are no dispatch of a gather, however many voxels there are.
const LEAST_GATHERED: u32 = 64;

impl Plan {
    /// Dispatches that one forward pass over all pairs takes at `level`.
    pub fn forward_sets(&self, level: &Level) -> u32 {
        self.sets_of(level, level.rendered.count)
    }

    /// Dispatches that one forward pass over so many pairs takes at `level`.
    pub(in crate::solve) fn sets_of(&self, level: &Level, pairs: usize) -> u32 {
        let chunks = self.voxels_at(level).div_ceil(self.tuning.chunk as usize);
        chunks.div_ceil(self.set_chunks(pairs) as usize) as u32
    }

    /// Chunks of voxels in one dispatch of a forward pass over so many pairs: one where every histogram belongs to an
    /// invocation, else as many as a dispatch may have work for.
    pub(in crate::solve) fn set_chunks(&self, pairs: usize) -> u32 {
        (self.set_cells() / u32::try_from(pairs.max(1)).unwrap_or(u32::MAX)).max(1)
    }

    /// Chunks times pairs of one dispatch, as [`Plan::set_chunks`] and `arguments.comp` divide them.
    pub(super) fn set_cells(&self) -> u32 {
        match self.accumulation {
            Accumulation::Owned => 0,
            _ => u32::try_from(self.work / u64::from(self.tuning.chunk)).unwrap_or(u32::MAX),
        }
    }

    /// The most dispatches that a forward pass takes at any level.
    pub(super) fn most_sets(&self) -> u32 {
        let all = self.levels.iter().chain(&self.pixel_level);
        all.map(|l| self.forward_sets(l)).max().unwrap_or(1)
    }

    /// Voxels or points that may be active at `level`.
    pub fn voxels_at(&self, level: &Level) -> usize {
        level.grid.storage().min(self.capacity)
    }

    /// Pairs of one dispatch that gathers them for `voxels` voxels.
    pub fn gathered_pairs(&self, voxels: usize) -> u32 {
        // Lanes that share a voxel take every few pairs.
        let most = (self.work / voxels.max(1) as u64).min(u64::from(PAIR_CHUNK)) as u32;
        (most / LEAST_GATHERED * LEAST_GATHERED).max(LEAST_GATHERED)
    }
}
