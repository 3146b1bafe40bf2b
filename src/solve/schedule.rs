//! One iteration of the paper's solver as data.

use super::{Level, NoiseTerm, Plan};
use crate::gpu::Schedule;
use crate::transport::Geometry;
use crate::transport::kernels::*;

/// Sample, forward, residual, (noise,) backward, update, finish: iteration `iteration` of the solve (from 0),
/// `step` of the optimiser since its restart (from 1).
pub fn iteration(plan: &Plan, level: &Level, iteration: u32, step: u32) -> Schedule {
    let mut s = Schedule::default();
    let push = Push { iteration, step, ..Default::default() };
    let arguments = |triple: u32| 12 * u64::from(triple);
    s.indirect("sample", "arguments", arguments(ARGUMENTS_SAMPLE)).bind("scene", level.scene).with(push);
    s.extend(forward(plan, level, "forward"));
    s.extend(compare(plan, level, "residual", push, None));
    if plan.noise != NoiseTerm::Off {
        s.dispatch("noise", groups(level.pairs, 1)).bind("scene", level.scene).with(push);
    }
    s.extend(gather(plan, level, "backward", ARGUMENTS_BACKWARD, 0, plan.residual()));
    s.indirect("update", "arguments", arguments(ARGUMENTS_UPDATE)).bind("scene", level.scene).with(push);
    s.dispatch("finish", [1, 1, 1]).bind("scene", level.scene).with(push);
    s
}

/// A forward pass by `kernel`, in as many dispatches as its accumulation takes.
pub(super) fn forward(plan: &Plan, level: &Level, kernel: &'static str) -> Schedule {
    let mut s = Schedule::default();
    let flags = if plan.forward_direct(level) { FORWARD_DIRECT } else { 0 };
    for set in 0..plan.forward_sets(level) {
        s.indirect(kernel, "arguments", 12 * u64::from(ARGUMENTS_FORWARD + set))
            .bind("scene", level.scene)
            .bind("wall", level.wall)
            .with(Push { first: set, flags, ..Default::default() });
    }
    s
}

/// Takes what a forward pass has rendered in by the kernel `residual`; with a pulse, as the instrument shows it, and what it
/// misses back to the paths, for [`Plan::residual`]; `through` as [`pulse_back`].
pub(super) fn compare(
    plan: &Plan,
    level: &Level,
    residual: &'static str,
    push: Push,
    through: Option<u32>,
) -> Schedule {
    let mut s = Schedule::default();
    if plan.pulse > 0 {
        let rendered = s.dispatch("pulse", runs(plan, level)).bind("scene", level.scene);
        if !plan.fixed_point() {
            rendered.bind("source", "histograms");
        }
    }
    s.dispatch(residual, groups(plan.cells_at(level), WORKGROUP * RESIDUAL_BINS))
        .bind("scene", level.scene)
        .with(push);
    s.extend(pulse_back(plan, level, "pulse_back", through));
    s
}

/// What `residual` holds, seen from the paths, by the kernel of that name, in `spread`: through the taps that begin at word
/// `through` of `pulse_taps`, or the pulse's own; nothing to do without either.
pub(super) fn pulse_back(plan: &Plan, level: &Level, kernel: &'static str, through: Option<u32>) -> Schedule {
    let mut s = Schedule::default();
    if plan.pulse > 0 || through.is_some() {
        s.dispatch(kernel, runs(plan, level))
            .bind("scene", level.scene)
            .bind("source", "residual")
            .with(Push { first: through.unwrap_or(0), ..Default::default() });
    }
    s
}

/// Gathers the buffer `from` over all pairs of `level` by `kernel`, which the triple `arguments` sizes, with `flags` beside
/// those of the parts.
pub(super) fn gather(
    plan: &Plan,
    level: &Level,
    kernel: &'static str,
    arguments: u32,
    flags: u32,
    from: &'static str,
) -> Schedule {
    let mut s = Schedule::default();
    for chunk in pair_chunks(plan, level) {
        s.indirect(kernel, "arguments", 12 * u64::from(arguments))
            .bind("scene", level.scene)
            .bind("wall", level.wall)
            .bind("residual", from)
            .with(Push { flags: chunk.flags | flags, ..chunk });
    }
    s
}

/// Workgroups of a pulse kernel.
fn runs(plan: &Plan, level: &Level) -> [u32; 3] {
    let of_row = (plan.bins + PADDING as usize).div_ceil(PULSE_RUN as usize);
    groups((level.pairs + 1) * of_row, WORKGROUP)
}

/// Push constants of a gather over all pairs of `level`, in as many dispatches as the loop limit asks for: of a product, whole
/// rows of scanned points where they fit, or parts of one row.
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

/// Workgroups for `n` invocations in groups of `size`, going on along y after [`GROUPS_X`].
pub(super) fn groups(n: usize, size: u32) -> [u32; 3] {
    let count = n.div_ceil(size as usize) as u32;
    [count.min(GROUPS_X), count.div_ceil(GROUPS_X).max(1), 1]
}
