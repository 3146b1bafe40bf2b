//! Fault injection for tests: a chosen call fails, fresh memory is poisoned, workgroups are shuffled, or buffers are
//! guarded.
//!
//! Without injected faults (the default) the cost is one comparison per point.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use ash::vk;

use super::names::Buffer;

/// A fallible call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Point {
    /// Memory, creation and binding of a buffer: fails as out of device memory.
    Allocation,
    /// Creation of any other object (kernels, pools, sets, command buffers, timestamps): fails as out of host memory.
    Object,
    /// Submission: fails as a lost device, which stays lost.
    Submission,
    /// As [`Point::Submission`].
    Wait,
}

impl Point {
    /// Every kind of call.
    pub const ALL: [Point; 4] = [Point::Allocation, Point::Object, Point::Submission, Point::Wait];
}

/// Faults to inject, for tests.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Faults {
    /// Call number N (from 0) of a kind since the device was opened fails. A number that is never reached only counts
    /// the calls ([`super::Gpu::reached`]).
    pub fail: Option<(Point, u64)>,
    /// Wait number N (from 0) since the device was opened times out immediately.
    pub hang: Option<u64>,
    /// After a loss, the driver reports an invalid read at this address.
    pub fault_address: Option<u64>,
    /// Fresh buffers are filled with this word.
    pub poison: Option<u32>,
    /// The workgroups of every dispatch run in an order drawn from this seed, with a wait between dispatches. Slow.
    pub shuffle: Option<u64>,
    /// Every buffer is followed by a canary, bound with it and checked when an executor is dropped:
    /// [`super::Gpu::take_guarded`]. Doubles the memory, outside the budget.
    pub guard: bool,
    /// Work is divided as on a discrete GPU, however slow the device is.
    pub discrete: bool,
}

impl Faults {
    pub(super) fn any(&self) -> bool {
        *self != Faults::default()
    }
}

/// A buffer with a write past its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Overrun {
    /// The buffer.
    pub buffer: Buffer,
    /// Its size in the plan, bytes.
    pub bytes: u64,
    /// Byte offset of the first overwritten word, from the start of the buffer.
    pub at: u64,
}

/// Result of the canary checks of all dropped executors.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Guarded {
    /// Number of buffers whose canaries were checked.
    pub buffers: usize,
    /// Buffers with a write past their end.
    pub overruns: Vec<Overrun>,
}

/// Injected faults of a device, and their counters.
pub(super) struct InjectedFaults {
    pub faults: Faults,
    reached: [AtomicU64; Point::ALL.len()],
    lost: AtomicBool,
    pub guarded: Mutex<Guarded>,
}

impl InjectedFaults {
    pub fn new(faults: Faults) -> InjectedFaults {
        InjectedFaults {
            faults,
            reached: Default::default(),
            lost: AtomicBool::new(false),
            guarded: Mutex::default(),
        }
    }

    /// Number of calls of a kind.
    pub fn reached(&self, point: Point) -> u64 {
        self.reached[point as usize].load(Relaxed)
    }

    /// Called before every fallible call.
    pub fn before_call(&self, point: Point) -> Result<(), vk::Result> {
        if self.lost.load(Relaxed) {
            return Err(vk::Result::ERROR_DEVICE_LOST);
        }
        let number = self.reached[point as usize].fetch_add(1, Relaxed);
        if point == Point::Wait && self.faults.hang == Some(number) {
            return Err(vk::Result::TIMEOUT);
        }
        if self.faults.fail != Some((point, number)) {
            return Ok(());
        }
        Err(match point {
            Point::Allocation => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            Point::Object => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
            Point::Submission | Point::Wait => {
                self.lost.store(true, Relaxed);
                vk::Result::ERROR_DEVICE_LOST
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_fails_when_its_turn_comes_and_a_lost_device_stays_lost() {
        let injected_faults =
            InjectedFaults::new(Faults { fail: Some((Point::Allocation, 1)), ..Faults::default() });
        let all: Vec<bool> = (0..4).map(|_| injected_faults.before_call(Point::Allocation).is_ok()).collect();
        assert_eq!(all, [true, false, true, true]);
        assert_eq!(injected_faults.reached(Point::Allocation), 4);
        let injected_faults =
            InjectedFaults::new(Faults { fail: Some((Point::Wait, 0)), ..Faults::default() });
        assert!(injected_faults.before_call(Point::Submission).is_ok());
        assert_eq!(injected_faults.before_call(Point::Wait), Err(vk::Result::ERROR_DEVICE_LOST));
        assert_eq!(injected_faults.before_call(Point::Allocation), Err(vk::Result::ERROR_DEVICE_LOST));
    }
}
