//! Passes over pairs: rendering, comparing, gathering. Every solver's iteration is made of them.

use super::Pass;
use super::passes::{PULSE, PULSE_BACK, SUM_BINS};
use super::{Level, Plan};
use crate::gpu::{Buffer, Schedule};
use crate::transport::Geometry;
use crate::transport::kernels::*;

/// A forward pass by `pass`, in as many dispatches as its accumulation takes.
pub(super) fn forward(plan: &Plan, level: &Level, pass: &Pass) -> Schedule {
    let mut s = Schedule::default();
    let flags = if plan.forward_direct(level) { FORWARD_DIRECT } else { 0 };
    for set in 0..plan.forward_sets(level) {
        s.indirect(pass, buffer::ARGUMENTS, arguments(ARGUMENTS_FORWARD + set))
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::WALL, level.wall)
            .with(Push { first: set, flags, ..Default::default() });
    }
    s
}

/// Compares the rendered histograms with the measurement by the pass `residual`. With a pulse, spreads them before as
/// the instrument does, and takes the residuals back through it for [`Plan::residual`]. `through`: see [`pulse_back`].
pub(super) fn compare(
    plan: &Plan,
    level: &Level,
    residual: &Pass,
    push: Push,
    through: Option<u32>,
) -> Schedule {
    let mut s = Schedule::default();
    if plan.pulse > 0 {
        let rendered = s
            .dispatch(&PULSE, runs(level))
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::PULSE_TAPS, level.taps);
        if !plan.fixed_point() {
            rendered.bind(buffer::SOURCE, buffer::HISTOGRAMS);
        }
    }
    s.dispatch(residual, groups(plan.cells_at(level), WORKGROUP * RESIDUAL_BINS))
        .bind(buffer::SCENE, level.scene)
        .bind(buffer::MEASURED, level.measured)
        .with(push);
    s.extend(pulse_back(plan, level, &PULSE_BACK, through));
    s
}

/// Takes the buffer `residual` back to the paths, into `spread`, by `pass`: through the taps that begin at word
/// `through` of `pulse_taps`, or through the pulse's own. Empty without either.
pub(super) fn pulse_back(plan: &Plan, level: &Level, pass: &Pass, through: Option<u32>) -> Schedule {
    let mut s = Schedule::default();
    if plan.pulse > 0 || through.is_some() {
        s.dispatch(pass, runs(level))
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::PULSE_TAPS, level.taps)
            .bind(buffer::SOURCE, buffer::RESIDUAL)
            .with(Push { first: through.unwrap_or(0), ..Default::default() });
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

/// Gathers the buffer `from` over all pairs of `level` by `pass`. The triple `sized` of the arguments gives its size;
/// `flags` are added to those of the parts.
pub(super) fn gather(
    plan: &Plan,
    level: &Level,
    pass: &Pass,
    sized: u32,
    flags: u32,
    from: Buffer,
) -> Schedule {
    let mut s = Schedule::default();
    for chunk in pair_chunks(plan, level) {
        s.indirect(pass, buffer::ARGUMENTS, arguments(sized))
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::WALL, level.wall)
            .bind(buffer::RESIDUAL, from)
            .with(Push { flags: chunk.flags | flags, ..chunk });
    }
    s
}

/// Workgroups of a pulse kernel.
fn runs(level: &Level) -> [u32; 3] {
    let of_row = (level.bins + PADDING as usize).div_ceil(PULSE_RUN as usize);
    groups((level.pairs + 1) * of_row, WORKGROUP)
}

/// Push constants of a gather over all pairs of `level`, in as many dispatches as the loop limit needs. A product is
/// cut into whole rows of scanned points where they fit, else into parts of one row.
pub(super) fn pair_chunks(plan: &Plan, level: &Level) -> Vec<Push> {
    let (pairs, most) = (level.pairs as u32, PAIR_CHUNK);
    let several = plan.geometry == Geometry::Product && plan.others > 1;
    let row = if several { plan.scanned as u32 } else { pairs };
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
