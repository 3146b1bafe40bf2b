//! A solve that is prepared for a scan: planned, then compiled and allocated once. Captures of that scan are solved one
//! after the other; nothing is left from one to the next.

use std::sync::Arc;

use super::on_device::OnDevice;
use super::plan::Plan;
use super::result::Reconstruction;
use crate::Result;
use crate::capture::Capture;
use crate::engine::drive::Watch;
use crate::gpu::Gpu;
use crate::transport::Model;

/// A solver that is prepared for captures of one scan.
pub trait Prepared: Send {
    /// Levels, passes and buffers.
    fn plan(&self) -> &Arc<Plan>;

    /// Makes all kernels and buffers now. Without it, they are made for the first capture.
    ///
    /// # Errors
    /// Memory or device do not allow it.
    fn allocate(&mut self) -> Result<()>;

    /// Solves a capture. It must pass [`Capture::check`], and may differ from the one that this was prepared with in its
    /// counts only. After an error, the next capture is solved as if nothing had happened, if the device still works.
    ///
    /// # Errors
    /// See [`super::solver::Solver::solve`].
    fn solve(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Reconstruction>;
}

/// A planned solve, on the device from its first use on.
pub(crate) struct Planned {
    gpu: Gpu,
    plan: Arc<Plan>,
    memory: Option<u64>,
    /// The model without counts.
    outline: Model,
    made: Option<Box<OnDevice>>,
}

impl Planned {
    /// `outline` is a model without counts. `memory` is a budget in bytes.
    pub fn new(gpu: &Gpu, outline: Model, plan: Plan, memory: Option<u64>) -> Planned {
        Planned { gpu: gpu.clone(), plan: Arc::new(plan), memory, outline, made: None }
    }

    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// Frees its buffers; the next use allocates them again.
    pub fn release(&mut self) {
        self.made = None;
    }

    /// The solve on the device, where something may be under way.
    ///
    /// # Panics
    /// It is not on the device.
    pub fn in_use(&mut self) -> &mut OnDevice {
        self.made.as_mut().expect("it is on the device")
    }

    /// The solve on the device, where nothing is under way.
    ///
    /// # Errors
    /// As [`OnDevice::new`].
    pub fn made(&mut self) -> Result<&mut OnDevice> {
        let made = match self.made.take() {
            Some(made) => made,
            None => {
                let outline = self.outline.clone();
                Box::new(OnDevice::queued(&self.gpu, outline, self.plan.clone(), self.memory)?)
            }
        };
        let job = self.made.insert(made);
        // A solve that failed or was cancelled may have left work behind.
        job.executor.settle()?;
        Ok(job)
    }
}
