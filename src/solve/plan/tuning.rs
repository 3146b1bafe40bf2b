//! Sizes of workgroups, chunks and columns, by the kind of device. They change how the work is cut, not what is computed.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::gpu::{Abilities, DeviceKind};
use crate::transport::kernels::*;
use crate::transport::{Geometry, Model};
use crate::{Error, Result};

/// lavapipe silently stops an invocation after this many loop turns in all.
const LOOP_LIMIT: u32 = 65_535;

/// The most bins of a histogram and voxels of a column: a kernel may pass over them twice.
pub(super) const LONGEST_LOOP: usize = 32_767;

/// How rendered values are added up in the histograms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Accumulation {
    /// The fastest that the device offers.
    Auto,
    /// The fastest of those that give the same bits in any order of workgroups: fixed on GPUs with 64-bit atomics, owned elsewhere.
    Repeatable,
    /// Native fp32 atomics.
    Float,
    /// Fixed point by 64-bit atomics: the same bits in any order.
    Fixed,
    /// Compare and swap.
    Cas,
    /// Every histogram belongs to one invocation, no atomics: for CPUs.
    Owned,
}

impl Accumulation {
    /// Whether values are added up in fixed point.
    pub fn is_fixed(self) -> bool {
        self == Accumulation::Fixed
    }
}

/// Workgroup and chunk sizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tuning {
    /// Forward: lanes of a workgroup, which own a pair each, or `held` pairs.
    pub lanes: u32,
    /// Forward, owned histograms: pairs of a lane, or scanned points of a product.
    pub held: u32,
    /// Forward: voxels of a workgroup.
    pub chunk: u32,
    /// Forward: lanes below which workgroups take smaller chunks.
    pub forward_fill: u32,
    /// One lane of a workgroup leaves the partial losses of all.
    pub group_losses: bool,
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
    /// Passes over pairs and over surroundings of pixels see what they read as texels. A CPU driver loads these for all lanes at once, and words of
    /// blocks lane by lane.
    pub texels: bool,
    /// High-pass: lanes of the workgroup that owns a row; 0 where an invocation owns it.
    pub row_lanes: u32,
    /// Passes over pixels of a surface that read surrounding pixels: lanes that share a pixel.
    pub pixel_lanes: u32,
}

/// Sizes that a user asks for instead of the device's own. Written `lanes=64,chunk=256`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sizes {
    /// See [`Tuning::lanes`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lanes: Option<u32>,
    /// See [`Tuning::chunk`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chunk: Option<u32>,
    /// See [`Tuning::window`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window: Option<u32>,
    /// See [`Tuning::voxels`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxels: Option<u32>,
    /// See [`Tuning::slices`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slices: Option<u32>,
}

impl Sizes {
    /// Whether no size is asked for.
    pub fn is_default(&self) -> bool {
        *self == Sizes::default()
    }

    fn named(&self) -> [(&'static str, Option<u32>); 5] {
        [
            ("lanes", self.lanes),
            ("chunk", self.chunk),
            ("window", self.window),
            ("voxels", self.voxels),
            ("slices", self.slices),
        ]
    }
}

impl fmt::Display for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let given: Vec<_> =
            self.named().iter().filter_map(|(name, v)| v.map(|v| format!("{name}={v}"))).collect();
        f.write_str(&given.join(","))
    }
}

impl FromStr for Sizes {
    type Err = Error;

    /// # Errors
    /// A name is not that of a size, or a value is not a whole number.
    fn from_str(text: &str) -> Result<Sizes> {
        let mut sizes = Sizes::default();
        for part in text.split(',') {
            let wrong = || {
                Error::options(
                    format!("sizes {text}: {part:?} is no size"),
                    "write sizes as lanes=64,chunk=256,window=64,voxels=32,slices=4, or some of them",
                )
            };
            let (name, value) = part.split_once('=').ok_or_else(wrong)?;
            let value: u32 = value.trim().parse().map_err(|_| wrong())?;
            let slot = match name.trim() {
                "lanes" => &mut sizes.lanes,
                "chunk" => &mut sizes.chunk,
                "window" => &mut sizes.window,
                "voxels" => &mut sizes.voxels,
                "slices" => &mut sizes.slices,
                _ => return Err(wrong()),
            };
            *slot = Some(value);
        }
        Ok(sizes)
    }
}

/// Lanes of a workgroup that gathers, on a GPU.
const GATHERERS: u32 = 256;

/// Lanes that share a voxel at most there.
const SLICES: u32 = 32;

/// Lanes that hide the latencies of a gather on a device of a kind: about 32 warps on each of the 132 multiprocessors of an
/// H200 (docs/devices.md), and an eighth of that where a GPU shares the host's memory.
fn fill_of(kind: DeviceKind) -> u32 {
    match kind {
        DeviceKind::Discrete | DeviceKind::Virtual => 1 << 17,
        DeviceKind::Integrated | DeviceKind::Other => 1 << 14,
        DeviceKind::Host | DeviceKind::Cpu => 0,
    }
}

/// The same for the forward pass, whose private columns leave room for fewer lanes.
fn forward_fill_of(kind: DeviceKind) -> u32 {
    fill_of(kind) / 2
}

/// Workgroups per thread of a CPU that leave no thread idle for long.
const GROUPS_PER_THREAD: usize = 4;

/// Histograms of a lane on a CPU, of `owned` in all: two where they leave enough workgroups. Four gain another 3 % and compile
/// twice as long.
fn held_of(owned: usize, lanes: u32) -> u32 {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    // Sizes are checked later.
    if owned.div_ceil(2 * lanes.max(1) as usize) >= GROUPS_PER_THREAD * threads { 2 } else { 1 }
}

/// Bins of a lane where a workgroup owns a row, and bounds of its lanes: more lanes take more turns of a scan.
const BINS_OF_LANE: u32 = 4;
const ROW_LANES: [u32; 2] = [32, 256];

/// Lanes of the workgroup that owns a row of `bins` bins (`residual_scan.comp`); 0 on a CPU, or for longer rows than fit into
/// shared memory.
fn row_lanes_of(bins: usize, device: &Abilities) -> u32 {
    let [least, most] = ROW_LANES;
    let lanes = (bins as u32).div_ceil(BINS_OF_LANE).next_power_of_two().clamp(least, most);
    let lanes = lanes.min(device.limits.workgroup_invocations);
    // A value of every bin, twice two sums of every lane, two words.
    let bytes = u64::from(lanes) * (4 * u64::from(row_run(bins, lanes)) + 16) + 8;
    let fits = bytes <= u64::from(device.limits.shared_memory);
    if device.kind != DeviceKind::Cpu && fits { lanes } else { 0 }
}

/// Bins of a lane: an odd number, so that lanes do not share memory banks.
pub(super) fn row_run(bins: usize, lanes: u32) -> u32 {
    (bins as u32).div_ceil(lanes.max(1)) | 1
}

/// Lanes that share a pixel on a GPU: as many as a pixel has neighbours.
const PIXEL_LANES: u32 = 8;

/// Maximum ratio of a brick's width to a column's. Counted on lists of solves: a lane of a warp then moves its
/// column in a sixth of the turns at most (docs/devices.md).
const SPANS: u32 = 4;

/// Bins of a lane's private histogram columns: 16 KiB of a workgroup's shared memory, or what is left of as much. A brick of
/// voxels spans about as many.
const WINDOW: u32 = 64;

/// Columns of fewer bins would move at every other voxel.
const NARROWEST: u32 = 8;

impl Tuning {
    /// The sizes for a device, with those that are asked for. `capacity` is how many voxels may be active, `scanned` the number
    /// of scanned points that a pass takes.
    ///
    /// # Errors
    /// The device or the kernels do not take the sizes.
    pub fn new(
        model: &Model,
        [capacity, scanned]: [usize; 2],
        accumulation: Accumulation,
        device: &Abilities,
        sizes: &Sizes,
    ) -> Result<Tuning> {
        let owned = accumulation == Accumulation::Owned;
        let cpu = device.kind == DeviceKind::Cpu;
        let others = model.rendered_wall().others.len() as u32;
        let product = model.wall.geometry == Geometry::Product;
        let at_once = |most: u32| if product { others.min(most) } else { 1 };
        let of_forward = if owned { 1 } else { OTHERS_FORWARD };
        let [others_forward, others_backward] = [of_forward, OTHERS_BACKWARD].map(at_once);
        // On a CPU a workgroup is one core's work and a subgroup is one vector: small groups, long chunks.
        let (lanes, chunk) = if cpu { (8, 4096) } else { (64, 256) };
        let slices = sizes.slices.unwrap_or(if cpu { 1 } else { SLICES });
        let gatherers = GATHERERS.min(device.limits.workgroup_invocations);
        let voxels = if cpu { 64 } else { (gatherers / slices.max(1)).max(1) };
        let chunk = if owned { OWNED_CHUNK } else { chunk };
        // On a CPU private memory costs the same wherever it lies.
        let window = if cpu { 0 } else { WINDOW / others_forward };
        let lanes = sizes.lanes.unwrap_or(lanes);
        let held = if owned && cpu { held_of(scanned, lanes) } else { 1 };
        let mut t = Tuning {
            lanes,
            held,
            chunk: sizes.chunk.unwrap_or(chunk),
            voxels: sizes.voxels.unwrap_or(voxels),
            slices,
            // Asked for: exactly as many.
            fill: if sizes.slices.is_some() { u32::MAX } else { fill_of(device.kind) },
            // Asked for: exactly as long.
            forward_fill: if sizes.chunk.is_some() { 0 } else { forward_fill_of(device.kind) },
            group_losses: !cpu,
            others_forward,
            others_backward,
            window: sizes.window.unwrap_or(window),
            window_span: sizes.window.unwrap_or(window).saturating_mul(SPANS),
            texels: cpu,
            row_lanes: row_lanes_of(model.bins, device),
            pixel_lanes: if cpu {
                1
            } else {
                PIXEL_LANES.min(device.limits.workgroup_invocations / WORKGROUP)
            },
        };
        if sizes.window.is_none() {
            let narrower = t.window.min(t.widest_window(product, device));
            t.window = if narrower < NARROWEST { 0 } else { narrower };
            t.window_span = t.window.saturating_mul(SPANS);
        }
        t.check(product, device, sizes)?;
        if !owned {
            // One dispatch must hold all chunks, even if every voxel is active.
            t.chunk = t.chunk.max(capacity.div_ceil(device.limits.groups[1] as usize) as u32);
        }
        if t.turns(owned, product) > LOOP_LIMIT && sizes.window.is_none() {
            t.window = 0;
        }
        if t.turns(owned, product) > LOOP_LIMIT {
            return Err(Error::options(
                format!("sizes {sizes}: a chunk of {} voxels loops longer than drivers allow", t.chunk),
                "use a smaller chunk or window",
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
    pub(in crate::solve) fn most_groups(&self, samples: usize) -> usize {
        // Where not all lanes share a sample, those of the samples are fewer than twice as many as fill the device.
        let whole = samples.div_ceil(self.voxels as usize);
        let lanes = (self.voxels * self.slices) as usize;
        whole.min(samples.div_ceil(lanes).max((2 * self.fill as usize).div_ceil(lanes) + 1))
    }

    /// Chunks of voxels of a forward pass at most, for up to `voxels` voxels and `tiles` tiles, as `chunks.glsl` divides
    /// them.
    pub(in crate::solve) fn most_chunks(&self, voxels: usize, tiles: u64) -> u64 {
        // Where chunks are smaller, they are fewer than twice as many as fill the device.
        let wanted = u64::from(self.forward_fill).div_ceil(tiles.max(1) * u64::from(self.lanes));
        (voxels as u64).div_ceil(u64::from(self.chunk)).max(2 * wanted + 1)
    }

    /// Tiles of pairs, along x, of a rendering dispatch, by numbers of pairs, scanned and other points.
    pub fn tiles(&self, geometry: Geometry, [pairs, scanned, others]: [usize; 3]) -> u64 {
        let wide = (self.lanes * self.held) as usize;
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

    /// Bytes of shared memory that a workgroup of the forward kernel takes for one bin of all its columns, and for the arms
    /// of a block of voxels to a product's other points (`forward_product.comp`).
    fn shared_bytes(&self, product: bool) -> [u64; 2] {
        let [lanes, others] = [self.lanes, self.others_forward].map(u64::from);
        let arms = if product { 64 * 12 * others + 12 } else { 0 };
        [lanes.saturating_mul(others * 4), arms]
    }

    /// Bins of the widest columns that a device has shared memory for.
    fn widest_window(&self, product: bool, device: &Abilities) -> u32 {
        let [of_bin, arms] = self.shared_bytes(product);
        (u64::from(device.limits.shared_memory).saturating_sub(arms) / of_bin.max(1)) as u32
    }

    fn check(&self, product: bool, device: &Abilities, sizes: &Sizes) -> Result<()> {
        let bad = |what: String, hint: String| Err(Error::options(format!("sizes {sizes}: {what}"), hint));
        let none = sizes.named().into_iter().find(|(name, v)| *v == Some(0) && *name != "window");
        if let Some((name, _)) = none {
            return bad(format!("{name} is 0"), "give 1 or more, or leave it out".into());
        }
        let invocations = device.limits.workgroup_invocations;
        for (what, size) in
            [("lanes", Some(self.lanes)), ("voxels times slices", self.voxels.checked_mul(self.slices))]
        {
            if size.is_none_or(|s| s > invocations) {
                let most = format!("use at most {invocations}");
                return bad(format!("{what} are more invocations than a workgroup of this device has"), most);
            }
        }
        if self.chunk > OWNED_CHUNK {
            return bad(
                format!("a chunk of {} voxels is too long", self.chunk),
                format!("use at most {OWNED_CHUNK}"),
            );
        }
        let [of_bin, arms] = self.shared_bytes(product);
        // Without columns there is one word of them.
        let bytes = of_bin.saturating_mul(u64::from(self.window)).max(4).saturating_add(arms);
        if bytes > u64::from(device.limits.shared_memory) {
            return bad(
                format!(
                    "{bytes} bytes of shared memory, where a workgroup has {}",
                    device.limits.shared_memory
                ),
                "use fewer lanes or a smaller window".into(),
            );
        }
        Ok(())
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
                held: 1,
                chunk: 256,
                forward_fill: 0,
                group_losses: true,
                voxels,
                slices,
                fill,
                others_forward: 1,
                others_backward: 1,
                window: 0,
                window_span: 0,
                texels: false,
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

    #[test]
    fn sizes_are_written_as_they_are_read() {
        let sizes: Sizes = "lanes=32, window=0,slices=8".parse().unwrap();
        assert_eq!(sizes, Sizes { lanes: Some(32), window: Some(0), slices: Some(8), ..Sizes::default() });
        assert_eq!(sizes.to_string(), "lanes=32,window=0,slices=8");
        assert_eq!(sizes.to_string().parse::<Sizes>().unwrap(), sizes);
        for wrong in
            ["", "lanes", "lanes=", "lanes=-1", "lane=3", "lanes=1.5", "lanes=99999999999", "lanes=1,,"]
        {
            assert!(wrong.parse::<Sizes>().is_err(), "{wrong:?}");
        }
    }
}
