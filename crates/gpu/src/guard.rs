//! Canaries behind buffers, for tests. Memory behind every buffer has a known content and is bound with the buffer,
//! so that a write past the end is detected and attributed.

use std::sync::PoisonError;

use ash::vk;

use super::device::Gpu;
use super::executor::DeviceExecutor;
use super::faults::{Guarded, Overrun};
use super::memory::{CANARY_BACK, Made};
use super::names::Buffer;
use super::place::Place;
use crate::Result;

const WORD: u32 = 0xca9a_41e5;

#[doc(hidden)]
impl Gpu {
    /// Returns and clears the results; empty without [`super::Faults::guard`].
    pub fn take_guarded(&self) -> Guarded {
        let Some(injected_faults) = &self.injected_faults else { return Guarded::default() };
        std::mem::take(&mut injected_faults.guarded.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl DeviceExecutor {
    /// Writes all canaries.
    pub(super) fn set_canaries(&mut self) -> Result<()> {
        if !self.gpu.faults().guard {
            return Ok(());
        }
        self.fill_all(WORD, |b| [b.bytes, b.canary])?;
        self.guarded = true;
        Ok(())
    }

    /// Checks all canaries and keeps the results. If the device fails, the rest is neither checked nor counted.
    pub(super) fn check_canaries(&mut self) {
        let gpu = self.gpu.clone();
        let Some(injected_faults) = gpu.injected_faults.as_ref().filter(|_| self.guarded) else { return };
        for (buffer, made) in self.arena.buffers() {
            let Ok(found) = self.first_overrun(buffer, &made) else { return };
            let mut guarded = injected_faults.guarded.lock().unwrap_or_else(PoisonError::into_inner);
            guarded.buffers += 1;
            guarded.overruns.extend(found.map(|at| Overrun { buffer, bytes: made.bytes, at }));
        }
    }

    /// Byte offset of the first changed word of a canary, from the start of the buffer.
    fn first_overrun(&mut self, buffer: Buffer, made: &Made) -> Result<Option<u64>> {
        if made.place != Place::Device {
            // Waits for submissions in flight.
            self.run_now([&[], &[]], |_, _| {})?;
            return Ok(self.first_changed(buffer, [made.bytes, made.canary]).map(|at| made.bytes + at));
        }
        let (through, part) = (self.arena.get(CANARY_BACK).handle, self.arena.size(CANARY_BACK));
        for offset in (0..made.canary).step_by(part as usize) {
            let size = part.min(made.canary - offset);
            let region = [vk::BufferCopy { src_offset: made.bytes + offset, dst_offset: 0, size }];
            self.run_now([&[], &[CANARY_BACK]], |device, c| {
                // SAFETY: both buffers live as long as the executor, and the region lies within them.
                unsafe { device.cmd_copy_buffer(c, made.handle, through, &region) }
            })?;
            if let Some(at) = self.first_changed(CANARY_BACK, [0, size]) {
                return Ok(Some(made.bytes + offset + at));
            }
        }
        Ok(None)
    }

    /// Byte offset, relative to `offset`, of the first changed canary word of a host-visible buffer. Requires that no
    /// submission is in flight.
    fn first_changed(&self, buffer: Buffer, [offset, bytes]: [u64; 2]) -> Option<u64> {
        let mut words = vec![0u32; (bytes / 4) as usize];
        self.copy_out(buffer, offset, bytemuck::cast_slice_mut(&mut words));
        words.iter().position(|w| *w != WORD).map(|i| 4 * i as u64)
    }
}
