//! Faults on demand, for tests: a chosen call fails, fresh memory is poisoned, workgroups run in another order, or
//! buffers are guarded.
//!
//! A device that was opened without faults (the default) pays one comparison where a fault could be.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

use ash::vk;

use super::Gpu;
use super::guard::Guarded;

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
    /// the calls ([`Gpu::reached`]).
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
    /// [`Gpu::take_guarded`]. Takes twice the memory, outside the budget.
    pub guard: bool,
}

impl Faults {
    pub(super) fn any(&self) -> bool {
        *self != Faults::default()
    }
}

/// The faults of a device, and what they have done so far.
pub(super) struct Struck {
    pub faults: Faults,
    reached: [AtomicU64; Point::ALL.len()],
    lost: AtomicBool,
    pub guarded: Mutex<Guarded>,
}

impl Struck {
    pub fn new(faults: Faults) -> Struck {
        Struck {
            faults,
            reached: Default::default(),
            lost: AtomicBool::new(false),
            guarded: Mutex::default(),
        }
    }

    fn strike(&self, point: Point) -> Result<(), vk::Result> {
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

#[doc(hidden)]
impl Gpu {
    /// Called before every call that may fail: fails if the device was lost or hangs, or if the call is to fail.
    pub(super) fn strike(&self, point: Point) -> Result<(), vk::Result> {
        if self.device.is_down() {
            return Err(vk::Result::ERROR_DEVICE_LOST);
        }
        self.struck.as_ref().map_or(Ok(()), |s| s.strike(point))
    }

    /// The word that fresh buffers are filled with, if any.
    pub(super) fn poison(&self) -> Option<u32> {
        self.struck.as_ref().and_then(|s| s.faults.poison)
    }

    /// Seed of the order of workgroups, if they run in another order.
    pub(super) fn shuffle(&self) -> Option<u64> {
        self.struck.as_ref().and_then(|s| s.faults.shuffle)
    }

    /// How many calls of a kind there were; 0 on a device that was opened without [`Faults`].
    pub fn reached(&self, point: Point) -> u64 {
        self.struck.as_ref().map_or(0, |s| s.reached[point as usize].load(Relaxed))
    }

    /// Bytes of device memory that buffers hold at the moment.
    pub fn allocated(&self) -> u64 {
        self.allocated.load(Relaxed)
    }

    /// Gives this handle back. If it is the last one, the device closes. Returns all messages of the validation layer,
    /// those about objects left behind included; empty without validation.
    pub fn close(self) -> Vec<String> {
        let messages = self.instance.messages.clone();
        drop(self);
        messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// A permutation of 0..n, the same for the same seed (Fisher-Yates over a multiplicative generator).
pub(super) fn shuffled(n: u32, seed: u64) -> Vec<u32> {
    let mut all: Vec<u32> = (0..n).collect();
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    for i in (1..all.len()).rev() {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        all.swap(i, (state >> 33) as usize % (i + 1));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_fails_when_its_turn_comes_and_a_lost_device_stays_lost() {
        let struck = Struck::new(Faults { fail: Some((Point::Allocation, 1)), ..Faults::default() });
        let all: Vec<bool> = (0..4).map(|_| struck.strike(Point::Allocation).is_ok()).collect();
        assert_eq!(all, [true, false, true, true]);
        assert_eq!(struck.reached[Point::Allocation as usize].load(Relaxed), 4);
        let struck = Struck::new(Faults { fail: Some((Point::Wait, 0)), ..Faults::default() });
        assert!(struck.strike(Point::Submission).is_ok());
        assert_eq!(struck.strike(Point::Wait), Err(vk::Result::ERROR_DEVICE_LOST));
        assert_eq!(struck.strike(Point::Allocation), Err(vk::Result::ERROR_DEVICE_LOST));
    }

    #[test]
    fn an_order_is_a_permutation_and_another_one() {
        let order = shuffled(100, 3);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().copied().eq(0..100) && order != sorted && order != shuffled(100, 4));
    }
}
