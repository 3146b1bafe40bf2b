//! The clock of a solve: seconds of host and device, without measuring.

use std::time::{Duration, Instant};

pub(crate) struct Clock {
    start: Instant,
    paused: Duration,
    /// Seconds that were spent before this clock started.
    before: f64,
    /// Device seconds of the executor that do not count.
    gpu_apart: f64,
}

/// A moment at which the clock stood still.
pub(crate) struct Pause(Instant);

impl Clock {
    /// Starts now. `gpu_seconds`: device seconds of the executor so far.
    pub fn start(gpu_seconds: f64) -> Clock {
        Clock { start: Instant::now(), paused: Duration::ZERO, before: 0.0, gpu_apart: gpu_seconds }
    }

    /// Adds earlier work, in seconds of host and device.
    pub fn resume_from(&mut self, [seconds, gpu_seconds]: [f64; 2]) {
        self.before = seconds;
        self.gpu_apart -= gpu_seconds;
    }

    /// Seconds of host and device so far.
    pub fn now(&self, gpu_seconds: f64) -> [f64; 2] {
        let host = self.before + self.start.elapsed().saturating_sub(self.paused).as_secs_f64();
        [host, gpu_seconds - self.gpu_apart]
    }

    /// Stops counting until [`Clock::resume`].
    pub fn pause(&self) -> Pause {
        Pause(Instant::now())
    }

    /// Counts on; the time since the pause is left out.
    pub fn resume(&mut self, pause: Pause) {
        self.paused += pause.0.elapsed();
    }

    /// Leaves out `seconds` of device time.
    pub fn leave_out_gpu(&mut self, seconds: f64) {
        self.gpu_apart += seconds;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_spent_in_a_pause_does_not_count() {
        let mut clock = Clock::start(5.0);
        clock.resume_from([100.0, 2.0]);
        let pause = clock.pause();
        std::thread::sleep(Duration::from_millis(30));
        clock.resume(pause);
        clock.leave_out_gpu(0.5);
        let [host, device] = clock.now(7.0);
        assert!((100.0..100.02).contains(&host), "{host}");
        assert!((device - 3.5).abs() < 1e-12, "{device}");
    }
}
