//! Device limits: those used for planning, and the minimum requirements.

use ash::vk;

use super::instance::{DeviceKind, Instance};
use crate::advice::advice;
use crate::{Error, Result};

/// Maximum number of storage buffers of a kernel. Vulkan guarantees 4; nearly all GPUs have 16 or more.
pub const MOST_STORAGE: u32 = 12;

/// Optional accumulation paths of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Accumulations {
    /// fp32 atomic add on buffers.
    pub float: bool,
    /// 64-bit integer atomic add on buffers.
    pub int64: bool,
}

/// Limits used for planning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Largest binding of one buffer, bytes, not above one allocation.
    pub storage_range: u64,
    /// Maximum invocations per workgroup, in any shape in x and y.
    pub workgroup_invocations: u32,
    /// Shared memory per workgroup, bytes.
    pub shared_memory: u32,
    /// Maximum workgroups per dispatch along x, y and z.
    pub groups: [u32; 3],
    /// Invocations per subgroup.
    pub subgroup: u32,
    /// Maximum loop turns per dispatch over all invocations, well below a driver's watchdog timeout.
    pub work: u64,
}

impl Limits {
    pub(super) fn binding_at_most(self, bytes: Option<u64>) -> Limits {
        Limits {
            storage_range: bytes.map_or(self.storage_range, |most| most.min(self.storage_range)),
            ..self
        }
    }
}

/// Properties of a device relevant to plans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Abilities {
    /// Device kind.
    pub kind: DeviceKind,
    /// Supported accumulation paths.
    pub accumulations: Accumulations,
    /// Its limits.
    pub limits: Limits,
}

/// Limits reported by the driver.
pub(super) struct Reported {
    pub limits: vk::PhysicalDeviceLimits,
    /// Invocations per subgroup.
    pub subgroup: u32,
    /// Maximum size of one allocation, bytes.
    pub allocation: u64,
}

impl Reported {
    pub fn by(instance: &Instance, physical: vk::PhysicalDevice) -> Reported {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut memory = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut properties =
            vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup).push_next(&mut memory);
        // SAFETY: the physical device is the instance's; the chained structs, of Vulkan 1.1, outlive the call.
        unsafe { instance.raw.get_physical_device_properties2(physical, &mut properties) };
        let limits = properties.properties.limits;
        Reported { limits, subgroup: subgroup.subgroup_size, allocation: memory.max_memory_allocation_size }
    }

    /// Checks the minimum requirements, for the device of this name.
    ///
    /// # Errors
    /// Too few storage buffers per kernel.
    pub fn check(&self, name: &str) -> Result<()> {
        let l = &self.limits;
        let of_set = l.max_descriptor_set_storage_buffers;
        let most = l.max_per_stage_descriptor_storage_buffers.min(of_set);
        if most >= MOST_STORAGE {
            return Ok(());
        }
        Err(Error::device(
            format!("{name} supports {most} storage buffers per kernel, {MOST_STORAGE} are required"),
            advice!["choose another device with " Device " (" [Devices] " lists them)"],
        ))
    }

    /// Planning limits, for dispatches of `work` turns.
    pub fn of_plans(&self, work: u64) -> Limits {
        let l = &self.limits;
        let [x, y, _] = l.max_compute_work_group_size;
        Limits {
            storage_range: u64::from(l.max_storage_buffer_range).min(self.allocation),
            workgroup_invocations: l.max_compute_work_group_invocations.min(x).min(y),
            shared_memory: l.max_compute_shared_memory_size,
            groups: l.max_compute_work_group_count,
            subgroup: self.subgroup,
            work,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::advice::Setting;

    /// A device with the guaranteed minimum limits, except for storage buffers.
    fn least(storage: u32) -> Reported {
        let limits = vk::PhysicalDeviceLimits {
            max_storage_buffer_range: 1 << 27,
            max_compute_work_group_invocations: 128,
            max_compute_work_group_size: [128, 128, 64],
            max_compute_shared_memory_size: 16_384,
            max_compute_work_group_count: [65_535; 3],
            max_per_stage_descriptor_storage_buffers: storage,
            max_descriptor_set_storage_buffers: 24,
            ..Default::default()
        };
        Reported { limits, subgroup: 32, allocation: 1 << 30 }
    }

    #[test]
    fn a_device_that_binds_too_little_is_refused() {
        least(MOST_STORAGE).check("a card").expect("just enough");
        let error = least(8).check("a card").expect_err("too few");
        assert!(
            error.what.contains("a card supports 8 storage buffers") && error.hint.names(Setting::Device),
            "{error}"
        );
        let mut reported = least(64);
        reported.limits.max_descriptor_set_storage_buffers = 11;
        assert!(reported.check("a card").is_err());
    }

    #[test]
    fn limits_are_the_least_of_those_that_hold() {
        let mut reported = least(16);
        let limits = |r: &Reported| r.of_plans(7);
        assert_eq!((limits(&reported).storage_range, limits(&reported).work), (1 << 27, 7));
        // A binding of 4 GiB is useless if an allocation has at most 1 GiB.
        reported.limits.max_storage_buffer_range = u32::MAX;
        assert_eq!(limits(&reported).storage_range, 1 << 30);
        assert_eq!(limits(&reported).binding_at_most(Some(1 << 40)).storage_range, 1 << 30);
        // The height of gather workgroups is the number of lanes per voxel.
        for size in [[128, 1024, 64], [1024, 128, 64], [1024, 1024, 64]] {
            reported.limits.max_compute_work_group_size = size;
            assert_eq!(limits(&reported).workgroup_invocations, 128, "{size:?}");
        }
    }
}
