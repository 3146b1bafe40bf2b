//! Devices, which stay open between calls: kernels are compiled once.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use engine::Result;
use engine::gpu::{self, Gpu, GpuOptions};
use engine::job::usual_pipeline_cache;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Open devices by the names that were asked for.
static OPEN: Mutex<BTreeMap<Option<String>, Gpu>> = Mutex::new(BTreeMap::new());

fn open_devices() -> MutexGuard<'static, BTreeMap<Option<String>, Gpu>> {
    OPEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The device, opened if it is not.
pub fn open(name: &Option<String>) -> Result<Gpu> {
    if let Some(gpu) = open_devices().get(name) {
        return Ok(gpu.clone());
    }
    let options =
        GpuOptions { device: name.clone(), pipeline_cache: usual_pipeline_cache(), ..GpuOptions::default() };
    let gpu = Gpu::open(&options)?;
    open_devices().insert(name.clone(), gpu.clone());
    Ok(gpu)
}

/// Opens the device anew at the next call: it failed.
pub fn forget(name: &Option<String>) {
    let gone = open_devices().remove(name);
    drop(gone);
}

/// Closes every device that no session uses, and keeps their compiled kernels for later runs.
#[pyfunction]
pub fn close_devices(py: Python<'_>) {
    py.detach(|| {
        let all = std::mem::take(&mut *open_devices());
        drop(all);
    });
}

/// The devices of this machine: those of Vulkan, and the host.
#[pyfunction]
pub fn devices(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let all = py.detach(gpu::devices);
    let of = |info: gpu::DeviceInfo| {
        let made = PyDict::new(py);
        made.set_item("index", info.index)?;
        made.set_item("name", info.name.trim())?;
        made.set_item("kind", info.kind.to_string())?;
        made.set_item("memory", info.memory)?;
        made.set_item("driver", info.driver.trim())?;
        Ok(made)
    };
    all.into_iter().map(of).collect()
}
