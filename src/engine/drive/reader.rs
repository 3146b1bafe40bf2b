//! Reads the device's trace: points, and faults.

use std::ops::Range;

use super::watch::TracePoint;
use crate::advice::advice;
use crate::engine::plan::{Level, Pass};
use crate::transport::kernels::*;
use crate::{Error, Kind, Result};

/// Reads the trace of finished blocks.
#[derive(Default)]
pub(crate) struct Reader {
    pub trace: Vec<TracePoint>,
    /// Active voxels times pairs, summed over iterations.
    pub pairs: u64,
}

impl Reader {
    /// Reads the `rows` of some iterations, all at `level`, and adds a point for the last one, which it returns.
    /// `seconds` are those of host and device.
    ///
    /// # Errors
    /// A fault of one of `passes`, or a loss that is not finite.
    pub fn read(
        &mut self,
        rows: &[[u32; TRACE_ROW as usize]],
        iterations: Range<usize>,
        level: &Level,
        l1_weight: f64,
        passes: &[&[&'static Pass]],
        [seconds, gpu_seconds]: [f64; 2],
    ) -> Result<TracePoint> {
        let (mut loss, mut data_loss) = (0.0, 0.0);
        let mut active = 0;
        for (i, row) in iterations.clone().zip(rows) {
            check_faults(row, i + 1, passes)?;
            active = row[TRACE_ACTIVE as usize] as usize;
            data_loss = f64::from(f32::from_bits(row[TRACE_DATA as usize]));
            let objective = f64::from(f32::from_bits(row[TRACE_OBJECTIVE as usize]));
            let l1 = f64::from(f32::from_bits(row[TRACE_L1 as usize]));
            loss = objective + l1_weight * l1;
            if !loss.is_finite() {
                return Err(Error::new(
                    Kind::Options,
                    format!("the loss is {loss} at iteration {}", i + 1),
                    advice!["check the capture (" [Capture] ")"],
                ));
            }
            self.pairs += (active * level.rendered.count) as u64;
        }
        let point = TracePoint {
            iteration: iterations.end,
            seconds,
            gpu_seconds,
            lateral: level.grid.n[0],
            pairs: level.pairs,
            active,
            active_ratio: active as f64 / level.grid.voxels() as f64,
            loss,
            data_loss,
        };
        self.trace.push(point);
        Ok(point)
    }
}

/// Looks for faults in rows of the trace.
///
/// # Errors
/// A row has a fault. The error names the iteration (from 1), the first pass in the order of an iteration, what is not
/// finite there, and what may fix it.
fn check_faults(
    row: &[u32; TRACE_ROW as usize],
    iteration: usize,
    passes: &[&[&'static Pass]],
) -> Result<()> {
    let bits = row[TRACE_FAULTS as usize];
    let all = passes.iter().copied().flatten().flat_map(|p| p.faults.iter().map(move |f| (p, f)));
    let Some((pass, fault)) = all.filter(|(_, f)| bits & f.bit != 0).min_by_key(|(_, f)| f.bit) else {
        return Ok(());
    };
    let loss = f32::from_bits(row[TRACE_OBJECTIVE as usize]);
    let (kernel, what) = (pass.kernel, fault.what);
    Err(Error::new(
        Kind::Options,
        format!(
            "iteration {iteration}: kernel {kernel}: {what} is beyond single precision or no number; the loss is {loss}"
        ),
        fault.hint,
    ))
}
