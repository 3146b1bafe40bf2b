//! What fits into the time of a frame, by what earlier frames took.

use std::time::Duration;

use crate::solve::TracePoint;

/// The share of a frame's time that is planned; the rest is for what varies.
const PLANNED: f64 = 0.85;

/// The share of its iterations that the first frame takes, before anything is measured.
const FIRST: f64 = 0.2;

/// What a warm frame takes beside its iterations, in iterations of the volume, before that is measured.
const BESIDE: f64 = 4.0;

/// The weight of a new measurement against all before it.
const NEW: f64 = 0.5;

/// Measured seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pace {
    /// A cold frame with all its iterations.
    cold: Option<f64>,
    /// A warm frame without its iterations.
    beside: Option<f64>,
    /// An iteration of the volume on the finest grid, and one of the surface.
    each: [Option<f64>; 2],
}

/// Takes a new value into account. A slower device shows at once.
fn learn(known: &mut Option<f64>, seconds: f64) {
    let mean = known.map_or(seconds, |k| (NEW * seconds + (1.0 - NEW) * k).max(0.9 * seconds));
    *known = Some(mean);
}

/// Seconds of an iteration, from points of a trace at one level; `None` with fewer than two.
pub fn rate(points: &[TracePoint]) -> Option<f64> {
    let [first, .., last] = points else { return None };
    let iterations = last.iteration - first.iteration;
    (iterations > 0).then(|| (last.seconds - first.seconds) / iterations as f64)
}

impl Pace {
    /// The share of its iterations that a cold frame can take.
    pub fn share(&self, budget: Option<Duration>) -> f64 {
        match (budget, self.cold) {
            (None, _) => 1.0,
            (Some(_), None) => FIRST,
            (Some(budget), Some(cold)) => (PLANNED * budget.as_secs_f64() / cold).min(1.0),
        }
    }

    /// The iterations of volume and surface that a warm frame can take: those `wanted`, or fewer of both in the same ratio.
    /// At least one of each that is wanted.
    pub fn iterations(&self, budget: Option<Duration>, wanted: [usize; 2]) -> [usize; 2] {
        let (Some(budget), [Some(volume), surface]) = (budget, self.each) else { return wanted };
        let beside = self.beside.unwrap_or(BESIDE * volume);
        let all = wanted[0] as f64 * volume + wanted[1] as f64 * surface.unwrap_or(volume);
        let share = ((PLANNED * budget.as_secs_f64() - beside) / all).clamp(0.0, 1.0);
        wanted.map(|n| ((share * n as f64) as usize).max(n.min(1)))
    }

    /// A cold frame with a `share` of its iterations took so long.
    pub fn learn_cold(&mut self, share: f64, seconds: f64) {
        learn(&mut self.cold, seconds / share);
    }

    /// Iterations of the volume on the finest grid, and of the surface, took so long.
    pub fn learn_rates(&mut self, each: [Option<f64>; 2]) {
        for (known, new) in self.each.iter_mut().zip(each) {
            new.into_iter().for_each(|seconds| learn(known, seconds));
        }
    }

    /// A warm frame with so many iterations took so long.
    pub fn learn_warm(&mut self, iterations: [usize; 2], seconds: f64) {
        let [volume, surface] = self.each.map(|s| s.unwrap_or(0.0));
        let of_iterations = iterations[0] as f64 * volume + iterations[1] as f64 * surface;
        learn(&mut self.beside, (seconds - of_iterations).max(0.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device on which everything takes as long as it says.
    struct Device {
        cold: f64,
        beside: f64,
        each: [f64; 2],
    }

    impl Device {
        /// Seconds of a warm frame, which `pace` plans and learns from, and its iterations.
        fn frame(&self, pace: &mut Pace, budget: Duration) -> (f64, [usize; 2]) {
            let done = pace.iterations(Some(budget), [12, 12]);
            let seconds = self.beside + done[0] as f64 * self.each[0] + done[1] as f64 * self.each[1];
            pace.learn_rates(self.each.map(Some));
            pace.learn_warm(done, seconds);
            (seconds, done)
        }

        fn slower(&self, times: f64) -> Device {
            let each = self.each.map(|s| times * s);
            Device { cold: times * self.cold, beside: times * self.beside, each }
        }
    }

    #[test]
    fn frames_keep_their_time_on_a_slow_device_that_gets_slower() {
        let device = Device { cold: 3.0, beside: 0.03, each: [0.01, 0.008] };
        let budget = Duration::from_millis(200);
        let mut pace = Pace::default();
        // The first frame measures.
        assert_eq!(pace.share(Some(budget)), FIRST);
        pace.learn_cold(FIRST, FIRST * device.cold);
        pace.learn_rates([Some(device.each[0]), None]);
        for _ in 0..3 {
            let (seconds, done) = device.frame(&mut pace, budget);
            assert!(seconds <= 0.2 && done[0] >= 6 && done[1] >= 6, "{seconds} {done:?}");
        }
        // Frames get slower: the one in which it happens is late, the next ones are not.
        let slow = device.slower(2.5);
        assert!(slow.frame(&mut pace, budget).0 > 0.2);
        for _ in 0..3 {
            let (seconds, done) = slow.frame(&mut pace, budget);
            assert!(seconds <= 0.2 && done[0] >= 1 && done[1] >= 1, "{seconds} {done:?}");
        }
        // And faster again: all iterations come back.
        let fast = device.slower(0.5);
        let frames: Vec<_> = (0..10).map(|_| fast.frame(&mut pace, budget)).collect();
        assert!(frames.iter().all(|f| f.0 <= 0.2) && frames[9].1 == [12, 12], "{frames:?}");
    }

    #[test]
    fn a_cold_frame_takes_the_share_that_fits_and_too_little_time_leaves_one_iteration() {
        let mut pace = Pace::default();
        assert_eq!((pace.share(None), pace.iterations(None, [12, 9])), (1.0, [12, 9]));
        pace.learn_cold(0.2, 0.6);
        let share = pace.share(Some(Duration::from_secs(1)));
        assert!((share - PLANNED / 3.0).abs() < 1e-9, "{share}");
        assert_eq!(pace.share(Some(Duration::from_secs(10))), 1.0);
        pace.learn_rates([Some(1.0), Some(1.0)]);
        assert_eq!(pace.iterations(Some(Duration::from_millis(1)), [12, 9]), [1, 1]);
        assert_eq!(pace.iterations(Some(Duration::from_millis(1)), [12, 0]), [1, 0]);
    }

    #[test]
    fn a_rate_is_that_between_the_first_and_the_last_point() {
        let point = |iteration, seconds| TracePoint {
            iteration,
            seconds,
            gpu_seconds: 0.0,
            lateral: 8,
            pairs: 4,
            active: 1,
            active_ratio: 0.0,
            loss: 0.0,
            data_loss: 0.0,
        };
        assert_eq!(rate(&[point(1, 3.0), point(3, 3.5), point(5, 5.0)]), Some(0.5));
        assert_eq!(
            (rate(&[point(1, 3.0)]), rate(&[]), rate(&[point(2, 1.0), point(2, 1.0)])),
            (None, None, None)
        );
    }
}
