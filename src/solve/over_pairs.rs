//! Passes over pairs: rendering, comparing, gathering. Every solver's iteration is made of them.

use super::Pass;
use super::passes::{PULSE, PULSE_BACK, SPOT, SPOT_BACK, SPOT_MORE, SUM_BINS};
use super::plan::{BETWEEN, Pairs, SEEN, Spots};
use super::{Level, Plan};
use crate::gpu::{Buffer, Schedule};
use crate::transport::kernels::*;
use crate::transport::{Geometry, SpotTaps};

/// A forward pass by `pass`, in as many dispatches as its accumulation takes.
pub(super) fn forward(plan: &Plan, level: &Level, pass: &Pass) -> Schedule {
    let mut s = Schedule::default();
    let flags = if plan.forward_direct(level) { FORWARD_DIRECT } else { 0 };
    let chunks = plan.set_chunks(level);
    let of_set = (u64::from(chunks) * u64::from(plan.tuning.chunk)).min(plan.voxels_at(level) as u64);
    for set in 0..plan.forward_sets(level) {
        s.indirect(pass, buffer::ARGUMENTS, arguments(ARGUMENTS_FORWARD + set))
            .bind(buffer::SCENE, level.rendered.scene)
            .bind(buffer::WALL, level.rendered.wall)
            .with(Push { first: set * chunks, flags, ..Default::default() })
            .taking(of_set * level.rendered.count as u64);
    }
    s
}

/// Compares the rendered histograms with the measurement by the pass `residual`, as the instrument shows them: summed
/// over spots, spread by the pulse. Takes the residuals back through both for [`Plan::residual`]. `through`: see
/// [`instrument_back`].
pub(super) fn compare(
    plan: &Plan,
    level: &Level,
    residual: &Pass,
    push: Push,
    through: Option<u32>,
) -> Schedule {
    // Only the first pass after rendering may read fixed point.
    let mut sharp = (!plan.fixed_point()).then_some(buffer::HISTOGRAMS);
    let mut s = Schedule::default();
    if let Some(spots) = plan.spots_of(level) {
        let passes = [&SPOT, if plan.fixed_point() { &SPOT_MORE } else { &SPOT }];
        s.extend(spot(level, spots, &spots.rendered.stages, passes, sharp));
        s.fill(buffer::HISTOGRAMS, plan.bytes_of(buffer::HISTOGRAMS), 0);
        sharp = Some(SEEN);
    }
    if plan.pulse > 0 {
        let spread = s.dispatch(&PULSE, runs(level.pairs, level.bins));
        spread.bind(buffer::SCENE, level.scene).bind(buffer::PULSE_TAPS, level.taps);
        if let Some(sharp) = sharp {
            spread.bind(buffer::SOURCE, sharp);
        }
    }
    let compared = s
        .dispatch(residual, groups(plan.cells_at(level), WORKGROUP * RESIDUAL_BINS))
        .bind(buffer::SCENE, level.scene)
        .bind(buffer::MEASURED, level.measured)
        .with(push);
    if plan.pulse == 0 && plan.has_spots() {
        compared.bind(buffer::SPREAD, SEEN);
    }
    s.extend(instrument_back(plan, level, [&PULSE_BACK, &SPOT_BACK], through));
    s
}

/// Takes the buffer `residual` back to the paths, into [`Plan::residual`], by passes for pulse and spot: through the taps
/// that begin at word `through` of `pulse_taps`, or through the pulse's own; then through the spots. Nothing where paths
/// are sharp and spots are points.
pub(super) fn instrument_back(
    plan: &Plan,
    level: &Level,
    [pulse, spots]: [&Pass; 2],
    through: Option<u32>,
) -> Schedule {
    let mut s = Schedule::default();
    let mut from = buffer::RESIDUAL;
    if plan.pulse > 0 || through.is_some() {
        s.dispatch(pulse, runs(level.pairs, level.bins))
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::PULSE_TAPS, level.taps)
            .bind(buffer::SOURCE, buffer::RESIDUAL)
            .with(Push { first: through.unwrap_or(0), ..Default::default() });
        from = buffer::SPREAD;
    }
    if let Some(of) = plan.spots_of(level) {
        s.extend(spot(level, of, &of.back, [spots; 2], Some(from)));
    }
    s
}

/// The buffer that gradients gather from after residuals went back through the taps `through`, if there are any.
pub(super) fn gathered(plan: &Plan, through: Option<u32>) -> Buffer {
    match through {
        Some(_) if !plan.has_spots() => buffer::SPREAD,
        _ => plan.residual(),
    }
}

/// Sums the histograms `from` by the `stages` of a level's spots, into [`SEEN`]: the first by the pass `first`.
/// Without `from`, those that the forward pass left in fixed point.
fn spot(
    level: &Level,
    spots: &Spots,
    stages: &[SpotTaps],
    [first, more]: [&Pass; 2],
    from: Option<Buffer>,
) -> Schedule {
    let mut s = Schedule::default();
    let mut source = from;
    for (i, stage) in stages.iter().enumerate() {
        // They alternate, and the last one is `SEEN`.
        let target = if (stages.len() - i) % 2 == 1 { SEEN } else { BETWEEN };
        let (word, sums) = (spots.word_of(stage) as u32, stage.sums());
        let dispatch = s
            .dispatch(if i == 0 { first } else { more }, runs(sums, level.bins))
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::SPOT_TAPS, spots.taps)
            .bind(buffer::TARGET, target)
            .with(Push { first: word, last: sums as u32, ..Default::default() });
        if let Some(source) = source {
            dispatch.bind(buffer::SOURCE, source);
        }
        source = Some(target);
    }
    s
}

/// Sums the measurement's bins for the levels of the volume, if these have wider ones. It is due once, after the upload.
pub fn sum_bins(plan: &Plan) -> Schedule {
    let mut s = Schedule::default();
    for level in plan.summed() {
        s.dispatch(&SUM_BINS, groups(plan.pairs * level.bins, WORKGROUP))
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::SOURCE, buffer::MEASURED)
            .bind(buffer::TARGET, level.measured)
            .with(Push {
                first: level.sum as u32,
                last: plan.bins as u32,
                step: plan.pairs as u32,
                ..Default::default()
            });
    }
    s
}

/// Gathers the buffer `from` over all rendered pairs of `level` by `pass`. `flags` are added to those of the parts.
pub(super) fn gather(plan: &Plan, level: &Level, pass: &Pass, flags: u32, from: Buffer) -> Schedule {
    let mut s = Schedule::default();
    let voxels = plan.voxels_at(level);
    for chunk in pair_chunks(plan, &level.rendered, voxels) {
        s.indirect(pass, buffer::ARGUMENTS, arguments(ARGUMENTS_BACKWARD))
            .bind(buffer::SCENE, level.rendered.scene)
            .bind(buffer::WALL, level.rendered.wall)
            .bind(buffer::RESIDUAL, from)
            .with(Push { flags: chunk.flags | flags, ..chunk })
            .taking(work_of(&chunk, voxels));
    }
    s
}

/// Workgroups of a pulse or spot kernel that writes so many histograms.
fn runs(histograms: usize, bins: usize) -> [u32; 3] {
    let of_row = (bins + PADDING as usize).div_ceil(PULSE_RUN as usize);
    groups((histograms + 1) * of_row, WORKGROUP)
}

/// Evaluations of a part of a gather for `voxels` voxels.
pub(super) fn work_of(part: &Push, voxels: usize) -> u64 {
    u64::from(part.last - part.first) * voxels as u64
}

/// Push constants of a gather over `all` pairs for `voxels` voxels, in as many dispatches as the limits of loops and of
/// the work of a dispatch need. A product is cut into whole rows of scanned points where they fit, else into parts of
/// one row.
pub(super) fn pair_chunks(plan: &Plan, all: &Pairs, voxels: usize) -> Vec<Push> {
    let (pairs, most) = (all.count as u32, plan.gathered_pairs(voxels));
    let several = plan.geometry == Geometry::Product && all.others > 1;
    let row = if several { all.scanned as u32 } else { pairs };
    let whole = row * (most / row).max(1);
    let mut chunks: Vec<Push> = vec![];
    let mut first = 0;
    while first < pairs {
        let last = match row <= most {
            true => (first + whole).min(pairs),
            false => (first + most).min((first / row + 1) * row),
        };
        let more = if first > 0 { BACKWARD_CONTINUE } else { 0 };
        let end = if last == pairs { BACKWARD_FINISH } else { 0 };
        chunks.push(Push { first, last, flags: more | end, ..Default::default() });
        first = last;
    }
    chunks
}

/// Workgroups for `n` invocations in groups of `size`; continued along y after [`GROUPS_X`].
pub(super) fn groups(n: usize, size: u32) -> [u32; 3] {
    let count = n.div_ceil(size as usize) as u32;
    [count.min(GROUPS_X), count.div_ceil(GROUPS_X).max(1), 1]
}

/// Byte offset of a triple of the arguments.
pub(super) fn arguments(triple: u32) -> u64 {
    12 * u64::from(triple)
}
