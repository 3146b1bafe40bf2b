//! What a job needs of the device: levels, kernel variants, buffers. Made before anything is allocated.

use std::collections::BTreeMap;

use super::{NoiseTerm, PaperOptions};
use crate::gpu::{Abilities, Accumulations, BufferPlan, DeviceKind};
use crate::transport::{
    BRICK_VOXELS, Binning, Geometry, Gradient, Grid, Model, Reflectance, Sampling, cells,
};
use crate::{Error, Result};

mod buffers;
mod kernels;
mod left_out;
mod room;
mod stages;
mod tuning;

pub(super) use stages::AMPLE;
pub use tuning::{Accumulation, Sizes, Tuning};

/// One stage of the coarse-to-fine sequence: a lateral resolution, and as many of the pairs as it is solved with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    pub grid: Grid,
    /// The first so many.
    pub pairs: usize,
    /// Buffer that holds the wall points of these pairs.
    pub wall: &'static str,
    /// Buffer that holds its constants.
    pub scene: &'static str,
    /// Buffer that tells which bricks a bin can be reached from.
    pub reachable: &'static str,
}

const SCENES: [[&str; 3]; 8] = [
    ["scene_0", "reachable_0", "wall_0"],
    ["scene_1", "reachable_1", "wall_1"],
    ["scene_2", "reachable_2", "wall_2"],
    ["scene_3", "reachable_3", "wall_3"],
    ["scene_4", "reachable_4", "wall_4"],
    ["scene_5", "reachable_5", "wall_5"],
    ["scene_6", "reachable_6", "wall_6"],
    ["scene_7", "reachable_7", "wall_7"],
];

/// Constants of the surface's levels where its pixels are no voxels.
const SURFACE_SCENES: [&str; 8] = [
    "surface_scene_0",
    "surface_scene_1",
    "surface_scene_2",
    "surface_scene_3",
    "surface_scene_4",
    "surface_scene_5",
    "surface_scene_6",
    "surface_scene_7",
];

/// Where the points of all pairs are.
const WALL: &str = "wall";

/// Variants, sizes and buffers of one job.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub levels: Vec<Level>,
    pub pairs: usize,
    pub bins: usize,
    /// Metres of path.
    pub bin_width: f64,
    pub iterations: usize,
    /// Iterations of the surface after those of the volume.
    pub surface_iterations: usize,
    /// What it runs at, with a part of the pairs and then all, on pixels that may be smaller than the finest voxels; none
    /// without iterations.
    pub surface: Vec<Level>,
    /// Points that a pixel of the surface consists of: four, or one if it is small.
    pub points: usize,
    /// Residuals of the surface are averaged along time at first.
    pub blurred: bool,
    pub accumulation: Accumulation,
    pub continuous: bool,
    pub binning: Binning,
    pub gradient: Gradient,
    pub noise: NoiseTerm,
    pub initial_albedo: f32,
    /// The vector solver's kernels and buffers, not the paper's.
    pub vectors: bool,
    pub geometry: Geometry,
    pub reflectance: Reflectance,
    /// Places among the bins are found in parts: paths are more bins long than fp32 tells apart.
    pub fine: bool,
    /// Voxels are summed by runs before they are added to a bin, which takes more of them than fp32 sums bear.
    pub runs: bool,
    /// A sample may be so near to a wall point that the pair gives nothing.
    pub touching: bool,
    /// Taps of the instrument's pulse; none where paths are taken for sharp.
    pub pulse: usize,
    /// Normals of the wall are used.
    pub curved: bool,
    /// Wall points of the scanned side, and of the other.
    pub scanned: usize,
    pub others: usize,
    pub tuning: Tuning,
    /// Voxels that may be active at once.
    pub capacity: usize,
    /// Voxels that may be touched at once: active ones and, where samples are random, their neighbours.
    pub touched_capacity: usize,
    /// Weights of the reduction's Gaussian, 0..=radius.
    pub taps: Vec<f64>,
    pub buffers: Vec<BufferPlan>,
    /// Whether each brick of each level can reach a bin.
    pub reachable: Vec<Vec<bool>>,
    /// Bins of the capture, whether or not a voxel reaches them.
    pub all_bins: usize,
    /// What this scene does not need and what that saves, in words.
    pub left_out: Vec<String>,
}

/// What a solver asks of a plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    pub accumulation: Accumulation,
    pub coarse_to_fine: bool,
    pub iterations: usize,
    pub surface_iterations: usize,
    /// How many pixels of the surface are as wide as a voxel of the finest grid.
    pub pixels_per_voxel: usize,
    /// Points of such a pixel; `None` for as many as its size asks for.
    pub surface_points: Option<usize>,
    /// Whether its residuals are averaged along time.
    pub surface_blur: bool,
    pub sampling: Sampling,
    pub binning: Binning,
    pub gradient: Gradient,
    pub noise: NoiseTerm,
    pub initial_albedo: f64,
    pub smooth_sigma: f64,
    pub smooth_truncate: f64,
    pub vectors: bool,
    pub general: bool,
    pub sizes: Sizes,
    /// Share of the finest grid that may be active at once.
    pub room: Option<f64>,
    /// Every doubling comes with a reduction.
    pub reduces: bool,
}

impl From<&PaperOptions> for Wanted {
    fn from(o: &PaperOptions) -> Wanted {
        Wanted {
            accumulation: o.accumulation,
            coarse_to_fine: o.coarse_to_fine,
            iterations: o.iterations,
            surface_iterations: 0,
            pixels_per_voxel: 1,
            surface_points: None,
            surface_blur: false,
            sampling: o.sampling,
            binning: o.binning,
            gradient: o.gradient,
            noise: o.noise,
            initial_albedo: o.initial_albedo,
            smooth_sigma: o.smooth_sigma,
            smooth_truncate: o.smooth_truncate,
            vectors: false,
            general: o.general,
            sizes: o.sizes,
            room: o.room,
            reduces: o.reduce && o.double_every.is_multiple_of(o.reduce_every),
        }
    }
}

/// lavapipe stops an invocation silently after so many loop turns in all.
const LOOP_LIMIT: u32 = 65_535;

/// Bins of a histogram and voxels of a column: a kernel may pass over them twice.
const LONGEST_LOOP: usize = 32_767;

/// Bins of path as wide as which a pixel of the surface is small enough to be one point: paths over it differ by about as many
/// bins (benches/NOTES.md).
const SMALL_PIXEL: f64 = 2.0;

/// More additions than these to one fp32 sum may lose 1e-4 of it: equal addends round alike (docs/stability.md).
const VOXELS_PER_BIN: usize = 16_384;

impl Plan {
    /// Plans a solver for `model` on `grid` (whose lateral cells are the maps' pixels) for a device of such abilities.
    ///
    /// Errors: an accumulation that the device does not offer, sizes beyond 32-bit indices.
    pub fn new(
        model: &Model,
        grid: Grid,
        scan: [usize; 2],
        wanted: impl Into<Wanted>,
        device: &Abilities,
        with_volume: bool,
    ) -> Result<Plan> {
        let options: Wanted = wanted.into();
        let accumulation = choose(options.accumulation, device.kind, device.accumulations)?;
        // Kernels count three words of noise for a bin, and two of fixed point for a cell.
        if (model.pairs() as u64 * model.bins as u64) > 1 << 30 || model.cells() as u64 >= 1 << 31 {
            return Err(Error::memory(
                format!("{} pairs of {} bins are beyond 2^30 values", model.pairs(), model.bins),
                "use a larger --stride or a narrower --gate",
            ));
        }
        // Kernels walk the depth of a column and the bins of a histogram in one loop each.
        for (what, count, mend) in [
            ("voxels deep", grid.n[2], "use a larger --depth-pitch or a narrower --gate"),
            ("bins long", model.bins, "use a narrower --gate, or add bins up before"),
        ] {
            if count > LONGEST_LOOP {
                return Err(Error::memory(
                    format!("{count} {what}: at most {LONGEST_LOOP} are supported"),
                    mend,
                ));
            }
        }
        let levels =
            stages::stages(model, grid.coarser(options.pixels_per_voxel), scan, options.coarse_to_fine)?;
        let surface = if options.surface_iterations > 0 { stages::surface(&levels, grid) } else { vec![] };
        let small = grid.pitch.x.max(grid.pitch.y) <= SMALL_PIXEL * model.bin_width;
        let [capacity, touched_capacity] = room::capacities(&levels, &options);
        let tuning = Tuning::new(model, capacity, accumulation, device, &options.sizes)?;
        let tiles = match model.wall.geometry {
            Geometry::Product => {
                model.wall.scanned.len().div_ceil(tuning.lanes as usize)
                    * model.wall.others.len().div_ceil(tuning.others_forward as usize)
            }
            _ => model.pairs().div_ceil(tuning.lanes as usize),
        };
        if tiles > device.limits.groups[0] as usize {
            return Err(Error::memory(
                format!("{} pairs are more than this device's workgroup counts reach", model.pairs()),
                "use a larger --stride",
            ));
        }
        let mut plan = Plan {
            pairs: model.pairs(),
            bins: model.bins,
            bin_width: model.bin_width,
            iterations: options.iterations,
            surface_iterations: options.surface_iterations,
            surface,
            points: options.surface_points.unwrap_or(if small { 1 } else { 4 }),
            blurred: options.surface_blur && options.surface_iterations > 0,
            accumulation,
            continuous: options.sampling == Sampling::Continuous,
            binning: options.binning,
            gradient: options.gradient,
            noise: options.noise,
            initial_albedo: options.initial_albedo as f32,
            vectors: options.vectors,
            geometry: model.wall.geometry,
            reflectance: model.reflectance,
            fine: model.is_fine(&grid),
            runs: false,
            touching: true,
            pulse: model.pulse.as_ref().map_or(0, |p| p.weights.len()),
            curved: model.wall.normals.is_some(),
            scanned: model.wall.scanned.len(),
            others: model.wall.others.len(),
            tuning,
            capacity,
            touched_capacity,
            taps: crate::transport::twin::taps(options.smooth_sigma, options.smooth_truncate),
            buffers: vec![],
            reachable: vec![],
            all_bins: model.elements / model.pairs().max(1),
            left_out: vec![],
            levels,
        };
        let reachable = |l: &Level| match options.general {
            true => vec![true; l.grid.storage() / BRICK_VOXELS],
            false => model.reachable_bricks(&l.grid),
        };
        // Fixed point adds without rounding, and a window is a second level by itself.
        plan.runs =
            !plan.fixed_point() && plan.tuning.window == 0 && plan.capacity / model.bins > VOXELS_PER_BIN;
        plan.touching =
            options.general || plan.levels.iter().chain(&plan.surface).any(|l| model.touches(&l.grid));
        plan.reachable = plan.levels.iter().map(reachable).collect();
        plan.buffers = plan.list_buffers(with_volume);
        plan.left_out = plan.list_left_out();
        Ok(plan)
    }

    /// Cells of the histograms that `level` uses, with their padding.
    pub fn cells_at(&self, level: &Level) -> usize {
        cells(level.pairs, self.bins)
    }

    pub fn finest(&self) -> &Level {
        self.levels.last().expect("a plan has a level")
    }

    /// The buffer that gradients gather from.
    pub fn residual(&self) -> &'static str {
        if self.pulse > 0 { "spread" } else { "residual" }
    }

    pub fn fixed_point(&self) -> bool {
        matches!(self.accumulation, Accumulation::Fixed | Accumulation::Fixed32)
    }

    /// Dispatches that one forward pass takes at `level`.
    pub fn forward_sets(&self, level: &Level) -> u32 {
        if self.accumulation != Accumulation::Owned {
            return 1;
        }
        level.grid.storage().min(self.capacity).div_ceil(self.tuning.chunk as usize) as u32
    }

    /// Whether the forward kernel's private columns would be too narrow at `level`.
    pub fn forward_direct(&self, level: &Level) -> bool {
        // A path changes by no more than twice what the voxel moves.
        let span = 16.0 * level.grid.pitch.length() / self.bin_width;
        span > f64::from(self.tuning.window_span)
    }

    /// The grid whose lateral cells are the maps' pixels.
    pub fn maps_grid(&self) -> &Grid {
        self.surface.last().map_or(&self.finest().grid, |l| &l.grid)
    }

    /// Pixels of the maps side by side in a voxel of the finest grid.
    pub fn factor(&self) -> usize {
        self.maps_grid().n[0] / self.finest().grid.n[0]
    }

    /// Those levels of the surface that are none of the volume's.
    pub(super) fn surface_only(&self) -> impl Iterator<Item = &Level> {
        self.surface.iter().filter(|l| !self.levels.contains(l))
    }

    /// Pixels that the surface may have: all of the maps', as far as there is room for the points of each.
    pub fn pixels(&self) -> usize {
        let [x, y, _] = self.maps_grid().n;
        if self.surface.is_empty() { 0 } else { (x * y).min(self.capacity / self.points) }
    }

    /// Weights of the noise term.
    pub fn noise_weights(&self) -> usize {
        match self.noise {
            NoiseTerm::Off => 0,
            NoiseTerm::Bin => self.pairs * self.bins,
            NoiseTerm::Histogram => self.pairs,
        }
    }

    /// Bytes by buffer name.
    pub fn bytes(&self) -> BTreeMap<String, u64> {
        self.buffers.iter().map(|b| (b.name.clone(), b.bytes)).collect()
    }
}

fn choose(wanted: Accumulation, kind: DeviceKind, offered: Accumulations) -> Result<Accumulation> {
    Ok(match wanted {
        Accumulation::Auto if kind == DeviceKind::Cpu => Accumulation::Owned,
        Accumulation::Auto if offered.float => Accumulation::Float,
        Accumulation::Auto => Accumulation::Cas,
        Accumulation::Fixed if !offered.int64 => Accumulation::Fixed32,
        Accumulation::Float if !offered.float => {
            return Err(Error::options(
                "--accumulation float: this device has no fp32 atomics (VK_EXT_shader_atomic_float)",
                "leave --accumulation out, or choose fixed or cas",
            ));
        }
        other => other,
    })
}
