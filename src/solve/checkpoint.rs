//! A solve's state between two iterations. A resumed solve ends with the same bits.
//!
//! Buffers are kept by their names and sizes in the plan. All are kept but those that a job uploads anew, so a new
//! buffer is part of the state without a change here. The trace that the driver has not read yet is kept too, so the
//! solve stops at the same iteration.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::on_device::OnDevice;
use super::plan::parts::{PART_MEASURED, PART_NOISE, PART_WALL};
use super::plan::{COLUMNS_HOST, UPLOAD};
use super::{Plan, TracePoint};
use crate::advice::{AdvicePart, advice};
use crate::gpu::{Buffer, BufferPlan, Place};
use crate::transport::kernels::buffer::{MEASURED, TRACE, WALL};
use crate::{Error, Result};

/// What a state belongs to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Version of the crate.
    pub version: String,
    /// Hash of histograms, wall and pulse, as the solver takes them.
    pub capture: u64,
    /// The solver's options.
    pub settings: BTreeMap<String, serde_json::Value>,
    /// Voxels, pitch and origin of every level's grid, and the kernels with their constants.
    pub plan: Vec<String>,
    /// Bytes of every buffer that is kept.
    pub buffers: BTreeMap<String, u64>,
}

/// State of a solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// What it belongs to.
    pub identity: Identity,
    /// Iterations done.
    pub iteration: usize,
    /// Index of the level of the last one.
    pub level: usize,
    /// First iteration of the block that was not submitted yet.
    pub first: usize,
    /// Active voxels in the last block that the driver had read.
    pub active: usize,
    /// Blocks that the driver had not read: first iteration, one past the last, level.
    pub pending: Vec<[usize; 3]>,
    /// Trace of the iterations that the driver has read.
    pub trace: Vec<TracePoint>,
    /// Active voxels times pairs so far.
    pub pairs: u64,
    /// Solve time so far, seconds.
    pub seconds: f64,
    /// Device time so far, seconds.
    pub gpu_seconds: f64,
    /// Content of every buffer that is kept, by name.
    pub buffers: BTreeMap<String, Vec<u8>>,
}

/// How a solve saves its state, and what it resumes from.
pub struct Keep<'k> {
    /// Save after every Nth iteration; 0: never.
    pub every: usize,
    /// Takes each state. An error ends the solve.
    pub save: &'k mut dyn FnMut(Checkpoint) -> Result<()>,
    /// The state to go on from, if any.
    pub from: Option<Checkpoint>,
}

/// What to save, and what the states belong to.
pub(super) struct Keeper<'k> {
    pub keep: Keep<'k>,
    pub identity: Identity,
}

/// Uploaded before every solve and never written on the device, or a copy of what is stored on the host.
const CONSTANT: [Buffer; 8] = [
    MEASURED,
    WALL,
    PART_MEASURED.at(0),
    PART_MEASURED.at(1),
    PART_WALL.at(0),
    PART_WALL.at(1),
    PART_NOISE.at(0),
    PART_NOISE.at(1),
];
/// The buffers that others are read and written through; nothing lives in them between iterations.
const DOWN: Buffer = COLUMNS_HOST;
const UP: Buffer = UPLOAD;

impl<'k> Keeper<'k> {
    /// `None` if nothing is to be saved or resumed.
    ///
    /// # Errors
    /// The state belongs to another solve.
    pub fn new(
        keep: Option<Keep<'k>>,
        job: &OnDevice,
        options: &impl Serialize,
    ) -> Result<Option<Keeper<'k>>> {
        let Some(keep) = keep.filter(|k| k.every > 0 || k.from.is_some()) else { return Ok(None) };
        let identity = Identity::of(job, options);
        if let Some(from) = &keep.from {
            from.identity.check(&identity)?;
        }
        Ok(Some(Keeper { keep, identity }))
    }

    pub fn is_due(&self, iteration: usize) -> bool {
        self.keep.every > 0 && iteration.is_multiple_of(self.keep.every)
    }
}

impl Identity {
    fn of(job: &OnDevice, options: &impl Serialize) -> Identity {
        let settings = match serde_json::to_value(options) {
            Ok(serde_json::Value::Object(all)) => all.into_iter().collect(),
            _ => BTreeMap::new(),
        };
        let mut hash = fnv(0xcbf2_9ce4_8422_2325, bytemuck::cast_slice(&job.model.measured));
        hash = fnv(hash, bytemuck::cast_slice(&job.model.wall.words()));
        if let Some(pulse) = &job.model.pulse {
            hash = fnv(hash, bytemuck::cast_slice(&pulse.weights));
            hash = fnv(hash, &pulse.before.to_le_bytes());
        }
        if let Some(rendered) = &job.model.rendered {
            hash = fnv(hash, bytemuck::cast_slice(&rendered.wall.words()));
            hash = fnv(hash, bytemuck::bytes_of(&rendered.spot.sigma));
        }
        let scene = |l: &super::Level| hash_of_scene(job, l);
        let grid = |l: &super::Level| format!("{:?} {:016x}", l.grid.n, scene(l));
        let plan = job.plan.levels.volume.iter().map(grid).chain(job.plan.variants()).collect();
        let version = env!("CARGO_PKG_VERSION").into();
        let living = job.plan.buffers.iter().filter(|b| lives(&job.plan, b));
        let buffers = living.map(|b| (b.buffer.to_string(), b.bytes)).collect();
        Identity { version, capture: hash, settings, plan, buffers }
    }

    /// Compares a saved identity with the `wanted` one.
    ///
    /// # Errors
    /// The first difference.
    fn check(&self, wanted: &Identity) -> Result<()> {
        let differs = |what: String, mend: &[AdvicePart]| Err(Error::options(what, mend));
        for (name, now) in &wanted.settings {
            let then = self.settings.get(name).unwrap_or(&serde_json::Value::Null);
            if then != now {
                return differs(
                    format!(
                        "the checkpoint was kept with {} = {then}, now it is {now}",
                        name.replace('_', "-")
                    ),
                    &advice!["resume with the options that it was kept with, or start without " Resume],
                );
            }
        }
        if self.capture != wanted.capture {
            return differs(
                "the checkpoint is of another capture, or of another part of it".into(),
                &advice!["resume with the capture, " Stride ", " Gate " and " Wall " that it was kept with, or start without " Resume],
            );
        }
        if self.version != wanted.version || self.plan != wanted.plan || self.buffers != wanted.buffers {
            return differs(
                format!(
                    "the checkpoint was kept by version {} for another grid or another kind of device",
                    self.version
                ),
                &advice!["resume with the same program, " Volume ", " DepthPitch " and " Device ", or start without " Resume],
            );
        }
        Ok(())
    }
}

fn hash_of_scene(job: &OnDevice, level: &super::Level) -> u64 {
    fnv(0, bytemuck::bytes_of(&job.model_of(level).scene_of(&level.grid, level.pairs)))
}

/// FNV-1a.
fn fnv(start: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(start, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3))
}

/// Whether a buffer's content lives from one iteration to the next.
fn lives(plan: &Plan, b: &BufferPlan) -> bool {
    let constant = CONSTANT.contains(&b.buffer) || plan.levels.volume.iter().any(|l| l.measured == b.buffer);
    b.buffer == TRACE || b.place == Place::Device && !constant || plan.changes_on_host(b.buffer)
}

/// The content of every buffer that lives from one iteration to the next. Waits for the device.
pub(super) fn download(job: &mut OnDevice) -> Result<BTreeMap<String, Vec<u8>>> {
    let mut all = BTreeMap::new();
    for b in job.plan.buffers.iter().filter(|b| lives(&job.plan, b)) {
        let content = if b.buffer == TRACE {
            job.executor.read::<u8>(TRACE, ..)
        } else {
            job.executor.download(b.buffer, DOWN)?
        };
        all.insert(b.buffer.to_string(), content);
    }
    Ok(all)
}

/// Restores a state.
///
/// # Errors
/// The device fails, or the state does not fit the plan.
pub(super) fn restore(job: &mut OnDevice, state: &Checkpoint) -> Result<()> {
    let (buffers, levels) = (&state.buffers, job.plan.levels.volume.len());
    let sound = |[from, to, level]: &[usize; 3]| from < to && *to <= state.iteration && *level < levels;
    let most = job.plan.demand.iterations[0];
    if state.iteration >= most || state.level >= levels || !state.pending.iter().all(sound) {
        return Err(Error::input(
            format!("the checkpoint is of iteration {} of {most}", state.iteration),
            advice!["it is damaged: start without " Resume],
        ));
    }
    for b in job.plan.buffers.iter().filter(|b| lives(&job.plan, b)) {
        if buffers.get(&b.buffer.to_string()).map(|content| content.len() as u64) != Some(b.bytes) {
            return Err(Error::input(
                format!("the checkpoint does not hold buffer `{}` of {} bytes", b.buffer, b.bytes),
                advice!["it is damaged: start without " Resume],
            ));
        }
    }
    let living: Vec<Buffer> =
        job.plan.buffers.iter().filter(|b| lives(&job.plan, b)).map(|b| b.buffer).collect();
    for buffer in living {
        let content = &buffers[&buffer.to_string()];
        if buffer == TRACE {
            job.executor.write(TRACE, content);
        } else {
            job.executor.restore(buffer, content, UP)?;
        }
    }
    Ok(())
}
