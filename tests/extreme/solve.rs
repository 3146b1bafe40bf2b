//! Iterations of the vector solver on a domain that stays, on the device and by the twins.

use glam::DVec3;
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::solve::{Accumulation, OnDevice, Plan, vector};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Bound, Momentum, Sample, Twin};

use super::super::device::vectors::{REST, read_vectors};
use super::super::device::{read_raw, write_mask};
use super::Case;

/// What is left after some iterations.
pub struct State {
    /// Where the device has the voxels' centres, by slot: in fp32.
    pub points: Vec<DVec3>,
    pub v: Vec<DVec3>,
    /// The weighted data term plus the group term, after every iteration.
    pub objective: Vec<f64>,
    /// The weighted data term.
    pub data: Vec<f64>,
}

/// A start of the vector solver that takes the case's domain.
pub fn started(plan: &Plan, case: &Case) -> Schedule {
    let mut s = vector::start(plan, plan.finest(), &case.options(plan.accumulation));
    let finds = [
        "filter",
        "backproject",
        "gaussian_x_volume",
        "gaussian_y",
        "gaussian_z",
        "levels",
        "room",
        "threshold",
    ];
    s.commands.retain(|c| !finds.contains(&c.name()));
    s
}

/// `count` iterations on the device.
pub fn on_device(gpu: &Gpu, case: &Case, accumulation: Accumulation, count: usize) -> State {
    let mut job = case.long_job(gpu, accumulation, count);
    begin(&mut job, case);
    let rows = run(&mut job, 0..count);
    let v = read_vectors(&mut job, buffer::RAW, &case.active, case.grid.storage());
    let at = |i: u32| rows.iter().map(move |r| f64::from(f32::from_bits(r[i as usize])));
    let data: Vec<f64> = at(TRACE_OBJECTIVE).collect();
    let points = read_raw(&mut job, buffer::SAMPLE_POINTS, case.active.len());
    let points = points.iter().map(|p| DVec3::new(p[0], p[1], p[2])).collect();
    State { points, v, objective: data.iter().zip(at(TRACE_L1)).map(|(d, l)| d + l).collect(), data }
}

/// The case's domain, nothing in it, its bounds.
pub fn begin(job: &mut OnDevice<'_>, case: &Case) {
    let mut domain = vec![false; case.grid.storage()];
    case.active.iter().for_each(|i| domain[*i as usize] = true);
    write_mask(job, buffer::MASK, &domain);
    let s = started(&job.plan, case);
    job.executor.run(&s).expect("the start runs");
}

/// Runs iterations (at most as many as the trace holds) and reads their rows.
pub fn run(job: &mut OnDevice<'_>, range: std::ops::Range<usize>) -> Vec<[u32; TRACE_ROW as usize]> {
    for i in range.clone() {
        let s = vector::iteration(&job.plan, job.plan.finest(), i as u32);
        job.executor.run(&s).expect("an iteration runs");
    }
    let rows: &[[u32; TRACE_ROW as usize]] = bytemuck::cast_slice(job.executor.arena.mapped(buffer::TRACE));
    rows[range].to_vec()
}

/// The samples with other points.
fn moved(mut samples: Vec<Sample>, points: &[DVec3]) -> Vec<Sample> {
    samples.iter_mut().zip(points).for_each(|(s, p)| s.point = *p);
    samples
}

/// (D, lambda) of the active voxels, by slot, whose centres lie there.
pub fn bounds(case: &Case, points: &[DVec3]) -> Vec<[f64; 2]> {
    let twin = case.twin();
    let points = moved(twin::points(&twin, &case.active), points);
    let (rendered, _) = twin::residual_weighted(&twin, &twin::forward_bound(&twin, &points), false);
    let d = twin::bound(&twin, &points, &rendered, Bound::Step);
    let lambda = twin::bound(&twin, &points, &twin::variance(&twin), Bound::Noise);
    d.into_iter().zip(lambda).map(|(d, l)| [d, l]).collect()
}

/// The voxels' centres without rounding, by slot.
pub fn centres(case: &Case) -> Vec<DVec3> {
    twin::points(&case.twin(), &case.active).iter().map(|s| s.point).collect()
}

/// `count` iterations of the twins on voxels whose centres lie there. `scalar` divides every voxel's step by the
/// largest D instead of its own.
pub fn by_twin(case: &Case, points: &[DVec3], count: usize, scalar: bool) -> State {
    by_twin_heard(case, points, count, scalar, &mut |_, _, _| ())
}

/// The same; `hear` is told how many iterations are done, the vectors by storage index, and the objective before.
pub fn by_twin_heard(
    case: &Case,
    points: &[DVec3],
    count: usize,
    scalar: bool,
    hear: &mut dyn FnMut(usize, &[DVec3], f64),
) -> State {
    let twin: Twin<'_> = case.twin();
    let mut by_slot = bounds(case, points);
    if scalar {
        let largest = by_slot.iter().fold(0.0f64, |a, b| a.max(b[0]));
        by_slot.iter_mut().for_each(|b| b[0] = if b[0] > 0.0 { largest } else { 0.0 });
    }
    let mut all = vec![[0.0; 2]; case.grid.storage()];
    case.active.iter().zip(&by_slot).for_each(|(i, b)| all[*i as usize] = *b);
    let mut v = vec![DVec3::ZERO; case.grid.storage()];
    let mut before = v.clone();
    let mut m: Momentum = REST;
    let (mut objective, mut data) = (vec![], vec![]);
    for n in 0..count {
        let samples = moved(twin::extrapolate(&twin, &case.active, &v, &before, m.beta), points);
        let (residual, loss) = twin::residual_weighted(&twin, &twin::forward(&twin, &samples), true);
        let gradient = twin::gradient_vectors(&twin, &samples, &residual);
        let told = twin::step(&twin, &case.active, &samples, &gradient, &all, m.share, &mut v, &mut before);
        let group: f64 = told.iter().map(|t| t.group).sum();
        m = twin::finish_accelerated(m, loss[0] + group, told.iter().map(|t| t.against).sum());
        objective.push(loss[0] + group);
        data.push(loss[0]);
        hear(n + 1, &v, loss[0] + group);
    }
    State { points: points.to_vec(), v, objective, data }
}

/// Largest difference of the vectors over the longest, and that of the last objective over the first one: where the
/// data can be met the last is a rounding error itself.
pub fn state_apart(got: &State, want: &State) -> [f64; 2] {
    let longest = want.v.iter().fold(0.0f64, |a, v| a.max(v.length()));
    let off =
        got.v.iter().zip(&want.v).fold(0.0f64, |a, (g, w)| {
            if (*g - *w).is_finite() { a.max((*g - *w).length()) } else { f64::NAN }
        });
    let share = |off: f64, of: f64| if off == 0.0 { 0.0 } else { off / of };
    let last = |s: &State| s.objective.last().copied().unwrap_or(0.0);
    [
        share(off, longest),
        share((last(got) - last(want)).abs(), want.objective.first().copied().unwrap_or(0.0)),
    ]
}

/// The same of the vectors shorter than a hundredth of the longest, over the longest of those.
pub fn dim_apart(got: &State, want: &State) -> f64 {
    let longest = want.v.iter().fold(0.0f64, |a, v| a.max(v.length()));
    let dim = got.v.iter().zip(&want.v).filter(|(_, w)| w.length() < 0.01 * longest);
    let [off, of] =
        dim.fold([0.0f64; 2], |[off, of], (g, w)| [off.max((*g - *w).length()), of.max(w.length())]);
    if off == 0.0 { 0.0 } else { off / of }
}
