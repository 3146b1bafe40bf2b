//! The host as a device: kernels are functions on host memory (`thirdbounce-kernels`), and a schedule is a list of calls.

use super::instance::{DeviceInfo, DeviceKind, Instance};
use super::limits::Limits;
use super::options::{GpuOptions, is_called};

/// Limits for planning. Functions have no workgroups, shared memory or watchdog: these bound sizes of schedules only.
pub(super) const LIMITS: Limits = Limits {
    storage_range: 1 << 46,
    workgroup_invocations: 1024,
    shared_memory: 32 << 10,
    groups: [u32::MAX; 3],
    subgroup: 1,
    work: u64::MAX,
};

/// The host at an index of [`super::devices`].
pub(super) fn info(index: usize) -> DeviceInfo {
    let threads = rayon::current_num_threads();
    let threads = if threads == 1 { "1 thread".into() } else { format!("{threads} threads") };
    DeviceInfo {
        index,
        name: format!("host ({})", processor()),
        kind: DeviceKind::Host,
        driver: format!("{}, {threads}", thirdbounce_kernels::vectors()),
        api: String::new(),
        uuid: String::new(),
        memory: thirdbounce_base::host::available(),
    }
}

/// The processor's name as the system reports it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| std::env::consts::ARCH.to_string(), |(_, name)| name.trim().to_string())
}

/// Whether the host is the device that `options` ask for, if it has this index.
pub(super) fn is_chosen(options: &GpuOptions, index: usize) -> bool {
    let text = options.device.as_deref().unwrap_or("auto");
    text == "auto"
        || text.parse::<usize>().map_or_else(|_| is_called(&info(index), text), |wanted| wanted == index)
}

/// All devices of this machine: those of Vulkan, if there is a loader, and the host.
pub fn devices() -> Vec<DeviceInfo> {
    let of_vulkan = Instance::new(false, false).map_or_else(|_| vec![], |instance| instance.list());
    let mut all: Vec<_> = of_vulkan.into_iter().map(|(_, info)| info).collect();
    all.push(info(all.len()));
    all
}
