//! How long the rest of a solve takes.

use super::Steps;
use crate::gpu::Schedule;
use crate::solve::{Plan, TracePoint};

/// A surface has about this many active voxels behind each other in the volume before it.
const THICKNESS: f64 = 8.0;

/// The power of the lateral resolution that active voxels of a volume grow with. It is less than 2, as the domain also
/// shrinks in the meantime.
const GROWTH: f64 = 1.3;

/// What is ahead of a running solve.
pub(super) struct Ahead {
    /// Lateral voxels and pairs of every iteration of this run.
    iterations: Vec<[usize; 2]>,
    /// The first of them.
    first: usize,
    /// See [`Steps::after`].
    after: Vec<[f64; 2]>,
    /// Seconds, and active voxels times pairs, at the first point of this run. What is before it, drivers that compile
    /// at the first dispatch included, says nothing about the rest.
    first_point: Option<[f64; 2]>,
}

impl Ahead {
    /// What is ahead of a run from iteration `first` at `level` up to `end`. `unused` takes schedules that nobody runs.
    pub fn new(
        steps: &Steps<'_>,
        plan: &Plan,
        [first, mut level, end]: [usize; 3],
        unused: &mut Schedule,
    ) -> Ahead {
        let mut iterations = Vec::with_capacity(end.saturating_sub(first));
        for i in first..end {
            if i > first {
                // Only the level that it leads to counts here.
                (steps.due)(unused, plan, &mut level, i);
                unused.clear();
            }
            let here = &steps.levels[level];
            iterations.push([here.grid.n[0], here.pairs]);
        }
        Ahead { iterations, first, after: steps.after.clone(), first_point: None }
    }

    /// Seconds that the rest takes, as `point` is reached after `work` active voxels times pairs. `None` while nothing
    /// is known. The rate is that of this run so far. Active voxels are taken to grow with the resolution, and the
    /// surface after a volume to be a sheet of them.
    pub fn seconds(&mut self, point: &TracePoint, work: u64) -> Option<f64> {
        let [seconds_before, work_before] = *self.first_point.get_or_insert([point.seconds, work as f64]);
        let (seconds, work) = (point.seconds - seconds_before, work as f64 - work_before);
        if seconds <= 0.0 || work <= 0.0 {
            return None;
        }
        let grown =
            |lateral: f64, power: f64| point.active as f64 * (lateral / point.lateral as f64).powf(power);
        let rest = self.iterations.iter().skip(point.iteration.saturating_sub(self.first));
        let volume: f64 = rest.map(|[lateral, pairs]| grown(*lateral as f64, GROWTH) * *pairs as f64).sum();
        let surface: f64 =
            self.after.iter().map(|[lateral, pairs]| grown(*lateral, 2.0) / THICKNESS * pairs).sum();
        Some((volume + surface) * seconds / work)
    }
}
