//! Work per dispatch and submission, and watchdog timeouts: drivers reset a device that does not respond within
//! seconds (2 s on Windows, 5 to 10 s elsewhere).
//!
//! Work is counted in turns of kernels' main loops over all invocations: one per voxel and laser-sensor pair, several
//! for shorter loops. Every dispatch declares an upper bound ([`super::Schedule::dispatch`]).

use std::borrow::Cow;
use std::iter;
use std::ops::Range;
use std::time::Duration;

use super::instance::DeviceKind;
use super::schedule::{Command, Size};

/// Work per submission, seconds.
const SUBMISSION: f64 = 0.1;

/// Maximum duration of a dispatch in seconds at the kind's rate. Submitted dispatches cannot be divided, so this
/// allows for devices ten times slower. The rate of integrated devices is already that of the slowest, so their limit
/// is four times as large.
const DISPATCH: f64 = 0.04;
const DISPATCH_OF_INTEGRATED: f64 = 0.16;

/// Time between two progress reports on the host's processors, seconds.
const HEARD: f64 = 0.1;

/// Shorter submissions, in seconds, measure overhead rather than the device.
const MEASURABLE: f64 = 1e-3;

/// Minimum watchdog timeout, seconds, which includes the compilation of kernels.
const WATCHDOG: f64 = 120.0;
/// The same for CPUs, which are shared with other programs and may run validation.
const WATCHDOG_OF_CPU: f64 = 600.0;

/// Watchdog timeout as a multiple of the time expected from the kind's rate.
const TIMEOUT_RATIO: f64 = 100.0;

/// Maximum ratio of the estimated rate to that of the kind. Upper bounds of work far above the actual work would
/// otherwise increase the rate without limit, and make the next level one long submission.
const MAX_RATE_RATIO: f64 = 16.0;

/// Loop turns per second, measured or expected, of a kind of device.
pub(super) fn rate_of(kind: DeviceKind) -> f64 {
    match kind {
        DeviceKind::Discrete | DeviceKind::Virtual => 3e10,
        DeviceKind::Integrated | DeviceKind::Other => 2e9,
        DeviceKind::Host => 1e9,
        DeviceKind::Cpu => 1e8,
    }
}

/// Maximum loop turns per dispatch. CPUs have no watchdog, and division costs time.
pub(super) fn dispatch_of(kind: DeviceKind) -> u64 {
    match kind {
        DeviceKind::Host | DeviceKind::Cpu => u64::MAX,
        DeviceKind::Integrated => (DISPATCH_OF_INTEGRATED * rate_of(kind)) as u64,
        _ => (DISPATCH * rate_of(kind)) as u64,
    }
}

/// The commands with every dispatch above `most` turns divided, down to single workgroups. The parts run the same
/// workgroups; for indirect dispatches, all within their bounds.
pub(super) fn divided(commands: &[Command], most: u64) -> Cow<'_, [Command]> {
    let long = |c: &Command| match c {
        Command::Dispatch {
            size: Size::Groups(groups) | Size::Indirect(_, _, Some(groups)), work, ..
        } => (*work > most).then_some((*groups, *work)),
        _ => None,
    };
    if !commands.iter().any(|c| long(c).is_some()) {
        return Cow::Borrowed(commands);
    }
    let mut all = Vec::with_capacity(2 * commands.len());
    for command in commands {
        let Some((groups, work)) = long(command) else {
            all.push(command.clone());
            continue;
        };
        // In reverse order: lavapipe (Mesa 22.3) adds the first workgroup of a dispatch to those of a subsequent
        // indirect one.
        for [from, count] in boxes(groups, work, most).into_iter().rev() {
            let mut part = command.clone();
            if let Command::Dispatch { size, first, work: of_part, .. } = &mut part {
                *size = Size::Groups(count);
                *first = from;
                *of_part = share([count, groups], work);
            }
            all.push(part);
        }
    }
    Cow::Owned(all)
}

fn product(counts: [u32; 3]) -> u128 {
    counts.iter().map(|n| u128::from(*n)).product()
}

/// Work of a subset of the workgroups, rounded up.
fn share([some, all]: [[u32; 3]; 2], work: u64) -> u64 {
    let turns = (u128::from(work) * product(some)).div_ceil(product(all).max(1));
    u64::try_from(turns).unwrap_or(u64::MAX)
}

/// Workgroups as boxes (first, counts) of at most `most` turns of `work`, unless a single workgroup exceeds it: rows
/// along x, several or a part of one.
fn boxes([x, y, z]: [u32; 3], work: u64, most: u64) -> Vec<[[u32; 3]; 2]> {
    // Workgroups of a box, those along z counted once.
    let fit = u128::from(most) * product([x, y, 1]) / u128::from(work.max(1));
    let fit = u64::try_from(fit).unwrap_or(u64::MAX);
    let columns = fit.clamp(1, u64::from(x.max(1))) as u32;
    let rows = (fit / u64::from(x.max(1))).clamp(1, u64::from(y.max(1))) as u32;
    let cuts = |all: u32, by: u32| (0..all).step_by(by as usize).map(move |at| [at, by.min(all - at)]);
    let of_rows =
        |[at_y, of_y]: [u32; 2]| cuts(x, columns).map(move |[at_x, of_x]| [[at_x, at_y, 0], [of_x, of_y, z]]);
    cuts(y, rows).flat_map(of_rows).collect()
}

/// Estimated speed of a device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pace {
    kind: DeviceKind,
    /// Maximum loop turns per submission, if specified.
    given: Option<u64>,
    /// Loop turns per second. Schedules declare upper bounds, so this may exceed the device's actual rate.
    rate: f64,
    /// Turns and seconds of submissions too short to be measured individually.
    short: (u64, f64),
}

impl Pace {
    pub fn new(kind: DeviceKind, given: Option<u64>) -> Pace {
        Pace { kind, given, rate: rate_of(kind), short: (0, 0.0) }
    }

    /// Maximum loop turns per submission.
    pub fn submission(&self) -> u64 {
        match (self.given, self.kind) {
            (Some(given), _) => given,
            (None, DeviceKind::Cpu) => u64::MAX,
            _ => (SUBMISSION * self.rate) as u64,
        }
    }

    /// Loop turns between two progress reports.
    pub fn heard(&self) -> u64 {
        (HEARD * self.rate) as u64
    }

    /// Updates the rate from a finished submission of at most `work` turns. The rate decreases immediately and
    /// increases in steps: a new level may have tighter bounds. Short submissions are accumulated; their sum includes
    /// all overhead and is a lower bound, so it only increases the rate.
    pub fn learn(&mut self, work: u64, seconds: f64) {
        if work == 0 || seconds <= 0.0 {
            return;
        }
        let usual = rate_of(self.kind);
        let most = (2.0 * self.rate).min(MAX_RATE_RATIO * usual);
        if seconds > MEASURABLE {
            self.rate = (work as f64 / seconds).clamp(1e-3 * usual, most);
            return;
        }
        self.short = (self.short.0.saturating_add(work), self.short.1 + seconds);
        let (work, seconds) = self.short;
        if seconds > MEASURABLE {
            self.short = (0, 0.0);
            self.rate = (work as f64 / seconds).min(most).max(self.rate);
        }
    }

    /// Watchdog timeout for `work` turns.
    pub fn timeout(&self, work: u64) -> Duration {
        let base = if self.kind == DeviceKind::Cpu { WATCHDOG_OF_CPU } else { WATCHDOG };
        Duration::from_secs_f64(base + TIMEOUT_RATIO * work as f64 / rate_of(self.kind))
    }
}

/// Parts of a schedule to submit separately: each with at most `most` loop turns, or a single longer dispatch. One empty
/// part for an empty schedule.
pub(super) fn parts(commands: &[Command], most: u64) -> impl Iterator<Item = Range<usize>> {
    let mut next = Some(0);
    iter::from_fn(move || {
        let from = next.take()?;
        let mut sum = 0u64;
        for (i, command) in commands.iter().enumerate().skip(from) {
            let work = command.work();
            if sum > 0 && work > 0 && sum.saturating_add(work) > most {
                next = Some(i);
                return Some(from..i);
            }
            sum = sum.saturating_add(work);
        }
        Some(from..commands.len())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Kernel, Schedule};

    fn of(works: &[u64]) -> Vec<Command> {
        let mut s = Schedule::default();
        for work in works {
            s.dispatch(Kernel::named("k"), [1, 1, 1], *work);
        }
        s.commands
    }

    #[test]
    fn a_submission_holds_as_much_work_as_it_may() {
        let pace = Pace::new(DeviceKind::Discrete, Some(10));
        let parts = |pace: &Pace, works: &[u64]| parts(&of(works), pace.submission()).collect::<Vec<_>>();
        assert_eq!(parts(&pace, &[]), vec![Range { start: 0, end: 0 }]);
        assert_eq!(parts(&pace, &[0, 4, 6, 0, 1, 0]), [0..4, 4..6]);
        assert_eq!(parts(&pace, &[30, 0, 30]), [0..2, 2..3], "a dispatch is not divided here");
        let whole = Pace::new(DeviceKind::Cpu, None);
        assert_eq!(parts(&whole, &[u64::MAX, u64::MAX]), vec![Range { start: 0, end: 2 }]);
    }

    #[test]
    fn a_long_dispatch_is_divided_and_every_workgroup_runs_once() {
        let of = |groups, work| {
            let mut s = Schedule::default();
            s.dispatch(Kernel::named("k"), groups, work);
            s.commands
        };
        for groups in [[1000, 1, 1], [32_768, 3, 1], [7, 5, 2], [1, 9, 1], [3, 1, 4], [0, 1, 1]] {
            for work in [99, 1000, 123_457, u64::MAX] {
                let whole = of(groups, work);
                let parts = divided(&whole, 100);
                let mut seen = vec![0u8; groups.iter().product::<u32>() as usize];
                for part in parts.iter() {
                    let Command::Dispatch { size: Size::Groups(count), first, .. } = part else { panic!() };
                    let runs: u32 = count.iter().product();
                    // Workgroups along z stay together.
                    assert!(part.work() <= 100 || runs == count[2], "{groups:?} {work}: {part:?}");
                    for i in 0..runs {
                        let at = [i % count[0], i / count[0] % count[1], i / (count[0] * count[1])];
                        let [x, y, z] = [0, 1, 2].map(|axis| first[axis] + at[axis]);
                        seen[((z * groups[1] + y) * groups[0] + x) as usize] += 1;
                    }
                }
                assert!(seen.iter().all(|n| *n == 1), "{groups:?} {work}");
                let sum = parts.iter().map(Command::work).fold(0u64, u64::saturating_add);
                assert!(seen.is_empty() || sum >= work, "{groups:?} {work}: {sum}");
            }
        }
        // Nothing is copied without long dispatches, and indirect dispatches without bounds stay whole.
        assert!(matches!(divided(&of([1000, 1, 1], 100), 100), Cow::Borrowed(_)));
        let indirect = |most: Option<[u32; 3]>| {
            let mut s = Schedule::default();
            let command = s.indirect(Kernel::named("k"), crate::Buffer::named("b"), 0, 1000);
            most.map(|groups| command.at_most(groups));
            s.commands
        };
        assert!(matches!(divided(&indirect(None), 100), Cow::Borrowed(_)));
        assert!(matches!(divided(&indirect(Some([40, 1, 1])), 1000), Cow::Borrowed(_)), "none is long");
        assert_eq!(*divided(&indirect(Some([40, 1, 1])), 100), *divided(&of([40, 1, 1], 1000), 100));
    }

    #[test]
    fn submissions_stay_well_below_half_a_second_on_a_device_that_is_slower_than_its_kind() {
        let mut pace = Pace::new(DeviceKind::Discrete, None);
        let slow = rate_of(DeviceKind::Discrete) / 10.0;
        let all = of(&[dispatch_of(DeviceKind::Discrete); 100]);
        let mut longest = 0.0f64;
        let mut at = 0;
        while at < all.len() {
            let part = parts(&all[at..], pace.submission()).next().expect("one at least");
            let work: u64 = all[at..][part.clone()].iter().map(Command::work).sum();
            let seconds = work as f64 / slow;
            if at > 0 {
                longest = longest.max(seconds);
            }
            pace.learn(work, seconds);
            at += part.len();
        }
        // At a tenth of the kind's rate one dispatch of 0.4 s remains.
        assert!(longest < 0.45, "{longest} s");
        let mut fast = Pace::new(DeviceKind::Discrete, None);
        fast.learn(1 << 40, 0.01);
        assert_eq!(fast.rate, 2.0 * rate_of(DeviceKind::Discrete), "it rises step by step");
        (0..20).for_each(|_| fast.learn(1 << 50, 0.01));
        assert_eq!(fast.rate, MAX_RATE_RATIO * rate_of(DeviceKind::Discrete), "and not without end");
    }

    #[test]
    fn a_fast_device_is_known_by_the_sum_of_its_short_submissions() {
        let usual = rate_of(DeviceKind::Discrete);
        let mut pace = Pace::new(DeviceKind::Discrete, None);
        // An iteration of a tenth of a millisecond at three times the default rate.
        let work = (3.0 * usual * 1e-4) as u64;
        (0..9).for_each(|_| pace.learn(work, 1e-4));
        assert_eq!(pace.rate, usual, "a millisecond is not over yet");
        (0..2).for_each(|_| pace.learn(work, 1e-4));
        assert_eq!(pace.rate, 2.0 * usual, "step by step");
        (0..22).for_each(|_| pace.learn(work, 1e-4));
        assert!((pace.rate / usual - 3.0).abs() < 1e-6, "{}", pace.rate / usual);
        // Little work with large overhead carries no information on the device.
        (0..100).for_each(|_| pace.learn(1000, 9e-4));
        assert!((pace.rate / usual - 3.0).abs() < 1e-6, "{}", pace.rate / usual);
        // A long submission does.
        pace.learn((0.1 * usual) as u64, 0.2);
        assert!((pace.rate / usual - 0.5).abs() < 1e-6, "{}", pace.rate / usual);
        // Submissions without device time are ignored.
        pace.learn(1 << 40, 0.0);
        assert!((pace.rate / usual - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_dispatch_of_an_integrated_device_is_no_shorter_than_it_must_be() {
        // 32 x 32 points and 300,000 voxels are one dispatch.
        assert!(dispatch_of(DeviceKind::Integrated) >= 1024 * 300_000);
        for kind in [DeviceKind::Discrete, DeviceKind::Virtual, DeviceKind::Integrated, DeviceKind::Other] {
            let slow = rate_of(kind) / 10.0;
            assert!(dispatch_of(kind) as f64 / slow < 2.0, "{kind}: a watchdog bites");
        }
    }

    #[test]
    fn patience_grows_with_the_work() {
        let pace = Pace::new(DeviceKind::Discrete, None);
        let of = |work: f64| pace.timeout(work as u64).as_secs_f64();
        assert_eq!(of(0.0), WATCHDOG);
        assert!((of(3e12) - WATCHDOG - 1e4).abs() < 1.0);
        assert!(Pace::new(DeviceKind::Cpu, None).timeout(u64::MAX).as_secs_f64() > 1e9);
    }
}
