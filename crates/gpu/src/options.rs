//! Device selection and options.

use std::path::PathBuf;

use ash::vk;

use super::faults::Faults;
use super::instance::{DeviceInfo, DeviceKind, Instance};
use crate::advice::advice;
use crate::{Error, Result};

/// Options for opening a device.
#[derive(Debug, Clone, Default)]
pub struct GpuOptions {
    /// Index in [`super::devices`], part of a name (case-insensitive), or a UUID; `vulkan` for the best Vulkan device, also where
    /// that is a CPU driver; default (`auto`): a GPU, else the host.
    pub device: Option<String>,
    /// Enables the Khronos validation layer with synchronisation checks.
    pub validation: bool,
    /// Enables GPU-assisted validation (checks of every access inside kernels) instead of synchronisation checks.
    /// Slow. Requires kernels compiled without optimisation (`build.rs`).
    #[doc(hidden)]
    pub instrumented: bool,
    /// Enables bounds checks of buffers if supported (`robustBufferAccess`). Costs time.
    #[doc(hidden)]
    pub robust: bool,
    /// Times every command and records the timeline of host and device: [`super::Gpu::take_recording`].
    pub timings: bool,
    /// Requests driver statistics of compiled kernels: [`super::Gpu::compile`].
    #[doc(hidden)]
    pub statistics: bool,
    /// Requests listings as well. Some drivers then recompile every kernel regardless of caches.
    #[doc(hidden)]
    pub listings: bool,
    /// Maximum loop turns per dispatch and per submission, for drivers with a shorter watchdog timeout; default: by
    /// device kind, and submissions by measured speed.
    #[doc(hidden)]
    pub work: Option<u64>,
    /// Maximum bytes of a buffer bound by kernels, to plan as for a smaller device; default: the device's limit.
    #[doc(hidden)]
    pub binding: Option<u64>,
    /// Folder of the pipeline cache file, replaced when device or driver differ.
    pub pipeline_cache: Option<PathBuf>,
    /// Faults to inject, for tests.
    #[doc(hidden)]
    pub faults: Faults,
}

impl GpuOptions {
    /// The best Vulkan device, also where that is a CPU driver.
    pub fn vulkan() -> GpuOptions {
        GpuOptions { device: Some("vulkan".into()), ..GpuOptions::default() }
    }
}

impl GpuOptions {
    /// Whether they ask for something that only a Vulkan device has.
    pub(super) fn needs_vulkan(&self) -> bool {
        let GpuOptions { validation, instrumented, robust, statistics, listings, .. } = self;
        let faults = Faults { poison: None, ..self.faults };
        *validation || *instrumented || *robust || *statistics || *listings || faults.any()
    }
}

/// Whether a device has this UUID, with or without hyphens, or a name containing the text.
pub(super) fn is_called(device: &DeviceInfo, text: &str) -> bool {
    let text = text.to_lowercase();
    let is_uuid = !device.uuid.is_empty() && device.uuid == text.replace('-', "");
    is_uuid || device.name.to_lowercase().contains(&text)
}

/// The device selected by `wanted`, or one of the best kind.
pub(super) fn choose(
    all: &[(vk::PhysicalDevice, DeviceInfo)],
    wanted: Option<&str>,
) -> Result<(vk::PhysicalDevice, DeviceInfo)> {
    let is_vulkan = |d: &DeviceInfo| d.kind != DeviceKind::Host;
    let list = || all.iter().map(|(_, d)| format!("{}: {}", d.index, d.name)).collect::<Vec<_>>().join(", ");
    let found = match wanted {
        _ if all.is_empty() || wanted == Some("vulkan") && !all.iter().any(|(_, d)| is_vulkan(d)) => {
            return Err(Error::device(
                "no Vulkan device on this machine",
                "install a driver: on Debian `apt-get install mesa-vulkan-drivers` (lavapipe runs on any CPU), or the vendor's driver; the host itself needs none",
            ));
        }
        // The first minimum: the loader's order decides among devices of a kind.
        None | Some("auto") => all.iter().min_by_key(|(_, d)| d.kind),
        Some("vulkan") => all.iter().filter(|(_, d)| is_vulkan(d)).min_by_key(|(_, d)| d.kind),
        Some(text) => match text.parse::<usize>() {
            Ok(index) => all.get(index),
            Err(_) => all.iter().find(|(_, d)| is_called(d, text)),
        },
    };
    found.cloned().ok_or_else(|| {
        let name = wanted.unwrap_or_default();
        let several = if name.contains(',') {
            "; a solve uses one device, and a batch one device for each capture"
        } else {
            ""
        };
        Error::options(
            format!("no device is called {name:?}"),
            advice!["give " Device " an index, part of a name or a UUID out of: " (list()) (several)],
        )
    })
}

/// A compute queue family, preferably without graphics, and whether it has timestamps.
pub(super) fn compute_family(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    info: &DeviceInfo,
) -> Result<(u32, bool)> {
    // SAFETY: the handle comes from this instance.
    let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
    (0u32..)
        .zip(&families)
        .filter(|(_, f)| f.queue_flags.contains(vk::QueueFlags::COMPUTE) && f.queue_count > 0)
        .min_by_key(|(_, f)| f.queue_flags.contains(vk::QueueFlags::GRAPHICS))
        .map(|(i, f)| (i, f.timestamp_valid_bits > 0))
        .ok_or_else(|| {
            Error::device(
                format!("{} has no compute queue", info.name),
                advice!["choose another device with " Device],
            )
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fastest_kind_of_device_is_taken() {
        use DeviceKind::{Cpu, Discrete, Host, Integrated, Other, Virtual};
        let info = |index, kind| DeviceInfo {
            index,
            name: format!("{kind}"),
            kind,
            driver: String::new(),
            api: String::new(),
            uuid: String::new(),
            memory: 0,
        };
        let chosen = |kinds: &[DeviceKind], wanted| {
            let all: Vec<_> =
                kinds.iter().enumerate().map(|(i, k)| (vk::PhysicalDevice::null(), info(i, *k))).collect();
            choose(&all, wanted).map(|(_, info)| info.index)
        };
        let taken = |kinds: &[DeviceKind]| chosen(kinds, None).expect("a device");
        assert_eq!(taken(&[Other, Cpu, Integrated, Virtual, Discrete, Discrete]), 4);
        assert_eq!(taken(&[Other, Cpu, Integrated, Virtual]), 3, "a part of a card is faster than a chip");
        assert_eq!(taken(&[Other, Cpu, Integrated]), 2);
        assert_eq!(taken(&[Other, Cpu, Host]), 2, "no emulation of a GPU");
        assert_eq!(taken(&[Cpu, Integrated, Host]), 1);
        assert_eq!(taken(&[Other, Cpu]), 1);
        assert_eq!(chosen(&[Other, Cpu, Host], Some("vulkan")).expect("a device"), 1);
        let error = chosen(&[Host], Some("vulkan")).expect_err("no driver");
        assert!(error.what.contains("no Vulkan device"), "{error}");
    }
}
