//! Sizes of workgroups, chunks and columns, by the kind of device. They change how the work is cut, not what is computed.

use serde::{Deserialize, Serialize};

use crate::advice::advice;
use crate::gpu::{Abilities, DeviceKind};
use crate::options::words;
use crate::transport::kernels::*;
use crate::transport::{Geometry, Model};
use crate::{Error, Result};

/// lavapipe silently stops an invocation after this many loop turns in all.
const LOOP_LIMIT: u32 = 65_535;

/// The most bins of a histogram and voxels of a column: a kernel may pass over them twice.
pub(crate) const LONGEST_LOOP: usize = 32_767;

/// How rendered values are added up in the histograms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Accumulation {
    /// The fastest that the device offers.
    Auto,
    /// The fastest of those that give the same bits in any order of workgroups: fixed on devices with 64-bit atomics, owned elsewhere.
    Repeatable,
    /// Native fp32 atomics.
    Float,
    /// Fixed point by 64-bit atomics: the same bits in any order.
    Fixed,
    /// Every histogram belongs to one invocation, no atomics.
    Owned,
}

words!(Accumulation);

impl Accumulation {
    /// Whether values are added up in fixed point.
    pub fn is_fixed(self) -> bool {
        self == Accumulation::Fixed
    }
}

/// Workgroup and chunk sizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tuning {
    /// Forward: lanes of a workgroup, which own a pair each.
    pub lanes: u32,
    /// Forward: voxels of a workgroup.
    pub chunk: u32,
    /// Forward: lanes below which workgroups take smaller chunks.
    pub forward_fill: u32,
    /// Gathers: voxels of a workgroup where as many lanes as possible share one.
    pub voxels: u32,
    /// Gathers: lanes that share a voxel at most.
    pub slices: u32,
    /// Gathers: lanes above which fewer lanes share a voxel.
    pub fill: u32,
    /// Other points that a product's forward kernel takes at once; 1 for other pairs.
    pub others_forward: u32,
    /// Other points that a product's backward kernel takes at once; 1 for other pairs.
    pub others_backward: u32,
    /// Forward: bins of a lane's private columns in shared memory; 0 to add straight to the histograms.
    pub window: u32,
    /// Forward: the columns are used at levels where a brick of voxels spans at most this many bins. Wider bricks
    /// would move the columns all the time, at more than the cost of atomics.
    pub window_span: u32,
    /// High-pass: lanes of the workgroup that owns a row; 0 where an invocation owns it.
    pub row_lanes: u32,
    /// Passes over pixels of a surface that read surrounding pixels: lanes that share a pixel.
    pub pixel_lanes: u32,
}

/// Sizes that follow from the kind of a device. Its limits may lower them.
struct KindSizes {
    /// Forward: lanes of a workgroup, and its voxels unless histograms are owned.
    forward: [u32; 2],
    /// Forward: bins of all private columns of a lane: 16 KiB of a workgroup's shared memory, or what is left of as much. A brick of
    /// voxels spans about as many.
    window: u32,
    /// Gathers: lanes of a workgroup, and how many of them share a voxel at most.
    gather: [u32; 2],
    /// Lanes that hide the latencies of a gather; of a forward pass, whose private columns leave room for fewer, half as many.
    fill: u32,
    /// High-pass: least and most lanes that own a row. More lanes take more turns of a scan.
    row_lanes: [u32; 2],
    /// Lanes that share a pixel: as many as it has neighbours.
    pixel_lanes: u32,
}

impl KindSizes {
    fn of(kind: DeviceKind) -> KindSizes {
        let gpu = KindSizes {
            forward: [64, 256],
            window: 64,
            gather: [256, 32],
            // About 32 warps on each of the 132 multiprocessors of an H200 (docs/devices.md).
            fill: 1 << 17,
            row_lanes: [32, 256],
            pixel_lanes: 8,
        };
        match kind {
            DeviceKind::Discrete | DeviceKind::Virtual => gpu,
            // An eighth of that where a GPU shares the host's memory. A CPU driver has no sizes of its own, and the host's
            // kernels have none.
            DeviceKind::Integrated | DeviceKind::Other | DeviceKind::Cpu | DeviceKind::Host => {
                KindSizes { fill: 1 << 14, ..gpu }
            }
        }
    }
}

/// Bins of a lane where a workgroup owns a row.
const BINS_OF_LANE: u32 = 4;

/// Lanes of the workgroup that owns a row of `bins` bins (`residual_scan.comp`), from least to most; 0 for longer rows than fit into
/// shared memory.
fn row_lanes_of(bins: usize, [least, most]: [u32; 2], device: &Abilities) -> u32 {
    let lanes = (bins as u32).div_ceil(BINS_OF_LANE).next_power_of_two().clamp(least, most);
    let lanes = lanes.min(device.limits.workgroup_invocations);
    // A value of every bin, twice two sums of every lane, two words.
    let bytes = u64::from(lanes) * (4 * u64::from(row_run(bins, lanes)) + 16) + 8;
    if bytes <= u64::from(device.limits.shared_memory) { lanes } else { 0 }
}

/// Bins of a lane: an odd number, so that lanes do not share memory banks.
pub(crate) fn row_run(bins: usize, lanes: u32) -> u32 {
    (bins as u32).div_ceil(lanes.max(1)) | 1
}

/// Maximum ratio of a brick's width to a column's. Counted on lists of solves: a lane of a warp then moves its
/// column in a sixth of the turns at most (docs/devices.md).
const SPANS: u32 = 4;

/// Columns of fewer bins would move at every other voxel.
const NARROWEST: u32 = 8;

impl Tuning {
    /// The sizes for a device. `capacity` is how many voxels may be active.
    ///
    /// # Errors
    /// A kernel would loop longer than drivers allow.
    pub fn new(
        model: &Model,
        capacity: usize,
        accumulation: Accumulation,
        device: &Abilities,
    ) -> Result<Tuning> {
        let of_kind = KindSizes::of(device.kind);
        let most_lanes = device.limits.workgroup_invocations;
        let owned = accumulation == Accumulation::Owned;
        let others = model.rendered_wall().others.len() as u32;
        let product = model.wall.geometry == Geometry::Product;
        let at_once = |most: u32| if product { others.min(most) } else { 1 };
        let of_forward = if owned { 1 } else { OTHERS_FORWARD };
        let [others_forward, others_backward] = [of_forward, OTHERS_BACKWARD].map(at_once);
        let [lanes, chunk] = of_kind.forward;
        let [gatherers, slices] = of_kind.gather;
        // One dispatch must hold all chunks, even if every voxel is active.
        let least_chunk = capacity.div_ceil(device.limits.groups[1] as usize) as u32;
        let mut t = Tuning {
            lanes: lanes.min(most_lanes),
            chunk: if owned { OWNED_CHUNK } else { chunk.max(least_chunk) },
            voxels: (gatherers.min(most_lanes) / slices).max(1),
            slices,
            fill: of_kind.fill,
            forward_fill: of_kind.fill / 2,
            others_forward,
            others_backward,
            window: 0,
            window_span: 0,
            row_lanes: row_lanes_of(model.bins, of_kind.row_lanes, device),
            pixel_lanes: of_kind.pixel_lanes.min(most_lanes / WORKGROUP).max(1),
        };
        let widest = (of_kind.window / others_forward.max(1)).min(t.widest_window(product, device));
        if !owned && widest >= NARROWEST {
            (t.window, t.window_span) = (widest, widest.saturating_mul(SPANS));
        }
        if t.turns(owned, product) > LOOP_LIMIT {
            (t.window, t.window_span) = (0, 0);
        }
        if t.turns(owned, product) > LOOP_LIMIT {
            return Err(Error::memory(
                format!("{capacity} voxels: a chunk of {} voxels loops longer than drivers allow", t.chunk),
                advice!["use a smaller " Lateral],
            ));
        }
        let turns = [PAIR_CHUNK * 2, 2 * LONGEST_LOOP as u32];
        assert!(turns.iter().all(|t| *t <= LOOP_LIMIT), "a kernel would loop longer than drivers allow");
        Ok(t)
    }

    /// Samples of a workgroup of a gather, as `slices.glsl` divides `samples`.
    pub fn samples_of_group(&self, samples: usize) -> u32 {
        let mut slices = self.slices;
        while slices.is_multiple_of(2) && samples >= (self.fill / (slices / 2)) as usize {
            slices /= 2;
        }
        self.voxels * self.slices / slices
    }

    /// Workgroups of a gather at most, for up to `samples` samples.
    pub(crate) fn most_groups(&self, samples: usize) -> usize {
        // Where not all lanes share a sample, those of the samples are fewer than twice as many as fill the device.
        let whole = samples.div_ceil(self.voxels as usize);
        let lanes = (self.voxels * self.slices) as usize;
        whole.min(samples.div_ceil(lanes).max((2 * self.fill as usize).div_ceil(lanes) + 1))
    }

    /// Chunks of voxels of a forward pass at most, for up to `voxels` voxels and `tiles` tiles, as `chunks.glsl` divides
    /// them.
    pub(crate) fn most_chunks(&self, voxels: usize, tiles: u64) -> u64 {
        // Where chunks are smaller, they are fewer than twice as many as fill the device.
        let wanted = u64::from(self.forward_fill).div_ceil(tiles.max(1) * u64::from(self.lanes));
        (voxels as u64).div_ceil(u64::from(self.chunk)).max(2 * wanted + 1)
    }

    /// Tiles of pairs, along x, of a rendering dispatch, by numbers of pairs, scanned and other points.
    pub fn tiles(&self, geometry: Geometry, [pairs, scanned, others]: [usize; 3]) -> u64 {
        let wide = self.lanes as usize;
        let tiles = match geometry {
            Geometry::Product => scanned.div_ceil(wide) * others.div_ceil(self.others_forward as usize),
            _ => pairs.div_ceil(wide),
        };
        tiles as u64
    }

    /// Loop turns of an invocation of the forward kernel, at most.
    fn turns(&self, owned: bool, product: bool) -> u32 {
        if owned {
            return self.chunk;
        }
        let (chunk, others) = (self.chunk, self.others_forward);
        let moves = chunk.saturating_mul(others).saturating_mul(self.window) / PATIENCE;
        moves.saturating_add(if product { chunk / 4 * (5 * others + 5) } else { chunk })
    }

    /// Bins of the widest columns that a device has shared memory for. In a product a block of voxels has its arms to the other
    /// points there, too (`forward_product.comp`).
    fn widest_window(&self, product: bool, device: &Abilities) -> u32 {
        let [lanes, others] = [self.lanes, self.others_forward].map(u64::from);
        let arms = if product { 64 * 12 * others + 12 } else { 0 };
        (u64::from(device.limits.shared_memory).saturating_sub(arms) / (lanes * others * 4).max(1)) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workgroups_leave_room_for_every_count() {
        let sizes = [
            (8, 32, 1 << 17),
            (8, 32, 1 << 14),
            (4, 32, 1000),
            (64, 1, 0),
            (32, 4, u32::MAX),
            (24, 3, u32::MAX),
        ];
        for (voxels, slices, fill) in sizes {
            let t = Tuning {
                lanes: 64,
                chunk: 256,
                forward_fill: 0,
                voxels,
                slices,
                fill,
                others_forward: 1,
                others_backward: 1,
                window: 0,
                window_span: 0,
                row_lanes: 0,
                pixel_lanes: 1,
            };
            let groups = |samples: usize| samples.div_ceil(t.samples_of_group(samples) as usize);
            for capacity in [1usize, 999, 8191, 70_001, 300_000, 2_000_000] {
                let most = (0..=capacity).step_by(capacity / 900 + 1).chain([capacity]).map(groups).max();
                assert!(most <= Some(t.most_groups(capacity)), "{voxels} {slices} {fill}: {capacity}");
            }
            // As few lanes for a sample as fill the device.
            for samples in [1usize, 500, 5000, 40_000, 200_000] {
                let lanes = samples * (voxels * slices / t.samples_of_group(samples)) as usize;
                let all = lanes == samples * slices as usize;
                assert!(all || (fill as usize..2 * fill as usize).contains(&lanes) || lanes == samples);
            }
        }
    }
}
