//! Driver reports on compiled kernels (VK_KHR_pipeline_executable_properties).

use std::ffi::CStr;

use ash::{khr, vk};

use super::code::KernelCode;
use super::device::Gpu;
use super::names::{Constant, Kernel};
use super::pipelines::Pipeline;
use crate::Result;

/// A kernel compiled by the driver.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Compiled {
    /// Compilation time, seconds; 0 on the host. Drivers may defer compilation to the first dispatch, or find the kernel in a
    /// cache.
    pub seconds: f64,
    /// Executables; empty without driver support.
    pub executables: Vec<Executable>,
}

/// An executable of a kernel. Some drivers create several, for different subgroup sizes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Executable {
    /// Name given by the driver.
    pub name: String,
    /// Invocations per subgroup; 0 if unknown.
    pub subgroup: u32,
    /// Registers, shared memory, spills etc. under the driver's names.
    pub statistics: Vec<(String, f64)>,
    /// Listings under the driver's names, from intermediate code to machine code; empty unless the device was opened
    /// with [`super::GpuOptions::listings`].
    pub listings: Vec<(String, String)>,
}

#[doc(hidden)]
impl Gpu {
    /// Compiles `kernel` from `code` with these specialization constants and discards it. Needs no buffers.
    ///
    /// # Errors
    /// The driver rejects the kernel.
    pub fn compile(
        &self,
        kernel: impl Into<Kernel>,
        code: &KernelCode,
        constants: &[(Constant, u32)],
    ) -> Result<Compiled> {
        if self.is_host() {
            return Ok(Compiled::default());
        }
        let start = std::time::Instant::now();
        let made = Pipeline::new(self, kernel.into().name(), code, constants)?;
        let seconds = start.elapsed().as_secs_f64();
        let executables = self.executables(made.handle);
        Ok(Compiled { seconds, executables })
    }

    /// Whether statistics of compiled kernels are supported and were requested.
    pub fn reports_kernels(&self) -> bool {
        !self.is_host() && self.vulkan().statistics.is_some()
    }

    /// Executables of a pipeline; empty if not supported or not requested.
    pub(super) fn executables(&self, pipeline: vk::Pipeline) -> Vec<Executable> {
        let Some(asked) = &self.vulkan().statistics else { return vec![] };
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        // SAFETY: the pipeline is alive and was created with CAPTURE_STATISTICS, as the extension is enabled.
        let all = unsafe { asked.get_pipeline_executable_properties(&info) }.unwrap_or_default();
        let executable = |(index, properties): (u32, &vk::PipelineExecutablePropertiesKHR<'_>)| {
            let of = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index);
            Executable {
                name: text(&properties.name),
                subgroup: properties.subgroup_size,
                statistics: statistics(asked, &of),
                listings: if self.vulkan().has_listings { listings(asked, &of) } else { vec![] },
            }
        };
        (0..).zip(&all).map(executable).collect()
    }
}

/// A text of fixed length, up to its zero.
fn text(chars: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = chars.iter().map(|c| *c as u8).take_while(|b| *b != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

fn statistics(
    asked: &khr::pipeline_executable_properties::Device,
    of: &vk::PipelineExecutableInfoKHR<'_>,
) -> Vec<(String, f64)> {
    // SAFETY: the caller's pipeline is alive, and has an executable of that index.
    let found = unsafe { asked.get_pipeline_executable_statistics(of) }.unwrap_or_default();
    let named = |s: &vk::PipelineExecutableStatisticKHR<'_>| {
        type Format = vk::PipelineExecutableStatisticFormatKHR;
        // SAFETY: `format` says which member of the union the driver wrote.
        let value = unsafe {
            match s.format {
                Format::BOOL32 => f64::from(s.value.b32),
                Format::INT64 => s.value.i64 as f64,
                Format::UINT64 => s.value.u64 as f64,
                _ => s.value.f64,
            }
        };
        (text(&s.name), value)
    };
    found.iter().map(named).collect()
}

fn listings(
    asked: &khr::pipeline_executable_properties::Device,
    of: &vk::PipelineExecutableInfoKHR<'_>,
) -> Vec<(String, String)> {
    // SAFETY: the caller's pipeline is alive, has an executable of that index, and was made with
    // CAPTURE_INTERNAL_REPRESENTATIONS.
    let found = unsafe { asked.get_pipeline_executable_internal_representations(of) };
    // The first call returns the sizes only.
    let mut found = found.unwrap_or_default();
    let mut room: Vec<Vec<u8>> = found.iter().map(|t| vec![0; t.data_size]).collect();
    for (t, bytes) in found.iter_mut().zip(&mut room) {
        t.p_data = bytes.as_mut_ptr().cast();
    }
    let mut count = found.len() as u32;
    // SAFETY: as above; `found` has `count` items, and each points to as many bytes as it says, which outlive the call.
    let filled = unsafe {
        (asked.fp().get_pipeline_executable_internal_representations_khr)(
            asked.device(),
            of,
            &mut count,
            found.as_mut_ptr(),
        )
    };
    if filled != vk::Result::SUCCESS {
        return vec![];
    }
    let listing = |(t, bytes): (&vk::PipelineExecutableInternalRepresentationKHR<'_>, &Vec<u8>)| {
        let whole = CStr::from_bytes_until_nul(bytes).map_or(&bytes[..], CStr::to_bytes);
        (t.is_text == vk::TRUE).then(|| (text(&t.name), String::from_utf8_lossy(whole).into_owned()))
    };
    found.iter().zip(&room).filter_map(listing).collect()
}
