//! What a solve needs of the device: levels, passes, buffers. Made before anything is allocated.
//!
//! A plan knows no solver. A solver's options say what they need ([`Needs`]), and the plan adds what every solver has.

use std::collections::BTreeMap;

use crate::advice::advice;
use crate::gpu::{Abilities, Accumulations, Buffer, BufferPlan, Constant, DeviceKind, KernelCode};
use crate::transport::kernels::{SceneData, buffer};
use crate::transport::{BRICK_VOXELS, Geometry, Gradient, Grid, Model, Reflectance, Rendered, cells};
use crate::{Error, Result};

mod buffers;
mod constants;
mod divide;
mod left_out;
mod levels;
mod needs;
pub(in crate::solve) mod parts;
pub(in crate::solve) mod pass;
pub mod passes;
mod share;
mod spots;
mod tuning;

pub use buffers::{COLUMNS_HOST, MASK_HOST, RAW_HOST, RESIDUAL_HOST, SMOOTH, SMOOTH_SPARE, UPLOAD};
pub use left_out::{LeftOut, mebibytes};
pub use levels::{AMPLE, Level, Pairs, first_of, pairs_for, sum_of};
pub use needs::{Demand, LentRows, Needs};
pub use parts::PairPart;
pub use pass::{Fault, Pass, Twin, Value, Voxels};
pub use share::Share;
pub use spots::{BETWEEN, SEEN, Spots};
pub use tuning::{Accumulation, Sizes, Tuning};

/// Levels, passes and buffers of one solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The coarse-to-fine sequence of the volume.
    pub levels: Vec<Level>,
    /// The level on the maps' pixels, for what follows the volume; `None` if nothing does.
    pub pixel_level: Option<Level>,
    /// Its pairs in batches, which iterations take in turns; none if each takes all.
    pub batches: Vec<Level>,
    /// What is rendered for every number of pairs; none where laser and sensor see points.
    pub spots: Vec<Spots>,
    /// The grid whose lateral cells are the maps' pixels.
    pub maps: Grid,
    /// Pairs of the model.
    pub pairs: usize,
    /// Pairs of the capture that it leaves out.
    pub unused: usize,
    /// Bins of a histogram. Levels may have fewer, wider ones.
    pub bins: usize,
    /// Metres of path.
    pub bin_width: f64,
    /// Iterations of the volume, and of what follows it.
    pub iterations: [usize; 2],
    /// How rendered values are added up; never `Auto`.
    pub accumulation: Accumulation,
    /// Neighbours of active voxels have state, too.
    pub has_rim: bool,
    /// Which gradient is gathered.
    pub gradient: Gradient,
    /// How pairs are made of wall points.
    pub geometry: Geometry,
    /// How surfaces reflect.
    pub reflectance: Reflectance,
    /// How they reflect in the volume, if a surface follows it.
    pub volume_reflectance: Reflectance,
    /// Bin positions are computed in parts: paths span more bins than fp32 resolves.
    pub fine: bool,
    /// Distances take a step of Newton: the device's inverse roots may be too rough for so many bins.
    pub polished: bool,
    /// Voxels are summed in runs before they are added to a bin: more of them go into one bin than an fp32 sum bears.
    pub runs: bool,
    /// A sample may be so near to a wall point that the pair gives nothing.
    pub touching: bool,
    /// Taps of the instrument's pulse; 0 if no pulse is known.
    pub pulse: usize,
    /// Standard deviation of the pulse, metres of path; 0 if no pulse is known.
    pub pulse_deviation: f64,
    /// The objective takes down what changes slowly along time: [`Model::high_pass`].
    pub high_pass: bool,
    /// Sets of taps for residuals.
    pub tap_sets: usize,
    /// Words of each set of taps.
    pub tap_room: usize,
    /// Rows of counts that may lie in a caller's buffer.
    pub lent: Option<LentRows>,
    /// Normals of the wall are used.
    pub curved: bool,
    /// Wall points of the scanned side.
    pub scanned: usize,
    /// Wall points of the other side.
    pub others: usize,
    /// Workgroup and chunk sizes.
    pub tuning: Tuning,
    /// Voxel-pair evaluations of a dispatch at most: see [`crate::gpu::Limits::work`].
    pub work: u64,
    /// The most cells of a part where the pairs of large levels are cut into parts ([`Plan::within`]); `None`: no level is.
    pub cut: Option<usize>,
    /// The share of the pairs that its device takes, if several share them ([`Plan::shared`]).
    pub share: Option<Share>,
    /// The volume can be read back.
    pub with_volume: bool,
    /// The most texels that passes over pairs may see in a buffer; 0 if they are to see none.
    pub texels: u64,
    /// The most workgroups of a dispatch along x.
    pub tiles: u32,
    /// Voxels that may be active at once.
    pub capacity: usize,
    /// Voxels that may be touched at once: active ones and, where they have state, their neighbours.
    pub touched_capacity: usize,
    /// Weights of the reduction's Gaussian, 0..=radius.
    pub taps: Vec<f64>,
    /// Decays of Adam's first and second moment.
    pub betas: [f64; 2],
    /// Two buffers for a number per voxel while the domain changes.
    pub volumes: [Buffer; 2],
    /// Values of the constants that passes share.
    pub constants: BTreeMap<Constant, u32>,
    /// Passes in the order in which they are made.
    pub passes: Vec<&'static Pass>,
    /// Every buffer with size and place.
    pub buffers: Vec<BufferPlan>,
    /// Whether each brick can reach a bin, by level.
    pub reachable: Vec<Vec<bool>>,
    /// Bins of the capture, whether or not a voxel reaches them.
    pub all_bins: usize,
    /// What this scene does not need and what that saves, in words.
    pub left_out: Vec<String>,
}

/// lavapipe silently stops an invocation after this many loop turns in all.
const LOOP_LIMIT: u32 = 65_535;

/// The most bins of a histogram and voxels of a column: a kernel may pass over them twice.
const LONGEST_LOOP: usize = 32_767;

/// The most additions to one fp32 sum: more may lose 1e-4 of it, as equal addends round alike (docs/stability.md).
const VOXELS_PER_BIN: usize = 16_384;

impl Plan {
    /// Plans a solver for `model` on `grid`, whose lateral cells are the maps' pixels, for a device with these
    /// abilities. With `with_volume` the volume can be read back.
    ///
    /// # Errors
    /// The device does not offer the accumulation, or sizes exceed 32-bit indices.
    pub fn new(
        model: &Model,
        grid: Grid,
        scan: [usize; 2],
        needs: &dyn Needs,
        device: &Abilities,
        with_volume: bool,
    ) -> Result<Plan> {
        let demand = needs.demand();
        let accumulation = choose(demand.accumulation, device.kind, device.accumulations)?;
        check_sizes(model, &grid)?;
        let mut levels = levels::Sequence::of(model, grid, scan, &demand).levels();
        let mut pixel_level = levels::of_pixels(model, &levels, grid).filter(|_| demand.iterations[1] > 0);
        let spots = spots::cover(model, &mut levels, pixel_level.as_mut_slice());
        let maps = pixel_level.as_ref().or(levels.last()).map_or(grid, |l| l.grid);
        let [capacity, touched_capacity] = needs.capacities(&levels);
        let mut tuning = Tuning::new(model, capacity, accumulation, device, &demand.sizes)?;
        let texels = if tuning.texels && !demand.general { device.limits.texels } else { 0 };
        tuning.texels = texels_at_most(model, touched_capacity) <= texels;
        let pulse = model.pulse.as_ref().map_or(0, |p| p.weights.len());
        let [more_sets, more_bins] = demand.more_taps;
        // Fixed point adds without rounding, and a window already sums in two levels.
        let fixed = matches!(accumulation, Accumulation::Fixed | Accumulation::Fixed32);
        let crowded = |l: &Level| capacity.min(l.grid.storage()) / l.bins > VOXELS_PER_BIN;
        let runs = !fixed && tuning.window == 0 && levels.iter().any(crowded);
        let mut plan = Plan {
            touching: demand.general || levels.iter().chain(&pixel_level).any(|l| model.touches(&l.grid)),
            reachable: levels.iter().map(|l| reachable(model, &l.grid, demand.general)).collect(),
            levels,
            batches: levels::in_batches(model, pixel_level.as_ref()),
            pixel_level,
            spots,
            maps,
            pairs: model.pairs(),
            unused: model.unused,
            bins: model.bins,
            bin_width: model.bin_width,
            iterations: demand.iterations,
            accumulation,
            has_rim: demand.has_rim,
            gradient: demand.gradient,
            geometry: model.wall.geometry,
            reflectance: model.reflectance,
            volume_reflectance: match model.reflectance {
                Reflectance::Lambertian if demand.cosine_volume => Reflectance::Cosine,
                other => other,
            },
            fine: model.is_fine(&grid),
            polished: device.kind != DeviceKind::Cpu && model.is_polished(&grid),
            runs,
            pulse,
            pulse_deviation: model.pulse.as_ref().map_or(0.0, |p| p.deviation() * model.bin_width),
            high_pass: model.high_pass.is_some(),
            tap_sets: if pulse > 0 || more_sets > 0 { 1 + more_sets } else { 0 },
            // The same for all pulses but the longest, so that a plan made before the pulse is found stays valid.
            tap_room: (pulse + 2 + more_bins).max(256),
            lent: demand.lent,
            curved: model.wall.normals.is_some(),
            scanned: model.wall.scanned.len(),
            others: model.wall.others.len(),
            tuning,
            work: device.limits.work,
            cut: None,
            share: None,
            with_volume,
            texels,
            tiles: device.limits.groups[0],
            capacity,
            touched_capacity,
            taps: crate::transport::twin::taps(demand.smooth[0], demand.smooth[1]),
            betas: needs.betas(),
            volumes: [SMOOTH, SMOOTH_SPARE],
            constants: BTreeMap::new(),
            passes: vec![],
            buffers: vec![],
            all_bins: model.elements / model.pairs().max(1),
            left_out: vec![],
        };
        plan.volumes = needs.volumes(&plan);
        plan.constants = plan.shared_constants(demand.binning);
        plan.constants.extend(needs.constants(&plan));
        let all = passes::ALL.iter().copied().chain(needs.passes());
        plan.passes = all.filter(|pass| (pass.when)(&plan)).collect();
        plan.cut_to_indices(model)?;
        plan.buffers = plan.list_buffers(needs.buffers(&plan), with_volume);
        plan.left_out = plan.lines_of_left_out(needs);
        Ok(plan)
    }

    /// What this scene does not need, in words.
    fn lines_of_left_out(&self, needs: &dyn Needs) -> Vec<String> {
        let mut left_out = LeftOut::default();
        self.list_left_out(&mut left_out);
        needs.left_out(self, &mut left_out);
        left_out.lines
    }

    /// The same plan for the `model` of as many other pairs: only what is rendered for their spots differs.
    pub fn of_other_pairs(&self, model: &Model, needs: &dyn Needs) -> Plan {
        let mut plan = self.clone();
        plan.spots = spots::cover(model, &mut plan.levels, plan.pixel_level.as_mut_slice());
        plan.buffers = plan.list_buffers(needs.buffers(&plan), false);
        plan
    }

    /// Makes every buffer as large as that of another plan with the same buffers.
    pub fn make_room(&mut self, other: &Plan) {
        for own in &mut self.buffers {
            let same = other.buffers.iter().find(|b| b.buffer == own.buffer);
            own.bytes = same.map_or(own.bytes, |b| b.bytes.max(own.bytes));
        }
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
        cells(level.pairs, level.bins)
    }

    /// The measured pairs of a level that are on this device.
    pub fn measured(&self, level: &Level) -> Pairs {
        let count = self.own(level.first + level.pairs) - self.own(level.first);
        let [scanned, others] = self.geometry.counts(count, self.scanned, self.others);
        Pairs { count, scanned, others, wall: level.wall, scene: level.scene }
    }

    /// The constants of a level for some of its pairs; `whole` are those of the model.
    pub(in crate::solve) fn scene_of(&self, level: &Level, pairs: &Pairs, whole: SceneData) -> SceneData {
        let [capacity, touched_capacity] = [self.capacity, self.touched_capacity].map(|v| v as u32);
        let [from_wide, from_deep] = level.parts.map(|v| v as u32);
        let [count, scanned, others] = [pairs.count, pairs.scanned, pairs.others].map(|v| v as u32);
        let numbers = SceneData { pairs: count, scanned, others, ..whole };
        SceneData { capacity, touched_capacity, from_wide, from_deep, ..numbers }
    }

    /// The last level of the volume, with all pairs.
    pub fn finest(&self) -> &Level {
        self.levels.last().expect("a plan has a level")
    }

    /// The buffer that gradients gather from.
    pub fn residual(&self) -> Buffer {
        match self.pulse {
            _ if self.has_spots() => SEEN,
            0 => buffer::RESIDUAL,
            _ => buffer::SPREAD,
        }
    }

    /// Whether rendered values are added up in fixed point.
    pub fn fixed_point(&self) -> bool {
        matches!(self.accumulation, Accumulation::Fixed | Accumulation::Fixed32)
    }

    /// The variant of a module that sees what it reads for every pair as this plan does ([`Tuning::texels`]).
    pub fn seen(&self, blocks: &'static KernelCode, texels: &'static KernelCode) -> &'static KernelCode {
        if self.tuning.texels { texels } else { blocks }
    }

    /// The levels of the volume whose bins no level before has, and that are wider than the model's.
    pub fn summed(&self) -> impl Iterator<Item = &Level> {
        let first =
            |l: &Level| self.levels.iter().find(|o| o.sum == l.sum).is_some_and(|o| o.scene == l.scene);
        self.levels.iter().filter(move |l| l.sum > 1 && first(l))
    }

    /// Whether the forward kernel's private columns would be too narrow at `level`.
    pub fn forward_direct(&self, level: &Level) -> bool {
        // A path changes by no more than twice what the voxel moves.
        let span = 16.0 * level.grid.pitch.length() / level.bin_width;
        span > f64::from(self.tuning.window_span)
    }

    /// Pixels of the maps side by side in a voxel of the finest grid.
    pub fn factor(&self) -> usize {
        self.maps.n[0] / self.finest().grid.n[0]
    }

    /// Pairs of the capture, those that are left out included.
    pub(crate) fn pairs_of_capture(&self) -> usize {
        self.pairs + self.unused
    }

    /// The pairs that iteration `at` of the surface takes, if it does not take all.
    pub(in crate::solve) fn batch(&self, at: usize) -> Option<&Level> {
        let all = self.batches_held();
        all.get(at % all.len().max(1))
    }

    /// The batches: none where pairs are taken in parts.
    pub(in crate::solve) fn batches_held(&self) -> &[Level] {
        if self.cut.is_none() { &self.batches } else { &[] }
    }

    /// The levels on the maps' pixels that are not levels of the volume.
    pub(super) fn pixels_only(&self) -> impl Iterator<Item = &Level> {
        self.pixel_level.iter().filter(|l| !self.levels.contains(l))
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

/// The most texels that a buffer has as passes over pairs see it.
fn texels_at_most(model: &Model, voxels: usize) -> u64 {
    let wall = model.rendered_wall();
    let points = wall.scanned.len() + wall.others.len();
    let normals = wall.normals.as_ref().map_or(0, Vec::len);
    // Half as many again: levels with a part of the pairs may render for more points than all have.
    let rendered = if model.rendered.is_some() { cells(wall.pairs(), model.bins) / 2 * 3 } else { 0 };
    model.cells().max(rendered).max(voxels).max(points + normals) as u64
}

/// Whether each brick of a grid can reach a bin.
fn reachable(model: &Model, grid: &Grid, general: bool) -> Vec<bool> {
    match general {
        true => vec![true; grid.storage() / BRICK_VOXELS],
        false => model.reachable_bricks(grid),
    }
}

/// Checks sizes against the limits of kernels, but those of pairs ([`Plan::cut_to_indices`]).
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
    for (what, count, mend) in [
        ("voxels deep", grid.n[2], &advice!["use a larger " DepthPitch " or a narrower " Gate][..]),
        ("bins long", model.bins, &advice!["use a narrower " Gate ", or add bins up before"]),
    ] {
        if count > LONGEST_LOOP {
            return Err(Error::memory(format!("{count} {what}: at most {LONGEST_LOOP} are supported"), mend));
        }
    }
    Ok(())
}

fn choose(wanted: Accumulation, kind: DeviceKind, offered: Accumulations) -> Result<Accumulation> {
    Ok(match wanted {
        Accumulation::Auto | Accumulation::Repeatable if kind == DeviceKind::Cpu => Accumulation::Owned,
        Accumulation::Auto if offered.float => Accumulation::Float,
        // Lanes that meet at one bin cost an integer atomic once each; compare-and-swap turns again for each of them.
        Accumulation::Auto if offered.int64 => Accumulation::Fixed,
        Accumulation::Auto => Accumulation::Cas,
        Accumulation::Fixed | Accumulation::Repeatable if !offered.int64 => Accumulation::Fixed32,
        Accumulation::Repeatable => Accumulation::Fixed,
        Accumulation::Float if !offered.float => {
            return Err(Error::options(
                "float accumulation was asked for: this device has no fp32 atomics (VK_EXT_shader_atomic_float)",
                advice!["leave " Accumulation " out, or choose fixed or cas"],
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
        assert_eq!(repeatable(DeviceKind::Integrated, false), Accumulation::Fixed32);
        assert_eq!(repeatable(DeviceKind::Cpu, true), Accumulation::Owned);
        let cpu = choose(Accumulation::Auto, DeviceKind::Cpu, Accumulations { float: true, int64: true });
        assert_eq!(cpu.unwrap(), Accumulation::Owned);
    }
}
