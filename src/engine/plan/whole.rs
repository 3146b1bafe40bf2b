//! What a solve needs of the device: levels, passes, buffers. Made before anything is allocated.
//!
//! A plan is independent of solvers. A solver opens one with what it asks for ([`Demand`]), adds what is its own, and finishes it.
//! A pass is one declared row: what schedules, plans, faults, reports, the profiler and the tests know of it. Every solver's folder
//! declares its passes with [`passes!`] in a file `passes.rs`; those that solvers share stand in [`super::passes`]. What a pass reads and
//! writes is not written down: `build.rs` reads it from the compiled module ([`Pass::reads`], [`Pass::writes`]).

use std::collections::BTreeMap;
use std::fmt;

use super::demand::Demand;
use super::divide::WorkDivision;
use super::domain::DomainCapacity;
use super::left_out::LeftOut;
use super::level::{Level, LevelPairs};
use super::levels::Levels;
use super::scene::ModelSizes;
use super::spots::SEEN;
use super::tuning::LONGEST_LOOP;
use crate::advice::{AdvicePart, advice};
use crate::gpu::{Abilities, Buffer, BufferPlan, Constant, Kernel, KernelCode, KernelRequest};
use crate::transport::kernels::{SceneData, buffer};
use crate::transport::{Grid, Model, Rendered, cells};
use crate::{Error, Result};

/// Levels, passes and buffers of one solve. Each part is made from those above it.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What the solver asks for.
    pub demand: Demand,
    /// What the plan has of the model.
    pub scene: ModelSizes,
    /// Grids with their pairs, from coarse to fine.
    pub levels: Levels,
    /// Room for active voxels.
    pub domain: DomainCapacity,
    /// How the work is divided.
    pub division: WorkDivision,
    /// Values of the constants that passes share.
    pub constants: BTreeMap<Constant, u32>,
    /// The solver's own uniform blocks, with their content.
    pub blocks: Vec<(Buffer, Vec<u8>)>,
    /// Passes in the order in which they are made.
    pub passes: Vec<&'static Pass>,
    /// The volume can be read back.
    pub with_volume: bool,
    /// Every buffer with size and place.
    pub buffers: Vec<BufferPlan>,
    /// What this scene does not need and what that saves, in words.
    pub left_out: Vec<String>,
}

impl Plan {
    /// Opens a plan of `model` on `grid`, whose lateral cells are the maps' pixels, for a device with these abilities. `room`: voxels
    /// that may be active at once, and touched at once, over the levels of the volume. The solver adds its constants and blocks, then
    /// its passes ([`Plan::add_passes`]), and finishes the plan ([`Plan::finish`]).
    ///
    /// # Errors
    /// The device does not offer the accumulation, or sizes exceed 32-bit indices.
    pub fn open(
        model: &Model,
        grid: Grid,
        scan: [usize; 2],
        demand: Demand,
        room: impl FnOnce(&[Level]) -> [usize; 2],
        device: &Abilities,
    ) -> Result<Plan> {
        check_sizes(model, &grid)?;
        let levels = Levels::of(model, grid, scan, &demand);
        let domain = DomainCapacity::of(room(&levels.volume), &demand);
        let mut plan = Plan {
            scene: ModelSizes::of(model, &grid, device.kind),
            division: WorkDivision::of(model, &levels, &domain, &demand, device)?,
            demand,
            levels,
            domain,
            constants: BTreeMap::new(),
            blocks: vec![],
            passes: vec![],
            with_volume: false,
            buffers: vec![],
            left_out: vec![],
        };
        plan.constants = plan.shared_constants();
        Ok(plan)
    }

    /// Adds those of the passes that the plan needs ([`Pass::when`]).
    pub fn add_passes(&mut self, passes: &[&'static Pass]) {
        let needed: Vec<_> = passes.iter().copied().filter(|pass| (pass.when)(self)).collect();
        self.passes.extend(needed);
    }

    /// Finishes the plan of a solver with its `own` device buffers and their bytes; those that all solvers have are added. With
    /// `with_volume` the volume can be read back.
    ///
    /// # Errors
    /// Sizes exceed 32-bit indices.
    pub fn finish(mut self, model: &Model, own: Vec<(Buffer, u64)>, with_volume: bool) -> Result<Plan> {
        self.check_pairs(model)?;
        self.with_volume = with_volume;
        self.buffers = self.list_buffers(own, with_volume);
        if self.demand.renders {
            self.leave_out(Plan::list_left_out);
        }
        Ok(self)
    }

    /// Lists what this scene does not need.
    pub fn leave_out(&mut self, list: impl FnOnce(&Plan, &mut LeftOut)) {
        let mut out = LeftOut { lines: std::mem::take(&mut self.left_out) };
        list(self, &mut out);
        self.left_out = out.lines;
    }

    /// The passes with their modules and constants, for reports.
    pub fn variants(&self) -> Vec<String> {
        let name = |pass: &&'static Pass| {
            let constants: Vec<_> = pass.values(self).iter().map(|(n, v)| format!("{n}={v}")).collect();
            format!("{}: {} {}", pass.kernel, (pass.code)(self).name, constants.join(" "))
                .trim_end()
                .to_string()
        };
        self.passes.iter().map(name).collect()
    }

    /// Cells of the histograms that `level` uses, with their padding.
    pub fn cells_at(&self, level: &Level) -> usize {
        cells(level.pairs, self.scene.bins)
    }

    /// The measured pairs of a level.
    pub fn measured(&self, level: &Level) -> LevelPairs {
        let count = level.pairs;
        let [scanned, others] = self.scene.geometry.counts(count, self.scene.scanned, self.scene.others);
        LevelPairs { count, scanned, others, wall: level.wall, scene: level.scene }
    }

    /// The constants of a level for some pairs; `whole` are those of the model.
    pub(crate) fn scene_of(&self, pairs: &LevelPairs, whole: SceneData) -> SceneData {
        let [capacity, touched_capacity] =
            [self.domain.capacity, self.domain.touched_capacity].map(|v| v as u32);
        let [count, scanned, others] = [pairs.count, pairs.scanned, pairs.others].map(|v| v as u32);
        SceneData { capacity, touched_capacity, pairs: count, scanned, others, ..whole }
    }

    /// The last level of the volume.
    pub fn finest(&self) -> &Level {
        self.levels.volume.last().expect("a plan has a level")
    }

    /// The buffer that gradients gather from.
    pub fn residual(&self) -> Buffer {
        match self.scene.pulse {
            _ if self.has_spots() => SEEN,
            0 => buffer::RESIDUAL,
            _ => buffer::SPREAD,
        }
    }

    /// Whether rendered values are added up in fixed point.
    pub fn fixed_point(&self) -> bool {
        self.division.accumulation.is_fixed()
    }

    /// Whether the forward kernel's private columns would be too narrow at `level`.
    pub fn forward_direct(&self, level: &Level) -> bool {
        // A path changes by no more than twice what the voxel moves.
        let span = 16.0 * level.grid.pitch.length() / self.scene.bin_width;
        span > f64::from(self.division.tuning.window_span)
    }

    /// The pairs that iteration `at` of the surface takes, if it does not take all.
    pub(crate) fn batch(&self, at: usize) -> Option<&Level> {
        let all = &self.levels.batches;
        all.get(at % all.len().max(1))
    }

    /// Stretches of pairs that have buffers of their own: batches, and pairs that are held out.
    pub(crate) fn stretches(&self) -> impl Iterator<Item = &Level> {
        self.levels.batches.iter().chain(&self.levels.held_out)
    }

    /// Bytes of a buffer; 0 if the plan does not have it.
    pub fn bytes_of(&self, buffer: Buffer) -> u64 {
        self.buffers.iter().find(|b| b.buffer == buffer).map_or(0, |b| b.bytes)
    }

    /// Bytes by buffer name.
    pub fn bytes(&self) -> BTreeMap<String, u64> {
        self.buffers.iter().map(|b| (b.buffer.to_string(), b.bytes)).collect()
    }
}

/// Checks sizes against the limits of kernels, but those of pairs ([`Plan::check_pairs`]).
///
/// # Errors
/// Sizes beyond what kernels index or loop over.
fn check_sizes(model: &Model, grid: &Grid) -> Result<()> {
    let longest = model.rendered.iter().flat_map(Rendered::all).map(|taps| taps.longest()).max().unwrap_or(0);
    if longest > LONGEST_LOOP {
        return Err(Error::memory(
            format!("a spot covers {longest} pairs: at most {LONGEST_LOOP} are supported"),
            advice!["use a larger " Stride],
        ));
    }
    // Kernels walk the depth of a column and the bins of a histogram in one loop each.
    for (what, count, hint) in [
        ("voxels deep", grid.n[2], &advice!["use a larger " DepthPitch " or a narrower " Gate][..]),
        ("bins long", model.bins, &advice!["use a narrower " Gate ", or add bins up before"]),
    ] {
        if count > LONGEST_LOOP {
            return Err(Error::memory(format!("{count} {what}: at most {LONGEST_LOOP} are supported"), hint));
        }
    }
    Ok(())
}

/// A pass, declared as one row.
pub struct Pass {
    /// What schedules, labels and timelines call it.
    pub kernel: Kernel,
    /// What the profiler's reports call it: every rendering begins with `forward`, every gather with `backward`.
    pub report: &'static str,
    /// The module that a plan runs it with.
    pub code: fn(&Plan) -> &'static KernelCode,
    /// Whether a plan that has these passes needs this one.
    pub when: fn(&Plan) -> bool,
    /// Constants of its own. The others that its module asks for are the plan's ([`Plan::constants`]).
    pub constants: &'static [(Constant, u32)],
    /// The voxels that it evaluates against every pair, if it evaluates pairs.
    pub pairs: Option<Voxels>,
    /// The values that are not finite that it can find.
    pub faults: &'static [Fault],
}

/// The voxels that a pass evaluates against every laser-sensor pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Voxels {
    /// Those in the active list.
    Active,
    /// Those of the grid that are not too near.
    Grid,
}

/// A value that is not finite, found by a kernel (`glsl/include/faults.glsl`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// Its bit in the trace. Lower bits come earlier in an iteration.
    pub bit: u32,
    /// What is not finite.
    pub what: &'static str,
    /// What may fix it.
    pub hint: &'static [AdvicePart],
}

/// Declares passes, and a list of all of them.
///
/// ```text
/// passes! {
///     /// Doc of the list.
///     pub static ALL;
///     /// Doc of the pass.
///     SAMPLE = Pass::of("sample", |_| &kernel::SAMPLE);
/// }
/// ```
macro_rules! passes {
    ($(#[$about:meta])* pub static $all:ident; $($(#[$doc:meta])* $name:ident = $row:expr;)*) => {
        $($(#[$doc])* pub static $name: $crate::engine::plan::Pass = $row;)*
        $(#[$about])*
        pub static $all: &[&$crate::engine::plan::Pass] = &[$(&$name),*];
    };
}

pub(crate) use passes;

impl Pass {
    /// A pass that evaluates no pairs, has no constants of its own, finds no faults, and is part of every plan.
    pub const fn of(name: &'static str, code: fn(&Plan) -> &'static KernelCode) -> Pass {
        Pass {
            kernel: Kernel::named(name),
            report: name,
            code,
            when: |_| true,
            constants: &[],
            pairs: None,
            faults: &[],
        }
    }

    /// The values of all constants that its module asks for, its own before the plan's. What neither sets keeps the
    /// default of the source.
    pub fn values(&self, plan: &Plan) -> Vec<(Constant, u32)> {
        let mut all = self.constants.to_vec();
        for (constant, _) in (self.code)(plan).constants {
            if let Some(value) = plan.constant(*constant).filter(|_| all.iter().all(|c| c.0 != *constant)) {
                all.push((*constant, value));
            }
        }
        all
    }

    /// Its kernel as an executor makes it.
    pub fn wanted(&self, plan: &Plan) -> KernelRequest<'static> {
        KernelRequest { kernel: self.kernel, code: (self.code)(plan), constants: self.values(plan) }
    }

    /// Blocks that it reads.
    pub fn reads(&self, plan: &Plan) -> impl Iterator<Item = Buffer> {
        (self.code)(plan).bindings.iter().filter(|b| b.reads).map(|b| b.block)
    }

    /// Blocks that it writes.
    pub fn writes(&self, plan: &Plan) -> impl Iterator<Item = Buffer> {
        (self.code)(plan).bindings.iter().filter(|b| b.writes).map(|b| b.block)
    }
}

impl From<&Pass> for Kernel {
    fn from(pass: &Pass) -> Kernel {
        pass.kernel
    }
}

impl PartialEq for Pass {
    fn eq(&self, other: &Pass) -> bool {
        self.kernel == other.kernel
    }
}

impl fmt::Debug for Pass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Pass({})", self.kernel)
    }
}
