//! Device memory: every buffer is stated before anything is allocated, then all are made at once.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;

use ash::vk;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationSizes, MemoryLocation};

use super::state::SIZE_BACK;
use super::{Gpu, Point};
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

/// A buffer to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BufferPlan {
    /// The name kernels bind it by.
    pub name: String,
    pub bytes: u64,
    pub place: Place,
}

impl BufferPlan {
    pub fn new(name: &str, bytes: u64, place: Place) -> BufferPlan {
        // Vulkan has no empty buffers, and copies work in words.
        BufferPlan { name: name.into(), bytes: bytes.max(16).next_multiple_of(4), place }
    }
}

pub(super) struct Buffer {
    pub handle: vk::Buffer,
    pub bytes: u64,
    pub place: Place,
    allocation: Option<Allocation>,
}

/// All buffers of one job.
pub struct Arena<'g> {
    gpu: &'g Gpu,
    buffers: BTreeMap<String, Buffer>,
    // Dropped before the device: `gpu` outlives it by its lifetime.
    allocator: Option<Allocator>,
    bytes: u64,
}

impl<'g> Arena<'g> {
    /// Makes every buffer of `plan`. `budget` is in bytes; without one, what the driver reports free.
    ///
    /// Errors: a buffer larger than the device can bind, a plan over budget (naming the largest buffers), an
    /// allocation that the driver refuses. Nothing stays allocated then.
    pub fn new(gpu: &'g Gpu, plan: &[BufferPlan], budget: Option<u64>) -> Result<Arena<'g>> {
        let _span = gpu.span("allocate");
        check(plan, gpu.limits.storage_range, budget.unwrap_or_else(|| gpu.free_memory()), budget.is_some())?;
        let mut arena = Arena { gpu, buffers: BTreeMap::new(), allocator: None, bytes: 0 };
        arena.allocator = Some(
            Allocator::new(&AllocatorCreateDesc {
                instance: gpu.instance.raw.clone(),
                device: gpu.raw().clone(),
                physical_device: gpu.physical,
                debug_settings: Default::default(),
                buffer_device_address: false,
                allocation_sizes: AllocationSizes::new(shared(plan, false), shared(plan, true)),
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
        Ok(arena)
    }

    fn add(&mut self, plan: &BufferPlan) -> Result<()> {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let info = vk::BufferCreateInfo::default().size(plan.bytes).usage(usage);
        let device = self.gpu.raw();
        let refused = |what: String| {
            Error::memory(
                format!("the device refuses {} for buffer `{}` ({what})", size(plan.bytes), plan.name),
                "use a smaller --lateral, a larger --depth-pitch or a narrower --gate",
            )
        };
        let strike = || self.gpu.strike(Point::Allocation);
        // SAFETY: the device is alive; the memory bound is the allocation made for this very buffer.
        let handle = strike().and_then(|()| unsafe { device.create_buffer(&info, None) });
        let handle = handle.map_err(|e| refused(e.to_string()))?;
        self.gpu.name(handle, &plan.name);
        let buffer = Buffer { handle, bytes: plan.bytes, place: plan.place, allocation: None };
        self.buffers.insert(plan.name.clone(), buffer);
        let requirements = unsafe { device.get_buffer_memory_requirements(handle) };
        let allocator = self.allocator.as_mut().expect("set in new, taken in drop only");
        strike().map_err(|e| refused(e.to_string()))?;
        let allocation = allocator
            .allocate(&AllocationCreateDesc {
                name: &plan.name,
                requirements,
                location: match plan.place {
                    Place::Device => MemoryLocation::GpuOnly,
                    Place::Upload => MemoryLocation::CpuToGpu,
                    Place::Readback => MemoryLocation::GpuToCpu,
                },
                linear: true,
                allocation_scheme: if plan.bytes < OWN_BLOCK {
                    AllocationScheme::GpuAllocatorManaged
                } else {
                    AllocationScheme::DedicatedBuffer(handle)
                },
            })
            .map_err(|e| refused(e.to_string()))?;
        let (memory, offset) = unsafe { (allocation.memory(), allocation.offset()) };
        self.bytes += allocation.size();
        self.gpu.allocated.fetch_add(allocation.size(), Relaxed);
        if let Some(b) = self.buffers.get_mut(&plan.name) {
            b.allocation = Some(allocation);
        }
        strike()
            .and_then(|()| unsafe { device.bind_buffer_memory(handle, memory, offset) })
            .map_err(|e| refused(e.to_string()))
    }

    /// Bytes allocated, host-visible ones included.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Bytes of device memory taken for them: not less than [`Arena::bytes`], as small buffers share blocks.
    pub fn taken(&self) -> u64 {
        self.allocator.as_ref().map_or(0, Allocator::capacity)
    }

    /// Name, place and handle of every buffer.
    pub(super) fn handles(&self) -> Vec<(String, Place, vk::Buffer)> {
        self.buffers.iter().map(|(n, b)| (n.clone(), b.place, b.handle)).collect()
    }

    /// Bytes of every buffer by name.
    pub fn sizes(&self) -> BTreeMap<String, u64> {
        self.buffers.iter().map(|(n, b)| (n.clone(), b.bytes)).collect()
    }

    pub(super) fn get(&self, name: &str) -> &Buffer {
        self.buffers.get(name).unwrap_or_else(|| panic!("the plan holds no buffer `{name}`"))
    }

    /// The bytes of an upload or readback buffer.
    pub fn mapped(&self, name: &str) -> &[u8] {
        let a = self.get(name).allocation.as_ref().and_then(Allocation::mapped_slice);
        a.unwrap_or_else(|| panic!("buffer `{name}` is not host-visible"))
    }

    /// The same, to write. The device must not be using the buffer.
    pub fn mapped_mut(&mut self, name: &str) -> &mut [u8] {
        let a = self
            .buffers
            .get_mut(name)
            .and_then(|b| b.allocation.as_mut())
            .and_then(Allocation::mapped_slice_mut);
        a.unwrap_or_else(|| panic!("buffer `{name}` is not host-visible"))
    }
}

impl Drop for Arena<'_> {
    fn drop(&mut self) {
        // SAFETY: the executor that used these buffers waits for the device before it is dropped.
        for (_, b) in std::mem::take(&mut self.buffers) {
            unsafe { self.gpu.raw().destroy_buffer(b.handle, None) };
            if let (Some(a), Some(allocator)) = (b.allocation, self.allocator.as_mut()) {
                let bytes = a.size();
                // What is not given back still counts as allocated.
                if allocator.free(a).is_ok() {
                    self.gpu.allocated.fetch_sub(bytes, Relaxed);
                }
            }
        }
        self.allocator = None;
    }
}

/// Buffers from this size on have memory of their own, so that little is taken beyond what a plan says.
const OWN_BLOCK: u64 = 4 << 20;

/// Blocks of memory that small buffers share are multiples of this (gpu-allocator's least).
const BLOCK: u64 = 4 << 20;

/// Bytes of the block that the small buffers share on the device, or on the host.
fn shared(plan: &[BufferPlan], host: bool) -> u64 {
    let small = plan.iter().filter(|b| (b.place != Place::Device) == host && b.bytes < OWN_BLOCK);
    // A little over the sum, for alignment: one block then holds them all.
    small.map(|b| b.bytes + 256).sum::<u64>().next_multiple_of(BLOCK)
}

/// Bytes that `plan` takes of memory, whole blocks counted.
fn taken(plan: &[BufferPlan]) -> u64 {
    let own = plan.iter().filter(|b| b.bytes >= OWN_BLOCK);
    own.map(|b| b.bytes.next_multiple_of(1 << 16)).sum::<u64>() + shared(plan, false) + shared(plan, true)
}

/// Whether a device that binds `storage_range` bytes at most takes `plan` within `budget` bytes, without touching it.
/// `by_user`: the budget is an option, not the heap's.
///
/// Errors: a buffer larger than the device can bind, a plan over budget, which names the largest buffers.
pub fn check(plan: &[BufferPlan], storage_range: u64, budget: u64, by_user: bool) -> Result<()> {
    if let Some(b) = plan.iter().find(|b| b.place == Place::Device && b.bytes > storage_range) {
        return Err(Error::memory(
            format!(
                "buffer `{}` needs {}, this device binds at most {}",
                b.name,
                size(b.bytes),
                size(storage_range)
            ),
            "use a smaller --lateral, a larger --depth-pitch, a narrower --gate or a larger --stride",
        ));
    }
    let total = taken(plan);
    if total <= budget {
        return Ok(());
    }
    let mut largest: Vec<_> = plan.iter().collect();
    largest.sort_by_key(|b| std::cmp::Reverse(b.bytes));
    let names: Vec<_> = largest.iter().take(3).map(|b| format!("`{}` {}", b.name, size(b.bytes))).collect();
    let whose = if by_user { "--memory allows" } else { "the device has free" };
    Err(Error::memory(
        format!(
            "this job needs {}, {whose} {}; the largest buffers: {}",
            size(total),
            size(budget),
            names.join(", ")
        ),
        "use a smaller --lateral, a larger --depth-pitch, a narrower --gate or a larger --stride",
    ))
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

    #[test]
    fn a_plan_over_budget_names_its_largest_buffers() {
        let plan =
            [BufferPlan::new("small", 100, Place::Device), BufferPlan::new("raw", 5 << 20, Place::Device)];
        assert!(check(&plan, 1 << 30, 9 << 20, false).is_ok(), "5 MiB of its own, a block of 4 MiB for the rest");
        assert!(check(&plan, 1 << 30, 8 << 20, false).is_err());
        let error = check(&plan, 1 << 30, 1 << 20, true).unwrap_err();
        assert!(error.what.contains("`raw` 5 MiB") && error.what.contains("--memory"), "{error}");
        let error = check(&plan, 1 << 20, 1 << 30, false).unwrap_err();
        assert!(error.what.contains("binds at most 1 MiB"), "{error}");
    }
}
