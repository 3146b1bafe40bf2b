//! Vulkan loader, instance and device enumeration.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

use ash::{ext, khr, vk};
use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// Device kind, in order of preference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// GPU with dedicated memory.
    Discrete,
    /// GPU in a virtual machine, or a part of one.
    Virtual,
    /// GPU that shares the host's memory.
    Integrated,
    /// The host itself, without Vulkan: kernels are functions on host memory.
    Host,
    /// Vulkan driver that runs on the host's processors, such as lavapipe.
    Cpu,
    /// Any other kind.
    Other,
}

impl std::fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            DeviceKind::Discrete => "discrete GPU",
            DeviceKind::Integrated => "integrated GPU",
            DeviceKind::Virtual => "virtual GPU",
            DeviceKind::Host => "host",
            DeviceKind::Cpu => "CPU",
            DeviceKind::Other => "other",
        })
    }
}

/// A device: of Vulkan as the loader lists it, or the host.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// Index in the list, accepted by [`super::GpuOptions::device`].
    pub index: usize,
    /// Name given by the driver.
    pub name: String,
    /// Device kind.
    pub kind: DeviceKind,
    /// Driver name and version as reported; of the host, vectors and threads.
    pub driver: String,
    /// Vulkan version of the device, "1.3.230"; empty for the host.
    pub api: String,
    /// UUID of the device, 32 hexadecimal digits, identical in all programs and in CUDA on this machine; empty for the host.
    #[serde(default)]
    pub uuid: String,
    /// Bytes of the largest device-local heap; of the host, bytes that are available.
    pub memory: u64,
}

/// Validation messages, shared with the callback that collects them.
pub(super) type Messages = Arc<Mutex<Vec<String>>>;

pub(super) struct Instance {
    /// Keeps the loader library alive. `None` for an application's instance.
    entry: Option<ash::Entry>,
    pub raw: ash::Instance,
    pub debug_names: bool,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub messages: Messages,
}

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

impl Instance {
    /// Creates an instance, optionally with the validation layer. `instrumented`: GPU-assisted validation instead of
    /// synchronisation checks.
    ///
    /// # Errors
    /// Missing loader, layer or driver, or an old loader.
    pub fn new(validation: bool, instrumented: bool) -> Result<Instance> {
        let validation = validation || instrumented;
        // SAFETY: loading the system's Vulkan loader runs its initialisers.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| {
            Error::device(
                format!("no Vulkan loader on this machine ({e})"),
                "install it and a driver: on Debian `apt-get install libvulkan1 mesa-vulkan-drivers` (or the vendor's driver)",
            )
        })?;
        // SAFETY: the entry is alive, also for the calls through it below.
        let version =
            unsafe { entry.try_enumerate_instance_version() }.ok().flatten().unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_2 {
            return Err(Error::device(
                format!("the Vulkan loader has version {}, 1.2 is required", version_text(version)),
                "update libvulkan1",
            ));
        }
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
        let offers = |name| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let debug_names = offers(ext::debug_utils::NAME);
        // Without it the loader hides layered implementations such as MoltenVK.
        let with_subsets = offers(khr::portability_enumeration::NAME);
        let mut layers = Vec::new();
        if validation {
            let known = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
            if !known.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) || !debug_names {
                return Err(Error::device(
                    "validation was requested, but the Vulkan validation layer is not installed",
                    "on Debian `apt-get install vulkan-validationlayers`, or run without validation",
                ));
            }
            layers.push(VALIDATION_LAYER.as_ptr());
        }
        let names =
            [(debug_names, ext::debug_utils::NAME), (with_subsets, khr::portability_enumeration::NAME)];
        let names: Vec<_> = names.iter().filter(|n| n.0).map(|n| n.1.as_ptr()).collect();
        let application = vk::ApplicationInfo::default()
            .application_name(c"thirdbounce")
            .engine_name(c"thirdbounce")
            .api_version(vk::API_VERSION_1_2);
        let enabled = if instrumented {
            vk::ValidationFeatureEnableEXT::GPU_ASSISTED
        } else {
            vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION
        };
        let enabled = [enabled];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&names);
        if with_subsets {
            info = info.flags(vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
        }
        if validation {
            info = info.push_next(&mut features);
        }
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|e| {
            Error::device(
                format!("no Vulkan instance can be created ({e})"),
                "a driver is missing or broken: on Debian `apt-get install mesa-vulkan-drivers`, or check VK_ICD_FILENAMES",
            )
        })?;
        let messages: Messages = Arc::default();
        let messenger = if validation {
            let loader = ext::debug_utils::Instance::new(&entry, &raw);
            let create = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                        | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                .message_type(
                    vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                        | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
                )
                .pfn_user_callback(Some(collect))
                .user_data(Arc::as_ptr(&messages) as *mut c_void);
            // SAFETY: the user data is owned by `messages`, which outlives the messenger.
            let handle = unsafe { loader.create_debug_utils_messenger(&create, None) }.ok();
            handle.map(|h| (loader, h))
        } else {
            None
        };
        Ok(Instance { entry: Some(entry), raw, debug_names, messenger, messages })
    }

    /// An application's instance, not destroyed on drop. `debug_names`: created with VK_EXT_debug_utils.
    pub fn of_external(raw: ash::Instance, debug_names: bool) -> Instance {
        Instance { entry: None, raw, debug_names, messenger: None, messages: Arc::default() }
    }

    /// Physical devices with their descriptions, in the loader's order.
    pub fn list(&self) -> Vec<(vk::PhysicalDevice, DeviceInfo)> {
        // SAFETY: the instance is alive.
        let all = unsafe { self.raw.enumerate_physical_devices() }.unwrap_or_default();
        all.into_iter().enumerate().map(|(index, p)| (p, self.describe(index, p))).collect()
    }

    /// Describes the device at `index` in the loader's list.
    pub fn describe(&self, index: usize, physical: vk::PhysicalDevice) -> DeviceInfo {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut id = vk::PhysicalDeviceIDProperties::default();
        let mut properties =
            vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut id);
        // SAFETY: the handle comes from this instance; the chain holds structs of Vulkan 1.2.
        unsafe { self.raw.get_physical_device_properties2(physical, &mut properties) };
        let p = properties.properties;
        let memory = unsafe { self.raw.get_physical_device_memory_properties(physical) };
        let heap = memory.memory_heaps_as_slice().iter();
        let largest =
            heap.filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL)).map(|h| h.size).max();
        let text = |c: std::result::Result<&CStr, _>| {
            c.map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
        };
        DeviceInfo {
            index,
            name: text(p.device_name_as_c_str()),
            kind: match p.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
                vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
                vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
                vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
                _ => DeviceKind::Other,
            },
            driver: format!(
                "{} {}",
                text(driver.driver_name_as_c_str()),
                text(driver.driver_info_as_c_str())
            ),
            api: version_text(p.api_version),
            uuid: id.device_uuid.iter().map(|byte| format!("{byte:02x}")).collect(),
            memory: largest.unwrap_or(0),
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.entry.is_none() {
            return;
        }
        // SAFETY: the device, a child of this instance, is dropped before it (field order in `Gpu`).
        unsafe {
            if let Some((loader, handle)) = &self.messenger {
                loader.destroy_debug_utils_messenger(*handle, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

pub(super) fn version_text(v: u32) -> String {
    format!("{}.{}.{}", vk::api_version_major(v), vk::api_version_minor(v), vk::api_version_patch(v))
}

unsafe extern "system" fn collect(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid record, and the pointer given at creation is to a live Mutex.
    let (text, messages) = unsafe {
        let text = (*data).message_as_c_str().map(|m| m.to_string_lossy().into_owned()).unwrap_or_default();
        (text, &*(messages as *const Mutex<Vec<String>>))
    };
    messages.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    vk::FALSE
}
