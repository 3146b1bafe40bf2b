//! Every buffer of a plan.

use super::{Level, Plan, WALL};
use crate::gpu::{BufferPlan, Place};
use crate::solve::surface::blur;
use crate::transport::BRICK_VOXELS;
use crate::transport::kernels::*;

/// What every pixel of the surface has, bytes.
const OF_PIXEL: [(&str, u64); 7] = [
    ("pixels", 16),
    ("heights", 8),
    ("slopes", 8),
    ("stencils", 64),
    ("height_gradient", 16),
    ("height_pull", 8),
    ("height_moments", 16),
];

/// Bytes of a surface with so many pixels, and their numbers by column.
pub(super) fn surface_bytes(pixels: u64) -> u64 {
    pixels * (OF_PIXEL.iter().map(|(_, bytes)| bytes).sum::<u64>() + 4)
}

impl Plan {
    pub(super) fn list_buffers(&self, with_volume: bool) -> Vec<BufferPlan> {
        let grid = &self.finest().grid;
        let voxels = grid.storage() as u64;
        // What active voxels have, and what their neighbours have too.
        let [slots, touched] = [self.capacity, self.touched_capacity].map(|v| v as u64);
        let of_vectors = |bytes: u64| if self.vectors { bytes } else { 0 };
        let of_adam = |bytes: u64| if self.vectors { 0 } else { bytes };
        let of_rim = |bytes: u64| if self.continuous { bytes } else { 0 };
        // Volumes of their own, in the first of which state is moved too.
        let of_volumes = |bytes: u64| if self.aliases_volumes() { 0 } else { bytes };
        let maps = &self.maps_grid().n;
        let columns = (maps[0] * maps[1] * 32) as u64;
        let elements = (self.pairs * self.bins) as u64;
        let cells = self.cells_at(self.finest()) as u64;
        let of_point = if self.curved { 32 } else { 16 };
        let sets = self.forward_sets(self.finest());
        let pixels = self.pixels() as u64;
        let device = [
            (WALL, self.points(self.finest()) * of_point),
            ("measured", elements * 4),
            ("histograms", cells * if self.fixed_point() { 8 } else { 4 }),
            ("residual", cells * 4),
            ("spread", if self.tap_sets() > 0 { cells * 4 } else { 0 }),
            ("pulse_taps", (self.tap_sets() * self.tap_room() * 4) as u64),
            ("noise_state", self.noise_weights() as u64 * 12),
            ("raw", touched * 16),
            ("before", of_vectors(slots * 16)),
            ("moment_first", of_adam(touched * 16)),
            ("moment_second", of_adam(touched * 16)),
            ("bounds", of_vectors(slots * 8)),
            ("hat_taps", of_vectors(self.bins as u64 * 4 + 4)),
            ("smooth", of_volumes((voxels * 4).max(of_adam(touched * 16)))),
            ("smooth_spare", of_volumes(voxels * 4)),
            ("levels", u64::from(LEVELS) * 4),
            ("momentum", u64::from(MOMENTUM) * 4),
            ("against_partials", of_vectors(slots.div_ceil(u64::from(self.tuning.voxels)) * 4)),
            ("mask", voxels / 8),
            ("ranks", voxels / 8),
            ("mask_before", voxels / 8),
            ("ranks_before", voxels / 8),
            ("rim_mask", of_rim(voxels / 8)),
            ("rim_ranks", of_rim(voxels / 8)),
            ("rim_before", of_rim(voxels / 8)),
            ("rim_ranks_before", of_rim(voxels / 8)),
            ("brick_offsets", voxels / BRICK_VOXELS as u64 * 4),
            ("active_voxels", touched * 4),
            ("sample_points", slots * 16),
            ("sample_normals", if self.reflectance.has_normals() { slots * 16 } else { 0 }),
            ("gradient", slots * 16),
            ("taps", (self.taps.len() + 1) as u64 * 4),
            ("counts", u64::from(COUNTS) * 4),
            ("arguments", u64::from(ARGUMENTS_FORWARD + sets) * 12),
            ("l1_partials", slots.div_ceil(u64::from(WORKGROUP.min(self.tuning.voxels))) * 4),
            (
                "loss_partials",
                cells.div_ceil(u64::from(WORKGROUP * RESIDUAL_BINS)) * u64::from(WORKGROUP) * 8,
            ),
            ("columns", columns),
            ("pixel_of", if pixels > 0 { columns / 8 } else { 0 }),
            ("surface_weights", if pixels > 0 { u64::from(SURFACE_WEIGHTS) * 4 } else { 0 }),
        ];
        let of_pixels = OF_PIXEL.map(|(name, bytes)| (name, pixels * bytes));
        let mut all: Vec<_> =
            device.iter().chain(&of_pixels).map(|(n, b)| BufferPlan::new(n, *b, Place::Device)).collect();
        for level in self.levels.iter().chain(self.surface_only()) {
            all.push(BufferPlan::new(level.scene, size_of::<SceneData>() as u64, Place::Device));
        }
        for level in &self.levels {
            let bricks = level.grid.storage() / BRICK_VOXELS;
            all.push(BufferPlan::new(level.reachable, bricks as u64 * 4, Place::Device));
            if level.wall != WALL {
                all.push(BufferPlan::new(level.wall, self.points(level) * of_point, Place::Device));
            }
        }
        all.push(BufferPlan::new("upload", elements * 4, Place::Upload));
        all.push(BufferPlan::new(
            "trace",
            ((self.iterations + self.surface_iterations) * TRACE_ROW as usize * 4) as u64,
            Place::Readback,
        ));
        all.push(BufferPlan::new("columns_host", columns, Place::Readback));
        if with_volume {
            all.push(BufferPlan::new("raw_host", slots * 16, Place::Readback));
            all.push(BufferPlan::new("mask_host", voxels / 8, Place::Readback));
        }
        all
    }

    /// Sets of taps that residuals may go back through: the pulse's, and the surface's blurs of it.
    fn tap_sets(&self) -> usize {
        match (self.pulse, self.blurred) {
            (0, false) => 0,
            (_, false) => 1,
            _ => 1 + blur::BLURS,
        }
    }

    /// Words of each: the same for all pulses but the longest, so that a plan made before one is found holds.
    pub fn tap_room(&self) -> usize {
        (self.pulse + 2 + blur::ADDED).max(256)
    }

    /// Wall points that the pairs of a level have.
    fn points(&self, level: &Level) -> u64 {
        self.geometry.counts(level.pairs, self.scanned, self.others).iter().sum::<usize>() as u64
    }
}
