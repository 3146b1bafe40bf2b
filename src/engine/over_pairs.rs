//! Passes over pairs: rendering, comparing, gathering. Every solver's iteration is made of them.

use super::plan::Plan;
use crate::engine::passes::{ARGUMENTS, PULSE, PULSE_BACK, RESIDUAL_ROWS, SPOT, SPOT_BACK, SPOT_MORE};
use crate::engine::plan::{BETWEEN, Level, LevelPairs, Pass, SEEN, Spots};
use crate::gpu::{Buffer, Command, Schedule};
use crate::transport::kernels::*;
use crate::transport::{Geometry, SpotTaps, cells};

/// Sizes the passes over these rendered pairs, by how many samples are active.
pub(crate) fn size_passes(s: &mut Schedule, rendered: &LevelPairs) {
    s.dispatch(&ARGUMENTS, [1, 1, 1], 1).bind(buffer::SCENE, rendered.scene);
}

/// A forward pass by `pass` over the pairs of `level`, in as many dispatches as its accumulation takes.
pub(crate) fn forward(s: &mut Schedule, plan: &Plan, level: &Level, pass: &Pass) {
    let flags = if plan.forward_direct(level) { FORWARD_DIRECT } else { 0 };
    let rendered = &level.rendered;
    let chunks = plan.set_chunks(rendered.count);
    let of_set =
        (u64::from(chunks) * u64::from(plan.division.tuning.chunk)).min(plan.voxels_at(level) as u64);
    let tiles =
        plan.division.tuning.tiles(plan.scene.geometry, [rendered.count, rendered.scanned, rendered.others]);
    let most = plan.division.tuning.most_chunks(plan.voxels_at(level), tiles).min(chunks.into());
    for set in 0..plan.forward_sets(level) {
        let turns = of_set * rendered.count as u64;
        s.indirect(pass, buffer::ARGUMENTS, arguments(ARGUMENTS_FORWARD + set), turns)
            .at_most([tiles as u32, most as u32, 1])
            .bind(buffer::SCENE, rendered.scene)
            .bind(buffer::WALL, rendered.wall)
            .with(Push { first: set * chunks, flags, ..Default::default() });
    }
}

/// Compares the rendered histograms of a level's pairs with the measurement by the pass `residual`, as the instrument
/// shows them: summed over spots, spread by the pulse. Takes the residuals back through both for [`Plan::residual`].
pub(crate) fn compare(s: &mut Schedule, plan: &Plan, level: &Level, residual: &Pass, push: Push) {
    let (bins, own) = (plan.scene.bins, plan.measured(level));
    // Only the first pass after rendering may read fixed point.
    let mut sharp = (!plan.fixed_point()).then_some(buffer::HISTOGRAMS);
    if let Some(spots) = &plan.levels.spots {
        let passes = [&SPOT, if plan.fixed_point() { &SPOT_MORE } else { &SPOT }];
        spot(s, plan, level, spots, &spots.rendered.stages, passes, sharp);
        s.fill(buffer::HISTOGRAMS, plan.bytes_of(buffer::HISTOGRAMS), 0);
        sharp = Some(SEEN);
    }
    if plan.scene.pulse > 0 {
        let turns = turns_of_pulse(own.count, bins, plan.scene.pulse);
        let spread = s.dispatch(&PULSE, runs(own.count, bins), turns);
        spread.bind(buffer::SCENE, own.scene);
        if let Some(sharp) = sharp {
            spread.bind(buffer::SOURCE, sharp);
        }
    }
    let cells = cells(own.count, bins);
    // Rows are walked three times, by an invocation or a workgroup each.
    let rows_of_group = if plan.division.tuning.row_lanes > 0 { 1 } else { WORKGROUP };
    let (all, turns) = match *residual == RESIDUAL_ROWS {
        true => (groups(own.count, rows_of_group), 3 * cells as u64),
        false => (groups(cells, WORKGROUP * RESIDUAL_BINS), cells as u64),
    };
    let compared = s
        .dispatch(residual, all, turns)
        .bind(buffer::SCENE, own.scene)
        .bind(buffer::MEASURED, level.measured)
        .with(push);
    if plan.scene.pulse == 0 && plan.has_spots() {
        compared.bind(buffer::SPREAD, SEEN);
    }
    instrument_back(s, plan, level);
}

/// Takes the buffer `residual` of a level's pairs back to the paths, into [`Plan::residual`]: through the pulse, then
/// through the spots. Nothing where paths are sharp and spots are points.
fn instrument_back(s: &mut Schedule, plan: &Plan, level: &Level) {
    let own = plan.measured(level);
    let mut from = buffer::RESIDUAL;
    if plan.scene.pulse > 0 {
        let turns = turns_of_pulse(own.count, plan.scene.bins, plan.scene.pulse);
        s.dispatch(&PULSE_BACK, runs(own.count, plan.scene.bins), turns)
            .bind(buffer::SCENE, own.scene)
            .bind(buffer::SOURCE, buffer::RESIDUAL);
        from = buffer::SPREAD;
    }
    if let Some(of) = &plan.levels.spots {
        spot(s, plan, level, of, &of.back, [&SPOT_BACK; 2], Some(from));
    }
}

/// Sums the histograms `from` by the `stages` of a level's spots, into [`SEEN`]: the first by the pass `first`.
/// Without `from`, those that the forward pass left in fixed point.
fn spot(
    s: &mut Schedule,
    plan: &Plan,
    level: &Level,
    spots: &Spots,
    stages: &[SpotTaps],
    [first, more]: [&Pass; 2],
    from: Option<Buffer>,
) {
    let mut source = from;
    for (i, stage) in stages.iter().enumerate() {
        // They alternate, and the last one is `SEEN`.
        let target = if (stages.len() - i) % 2 == 1 { SEEN } else { BETWEEN };
        let (word, sums) = (spots.word_of(stage) as u32, stage.sums());
        let dispatch = s
            .dispatch(
                if i == 0 { first } else { more },
                runs(sums, plan.scene.bins),
                turns_of_spot(stage, plan.scene.bins),
            )
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::TARGET, target)
            .with(Push { first: word, last: sums as u32, ..Default::default() });
        if let Some(source) = source {
            dispatch.bind(buffer::SOURCE, source);
        }
        source = Some(target);
    }
}

/// Gathers [`Plan::residual`] over the rendered pairs of `level` by `pass`.
pub(crate) fn gather(s: &mut Schedule, plan: &Plan, level: &Level, pass: &Pass) {
    let voxels = plan.voxels_at(level);
    for chunk in pair_chunks(plan, &level.rendered, voxels) {
        let turns = work_of(&chunk, voxels);
        s.indirect(pass, buffer::ARGUMENTS, arguments(ARGUMENTS_BACKWARD), turns)
            .at_most(groups(plan.division.tuning.most_groups(voxels), 1))
            .bind(buffer::SCENE, level.rendered.scene)
            .bind(buffer::WALL, level.rendered.wall)
            .bind(buffer::RESIDUAL, plan.residual())
            .with(chunk);
    }
}

/// Runs `pass` with an invocation for each active voxel of `level`, of at most `turns` turns.
pub(crate) fn over_active<'s>(
    s: &'s mut Schedule,
    plan: &Plan,
    level: &Level,
    pass: &Pass,
    turns: usize,
) -> &'s mut Command {
    over(s, pass, ARGUMENTS_SAMPLE, [plan.voxels_at(level), turns]).bind(buffer::SCENE, level.scene)
}

/// Runs `pass` with an invocation for each touched voxel of `level`, of at most `turns` turns.
pub(crate) fn over_touched<'s>(
    s: &'s mut Schedule,
    plan: &Plan,
    level: &Level,
    pass: &Pass,
    turns: usize,
) -> &'s mut Command {
    over(s, pass, ARGUMENTS_UPDATE, [plan.domain.touched_capacity, turns]).bind(buffer::SCENE, level.scene)
}

fn over<'s>(s: &'s mut Schedule, pass: &Pass, triple: u32, [most, turns]: [usize; 2]) -> &'s mut Command {
    s.indirect(pass, buffer::ARGUMENTS, arguments(triple), (turns * most) as u64)
        .at_most(groups(most, WORKGROUP))
}

/// Workgroups of a pulse or spot kernel, by number of histograms.
fn runs(histograms: usize, bins: usize) -> [u32; 3] {
    groups((histograms + 1) * runs_of_row(bins), WORKGROUP)
}

/// Runs of cells that an invocation of these kernels writes, in a row.
fn runs_of_row(bins: usize) -> usize {
    (bins + PADDING as usize).div_ceil(PULSE_RUN as usize)
}

/// Turns of a filter, a pulse or a spot that take no longer than one over a pair: each loads neighbouring cells and
/// multiplies, some 15 issue slots where a pair takes 45.
const LIGHT: u64 = 3;

/// So many light turns, in those over pairs.
pub(crate) fn light(turns: usize) -> u64 {
    (turns as u64).div_ceil(LIGHT)
}

/// Turns of a convolution kernel, by numbers of histograms and taps.
fn turns_of_pulse(histograms: usize, bins: usize, taps: usize) -> u64 {
    let runs = (histograms + 1) * runs_of_row(bins);
    light(runs * (taps + PULSE_RUN as usize))
}

/// Turns of a kernel that sums histograms by a stage of the spots: one for each weight and each run of cells.
fn turns_of_spot(stage: &SpotTaps, bins: usize) -> u64 {
    let weights = stage.outer * stage.inner * stage.rows.iter().map(|row| row.len() + 1).sum::<usize>();
    light(weights * runs_of_row(bins))
}

/// Turns of a kernel that closes an iteration: it adds up what workgroups left.
pub(crate) fn turns_of_finish(plan: &Plan) -> u64 {
    (plan.bytes_of(buffer::LOSS_PARTIALS) + plan.bytes_of(buffer::L1_PARTIALS)) / 4
}

/// Evaluations of a chunk of a gather for `voxels` voxels.
pub(crate) fn work_of(chunk: &Push, voxels: usize) -> u64 {
    u64::from(chunk.last - chunk.first) * voxels as u64
}

/// Push constants of a gather over the measured or rendered pairs `all` for `voxels` voxels, in as many
/// dispatches as the limits of loops and of the work of a dispatch need. A product is cut into whole rows of scanned
/// points where they fit, else into stretches of one row.
pub(crate) fn pair_chunks(
    plan: &Plan,
    all: &LevelPairs,
    voxels: usize,
) -> impl Iterator<Item = Push> + use<> {
    let (pairs, most) = (all.count as u32, plan.gathered_pairs(voxels));
    let several = plan.scene.geometry == Geometry::Product && all.others > 1;
    let row = if several { all.scanned as u32 } else { pairs };
    let whole = row * (most / row).max(1);
    let mut first = 0;
    std::iter::from_fn(move || {
        if first == pairs {
            return None;
        }
        let last = match row <= most {
            true => (first + whole).min(pairs),
            false => (first + most).min((first / row + 1) * row),
        };
        let more = if first > 0 { BACKWARD_CONTINUE } else { 0 };
        let end = if last == pairs { BACKWARD_FINISH } else { 0 };
        let chunk = Push { first, last, flags: more | end, ..Default::default() };
        first = last;
        Some(chunk)
    })
}

/// Workgroups for `n` invocations in groups of `size`; continued along y after [`GROUPS_X`].
pub(crate) fn groups(n: usize, size: u32) -> [u32; 3] {
    let count = n.div_ceil(size as usize) as u32;
    [count.min(GROUPS_X), count.div_ceil(GROUPS_X).max(1), 1]
}

/// Byte offset of a triple of the arguments.
pub(crate) fn arguments(triple: u32) -> u64 {
    12 * u64::from(triple)
}
