//! Turns a recording into figures per kernel, per iteration, and of the device's idle time.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::limits::DeviceLimits;
use super::work::{Limit, Work};
use thirdbounce::engine::{TracePoint, Voxels};
use thirdbounce::gpu::{Ran, Recording};
use thirdbounce::methods::pass_of;

/// Statistics above this are in other units than their names say: no kernel has 2³² registers or bytes of memory.
const MOST_PLAUSIBLE: f64 = 4_294_967_296.0;

/// A kernel's part in a solve. A null value is not known or does not apply: most kernels evaluate no pairs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelProfile {
    /// Its name in reports. Names of passes over pairs begin with `forward` or `backward`.
    pub name: String,
    /// Its name in schedules, labels and traces.
    pub kernel: String,
    /// Its module.
    pub code: String,
    /// Number of dispatches.
    pub calls: u64,
    /// Device seconds in all.
    pub seconds: f64,
    /// Share of the device's time.
    pub share: f64,
    /// Voxel-pair evaluations.
    pub pairs: f64,
    /// Pairs per second, if it evaluates pairs.
    pub pairs_per_s: Option<f64>,
    /// Bytes that its dispatches touch at least: in each buffer the parts of the pairs and points of a dispatch, once per dispatch.
    pub bytes: f64,
    /// Bytes per second.
    pub bytes_per_s: Option<f64>,
    /// The limit of the device that binds it.
    #[serde(default)]
    pub limit: Option<Limit>,
    /// Least seconds that this limit allows for the kernel's operations, over the seconds taken.
    pub share_of_limit: Option<f64>,
    /// Registers, shared memory and so on, with the driver's names.
    pub statistics: BTreeMap<String, f64>,
}

/// The device's idle time while it was solving.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Gaps {
    /// Seconds between commands of one submission, where the second had to wait for the first.
    pub within_s: f64,
    /// The longest one, seconds.
    pub largest_within_s: f64,
    /// Seconds between submissions: the host was late.
    pub between_s: f64,
    /// The longest one, seconds.
    pub largest_between_s: f64,
}

/// Means over all iterations.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct IterationProfile {
    /// Number of iterations.
    pub count: usize,
    /// Seconds of an iteration.
    pub seconds: f64,
    /// Seconds of it in passes over pairs.
    pub pass_s: f64,
    /// Seconds of the rest.
    pub overhead_s: f64,
}

/// The profiles of all kernels, the longest first. `works` holds their operations, `grid_voxels` the voxels beyond the least
/// depth, by lateral resolution.
pub fn times(
    recording: &Recording,
    works: &BTreeMap<&str, Work>,
    trace: &[TracePoint],
    grid_voxels: &BTreeMap<u64, usize>,
    limits: &DeviceLimits,
) -> Vec<KernelProfile> {
    let mut all: BTreeMap<&'static str, KernelProfile> = BTreeMap::new();
    let mut met: BTreeSet<(&'static str, usize)> = BTreeSet::new();
    for (stage, ran) in staged(recording) {
        let k = all.entry(ran.kernel).or_default();
        k.calls += 1;
        k.seconds += ran.to - ran.from;
        let value = |name| recording.stages[stage].value(name);
        let pairs = value("pairs").unwrap_or(0) as f64;
        let active = active_at(trace, value("iteration").unwrap_or(0) as usize);
        k.bytes += works.get(ran.kernel).map_or(0.0, |work| work.bytes(pairs, active as f64));
        // All dispatches of a pass in one stage together evaluate every pair once.
        let voxels = pass_of(ran.kernel).and_then(|p| p.pairs);
        if let Some(voxels) = voxels.filter(|_| met.insert((ran.kernel, stage))) {
            let voxels = match voxels {
                Voxels::Active => active,
                Voxels::Grid => value("lateral").and_then(|n| grid_voxels.get(&n).copied()).unwrap_or(0),
            };
            k.pairs += voxels as f64 * pairs;
        }
    }
    let total: f64 = all.values().map(|k| k.seconds).sum();
    let mut list: Vec<KernelProfile> = all
        .into_iter()
        .map(|(kernel, mut k)| {
            let pass = pass_of(kernel);
            k.name = pass.map_or(kernel, |p| p.report).into();
            k.kernel = kernel.into();
            k.share = if total > 0.0 { k.seconds / total } else { 0.0 };
            let made = recording.kernels.get(kernel);
            if let Some(made) = made {
                k.code = made.code.name.into();
                k.statistics = made.statistics.iter().cloned().collect();
                k.statistics.retain(|_, value| value.abs() <= MOST_PLAUSIBLE);
            }
            let over_pairs = pass.is_some_and(|p| p.pairs.is_some());
            if over_pairs && k.seconds > 0.0 {
                k.pairs_per_s = Some(k.pairs / k.seconds);
            }
            let work = works.get(kernel).copied().unwrap_or_default();
            if k.bytes > 0.0 && k.seconds > 0.0 {
                k.bytes_per_s = Some(k.bytes / k.seconds);
                let bound = work.bound(limits, k.calls, k.bytes, k.pairs);
                (k.limit, k.share_of_limit) = (bound.map(|b| b.0), bound.map(|b| b.1 / k.seconds));
            }
            k
        })
        .collect();
    list.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    list
}

/// Commands that belong to a stage, with the stage's index: the solver's own work.
fn staged(recording: &Recording) -> impl Iterator<Item = (usize, &Ran)> {
    recording.device.iter().filter_map(|r| r.stage.map(|s| (s, r)))
}

/// Active voxels of an iteration (from 0). The domain changes only between blocks of iterations, and every block ends
/// in a point of the trace.
fn active_at(trace: &[TracePoint], iteration: usize) -> usize {
    let point = trace.iter().find(|p| p.iteration > iteration);
    point.or(trace.last()).map_or(0, |p| p.active)
}

/// The device's idle time between the first and the last command of the solver.
pub fn gaps(recording: &Recording) -> Gaps {
    let mut gaps = Gaps::default();
    let ran: Vec<&Ran> = staged(recording).map(|(_, r)| r).collect();
    for pair in ran.windows(2) {
        let idle = (pair[1].from - pair[0].to).max(0.0);
        let (sum, largest) = if pair[0].submission == pair[1].submission {
            (&mut gaps.within_s, &mut gaps.largest_within_s)
        } else {
            (&mut gaps.between_s, &mut gaps.largest_between_s)
        };
        *sum += idle;
        *largest = largest.max(idle);
    }
    gaps
}

/// The mean time of an iteration: passes over pairs, and the rest.
pub fn iterations(recording: &Recording) -> IterationProfile {
    // Stage, its end, seconds, seconds of passes.
    let mut each: Vec<(usize, f64, f64, f64)> = vec![];
    let mut before: Option<&Ran> = None;
    for (stage, ran) in staged(recording) {
        if recording.stages[stage].name == "iteration" {
            // An iteration includes the wait for the command before it.
            let same = before.filter(|b| b.submission == ran.submission);
            let from = same.map_or(ran.from, |b| b.to);
            if each.last().is_none_or(|e| e.0 != stage) {
                each.push((stage, from, 0.0, 0.0));
            }
            if let Some(e) = each.last_mut() {
                e.2 = ran.to - e.1;
                e.3 += if pass_of(ran.kernel).is_some_and(|p| p.pairs.is_some()) {
                    ran.to - ran.from
                } else {
                    0.0
                };
            }
        }
        before = Some(ran);
    }
    let count = each.len();
    let mean = |sum: f64| if count > 0 { sum / count as f64 } else { 0.0 };
    let (seconds, pass_s) = (mean(each.iter().map(|e| e.2).sum()), mean(each.iter().map(|e| e.3).sum()));
    IterationProfile { count, seconds, pass_s, overhead_s: seconds - pass_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use thirdbounce::gpu::Stage;

    fn recording() -> Recording {
        let stage =
            |name, iteration| Stage::new(name, &[("iteration", iteration), ("lateral", 8), ("pairs", 5)]);
        let ran = |kernel, stage, submission, from, to| Ran { kernel, stage, submission, from, to };
        Recording {
            stages: vec![stage("start", 0), stage("iteration", 0), stage("iteration", 1)],
            device: vec![
                ran("copy", None, 1, 0.0, 0.5),
                ran("backproject", Some(0), 2, 1.0, 2.0),
                ran("forward", Some(1), 2, 2.25, 3.0),
                ran("forward", Some(1), 2, 3.0, 4.0),
                ran("finish", Some(1), 2, 4.5, 5.0),
                ran("forward", Some(2), 3, 7.0, 8.0),
                ran("finish", Some(2), 3, 8.0, 8.25),
            ],
            ..Recording::default()
        }
    }

    fn trace() -> Vec<TracePoint> {
        let point = |iteration, active| TracePoint {
            iteration,
            seconds: 0.0,
            gpu_seconds: 0.0,
            lateral: 8,
            pairs: 5,
            active,
            active_ratio: 0.0,
            loss: 0.0,
            data_loss: 0.0,
        };
        vec![point(1, 100), point(2, 10)]
    }

    #[test]
    fn pairs_count_once_per_pass_with_the_voxels_of_their_iteration() {
        let limits = DeviceLimits { copy_bytes_per_s: 1e3, ..DeviceLimits::default() };
        let works = [("forward", Work { bytes_of_pair: 20.0, ..Work::default() })].into();
        let k = times(&recording(), &works, &trace(), &[(8, 1000)].into(), &limits);
        let of = |name: &str| k.iter().find(|k| k.name == name).unwrap();
        assert_eq!((of("forward").calls, of("forward").pairs, of("forward").seconds), (3, 550.0, 2.75));
        assert_eq!(of("forward").pairs_per_s, Some(200.0));
        assert_eq!((of("forward").bytes, of("forward").share_of_limit), (300.0, Some(300.0 / 1e3 / 2.75)));
        assert_eq!((of("forward").limit, of("finish").limit), (Some(Limit::Memory), None));
        assert_eq!(of("finish").share_of_limit, None);
        assert_eq!(
            (of("backward_project").pairs, of("backward_project").kernel.as_str()),
            (5000.0, "backproject")
        );
        assert_eq!((of("finish").pairs, of("finish").pairs_per_s), (0.0, None));
        assert!((k.iter().map(|k| k.share).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(k.iter().all(|k| k.name != "copy"), "uploads are not the solver's");
        assert!(k.is_sorted_by(|a, b| a.seconds >= b.seconds));
    }

    #[test]
    fn idle_time_is_split_by_who_is_late() {
        let want = Gaps { within_s: 0.75, largest_within_s: 0.5, between_s: 2.0, largest_between_s: 2.0 };
        assert_eq!(gaps(&recording()), want);
        assert_eq!(gaps(&Recording::default()), Gaps::default());
    }

    #[test]
    fn an_iteration_is_what_lies_between_its_ends() {
        // The first from the end of `backproject` at 2 to 5, the second from 7 to 8.25.
        let want = IterationProfile { count: 2, seconds: 2.125, pass_s: 1.375, overhead_s: 0.75 };
        assert_eq!(iterations(&recording()), want);
    }
}
