//! Host access to host-visible buffers, which the device also reads and writes.
//!
//! No reference to that memory is created: bytes are copied, and only where no submission in flight may access them.

use std::ops::{Bound, Range, RangeBounds};

use super::executor::DeviceExecutor;
use super::flight::{Flight, Ticket};
use super::names::Buffer;
use super::place::Place;

impl DeviceExecutor {
    /// As [`crate::Executor::read`].
    pub fn read<T: bytemuck::Pod>(&self, buffer: Buffer, items: impl RangeBounds<usize>) -> Vec<T> {
        let writer = self.flights.iter().find(|f| f.shared[1].contains(&buffer));
        assert!(writer.is_none(), "`{buffer}` is read while the device may be writing it");
        let mut read = vec![];
        self.copy_items(buffer, items, &mut read);
        read
    }

    /// As [`crate::Executor::read_behind`].
    pub fn read_behind<T: bytemuck::Pod>(
        &self,
        done: Ticket,
        buffer: Buffer,
        items: impl RangeBounds<usize>,
        into: &mut Vec<T>,
    ) {
        let over = self.flights.front().is_none_or(|f| f.ticket > done);
        assert!(over, "`{buffer}` is read before the submission is done");
        self.copy_items(buffer, items, into);
    }

    /// As [`crate::Executor::write`].
    pub fn write(&mut self, buffer: Buffer, bytes: &[u8]) {
        self.write_at(buffer, 0, bytes);
    }

    /// As [`crate::Executor::write_at`].
    pub fn write_at(&mut self, buffer: Buffer, offset: u64, bytes: &[u8]) {
        let user = self.flights.iter().find(|f| f.shared.iter().any(|all| all.contains(&buffer)));
        assert!(user.is_none(), "`{buffer}` is written while the device may be using it");
        let room = self.arena.size(buffer);
        let end = offset.saturating_add(bytes.len() as u64);
        assert!(end <= room, "bytes {offset} to {end} of `{buffer}` are written, which has {room}");
        let to = self.arena.pointer(buffer);
        // SAFETY: this range is mapped, and no submission in flight accesses the buffer. `bytes` does not overlap, as
        // no references to mapped memory exist.
        unsafe {
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), to.add(offset as usize).as_ptr(), bytes.len());
        }
    }

    /// Copies a part of a host-visible buffer from byte `offset`, including the canary. The caller guarantees that no
    /// submission in flight writes this part.
    pub(super) fn copy_out(&self, buffer: Buffer, offset: u64, to: &mut [u8]) {
        let made = self.arena.get(buffer);
        assert!(offset + to.len() as u64 <= made.bytes + made.canary, "bytes beyond `{buffer}`");
        let from = self.arena.pointer(buffer);
        // SAFETY: this range is mapped and not written by the device, see above. `to` does not overlap, as no
        // references to mapped memory exist.
        unsafe {
            std::ptr::copy_nonoverlapping(from.add(offset as usize).as_ptr(), to.as_mut_ptr(), to.len());
        }
    }

    /// Fills `bytes` bytes of a host-visible buffer with `word` from byte `offset`, including the canary. The caller
    /// guarantees that no submission in flight uses the buffer.
    pub(super) fn fill_shared(&mut self, buffer: Buffer, [offset, bytes]: [u64; 2], word: u32) {
        let made = self.arena.get(buffer);
        assert!(offset % 4 == 0 && bytes % 4 == 0, "whole words of `{buffer}`");
        assert!(offset + bytes <= made.bytes + made.canary, "words beyond `{buffer}`");
        let to = self.arena.pointer(buffer).cast::<u32>();
        for i in offset / 4..(offset + bytes) / 4 {
            // SAFETY: inside the mapped range, see above; the offset is a multiple of the alignment.
            unsafe { to.add(i as usize).write(word) };
        }
    }

    fn copy_items<T: bytemuck::Pod>(
        &self,
        buffer: Buffer,
        items: impl RangeBounds<usize>,
        into: &mut Vec<T>,
    ) {
        let Range { start: from, end: to } =
            range_of(buffer, items, self.arena.size(buffer) as usize / size_of::<T>());
        into.resize(to - from, T::zeroed());
        self.copy_out(buffer, (from * size_of::<T>()) as u64, bytemuck::cast_slice_mut(into));
    }

    /// Records the host-visible buffers of a submission.
    pub(super) fn share(&self, flight: &mut Flight, reads: &[Buffer], writes: &[Buffer]) {
        for (uses, kept) in [reads, writes].into_iter().zip(&mut flight.shared) {
            kept.extend(uses.iter().filter(|buffer| self.arena.get(**buffer).place != Place::Device));
        }
    }
}

/// The range of `items` of a buffer that has `all`.
///
/// # Panics
/// It has fewer.
pub(super) fn range_of(buffer: Buffer, items: impl RangeBounds<usize>, all: usize) -> Range<usize> {
    let from = match items.start_bound() {
        Bound::Included(i) => *i,
        Bound::Excluded(i) => i + 1,
        Bound::Unbounded => 0,
    };
    let to = match items.end_bound() {
        Bound::Included(i) => i + 1,
        Bound::Excluded(i) => *i,
        Bound::Unbounded => all,
    };
    assert!(from <= to && to <= all, "items {from} to {to} of `{buffer}`, which has {all}");
    from..to
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use crate::{Arena, Buffer, BufferPlan, Executor, Gpu, GpuOptions, Place, Schedule};

    const UP: Buffer = Buffer::named("up");
    const STATE: Buffer = Buffer::named("state");
    const DOWN: Buffer = Buffer::named("down");
    const OTHER: Buffer = Buffer::named("other");

    #[test]
    fn what_is_under_way_is_neither_read_nor_written() {
        let gpu = Gpu::open(&GpuOptions::vulkan()).expect("a Vulkan device: `make setup` installs lavapipe");
        let plan = [
            BufferPlan::new(UP, 64, Place::Upload),
            BufferPlan::new(STATE, 64, Place::Device),
            BufferPlan::new(DOWN, 64, Place::Readback),
            BufferPlan::new(OTHER, 64, Place::Readback),
        ];
        let mut executor = Executor::new(&gpu, Arena::new(&gpu, &plan, None).unwrap()).unwrap();
        let refused = |work: &mut dyn FnMut()| catch_unwind(AssertUnwindSafe(work)).is_err();
        executor.write(UP, &[7; 64]);
        let mut first = Schedule::default();
        first.copy(UP, STATE, 64);
        first.copy(STATE, DOWN, 64);
        let ticket = executor.submit(&first).unwrap();
        assert!(refused(&mut || drop(executor.read::<u8>(DOWN, ..))), "the device may be writing it");
        assert!(refused(&mut || executor.read_behind::<u8>(ticket, DOWN, .., &mut vec![])));
        assert!(refused(&mut || executor.write(UP, &[0])), "the device may be reading it");
        executor.write(OTHER, &[1, 2, 3]);
        assert_eq!(executor.read::<u8>(OTHER, 1..3), [2, 3], "a buffer that nothing uses");
        assert_eq!(executor.read::<[u8; 8]>(UP, 7..), [[7; 8]], "both may read");
        executor.wait(ticket).unwrap();
        let mut second = Schedule::default();
        second.fill(DOWN, 8, 0x0101_0101);
        let later = executor.submit(&second).unwrap();
        let mut rest = vec![];
        executor.read_behind::<u16>(ticket, DOWN, 4..=5, &mut rest);
        assert_eq!(rest, [0x0707; 2], "the second leaves it alone");
        assert!(refused(&mut || drop(executor.read::<u16>(DOWN, 4..))));
        executor.wait(later).unwrap();
        let down = executor.read::<u8>(DOWN, ..);
        assert!(down[..8] == [1; 8] && down[8..] == [7; 56], "{down:?}");
        assert!(refused(&mut || drop(executor.read::<u8>(DOWN, ..65))), "beyond its end");
        assert!(refused(&mut || executor.write(UP, &[0; 65])), "beyond its end");
    }
}
