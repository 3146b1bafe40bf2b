//! A caller's own Vulkan: instance, device, queue, memory and buffers of the program that embeds the library. Nothing of
//! it is destroyed here, and nothing is enabled on it: [`requirements`] says what the caller is to enable.
//!
//! Handles are numbers that nobody can check, so whoever gives them makes a promise: the functions that take them are
//! `unsafe`. What they return is safe to use.

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

pub use super::flight::Moment;
pub use super::owned::QueueLock;
pub use super::place::{Block, BlockSource};
pub use buffer::{Imported, Lent};
pub use requirements::{Features, Requirements, requirements};

/// Handles of a caller's Vulkan.
#[derive(Clone)]
pub struct Vulkan {
    /// `vkGetInstanceProcAddr` of the loader that made the instance.
    pub get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    /// The instance.
    pub instance: vk::Instance,
    /// `VkApplicationInfo::apiVersion` of the instance: at least 1.2.
    pub api_version: u32,
    /// The physical device.
    pub physical_device: vk::PhysicalDevice,
    /// The device.
    pub device: vk::Device,
    /// A queue that computes.
    pub queue: vk::Queue,
    /// Its family.
    pub family: u32,
    /// What was enabled of that which [`requirements`] names.
    pub enabled: Features,
    /// Taken around submissions to the queue. `None`: nobody else uses the queue while a [`Gpu`] of it lives.
    pub lock: Option<Arc<dyn QueueLock>>,
    /// Memory for buffers. `None`: the library allocates blocks of its own.
    pub blocks: Option<Arc<dyn BlockSource>>,
    /// Compiled kernels are kept in this cache. Null: in one of the library's own.
    pub pipeline_cache: vk::PipelineCache,
}

impl Gpu {
    /// A handle of a caller's device. All sessions and solves over it submit to the caller's queue.
    ///
    /// # Errors
    /// A device, a version or a queue that does not suffice; each error says what is missing.
    ///
    /// # Safety
    /// All handles are valid, belong together, and outlive the last clone of the returned handle with everything that was made
    /// of it. `enabled` says no more than what was enabled.
    pub unsafe fn of_caller(vulkan: &Vulkan) -> Result<Gpu> {
        requirements::check_version(vulkan.api_version)?;
        let debug_names = vulkan.enabled.debug_utils;
        // SAFETY: the caller gives an instance with the function that loads its functions.
        let raw = unsafe { requirements::load(vulkan.get_instance_proc_addr, vulkan.instance) };
        let instance = Arc::new(Instance::of_caller(raw, debug_names));
        let physical = vulkan.physical_device;
        let index = instance.list().iter().position(|(other, _)| *other == physical).ok_or_else(|| {
            Error::device(
                "the physical device is none of the instance's",
                "give the instance that the device was made with",
            )
        })?;
        let info = instance.describe(index, physical);
        let options = GpuOptions::default();
        let offered = Offered::by(&instance, physical, &info, &options)?;
        let offered = vulkan.enabled.of(offered, &info.name)?;
        check_family(&instance, vulkan, &info.name)?;
        // SAFETY: the caller gives a device of the instance.
        let device = unsafe { ash::Device::load(instance.raw.fp_v1_0(), vulkan.device) };
        let device = Arc::new(OwnedDevice::new(device, instance.clone(), true));
        let cache = Cache::of_caller(device.clone(), vulkan.pipeline_cache);
        let (lock, blocks) = (vulkan.lock.clone(), vulkan.blocks.clone());
        let (queue, family) = (vulkan.queue, vulkan.family);
        let parts = Parts { instance, device, physical, info, queue, family, offered, cache, lock, blocks };
        Ok(Gpu::of(parts, &options))
    }
}

/// Checks that the queue's family computes.
fn check_family(instance: &Instance, vulkan: &Vulkan, name: &str) -> Result<()> {
    // SAFETY: the physical device is the instance's.
    let families =
        unsafe { instance.raw.get_physical_device_queue_family_properties(vulkan.physical_device) };
    match families.get(vulkan.family as usize) {
        Some(family) if family.queue_flags.contains(vk::QueueFlags::COMPUTE) => Ok(()),
        Some(_) => Err(Error::device(
            format!("queue family {} of {name} does not compute", vulkan.family),
            "give a queue of a family with VK_QUEUE_COMPUTE_BIT",
        )),
        None => Err(Error::device(
            format!(
                "{name} has {} queue families, the queue is said to be of family {}",
                families.len(),
                vulkan.family
            ),
            advice!["give the family that the queue was made with"],
        )),
    }
}
