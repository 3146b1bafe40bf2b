//! Device memory. All buffers are declared before anything is allocated, then made at once.

use std::collections::BTreeMap;
use std::ptr::NonNull;
use std::sync::atomic::Ordering::Relaxed;

use ash::vk;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationSizes, MemoryLocation};

use super::guard::{CANARY_BACK, CANARY_PART, LEAST_CANARY};
use super::state::SIZE_BACK;
use super::{Buffer, Gpu, Point};
use crate::advice::{Advice, Remedy, advice};
use crate::{Error, Result};

/// Where a buffer lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// On the device; the host reaches it by copies only.
    Device,
    /// Written by the host, read by the device.
    Upload,
    /// Written by the device, read by the host.
    Readback,
}

/// A buffer to allocate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BufferPlan {
    /// Its name.
    pub buffer: Buffer,
    /// Its size, bytes.
    pub bytes: u64,
    /// Where it lives.
    pub place: Place,
}

impl BufferPlan {
    /// The smallest size of a buffer, bytes: Vulkan has no empty buffers.
    pub const LEAST: u64 = 16;

    /// A buffer of `bytes` bytes, but at least [`BufferPlan::LEAST`], rounded up to the whole words that copies need.
    pub fn new(buffer: Buffer, bytes: u64, place: Place) -> BufferPlan {
        BufferPlan { buffer, bytes: bytes.max(Self::LEAST).next_multiple_of(4), place }
    }
}

#[derive(Clone, Copy)]
pub(super) struct Made {
    pub handle: vk::Buffer,
    /// Size in the plan.
    pub bytes: u64,
    /// Bytes behind these that nothing may write: 0 unless the device is opened with [`super::Faults::guard`].
    pub canary: u64,
    pub place: Place,
}

/// All buffers of one job.
pub struct Arena<'g> {
    gpu: &'g Gpu,
    buffers: BTreeMap<Buffer, (Made, Option<Allocation>)>,
    // Dropped before the device: `gpu` outlives it by its lifetime.
    allocator: Option<Allocator>,
    bytes: u64,
    /// Buffers from this size on have memory of their own, bytes: on the device, and on the host.
    own_from: [u64; 2],
}

impl<'g> Arena<'g> {
    /// Allocates every buffer of `plan`. `budget` is in bytes; without one, it is what the driver reports as free.
    ///
    /// # Errors
    /// A buffer is larger than the device can bind, the plan is over budget (the error names the largest buffers), or
    /// the driver refuses an allocation. Nothing stays allocated then.
    pub fn new(gpu: &'g Gpu, plan: &[BufferPlan], budget: Option<u64>) -> Result<Arena<'g>> {
        let _span = gpu.span("allocate");
        check(plan, gpu.limits.storage_range, budget.unwrap_or_else(|| gpu.free_memory()), budget.is_some())?;
        let layout = Layout::both(&guarded(gpu, plan), gpu.one_memory);
        let own_from = layout.map(|l| l.own_from);
        let mut arena = Arena { gpu, buffers: BTreeMap::new(), allocator: None, bytes: 0, own_from };
        arena.allocator = Some(
            Allocator::new(&AllocatorCreateDesc {
                instance: gpu.instance.raw.clone(),
                device: gpu.raw().clone(),
                physical_device: gpu.physical,
                debug_settings: Default::default(),
                buffer_device_address: false,
                allocation_sizes: AllocationSizes::new(layout[0].block, layout[1].block),
            })
            .map_err(|e| {
                Error::memory(format!("the allocator does not start ({e})"), "update the device's driver")
            })?,
        );
        for b in plan {
            arena.add(b)?;
        }
        if gpu.shuffle().is_some() {
            arena.add(&BufferPlan::new(SIZE_BACK, 12, Place::Readback))?;
        }
        if gpu.guards() {
            let stated = arena.bytes;
            arena.add(&BufferPlan::new(CANARY_BACK, CANARY_PART, Place::Readback))?;
            arena.bytes = stated;
        }
        match budget.filter(|b| !gpu.guards() && arena.taken() > *b) {
            None => Ok(arena),
            Some(budget) => Err(over(plan, arena.taken(), budget, true)),
        }
    }

    fn add(&mut self, plan: &BufferPlan) -> Result<()> {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::STORAGE_TEXEL_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let canary = if self.gpu.guards() { canary_of(plan.bytes) } else { 0 };
        let info = vk::BufferCreateInfo::default().size(plan.bytes + canary).usage(usage);
        let device = self.gpu.raw();
        let refused = |what: String| {
            Error::memory(
                format!("the device refuses {} for buffer `{}` ({what})", size(plan.bytes), plan.buffer),
                advice!["use " {Remedy::SMALLER_JOB}],
            )
        };
        let strike = || self.gpu.strike(Point::Allocation);
        // SAFETY: the device is alive; the memory bound is the allocation made for this very buffer.
        let handle = strike().and_then(|()| unsafe { device.create_buffer(&info, None) });
        let handle = handle.map_err(|e| refused(e.to_string()))?;
        let name = plan.buffer.to_string();
        self.gpu.name(handle, &name);
        let made = Made { handle, bytes: plan.bytes, canary, place: plan.place };
        self.buffers.insert(plan.buffer, (made, None));
        let requirements = unsafe { device.get_buffer_memory_requirements(handle) };
        let allocator = self.allocator.as_mut().expect("set in new, taken in drop only");
        strike().map_err(|e| refused(e.to_string()))?;
        let allocation = allocator
            .allocate(&AllocationCreateDesc {
                name: &name,
                requirements,
                location: match plan.place {
                    Place::Device => MemoryLocation::GpuOnly,
                    Place::Upload => MemoryLocation::CpuToGpu,
                    Place::Readback => MemoryLocation::GpuToCpu,
                },
                linear: true,
                allocation_scheme: if plan.bytes < self.own_from[usize::from(plan.place != Place::Device)] {
                    AllocationScheme::GpuAllocatorManaged
                } else {
                    AllocationScheme::DedicatedBuffer(handle)
                },
            })
            .map_err(|e| refused(e.to_string()))?;
        let (memory, offset) = unsafe { (allocation.memory(), allocation.offset()) };
        self.bytes += allocation.size() - canary;
        self.gpu.allocated.fetch_add(allocation.size(), Relaxed);
        if let Some((_, held)) = self.buffers.get_mut(&plan.buffer) {
            *held = Some(allocation);
        }
        strike()
            .and_then(|()| unsafe { device.bind_buffer_memory(handle, memory, offset) })
            .map_err(|e| refused(e.to_string()))
    }

    /// Bytes of all buffers, host-visible ones included, canaries not.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Bytes of memory blocks taken for the buffers: at least [`Arena::bytes`], as small buffers share blocks.
    pub fn taken(&self) -> u64 {
        self.allocator.as_ref().map_or(0, Allocator::capacity)
    }

    /// Every buffer.
    pub(super) fn buffers(&self) -> Vec<(Buffer, Made)> {
        self.buffers.iter().map(|(buffer, (made, _))| (*buffer, *made)).collect()
    }

    /// Bytes of every buffer.
    pub fn sizes(&self) -> BTreeMap<Buffer, u64> {
        self.buffers.iter().map(|(buffer, (made, _))| (*buffer, made.bytes)).collect()
    }

    /// Bytes of a buffer.
    ///
    /// # Panics
    /// The plan has no such buffer.
    pub fn size(&self, buffer: Buffer) -> u64 {
        self.get(buffer).bytes
    }

    pub(super) fn get(&self, buffer: Buffer) -> &Made {
        &self.held(buffer).0
    }

    fn held(&self, buffer: Buffer) -> &(Made, Option<Allocation>) {
        self.buffers.get(&buffer).unwrap_or_else(|| panic!("the plan holds no buffer `{buffer}`"))
    }

    /// Where an upload or readback buffer begins in the host's memory: valid for its bytes and its canary, as
    /// long as the arena lives. The device may be writing there.
    pub(super) fn pointer(&self, buffer: Buffer) -> NonNull<u8> {
        let mapped = self.held(buffer).1.as_ref().and_then(Allocation::mapped_ptr);
        mapped.unwrap_or_else(|| panic!("buffer `{buffer}` is not host-visible")).cast()
    }
}

impl Drop for Arena<'_> {
    fn drop(&mut self) {
        // SAFETY: the executor that used these buffers waits for its work before it is dropped.
        for (_, (b, allocation)) in std::mem::take(&mut self.buffers) {
            unsafe { self.gpu.raw().destroy_buffer(b.handle, None) };
            if let (Some(a), Some(allocator)) = (allocation, self.allocator.as_mut()) {
                let bytes = a.size();
                // Memory that is not given back still counts as allocated.
                if allocator.free(a).is_ok() {
                    self.gpu.allocated.fetch_sub(bytes, Relaxed);
                }
            }
        }
        self.allocator = None;
    }
}

/// Bytes of the canary behind a buffer of `bytes` bytes: as many, but at least [`LEAST_CANARY`].
fn canary_of(bytes: u64) -> u64 {
    bytes.max(LEAST_CANARY)
}

/// The buffers to allocate for a plan: with a canary behind each if the device guards them.
fn guarded(gpu: &Gpu, plan: &[BufferPlan]) -> Vec<BufferPlan> {
    let canary = |b: &BufferPlan| if gpu.guards() { canary_of(b.bytes) } else { 0 };
    plan.iter().map(|b| BufferPlan { bytes: b.bytes + canary(b), ..b.clone() }).collect()
}

/// Buffers share memory blocks whose size is a multiple of [`BLOCK`] and at most [`LARGEST_BLOCK`], the bounds of
/// gpu-allocator.
const BLOCK: u64 = 4 << 20;
const LARGEST_BLOCK: u64 = 256 << 20;

/// How buffers in one kind of memory lie in it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Layout {
    /// Buffers from this size on have memory of their own. If one block holds all buffers, they share it; else only
    /// the small ones share a block.
    own_from: u64,
    block: u64,
    /// Bytes in all.
    taken: u64,
}

impl Layout {
    fn of<'b>(buffers: impl Iterator<Item = &'b BufferPlan> + Clone) -> Layout {
        // A little over the sum, for alignment: one block then holds them all.
        let block = |below: u64| {
            let small = buffers.clone().filter(|b| b.bytes < below);
            small.map(|b| b.bytes.saturating_add(256)).fold(0, u64::saturating_add)
        };
        let rounded = |bytes: u64| bytes.checked_next_multiple_of(BLOCK).unwrap_or(u64::MAX);
        let all = rounded(block(u64::MAX));
        if all <= LARGEST_BLOCK {
            return Layout { own_from: u64::MAX, block: all, taken: all };
        }
        let own = buffers.clone().filter(|b| b.bytes >= BLOCK).map(|b| b.bytes.saturating_add(1 << 16));
        let small = rounded(block(BLOCK));
        Layout { own_from: BLOCK, block: small, taken: own.fold(small, u64::saturating_add) }
    }

    /// Layouts of device memory and of host memory: the same one where the device has no memory of its own.
    fn both(plan: &[BufferPlan], one: bool) -> [Layout; 2] {
        if one {
            return [Layout::of(plan.iter()); 2];
        }
        [true, false].map(|device| Layout::of(plan.iter().filter(|b| (b.place == Place::Device) == device)))
    }
}

/// Checks a plan against a device that binds at most `storage_range` bytes and has `budget` bytes. Allocates nothing.
/// `by_user`: the budget is an option, not the free part of the heap.
///
/// # Errors
/// A buffer is larger than the device can bind, or the plan is over budget (the error names the largest buffers).
pub fn check(plan: &[BufferPlan], storage_range: u64, budget: u64, by_user: bool) -> Result<()> {
    if let Some(b) = plan.iter().find(|b| b.place == Place::Device && b.bytes > storage_range) {
        return Err(Error::memory(
            format!(
                "buffer `{}` needs {}, this device binds at most {}",
                b.buffer,
                size(b.bytes),
                size(storage_range)
            ),
            advice!["use " {smaller(b.bytes, storage_range)}],
        ));
    }
    let [device, host] = Layout::both(plan, false);
    let total = device.taken.saturating_add(host.taken);
    if total <= budget {
        return Ok(());
    }
    Err(over(plan, total, budget, by_user))
}

fn over(plan: &[BufferPlan], total: u64, budget: u64, by_user: bool) -> Error {
    let mut largest: Vec<_> = plan.iter().collect();
    largest.sort_by_key(|b| std::cmp::Reverse(b.bytes));
    let names: Vec<_> = largest.iter().take(3).map(|b| format!("`{}` {}", b.buffer, size(b.bytes))).collect();
    let whose = if by_user { "the memory budget is" } else { "the device has free" };
    let mend = Advice::from(advice!["use " {smaller(total, budget)}]);
    let mend = if by_user { mend.and(advice![", or allow more with " Memory]) } else { mend };
    Error::memory(
        format!(
            "this job needs {} in whole blocks, {whose} {}; the largest buffers: {}",
            size(total),
            size(budget),
            names.join(", ")
        ),
        mend,
    )
}

fn smaller(asked: u64, available: u64) -> Remedy {
    Remedy::SmallerJob { asked: Some(asked), available: Some(available) }
}

fn size(bytes: u64) -> String {
    if bytes < 1 << 20 {
        format!("{} KiB", bytes.div_ceil(1 << 10))
    } else {
        format!("{} MiB", bytes.div_ceil(1 << 20))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::advice::Setting;

    #[test]
    fn buffers_share_a_block_while_it_holds_them() {
        let of = |bytes: &[u64]| {
            Layout::of(
                bytes
                    .iter()
                    .map(|b| BufferPlan::new(Buffer::named("b"), *b, Place::Device))
                    .collect::<Vec<_>>()
                    .iter(),
            )
        };
        let mib = 1 << 20;
        assert_eq!(of(&[]), Layout { own_from: u64::MAX, block: 0, taken: 0 });
        assert_eq!(of(&[100, 5 * mib]), Layout { own_from: u64::MAX, block: 8 * mib, taken: 8 * mib });
        let large = of(&[100, 300 * mib, 3 * mib]);
        assert_eq!((large.own_from, large.block), (4 * mib, 4 * mib));
        assert_eq!(large.taken, 304 * mib + (1 << 16));
        assert_eq!(of(&[u64::MAX - 300, u64::MAX - 300]).taken, u64::MAX);
    }

    #[test]
    fn a_plan_over_budget_names_its_largest_buffers() {
        let plan = [("small", 100), ("raw", 5 << 20)]
            .map(|(n, b)| BufferPlan::new(Buffer::named(n), b, Place::Device));
        assert!(check(&plan, 1 << 30, 8 << 20, false).is_ok(), "two blocks of 4 MiB");
        assert!(check(&plan, 1 << 30, 7 << 20, false).is_err());
        let error = check(&plan, 1 << 30, 1 << 20, true).unwrap_err();
        assert!(error.what.contains("`raw` 5 MiB") && error.mend.names(Setting::Memory), "{error}");
        assert!(error.mend.remedies().any(|r| r == smaller(8 << 20, 1 << 20)), "{error:?}");
        let error = check(&plan, 1 << 20, 1 << 30, false).unwrap_err();
        assert!(error.what.contains("binds at most 1 MiB"), "{error}");
    }
}
