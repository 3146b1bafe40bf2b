//! Pipelines of compiled kernels, and their descriptor sets.

use std::collections::HashMap;
use std::sync::Arc;

use ash::vk;

use super::code::{Binding, KernelCode, View};
use super::device::Gpu;
use super::faults::Point;
use super::limits::MOST_STORAGE;
use super::memory::DeviceArena;
use super::names::{Buffer, Constant};
use super::pipelines::Pipeline;
use super::rounding::to_nearest;
use super::schedule::{Binds, PUSH_WORDS};
use crate::{Error, Result};

/// Bytes of push constants, the same for every kernel.
pub(super) const PUSH_BYTES: u32 = 4 * PUSH_WORDS as u32;

/// The layout of a binding.
fn slot(b: &Binding) -> vk::DescriptorSetLayoutBinding<'static> {
    vk::DescriptorSetLayoutBinding::default()
        .binding(b.slot)
        .descriptor_type(descriptor_type(b))
        .descriptor_count(1)
        .stage_flags(vk::ShaderStageFlags::COMPUTE)
}

/// Specialization constants in Vulkan's form.
///
/// # Panics
/// The kernel has no constant of that name.
fn specialization(
    code: &KernelCode,
    constants: &[(Constant, u32)],
) -> (Vec<vk::SpecializationMapEntry>, Vec<u8>) {
    // Every named constant must exist: a misspelt one would silently keep its default.
    let mut entries = Vec::new();
    let mut data = Vec::new();
    for (constant, value) in constants {
        let known = code.constants.iter().find(|c| c.0 == *constant);
        let known = known.unwrap_or_else(|| panic!("kernel `{}` has no constant {constant}", code.name));
        entries.push(
            vk::SpecializationMapEntry::default().constant_id(known.1).offset(data.len() as u32).size(4),
        );
        data.extend_from_slice(&value.to_le_bytes());
    }
    (entries, data)
}

impl Pipeline {
    /// The pipeline of a kernel on this device, existing or new.
    ///
    /// # Errors
    /// The device fails.
    pub fn of(
        gpu: &Gpu,
        name: &'static str,
        code: &KernelCode,
        constants: &[(Constant, u32)],
    ) -> Result<Arc<Pipeline>> {
        let key = (name, code.spirv.as_ptr() as usize, constants.to_vec());
        gpu.vulkan().pipelines.get(key, || Pipeline::new(gpu, name, code, constants))
    }

    pub fn new(
        gpu: &Gpu,
        name: &'static str,
        code: &KernelCode,
        constants: &[(Constant, u32)],
    ) -> Result<Pipeline> {
        let device = gpu.raw();
        let doing = format!("creating kernel `{name}`");
        let failed = |e| gpu.failed(&doing, e);
        let slots: Vec<_> = code.bindings.iter().map(slot).collect();
        let (entries, data) = specialization(code, constants);
        let mut words = ash::util::read_spv(&mut std::io::Cursor::new(code.spirv)).map_err(|e| {
            Error::device(format!("kernel `{name}` is not SPIR-V ({e})"), "rebuild the program")
        })?;
        if gpu.vulkan().has_rounding {
            words = to_nearest(&words);
        }

        let mut made = Pipeline {
            name,
            handle: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            module: vk::ShaderModule::null(),
            bindings: code.bindings,
            device: gpu.vulkan().device.clone(),
        };
        // SAFETY: all structs outlive their call; on an error created objects are destroyed with `made`.
        let result = unsafe {
            (|| {
                gpu.before_call(Point::Object)?;
                let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&slots);
                made.set_layout = device.create_descriptor_set_layout(&info, None)?;
                let push = [vk::PushConstantRange::default()
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
                    .size(PUSH_BYTES)];
                let layouts = [made.set_layout];
                let info =
                    vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts).push_constant_ranges(&push);
                made.layout = device.create_pipeline_layout(&info, None)?;
                gpu.before_call(Point::Object)?;
                made.module =
                    device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)?;
                let special = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
                let stage = vk::PipelineShaderStageCreateInfo::default()
                    .stage(vk::ShaderStageFlags::COMPUTE)
                    .module(made.module)
                    .name(c"main")
                    .specialization_info(&special);
                // Long dispatches are divided.
                let mut flags = vk::PipelineCreateFlags::DISPATCH_BASE;
                if gpu.vulkan().statistics.is_some() {
                    flags |= vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR;
                }
                if gpu.vulkan().has_listings {
                    flags |= vk::PipelineCreateFlags::CAPTURE_INTERNAL_REPRESENTATIONS_KHR;
                }
                let info =
                    [vk::ComputePipelineCreateInfo::default().stage(stage).layout(made.layout).flags(flags)];
                gpu.before_call(Point::Object)?;
                let made_pipelines = device.create_compute_pipelines(gpu.vulkan().cache.handle, &info, None);
                made.handle = made_pipelines.map_err(|(_, e)| e)?[0];
                Ok(())
            })()
        };
        result.map_err(failed)?;
        gpu.name(made.handle, name);
        gpu.name(made.layout, name);
        gpu.name(made.set_layout, name);
        gpu.name(made.module, code.name);
        Ok(made)
    }
}

/// Descriptor sets by kernel and buffers, created on first use.
pub(super) struct DescriptorSets {
    pools: Vec<vk::DescriptorPool>,
    made: HashMap<Bound, vk::DescriptorSet>,
    /// Lookup key, kept so that lookups do not allocate.
    wanted: Bound,
}

/// A pipeline, and the buffers bound to its blocks.
type Bound = (vk::Pipeline, Vec<vk::Buffer>);

const SETS_PER_POOL: u32 = 64;

impl DescriptorSets {
    pub fn new() -> DescriptorSets {
        DescriptorSets { pools: vec![], made: HashMap::new(), wanted: Bound::default() }
    }

    pub fn get(
        &mut self,
        gpu: &Gpu,
        arena: &DeviceArena,
        pipeline: &Pipeline,
        bind: &Binds,
    ) -> Result<vk::DescriptorSet> {
        let named = |b: &Binding| bind.buffer_of(b.block);
        self.wanted.0 = pipeline.handle;
        self.wanted.1.clear();
        self.wanted.1.extend(pipeline.bindings.iter().map(|b| arena.get(named(b)).handle));
        if let Some(set) = self.made.get(&self.wanted) {
            return Ok(*set);
        }
        let buffers: &[Buffer] = &pipeline.bindings.iter().map(named).collect::<Vec<_>>();
        let key = self.wanted.clone();
        let failed = |e| gpu.failed("binding buffers", e);
        let device = gpu.raw();
        if self.made.len().is_multiple_of(SETS_PER_POOL as usize) {
            let size = |ty, n| vk::DescriptorPoolSize::default().ty(ty).descriptor_count(n);
            let sizes = [
                size(vk::DescriptorType::STORAGE_BUFFER, SETS_PER_POOL * MOST_STORAGE),
                // The scene, and the block of a solver.
                size(vk::DescriptorType::UNIFORM_BUFFER, SETS_PER_POOL * 2),
            ];
            let info = vk::DescriptorPoolCreateInfo::default().max_sets(SETS_PER_POOL).pool_sizes(&sizes);
            // SAFETY: the device is alive; pools are destroyed with the executor.
            gpu.before_call(Point::Object).map_err(failed)?;
            self.pools.push(unsafe { device.create_descriptor_pool(&info, None) }.map_err(failed)?);
            gpu.name(self.pools[self.pools.len() - 1], "descriptor pool");
        }
        gpu.before_call(Point::Object).map_err(failed)?;
        let layouts = [pipeline.set_layout];
        let pool = *self.pools.last().expect("made above");
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: pool, layout and buffers are alive as long as the executor.
        let set = unsafe { device.allocate_descriptor_sets(&info) }.map_err(failed)?[0];
        gpu.name(set, &set_name(pipeline.name, buffers));
        let infos: Vec<_> = key
            .1
            .iter()
            .zip(pipeline.bindings.iter().zip(buffers))
            .map(|(handle, (b, buffer))| {
                // The canary is bound too, so that writes past the end reach it. Uniforms are read-only and have a
                // limited range.
                let range = if b.view == View::Uniform { arena.get(*buffer).bytes } else { vk::WHOLE_SIZE };
                [vk::DescriptorBufferInfo::default().buffer(*handle).range(range)]
            })
            .collect();
        let writes: Vec<_> = pipeline
            .bindings
            .iter()
            .zip(&infos)
            .map(|(b, info)| {
                vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(b.slot)
                    .descriptor_type(descriptor_type(b))
                    .buffer_info(info)
            })
            .collect();
        unsafe { device.update_descriptor_sets(&writes, &[]) };
        self.made.insert(key, set);
        Ok(set)
    }

    pub fn destroy(&mut self, gpu: &Gpu) {
        for pool in self.pools.drain(..) {
            // SAFETY: the executor waits for its work first.
            unsafe { gpu.raw().destroy_descriptor_pool(pool, None) };
        }
    }
}

fn set_name(kernel: &str, buffers: &[Buffer]) -> String {
    let names: Vec<_> = buffers.iter().map(Buffer::to_string).collect();
    format!("{kernel} of {}", names.join(" "))
}

fn descriptor_type(b: &Binding) -> vk::DescriptorType {
    match b.view {
        View::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        View::Storage => vk::DescriptorType::STORAGE_BUFFER,
    }
}
