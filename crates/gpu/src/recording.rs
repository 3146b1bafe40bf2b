//! Timeline of host and device, recorded if the device was opened with `timings`.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Instant;

use super::code::KernelCode;
use super::flight::Flight;
use super::schedule::Stage;

/// A span of host work, seconds since the device was opened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HostSpan {
    /// Activity.
    pub what: &'static str,
    /// Start.
    pub from: f64,
    /// End.
    pub to: f64,
}

/// A command executed by the device: a kernel, "copy" or "fill". Seconds on the host's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ran {
    /// Name of the kernel, "copy" or "fill".
    pub kernel: &'static str,
    /// Index in [`Recording::stages`], if inside a stage.
    pub stage: Option<usize>,
    /// Identifier of its submission.
    pub submission: u64,
    /// Time at which all dependencies were complete.
    pub from: f64,
    /// Time at which the command was complete.
    pub to: f64,
}

/// A created kernel.
#[derive(Debug, Clone)]
pub struct KernelMade {
    /// Module.
    pub code: KernelCode,
    /// Specialization constants with their values.
    pub constants: Vec<(String, u32)>,
    /// Statistics of the compiled kernel under the driver's names; empty if unavailable.
    pub statistics: Vec<(String, f64)>,
}

/// The complete recording.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// Spans of the host.
    pub host: Vec<HostSpan>,
    /// Stages in order of submission.
    pub stages: Vec<Stage>,
    /// Commands executed by the device.
    pub device: Vec<Ran>,
    /// Kernels by name.
    pub kernels: BTreeMap<&'static str, KernelMade>,
}

pub(super) struct Recorder {
    start: Instant,
    held: Mutex<RecorderState>,
}

#[derive(Default)]
struct RecorderState {
    /// Device times are relative to the first timestamp read.
    recording: Recording,
    first_tick: Option<u64>,
    /// Host clock minus device clock, seconds. The end of a submission is observed late, so the minimum observed
    /// difference is the best estimate.
    offset: Option<f64>,
}

/// A span of host time, ended on drop.
#[must_use]
pub struct OpenSpan<'g> {
    recorder: Option<&'g Recorder>,
    what: &'static str,
    from: f64,
}

impl OpenSpan<'_> {
    /// Starts a span of host time, if there is a recorder.
    pub(super) fn begin<'g>(recorder: Option<&'g Recorder>, what: &'static str) -> OpenSpan<'g> {
        OpenSpan { recorder, what, from: recorder.map_or(0.0, Recorder::now) }
    }
}

impl Drop for OpenSpan<'_> {
    fn drop(&mut self) {
        let Some(recorder) = self.recorder else { return };
        let span = HostSpan { what: self.what, from: self.from, to: recorder.now() };
        recorder.with(|held| held.recording.host.push(span));
    }
}

impl Recorder {
    pub fn new() -> Recorder {
        Recorder { start: Instant::now(), held: Mutex::default() }
    }

    /// Seconds since the device was opened.
    pub fn now(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn with<T>(&self, work: impl FnOnce(&mut RecorderState) -> T) -> T {
        // Every change leaves a complete recording, so a panicked thread has not damaged it.
        work(&mut self.held.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    pub fn made(&self, name: &'static str, made: KernelMade) {
        self.with(|held| held.recording.kernels.insert(name, made));
    }

    /// Adds a submission that has just been observed to finish. `tick` is in seconds.
    pub fn ran(&self, flight: &Flight, stamps: &[u64], tick: f64) {
        let seen = self.now();
        self.with(|held| {
            let first = *held.first_tick.get_or_insert(stamps[0]);
            // A device may restart its clock: timestamps before the first one are negative times.
            let seconds = |stamp: u64| stamp.wrapping_sub(first) as i64 as f64 * tick;
            let last = stamps.iter().copied().map(seconds).fold(f64::NEG_INFINITY, f64::max);
            held.offset = Some(held.offset.map_or(seen - last, |o| o.min(seen - last)));
            let known = held.recording.stages.len();
            // The stage continued by this submission, unless it was taken in the meantime.
            let again =
                usize::from(flight.continues_stage && held.recording.stages.last() == flight.stages.first());
            let before = known - again;
            held.recording.stages.extend_from_slice(&flight.stages[again..]);
            held.recording.device.extend(flight.marks.iter().map(|m| Ran {
                kernel: m.kernel,
                stage: m.stage.map(|s| before + s),
                submission: flight.ticket.0,
                from: seconds(stamps[m.from as usize]),
                to: seconds(stamps[m.to as usize]),
            }));
        });
    }

    /// Adds a submission that ran on the host: (command, its stage, start and end on this clock).
    pub fn ran_on_host(
        &self,
        submission: u64,
        stages: &[Stage],
        ran: &[(&'static str, Option<usize>, [f64; 2])],
    ) {
        self.with(|held| {
            let before = held.recording.stages.len();
            held.recording.stages.extend_from_slice(stages);
            let all = ran.iter().map(|(kernel, stage, [from, to])| Ran {
                kernel,
                stage: stage.map(|s| before + s),
                submission,
                from: *from,
                to: *to,
            });
            held.recording.device.extend(all);
        });
    }

    /// Returns and clears the recording; kernels are kept.
    pub fn take(&self) -> Recording {
        self.with(|held| {
            let kernels = held.recording.kernels.clone();
            let mut taken =
                std::mem::replace(&mut held.recording, Recording { kernels, ..Recording::default() });
            let offset = held.offset.unwrap_or(0.0);
            for ran in &mut taken.device {
                ran.from += offset;
                ran.to += offset;
            }
            taken.host.sort_by(|a, b| a.from.total_cmp(&b.from).then(b.to.total_cmp(&a.to)));
            taken
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Mark;

    #[test]
    fn device_times_lie_on_the_hosts_clock_by_the_submission_that_was_seen_soonest() {
        let recorder = Recorder::new();
        let flight = |kernel, continues_stage| Flight {
            marks: vec![Mark { kernel, stage: Some(0), from: 0, to: 1 }],
            stages: vec![Stage::new("s", &[("i", 3)])],
            continues_stage,
            ..Flight::default()
        };
        let tick = 1e-9;
        // The device's clock has another origin. The first submission is observed late, the second immediately.
        let at = |seconds: f64| 7_000_000_000 + (seconds * 1e9) as u64;
        recorder.ran(&flight("a", false), &[at(0.0), at(1e-6)], tick);
        std::thread::sleep(std::time::Duration::from_millis(20));
        let soon = recorder.now();
        recorder.ran(&flight("b", false), &[at(0.5), at(1.0)], tick);
        let taken = recorder.take();
        let [a, b] = taken.device[..] else { panic!("{:?}", taken.device) };
        assert!((b.to - a.from - 1.0).abs() < 1e-9 && (a.to - a.from - 1e-6).abs() < 1e-12, "{a:?} {b:?}");
        // From the second alone it would end when observed; the first was observed 1 s of device time earlier.
        assert!((b.to - soon).abs() < 1e-3, "{b:?} seen at {soon}");
        assert_eq!((a.stage, b.stage), (Some(0), Some(1)), "stages of their own");
        assert!(recorder.take().device.is_empty(), "taken is taken");
        recorder.ran(&flight("c", true), &[at(1.0), at(1.1)], tick);
        recorder.ran(&flight("d", true), &[at(1.1), at(1.2)], tick);
        let taken = recorder.take();
        let stages: Vec<_> = taken.device.iter().map(|r| r.stage).collect();
        assert_eq!((stages, taken.stages.len()), (vec![Some(0), Some(0)], 1), "a stage of two submissions");
    }
}
