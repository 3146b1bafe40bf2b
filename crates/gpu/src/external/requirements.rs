//! Requirements on an application's device, and optional features used if present.

use std::ffi::CStr;

use ash::vk;

use crate::instance::{Instance, version_text};
use crate::offered::Offered;
use crate::options::{GpuOptions, compute_family};
use crate::{Error, Result};

/// Minimum Vulkan version of instance and device.
const VERSION: u32 = vk::API_VERSION_1_2;

/// Features and extensions used by the library. Only the first is required.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Features {
    /// `VkPhysicalDeviceVulkan12Features::timelineSemaphore`. Required.
    pub timeline_semaphore: bool,
    /// `VkPhysicalDeviceFeatures::shaderInt64` and `VkPhysicalDeviceVulkan12Features::shaderBufferInt64Atomics`.
    pub int64_atomics: bool,
    /// VK_EXT_shader_atomic_float with `VkPhysicalDeviceShaderAtomicFloatFeaturesEXT::shaderBufferFloat32AtomicAdd`:
    /// the fastest histogram accumulation on GPUs.
    pub float_atomics: bool,
    /// VK_EXT_memory_budget: amount of free memory.
    pub memory_budget: bool,
    /// VK_KHR_portability_subset: must be enabled on devices that offer it.
    pub portability_subset: bool,
    /// VK_KHR_external_memory_fd, for [`super::Imported`].
    pub external_memory_fd: bool,
    /// VK_EXT_debug_utils, an instance extension: names of buffers and kernels.
    pub debug_utils: bool,
}

impl Features {
    /// Device extensions required by these features.
    pub fn extensions(&self) -> Vec<&'static CStr> {
        let offered = Offered {
            float: self.float_atomics,
            has_budget: self.memory_budget,
            is_subset: self.portability_subset,
            has_external_memory: self.external_memory_fd,
            ..Offered::default()
        };
        offered.extensions()
    }

    /// The intersection of `offered` with the enabled features.
    ///
    /// # Errors
    /// Timeline semaphores are not enabled, or a feature is listed that the device lacks.
    pub(super) fn of(&self, offered: Offered, name: &str) -> Result<Offered> {
        if !self.timeline_semaphore {
            return Err(Error::device(
                "the device was created without timeline semaphores, which are required",
                "enable VkPhysicalDeviceVulkan12Features::timelineSemaphore in VkDeviceCreateInfo, and set it in the enabled features",
            ));
        }
        let pairs = [
            (self.int64_atomics, offered.int64, "64-bit atomics"),
            (self.float_atomics, offered.float, "fp32 atomics"),
            (self.memory_budget, offered.has_budget, "VK_EXT_memory_budget"),
            (self.external_memory_fd, offered.has_external_memory, "VK_KHR_external_memory_fd"),
        ];
        if let Some((_, _, what)) = pairs.into_iter().find(|(said, there, _)| *said && !there) {
            return Err(Error::device(
                format!("{what} are said to be enabled, which {name} does not have"),
                "list only enabled features, a subset of the requirements of this device",
            ));
        }
        Ok(Offered {
            float: self.float_atomics,
            int64: self.int64_atomics,
            robust: false,
            has_budget: self.memory_budget,
            has_statistics: false,
            is_subset: self.portability_subset,
            has_external_memory: self.external_memory_fd,
            has_device_fault: false,
            ..offered
        })
    }
}

/// Requirements for creating a device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Requirements {
    /// Minimum `VkApplicationInfo::apiVersion`.
    pub api_version: u32,
    /// A compute queue family, without graphics if possible. Any other compute family is suitable.
    pub family: u32,
    /// All features that the device offers and the library uses; any subset may be enabled.
    pub features: Features,
}

impl Requirements {
    /// Device extensions to enable.
    pub fn extensions(&self) -> Vec<&'static CStr> {
        self.features.extensions()
    }
}

/// Requirements for creating a device of an application's instance. `api_version` is that of the instance.
///
/// # Errors
/// Instance or device have an older version, or the device lacks a requirement.
///
/// # Safety
/// The handles are valid and belong together.
pub unsafe fn requirements(
    get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    instance: vk::Instance,
    api_version: u32,
    physical_device: vk::PhysicalDevice,
) -> Result<Requirements> {
    check_version(api_version)?;
    // SAFETY: as the caller states.
    let raw = unsafe { load(get_instance_proc_addr, instance) };
    let instance = Instance::of_external(raw, false);
    let info = instance.describe(0, physical_device);
    let offered = Offered::by(&instance, physical_device, &info, &GpuOptions::default())?;
    let (family, _) = compute_family(&instance, physical_device, &info)?;
    let features = Features {
        timeline_semaphore: true,
        int64_atomics: offered.int64,
        float_atomics: offered.float,
        memory_budget: offered.has_budget,
        portability_subset: offered.is_subset,
        external_memory_fd: offered.has_external_memory,
        debug_utils: false,
    };
    Ok(Requirements { api_version: VERSION, family, features })
}

/// # Errors
/// A version below the minimum.
pub(super) fn check_version(api_version: u32) -> Result<()> {
    if api_version >= VERSION {
        return Ok(());
    }
    Err(Error::device(
        format!("the instance was created for Vulkan {}, 1.2 is required", version_text(api_version)),
        "set VkApplicationInfo::apiVersion to VK_API_VERSION_1_2 or later",
    ))
}

/// # Safety
/// The instance is valid, and the function is its loader function.
pub(super) unsafe fn load(
    get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    instance: vk::Instance,
) -> ash::Instance {
    let entry = ash::StaticFn { get_instance_proc_addr };
    // SAFETY: as the caller states.
    unsafe { ash::Instance::load(&entry, instance) }
}

#[cfg(test)]
mod tests {
    use ash::ext;

    use super::*;

    #[test]
    fn what_is_said_to_be_enabled_must_be_there() {
        let offered = Offered { int64: true, rounding: true, ..Offered::default() };
        let all = Features { timeline_semaphore: true, int64_atomics: true, ..Features::default() };
        let taken = all.of(offered, "a card").unwrap();
        assert!(taken.int64 && taken.rounding && !taken.float);
        let none = Features { timeline_semaphore: true, ..Features::default() };
        assert!(!none.of(offered, "a card").unwrap().int64, "offered, but not enabled");
        let error = Features { float_atomics: true, ..all }.of(offered, "a card").unwrap_err();
        assert!(error.what.contains("fp32 atomics") && error.what.contains("a card"), "{error}");
        assert!(Features::default().of(offered, "a card").unwrap_err().what.contains("timeline"));
        assert!(check_version(vk::API_VERSION_1_1).is_err() && check_version(vk::API_VERSION_1_3).is_ok());
        let extensions = Features { float_atomics: true, ..all }.extensions();
        assert_eq!(extensions, [ext::shader_atomic_float::NAME]);
    }
}
