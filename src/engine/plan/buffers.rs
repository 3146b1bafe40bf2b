//! Every buffer of a plan: those that all solvers have, and the solver's own.

use std::collections::BTreeSet;

use super::level::Level;
use super::spots::{BETWEEN, SEEN, WALL};
use super::whole::Plan;
use crate::gpu::{Buffer, BufferPlan, Place};
use crate::transport::kernels::*;
use crate::transport::{BRICK_VOXELS, SpotTaps, cells};
use glam::DVec3;

/// Data of the host for the device.
pub const UPLOAD: Buffer = Buffer::named("upload");
/// The maps, for the host.
pub const COLUMNS_HOST: Buffer = Buffer::named("columns_host");
/// The volume's raw variables, for the host.
pub const RAW_HOST: Buffer = Buffer::named("raw_host");
/// The volume's mask, for the host.
pub const MASK_HOST: Buffer = Buffer::named("mask_host");
/// The residual, for the host.
pub const RESIDUAL_HOST: Buffer = Buffer::named("residual_host");

impl Plan {
    /// All buffers: the shared ones, the solver's `own`, and one of the smallest size for every block that a pass
    /// binds but does not use in this plan.
    pub(crate) fn list_buffers(&self, own: Vec<(Buffer, u64)>, with_volume: bool) -> Vec<BufferPlan> {
        let columns = (self.levels.maps.n[0] * self.levels.maps.n[1] * 32) as u64;
        let mut all: Vec<BufferPlan> = vec![];
        for (buffer, bytes) in self.shared_buffers(columns).into_iter().chain(own).chain(self.level_buffers())
        {
            let made = BufferPlan::new(buffer, bytes, Place::Device);
            // A solver may need a shared one to be larger.
            match all.iter_mut().find(|b| b.buffer == buffer) {
                Some(same) => same.bytes = same.bytes.max(made.bytes),
                None => all.push(made),
            }
        }
        // One more: a surface is compared twice before its first iteration.
        let rows = (self.demand.iterations.iter().sum::<usize>() + 1) * TRACE_ROW as usize;
        let mut on_host = vec![
            (UPLOAD, self.measured_bytes() + self.scan_bytes(), Place::Upload),
            (buffer::TRACE, (rows * 4) as u64, Place::Readback),
            (COLUMNS_HOST, columns, Place::Readback),
        ];
        if with_volume {
            on_host.push((RAW_HOST, self.domain.capacity as u64 * 16, Place::Readback));
            on_host.push((MASK_HOST, self.finest().grid.storage() as u64 / 8, Place::Readback));
        }
        all.extend(on_host.into_iter().map(|(b, bytes, place)| BufferPlan::new(b, bytes, place)));
        let bound = self.passes.iter().flat_map(|p| (p.code)(self).bindings);
        let mut missing: BTreeSet<Buffer> = bound.map(|b| b.block).collect();
        // Schedules always bind these to other buffers.
        for block in [buffer::SCENE, buffer::SOURCE, buffer::TARGET, buffer::REACHABLE, buffer::COARSE_MASK] {
            missing.remove(&block);
        }
        all.iter().for_each(|b| {
            missing.remove(&b.buffer);
        });
        // A kernel that does not use a block still sees all of it.
        let least = |b: Buffer| if b == buffer::PAPER { size_of::<PaperData>() as u64 } else { 0 };
        all.extend(missing.into_iter().map(|b| BufferPlan::new(b, least(b), Place::Device)));
        all
    }

    /// Partial sums that the workgroups of a gather leave at most.
    pub fn partials(&self) -> u64 {
        self.division.tuning.most_groups(self.domain.capacity) as u64
    }

    fn shared_buffers(&self, columns: u64) -> Vec<(Buffer, u64)> {
        let slots = self.domain.capacity as u64;
        let [cells, rendered] = [self.scene.pairs, self.finest().rendered.count]
            .map(|pairs| cells(pairs, self.scene.bins) as u64);
        let sets = self.most_sets();
        let losses = cells.div_ceil(u64::from(WORKGROUP * RESIDUAL_BINS));
        let losses = if self.scene.high_pass { losses.max(self.scene.pairs as u64) } else { losses };
        let mut all = vec![
            (buffer::WALL, self.wall_bytes(self.finest())),
            (buffer::MEASURED, self.measured_bytes()),
            (buffer::RESIDUAL, cells * 4),
            (buffer::SAMPLE_POINTS, slots * 16),
            (buffer::SAMPLE_NORMALS, if self.scene.reflectance.has_normals() { slots * 16 } else { 0 }),
            (buffer::GRADIENT, slots * 16),
            (buffer::COUNTS, u64::from(COUNTS) * 4),
            (buffer::ARGUMENTS, u64::from(ARGUMENTS_FORWARD + sets) * 12),
            (buffer::L1_PARTIALS, self.partials().max(slots.div_ceil(u64::from(WORKGROUP))) * 4),
            (buffer::LOSS_PARTIALS, losses * 8),
            (buffer::COLUMNS, columns),
        ];
        if self.demand.renders {
            all.push((buffer::HISTOGRAMS, rendered * if self.fixed_point() { 8 } else { 4 }));
        }
        if self.scene.pulse > 0 {
            all.push((buffer::SPREAD, cells * 4));
            all.push((buffer::PULSE_TAPS, (self.scene.pulse as u64 + 2) * 4));
        }
        all
    }

    /// Bytes of the measured histograms of all pairs.
    fn measured_bytes(&self) -> u64 {
        (self.scene.pairs * self.scene.bins * 4) as u64
    }

    /// Bytes of the scan and of the constants of all levels: one submission takes them with the counts.
    fn scan_bytes(&self) -> u64 {
        let batches: u64 = self.stretches().map(|b| (b.pairs * self.scene.bins * 4) as u64).sum();
        let own: u64 = self.level_buffers().iter().map(|(_, bytes)| bytes).sum();
        self.wall_bytes(self.finest()) + own - batches
    }

    fn level_buffers(&self) -> Vec<(Buffer, u64)> {
        let mut all = vec![];
        let of_scene = size_of::<SceneData>() as u64;
        for level in &self.levels.volume {
            all.push((level.scene, of_scene));
            all.push((level.reachable, (level.grid.storage() / BRICK_VOXELS) as u64 * 4));
            if self.has_spots() {
                all.push((level.rendered.scene, of_scene));
            }
        }
        all.extend(self.spot_buffers());
        for batch in self.stretches() {
            let measured = (batch.pairs * self.scene.bins * 4) as u64;
            let wall = self.wall_bytes(batch);
            all.extend([(batch.scene, of_scene), (batch.wall, wall), (batch.measured, measured)]);
        }
        all.extend(self.blocks.iter().map(|(buffer, bytes)| (*buffer, bytes.len() as u64)));
        if self.scene.high_pass {
            all.push((buffer::SURFACE, size_of::<SurfaceData>() as u64));
            all.push((buffer::ROW_FACTORS, (self.scene.bins as u64 + 1) * 16));
        }
        all
    }

    /// Bytes of the wall points that the pairs of a level have.
    fn wall_bytes(&self, level: &Level) -> u64 {
        let own = self.measured(level);
        (own.scanned + own.others) as u64 * self.scene.bytes_of_point()
    }
}

impl Plan {
    /// Whether laser or sensor see more than points.
    pub fn has_spots(&self) -> bool {
        self.levels.spots.is_some()
    }

    /// The buffers that spots need.
    pub(crate) fn spot_buffers(&self) -> Vec<(Buffer, u64)> {
        let Some(spots) = &self.levels.spots else { return vec![] };
        let cells = |pairs: usize| 4 * cells(pairs, self.scene.bins) as u64;
        let stages = &spots.rendered.stages;
        let inner = stages.iter().skip(1).map(SpotTaps::terms).max();
        let words: usize = stages.iter().chain(&spots.back).map(SpotTaps::len_of_words).sum();
        vec![
            (buffer::SPOT_TAPS, words as u64 * 4),
            (WALL, (spots.rendered.wall.words(DVec3::ZERO).len() * 16) as u64),
            (SEEN, cells(self.scene.pairs.max(spots.rendered.wall.pairs()))),
            (BETWEEN, inner.map_or(0, cells)),
        ]
    }
}
