//! Faults on demand, for tests: a chosen call fails, fresh memory is poisoned, workgroups run in another order, or
//! buffers are guarded.
//!
//! A device that was opened without faults (the default) pays one comparison where a fault could be.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use ash::vk;

use super::names::Buffer;

/// A call that may fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Point {
    /// Memory for a buffer, the buffer itself, its binding: fails as out of device memory.
    Allocation,
    /// Anything else that is made: kernels, pools, sets, command buffers, time stamps: fails as out of host memory.
    Object,
    /// Fails as a lost device, which stays lost.
    Submission,
    /// As [`Point::Submission`].
    Wait,
}

impl Point {
    /// Every kind of call.
    pub const ALL: [Point; 4] = [Point::Allocation, Point::Object, Point::Submission, Point::Wait];
}

/// Faults to produce, for tests.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Faults {
    /// Fail call number N (from 0) of a kind since the device was opened. A number that is never reached only counts
    /// the calls ([`super::Gpu::reached`]).
    pub fail: Option<(Point, u64)>,
    /// Wait number N (from 0) since the device was opened runs out of time at once: the device hangs.
    pub hang: Option<u64>,
    /// After a loss, the driver tells of an invalid read at this address.
    pub told: Option<u64>,
    /// Fill fresh buffers with this word.
    pub poison: Option<u32>,
    /// Run the workgroups of every dispatch in another order, drawn from this seed, and wait between dispatches: slow.
    pub shuffle: Option<u64>,
    /// Put a canary behind every buffer, bound with it, and check all of them when an executor is dropped:
    /// [`super::Gpu::take_guarded`]. Takes twice the memory, outside the budget.
    pub guard: bool,
}

impl Faults {
    pub(super) fn any(&self) -> bool {
        *self != Faults::default()
    }
}

/// A buffer that was written past its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Overrun {
    /// The buffer.
    pub buffer: Buffer,
    /// Its size in the plan, bytes.
    pub bytes: u64,
    /// Byte offset of the first overwritten word, from the beginning of the buffer.
    pub at: u64,
}

/// Result of the checks of canaries, over all executors that were dropped.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Guarded {
    /// Number of buffers whose canaries were checked.
    pub buffers: usize,
    /// Those that were written past their end.
    pub overruns: Vec<Overrun>,
}

/// The faults of a device, and what they have done so far.
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

    /// How many calls of a kind there were.
    pub fn reached(&self, point: Point) -> u64 {
        self.reached[point as usize].load(Relaxed)
    }

    /// Called before every call that may fail.
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
