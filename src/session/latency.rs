//! How long frames take, from their submission to their result.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Frames that are remembered.
const LAST: usize = 256;

/// Times of the last frames, up to 256, from submission to result: what waits is included.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Latency {
    /// Frames that were solved since the session began.
    pub frames: u64,
    /// Frames that were submitted and never solved, as newer ones replaced them.
    pub dropped: u64,
    /// The last frame's.
    pub last: Duration,
    /// Half of the frames took no longer.
    pub median: Duration,
    /// Nine of ten.
    pub p90: Duration,
    /// Ninety-nine of a hundred.
    pub p99: Duration,
    /// Results in a second, while frames came; 0 before the second one.
    pub frames_per_second: f64,
}

/// Remembers them.
#[derive(Default)]
pub(super) struct Latencies {
    frames: u64,
    pub dropped: u64,
    /// When each of the last results was there, and how long that took.
    last: VecDeque<(Instant, Duration)>,
}

impl Latencies {
    /// With room for all that it remembers.
    pub fn with_room() -> Latencies {
        Latencies { last: VecDeque::with_capacity(LAST), ..Latencies::default() }
    }

    /// A frame that was submitted at `begun` is done at `now`.
    pub fn add(&mut self, begun: Instant, now: Instant) {
        self.frames += 1;
        if self.last.len() == LAST {
            self.last.pop_front();
        }
        self.last.push_back((now, now.duration_since(begun)));
    }

    pub fn reported(&self) -> Latency {
        let mut sorted: Vec<Duration> = self.last.iter().map(|(_, took)| *took).collect();
        sorted.sort();
        // The least value that this percentage of the frames does not exceed.
        let at = |percent: usize| {
            let place = (percent * sorted.len()).div_ceil(100).max(1) - 1;
            sorted.get(place).copied().unwrap_or_default()
        };
        let span = match (self.last.front(), self.last.back()) {
            (Some(first), Some(last)) => last.0.duration_since(first.0).as_secs_f64(),
            _ => 0.0,
        };
        Latency {
            frames: self.frames,
            dropped: self.dropped,
            last: self.last.back().map_or(Duration::ZERO, |l| l.1),
            median: at(50),
            p90: at(90),
            p99: at(99),
            frames_per_second: if span > 0.0 { (self.last.len() - 1) as f64 / span } else { 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_the_last_frames() {
        let mut all = Latencies::with_room();
        assert_eq!(all.reported(), Latency::default());
        let begin = Instant::now();
        let ms = Duration::from_millis;
        // 100 frames that took 1 to 100 ms, 10 ms apart.
        for i in 1..=100 {
            all.add(begin + ms(10 * i - i), begin + ms(10 * i));
        }
        let reported = all.reported();
        assert_eq!([reported.median, reported.p90, reported.p99, reported.last], [50, 90, 99, 100].map(ms));
        assert!((reported.frames_per_second - 100.0).abs() < 1e-6 && reported.frames == 100);
        // They are forgotten after 256 others.
        for i in 101..=356 {
            all.add(begin + ms(10 * i - 7), begin + ms(10 * i));
        }
        let reported = all.reported();
        assert_eq!([reported.median, reported.p99], [ms(7); 2]);
        assert_eq!(reported.frames, 356);
    }
}
