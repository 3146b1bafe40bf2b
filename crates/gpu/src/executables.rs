//! What a driver tells of the programs that it made of a kernel (VK_KHR_pipeline_executable_properties).

use std::ffi::CStr;

use ash::{khr, vk};

use super::code::KernelCode;
use super::device::Gpu;
use super::names::{Constant, Kernel};
use super::pipelines::Pipeline;
use crate::Result;

/// A kernel as the driver compiled it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Compiled {
    /// Seconds that it took. A driver may compile at the first dispatch instead, or have the kernel in a cache.
    pub seconds: f64,
    /// The programs that the driver made; empty if it tells nothing of them.
    pub executables: Vec<Executable>,
}

/// A program that a driver made of a kernel. Some drivers make several, for subgroups of several sizes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Executable {
    /// Its name in the driver's words.
    pub name: String,
    /// Invocations of a subgroup; 0 if the driver does not say.
    pub subgroup: u32,
    /// Registers, shared memory, spills and so on by the driver's own names.
    pub statistics: Vec<(String, f64)>,
    /// Listings by the driver's own names, from its intermediate code to machine code; empty unless the device was
    /// opened with [`super::GpuOptions::listings`].
    pub listings: Vec<(String, String)>,
}

#[doc(hidden)]
impl Gpu {
    /// Compiles `kernel` from `code` with these specialization constants, and drops it again. Needs no buffers.
    ///
    /// # Errors
    /// The driver refuses the kernel.
    pub fn compile(
        &self,
        kernel: impl Into<Kernel>,
        code: &KernelCode,
        constants: &[(Constant, u32)],
    ) -> Result<Compiled> {
        let start = std::time::Instant::now();
        let made = Pipeline::new(self, kernel.into().name(), code, constants)?;
        let seconds = start.elapsed().as_secs_f64();
        let executables = self.executables(made.handle);
        Ok(Compiled { seconds, executables })
    }

    /// Whether the driver tells of compiled kernels, and was asked to.
    pub fn tells_of_kernels(&self) -> bool {
        self.statistics.is_some()
    }

    /// The programs of a pipeline; empty if the driver tells nothing of them or was not asked.
    pub(super) fn executables(&self, pipeline: vk::Pipeline) -> Vec<Executable> {
        let Some(asked) = &self.statistics else { return vec![] };
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        // SAFETY: the pipeline is alive and was made with CAPTURE_STATISTICS, as the extension is on.
        let all = unsafe { asked.get_pipeline_executable_properties(&info) }.unwrap_or_default();
        let executable = |(index, properties): (u32, &vk::PipelineExecutablePropertiesKHR<'_>)| {
            let of = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index);
            Executable {
                name: text(&properties.name),
                subgroup: properties.subgroup_size,
                statistics: statistics(asked, &of),
                listings: if self.has_listings { listings(asked, &of) } else { vec![] },
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
    let told = unsafe { asked.get_pipeline_executable_statistics(of) }.unwrap_or_default();
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
    told.iter().map(named).collect()
}

fn listings(
    asked: &khr::pipeline_executable_properties::Device,
    of: &vk::PipelineExecutableInfoKHR<'_>,
) -> Vec<(String, String)> {
    // SAFETY: the caller's pipeline is alive, has an executable of that index, and was made with
    // CAPTURE_INTERNAL_REPRESENTATIONS.
    let told = unsafe { asked.get_pipeline_executable_internal_representations(of) };
    // The first call gives the sizes alone.
    let mut told = told.unwrap_or_default();
    let mut room: Vec<Vec<u8>> = told.iter().map(|t| vec![0; t.data_size]).collect();
    for (t, bytes) in told.iter_mut().zip(&mut room) {
        t.p_data = bytes.as_mut_ptr().cast();
    }
    let mut count = told.len() as u32;
    // SAFETY: as above; `told` has `count` items, and each points to as many bytes as it says, which outlive the call.
    let filled = unsafe {
        (asked.fp().get_pipeline_executable_internal_representations_khr)(
            asked.device(),
            of,
            &mut count,
            told.as_mut_ptr(),
        )
    };
    if filled != vk::Result::SUCCESS {
        return vec![];
    }
    let listing = |(t, bytes): (&vk::PipelineExecutableInternalRepresentationKHR<'_>, &Vec<u8>)| {
        let whole = CStr::from_bytes_until_nul(bytes).map_or(&bytes[..], CStr::to_bytes);
        (t.is_text == vk::TRUE).then(|| (text(&t.name), String::from_utf8_lossy(whole).into_owned()))
    };
    told.iter().zip(&room).filter_map(listing).collect()
}
