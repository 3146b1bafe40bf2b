//! Memory requirements of a plan, before allocation: blocks of each memory type, heap by heap.

use ash::vk;

use super::instance::Instance;
use super::place::{BufferPlan, Place};
use crate::advice::{Advice, Remedy, advice};
use crate::{Error, Result};

/// Buffers share memory blocks whose size is a multiple of [`BLOCK`] and at most [`LARGEST_BLOCK`], the bounds of
/// gpu-allocator.
const BLOCK: u64 = 4 << 20;
const LARGEST_BLOCK: u64 = 256 << 20;

/// Layout of the buffers in one memory type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MemoryLayout {
    /// Buffers from this size have dedicated allocations. If one block holds all buffers, they share it; otherwise
    /// only smaller ones share a block.
    pub own_from: u64,
    pub block: u64,
    /// Total bytes.
    taken: u64,
}

impl MemoryLayout {
    fn of<'b>(buffers: impl Iterator<Item = &'b BufferPlan> + Clone) -> MemoryLayout {
        // Slightly above the sum, for alignment, so that one block holds them all.
        let block = |below: u64| {
            let small = buffers.clone().filter(|b| b.bytes < below);
            small.map(|b| b.bytes.saturating_add(256)).fold(0, u64::saturating_add)
        };
        let rounded = |bytes: u64| bytes.checked_next_multiple_of(BLOCK).unwrap_or(u64::MAX);
        let all = rounded(block(u64::MAX));
        if all <= LARGEST_BLOCK {
            return MemoryLayout { own_from: u64::MAX, block: all, taken: all };
        }
        let own = buffers.clone().filter(|b| b.bytes >= BLOCK).map(|b| b.bytes.saturating_add(1 << 16));
        let small = rounded(block(BLOCK));
        MemoryLayout { own_from: BLOCK, block: small, taken: own.fold(small, u64::saturating_add) }
    }

    /// Layouts of device and host buffers: the same layout if both use one memory type.
    pub(super) fn both(plan: &[BufferPlan], kinds: &Kinds) -> [MemoryLayout; 2] {
        if kinds.one {
            return [MemoryLayout::of(plan.iter()); 2];
        }
        let [mut device, mut host] = [true, false]
            .map(|device| MemoryLayout::of(plan.iter().filter(|b| (b.place == Place::Device) == device)));
        if kinds.device_is_mapped {
            // The allocator has one block size for all host-visible memory.
            let block = device.block.max(host.block);
            for layout in [&mut device, &mut host].into_iter().filter(|l| l.block > 0) {
                layout.taken = layout.taken.saturating_add(block - layout.block);
                layout.block = block;
            }
        }
        [device, host]
    }
}

/// Memory types of device buffers and of host-visible buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kinds {
    /// Both are one type, as on CPUs and some integrated GPUs.
    one: bool,
    /// The device type is host-visible as well.
    device_is_mapped: bool,
    /// Heaps of the two types.
    pub heaps: [usize; 2],
}

impl Kinds {
    /// Types that the allocator selects for [`Place::Device`], and for the other places.
    pub fn of(instance: &Instance, physical: vk::PhysicalDevice) -> Kinds {
        // SAFETY: the handle comes from this instance.
        let memory = unsafe { instance.raw.get_physical_device_memory_properties(physical) };
        Kinds::among(memory.memory_types_as_slice())
    }

    fn among(types: &[vk::MemoryType]) -> Kinds {
        type Flags = vk::MemoryPropertyFlags;
        let first = |flags| types.iter().position(|t| t.property_flags.contains(flags));
        let seen = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
        let device = first(Flags::DEVICE_LOCAL).unwrap_or(0);
        let host = first(seen | Flags::HOST_CACHED).or(first(seen)).unwrap_or(0);
        let of = |at: usize| types.get(at).copied().unwrap_or_default();
        Kinds {
            one: device == host,
            device_is_mapped: of(device).property_flags.contains(Flags::HOST_VISIBLE),
            heaps: [device, host].map(|at| of(at).heap_index as usize),
        }
    }
}

/// Host-visible, coherent memory types, as the bits of `VkMemoryRequirements::memoryTypeBits`.
pub(super) fn coherent(types: &[vk::MemoryType]) -> u32 {
    let seen = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
    (0..).zip(types).filter(|(_, t)| t.property_flags.contains(seen)).map(|(i, _)| 1u32 << i).sum()
}

/// Memory of a device, for [`check`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// Largest binding of one buffer in bytes.
    pub storage_range: u64,
    /// Free bytes for device buffers and for host-visible buffers.
    pub free: [u64; 2],
    /// Whether both are the same bytes: discrete GPUs have separate heaps, others share the host's.
    pub shared: bool,
    /// Maximum size of one allocation, bytes.
    pub(super) allocation: u64,
    pub(super) kinds: Kinds,
}

impl Memory {
    /// Memory of the host as a device, with the given largest buffer.
    pub(super) fn of_host(storage_range: u64) -> Memory {
        // `--host-memory` bounds arrays of files and results; `--memory` these.
        let free = thirdbounce_base::host::available();
        let kinds = Kinds { one: true, device_is_mapped: true, heaps: [0, 0] };
        Memory { storage_range, free: [free; 2], shared: true, allocation: u64::MAX, kinds }
    }

    /// A discrete GPU with the given binding limit and free bytes on device and host.
    pub fn of_card(storage_range: u64, free: [u64; 2]) -> Memory {
        let kinds = Kinds { one: false, device_is_mapped: false, heaps: [0, 1] };
        Memory { storage_range, free, shared: false, allocation: u64::MAX, kinds }
    }
}

/// Checks a plan against a device's memory. `budget`: maximum bytes of all buffers. Without it, each heap
/// must hold its buffers. Allocates nothing.
///
/// # Errors
/// A buffer exceeds the device's largest binding or allocation, or the plan exceeds the budget (the error names the
/// largest buffers).
pub fn check(plan: &[BufferPlan], memory: &Memory, budget: Option<u64>) -> Result<()> {
    let range = memory.storage_range;
    if let Some(b) = plan.iter().find(|b| b.place == Place::Device && b.bytes > range) {
        return Err(Error::memory(
            format!(
                "buffer `{}` needs {}, this device binds at most {}",
                b.buffer,
                size(b.bytes),
                size(range)
            ),
            advice!["use " {smaller(b.bytes, range)}],
        ));
    }
    let most = memory.allocation;
    if let Some(b) = plan.iter().find(|b| b.bytes > most) {
        return Err(Error::memory(
            format!(
                "buffer `{}` needs {}, this device allocates at most {} at once",
                b.buffer,
                size(b.bytes),
                size(most)
            ),
            advice!["use " {smaller(b.bytes, most)}],
        ));
    }
    let [device, host] = MemoryLayout::both(plan, &memory.kinds);
    let total = if memory.kinds.one { device.taken } else { device.taken.saturating_add(host.taken) };
    let [on_device, on_host] = memory.free;
    if let Some(budget) = budget {
        return if total <= budget { Ok(()) } else { Err(over(plan.iter(), total, budget, Whose::Users)) };
    }
    if memory.shared {
        return if total <= on_device {
            Ok(())
        } else {
            Err(over(plan.iter(), total, on_device, Whose::Device))
        };
    }
    let part = |of_device: bool| plan.iter().filter(move |b| (b.place == Place::Device) == of_device);
    if device.taken > on_device {
        return Err(over(part(true), device.taken, on_device, Whose::Device));
    }
    if host.taken > on_host {
        return Err(over(part(false), host.taken, on_host, Whose::Host));
    }
    Ok(())
}

/// Source of an insufficient limit.
pub(super) enum Whose {
    Users,
    Device,
    Host,
}

pub(super) fn over<'b>(
    plan: impl Iterator<Item = &'b BufferPlan>,
    total: u64,
    budget: u64,
    whose: Whose,
) -> Error {
    let mut largest: Vec<_> = plan.collect();
    largest.sort_by_key(|b| std::cmp::Reverse(b.bytes));
    let names: Vec<_> = largest.iter().take(3).map(|b| format!("`{}` {}", b.buffer, size(b.bytes))).collect();
    let hint = Advice::from(advice!["use " {smaller(total, budget)}]);
    let (whose, hint) = match whose {
        Whose::Users => ("the memory budget is", hint.and(advice![", or allow more with " Memory])),
        Whose::Device => ("the device has free", hint),
        Whose::Host => ("the host has free for copies from and to the device", hint),
    };
    Error::memory(
        format!(
            "this job needs {} in whole blocks, {whose} {}; the largest buffers: {}",
            size(total),
            size(budget),
            names.join(", ")
        ),
        hint,
    )
}

fn smaller(asked: u64, available: u64) -> Remedy {
    Remedy::SmallerJob { asked: Some(asked), available: Some(available) }
}

pub(super) fn size(bytes: u64) -> String {
    if bytes < 1 << 20 {
        format!("{} KiB", bytes.div_ceil(1 << 10))
    } else {
        format!("{} MiB", bytes.div_ceil(1 << 20))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Buffer;
    use crate::advice::Setting;

    #[test]
    fn buffers_share_a_block_while_it_holds_them() {
        let of = |bytes: &[u64]| {
            MemoryLayout::of(
                bytes
                    .iter()
                    .map(|b| BufferPlan::new(Buffer::named("b"), *b, Place::Device))
                    .collect::<Vec<_>>()
                    .iter(),
            )
        };
        let mib = 1 << 20;
        assert_eq!(of(&[]), MemoryLayout { own_from: u64::MAX, block: 0, taken: 0 });
        assert_eq!(of(&[100, 5 * mib]), MemoryLayout { own_from: u64::MAX, block: 8 * mib, taken: 8 * mib });
        let large = of(&[100, 300 * mib, 3 * mib]);
        assert_eq!((large.own_from, large.block), (4 * mib, 4 * mib));
        assert_eq!(large.taken, 304 * mib + (1 << 16));
        assert_eq!(of(&[u64::MAX - 300, u64::MAX - 300]).taken, u64::MAX);
    }

    #[test]
    fn a_plan_over_budget_names_its_largest_buffers() {
        let plan = [("small", 100), ("raw", 5 << 20)]
            .map(|(n, b)| BufferPlan::new(Buffer::named(n), b, Place::Device));
        let card = |range, device| Memory::of_card(range, [device, 0]);
        assert!(check(&plan, &card(1 << 30, 8 << 20), None).is_ok(), "two blocks of 4 MiB");
        assert!(check(&plan, &card(1 << 30, 7 << 20), None).is_err());
        let error = check(&plan, &card(1 << 30, 0), Some(1 << 20)).unwrap_err();
        assert!(error.what.contains("`raw` 5 MiB") && error.hint.names(Setting::Memory), "{error}");
        assert!(error.hint.remedies().any(|r| r == smaller(8 << 20, 1 << 20)), "{error:?}");
        let error = check(&plan, &card(1 << 20, 1 << 30), None).unwrap_err();
        assert!(error.what.contains("binds at most 1 MiB"), "{error}");
    }

    #[test]
    fn what_the_host_sees_lies_on_its_own_heap_and_counts_there() {
        let plan = [
            ("raw", 6 << 20, Place::Device),
            ("upload", 5 << 20, Place::Upload),
            ("back", 4 << 20, Place::Readback),
        ]
        .map(|(n, b, place)| BufferPlan::new(Buffer::named(n), b, place));
        let free = |device, host| check(&plan, &Memory::of_card(1 << 30, [device, host]), None);
        assert!(free(8 << 20, 12 << 20).is_ok(), "uploads and readbacks share a block");
        let error = free(8 << 20, 11 << 20).unwrap_err();
        assert!(error.what.contains("the host has free") && error.what.contains("`upload`"), "{error}");
        assert!(!error.what.contains("`raw`"), "{error}");
        let error = free(7 << 20, 1 << 30).unwrap_err();
        assert!(error.what.contains("the device has free") && !error.what.contains("`upload`"), "{error}");
        // A budget covers both together.
        let all = Memory::of_card(1 << 30, [0, 0]);
        assert!(check(&plan, &all, Some(20 << 20)).is_ok() && check(&plan, &all, Some(19 << 20)).is_err());
    }

    #[test]
    fn no_buffer_is_larger_than_an_allocation() {
        let plan = |place| [BufferPlan::new(Buffer::named("large"), 3 << 20, place)];
        for place in [Place::Device, Place::Upload] {
            let card = |allocation| Memory { allocation, ..Memory::of_card(1 << 30, [1 << 40; 2]) };
            assert!(check(&plan(place), &card(3 << 20), None).is_ok());
            let error = check(&plan(place), &card(2 << 20), None).unwrap_err();
            assert!(
                error.what.contains("`large` needs 3 MiB, this device allocates at most 2 MiB"),
                "{error}"
            );
            assert!(error.hint.remedies().any(|r| r == smaller(3 << 20, 2 << 20)), "{error:?}");
        }
    }

    #[test]
    fn a_callers_memory_that_the_host_sees_is_coherent() {
        type Flags = vk::MemoryPropertyFlags;
        let seen = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
        // As on phones: the first host-visible type is cached and not coherent.
        let types = [
            Flags::DEVICE_LOCAL,
            Flags::HOST_VISIBLE | Flags::HOST_CACHED,
            seen,
            seen | Flags::HOST_CACHED | Flags::DEVICE_LOCAL,
        ];
        let types = types.map(|property_flags| vk::MemoryType { property_flags, heap_index: 0 });
        assert_eq!(coherent(&types), 0b1100);
        assert_eq!(coherent(&types[..2]), 0);
    }

    #[test]
    fn the_kinds_of_memory_are_those_that_the_allocator_takes() {
        type Flags = vk::MemoryPropertyFlags;
        let seen = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
        let kind = |property_flags, heap_index| vk::MemoryType { property_flags, heap_index };
        let card = [
            kind(Flags::DEVICE_LOCAL, 0),
            kind(seen, 1),
            kind(seen | Flags::HOST_CACHED, 1),
            kind(seen | Flags::DEVICE_LOCAL, 2),
        ];
        assert_eq!(Kinds::among(&card), Kinds { one: false, device_is_mapped: false, heaps: [0, 1] });
        let cpu = [kind(Flags::DEVICE_LOCAL | seen | Flags::HOST_CACHED, 0)];
        assert_eq!(Kinds::among(&cpu), Kinds { one: true, device_is_mapped: true, heaps: [0, 0] });
        // Both types of an integrated GPU use blocks of the same size.
        let integrated = [kind(Flags::DEVICE_LOCAL | seen, 0), kind(seen | Flags::HOST_CACHED, 0)];
        let kinds = Kinds::among(&integrated);
        assert_eq!(kinds, Kinds { one: false, device_is_mapped: true, heaps: [0, 0] });
        let plan = [(1, Place::Device), (9 << 20, Place::Readback)]
            .map(|(b, place)| BufferPlan::new(Buffer::named("b"), b, place));
        assert_eq!(MemoryLayout::both(&plan, &kinds).map(|l| (l.block, l.taken)), [(12 << 20, 12 << 20); 2]);
    }
}
