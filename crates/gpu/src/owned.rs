//! Who owns a logical device, and who may use its queue.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, MutexGuard, OnceLock};

use ash::vk;

use super::instance::Instance;
use crate::Error;

/// A logical device that destroys itself, after everything made from it.
pub(super) struct OwnedDevice {
    pub raw: ash::Device,
    /// It did not come back from work in time, and may still be at it.
    hung: AtomicBool,
    /// Why nothing can be done on it any more.
    down: OnceLock<Error>,
    /// A caller's device stays open.
    is_callers: bool,
    // The instance must outlive its device.
    instance: Arc<Instance>,
}

impl OwnedDevice {
    /// A device of `instance`: a caller's, or one that this value is to destroy.
    pub fn new(raw: ash::Device, instance: Arc<Instance>, is_callers: bool) -> OwnedDevice {
        OwnedDevice { raw, hung: AtomicBool::new(false), down: OnceLock::new(), is_callers, instance }
    }

    /// Whether the device did not come back from work in time.
    pub fn has_hung(&self) -> bool {
        self.hung.load(Relaxed)
    }

    /// Whether it was lost or hangs: every call on it fails from then on.
    pub fn is_down(&self) -> bool {
        self.down.get().is_some()
    }

    /// Notes why it is down. Returns the first reason that was noted.
    pub fn note_down(&self, why: impl FnOnce() -> Error) -> Error {
        self.down.get_or_init(why).clone()
    }

    /// Notes that it did not.
    pub fn note_hung(&self) {
        self.hung.store(true, Relaxed);
    }
}

impl Drop for OwnedDevice {
    fn drop(&mut self) {
        if self.has_hung() {
            // Executors and arenas have left their objects behind, which keep the device and its instance.
            std::mem::forget(self.instance.clone());
            return;
        }
        if self.is_callers {
            return;
        }
        // SAFETY: the last owner is gone, so nothing made from this device is left. Every executor has waited for its own
        // work, so the queue is idle. `vkDeviceWaitIdle` would add nothing, and RADV's null device (Mesa 22.3), which
        // only compiles, calls through a null pointer there.
        unsafe { self.raw.destroy_device(None) };
    }
}

/// A caller's lock of its queue. Vulkan lets one thread at a time use a queue: the library takes this lock around every
/// submission, and holds it for no longer.
pub trait QueueLock: Send + Sync {
    /// Waits until no other thread uses the queue.
    fn lock(&self);

    /// Lets others use it. Called by the thread that called [`QueueLock::lock`].
    fn unlock(&self);
}

/// The queue, while this thread alone may use it.
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
