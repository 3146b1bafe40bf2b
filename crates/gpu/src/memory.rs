//! Device memory: free memory, and the buffers of a job, declared before allocation and created together.

use std::collections::BTreeMap;
use std::ptr::NonNull;
use std::sync::atomic::Ordering::Relaxed;

use ash::vk;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationSizes, MemoryLocation};

use super::budget::{Memory, MemoryLayout, Whose, check, coherent, over, size};
use super::device::Gpu;
use super::faults::Point;
use super::names::Buffer;
use super::place::{Block, BufferPlan, Place};
use crate::advice::{Remedy, advice};
use crate::{Error, Result};

/// Readback buffer for the size of a shuffled indirect dispatch.
pub(super) const SIZE_BACK: Buffer = Buffer::named("size_back");

/// Readback buffer for canaries on the device.
pub(super) const CANARY_BACK: Buffer = Buffer::named("canary_back");

/// Its size in bytes, the part size for reading canaries.
const CANARY_PART: u64 = 1 << 20;

/// Minimum canary size, bytes.
const LEAST_CANARY: u64 = 64 << 10;

/// An allocated buffer.
#[derive(Clone, Copy)]
pub(super) struct Made {
    pub handle: vk::Buffer,
    /// Size in the plan.
    pub bytes: u64,
    /// Bytes of the canary: 0 unless the device was opened with [`super::Faults::guard`].
    pub canary: u64,
    pub place: Place,
}

/// The memory of a buffer.
enum BufferMemory {
    Own(Allocation),
    /// An application's block, with its size.
    External(Block, u64),
}

impl BufferMemory {
    fn bytes(&self) -> u64 {
        match self {
            BufferMemory::Own(own) => own.size(),
            BufferMemory::External(_, bytes) => *bytes,
        }
    }

    fn place(&self) -> (vk::DeviceMemory, u64) {
        match self {
            // SAFETY: the handle is only bound.
            BufferMemory::Own(own) => (unsafe { own.memory() }, own.offset()),
            BufferMemory::External(block, _) => (block.memory, block.offset),
        }
    }

    fn mapped(&self) -> Option<NonNull<u8>> {
        match self {
            BufferMemory::Own(own) => own.mapped_ptr().map(NonNull::cast),
            BufferMemory::External(block, _) => NonNull::new(block.mapped.cast()),
        }
    }
}

/// All buffers of one job.
pub struct DeviceArena {
    gpu: Gpu,
    buffers: BTreeMap<Buffer, (Made, Option<BufferMemory>)>,
    // Dropped before the device, which `gpu` keeps open.
    allocator: Option<Allocator>,
    bytes: u64,
    /// Size from which buffers have dedicated allocations, bytes: on the device, and on the host.
    own_from: [u64; 2],
}

impl DeviceArena {
    /// Allocates every buffer of `plan`. `budget` limits the bytes of all buffers; default: free bytes of each heap
    /// as reported by the driver.
    ///
    /// # Errors
    /// A buffer exceeds the largest binding, the plan exceeds the budget (the error names the largest buffers), or
    /// the driver refuses an allocation. Nothing remains allocated.
    pub fn new(gpu: &Gpu, plan: &[BufferPlan], budget: Option<u64>) -> Result<DeviceArena> {
        let _span = gpu.span("allocate");
        if gpu.vulkan().device.has_failed() {
            return Err(gpu.failed("allocating", vk::Result::ERROR_DEVICE_LOST));
        }
        check(plan, &gpu.memory(), budget)?;
        let layout = MemoryLayout::both(&guarded(gpu, plan), &gpu.vulkan().kinds);
        let own_from = layout.map(|l| l.own_from);
        let mut arena =
            DeviceArena { gpu: gpu.clone(), buffers: BTreeMap::new(), allocator: None, bytes: 0, own_from };
        arena.allocator = Some(
            Allocator::new(&AllocatorCreateDesc {
                instance: gpu.vulkan().instance.raw.clone(),
                device: gpu.raw().clone(),
                physical_device: gpu.vulkan().physical,
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
        if gpu.faults().shuffle.is_some() {
            arena.add(&BufferPlan::new(SIZE_BACK, 12, Place::Readback))?;
        }
        if gpu.faults().guard {
            let stated = arena.bytes;
            arena.add(&BufferPlan::new(CANARY_BACK, CANARY_PART, Place::Readback))?;
            arena.bytes = stated;
        }
        match budget.filter(|b| !gpu.faults().guard && arena.taken() > *b) {
            None => Ok(arena),
            Some(budget) => Err(over(plan.iter(), arena.taken(), budget, Whose::Users)),
        }
    }

    fn add(&mut self, plan: &BufferPlan) -> Result<()> {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let canary = if self.gpu.faults().guard { canary_of(plan.bytes) } else { 0 };
        let info = vk::BufferCreateInfo::default().size(plan.bytes + canary).usage(usage);
        let gpu = self.gpu.clone();
        let device = gpu.raw();
        let refused = |what: String| {
            Error::memory(
                format!("the device refuses {} for buffer `{}` ({what})", size(plan.bytes), plan.buffer),
                advice!["use " {Remedy::SMALLER_JOB}],
            )
        };
        let before_call = || gpu.before_call(Point::Allocation);
        // SAFETY: the device is alive; the memory bound is the allocation made for this very buffer.
        let handle = before_call().and_then(|()| unsafe { device.create_buffer(&info, None) });
        let handle = handle.map_err(|e| refused(e.to_string()))?;
        let name = plan.buffer.to_string();
        self.gpu.name(handle, &name);
        let made = Made { handle, bytes: plan.bytes, canary, place: plan.place };
        self.buffers.insert(plan.buffer, (made, None));
        let requirements = unsafe { device.get_buffer_memory_requirements(handle) };
        before_call().map_err(|e| refused(e.to_string()))?;
        let held = self.memory_for(plan, &name, handle, requirements).map_err(refused)?;
        let (memory, offset) = held.place();
        self.bytes += held.bytes() - canary;
        self.gpu.allocated.fetch_add(held.bytes(), Relaxed);
        if let Some((_, of_buffer)) = self.buffers.get_mut(&plan.buffer) {
            *of_buffer = Some(held);
        }
        before_call()
            .and_then(|()| unsafe { device.bind_buffer_memory(handle, memory, offset) })
            .map_err(|e| refused(e.to_string()))
    }

    /// Memory for a buffer, or the reason for its absence.
    fn memory_for(
        &mut self,
        plan: &BufferPlan,
        name: &str,
        handle: vk::Buffer,
        mut requirements: vk::MemoryRequirements,
    ) -> std::result::Result<BufferMemory, String> {
        if let Some(blocks) = &self.gpu.vulkan().blocks {
            if plan.place != Place::Device {
                requirements.memory_type_bits &= self.gpu.coherent_types();
            }
            let block = blocks
                .allocate(&requirements, plan.place)
                .ok_or("the application's allocator returned no memory")?;
            let held = BufferMemory::External(block, requirements.size);
            if plan.place != Place::Device && held.mapped().is_none() {
                blocks.free(block);
                return Err("the application's allocator returned unmapped memory".into());
            }
            return Ok(held);
        }
        let allocator = self.allocator.as_mut().expect("set in new, taken in drop only");
        let made = allocator.allocate(&AllocationCreateDesc {
            name,
            requirements,
            location: match plan.place {
                Place::Device => MemoryLocation::GpuOnly,
                // Uploads are transient: they use the memory type of readbacks and share its block. Host-visible
                // memory of a discrete GPU is often only 256 MiB.
                Place::Upload | Place::Readback => MemoryLocation::GpuToCpu,
            },
            linear: true,
            allocation_scheme: if plan.bytes < self.own_from[usize::from(plan.place != Place::Device)] {
                AllocationScheme::GpuAllocatorManaged
            } else {
                AllocationScheme::DedicatedBuffer(handle)
            },
        });
        made.map(BufferMemory::Own).map_err(|e| e.to_string())
    }

    /// Bytes of all buffers, including host-visible ones, excluding canaries.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Bytes of memory blocks allocated for the buffers: at least [`DeviceArena::bytes`], as small buffers share blocks.
    pub fn taken(&self) -> u64 {
        match self.gpu.vulkan().blocks {
            Some(_) => self.bytes,
            None => self.allocator.as_ref().map_or(0, Allocator::capacity),
        }
    }

    /// All buffers.
    pub(super) fn buffers(&self) -> Vec<(Buffer, Made)> {
        self.buffers.iter().map(|(buffer, (made, _))| (*buffer, *made)).collect()
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

    fn held(&self, buffer: Buffer) -> &(Made, Option<BufferMemory>) {
        self.buffers.get(&buffer).unwrap_or_else(|| panic!("the plan holds no buffer `{buffer}`"))
    }

    /// Host address of an upload or readback buffer, valid for its bytes and its canary during the arena's lifetime.
    /// The device may write there concurrently.
    pub(super) fn pointer(&self, buffer: Buffer) -> NonNull<u8> {
        let mapped = self.held(buffer).1.as_ref().and_then(BufferMemory::mapped);
        mapped.unwrap_or_else(|| panic!("buffer `{buffer}` is not host-visible"))
    }
}

impl Drop for DeviceArena {
    fn drop(&mut self) {
        if self.gpu.has_hung() {
            // The device may still use these objects: leak them.
            std::mem::forget((std::mem::take(&mut self.buffers), self.allocator.take()));
            return;
        }
        // SAFETY: the executor that used these buffers waited for its work before it was dropped.
        for (_, (b, held)) in std::mem::take(&mut self.buffers) {
            unsafe { self.gpu.raw().destroy_buffer(b.handle, None) };
            let Some(held) = held else { continue };
            let bytes = held.bytes();
            let is_freed = match (held, self.allocator.as_mut(), &self.gpu.vulkan().blocks) {
                (BufferMemory::Own(own), Some(allocator), _) => allocator.free(own).is_ok(),
                (BufferMemory::External(block, _), _, Some(blocks)) => {
                    blocks.free(block);
                    true
                }
                _ => false,
            };
            // Memory that is not freed still counts as allocated.
            if is_freed {
                self.gpu.allocated.fetch_sub(bytes, Relaxed);
            }
        }
        self.allocator = None;
    }
}

#[doc(hidden)]
impl Gpu {
    /// Host-visible, coherent memory types, as bits.
    pub(super) fn coherent_types(&self) -> u32 {
        // SAFETY: the physical device is the instance's.
        let memory = unsafe {
            self.vulkan().instance.raw.get_physical_device_memory_properties(self.vulkan().physical)
        };
        coherent(memory.memory_types_as_slice())
    }

    /// Currently free memory for this process, as reported by the driver or the system.
    pub fn memory(&self) -> Memory {
        if self.is_host() {
            return Memory::of_host(self.limits.storage_range);
        }
        let vulkan = self.vulkan();
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut memory = vk::PhysicalDeviceMemoryProperties2::default();
        if vulkan.has_budget {
            memory = memory.push_next(&mut budget);
        }
        // SAFETY: the extension is enabled on this device if its struct is asked for.
        unsafe { vulkan.instance.raw.get_physical_device_memory_properties2(vulkan.physical, &mut memory) };
        let heaps = memory.memory_properties.memory_heaps;
        let free = |heap: usize| match vulkan.has_budget {
            true => budget.heap_budget[heap].saturating_sub(budget.heap_usage[heap]),
            false => heaps[heap].size,
        };
        let [device, host] = vulkan.kinds.heaps;
        Memory {
            storage_range: self.limits.storage_range,
            free: [free(device), free(host)],
            shared: device == host,
            allocation: vulkan.allocation,
            kinds: vulkan.kinds,
        }
    }
}

/// Canary size of a buffer of `bytes` bytes: the same size, but at least [`LEAST_CANARY`].
fn canary_of(bytes: u64) -> u64 {
    bytes.max(LEAST_CANARY)
}

/// Buffers to allocate for a plan, each with a canary if the device guards them.
fn guarded(gpu: &Gpu, plan: &[BufferPlan]) -> Vec<BufferPlan> {
    let canary = |b: &BufferPlan| if gpu.faults().guard { canary_of(b.bytes) } else { 0 };
    plan.iter().map(|b| BufferPlan { bytes: b.bytes + canary(b), ..b.clone() }).collect()
}
