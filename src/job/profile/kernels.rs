//! Turns a recording into figures per kernel, per iteration, and of the device's idle time.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::limits::DeviceLimits;
use crate::gpu::spirv::{Counts, count_loop};
use crate::gpu::{Constant, KernelCode, Ran, Recording};
use crate::solve::{TracePoint, Voxels, pass_of};
use crate::transport::kernels::constant;

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
    /// The least time that the device's limits allow, over the time that it took.
    pub share_of_limit: Option<f64>,
    /// The least time that a pair can take, if it evaluates pairs.
    pub floor: Option<Floor>,
    /// Instructions of a pair, counted in the compiled module.
    pub counts: Option<Counts>,
    /// Instructions that the outer loop runs once for this many pairs: in a product, those for the scanned point's arm.
    pub shared: Option<(Counts, u32)>,
    /// Registers, shared memory and so on, with the driver's names.
    pub statistics: BTreeMap<String, f64>,
}

/// The least seconds of a pair by the limit of each part of the device. The largest of them counts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Floor {
    /// Seconds to issue all counted instructions, at the rate of fused multiply-adds.
    pub issue: f64,
    /// Seconds of the special functions.
    pub special: f64,
    /// Seconds of the loads.
    pub load: f64,
    /// Seconds of the atomics.
    pub atomic: f64,
}

impl Floor {
    /// The floor of these instructions on a device with these limits.
    pub fn new(c: &Counts, l: &DeviceLimits, float_atomics: bool) -> Floor {
        let global = match l.global_atomic_float_per_s.filter(|_| float_atomics) {
            Some(rate) => rate,
            None => l.global_atomic_per_s,
        };
        Floor {
            issue: f64::from(c.issued()) / l.fma_per_s,
            special: f64::from(c.special) / l.special_per_s,
            // A broadcast is issued for every lane, but takes a load's bandwidth once for a whole subgroup.
            load: f64::from(c.loads) / l.load_per_s,
            atomic: f64::from(c.atomics) / global + f64::from(c.shared_atomics) / l.shared_atomic_per_s,
        }
    }

    /// Seconds of the slowest part: at best, all parts overlap.
    pub fn seconds(&self) -> f64 {
        self.issue.max(self.special).max(self.load).max(self.atomic)
    }

    /// Name of the slowest part.
    pub fn bound(&self) -> &'static str {
        let all =
            [(self.issue, "issue"), (self.special, "special"), (self.load, "load"), (self.atomic, "atomic")];
        all.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or("", |(_, name)| name)
    }
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

/// The profiles of all kernels, the longest first. `grid_voxels` holds the voxels beyond the least depth, by lateral
/// resolution.
pub fn times(
    recording: &Recording,
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
        // All dispatches of a pass in one stage together evaluate every pair once.
        let voxels = pass_of(ran.kernel).and_then(|p| p.pairs);
        if let Some(voxels) = voxels.filter(|_| met.insert((ran.kernel, stage))) {
            let value = |name| recording.stages[stage].value(name);
            let voxels = match voxels {
                Voxels::Active => active_at(trace, value("iteration").unwrap_or(0) as usize),
                Voxels::Grid => value("lateral").and_then(|n| grid_voxels.get(&n).copied()).unwrap_or(0),
            };
            k.pairs += voxels as f64 * value("pairs").unwrap_or(0) as f64;
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
            }
            let over_pairs = pass.is_some_and(|p| p.pairs.is_some());
            if over_pairs && k.seconds > 0.0 {
                k.pairs_per_s = Some(k.pairs / k.seconds);
            }
            if let Some(made) = made.filter(|_| over_pairs) {
                let float = made.code.name.ends_with("_float");
                (k.counts, k.shared) = counted(&made.code, &made.constants);
                let of = |c: &Counts| Floor::new(c, limits, float);
                let floor = k
                    .counts
                    .map(|c| of(&c))
                    .map(|f| k.shared.map_or(f, |(c, pairs)| f.and(of(&c).shared(pairs))));
                k.share_of_limit = floor.and_then(|f| Some(f.seconds() * k.pairs_per_s?));
                k.floor = floor;
            }
            k
        })
        .collect();
    list.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    list
}

/// What a turn of a kernel's main loop counts in its SPIR-V, and of the enclosing loop per number of turns.
pub(super) fn counted(
    code: &KernelCode,
    constants: &[(String, u32)],
) -> (Option<Counts>, Option<(Counts, u32)>) {
    let at_once = [constant::OTHERS, constant::FORWARD_OTHERS].map(Constant::name);
    let others = constants.iter().find(|c| at_once.contains(&c.0.as_str())).map_or(1, |c| c.1);
    let counted = count_loop(code, constants);
    let shared = counted.map(|c| (c[1], others)).filter(|s| s.0 != Counts::default());
    (counted.map(|c| c[0]), shared)
}

impl Floor {
    /// The sum of two floors.
    fn and(self, o: Floor) -> Floor {
        Floor {
            issue: self.issue + o.issue,
            special: self.special + o.special,
            load: self.load + o.load,
            atomic: self.atomic + o.atomic,
        }
    }

    /// The floor of one pair, if a turn evaluates this many.
    fn shared(self, pairs: u32) -> Floor {
        let by = |v: f64| v / f64::from(pairs.max(1));
        Floor {
            issue: by(self.issue),
            special: by(self.special),
            load: by(self.load),
            atomic: by(self.atomic),
        }
    }
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
    use crate::gpu::Stage;

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
        let k = times(&recording(), &trace(), &[(8, 1000)].into(), &DeviceLimits::default());
        let of = |name: &str| k.iter().find(|k| k.name == name).unwrap();
        assert_eq!((of("forward").calls, of("forward").pairs, of("forward").seconds), (3, 550.0, 2.75));
        assert_eq!(of("forward").pairs_per_s, Some(200.0));
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

    #[test]
    fn the_scarcest_part_of_the_device_is_the_floor() {
        let limits = DeviceLimits {
            fma_per_s: 100.0,
            special_per_s: 10.0,
            load_per_s: 50.0,
            global_atomic_per_s: 20.0,
            global_atomic_float_per_s: Some(4.0),
            shared_atomic_per_s: 40.0,
            ..DeviceLimits::default()
        };
        let counts = Counts { fma: 10, special: 2, other: 3, loads: 5, broadcasts: 8, ..Counts::default() };
        let floor = Floor::new(&counts, &limits, true);
        assert_eq!((floor.issue, floor.special, floor.load, floor.atomic), (0.28, 0.2, 0.1, 0.0));
        assert_eq!((floor.seconds(), floor.bound()), (0.28, "issue"));
        let adding = Counts { atomics: 2, ..counts };
        assert_eq!(Floor::new(&adding, &limits, true).bound(), "atomic");
        assert_eq!(Floor::new(&adding, &limits, true).atomic, 0.5);
        assert_eq!(Floor::new(&adding, &limits, false).atomic, 0.1);
        assert_eq!(floor.shared(2).special, 0.1);
        assert_eq!(floor.and(floor.shared(2)).issue, 0.28 + 0.14);
    }
}
