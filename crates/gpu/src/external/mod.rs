//! An application's own Vulkan: instance, device, queue, memory and buffers of the embedding program. None of them is
//! destroyed or modified here; [`requirements`] lists what the application must enable.
//!
//! Handles cannot be validated, so functions that accept them are `unsafe`; their results are safe to use.

mod buffer;
mod requirements;

use std::sync::Arc;

use ash::vk;

use super::device::{Gpu, Parts};
use super::instance::Instance;
use super::kept::Cache;
use super::offered::Offered;
use super::options::GpuOptions;
use super::owned::OwnedDevice;
use crate::advice::advice;
use crate::{Error, Result};

pub use super::flight::TimelinePoint;
pub use super::owned::QueueLock;
pub use super::place::{Block, BlockSource};
pub use buffer::{ExternalBuffer, Imported};
pub use requirements::{Features, Requirements, requirements};

/// Handles of an application's Vulkan.
#[derive(Clone)]
pub struct Vulkan {
    /// `vkGetInstanceProcAddr` of the loader that created the instance.
    pub get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    /// The instance.
    pub instance: vk::Instance,
    /// `VkApplicationInfo::apiVersion` of the instance: at least 1.2.
    pub api_version: u32,
    /// The physical device.
    pub physical_device: vk::PhysicalDevice,
    /// The device.
    pub device: vk::Device,
    /// A compute-capable queue.
    pub queue: vk::Queue,
    /// Family of the queue.
    pub family: u32,
    /// Enabled features, of those in [`requirements`].
    pub enabled: Features,
    /// Lock held around submissions to the queue. `None`: the queue is not used otherwise while a [`Gpu`] of it
    /// exists.
    pub lock: Option<Arc<dyn QueueLock>>,
    /// Allocator of buffer memory. `None`: the library allocates its own blocks.
    pub blocks: Option<Arc<dyn BlockSource>>,
    /// Pipeline cache for the library's kernels. Null: a cache of the library.
    pub pipeline_cache: vk::PipelineCache,
}

impl Gpu {
    /// A handle of an application's device. All its sessions and solves submit to the application's queue.
    ///
    /// # Errors
    /// An unsuitable device, version or queue; the error names the missing requirement.
    ///
    /// # Safety
    /// All handles are valid, belong together, and outlive the last clone of the returned handle and everything
    /// created from it. `enabled` lists only enabled features.
    pub unsafe fn of_external(vulkan: &Vulkan) -> Result<Gpu> {
        requirements::check_version(vulkan.api_version)?;
        let debug_names = vulkan.enabled.debug_utils;
        // SAFETY: the caller provides an instance with its loader function.
        let raw = unsafe { requirements::load(vulkan.get_instance_proc_addr, vulkan.instance) };
        let instance = Arc::new(Instance::of_external(raw, debug_names));
        let physical = vulkan.physical_device;
        let index = instance.list().iter().position(|(other, _)| *other == physical).ok_or_else(|| {
            Error::device(
                "the physical device does not belong to the instance",
                "give the instance from which the device was created",
            )
        })?;
        let info = instance.describe(index, physical);
        let options = GpuOptions::default();
        let offered = Offered::by(&instance, physical, &info, &options)?;
        let offered = vulkan.enabled.of(offered, &info.name)?;
        check_family(&instance, vulkan, &info.name)?;
        // SAFETY: the caller provides a device of the instance.
        let device = unsafe { ash::Device::load(instance.raw.fp_v1_0(), vulkan.device) };
        let device = Arc::new(OwnedDevice::new(device, instance.clone(), true));
        let cache = Cache::of_external(device.clone(), vulkan.pipeline_cache);
        let (lock, blocks) = (vulkan.lock.clone(), vulkan.blocks.clone());
        let (queue, family) = (vulkan.queue, vulkan.family);
        let parts = Parts { instance, device, physical, info, queue, family, offered, cache, lock, blocks };
        Ok(Gpu::of(parts, &options))
    }
}

/// Checks that the queue's family supports compute.
fn check_family(instance: &Instance, vulkan: &Vulkan, name: &str) -> Result<()> {
    // SAFETY: the physical device is the instance's.
    let families =
        unsafe { instance.raw.get_physical_device_queue_family_properties(vulkan.physical_device) };
    match families.get(vulkan.family as usize) {
        Some(family) if family.queue_flags.contains(vk::QueueFlags::COMPUTE) => Ok(()),
        Some(_) => Err(Error::device(
            format!("queue family {} of {name} does not support compute", vulkan.family),
            "give a queue of a family with VK_QUEUE_COMPUTE_BIT",
        )),
        None => Err(Error::device(
            format!("{name} has {} queue families, the given family is {}", families.len(), vulkan.family),
            advice!["give the family of the queue"],
        )),
    }
}
