//! Ownership of a logical device, and access to its queue.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, MutexGuard, OnceLock};

use ash::vk;

use super::instance::Instance;
use crate::Error;

/// A logical device that destroys itself, after everything created from it.
pub(super) struct OwnedDevice {
    pub raw: ash::Device,
    /// The watchdog timed out; the device may still be working.
    hung: AtomicBool,
    /// Reason why every call fails.
    down: OnceLock<Error>,
    /// The device belongs to the application.
    is_external: bool,
    // The instance outlives its device.
    instance: Arc<Instance>,
}

impl OwnedDevice {
    /// A device of `instance`: an application's, or one destroyed with this value.
    pub fn new(raw: ash::Device, instance: Arc<Instance>, is_external: bool) -> OwnedDevice {
        OwnedDevice { raw, hung: AtomicBool::new(false), down: OnceLock::new(), is_external, instance }
    }

    /// Whether the watchdog timed out.
    pub fn has_hung(&self) -> bool {
        self.hung.load(Relaxed)
    }

    /// Whether the device was lost or hung: every later call fails.
    pub fn has_failed(&self) -> bool {
        self.down.get().is_some()
    }

    /// Records the reason of the failure. Returns the first recorded reason.
    pub fn record_failure(&self, why: impl FnOnce() -> Error) -> Error {
        self.down.get_or_init(why).clone()
    }

    /// Records a watchdog timeout.
    pub fn record_timeout(&self) {
        self.hung.store(true, Relaxed);
    }
}

impl Drop for OwnedDevice {
    fn drop(&mut self) {
        if self.has_hung() {
            // Executors and arenas have leaked objects, which keep the device and its instance alive.
            std::mem::forget(self.instance.clone());
            return;
        }
        if self.is_external {
            return;
        }
        // SAFETY: the last owner is gone, so no object of this device remains. Every executor waited for its work, so
        // the queue is idle. `vkDeviceWaitIdle` is redundant and crashes in RADV's null device (Mesa 22.3).
        unsafe { self.raw.destroy_device(None) };
    }
}

/// An application's lock of its queue, held by the library around every submission only.
pub trait QueueLock: Send + Sync {
    /// Waits for exclusive access to the queue.
    fn lock(&self);

    /// Releases the queue. Called by the thread that called [`QueueLock::lock`].
    fn unlock(&self);
}

/// Exclusive access to the queue.
pub(super) struct Queue<'g> {
    pub queue: MutexGuard<'g, vk::Queue>,
    pub lock: Option<&'g dyn QueueLock>,
}

impl Deref for Queue<'_> {
    type Target = vk::Queue;

    fn deref(&self) -> &vk::Queue {
        &self.queue
    }
}

impl Drop for Queue<'_> {
    fn drop(&mut self) {
        self.lock.into_iter().for_each(QueueLock::unlock);
    }
}
