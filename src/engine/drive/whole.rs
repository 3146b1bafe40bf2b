//! Runs of a few iterations as one block, without a report on the way: several may be under way on one device.

use std::ops::Range;

use super::reader::Reader;
use super::steps::Steps;
use super::{stage_values, watch::TracePoint};
use crate::Result;
use crate::engine::on_device::{Lists, OnDevice};
use crate::gpu::Ticket;
use crate::transport::kernels::buffer;

/// Submits what is queued, and a run of these iterations at the first level.
///
/// # Errors
/// The device fails.
pub(crate) fn submit_whole(
    device: &mut OnDevice,
    steps: &Steps<'_>,
    iterations: Range<usize>,
) -> Result<Ticket> {
    let OnDevice { plan, queue, lists: Lists { block, .. }, executor, .. } = device;
    let level = steps.levels[0];
    // A run that failed may have left something.
    block.clear();
    queue.move_into(block);
    block.stage("start", &stage_values(&level, iterations.start));
    (steps.start)(block, plan);
    for i in iterations.clone() {
        block.stage("iteration", &stage_values(&level, i));
        (steps.iteration)(block, plan, &level, i);
    }
    (steps.last)(block, plan, iterations.end);
    let ticket = executor.submit(block)?;
    block.clear();
    Ok(ticket)
}

/// Waits for a run that [`submit_whole`] submitted; its last point.
///
/// # Errors
/// The device fails, or a loss is not finite.
pub(crate) fn read_whole(
    device: &mut OnDevice,
    steps: &Steps<'_>,
    ticket: Ticket,
    iterations: Range<usize>,
) -> Result<TracePoint> {
    let OnDevice { executor, lists: Lists { rows, .. }, .. } = device;
    executor.wait(ticket)?;
    executor.read_behind(ticket, buffer::TRACE, iterations.clone(), rows);
    let level = steps.levels[0];
    Reader::default().read(rows, iterations, &level, (steps.l1_weight)(&level), &steps.passes, [0.0; 2])
}
