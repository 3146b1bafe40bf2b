//! What a job needs of the device: levels, kernel variants, buffers. Made before anything is allocated.

use std::collections::BTreeMap;

use super::{Accumulation, NoiseTerm, PaperOptions};
use crate::gpu::{Abilities, Accumulations, BufferPlan, DeviceKind, Executor, KernelCode, Place};
use crate::transport::kernels::*;
use crate::transport::{BRICK_VOXELS, Binning, Gradient, Grid, Model, Sampling};
use crate::{Error, Result};

/// One lateral resolution of the coarse-to-fine sequence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    pub grid: Grid,
    /// Buffer that holds its constants.
    pub scene: &'static str,
}

const SCENES: [&str; 8] =
    ["scene_0", "scene_1", "scene_2", "scene_3", "scene_4", "scene_5", "scene_6", "scene_7"];

/// Workgroup and chunk sizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tuning {
    /// Forward: pairs of a workgroup.
    pub lanes: u32,
    /// Forward: voxels of a workgroup.
    pub chunk: u32,
    /// Backward: voxels of a workgroup.
    pub voxels: u32,
    /// Backward: lanes that share a voxel.
    pub slices: u32,
}

/// Variants, sizes and buffers of one job.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub levels: Vec<Level>,
    pub pairs: usize,
    pub bins: usize,
    pub iterations: usize,
    pub accumulation: Accumulation,
    pub continuous: bool,
    pub binning: Binning,
    pub gradient: Gradient,
    pub noise: NoiseTerm,
    pub initial_albedo: f32,
    /// The vector solver's kernels and buffers, not the paper's.
    pub vectors: bool,
    /// The vector solver's surfaces shine with both cosines and the wall's.
    pub lambertian: bool,
    pub tuning: Tuning,
    /// Weights of the reduction's Gaussian, 0..=radius.
    pub taps: Vec<f64>,
    pub buffers: Vec<BufferPlan>,
    /// What this scene does not need, in words.
    pub left_out: Vec<String>,
}

/// What a solver asks of a plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    pub accumulation: Accumulation,
    pub coarse_to_fine: bool,
    pub iterations: usize,
    pub sampling: Sampling,
    pub binning: Binning,
    pub gradient: Gradient,
    pub noise: NoiseTerm,
    pub initial_albedo: f64,
    pub smooth_sigma: f64,
    pub smooth_truncate: f64,
    pub vectors: bool,
    pub lambertian: bool,
}

impl From<&PaperOptions> for Wanted {
    fn from(o: &PaperOptions) -> Wanted {
        Wanted {
            accumulation: o.accumulation,
            coarse_to_fine: o.coarse_to_fine,
            iterations: o.iterations,
            sampling: o.sampling,
            binning: o.binning,
            gradient: o.gradient,
            noise: o.noise,
            initial_albedo: o.initial_albedo,
            smooth_sigma: o.smooth_sigma,
            smooth_truncate: o.smooth_truncate,
            vectors: false,
            lambertian: false,
        }
    }
}

impl Plan {
    /// Plans a solver for `model` on `grid` (the final one) for a device of such abilities.
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
        let elements = model.pairs() as u64 * model.bins as u64;
        if elements > 1 << 30 {
            return Err(Error::memory(
                format!("{} pairs of {} bins are beyond 2^30 values", model.pairs(), model.bins),
                "use a larger --stride or a narrower --gate",
            ));
        }
        let levels = levels(grid, scan, options.coarse_to_fine)?;
        let owned = accumulation == Accumulation::Owned;
        let cpu = device.kind == DeviceKind::Cpu;
        // On a CPU a workgroup is one core's work and a subgroup is one vector: small groups, long chunks.
        let tuning = if cpu {
            Tuning { lanes: 8, chunk: if owned { OWNED_CHUNK } else { 4096 }, voxels: 64, slices: 1 }
        } else {
            Tuning { lanes: 64, chunk: if owned { OWNED_CHUNK } else { 256 }, voxels: 32, slices: 4 }
        };
        // lavapipe stops silently after 65,535 loop turns of an invocation.
        assert!(tuning.chunk.max(OWNED_CHUNK) < 65_535 && PAIR_CHUNK / tuning.slices < 65_535);
        let chunks = grid.storage().div_ceil(tuning.chunk as usize);
        if !owned && chunks > device.limits.groups[1] as usize {
            return Err(Error::memory(
                format!("{} voxels are more than this device's workgroup counts reach", grid.storage()),
                "use a smaller --lateral or a larger --depth-pitch",
            ));
        }
        let mut plan = Plan {
            levels,
            pairs: model.pairs(),
            bins: model.bins,
            iterations: options.iterations,
            accumulation,
            continuous: options.sampling == Sampling::Continuous,
            binning: options.binning,
            gradient: options.gradient,
            noise: options.noise,
            initial_albedo: options.initial_albedo as f32,
            vectors: options.vectors,
            lambertian: options.lambertian,
            tuning,
            taps: crate::transport::twin::taps(options.smooth_sigma, options.smooth_truncate),
            buffers: vec![],
            left_out: vec![],
        };
        plan.buffers = plan.list_buffers(with_volume);
        plan.left_out = plan.list_left_out();
        Ok(plan)
    }

    pub fn finest(&self) -> &Level {
        self.levels.last().expect("a plan has a level")
    }

    /// A buffer of a volume's size that is free while the domain doubles: Adam's first moment, which is at rest
    /// then, or the iterate before.
    pub fn spare(&self) -> &'static str {
        if self.vectors { "before" } else { "moment_first" }
    }

    pub fn fixed_point(&self) -> bool {
        matches!(self.accumulation, Accumulation::Fixed | Accumulation::Fixed32)
    }

    /// Dispatches that one forward pass takes at `level`.
    pub fn forward_sets(&self, level: &Level) -> u32 {
        if self.accumulation != Accumulation::Owned {
            return 1;
        }
        level.grid.storage().div_ceil(self.tuning.chunk as usize) as u32
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

    fn list_buffers(&self, with_volume: bool) -> Vec<BufferPlan> {
        let grid = &self.finest().grid;
        let voxels = grid.storage() as u64;
        let columns = (grid.n[0] * grid.n[1] * 32) as u64;
        let elements = (self.pairs * self.bins) as u64;
        let sets = self.forward_sets(self.finest());
        let device = [
            ("wall", self.pairs as u64 * 16),
            ("measured", elements * 4),
            ("histograms", elements * if self.fixed_point() { 8 } else { 4 }),
            ("residual", elements * 4),
            ("noise_state", self.noise_weights() as u64 * 12),
            ("raw", voxels * 16),
            (self.spare(), voxels * 16),
            ("moment_second", if self.vectors { 0 } else { voxels * 16 }),
            ("bounds", if self.vectors { voxels * 8 } else { 0 }),
            ("hat_taps", if self.vectors { self.bins as u64 * 4 + 4 } else { 0 }),
            ("momentum", u64::from(MOMENTUM) * 4),
            (
                "against_partials",
                if self.vectors { voxels.div_ceil(u64::from(self.tuning.voxels)) * 4 } else { 0 },
            ),
            ("mask", voxels / 8),
            ("touched_mask", voxels / 8),
            ("brick_offsets", voxels / BRICK_VOXELS as u64 * 4),
            ("active_voxels", voxels * 4),
            ("touched_voxels", if self.continuous { voxels * 4 } else { 0 }),
            ("slot_of", voxels * 4),
            ("sample_points", voxels * 16),
            ("sample_normals", voxels * 16),
            ("gradient", voxels * 16),
            ("taps", (self.taps.len() + 1) as u64 * 4),
            ("counts", u64::from(COUNTS) * 4),
            ("arguments", u64::from(ARGUMENTS_FORWARD + sets) * 12),
            ("l1_partials", voxels.div_ceil(u64::from(WORKGROUP.min(self.tuning.voxels))) * 4),
            ("loss_partials", elements.div_ceil(u64::from(WORKGROUP)) * 8),
            ("columns", columns),
        ];
        let mut all: Vec<_> = device.iter().map(|(n, b)| BufferPlan::new(n, *b, Place::Device)).collect();
        for level in &self.levels {
            all.push(BufferPlan::new(level.scene, size_of::<SceneData>() as u64, Place::Device));
        }
        all.push(BufferPlan::new("upload", elements * 4, Place::Upload));
        all.push(BufferPlan::new(
            "trace",
            (self.iterations * TRACE_ROW as usize * 4) as u64,
            Place::Readback,
        ));
        all.push(BufferPlan::new("columns_host", columns, Place::Readback));
        if with_volume {
            all.push(BufferPlan::new("raw_host", voxels * 16, Place::Readback));
            all.push(BufferPlan::new("mask_host", voxels / 8, Place::Readback));
        }
        all
    }

    fn list_left_out(&self) -> Vec<String> {
        let mut out = vec![
            "the second distance of a pair: laser and sensor point are one".to_string(),
            "the wall's normals: the cosine model does not ask for them".to_string(),
        ];
        if self.noise == NoiseTerm::Off {
            out.push("the noise term: its weights, their moments and its kernel".into());
        }
        if self.vectors {
            out.push("the optimiser's moments: the step comes from a bound".into());
        }
        if !self.continuous {
            out.push("random sampling: interpolation, its adjoint and the list of touched voxels".into());
        }
        if self.gradient == Gradient::Published {
            out.push("the falloff in the gradient".into());
        }
        if self.levels.len() == 1 {
            out.push("doubling of the lateral resolution: the first grid is the last".into());
        }
        out
    }

    /// Names of the variants that run, for reports.
    pub fn variants(&self) -> Vec<String> {
        let name = |k: &KernelUse| {
            let constants: Vec<_> = k.constants.iter().map(|(n, v)| format!("{n}={v}")).collect();
            format!("{}: {} {}", k.name, k.code, constants.join(" ")).trim_end().to_string()
        };
        self.kernels().iter().map(name).collect()
    }

    fn kernels(&self) -> Vec<KernelUse> {
        let t = self.tuning;
        let continuous = u32::from(self.continuous);
        let split = u32::from(self.binning == Binning::Linear);
        let exact = u32::from(self.gradient == Gradient::Exact);
        let noise = match self.noise {
            NoiseTerm::Off => 0,
            NoiseTerm::Bin => 1,
            NoiseTerm::Histogram => 2,
        };
        let forward = match self.accumulation {
            Accumulation::Float => "forward_float",
            Accumulation::Fixed => "forward_fixed64",
            Accumulation::Fixed32 => "forward_fixed32",
            Accumulation::Cas => "forward_cas",
            Accumulation::Owned | Accumulation::Auto => "forward_owned",
        };
        let owned = u32::from(self.accumulation == Accumulation::Owned);
        let sets = self.forward_sets(self.finest());
        let u = |name, code, constants: &[(&'static str, u32)]| KernelUse {
            name,
            code,
            constants: constants.to_vec(),
        };
        let residual = if self.fixed_point() { "residual_fixed" } else { "residual" };
        let vectors = u32::from(self.vectors);
        let tile_constants = [("LANES", t.lanes), ("CHUNK", t.chunk), ("SPLIT", split)];
        let lambertian = ("LAMBERTIAN", u32::from(self.lambertian));
        let mut forward_constants = tile_constants.to_vec();
        forward_constants.push(lambertian);
        let gather_constants =
            [("VOXELS", t.voxels), ("SLICES", t.slices), ("SPLIT", split), ("EXACT", exact)];
        let summed = if self.vectors { t.voxels } else { WORKGROUP };
        let mut all = vec![
            u("forward", forward, &forward_constants),
            u("residual", residual, &[("NOISE", noise), ("WEIGHTED", vectors)]),
            u("finish", "finish", &[("ACCELERATED", vectors), ("VOXELS", summed)]),
            u("gaussian_y", "gaussian", &[("AXIS", 1), ("FIRST", 0), ("LAST", 0)]),
            u("gaussian_z", "gaussian", &[("AXIS", 2), ("FIRST", 0), ("LAST", 1)]),
            u("threshold", "threshold", &[]),
            u("compact_count", "compact_count", &[]),
            u("compact_scan_active", "compact_scan", &[("TOTAL", COUNT_ACTIVE)]),
            u("compact_scan_touched", "compact_scan", &[("TOTAL", COUNT_TOUCHED)]),
            u("compact_scatter_active", "compact_scatter", &[("WRITE_SLOTS", 1)]),
            u(
                "arguments",
                "arguments",
                &[
                    ("OWNED", owned),
                    ("LANES", t.lanes),
                    ("CHUNK", t.chunk),
                    ("VOXELS", t.voxels),
                    ("FORWARD_SETS", sets),
                ],
            ),
            u("double_raw", "double_raw", &[]),
            u("double_domain", "double_domain", &[]),
            u("extract", "extract", &[("VECTORS", vectors)]),
        ];
        if self.vectors {
            let mut bound = tile_constants.to_vec();
            bound.push(("ISOTROPIC", 1));
            all.extend([
                u("gaussian_x_volume", "gaussian", &[("AXIS", 0), ("FIRST", 0), ("LAST", 0)]),
                u("gaussian_x", "gaussian", &[("AXIS", 0), ("FIRST", 2), ("LAST", 0)]),
                u("forward_bound", forward, &bound),
                u("residual_bound", residual, &[("WEIGHTED", 1), ("MEASURE", 0)]),
                u("bound_step", "bound", &[("SPLIT", split), ("WHAT", 0)]),
                u("bound_noise", "bound", &[("SPLIT", split), ("WHAT", 1)]),
                u("variance", "variance", &[]),
                u("filter", "filter", &[]),
                u("backproject", "backproject", &[]),
                u("settle", "settle", &[]),
                u("points", "points", &[]),
                u("extrapolate", "extrapolate", &[]),
                u("step", "step", &[&gather_constants[..], &[lambertian]].concat()),
            ]);
            return all;
        }
        all.extend([
            u("initialise", "initialise", &[("ALBEDO_SPAN", self.initial_albedo.to_bits())]),
            u("sample", "sample", &[("CONTINUOUS", continuous)]),
            u("backward", "backward", &gather_constants),
            u("update", "update", &[("CONTINUOUS", continuous)]),
            u("gaussian_x", "gaussian", &[("AXIS", 0), ("FIRST", 1), ("LAST", 0)]),
            u("dilate", "dilate", &[]),
            u("compact_scatter_touched", "compact_scatter", &[("WRITE_SLOTS", 0)]),
        ]);
        if self.noise != NoiseTerm::Off {
            all.push(u(
                "noise",
                "noise",
                &[("PER_HISTOGRAM", u32::from(self.noise == NoiseTerm::Histogram))],
            ));
        }
        all
    }

    /// Makes the plan's kernels.
    pub fn add_kernels(&self, executor: &mut Executor<'_>) -> Result<()> {
        for k in self.kernels() {
            executor.add_kernel(k.name, code(k.code), &k.constants)?;
        }
        Ok(())
    }
}

struct KernelUse {
    name: &'static str,
    code: &'static str,
    constants: Vec<(&'static str, u32)>,
}

fn code(name: &str) -> &'static KernelCode {
    KERNELS.iter().find(|k| k.name == name).unwrap_or_else(|| panic!("no kernel variant {name} in the table"))
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

/// From the scan's resolution (or more, where the final one is no power of two of it) by doubling.
fn levels(finest: Grid, scan: [usize; 2], coarse_to_fine: bool) -> Result<Vec<Level>> {
    let mut factor = 1;
    while coarse_to_fine
        && finest.n[0].is_multiple_of(factor * 2)
        && finest.n[0] / (factor * 2) >= scan[0].max(scan[1])
    {
        factor *= 2;
    }
    let count = factor.ilog2() as usize + 1;
    if count > SCENES.len() {
        return Err(Error::options(
            format!(
                "{count} levels from a scan of {} x {} to {} lateral voxels",
                scan[0], scan[1], finest.n[0]
            ),
            "use a smaller --lateral, or --no-coarse-to-fine",
        ));
    }
    Ok((0..count).map(|i| Level { grid: finest.coarser(factor >> i), scene: SCENES[i] }).collect())
}
