//! Pipelines shared by the executors of a device.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;

use super::code::Binding;
use super::names::Constant;
use super::owned::OwnedDevice;
use crate::Result;

/// A pipeline of a kernel.
pub(super) struct Pipeline {
    pub name: &'static str,
    pub handle: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    pub set_layout: vk::DescriptorSetLayout,
    pub module: vk::ShaderModule,
    pub bindings: &'static [Binding],
    pub device: Arc<OwnedDevice>,
}

/// Number of pipelines from which unused ones are evicted. A solve has about 40.
const KEPT: usize = 512;

/// The pipelines of a device, shared by executors with the same kernels.
#[derive(Default)]
pub(super) struct Pipelines(Mutex<HashMap<Key, Arc<Pipeline>>>);

/// Name, module (by address) and specialization constants.
pub(super) type Key = (&'static str, usize, Vec<(Constant, u32)>);

impl Pipelines {
    /// The pipeline with this key, created by `make` if absent.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn get(&self, key: Key, make: impl FnOnce() -> Result<Pipeline>) -> Result<Arc<Pipeline>> {
        let all = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(made) = all().get(&key) {
            return Ok(made.clone());
        }
        // Pipelines are created concurrently: the lock is not held.
        let made = Arc::new(make()?);
        let mut all = all();
        if all.len() >= KEPT {
            all.retain(|_, pipeline| Arc::strong_count(pipeline) > 1);
        }
        Ok(all.entry(key).or_insert(made).clone())
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // A hung device may still use it.
        if self.device.has_hung() {
            return;
        }
        let device = &self.device.raw;
        // SAFETY: the executors that used it waited for their work; null handles are allowed.
        unsafe {
            device.destroy_pipeline(self.handle, None);
            device.destroy_shader_module(self.module, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
