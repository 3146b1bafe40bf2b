//! How long the rest of a solve takes.

use super::steps::Steps;
use super::watch::TracePoint;
use crate::engine::plan::Plan;
use crate::gpu::Schedule;

/// The power of the lateral resolution that active voxels of a volume grow with, from the end of a level to the end of the next.
/// It is less than 2, as the domain also shrinks in the meantime.
const GROWTH: f64 = 0.5;

/// The share of a level's first active voxels that is left at its end, and the share of its iterations in which the rest falls
/// to 1/e: the domain shrinks most at once (benches/NOTES.md).
const KEPT: f64 = 0.45;
const FALLS: f64 = 0.13;

/// The share of a level's first active voxels that is left after this share of its iterations.
fn kept(share: f64) -> f64 {
    KEPT + (1.0 - KEPT) * (-share / FALLS).exp()
}

/// What is ahead of a running solve.
pub(crate) struct Ahead {
    /// Lateral voxels and pairs of every iteration of this run, and the share of its level's active voxels that is left then, over
    /// that at the level's end.
    iterations: Vec<(usize, usize, f64)>,
    /// The first of them.
    first: usize,
    /// Seconds, and active voxels times pairs, at the first point of this run. What is before it, drivers that compile
    /// at the first dispatch included, says nothing about the rest.
    first_point: Option<[f64; 2]>,
}

impl Ahead {
    /// What is ahead of a run from iteration `first` at `level` up to `end`. `unused` receives schedules that were not run.
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
            iterations.push((here.grid.n[0], here.pairs, 1.0));
        }
        let levels = iterations.chunk_by_mut(|a, b| a.0 == b.0).filter(|_| steps.shrinks);
        for level in levels {
            let all = level.len() as f64;
            level.iter_mut().enumerate().for_each(|(i, of)| of.2 = kept(i as f64 / all) / KEPT);
        }
        Ahead { iterations, first, first_point: None }
    }

    /// Seconds that the rest takes, as `point` is reached after `work` active voxels times pairs. `None` while nothing
    /// is known. The rate is that of this run so far. Active voxels are taken to become fewer within a level and to grow with the
    /// resolution.
    pub fn seconds(&mut self, point: &TracePoint, work: u64) -> Option<f64> {
        let [seconds_before, work_before] = *self.first_point.get_or_insert([point.seconds, work as f64]);
        let (seconds, work) = (point.seconds - seconds_before, work as f64 - work_before);
        if seconds <= 0.0 || work <= 0.0 {
            return None;
        }
        let done = point.iteration.saturating_sub(self.first);
        let now = self.iterations.get(done.saturating_sub(1)).map_or(1.0, |of| of.2);
        // Active voxels at the end of a level.
        let grown =
            |lateral: usize| point.active as f64 / now * (lateral as f64 / point.lateral as f64).powf(GROWTH);
        let rest = self.iterations.iter().skip(done);
        // The sum of nothing is -0.
        let left = rest.fold(0.0, |sum, (lateral, pairs, kept)| sum + grown(*lateral) * kept * *pairs as f64);
        Some(left * seconds / work)
    }
}
