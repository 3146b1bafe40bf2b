//! A solve that is prepared for a scan: planned, then compiled and allocated once. Captures of that scan are solved one
//! after the other; nothing is left from one to the next.

use std::sync::Arc;

use super::{Beside, OnDevice, Plan, Reconstruction, UPLOAD};
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::gpu::caller::{Lent, Moment};
use crate::transport::Model;
use crate::{Error, Result};

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
    /// See [`super::paper::reconstruct`].
    fn solve(&mut self, capture: &Capture, beside: Beside<'_, '_>) -> Result<Reconstruction>;

    /// Writes `content` into a lent buffer, and brings the moment `done` about when it is there.
    ///
    /// # Errors
    /// The device fails. Then `done` has not come.
    fn give(&mut self, _content: &[u8], _to: &Lent, _done: Option<Moment>) -> Result<()> {
        Err(Error::options("this method works on the host", "use the vector solver for lent buffers"))
    }
}

/// A planned solve, on the device from its first use on.
pub(super) struct Planned {
    gpu: Gpu,
    plan: Arc<Plan>,
    memory: Option<u64>,
    state: State,
}

enum State {
    /// The model without counts, until the device has it.
    Outline(Box<Model>),
    Made(Box<OnDevice>),
}

impl Planned {
    /// `outline` is a model without counts. `memory` is a budget in bytes.
    pub fn new(gpu: &Gpu, outline: Model, plan: Plan, memory: Option<u64>) -> Planned {
        Planned { gpu: gpu.clone(), plan: Arc::new(plan), memory, state: State::Outline(Box::new(outline)) }
    }

    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// See [`Prepared::give`].
    ///
    /// # Errors
    /// The device fails.
    pub fn give(&mut self, content: &[u8], to: &Lent, done: Option<Moment>) -> Result<()> {
        self.made(|_| Ok(()))?.executor.give_lent(content, UPLOAD, to, done)
    }

    /// The solve on the device, where nothing is under way. `first` runs when it is made.
    ///
    /// # Errors
    /// As [`OnDevice::new`].
    pub fn made(&mut self, first: impl FnOnce(&mut OnDevice) -> Result<()>) -> Result<&mut OnDevice> {
        if let State::Outline(outline) = &self.state {
            let model = (**outline).clone();
            let mut made = OnDevice::new(&self.gpu, model, self.plan.clone(), self.memory)?;
            first(&mut made)?;
            self.state = State::Made(Box::new(made));
        }
        let State::Made(job) = &mut self.state else { unreachable!("made above") };
        // A solve that failed or was cancelled may have left work behind.
        job.executor.settle()?;
        Ok(job)
    }
}
