//! Counts that lie in a caller's buffer on the device. They become the measurement there; the host only gets sums, bin by
//! bin: what it must know of counts to scale them, to take off their background, and to tell noise from light.

use super::on_device::{OnDevice, Uploads, upload};
use super::over_pairs::groups;
use super::passes::{INTAKE, TALLY};
use super::{LentRows, Plan};
use crate::capture::negative::quiet_bins;
use crate::gpu::caller::{Lent, Moment};
use crate::gpu::{Buffer, Gpu, Schedule};
use crate::transport::kernels::*;
use crate::transport::{Moments, Rows};
use crate::{Error, Result};

/// How counts lie in a buffer.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Format {
    /// 32-bit floats.
    #[default]
    F32,
    /// 32-bit unsigned integers.
    U32,
    /// 16-bit unsigned integers, two to a word, the first in its low half.
    U16,
}

impl Format {
    /// Bytes of so many counts, in whole words.
    pub fn bytes_of(self, counts: usize) -> u64 {
        let each = if self == Format::U16 { 2 } else { 4 };
        (counts as u64 * each).next_multiple_of(4)
    }

    fn word(self) -> u32 {
        match self {
            Format::F32 => COUNTS_F32,
            Format::U32 => COUNTS_U32,
            Format::U16 => COUNTS_U16,
        }
    }
}

/// A frame's counts in a caller's buffer: those of bin b of pair p are number `p * bins + b`.
#[derive(Clone)]
pub struct LentCounts {
    /// Where they are.
    pub counts: Lent,
    /// What they are.
    pub format: Format,
    /// They are there from this moment on; `None`: now.
    pub after: Option<Moment>,
    /// Brought about when they were copied: the caller may write the buffer again. Gone once that is under way.
    pub taken: Option<Moment>,
}

impl LentCounts {
    /// Gives the buffer back from the host, if that did not happen yet. No work on the device may use it.
    ///
    /// # Errors
    /// The device fails.
    pub(crate) fn release(&mut self, gpu: &Gpu) -> Result<()> {
        self.taken.take().map_or(Ok(()), |taken| gpu.signal(taken))
    }
}

impl LentRows {
    /// Rows of so many bins.
    pub fn of_bins(bins: usize) -> LentRows {
        LentRows { counts: bins, sum: 1 }
    }

    fn bins(&self) -> usize {
        self.counts.div_ceil(self.sum)
    }

    /// What kernels are told (`glsl/include/lent.glsl`).
    fn word(&self, format: Format) -> u32 {
        format.word() | (self.sum as u32) << 2 | (self.counts as u32) << 16
    }
}

/// What is known of counts on the device.
pub(super) struct Tally {
    /// Their sums.
    pub moments: Moments,
    /// The largest and the smallest.
    pub range: [f64; 2],
}

/// The numbers of pairs that sums are needed over, ascending.
fn ends(plan: &Plan) -> Vec<usize> {
    vec![plan.scene.pairs]
}

/// Slices of the pairs up to each of `ends`, from the end before: first pair, end, pairs of a slice, slices.
fn slices(ends: &[usize]) -> Vec<[usize; 4]> {
    let all = ends.last().copied().unwrap_or(0);
    // Each part rounds up once.
    let of_slice =
        all.div_ceil((TALLY_SLICES as usize - ends.len().min(TALLY_SLICES as usize - 1)).max(1)).max(1);
    let starts = std::iter::once(&0).chain(ends);
    starts.zip(ends).map(|(from, to)| [*from, *to, of_slice, (to - from).div_ceil(of_slice)]).collect()
}

/// Sums the `rows` in the buffer `from` over the pairs up to each of `ends`.
pub fn tally_of(s: &mut Schedule, from: Buffer, rows: LentRows, format: Format, ends: &[usize]) {
    let mut at = 0;
    for [first, last, of_slice, count] in slices(ends) {
        let turns = ((last - first) * rows.bins()) as u64;
        s.dispatch(&TALLY, [rows.bins().div_ceil(WORKGROUP as usize) as u32, count as u32, 1], turns)
            .bind(buffer::SOURCE, from)
            .with(Push {
                first: first as u32,
                last: last as u32,
                step: of_slice as u32,
                iteration: at as u32,
                flags: rows.word(format),
                ..Default::default()
            });
        at += count;
    }
}

/// Runs [`tally_of`], and adds up what it leaves.
fn tally(job: &mut OnDevice, from: Buffer, rows: LentRows, format: Format, ends: &[usize]) -> Result<Tally> {
    job.executor.run_once(|s| tally_of(s, from, rows, format, ends))?;
    let bins = rows.bins();
    let slices = slices(ends);
    let count: usize = slices.iter().map(|[.., count]| count).sum();
    let read: Vec<[f32; 4]> = job.executor.read(buffer::TALLY, ..count * bins);
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    let mut rows = read.chunks_exact(bins);
    let between = slices.iter().map(|[.., count]| {
        let mut sums = vec![[0.0; 2]; bins];
        for row in rows.by_ref().take(*count) {
            for (sum, [value, square, largest, smallest]) in sums.iter_mut().zip(row) {
                *sum = [sum[0] + f64::from(*value), sum[1] + f64::from(*square)];
                range = [range[0].max(f64::from(*largest)), range[1].min(f64::from(*smallest))];
            }
        }
        sums
    });
    let moments = Moments::of(ends, between.collect());
    Ok(Tally { moments, range })
}

/// Scales the counts in [`buffer::HISTOGRAMS`] and takes off `below`, into [`buffer::MEASURED`].
pub fn intake(
    s: &mut Schedule,
    plan: &Plan,
    rows: &Rows,
    lent: LentRows,
    format: Format,
    [factor, below]: [f64; 2],
) {
    s.set(buffer::ROWS, 0, (factor as f32).to_bits());
    s.set(buffer::ROWS, 1, (below as f32).to_bits());
    let counts = plan.scene.pairs * plan.scene.bins;
    s.dispatch(&INTAKE, groups(counts, WORKGROUP), counts as u64)
        .bind(buffer::SOURCE, buffer::HISTOGRAMS)
        .with(Push {
            first: rows.bins().start as u32,
            step: plan.scene.bins as u32,
            iteration: plan.scene.pairs as u32,
            flags: lent.word(format),
            ..Default::default()
        });
}

/// Calls `reserve` with every schedule that takes counts.
///
/// # Errors
/// Those of `reserve`.
pub(super) fn each(plan: &Plan, rows: &Rows, reserve: &mut dyn FnMut(&Schedule) -> Result<()>) -> Result<()> {
    for source in [buffer::HISTOGRAMS, buffer::MEASURED] {
        let of_source = |s: &mut Schedule| {
            tally_of(s, source, LentRows::of_bins(plan.scene.bins), Format::F32, &ends(plan));
        };
        reserve(&Schedule::of(of_source))?;
    }
    reserve(&Schedule::of(|s| {
        intake(s, plan, rows, LentRows::of_bins(plan.scene.bins), Format::F32, [1.0, 0.0])
    }))
}

/// Uploads which of a caller's rows are the model's.
///
/// # Errors
/// The device fails.
pub(super) fn upload_rows(job: &mut OnDevice, rows: &Rows) -> Result<()> {
    let words: Vec<u32> = [0, 0].into_iter().chain(rows.pairs().iter().map(|pair| *pair as u32)).collect();
    upload(&mut job.executor, buffer::ROWS, bytemuck::cast_slice(&words))
}

/// Takes the counts of a frame as the measurement, less their background if asked for. `scale`: of the counts, if it is not
/// to be that of these. Returns the share of noise in their energy. Gives the buffer back as soon as it was read, unless it
/// is to be kept.
///
/// # Errors
/// The counts cannot be used, or the device fails.
pub(super) fn take(
    job: &mut OnDevice,
    rows: &Rows,
    frame: &mut LentCounts,
    [background, keep]: [bool; 2],
    scale: Option<f64>,
) -> Result<f64> {
    let pairs = job.plan.scene.pairs_of_capture();
    let lent = job.plan.demand.lent.expect("the session was made for lent counts");
    let taken = frame.taken.filter(|_| !keep);
    job.executor.take_lent(&frame.counts, buffer::HISTOGRAMS, [frame.after, taken])?;
    if !keep {
        frame.taken = None;
    }
    let counts = tally(job, buffer::HISTOGRAMS, lent, frame.format, &[pairs])?;
    check(&counts)?;
    let sums = counts.moments.all();
    let mean: Vec<f64> = sums.iter().map(|[sum, _]| sum / pairs as f64).collect();
    let level = if background { quiet_bins(&mean).map_or(0.0, |(_, lowest)| lowest) } else { 0.0 };
    let scale = scale.unwrap_or(job.model.peak / counts.range[0]);
    // Photons: a count is its own variance, and an empty bin has that of the background.
    let empty = level.max(0.0);
    job.model.measured.clear();
    job.model.counts_per_unit = 1.0 / scale;
    job.model.variance = [scale, empty * scale * scale];
    let plan = job.plan.clone();
    upload_measurement(job, |s| intake(s, &plan, rows, lent, frame.format, [scale, level * scale]))?;
    let ends = ends(&plan);
    let own = LentRows::of_bins(job.model.bins);
    job.model.moments = Some(tally(job, buffer::MEASURED, own, Format::F32, &ends)?.moments);
    Ok(noise(sums, pairs, level))
}

/// Leaves the measurement by `intake`, and the scenes.
fn upload_measurement(job: &mut OnDevice, intake: impl FnOnce(&mut Schedule)) -> Result<()> {
    let OnDevice { plan, model, executor, .. } = job;
    let mut all = Uploads::begin(executor)?;
    all.add_scenes(plan, model)?;
    all.then(intake);
    all.run()
}

/// The variance of photons over their squared counts without background; 1 without light. `sums`: `[bin]`, of so many pairs.
fn noise(sums: &[[f64; 2]], pairs: usize, background: f64) -> f64 {
    let (mut variance, mut energy) = (0.0, 0.0);
    for [sum, squares] in sums {
        let light = sum - pairs as f64 * background;
        variance += light + pairs as f64 * background.max(0.0);
        energy += squares - background * (sum + light);
    }
    if energy > 0.0 { (variance / energy).clamp(0.0, 1.0) } else { 1.0 }
}

fn check(counts: &Tally) -> Result<()> {
    let sums = counts.moments.all();
    if let Some(bin) = sums.iter().position(|[sum, squares]| !(sum.is_finite() && squares.is_finite())) {
        return Err(Error::input(
            format!("bin {bin}: a count of the frame is not finite, or beyond 1e19"),
            "check that the buffer holds counts in the format that was named",
        ));
    }
    let [largest, smallest] = counts.range;
    if smallest < 0.0 {
        return Err(Error::input(
            format!("the smallest count of the frame is {smallest}"),
            "counts in a buffer must be photon counts: leave their background in, or submit them from the host",
        ));
    }
    if largest <= 0.0 {
        return Err(Error::input(
            "there is no signal: all counts of the frame are zero",
            "check the gate, and that the counts are written before the moment that was named",
        ));
    }
    Ok(())
}

/// Whether counts of a scan can lie in a caller's buffer.
///
/// # Errors
/// They are no photon counts, or rows are too long.
pub(crate) fn check_scan(is_photons: bool, rows: LentRows) -> Result<()> {
    if rows.counts >= 1 << 16 || rows.sum >= 1 << 14 {
        return Err(Error::options(
            format!("rows of {} counts in a buffer, {} of them for a bin", rows.counts, rows.sum),
            "lend fewer than 65536 counts for a pair, with fewer than 16384 for a bin",
        ));
    }
    if is_photons {
        return Ok(());
    }
    Err(Error::options(
        "counts in a buffer are to be photon counts: the noise of others is estimated on the host",
        "set `integer_counts` of the scan if they are, or submit counts from the host",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_cover_every_pair_once_and_fit() {
        for ends in
            [vec![1], vec![64], vec![65, 1024], vec![256, 1024, 4096], vec![1, 2, 65_536], (1..100).collect()]
        {
            let all = slices(&ends);
            let mut next = 0;
            for ([from, to, of_slice, count], end) in all.iter().zip(&ends) {
                assert_eq!((*from, to), (next, end));
                assert!(count * of_slice >= to - from && (count - 1) * of_slice < to - from, "{ends:?}");
                next = *to;
            }
            let count: usize = all.iter().map(|[.., count]| count).sum();
            assert!(count <= (TALLY_SLICES as usize).max(ends.len()), "{ends:?}: {count}");
        }
    }

    #[test]
    fn noise_is_that_of_the_counts_on_the_host() {
        // Counts 0, 4, 2, 0 and 1, 3, 2, 1 of two pairs.
        let sums = [[1.0, 1.0], [7.0, 25.0], [4.0, 8.0], [1.0, 1.0]];
        assert!((noise(&sums, 2, 0.0) - 13.0 / 35.0).abs() < 1e-12);
        // Half a count of background in each of eight bins: light 9, its squares 35 - 13 + 2.
        assert!((noise(&sums, 2, 0.5) - (9.0 + 4.0) / 24.0).abs() < 1e-12);
        assert_eq!(noise(&[[0.0; 2]; 4], 2, 0.0), 1.0);
    }
}
