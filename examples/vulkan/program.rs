//! What a program has that computes on a Vulkan device of its own: nothing here knows of thirdbounce, but for what it asks a
//! device to have.

use ash::vk;
use thirdbounce::{Requirements, requirements};

pub const VERSION: u32 = vk::API_VERSION_1_2;

/// The program's Vulkan.
pub struct Program {
    pub entry: ash::Entry,
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub queue: vk::Queue,
    pub requirements: Requirements,
    commands: vk::CommandBuffer,
}

/// A buffer. `at`: its memory, if the host sees it.
pub struct Buffer {
    pub handle: vk::Buffer,
    pub bytes: u64,
    pub at: *const u8,
}

/// A semaphore with a value to wait for, or to signal.
pub type TimelinePoint = (vk::Semaphore, u64);

impl Program {
    /// # Safety
    /// None beyond Vulkan's: the program never destroys what it makes, as it ends with its first picture.
    pub unsafe fn new() -> Result<Program, Box<dyn std::error::Error>> {
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(VERSION);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None)?;
            let physical = *instance.enumerate_physical_devices()?.first().ok_or("no Vulkan device")?;
            let load = entry.static_fn().get_instance_proc_addr;
            let requirements = requirements(load, instance.handle(), VERSION, physical)?;

            // The program would enable what it needs itself, too.
            let wanted = requirements.features;
            let mut v12 = vk::PhysicalDeviceVulkan12Features::default()
                .timeline_semaphore(wanted.timeline_semaphore)
                .shader_buffer_int64_atomics(wanted.int64_atomics);
            let mut atomics = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default()
                .shader_buffer_float32_atomic_add(wanted.float_atomics);
            let features = vk::PhysicalDeviceFeatures::default().shader_int64(wanted.int64_atomics);
            let extensions: Vec<_> = requirements.extensions().iter().map(|name| name.as_ptr()).collect();
            let family = requirements.family;
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let mut info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .enabled_features(&features)
                .push_next(&mut v12);
            if wanted.float_atomics {
                info = info.push_next(&mut atomics);
            }
            let device = instance.create_device(physical, &info, None)?;
            let queue = device.get_device_queue(family, 0);
            let flags = vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER;
            let info = vk::CommandPoolCreateInfo::default().queue_family_index(family).flags(flags);
            let pool = device.create_command_pool(&info, None)?;
            let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let commands = device.allocate_command_buffers(&info)?[0];
            Ok(Program { entry, instance, physical, device, queue, requirements, commands })
        }
    }

    /// A buffer for passes and copies, on the device or where the host sees it.
    pub unsafe fn buffer(&self, bytes: u64, for_host: bool) -> Result<Buffer, vk::Result> {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        let seen = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let wanted = if for_host { seen } else { vk::MemoryPropertyFlags::DEVICE_LOCAL };
        unsafe {
            let handle = self.device.create_buffer(&info, None)?;
            let needs = self.device.get_buffer_memory_requirements(handle);
            let types = self.instance.get_physical_device_memory_properties(self.physical);
            let fits = |i: &u32| {
                let flags = types.memory_types[*i as usize].property_flags;
                needs.memory_type_bits >> i & 1 == 1 && flags.contains(wanted)
            };
            let kind =
                (0..types.memory_type_count).find(fits).ok_or(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY)?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
            let memory = self.device.allocate_memory(&info, None)?;
            self.device.bind_buffer_memory(handle, memory, 0)?;
            let at = match for_host {
                true => self
                    .device
                    .map_memory(memory, 0, needs.size, vk::MemoryMapFlags::empty())?
                    .cast_const()
                    .cast(),
                false => std::ptr::null(),
            };
            Ok(Buffer { handle, bytes, at })
        }
    }

    /// A timeline semaphore at 0.
    pub unsafe fn semaphore(&self) -> Result<vk::Semaphore, vk::Result> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        unsafe {
            self.device.create_semaphore(&vk::SemaphoreCreateInfo::default().push_next(&mut kind), None)
        }
    }

    /// Submits a pass of `invocations` over buffers, with specialization constants; it brings `done` about.
    pub unsafe fn run(
        &self,
        spirv: &[u8],
        constants: &[u32],
        buffers: &[&Buffer],
        invocations: usize,
        done: TimelinePoint,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let device = &self.device;
        unsafe {
            let binding = |i: usize| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(i as u32)
                    .descriptor_count(1)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            };
            let bindings: Vec<_> = (0..buffers.len()).map(binding).collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            let layouts = [device.create_descriptor_set_layout(&info, None)?];
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
            let layout = device.create_pipeline_layout(&info, None)?;
            let words = ash::util::read_spv(&mut std::io::Cursor::new(spirv))?;
            let module =
                device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)?;
            let entries: Vec<_> = (0..constants.len() as u32)
                .map(|i| vk::SpecializationMapEntry { constant_id: i, offset: 4 * i, size: 4 })
                .collect();
            let data: Vec<u8> = constants.iter().flat_map(|c| c.to_ne_bytes()).collect();
            let values = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main")
                .specialization_info(&values);
            let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
            let pipeline = device
                .create_compute_pipelines(vk::PipelineCache::null(), &info, None)
                .map_err(|(_, e)| e)?[0];

            let sizes = [vk::DescriptorPoolSize {
                ty: vk::DescriptorType::STORAGE_BUFFER,
                descriptor_count: buffers.len() as u32,
            }];
            let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
            let pool = device.create_descriptor_pool(&info, None)?;
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
            let set = device.allocate_descriptor_sets(&info)?[0];
            for (i, buffer) in buffers.iter().enumerate() {
                let whole =
                    [vk::DescriptorBufferInfo { buffer: buffer.handle, offset: 0, range: vk::WHOLE_SIZE }];
                let write = vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(i as u32)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .buffer_info(&whole);
                device.update_descriptor_sets(&[write], &[]);
            }

            device.begin_command_buffer(self.commands, &vk::CommandBufferBeginInfo::default())?;
            device.cmd_bind_pipeline(self.commands, vk::PipelineBindPoint::COMPUTE, pipeline);
            device.cmd_bind_descriptor_sets(
                self.commands,
                vk::PipelineBindPoint::COMPUTE,
                layout,
                0,
                &[set],
                &[],
            );
            device.cmd_dispatch(self.commands, invocations.div_ceil(64) as u32, 1, 1);
            device.end_command_buffer(self.commands)?;
            let (semaphores, values, commands) = ([done.0], [done.1], [self.commands]);
            let mut timeline = vk::TimelineSemaphoreSubmitInfo::default().signal_semaphore_values(&values);
            let info = vk::SubmitInfo::default()
                .command_buffers(&commands)
                .signal_semaphores(&semaphores)
                .push_next(&mut timeline);
            device.queue_submit(self.queue, &[info], vk::Fence::null())?;
        }
        Ok(())
    }

    /// Waits for a moment.
    pub unsafe fn wait(&self, (semaphore, value): TimelinePoint) -> Result<(), vk::Result> {
        let (semaphores, values) = ([semaphore], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        unsafe { self.device.wait_semaphores(&info, u64::MAX) }
    }
}
