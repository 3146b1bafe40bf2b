//! Parallel creation of an executor's kernels.

use std::sync::Arc;

use rayon::prelude::*;

use super::code::KernelCode;
use super::executor::DeviceExecutor;
use super::names::{Constant, Kernel};
use super::pipelines::Pipeline;
use super::recording::KernelMade;
use crate::Result;

/// A kernel to create.
#[derive(Debug, Clone)]
pub struct KernelRequest<'c> {
    /// Name in schedules.
    pub kernel: Kernel,
    /// Module.
    pub code: &'c KernelCode,
    /// Specialization constants with their values.
    pub constants: Vec<(Constant, u32)>,
}

impl DeviceExecutor {
    /// Creates kernels concurrently, replacing kernels of the same names.
    ///
    /// # Errors
    /// The device fails.
    pub fn add_kernels(&mut self, wanted: &[KernelRequest<'_>]) -> Result<()> {
        let gpu = self.gpu.clone();
        let _span = gpu.span("make kernels");
        let make = |w: &KernelRequest<'_>| Pipeline::of(&gpu, w.kernel.name(), w.code, &w.constants);
        let made: Vec<Result<Arc<Pipeline>>> = wanted.par_iter().map(make).collect();
        let mut all = Ok(());
        for (wanted, made) in wanted.iter().zip(made) {
            match made {
                Ok(made) => self.keep_kernel(wanted, made),
                Err(e) => all = all.and(Err(e)),
            }
        }
        all
    }

    /// Whether a kernel of this name exists.
    pub fn has_kernel(&self, kernel: Kernel) -> bool {
        self.pipelines.contains_key(&kernel)
    }

    fn keep_kernel(&mut self, wanted: &KernelRequest<'_>, made: Arc<Pipeline>) {
        if let Some(recorder) = &self.gpu.recorder {
            let constants = wanted.constants.iter().map(|(n, v)| (n.to_string(), *v)).collect();
            let executables = self.gpu.executables(made.handle);
            let statistics = executables.into_iter().flat_map(|e| e.statistics).collect();
            recorder.made(wanted.kernel.name(), KernelMade { code: *wanted.code, constants, statistics });
        }
        self.pipelines.insert(wanted.kernel, made);
    }
}
