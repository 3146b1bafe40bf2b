//! Optional features and extensions, enabled where offered.

use std::ffi::CStr;

use ash::{ext, khr, vk};

use super::instance::{DeviceInfo, Instance};
use super::limits::Reported;
use super::options::GpuOptions;
use crate::advice::advice;
use crate::{Error, Result};

/// Offered features, of those used.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Offered {
    /// fp32 atomic add on buffers.
    pub float: bool,
    /// 64-bit integers and their atomic add on buffers.
    pub int64: bool,
    /// Bounds checks of buffers, if requested.
    pub robust: bool,
    /// Free memory of every heap.
    pub has_budget: bool,
    /// Statistics of compiled kernels, if requested.
    pub has_statistics: bool,
    /// The device is a layered implementation that requires VK_KHR_portability_subset.
    pub is_subset: bool,
    /// Round-to-nearest of fp32 can be declared by a kernel.
    pub rounding: bool,
    /// Import of external memory by file descriptor.
    pub has_external_memory: bool,
    /// Fault reports after a loss.
    pub has_device_fault: bool,
}

impl Offered {
    /// # Errors
    /// A Vulkan version before 1.2, no timeline semaphores, or too few storage buffers.
    pub fn by(
        instance: &Instance,
        physical: vk::PhysicalDevice,
        info: &DeviceInfo,
        options: &GpuOptions,
    ) -> Result<Offered> {
        // SAFETY: the physical device is the instance's.
        let properties = unsafe { instance.raw.get_physical_device_properties(physical) };
        if properties.api_version < vk::API_VERSION_1_2 {
            return Err(Error::device(
                format!("{} supports Vulkan {}, 1.2 is required", info.name, info.api),
                advice!["update its driver, or choose another device with " Device " (" [Devices] " lists them)"],
            ));
        }
        Reported::by(instance, physical).check(&info.name)?;
        // SAFETY: as above.
        let extensions =
            unsafe { instance.raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
        let offers = |name| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let mut atomic_float = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default();
        let mut statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
        let mut device_fault = vk::PhysicalDeviceFaultFeaturesEXT::default();
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut v12);
        // A struct may be queried only if its extension is present; otherwise it remains zero.
        if offers(ext::shader_atomic_float::NAME) {
            features = features.push_next(&mut atomic_float);
        }
        if offers(khr::pipeline_executable_properties::NAME) {
            features = features.push_next(&mut statistics);
        }
        if offers(ext::device_fault::NAME) {
            features = features.push_next(&mut device_fault);
        }
        // SAFETY: the chained structs outlive the call.
        unsafe { instance.raw.get_physical_device_features2(physical, &mut features) };
        let features = features.features;
        if v12.timeline_semaphore != vk::TRUE {
            return Err(Error::device(
                format!("{} does not support timeline semaphores, which are required", info.name),
                advice!["update its driver, or choose another device with " Device],
            ));
        }
        let mut controls = vk::PhysicalDeviceFloatControlsProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut controls);
        // SAFETY: as above; the struct belongs to Vulkan 1.2.
        unsafe { instance.raw.get_physical_device_properties2(physical, &mut properties) };
        Ok(Offered {
            float: atomic_float.shader_buffer_float32_atomic_add == vk::TRUE,
            int64: features.shader_int64 == vk::TRUE && v12.shader_buffer_int64_atomics == vk::TRUE,
            robust: options.robust && features.robust_buffer_access == vk::TRUE,
            has_budget: offers(ext::memory_budget::NAME),
            has_statistics: (options.timings || options.statistics || options.listings)
                && statistics.pipeline_executable_info == vk::TRUE,
            is_subset: offers(khr::portability_subset::NAME),
            // If the modes of all widths must agree, fp32 alone cannot declare one.
            rounding: controls.shader_rounding_mode_rte_float32 == vk::TRUE
                && controls.rounding_mode_independence != vk::ShaderFloatControlsIndependence::NONE,
            has_external_memory: offers(khr::external_memory_fd::NAME),
            has_device_fault: device_fault.device_fault == vk::TRUE,
        })
    }

    /// Extensions to enable.
    pub fn extensions(&self) -> Vec<&'static CStr> {
        let all = [
            (self.float, ext::shader_atomic_float::NAME),
            (self.has_budget, ext::memory_budget::NAME),
            (self.has_statistics, khr::pipeline_executable_properties::NAME),
            (self.is_subset, khr::portability_subset::NAME),
            (self.has_external_memory, khr::external_memory_fd::NAME),
            (self.has_device_fault, ext::device_fault::NAME),
        ];
        all.into_iter().filter(|(offered, _)| *offered).map(|(_, name)| name).collect()
    }

    /// Creates the device with all offered features.
    ///
    /// # Errors
    /// Device creation fails.
    pub fn create(
        &self,
        instance: &Instance,
        physical: vk::PhysicalDevice,
        info: &DeviceInfo,
        family: u32,
    ) -> Result<ash::Device> {
        let wanted: Vec<_> = self.extensions().iter().map(|name| name.as_ptr()).collect();
        let mut use_statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
            .pipeline_executable_info(true);
        // Other float atomics are separate features, which a device may lack.
        let mut use_float =
            vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default().shader_buffer_float32_atomic_add(true);
        let mut use_device_fault = vk::PhysicalDeviceFaultFeaturesEXT::default().device_fault(true);
        let mut use_v12 = vk::PhysicalDeviceVulkan12Features::default()
            .timeline_semaphore(true)
            .shader_buffer_int64_atomics(self.int64);
        let use_features =
            vk::PhysicalDeviceFeatures::default().shader_int64(self.int64).robust_buffer_access(self.robust);
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&wanted)
            .enabled_features(&use_features)
            .push_next(&mut use_v12);
        if self.float {
            create = create.push_next(&mut use_float);
        }
        if self.has_statistics {
            create = create.push_next(&mut use_statistics);
        }
        if self.has_device_fault {
            create = create.push_next(&mut use_device_fault);
        }
        // SAFETY: the physical device is the instance's; the chained structs outlive the call.
        unsafe { instance.raw.create_device(physical, &create, None) }.map_err(|e| {
            Error::device(
                format!("{} cannot be opened ({e})", info.name),
                advice!["another program may hold it, or its driver is broken; try another with " Device],
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_extension_is_asked_for_where_it_is_offered_and_only_there() {
        assert!(Offered::default().extensions().is_empty());
        let layered = Offered { is_subset: true, rounding: true, int64: true, ..Offered::default() };
        assert_eq!(layered.extensions(), [khr::portability_subset::NAME]);
        let usual = Offered { float: true, has_budget: true, has_statistics: true, ..Offered::default() };
        let names = usual.extensions();
        assert_eq!(names.len(), 3);
        assert!(names.contains(&ext::shader_atomic_float::NAME) && names.contains(&ext::memory_budget::NAME));
    }
}
